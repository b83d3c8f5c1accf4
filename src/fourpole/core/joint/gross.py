"""Gross errors of a statement, which no small change of a value explains: a unit, a sign, exchanged columns."""

from __future__ import annotations

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.joint.misfit import Candidate, larger_part
from fourpole.core.joint.model import Observed
from fourpole.core.joint.shared import Shared
from fourpole.core.sources import Kind, Source

#: A ratio of F1 to what V2 and the rig need is gross beyond these: its logarithm [1], its angle [rad].
_GROSS, _TURNED = 0.25, 0.5
#: A factor or an exchange is recognised if the ratio is this close to it, in logarithm and angle.
_NEAR = 0.15
#: Tests in which Zr is below this share of its largest part are close to the rig's resonance, and are not used.
_RESONANT = 0.2
#: Share of the tests that must agree.
_MOST = 0.7
#: Factors by which F1 must be multiplied after a mistake of a unit, with the words for the mistake in F1 or V2.
_FACTORS = {
    9.80665: "9.81 times too small, as kgf read as N is, or V2 as much too large",
    1 / 9.80665: "9.81 times too large, as N read as kgf is, or V2 as much too small, as g read as m/s² is",
    1e3: "1000 times too small, as kN read as N is, or V2 as much too large, as mm read as m is",
    1e-3: "1000 times too large, as N read as kN is, or V2 as much too small, as m read as mm is",
}


def gross_errors(observed: Observed, shared: Shared) -> list[Candidate]:
    """The gross errors of F1 and V2 that most tests show; empty for none.

    Parameters
    ----------
    observed : Observed
        The tests, sorted or not.
    shared : Shared
        The rig and the masses as stated.
    """
    force, contact, wheel = observed.amplitudes.T
    impedance = _impedance(observed, shared)
    input_force = 1j * observed.omega * shared.rig.input_mass * contact
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (force - input_force) / (impedance * wheel)
        exchanged = force / (impedance * contact)
    used = np.isfinite(ratio) & (ratio != 0) & (force != 0) & _off_resonance(observed, shared, impedance)
    if not used.any():
        return []
    other = exchanged[used]
    swapped = bool(np.all(np.isfinite(other))) and _is_one(*_middle(other)) and _agree(other)
    size, angle = _middle(ratio[used])
    if swapped and not (_is_one(size, angle) and _agree(ratio[used])):
        return [_gross("V1", "V1 and V2 exchanged: their columns, or the sensors", 1.0)]
    if not _agree(ratio[used]) or (abs(np.log(size)) < _GROSS and abs(angle) < _TURNED):
        return []
    return [_gross(of, text, size) for of, text in _words(size, angle)]


def _impedance(observed: Observed, shared: Shared) -> ComplexArray:
    """Zr of each test as stated (N,) [N s/m]."""
    return np.asarray(shared.rig.impedance(observed.omega, observed.added(shared.masses)))


def _off_resonance(observed: Observed, shared: Shared, impedance: ComplexArray) -> np.ndarray:
    """Flags (N,) of the tests in which Zr is not much smaller than its mass and spring."""
    return np.asarray(np.abs(impedance) > _RESONANT * larger_part(impedance, observed.omega, shared.rig))


def _middle(ratio: ComplexArray) -> tuple[float, float]:
    """Median size of ratios, and the angle of their mean direction [rad]."""
    turned = np.mean(ratio / np.abs(ratio))
    return float(np.median(np.abs(ratio))), float(np.angle(turned))


def _agree(ratio: ComplexArray) -> bool:
    """Whether most ratios are close to their middle."""
    size, angle = _middle(ratio)
    off: FloatArray = np.abs(np.log(ratio / (size * np.exp(1j * angle))))
    return bool(np.mean(off < 2 * _NEAR) > _MOST)


def _is_one(size: float, angle: float) -> bool:
    return abs(np.log(size)) < _NEAR and abs(angle) < _NEAR


def _words(size: float, angle: float) -> list[tuple[str, str]]:
    """Channel and words of the errors that give a ratio of this size and angle."""
    turned = abs(abs(angle) - np.pi) < _NEAR
    sign = " with its sign inverted," if turned else ""
    for factor, words in _FACTORS.items():
        if abs(np.log(size * factor)) < _NEAR and (turned or abs(angle) < _NEAR):
            return [("F1", f"F1{sign} {words}"), ("V2", f"a unit of V2{sign} off by as much")]
    if turned and abs(np.log(size)) < _NEAR:
        return [("F1", "F1 with its sign inverted (times -1)"), ("V2", "V2 with its sign inverted (times -1)")]
    off = f"{size:.3g} times, and {np.degrees(angle):.0f} degrees off, what {{}} and the rig need"
    return [("F1", "F1 " + off.format("V2")), ("V2", f"V2 {1 / size:.3g} times what F1 and the rig need")]


def _gross(of: str, text: str, size: float) -> Candidate:
    """A gross error of a channel, whose factor is `size`; it counts as the cause of all of chi-square."""
    return Candidate(f"sensor {of}", size - 1, 0.0, "1", np.inf, Source(Kind.GAIN, of), size - 1, text)
