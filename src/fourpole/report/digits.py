"""Numbers as text, with as many digits as their uncertainty allows, and the units in which a report is written."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np

from fourpole.core.condition import Axis
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import fixed, known, number, with_std
from fourpole.findings.facts import Estimate
from fourpole.quantities import Quantity, ShownUnits

__all__ = [
    "PLUS_MINUS", "cell", "decimals_of", "expanded", "in_unit", "known", "number", "rounded", "spread", "with_interval",
    "with_std", "with_u",
]  # fmt: skip

#: Up to this number values are listed one by one; more are given as a range.
_LISTED = 8
#: From this size on a number is shown with a power of ten.
_LARGE = 1e7
#: A relative standard uncertainty below this is not shown.
_NEGLIGIBLE = 1e-8
#: What stands after a number.
PLUS_MINUS = "± is U (k = 2)"


def expanded(value: float, std: float) -> tuple[str, str]:
    """A number and its expanded uncertainty U, to the second digit of U if its first is 1 or 2, else to the first.

    >>> expanded(172.3482, 0.619), expanded(1105.36, 33.0), expanded(0.30366, 0.0)
    (('172.3', '1.2'), ('1110', '70'), ('0.3037', ''))
    >>> expanded(1105.36, 1.7e8)
    ('1105', '3.4×10⁸')
    """
    reach = COVERAGE_FACTOR * std
    decimals = decimals_of(reach)
    if decimals is None:
        return number(value), number(reach, 2) if reach >= _LARGE else ""
    return rounded(value, decimals), rounded(reach, decimals)


def in_unit(measured: Estimate, quantity: Quantity) -> tuple[str, str]:
    """A measured value and its U in the unit shown of its quantity."""
    return expanded(measured.value / quantity.scale, measured.std / quantity.scale)


def with_interval(value: float, low: float, high: float) -> tuple[str, str]:
    """A number and an interval about it that is skewed, to the digits that U would have.

    >>> with_interval(93.81, 93.42, 94.51), with_interval(50.0, 20.0, math.inf)
    (('93.8', '93.4 to 94.5'), ('50', 'above 20'))
    """
    decimals = decimals_of(0.5 * (high - low))
    if decimals is None:
        return number(value, 2), f"above {number(low, 2)}" if math.isinf(high) else f"{number(low)} to {number(high)}"
    return rounded(value, decimals), f"{rounded(low, decimals)} to {rounded(high, decimals)}"


def decimals_of(reach: float) -> int | None:
    """Decimals of a number with an expanded uncertainty; None where this is unknown, zero or very large."""
    if not 1e-9 < reach < _LARGE:
        return None
    leading = f"{reach:.0e}"
    return -int(leading[2:]) + (leading[0] in "12")


def rounded(value: float, decimals: int | None) -> str:
    """A number to some decimals, which are negative for tens and hundreds; to four digits for None."""
    return number(value) if decimals is None else fixed(round(value, decimals), decimals)


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


def with_u(value: float | None, std: float | None, scale: float = 1.0) -> str:
    """A value with U in the unit shown, both to the second digit of U.

    Examples
    --------
    >>> with_u(435012.3, 59.0, 1e3), with_u(0.30366, None)
    ('435.01 ± 0.12', '0.3037')
    """
    if value is None:
        return ""
    std = std if std is not None and std > _NEGLIGIBLE * abs(value) else None
    text, u = with_std(value / scale, None if std is None else COVERAGE_FACTOR * std / scale)
    return f"{text} ± {u}" if u else text


def cell(row: Mapping[str, Any], head: str, units: ShownUnits) -> str:
    """A value of a row by the head of its column, with U where the row has an uncertainty."""
    value = row[head]
    if value is None or isinstance(value, str):
        return value or ""
    name, _, si = head.removesuffix("]").partition(" [")
    std = row.get(f"u({name}) [{si}]")
    scale = units.unit(si)[1]
    if std is not None:
        return with_u(value, std, scale)
    text = number(value / scale, 5)
    return text.rstrip("0").rstrip(".") if "." in text and "×" not in text else text


_UNITS = ContextVar("units of the report", default=ShownUnits())  # noqa: B039  it is frozen


@contextmanager
def in_units(units: ShownUnits) -> Iterator[None]:
    """Inside the context words and tables have these units, afterwards the former ones.

    Examples
    --------
    >>> from fourpole.quantities import PRESSURE
    >>> with in_units(ShownUnits({"Pa": ("kPa", 1e3)})):
    ...     shown_as(PRESSURE).label
    'pressure [kPa]'
    """
    token = _UNITS.set(units)
    try:
        yield
    finally:
        _UNITS.reset(token)


def shown_as(quantity: Quantity) -> Quantity:
    """A quantity with the unit in which it is written now."""
    return _UNITS.get().of(quantity)
