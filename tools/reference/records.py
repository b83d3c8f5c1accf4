"""Cases of whole records: load-deflection curves that are polynomials, and recordings of known tones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from mpmath import mp, mpc, mpf

from reference.cases import OPERATIONS, ROUND_OFF, parts, value_row
from reference.physics import J, Network

#: A static curve: mean of the branches P(x) and half their gap H(x), by powers of x, with x up to the stroke [m].
_STROKE = mpf("0.03")
_MEAN = (mpf(0), mpf("150e3"), mpf("1.1e6"), mpf("-8e6"))
_HALF_GAP = (mpf(0), mpf("4000"), -mpf("4000") / _STROKE)
_POINTS, _CYCLES = 40, 3
#: Conditioning of the fits: of a cubic over its stroke, of a sine with its harmonics, and of the derivative of a cubic.
_OF_FIT = mpf(10) ** 4


def _poly(terms: Sequence[mpf], x: mpf) -> mpf:
    return mp.polyval(list(reversed(terms)), x)


def curves() -> Iterator[dict[str, Any]]:
    """K1 of both branches and of their mean, gap, secant and loss of a curve that is an exact polynomial."""
    branch = [_STROKE * mpf(at) / _POINTS for at in range(_POINTS + 1)]
    up = [(x, _poly(_MEAN, x) + _poly(_HALF_GAP, x)) for x in branch]
    down = [(x, _poly(_MEAN, x) - _poly(_HALF_GAP, x)) for x in reversed(branch)]
    points = (up + down[1:-1]) * _CYCLES + up[:1]
    series = {"deflection": [float(x) for x, _ in points], "load": [float(f) for _, f in points]}
    for load in (1000, 3200):
        place = mp.findroot(lambda x, load=load: _poly(_MEAN, x) - load, _STROKE / 3, tol=mpf(10) ** -100)
        mean, apart = (mp.diff(lambda x, terms=terms: _poly(terms, x), place) for terms in (_MEAN, _HALF_GAP))
        found = {
            "K1": ("N/m", mean),
            "K1 loading": ("N/m", mean + apart),
            "K1 unloading": ("N/m", mean - apart),
            "branch gap": ("N", 2 * _poly(_HALF_GAP, place)),
            "secant": ("N/m", load / place),
        }
        rows = [value_row(name, unit, one, _OF_FIT * ROUND_OFF * abs(mean if unit == "N/m" else load))
                for name, (unit, one) in found.items()]  # fmt: skip
        loss = 2 * mp.quad(lambda x: _poly(_HALF_GAP, x), [0, _STROKE])
        # the loop is summed as a polygon: its error is bounded by h^2/12 times the stroke times the largest bend
        bend = 2 * abs(2 * _HALF_GAP[2])
        rows.append(
            value_row("hysteresis loss", "J", loss, (_STROKE / _POINTS) ** 2 / 12 * _STROKE * bend * mpf("1.01"))
        )
        yield {
            "check": "static curve", "function": "core.loadcurve.LoadCurve", "inputs": {"at": load}, "series": series,
            "values": rows,
        }  # fmt: skip


def _tone(amplitude: mpc, frequency: mpf, time: mpf) -> mpf:
    return (amplitude * mp.expj(2 * mp.pi * frequency * time)).real


def recordings() -> Iterator[dict[str, Any]]:
    """Recordings of tones whose amplitudes are known: offsets, harmonics, delays, filters, rates of their own."""
    yield _recording(
        "offset and harmonics", 10.3, 500.0, 450,
        {
            "force_in": {"quantity": "force", "true": mpc(310, 55), "offset": 1040, "second": 6, "third": 3},
            "motion_in": {"quantity": "velocity", "true": mpc(0.061, -0.013), "offset": 0.002},
            "motion_out": {"quantity": "acceleration", "true": mpc(0.07, -0.021), "second": 0.4},
        },
    )  # fmt: skip
    yield _recording(
        "delays and filters", 14.7, 600.0, 480,
        {
            "force_in": {"quantity": "force", "true": mpc(220, -140), "low pass": (120.0, 2), "high pass": (0.5, 1)},
            "motion_in": {"quantity": "displacement", "true": mpc(0.02, 0.09), "delay": 1.3e-3},
            "motion_out": {"quantity": "velocity", "true": mpc(0.11, -0.04), "geophone": (4.5, 0.56), "delay": -4e-4},
        },
    )  # fmt: skip
    yield _recording(
        "rates and starts of their own", 22.4, 400.0, 320,
        {
            "force_in": {"quantity": "force", "true": mpc(150, 200), "rate": 1000.0, "offset": 800, "delay": 2e-4},
            "motion_in": {"quantity": "velocity", "true": mpc(0.08, 0.0)},
            "motion_out": {"quantity": "displacement", "true": mpc(-0.03, 0.05), "start": 0.0007},
        },
    )  # fmt: skip


def _recording(
    name: str, frequency: float, rate: float, count: int, channels: dict[str, dict[str, Any]]
) -> dict[str, Any]:
    """A recording and its amplitudes; the velocities and the force are the true ones, at the contact and beyond."""
    f = mpf(frequency)
    stated: dict[str, Any] = {}
    series: dict[str, list[float]] = {}
    for role, one in channels.items():
        own, start = mpf(one.get("rate", rate)), mpf(one.get("start", 0.0))
        samples = []
        response = _response(one, f)
        power = {"force": 0, "velocity": 0, "displacement": -1, "acceleration": 1}[one["quantity"]]
        for at in range(int(count * own / mpf(rate))):
            time = start + at / own
            value = _tone(one["true"] * (2j * mp.pi * f) ** power * response, f, time) + one.get("offset", 0)
            for order, key in ((2, "second"), (3, "third")):
                value += _tone(mpc(one.get(key, 0)) * mp.expj(mpf("0.4") * order), order * f, time)
            samples.append(float(value))
        series[role] = samples
        stated[role] = {key: one[key] for key in one if key not in ("true", "offset", "second", "third")}
    true = [channels[role]["true"] for role in ("force_in", "motion_in", "motion_out")]
    found = {
        **{key: ("m/(N s)", one) for key, one in parts("V1/F1", true[1] / true[0]).items()},
        **{key: ("1", one) for key, one in parts("V2/V1", true[2] / true[1]).items()},
        "|F1|": ("N", abs(true[0])),
        "frequency": ("Hz", f),
    }
    sizes = {"m/(N s)": abs(true[1] / true[0]), "1": abs(true[2] / true[1]), "N": abs(true[0]), "Hz": f}
    return {
        "check": "amplitudes of recordings",
        "function": "core.demodulation.demodulate",
        "about": name,
        "inputs": {"rate": rate},
        "channels": stated,
        "series": series,
        "values": [value_row(key, unit, one, OF_SINE * sizes[unit]) for key, (unit, one) in found.items()],
    }


#: Round-off of sums over the samples of a recording, for a tone in an offset of a few times its size.
OF_SINE = OPERATIONS * 480 * ROUND_OFF


def _response(one: dict[str, Any], f: mpf) -> mpc:
    """Recorded over true amplitude of the chain of a channel."""
    found = mp.expj(-2 * mp.pi * f * mpf(one.get("delay", 0.0)))
    if "low pass" in one:  # second order: a mass on a spring with the damping 1/sqrt(2)
        s = J * f / mpf(one["low pass"][0])
        found /= 1 + mp.sqrt(2) * s + s * s
    if "high pass" in one:  # a capacitor and a resistor
        s = J * f / mpf(one["high pass"][0])
        found *= s / (1 + s)
    if "geophone" in one:
        own, damping = 2 * mp.pi * mpf(one["geophone"][0]), mpf(one["geophone"][1])
        omega = 2 * mp.pi * f
        suspension = own**2 + J * omega * 2 * damping * own
        found *= (
            1
            - Network(omega)
            .mass("mass", mpf(1))
            .link("mass", None, suspension)
            .displacements({"mass": suspension})["mass"]
        )
    return found
