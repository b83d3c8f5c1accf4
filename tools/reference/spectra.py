"""Cases of recordings of many frequencies: a motion that repeats on a rig, and ratios that are exact polynomials."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mpmath import mp, mpc, mpf

from reference.cases import OPERATIONS, ROUND_OFF, parts, value_row
from reference.physics import J

_RATE = 100
#: The motion that repeats: samples of a period, number of periods, and its harmonics of 2 Hz in the band.
_PERIOD, _PERIODS, _HARMONICS = 50, 24, range(3, 11)
#: Springs [N/m], damper [N s/m], moving mass [kg] and its spring [N/m].
_K1, _K2, _C, _MASS, _K3 = mpf(120000), mpf(90000), mpf(800), mpf(15), mpf(12440)
#: Length of the record whose ratios are polynomials, its lines of 0.1 Hz, and the powers of the frequency.
_COUNT, _LINES = 1000, range(85, 316)
#: A sample below this is zero: what is left is the round-off of 50 digits.
_NOTHING = mpf(10) ** -40
_FORCE, _BEYOND = (mpf(200), mpc(0, 3), mpf("-0.05")), (mpf("0.4"), mpc(0, "0.01"), mpf("-0.0002"))


def spectra() -> Iterator[dict[str, Any]]:
    """Random excitation that repeats, and a record of many lines as of a sweep."""
    yield _repeated()
    yield _polynomial()


def _phase(at: int, count: int) -> mpc:
    """A phase that keeps the peaks of a sum of sines low."""
    return mp.expj(-mp.pi * at * at / count)


def _stiffness(omega: mpf) -> mpc:
    arm = J * omega * _C
    return _K1 + arm * _K2 / (arm + _K2)


def _repeated() -> dict[str, Any]:
    """The force and both velocities of a specimen under a mass on a spring, by the balance of forces at the mass."""
    rows: dict[str, list[mpf]] = {role: [mpf(0)] * _PERIOD for role in ("force_in", "motion_in", "motion_out")}
    for order in _HARMONICS:
        f = mpf(2 * order)
        omega = 2 * mp.pi * f
        stiffness, contact = _stiffness(omega), mpf("0.01") * _phase(order, len(_HARMONICS))
        wheel = stiffness * contact / (stiffness + _K3 - omega**2 * _MASS)
        force = stiffness * (contact - wheel) / (J * omega)  # the amplitudes of the motions are velocities
        for role, amplitude in zip(rows, (force, contact, wheel), strict=True):
            for at in range(_PERIOD):
                rows[role][at] += (amplitude * mp.expj(2 * mp.pi * f * at / _RATE)).real
    values = []
    for order in (3, 6, 10):
        true = _stiffness(4 * mp.pi * order)
        values += [
            value_row(f"{name} at {2 * order} Hz", "N/m", one, OPERATIONS * _PERIOD * _PERIODS * ROUND_OFF * abs(true))
            for name, one in parts("K*", true).items()
        ]
    return {
        "check": "spectra of recordings",
        "function": "core.spectra.random.random_amplitudes",
        "about": "a motion that repeats",
        "inputs": {"rate": float(_RATE), "periods": _PERIODS, "low": 6.0, "high": 20.0},
        "series": {role: [float(one) for one in samples] for role, samples in rows.items()},
        "values": values,
    }


def _at(terms: tuple[mpc, ...], f: mpf) -> mpc:
    return sum(term * f**power for power, term in enumerate(terms))


def _polynomial() -> dict[str, Any]:
    """F1 and V2 are V1 times polynomials of second order in the frequency."""
    turns = [mp.expjpi(mpf(2 * at) / _COUNT) for at in range(_COUNT)]  # the record is one turn of a line of 0.1 Hz
    cosines, sines = [one.real for one in turns], [one.imag for one in turns]
    series: dict[str, list[float]] = {}
    for role, terms in (("force_in", _FORCE), ("motion_in", (mpf(1),)), ("motion_out", _BEYOND)):
        lines = [_phase(at - _LINES[0], len(_LINES)) * _at(terms, mpf(at) / 10) for at in _LINES]
        parts_of_lines = [one.real for one in lines] + [-one.imag for one in lines]
        series[role] = []
        for at in range(_COUNT):
            places = [at * line % _COUNT for line in _LINES]
            moment = [cosines[place] for place in places] + [sines[place] for place in places]
            series[role].append(float(mp.chop(mp.fdot(parts_of_lines, moment), _NOTHING)))
    values = []
    for tenths in (110, 194):
        f = mpf(tenths) / 10
        for name, terms in (("F1/V1", _FORCE), ("V2/V1", _BEYOND)):
            true = _at(terms, f)
            values += [
                value_row(
                    f"{part} at {float(f):g} Hz", "N s/m" if name == "F1/V1" else "1", one,
                    OPERATIONS * _COUNT * ROUND_OFF * abs(true),
                )
                for part, one in parts(name, true).items()
            ]  # fmt: skip
    return {
        "check": "spectra of recordings",
        "function": "core.spectra.sweep.sweep_amplitudes",
        "about": "ratios that are polynomials",
        "inputs": {"rate": float(_RATE), "periods": 1, "low": 10.0, "high": 30.0},
        "series": series,
        "values": values,
    }
