"""A reference case: inputs, expected values with 50 digits, and the tolerance that double precision allows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from mpmath import mp, mpc, mpf

from reference.physics import Numbers

#: Digits that are written, and round-off of one operation in double precision.
DIGITS, ROUND_OFF = 50, mpf(2) ** -53
#: No more than this number of operations lead from the inputs to a value.
OPERATIONS = 64
_STEP = mpf(10) ** -25


def parts(name: str, value: Any) -> dict[str, mpf]:
    """Real and imaginary part of a complex value under their names."""
    value = mpc(value)
    return {f"Re {name}": value.real, f"Im {name}": value.imag}


def numbers(inputs: Mapping[str, Any]) -> dict[str, mpf]:
    """Inputs as the doubles that the package will read, to the last bit."""
    return {name: mpf(float(value)) for name, value in inputs.items()}


def case(
    check: str,
    function: str,
    units: Mapping[str, str],
    inputs: Mapping[str, Any],
    physics: Callable[[Numbers], Mapping[str, mpf]],
    followed: Collection[str] = (),
) -> dict[str, Any]:
    """One case. A value may be off by the round-off of the operations, and by what that of the inputs does to it.

    The round-off of all inputs is followed, or of those of `followed`.
    """
    given = numbers(inputs)
    expected = physics(given)
    reach = {name: abs(value) for name, value in expected.items()}
    for name, value in given.items():
        if value and (not followed or name in followed):
            moved = physics({**given, name: value * (1 + _STEP)})
            for key in reach:
                reach[key] += abs((moved[key] - expected[key]) / _STEP)
    return {
        "check": check,
        "function": function,
        "inputs": {name: float(value) for name, value in given.items()},
        "values": [
            value_row(name, units[_bare(name)], value, OPERATIONS * ROUND_OFF * _scale(name, reach))
            for name, value in expected.items()
        ],
    }


def value_row(name: str, unit: str, value: mpf, tolerance: mpf) -> dict[str, str]:
    """A value as it is written: name, unit, 50 digits, and two digits of the tolerance."""
    return {
        "value": name,
        "unit": unit,
        "expected": mp.nstr(value, DIGITS, strip_zeros=True),
        "tolerance": mp.nstr(tolerance, 2),
    }


def _bare(name: str) -> str:
    """The name of a quantity whose real or imaginary part a value is."""
    return name.removeprefix("Re ").removeprefix("Im ")


def _scale(name: str, reach: Mapping[str, mpf]) -> mpf:
    """Size of a value for its round-off; that of a part is the one of the whole complex number."""
    bare = _bare(name)
    return mp.hypot(reach.get(f"Re {bare}", reach[name]), reach.get(f"Im {bare}", 0)) if bare != name else reach[name]
