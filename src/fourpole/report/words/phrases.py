"""Numbers, conditions and lists as text."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Sequence
from importlib import resources
from typing import Any

from fourpole.findings.facts import UNSTATED, Finding, Key
from fourpole.quantities import PRELOAD, PRESSURE, Quantity
from fourpole.report.digits import number as digits_of
from fourpole.report.digits import shown_as
from fourpole.words import first_of


def sentences_of(package: str) -> dict[str, Any]:
    """Sentences as data, by their table; words.toml of the package says what each is."""
    return tomllib.loads(resources.files(package).joinpath("words.toml").read_text(encoding="utf-8"))


#: Sentences of the report.
SENTENCES = sentences_of("fourpole.report.words")
_PLURAL = {"pressure": "pressures", "load": "loads", "frequency": "frequencies"}


def number(value: float, digits: int = 3) -> str:
    """A number to some significant digits, without an exponent from 1e-4 to 1e6.

    Examples
    --------
    >>> number(144216.0), number(1.0), number(0.30366), number(99.96)
    ('144000', '1.00', '0.304', '100')
    """
    return digits_of(float(f"{value:.{digits}g}"), digits) or "unknown"


def shown(quantity: Quantity | None, value: float) -> str:
    """A value of a quantity in the unit shown, with that unit."""
    if quantity is None:
        return number(value)
    quantity = shown_as(quantity)
    return f"{number(value / quantity.scale)} {quantity.suffix}".rstrip()


def opening(finding: Finding) -> str:
    """The quantity of a specimen, at the start of a sentence."""
    name = (finding.quantity.start or finding.quantity.column) if finding.quantity else ""
    return f"{name} of {finding.specimens[0]}"


def ranged(values: Sequence[float], unit: str = "", digits: int = 3) -> str:
    """'a to b unit', or one number where both read the same."""
    low, high = number(min(values), digits), number(max(values), digits)
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


def bar(pressure: float) -> str:
    """A pressure, in bar unless another unit is wanted.

    Examples
    --------
    >>> bar(170e3)
    '1.70 bar'
    """
    one = shown_as(PRESSURE)
    return "unstated pressure" if pressure == UNSTATED else f"{number(pressure / one.scale)} {one.shown}"


def newton(load: float) -> str:
    """A load, in N unless another unit is wanted."""
    if load == UNSTATED:
        return "unstated load"
    one = shown_as(PRELOAD)
    value = load / one.scale
    return f"{number(value, 4) if value < 1000 else f'{value:.0f}'} {one.shown}"


def hertz(frequency: float) -> str:
    """A frequency in Hz, without trailing zeros.

    Examples
    --------
    >>> hertz(16.0), hertz(16.53)
    ('16 Hz', '16.5 Hz')
    """
    text = number(frequency)
    return f"{text.rstrip('0').rstrip('.') if '.' in text else text} Hz"


SHOWN: dict[str, Callable[[float], str]] = {"pressure": bar, "load": newton, "frequency": hertz}


def setting(axis: str, value: float) -> str:
    """One pressure, load or frequency."""
    return SHOWN[axis](value)


def condition(axes: Sequence[str], key: Key) -> str:
    """'1.70 bar, 1000 N, 16 Hz'; what is not stated is left out."""
    parts = [setting(axis, value) for axis, value in zip(axes, key, strict=True) if value != UNSTATED]
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


def stretches(axis: str, chosen: Sequence[float], tested: Sequence[float]) -> str:
    """Settings as stretches of the tested ones: '10 Hz to 16 Hz and 19 Hz'."""
    order = sorted(tested)
    runs: list[list[float]] = []
    for value in sorted(chosen):
        if runs and order.index(value) == order.index(runs[-1][-1]) + 1:
            runs[-1].append(value)
        else:
            runs.append([value])
    return joined(_stretch(axis, run) for run in runs)


def _stretch(axis: str, run: Sequence[float]) -> str:
    first, last = setting(axis, run[0]), setting(axis, run[-1])
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
