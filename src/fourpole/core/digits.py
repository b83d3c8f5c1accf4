"""Numbers as text, with as many digits as their uncertainty allows."""

from __future__ import annotations

import math

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def known(value: object) -> float | None:
    """A finite number, or None."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def number(value: object, digits: int = 4) -> str:
    """A number to some significant digits; blank where there is none.

    >>> number(9.98918), number(-0.00012345, 3), number(1.5e9), number(None)
    ('9.989', '−0.000123', '1.500×10⁹', '')
    """
    finite = known(value)
    if finite is None:
        return ""
    if finite == 0:
        return "0"
    power = _power(finite, digits)
    if -4 <= power < 7:
        return fixed(finite, digits - 1 - power)
    return f"{fixed(finite / 10.0**power, digits - 1)}×10{str(power).translate(_SUPERSCRIPT)}"


def with_std(value: object, std: object, digits: int = 4) -> tuple[str, str]:
    """A number and its standard uncertainty, both to the second digit of the uncertainty; blank where unknown.

    >>> with_std(172.3482, 0.619), with_std(1105.36, 667.0), with_std(0.30366, None)
    (('172.35', '0.62'), ('1110', '670'), ('0.3037', ''))
    >>> with_std(1.04691e7, 4757580.0)
    ('1.047×10⁷', '4800000')
    """
    finite, u = known(value), known(std)
    if finite is None or not u or u < 0:
        return number(finite, digits), ""
    decimals = 1 - _power(u, 2)
    if decimals > 9 or abs(finite) >= 1e7:
        return number(finite, digits), number(round(u, decimals), 2)
    return fixed(round(finite, decimals), decimals), fixed(round(u, decimals), decimals)


def _power(value: float, digits: int) -> int:
    """Power of ten of a number once it is rounded."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2])


def fixed(value: float, decimals: int) -> str:
    """A number with this many decimals, and a true minus sign; zero has none."""
    text = f"{value:.{max(0, decimals)}f}".replace("-", "−")
    return text.lstrip("−") if not text.strip("−0.") else text
