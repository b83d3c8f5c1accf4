"""Numbers as text, with as many digits as their uncertainty allows."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from fourpole.core.condition import Axis

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
#: Up to this number values are listed one by one; more are given as a range.
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
    """A number and its standard uncertainty, both to the second digit of the uncertainty; blank where unknown.

    >>> with_std(172.3482, 0.619), with_std(1105.36, 667.0), with_std(0.30366, None)
    (('172.35', '0.62'), ('1110', '670'), ('0.3037', ''))
    """
    found, u = known(value), known(std)
    if found is None or not u or u < 0:
        return number(found, digits), ""
    decimals = 1 - _power(u, 2)
    if decimals > 9 or abs(found) >= 1e7:
        return number(found, digits), number(u, 2)
    return _fixed(round(found, decimals), decimals), _fixed(round(u, decimals), decimals)


def expanded(value: float, std: float, coverage: float = 2.0) -> tuple[str, str]:
    """A number and its expanded uncertainty U, to the second digit of U if its first is 1 or 2, else to the first.

    >>> expanded(172.3482, 0.619), expanded(1105.36, 33.0), expanded(0.30366, 0.0)
    (('172.3', '1.2'), ('1110', '70'), ('0.3037', ''))
    """
    reach = coverage * std
    decimals = _decimals(reach)
    if decimals is None:
        return number(value), ""
    return _rounded(value, decimals), _rounded(reach, decimals)


def with_interval(value: float, low: float, high: float) -> tuple[str, str]:
    """A number and an interval about it that is skewed, to the digits that U would have.

    >>> with_interval(93.81, 93.42, 94.51), with_interval(50.0, 20.0, math.inf)
    (('93.8', '93.4 to 94.5'), ('50', 'above 20'))
    """
    decimals = _decimals(0.5 * (high - low))
    if decimals is None:
        return number(value, 2), f"above {number(low, 2)}" if math.isinf(high) else f"{number(low)} to {number(high)}"
    return _rounded(value, decimals), f"{_rounded(low, decimals)} to {_rounded(high, decimals)}"


def _decimals(reach: float) -> int | None:
    """Decimals of a number with an expanded uncertainty; None where this is zero or unknown."""
    if not 1e-9 < reach < 1e7:
        return None
    leading = f"{reach:.0e}"
    return -int(leading[2:]) + (leading[0] in "12")


def _rounded(value: float, decimals: int) -> str:
    return _fixed(round(value, decimals), decimals)


def _power(value: float, digits: int) -> int:
    """Power of ten of a number once it is rounded."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2])


def _fixed(value: float, decimals: int) -> str:
    text = f"{value:.{max(0, decimals)}f}".replace("-", "−")
    return text.lstrip("−") if not text.strip("−0.") else text


def spread(values: Iterable[object], axis: Axis, unit: str, *, scale: float = 1.0) -> str:
    """Up to eight values as a list, more as a range; values that are the same on an axis are replaced by their mean.

    >>> from fourpole.core.condition import FREQUENCY, PRESSURE
    >>> spread([1e5, 1.7e5, 1.71e5], PRESSURE, "bar", scale=1e5), spread(range(1, 20), FREQUENCY, "Hz")
    ('1, 1.705 bar', '1 to 19 Hz (19 values)')
    """
    stated = sorted(value for one in values if (value := known(one)) is not None)
    groups = axis.groups(stated)
    means = [sum(group) / len(group) for at in dict.fromkeys(groups) for group in [np.array(stated)[groups == at]]]
    found = [f"{mean / scale:.4g}".replace("-", "−") for mean in means]
    if not found:
        return ""
    if len(found) <= _LISTED:
        return f"{', '.join(found)} {unit}"
    return f"{found[0]} to {found[-1]} {unit} ({len(found)} values)"
