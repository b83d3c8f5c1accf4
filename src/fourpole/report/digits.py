"""Numbers as a person reads them: as many digits as are known."""

from __future__ import annotations

import math
from collections.abc import Iterable

__all__ = ["distinct", "known", "number", "spread", "with_std"]

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
#: As many values are listed one by one; more are given as a range.
_LISTED = 8


def known(value: object) -> float | None:
    """A finite number, or None."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def number(value: object, digits: int = 4) -> str:
    """A number to some significant digits; blank where there is none.

    >>> number(9.98918), number(-0.00012345, 3), number(1.5e9), number(None)
    ('9.989', '−0.000123', '1.500×10⁹', '')
    """
    found = known(value)
    if found is None:
        return ""
    if found == 0:
        return "0"
    power = _power(found, digits)
    if -4 <= power < 7:
        return _fixed(found, digits - 1 - power)
    return f"{_fixed(found / 10.0**power, digits - 1)}×10{str(power).translate(_SUPERSCRIPT)}"


def with_std(value: object, std: object, digits: int = 4) -> tuple[str, str]:
    """A number and its standard uncertainty, both to the second digit of the latter; that is blank where it is unknown.

    >>> with_std(172.3482, 0.619), with_std(1105.36, 66.7), with_std(0.30366, None)
    (('172.35', '0.62'), ('1105', '67'), ('0.3037', ''))
    """
    found, spread_of_it = known(value), known(std)
    if found is None or not spread_of_it or spread_of_it < 0:
        return number(found, digits), ""
    decimals = 1 - _power(spread_of_it, 2)
    if decimals > 9 or abs(found) >= 1e7:
        return number(found, digits), number(spread_of_it, 2)
    return _fixed(found, decimals), _fixed(spread_of_it, decimals)


def _power(value: float, digits: int) -> int:
    """Power of ten of a number once it is rounded."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2])


def _fixed(value: float, decimals: int) -> str:
    text = f"{value:.{max(0, decimals)}f}".replace("-", "−")
    return text.lstrip("−") if not text.strip("−0.") else text


def distinct(values: Iterable[object], tolerance: float) -> list[float]:
    """Rising values, those within a relative tolerance of the first of their kind taken as one: their mean.

    >>> distinct([10.01, 12.0, 9.99, None], 0.01)
    [10.0, 12.0]
    """
    groups: list[list[float]] = []
    for value in sorted(found for value in values if (found := known(value)) is not None):
        if groups and value - groups[-1][0] <= tolerance * abs(groups[-1][0]):
            groups[-1].append(value)
        else:
            groups.append([value])
    return [sum(group) / len(group) for group in groups]


def spread(values: Iterable[object], unit: str, *, scale: float = 1.0, tolerance: float = 0.01) -> str:
    """Few values one by one, many as a range.

    >>> spread([1e5, 1.7e5, 1.7e5], "bar", scale=1e5), spread(range(1, 20), "Hz"), spread([], "N")
    ('1, 1.7 bar', '1 to 19 Hz (19 values)', '')
    """
    found = [f"{value / scale:.4g}".replace("-", "−") for value in distinct(values, tolerance)]
    if not found:
        return ""
    if len(found) <= _LISTED:
        return f"{', '.join(found)} {unit}"
    return f"{found[0]} to {found[-1]} {unit} ({len(found)} values)"
