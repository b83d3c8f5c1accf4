"""Verdict rows: what was looked at, what was found, the limit, whether it passed, and what to do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.demodulation.demodulate import Demodulation
from fourpole.core.demodulation.spectrum import LINE_GAP, off_multiples
from fourpole.core.phasor import Phasors
from fourpole.core.recording import Channel
from fourpole.core.rig import Rig

__all__ = [
    "Check",
    "check_clipping",
    "check_consistency",
    "check_distortion",
    "check_excitation",
    "check_frequency",
    "check_gaps",
    "check_lift_off",
    "check_mains",
    "check_noise",
    "check_resonance",
    "remarked",
    "worst_verdict",
]

#: Departure of F1 from Zr V2 that no honest calibration explains.
_INCONSISTENT = 0.2
#: From best to worst.
VERDICTS = ("ok", "warning", "rejected")


@dataclass(frozen=True)
class Check:
    """One check of one test.

    Attributes
    ----------
    name : str
        What was looked at.
    statistic, limit : float
        What was found, and where it starts to matter, in the same unit.
    verdict : {"ok", "warning", "rejected"}
        What follows.
    remark : str
        Cause and remedy; empty where ok.
    """

    name: str
    statistic: float
    limit: float
    verdict: str
    remark: str = ""


def worst_verdict(verdicts: Iterable[str]) -> str:
    """The worst of several verdicts; ok for none.

    Examples
    --------
    >>> worst_verdict(["ok", "rejected", "warning"])
    'rejected'
    """
    return max(verdicts, key=VERDICTS.index, default="ok")


def remarked(name: str, verdict: str, remark: str) -> Check:
    """A check that has no statistic, only a verdict and what to say."""
    return Check(name, float("nan"), float("nan"), verdict, remark)


def _graded(
    name: str, statistic: float, warn: float, reject: float, remark: str, rejected_remark: str | None = None
) -> Check:
    if statistic > reject:
        return Check(name, statistic, reject, "rejected", rejected_remark or remark)
    if statistic > warn:
        return Check(name, statistic, warn, "warning", remark)
    return Check(name, statistic, warn, "ok")


def check_frequency(found: float, stated: float | None) -> Check:
    """Hold the stated frequency against the estimate: within 1 % ok, to 5 % a warning, beyond rejected."""
    off = 0.0 if not stated else abs(found - stated) / stated
    remark = (
        ""
        if stated is None
        else f"the recording turns at {found:.5g} Hz, {stated:.5g} Hz is stated ({off:.1%} off): "
        "correct the frequency in tests.csv, or check that this is the right file"
    )
    return _graded("stated frequency", off, 0.01, 0.05, remark)


def check_lift_off(force_peak: float, preload: float | None) -> Check:
    """Compare the dynamic force, harmonics included, with the preload: the tyre must stay on the cam."""
    share = 0.0 if preload is None else force_peak / preload if preload > 0 else np.inf
    remark = (
        f"the dynamic force reaches {force_peak:.4g} N, {share:.0%} of the preload of {preload or 0:.4g} N: "
        "{0}; test with a higher preload or a smaller excitation"
    )
    return _graded(
        "lift-off",
        share,
        0.9,
        1.0,
        remark.format("the tyre is close to lifting off"),
        remark.format("the tyre lifts off"),
    )


def check_clipping(name: str, channel: Channel) -> Check:
    """Look for samples that stand at the end of the converter's range, stated or seen as flat tops."""
    share = clipped_share(channel)
    remark = (
        f"{name} is clipped: {share:.1%} of its samples stand at the end of its range; "
        "set a larger range on the amplifier and repeat the test"
    )
    return Check(f"clipping of {name}", share, 0.0, "rejected" if share > 0 else "ok", remark if share > 0 else "")


def clipped_share(channel: Channel) -> float:
    """Share of the samples at the full scale, or in flat tops that no sine with this resolution would have."""
    if channel.clipped is not None:
        return channel.clipped
    samples = channel.samples[np.isfinite(channel.samples)]
    if samples.size == 0:
        return 0.0
    if channel.limits is not None:
        low, high = channel.limits
        tolerance = 1e-4 * (high - low)
        at_limit = float(np.mean((samples <= low + tolerance) | (samples >= high - tolerance)))
        if at_limit > 0:
            return at_limit
    return sum(_flat_share(sign * samples) for sign in (1.0, -1.0))


def _flat_share(samples: FloatArray) -> float:
    """Share of the samples that equal the largest, where they are far more than the top of a sine would hold."""
    top = samples.max()
    at_top = samples == top
    count = int(at_top.sum())
    longest = int(np.max(np.diff(np.flatnonzero(np.concatenate([[True], ~at_top, [True]]))))) - 1
    if count < 6 or longest < 3:
        return 0.0
    below = samples[~at_top]
    if below.size == 0:
        return 0.0
    # Within one step of the converter below the top a sine of this size spends acos(1 - step/amplitude)/pi of its time.
    step = float(np.min(np.diff(np.unique(samples))))
    amplitude = 0.5 * float(np.ptp(samples))
    expected = np.arccos(max(1.0 - step / amplitude, -1.0)) / np.pi
    share = count / samples.size
    return share if share > 3.0 * expected + 2.0 / samples.size else 0.0


def check_distortion(found: Demodulation) -> Check:
    """Look at the harmonics of the motion at the contact: the cam should move as a sine."""
    worst = float(found.distortion[1])
    remark = (
        f"harmonics of the displacement at the contact are {worst:.0%} of the fundamental: "
        "look at the cam, the contact and the frequency; the tyre may behave non-linearly"
    )
    return _graded("distortion", worst, 0.2, np.inf, remark)


def check_noise(found: Demodulation, names: tuple[str, ...]) -> list[Check]:
    """Compare what the fit leaves with the fundamental, channel by channel."""
    rows = []
    for name, ratio in zip(names, found.noise_ratio, strict=True):
        if np.isfinite(ratio):
            remark = (
                f"what the fit leaves of {name} is {ratio:.0%} of the fundamental: noise, an unsteady speed, or loose "
                "parts; look at the signal, record longer, or steady the drive"
            )
            rows.append(_graded(f"residual of {name}", float(ratio), 0.3, np.inf, remark))
    return rows


def check_excitation(found: Demodulation, names: tuple[str, ...]) -> list[Check]:
    """Ask whether there is a line at the frequency at all: amplitude over its own standard uncertainty."""
    rows = []
    for i, name in enumerate(names):
        amplitude = abs(complex(found.phasors.amplitudes[i]))
        if np.isfinite(amplitude):
            relative = float(found.phasors.std[2 * i : 2 * i + 2].max()) / amplitude if amplitude > 0 else np.inf
            remark = (
                f"{name} hardly moves at {float(found.phasors.frequency):.4g} Hz: the amplitude is known to "
                f"{relative:.0%} only; check the sensor, its column and the excitation"
            )
            rows.append(_graded(f"excitation of {name}", relative, 0.05, 0.2, remark))
    return rows


def check_mains(found: Demodulation) -> Check:
    """Ask whether the excitation lies on a multiple of the mains frequency, where hum cannot be told from it."""
    frequency = float(found.phasors.frequency)
    apart = min(float(off_multiples(frequency, base)) for base in (50.0, 60.0))
    remark = (
        f"{frequency:.4g} Hz lies on a multiple of the mains frequency: hum cannot be told from the excitation; "
        "test half a hertz beside it"
    )
    bins = apart * found.cycles / frequency
    return (
        Check("mains", bins, LINE_GAP, "warning", remark) if bins < LINE_GAP else Check("mains", bins, LINE_GAP, "ok")
    )


def check_gaps(found: Demodulation) -> Check:
    """Say how many samples were missing and left out."""
    remark = f"{100 * found.missing:.2g} % of the samples are missing and were left out of the fit; look at the logger"
    return _graded("missing samples", found.missing, 0.0, np.inf, remark)


def check_resonance(frequency: float, rig: Rig, added_mass: float) -> Check:
    """Ask how far the rig's own stiffness, K3 - m w², is from zero: there it follows freely and hides the tyre."""
    omega = 2 * np.pi * frequency
    if rig.blocked:
        return Check("rig resonance", 0.0, 20.0, "ok")
    impedance = complex(rig.impedance(omega, added_mass))
    spring, inertia = rig.preload_stiffness, omega**2 * (rig.moving_mass + rig.tyre_mass + added_mass)
    left = abs(omega * impedance) / max(spring, inertia)
    remark = (
        f"{frequency:.4g} Hz is the rig's own resonance (K3 = {spring:.4g} N/m, m w² = {inertia:.4g} N/m): it moves "
        "without force and the tyre cannot be seen; test at another frequency, or with another moving mass"
    )
    closeness = 1.0 / left if left > 0 else np.inf
    return _graded("rig resonance", closeness, 20.0, 100.0, remark)


def check_consistency(phasors: Phasors, rig: Rig, added_mass: float) -> Check:
    """Hold F1 against the force that V2 says the rig needs, F1 = Zr V2: the one relation that three sensors leave."""
    omega = 2 * np.pi * float(phasors.frequency)
    f1, v1, v2 = (complex(x) for x in phasors.amplitudes)
    needed = complex(rig.impedance(omega, added_mass)) * v2
    force = f1 - 1j * omega * rig.input_mass * v1
    if not (np.isfinite(force) and np.isfinite(needed)) or needed == 0:
        return Check("F1 against V2", float("nan"), _INCONSISTENT, "ok")
    ratio = force / needed
    remark = (
        f"F1 is {abs(ratio):.2f} times, and {np.degrees(np.angle(ratio)):.0f} degrees off, what V2 and the rig need: "
        "look for an inverted or wrongly scaled F1 or V2, an undeclared delay, or a wrong moving mass"
    )
    return _graded("F1 against V2", abs(ratio - 1.0), _INCONSISTENT, np.inf, remark)
