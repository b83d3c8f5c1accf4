"""Units: a text such as "12.44 kN/m" becomes an SI float, 12440.0; no other package imports pint.

Arithmetic is exact (fractions) until the last step, so that 5.1 mm is 0.0051 m to the last bit.
"""

from __future__ import annotations

import math
import numbers
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from decimal import Decimal
from fractions import Fraction
from typing import TYPE_CHECKING

from fourpole.errors import UnitError
from fourpole.units.grammar import SPELLINGS, add_up, bounded, hints, nearest, parse, shown, spelled_out
from fourpole.units.kinds import COMMON, KINDS, MOTIONS, SUGGESTED, TEMPERATURES, affine, kind_named, kind_of, scale_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "KINDS",
    "MOTIONS",
    "bounded",
    "channel_scale",
    "column_unit",
    "crosstalk",
    "frequency_band",
    "frequency_grid",
    "hints",
    "is_unit",
    "nearest",
    "quantity",
    "sensitivity",
    "shown",
    "si_unit",
    "to_si",
    "unit_in",
    "unit_scale",
]
#: Bounds of texts and of numbers: name, value, unit, and reason.
_LONGEST = 100  # [characters] of the head of a column; longer ones have no unit
_LONGEST_GRID = 4000  # [characters] of a list of frequencies
_MOST_POINTS = 100_000  # [frequencies] of a list
_NUMBER = r"[+-]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][+-]?[0-9]{1,3}(?![0-9]))?"
_QUANTITY = re.compile(rf"({_NUMBER})(.*)", re.DOTALL)
_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")
_BRACKETED = re.compile(r"(?P<stem>.*[^\s_])[\s_]*(?:\[(?P<square>[^\[\]]*)\]|(?<=[\s_])\((?P<round>[^()]*)\))\s*")
_ATTACHED = re.compile(r"(?P<stem>[^()]*)\((?P<round>[^()]+)\)\s*")
_CHARGE = re.compile(r"(?<![A-Za-z°])[pnµum]?C(?![A-Za-z])")
_BAND = re.compile(
    rf"\s*(?P<low>{_NUMBER})\s*+(?P<first>[A-Za-z/]*?)\s*+"
    rf"(?:(?::|\.\.\.?|-|–|\bto\b)\s*(?P<high>{_NUMBER})\s*)?(?P<last>[A-Za-z][^0-9:]*|)"
)
#: Number of frequencies of a range without a step.
_EVEN = 25
_FUNCTIONS = frozenset({"u", "std", "cov", "corr", "var", "re", "im", "abs", "arg", "mean", "rms"})


def si_unit(kind: str) -> str:
    """The SI unit of a kind of quantity, which all numbers of this kind have inside Fourpole.

    Examples
    --------
    >>> si_unit("stiffness"), si_unit("temperature")
    ('N/m', 'degC')
    """
    return "Hz" if kind == "frequency" else kind_named(kind).si


def quantity(text: str | float, kind: str, *, default_unit: str | None = None) -> float:
    """The SI value of a quantity that is written as a text.

    Parameters
    ----------
    text : str or number
        "12.44 kN/m", "1.85bar", "0,5 %". A decimal comma is taken where it cannot mean thousands.
    kind : str
        One of `KINDS`.
    default_unit : str, optional
        Unit of a bare number. Without it a bare number is refused.

    Returns
    -------
    float
        In the kind's SI unit; temperatures in degC, frequencies in Hz.

    Raises
    ------
    UnitError
        If the text is no finite number with a unit of that kind.

    Examples
    --------
    >>> quantity("12.44 kN/m", "stiffness")
    12440.0
    >>> quantity("600 rpm", "frequency")
    10.0
    """
    number, unit = _number_and_unit(text, kind)
    if not unit:
        if default_unit is None:
            raise UnitError(f"{shown(text)} has no unit; write it as in '{kind_named(kind).example}'")
        unit = default_unit
    scale, offset = affine(unit, kind)
    return bounded(number * scale + offset, text)


def unit_in(text: str) -> str:
    """The unit with which a quantity is written.

    Parameters
    ----------
    text : str
        A quantity, as for `quantity`.

    Returns
    -------
    str
        Empty for a bare number.

    Raises
    ------
    UnitError
        If the text does not begin with a number.

    Examples
    --------
    >>> unit_in("2.1 bar"), unit_in("180 N/mm")
    ('bar', 'N/mm')
    """
    return _number_and_unit(text, None)[1]


def unit_scale(unit: str, kind: str) -> float:
    """SI value of one unit, such as 1000 for "kN".

    Parameters
    ----------
    unit : str
        As people write it: "kN/mm", "N·s/m", "kgf/cm2", "rpm".
    kind : str
        One of `KINDS`. A scale alone converts no temperature except °C; use `to_si` for K and °F.

    Raises
    ------
    UnitError
        If the unit is unknown (with the nearest known one) or of another kind.

    Examples
    --------
    >>> unit_scale("kN/mm", "stiffness")
    1000000.0
    """
    scale, offset = affine(unit, kind)
    if offset:
        raise UnitError(f"{shown(unit)} has another zero than °C; state the temperature in °C")
    return bounded(scale, unit)


def to_si(values: ArrayLike, unit: str, kind: str) -> NDArray[np.float64]:
    """Values in any unit of a kind, in SI (temperatures in °C).

    Parameters
    ----------
    values : (...,) float array [unit]
    unit, kind : str
        As for `unit_scale`; K and °F are accepted too.

    Returns
    -------
    (...,) float array [SI]

    Examples
    --------
    >>> to_si([293.15, 300.0], "K", "temperature").round(6).tolist()
    [20.0, 26.85]
    """
    import numpy as np  # here, since what reads bytes names files by `shown`, and a second run waits for it

    scale, offset = affine(unit, kind)
    return np.asarray(values, dtype=np.float64) * float(scale) + float(offset)


def channel_scale(unit: str, kinds: Sequence[str] = MOTIONS) -> tuple[str, float]:
    """The kind of a unit, one of several possible kinds, and the SI value of one unit.

    Parameters
    ----------
    unit : str
        "mm/s". Where an acceleration is possible and a mass is not, "g" is 9.80665 m/s².
    kinds : sequence of str
        The possible kinds. If several have the dimensions of the unit, the first is returned.

    Raises
    ------
    UnitError
        If the unit is unknown or of none of these kinds.

    Examples
    --------
    >>> channel_scale("mm/s"), channel_scale("g")
    (('velocity', 0.001), ('acceleration', 9.80665))
    >>> channel_scale("kN", ("force", "voltage"))
    ('force', 1000.0)
    """
    if tuple(kinds) == ("temperature",):
        return "temperature", unit_scale(unit, "temperature")
    kind, scale = scale_of(unit, tuple(kinds))
    return kind, bounded(scale, unit)


def is_unit(text: str, kind: str | None = None) -> bool:
    """Whether a text is a unit of one of the `KINDS`, or of a certain one.

    Examples
    --------
    >>> is_unit("kgf/cm²"), is_unit("radial"), is_unit("bar", "force")
    (True, False, False)
    """
    with suppress(UnitError):
        if kind is not None:
            return bool(affine(text, kind)[0])
        is_usual = text.strip() in SUGGESTED or text.strip() in TEMPERATURES
        return is_usual or kind_of(parse(spelled_out(text), True)[1]) is not None
    return False


def sensitivity(text: str) -> tuple[float, str]:
    """The sensitivity of a sensor in volts per SI unit, and the kind of quantity that it measures.

    Parameters
    ----------
    text : str
        "98.3 mV/g", "4 mV/N", "20 V/(m/s)"; also the other way up, "1000 N/V". g is 9.80665 m/s².

    Returns
    -------
    float [V per N, m, m/s or m/s²]
        > 0
    str
        "force", "displacement", "velocity" or "acceleration".

    Raises
    ------
    UnitError
        If the sensitivity is not volts per force or motion, as "50 pC/N" is not, or is not positive.

    Examples
    --------
    >>> sensitivity("4 mV/N")
    (0.004, 'force')
    """
    number, unit = _number_and_unit(text, None)
    example = "write it as in '98.3 mV/g' or '4 mV/N'"
    if number <= 0:
        raise UnitError(f"sensitivity {shown(text)} is not positive; a reversed sensor has invert = true")
    if not unit:
        raise UnitError(f"sensitivity {shown(text)} has no unit; {example}")
    if _CHARGE.search(unit):  # recognized by its letters: pC/N has the dimensions of pm/V
        raise UnitError(f"sensitivity {shown(text)} is a charge; state the volts after its amplifier, as in '4 mV/N'")
    scale, dimensions = parse(unit, True)
    volt, volts = parse("V", False)
    for kind in ("force", *MOTIONS):
        one, measured = parse(kind_named(kind).si, False)
        if dimensions == add_up((volts, 1), (measured, -1)):
            return bounded(number * scale * one / volt, text), kind
        if dimensions == add_up((measured, 1), (volts, -1)):
            return bounded(one / (number * scale * volt), text), kind
    raise UnitError(f"sensitivity {shown(text)} is not volts per force or motion; {example} or '20 V/(m/s)'")


def crosstalk(text: str, kind: str) -> tuple[float, str]:
    """Crosstalk of a sensor: its reading per disturbing force or motion, in SI units, and the kind of disturbance.

    Parameters
    ----------
    text : str
        "0.02 N/(m/s2)", "0.02 kg", "0.5 %" of the same kind, "-1e-4 (m/s2)/N".
    kind : str
        Kind of the sensor: "force", "displacement", "velocity" or "acceleration".

    Returns
    -------
    float
        Crosstalk, of either sign.
    str
        Kind of the disturbance: "force", "displacement", "velocity" or "acceleration".

    Raises
    ------
    UnitError
        If the unit is not that of the sensor's kind per force or motion.

    Examples
    --------
    >>> crosstalk("0.02 N/(m/s2)", "force"), crosstalk("0.5 %", "acceleration")
    ((0.02, 'acceleration'), (0.005, 'acceleration'))
    """
    number, unit = _number_and_unit(text, None)
    scale, dimensions = parse(unit or "1", True)
    one, shown_in = parse(kind_named(kind).si, False)
    for of in (kind, "force", *MOTIONS):
        other, measured = parse(kind_named(of).si, False)
        if dimensions == add_up((shown_in, 1), (measured, -1)):
            return bounded(number * scale * other / one, text), of
    example = f"({kind_named(kind).si})/(m/s2)"
    raise UnitError(f"crosstalk {shown(text)} is not {kind} per force or motion; write it as in '0.02 {example}'")


def frequency_grid(text: str) -> list[float]:
    """Frequencies from a text that lists numbers and ranges.

    Parameters
    ----------
    text : str
        Numbers and ranges start:stop:step (the stop included), between commas, and one unit at the
        end: "10:24:0.5 Hz", "10,12,14 Hz", "18 Hz", "600:1440:60 rpm". A range without a step, "10:24 Hz", is 25
        frequencies, evenly spaced in their logarithm.

    Returns
    -------
    list of float [Hz]
        In the order written, each > 0; at most 100 000.

    Raises
    ------
    UnitError
        If the text has another form, or a frequency is not positive.

    Examples
    --------
    >>> frequency_grid("10:11:0.5 Hz")
    [10.0, 10.5, 11.0]
    """
    example = "write it as in '10:24:0.5 Hz' or '10,12,14 Hz'"
    spelled = spelled_out(text, _LONGEST_GRID)
    match = re.fullmatch(r"([-+0-9.,;:eE\s]*[0-9.])\s*([^0-9\s.,;:+-].*)", spelled)
    if match is None:
        raise UnitError(f"frequencies {shown(text)} lack numbers or a unit; {example}")
    scale, _ = affine(match[2], "frequency")
    grid: list[float] = []
    for part in re.split(r"[,;]", match[1]):
        for value in _range(part.strip(), text, example):
            grid.append(bounded(value * scale, text))
            if len(grid) > _MOST_POINTS:
                raise UnitError(f"frequencies {shown(text)} are more than {_MOST_POINTS}; take a larger step")
    if min(grid) <= 0:
        raise UnitError(f"frequencies {shown(text)} are not all positive")
    return grid


def frequency_band(text: str) -> tuple[float, float]:
    """Lowest and highest frequency of a band from a text.

    Parameters
    ----------
    text : str
        Two rising numbers with ":", "..", "-" or "to" between them and a unit at the end, or a unit at each of them;
        or one frequency, which is both ends.

    Returns
    -------
    float, float [Hz]
        > 0, rising.

    Raises
    ------
    UnitError
        If the text has another form, or a frequency is not positive.

    Examples
    --------
    >>> frequency_band("10:24 Hz"), frequency_band("1e-3 .. 1e5 Hz"), frequency_band("10 Hz")
    ((10.0, 24.0), (0.001, 100000.0), (10.0, 10.0))
    """
    match = _BAND.fullmatch(spelled_out(text))
    if match is None:
        raise UnitError(f"band {shown(text)} is not two rising frequencies; write it as in '10:24 Hz' or '0.1..100 Hz'")
    low, first, high, last = (match[name] for name in ("low", "first", "high", "last"))
    if not last:
        last, first = first, ""
    if not last:
        raise UnitError(f"band {shown(text)} has no unit; write it as in '10:24 Hz'")
    ends = [(low, first or last), (high, last)] if high is not None else [(low, last)]
    values = [quantity(f"{number} {unit}", "frequency") for number, unit in ends]
    if not 0 < values[0] <= values[-1] or (len(values) == 2 and values[0] == values[1]):
        raise UnitError(f"band {shown(text)} is not two rising, positive frequencies, as in '10:24 Hz'")
    return values[0], values[-1]


def column_unit(name: str) -> tuple[str, str | None]:
    """A column's name and the unit written with it.

    Parameters
    ----------
    name : str
        "pressure [bar]", "F1 (N)", "F1_[kN]", "F1". Round brackets that touch the name are a unit
        only if they hold a common one: "t(s)" has a unit, "u(K1)" has none. "[]" and "[-]" are 1.

    Returns
    -------
    str
        The name alone.
    str or None
        The unit as written, or None if there is none.

    Examples
    --------
    >>> column_unit("pressure [bar]"), column_unit("u(K1) [N/m]"), column_unit("u(K1)")
    (('pressure', 'bar'), ('u(K1)', 'N/m'), ('u(K1)', None))
    """
    whole = name.strip()
    if len(whole) > _LONGEST:
        return whole, None
    match = _BRACKETED.fullmatch(whole)
    if match is not None:
        unit = (match["square"] or match["round"] or "").strip()
        return match["stem"].strip(), "1" if unit in ("", "-", "–") else unit
    match = _ATTACHED.fullmatch(whole)
    if match is not None and match["stem"].strip() and match["stem"].strip().lower() not in _FUNCTIONS:
        unit = match["round"].strip()
        if unit.translate(SPELLINGS) in COMMON and unit != "t":
            return match["stem"].strip(), unit
    return whole, None


def _number_and_unit(text: object, kind: str | None) -> tuple[Fraction, str]:
    """The exact number and the text of the unit, which is empty for a bare number."""
    example = kind_named(kind).example if kind is not None else "4 mV/N"
    if isinstance(text, numbers.Real) and not isinstance(text, bool):
        if not math.isfinite(text):
            raise UnitError(f"{shown(text)} is not a finite number")
        return Fraction(repr(float(text))), ""
    if not isinstance(text, str):
        raise UnitError(f"{shown(text)} is not a quantity; write it as in '{example}'")
    spelled = spelled_out(text)
    match = _QUANTITY.fullmatch(spelled)
    if match is None:
        raise UnitError(f"{shown(text)} does not begin with a number; write it as in '{example}'")
    number, unit = match[1], match[2].strip()
    if unit.startswith("[") and unit.endswith("]"):
        unit = unit[1:-1].strip()
    if unit[:1] in tuple(",.'0123456789") and not re.match(r"1\s*/", unit):
        raise UnitError(f"{shown(text)} has two numbers or a thousands mark; write it as in '{example}'")
    if "," in number:
        number = _decimal_comma(number, text)
    return Fraction(number), unit


def _decimal_comma(number: str, text: object) -> str:
    if not re.search(r"[0-9],[0-9]", number) or _THOUSANDS.fullmatch(number):
        raise UnitError(f"the comma in {shown(text)} may mean thousands or a decimal; write a decimal point")
    return number.replace(",", ".")


def _range(part: str, text: str, example: str) -> Iterator[Fraction]:
    """The numbers of "18" or "10:24:0.5"; the stop is included if a step ends within a millionth of a step of it."""
    pieces = part.split(":")
    if len(pieces) > 3 or not all(re.fullmatch(_NUMBER, piece.strip()) for piece in pieces):
        raise UnitError(f"frequencies {shown(text)}: {shown(part)} is no number or start:stop:step; {example}")
    values = [Fraction(Decimal(piece.strip())) for piece in pieces]
    if len(values) == 1:
        yield values[0]
        return
    if len(values) == 2:
        import numpy as np

        low, high = map(float, values)
        if not 0 < low < high:
            raise UnitError(f"frequencies {shown(text)}: {shown(part)} must rise, as start:stop; {example}")
        yield values[0]
        yield from map(Fraction, np.geomspace(low, high, _EVEN)[1:-1].tolist())
        yield values[1]
        return
    start, stop, step = values
    if step <= 0 or stop < start:
        raise UnitError(f"frequencies {shown(text)}: {shown(part)} must rise, as start:stop:step; {example}")
    steps = min((stop - start) / step + Fraction(1, 10**6), Fraction(_MOST_POINTS))
    yield from (start + index * step for index in range(math.floor(steps) + 1))
