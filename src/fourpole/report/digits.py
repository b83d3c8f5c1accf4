"""Numbers as text with as many digits as their uncertainty allows, in the units of a report; conditions and lists."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fourpole.core.condition import Axis
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import fixed, known, number, with_std
from fourpole.findings.facts import UNSTATED, Estimate, Finding, Key
from fourpole.quantities import PRELOAD, PRESSURE, Quantity, ShownUnits
from fourpole.words import first_of, package_toml

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


#: Sentences of the report.
SENTENCES = package_toml("fourpole.report.words")
_PLURAL = {"pressure": "pressures", "load": "loads", "frequency": "frequencies"}


def plain_number(value: float, digits: int = 3) -> str:
    """A number to some significant digits, without an exponent from 1e-4 to 1e6.

    Examples
    --------
    >>> plain_number(144216.0), plain_number(1.0), plain_number(0.30366), plain_number(99.96)
    ('144000', '1.00', '0.304', '100')
    """
    return number(float(f"{value:.{digits}g}"), digits) or "unknown"


def shown(quantity: Quantity | None, value: float, units: ShownUnits) -> str:
    """A value of a quantity in the unit shown, with that unit."""
    if quantity is None:
        return plain_number(value)
    quantity = units.of(quantity)
    return f"{plain_number(value / quantity.scale)} {quantity.suffix}".rstrip().replace(" °", "°")


def opening(finding: Finding) -> str:
    """The quantity of a specimen, at the start of a sentence."""
    name = (finding.quantity.start or finding.quantity.column) if finding.quantity else ""
    return f"{name} of {finding.specimens[0]}"


def ranged(values: Sequence[float], unit: str = "", digits: int = 3) -> str:
    """'a to b unit', or one number where both read the same."""
    low, high = plain_number(min(values), digits), plain_number(max(values), digits)
    return f"{low if low == high else f'{low} to {high}'} {unit}".rstrip()


def percent(share: float) -> str:
    """A fraction as per cent, with no decimal from 10 %, one from 0.1 %, two below."""
    size = abs(100.0 * share)
    decimals = 0 if size >= 9.95 else 1 if size >= 0.095 else 2
    return f"{100.0 * share:.{decimals}f} %" if abs(share) >= 0.5e-4 else "less than 0.01 %" if share else "0 %"


def percents(shares: Sequence[float]) -> str:
    """Smallest to largest share as per cent."""
    low, high = percent(min(shares)), percent(max(shares))
    if low.startswith(("less", "0 ")) and low != high:
        return f"up to {high}"
    return low if low == high else f"{low.removesuffix(' %')} to {high}"


def bar(pressure: float, units: ShownUnits) -> str:
    """A pressure, in bar unless another unit is wanted.

    Examples
    --------
    >>> bar(170e3, ShownUnits()), bar(170e3, ShownUnits({"Pa": ("kPa", 1e3)}))
    ('1.70 bar', '170 kPa')
    """
    one = units.of(PRESSURE)
    return "unstated pressure" if pressure == UNSTATED else f"{plain_number(pressure / one.scale)} {one.shown}"


def newton(load: float, units: ShownUnits) -> str:
    """A load, in N unless another unit is wanted."""
    if load == UNSTATED:
        return "unstated load"
    one = units.of(PRELOAD)
    value = load / one.scale
    return f"{plain_number(value, 4) if value < 1000 else f'{value:.0f}'} {one.shown}"


def hertz(frequency: float) -> str:
    """A frequency in Hz, without trailing zeros.

    Examples
    --------
    >>> hertz(16.0), hertz(16.53)
    ('16 Hz', '16.5 Hz')
    """
    text = plain_number(frequency)
    return f"{text.rstrip('0').rstrip('.') if '.' in text else text} Hz"


def setting(axis: str, value: float, units: ShownUnits) -> str:
    """One pressure, load or frequency."""
    return hertz(value) if axis == "frequency" else {"pressure": bar, "load": newton}[axis](value, units)


def condition(axes: Sequence[str], key: Key, units: ShownUnits) -> str:
    """'1.70 bar, 1000 N, 16 Hz'; what is not stated is left out."""
    parts = [setting(axis, value, units) for axis, value in zip(axes, key, strict=True) if value != UNSTATED]
    return ", ".join(parts) or "the only condition"


def counted(count: int, singular: str, plural: str = "") -> str:
    """A count with its noun in the singular or plural: '1 test', '3 tests'."""
    return f"{count} {singular if count == 1 else plural or singular + 's'}"


def joined(items: Iterable[str]) -> str:
    """The items as a list in a sentence: 'a', 'a and b', 'a, b and c'."""
    listed = list(items)
    return " and ".join([", ".join(listed[:-1]), listed[-1]] if len(listed) > 1 else listed)


def some(items: Sequence[str], most: int = 10) -> str:
    """A list of which at most `most` are named."""
    return joined(items) if len(items) <= most else first_of(items, most)


def stretches(axis: str, chosen: Sequence[float], tested: Sequence[float], units: ShownUnits) -> str:
    """Settings as stretches of the tested ones: '10 Hz to 16 Hz and 19 Hz'."""
    order = sorted(tested)
    runs: list[list[float]] = []
    for value in sorted(chosen):
        if runs and order.index(value) == order.index(runs[-1][-1]) + 1:
            runs[-1].append(value)
        else:
            runs.append([value])
    return joined(_stretch(axis, run, units) for run in runs)


def _stretch(axis: str, run: Sequence[float], units: ShownUnits) -> str:
    first, last = setting(axis, run[0], units), setting(axis, run[-1], units)
    if len(run) == 1:
        return first
    return f"{first.rpartition(' ')[0]} to {last}"


def combinations(axes: Sequence[str], keys: Sequence[Key]) -> str:
    """'5 pressures', '20 combinations of load and frequency'."""
    varied = [axis for i, axis in enumerate(axes) if len({key[i] for key in keys}) > 1]
    if len(varied) == 1:
        return counted(len(keys), varied[0], _PLURAL[varied[0]])
    return f"{counted(len(keys), 'combination')} of {joined(varied)}" if varied else counted(len(keys), "condition")


def each_of(count: int) -> str:
    """'the only condition', 'each of 10 conditions'."""
    return "the only condition" if count == 1 else f"each of {counted(count, 'condition')}"
