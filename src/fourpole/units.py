"""Units: what people write, "12.44 kN/m", becomes an SI float, 12440.0; the only room that knows pint.

The text is untrusted. It is bounded in length and letters, split here into unit names, and only
single names are looked up in pint, so no text can make it compute. Arithmetic is exact (fractions)
until the last step, so that 5.1 mm is 0.0051 m to the last bit.
"""

from __future__ import annotations

import difflib
import math
import numbers
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fourpole.errors import UnitError

if TYPE_CHECKING:
    from pint import UnitRegistry

__all__ = [
    "KINDS",
    "MOTIONS",
    "channel_scale",
    "column_unit",
    "frequency_grid",
    "is_unit",
    "motion_scale",
    "quantity",
    "sensitivity",
    "shown",
    "si_unit",
    "to_si",
    "unit_scale",
]


@dataclass(frozen=True)
class _Kind:
    """A kind of quantity: its SI unit, an example, and the spellings to suggest (the first few are shown)."""

    si: str
    example: str
    units: tuple[str, ...]


_LENGTHS = ("m", "mm", "µm", "cm", "in", "um", "ft", "km")
_KINDS: dict[str, _Kind] = {
    "mass": _Kind("kg", "15 kg", ("kg", "g", "t", "lb")),
    "force": _Kind("N", "1000 N", ("N", "kN", "kgf", "lbf", "mN", "daN", "MN")),
    "stiffness": _Kind("N/m", "12.44 kN/m", ("N/m", "kN/m", "N/mm", "kN/mm", "MN/m", "lbf/in", "kgf/mm")),
    "damping": _Kind("N s/m", "20 N s/m", ("N s/m", "kN s/m", "N s/mm", "lbf s/in", "Ns/m", "N·s/m", "kg/s")),
    "length": _Kind("m", "0.5 mm", _LENGTHS),
    "displacement": _Kind("m", "0.5 mm", _LENGTHS),
    "velocity": _Kind("m/s", "0.2 m/s", ("m/s", "mm/s", "in/s", "km/h", "cm/s", "µm/s", "mph")),
    "acceleration": _Kind("m/s^2", "9.81 m/s²", ("m/s²", "g", "mm/s²", "m/s^2", "m/s2", "in/s²", "ft/s²")),
    "pressure": _Kind("Pa", "1.7 bar", ("Pa", "kPa", "bar", "psi", "kgf/cm²", "MPa", "hPa", "mbar", "GPa")),
    "frequency": _Kind("1/s", "18 Hz", ("Hz", "kHz", "rpm", "1/min", "rad/s", "1/s", "mHz")),
    "time": _Kind("s", "0.2 ms", ("s", "ms", "µs", "min", "h", "us", "sec")),
    "temperature": _Kind("degC", "20 °C", ("°C", "degC", "K", "°F", "degF")),
    "angle": _Kind("rad", "0.2 deg", ("rad", "deg", "°", "mrad")),
    "ratio": _Kind("1", "0.5 %", ("1", "%", "ppm", "-")),
    "mobility": _Kind("m/(N s)", "0.001 m/(N s)", ("m/(N s)", "mm/(N s)", "m/(kN s)", "m/(Ns)", "s/kg")),
    "voltage": _Kind("V", "5 V", ("V", "mV", "µV", "kV")),
    "energy": _Kind("J", "3 J", ("J", "kJ", "N m", "Nm", "mJ")),
}

KINDS: tuple[str, ...] = tuple(_KINDS)
"""The kinds of quantity, by the words that all functions here take."""

MOTIONS: tuple[str, ...] = ("displacement", "velocity", "acceleration")
"""The kinds that a motion channel may record."""

# Celsius = scale * value + offset; pint is not asked, since its offset units cannot enter a product.
_TEMPERATURES: dict[str, tuple[Fraction, Fraction]] = {
    **dict.fromkeys(("degC", "°C", "C", "celsius", "deg C", "° C"), (Fraction(1), Fraction(0))),
    **dict.fromkeys(("K", "kelvin"), (Fraction(1), Fraction(-27315, 100))),
    **dict.fromkeys(("degF", "°F", "F", "fahrenheit", "deg F", "° F"), (Fraction(5, 9), Fraction(-160, 9))),
}

_PURE: _Dimensions = ()
_LONGEST = 100
_LONGEST_GRID = 4000
_MOST_POINTS = 100_000
_MOST_NAMES = 12
_DEEPEST = 3
_HIGHEST_POWER = 4

_ALIASES = {
    "%": "percent",
    "‰": "permille",
    "°": "degree",
    "µ": "micrometer",
    "rev": "revolution",
    "U": "revolution",
    "gn": "standard_gravity",
    "kp": "kilogram_force",
    "lbs": "pound",
}
_SPELLINGS = str.maketrans(
    {
        "\u03bc": "µ",
        "·": "*", "⋅": "*", "×": "*", "∙": "*", "•": "*",
        "−": "-", "–": "-", "⁻": "-",
        "⁄": "/", "∕": "/",
        "¹": "1", "²": "2", "³": "3", "⁴": "4",
        "℃": "°C", "℉": "°F", "º": "°",
        "\u00a0": " ", "\u2007": " ", "\u2009": " ", "\u202f": " ", "\t": " ",
    }
)  # fmt: skip

_NUMBER = r"[+-]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][+-]?[0-9]{1,3}(?![0-9]))?"
_QUANTITY = re.compile(rf"({_NUMBER})(.*)", re.DOTALL)
_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")
_TOKEN = re.compile(
    r"\s*(?:(?P<name>[A-Za-zµ°%‰]+(?:_[A-Za-z0-9]+)*)(?P<power>(?:\^|\*\*)?\s*[+-]?[0-9]+)?"
    r"|(?P<one>1(?![0-9]))|(?P<mark>[*/().-]))\s*"
)
# Products written without a sign between; pint would read "Nm" as a textile unit and "lbfs" not at all.
_JOINED = re.compile(r"([kMGmµu]?(?:N|Pa|J)|lbf|kgf)(s|m|mm|cm)")
_BRACKETED = re.compile(r"(?P<stem>.*?)[\s_]*(?:\[(?P<square>[^\[\]]*)\]|(?<=[\s_])\((?P<round>[^()]*)\))\s*")
_ATTACHED = re.compile(r"(?P<stem>[^()]*)\((?P<round>[^()]+)\)\s*")
_CHARGE = re.compile(r"(?<![A-Za-z°])[pnµum]?C(?![A-Za-z])")
_FUNCTIONS = frozenset({"u", "std", "cov", "corr", "var", "re", "im", "abs", "arg", "mean", "rms"})

_Dimensions = tuple[tuple[str, int], ...]
_Scaled = tuple[Fraction, _Dimensions]


def shown(text: object, limit: int = 60) -> str:
    r"""Text as it may stand in a message: quoted, shortened, control characters escaped.

    Parameters
    ----------
    text : object
        Anything; its `str` is taken.
    limit : int [characters]
        Longest text that is shown whole.

    Examples
    --------
    >>> print(shown("ra\x1bdial"))
    'ra\x1bdial'
    """
    whole = str(text)
    kept = whole if len(whole) <= limit else whole[: limit - 1] + "…"
    clean = "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in kept)
    return f"'{clean}'"


def si_unit(kind: str) -> str:
    """The unit that numbers of a kind have inside Fourpole.

    Examples
    --------
    >>> si_unit("stiffness"), si_unit("temperature")
    ('N/m', 'degC')
    """
    return "Hz" if kind == "frequency" else _kind(kind).si


def quantity(text: str | float, kind: str, *, default_unit: str | None = None) -> float:
    """A quantity as people write it, as an SI float.

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
            raise UnitError(f"{shown(text)} has no unit; write it as in '{_kind(kind).example}'")
        unit = default_unit
    scale, offset = _affine(unit, kind)
    return _finite(number * scale + offset, text)


def unit_scale(unit: str, kind: str) -> float:
    """SI value of one of a unit.

    Parameters
    ----------
    unit : str
        As people write it: "kN/mm", "N·s/m", "kgf/cm2", "rpm".
    kind : str
        One of `KINDS`. Of temperatures only °C can be told by a scale; see `to_si`.

    Raises
    ------
    UnitError
        If the unit is unknown (with the nearest known one) or of another kind.

    Examples
    --------
    >>> unit_scale("kN/mm", "stiffness")
    1000000.0
    """
    scale, offset = _affine(unit, kind)
    if offset:
        raise UnitError(f"{shown(unit)} has another zero than °C; state the temperature in °C")
    return _finite(scale, unit)


def to_si(values: ArrayLike, unit: str, kind: str) -> NDArray[np.float64]:
    """Values in any unit of a kind, in SI (temperatures in °C).

    Parameters
    ----------
    values : (...,) float array [unit]
    unit, kind : str
        As for `unit_scale`; K and °F are taken too.

    Returns
    -------
    (...,) float array [SI]

    Examples
    --------
    >>> to_si([293.15, 300.0], "K", "temperature").round(6).tolist()
    [20.0, 26.85]
    """
    scale, offset = _affine(unit, kind)
    return np.asarray(values, dtype=np.float64) * float(scale) + float(offset)


def channel_scale(unit: str, kinds: Sequence[str] = MOTIONS) -> tuple[str, float]:
    """Which of several kinds a unit is, and the SI value of one of it.

    Parameters
    ----------
    unit : str
        "mm/s". Where an acceleration is possible and a mass is not, "g" is 9.80665 m/s².
    kinds : sequence of str
        The kinds that are possible; of equal ones the first is answered.

    Raises
    ------
    UnitError
        If the unit is unknown or of none of these kinds.

    Examples
    --------
    >>> channel_scale("mm/s")
    ('velocity', 0.001)
    >>> channel_scale("kN", ("force", "voltage"))
    ('force', 1000.0)
    """
    if tuple(kinds) == ("temperature",):
        return "temperature", unit_scale(unit, "temperature")
    kind, scale = _scale_of(unit, tuple(kinds))
    return kind, _finite(scale, unit)


def motion_scale(unit: str) -> tuple[str, float]:
    """Whether a unit is of displacement, velocity or acceleration, and the SI value of one of it.

    Examples
    --------
    >>> motion_scale("µm"), motion_scale("g")
    (('displacement', 1e-06), ('acceleration', 9.80665))
    """
    return channel_scale(unit, MOTIONS)


def is_unit(text: str) -> bool:
    """Whether a text is a unit of one of the `KINDS`.

    Examples
    --------
    >>> is_unit("kgf/cm²"), is_unit("radial")
    (True, False)
    """
    if text.strip() in _SUGGESTED or text.strip() in _TEMPERATURES:
        return True
    try:
        _, dimensions = _parse(_spelled(text), True)
    except UnitError:
        return False
    return _kind_of(dimensions) is not None


def sensitivity(text: str) -> tuple[float, str]:
    """What a sensor gives: volts per SI unit, and the kind of what it measures.

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
        If it is not volts per force or motion, as with charge ("50 pC/N"), or not positive.

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
    if _CHARGE.search(unit):  # by its letters: in dimensions pC/N is also pm/V
        raise UnitError(f"sensitivity {shown(text)} is a charge; state the volts after its amplifier, as in '4 mV/N'")
    scale, dimensions = _parse(unit, True)
    volt, volts = _parse("V", False)
    for kind in ("force", *MOTIONS):
        one, measured = _parse(_kind(kind).si, False)
        if dimensions == _sum((volts, 1), (measured, -1)):
            return _finite(number * scale * one / volt, text), kind
        if dimensions == _sum((measured, 1), (volts, -1)):
            return _finite(one / (number * scale * volt), text), kind
    raise UnitError(f"sensitivity {shown(text)} is not volts per force or motion; {example} or '20 V/(m/s)'")


def frequency_grid(text: str) -> list[float]:
    """Frequencies as people list them.

    Parameters
    ----------
    text : str
        Numbers and ranges start:stop:step (the stop included), between commas, and one unit at the
        end: "10:24:0.5 Hz", "10,12,14 Hz", "18 Hz", "600:1440:60 rpm".

    Returns
    -------
    list of float [Hz]
        In the order written, each > 0; at most 100 000.

    Raises
    ------
    UnitError
        If it is none of these.

    Examples
    --------
    >>> frequency_grid("10:11:0.5 Hz")
    [10.0, 10.5, 11.0]
    """
    example = "write it as in '10:24:0.5 Hz' or '10,12,14 Hz'"
    spelled = _spelled(text, _LONGEST_GRID)
    match = re.fullmatch(r"([-+0-9.,;:eE\s]*[0-9.])\s*([^0-9\s.,;:+-].*)", spelled)
    if match is None:
        raise UnitError(f"frequencies {shown(text)} lack numbers or a unit; {example}")
    scale, _ = _affine(match[2], "frequency")
    grid: list[float] = []
    for part in re.split(r"[,;]", match[1]):
        for value in _range(part.strip(), text, example):
            grid.append(_finite(value * scale, text))
            if len(grid) > _MOST_POINTS:
                raise UnitError(f"frequencies {shown(text)} are more than {_MOST_POINTS}; take a larger step")
    if min(grid) <= 0:
        raise UnitError(f"frequencies {shown(text)} are not all positive")
    return grid


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
    if match is not None and match["stem"].strip():
        unit = (match["square"] or match["round"] or "").strip()
        return match["stem"].strip(), "1" if unit in ("", "-", "–") else unit
    match = _ATTACHED.fullmatch(whole)
    if match is not None and match["stem"].strip() and match["stem"].strip().lower() not in _FUNCTIONS:
        unit = match["round"].strip()
        if unit.translate(_SPELLINGS) in _COMMON and unit != "t":
            return match["stem"].strip(), unit
    return whole, None


_SUGGESTED = frozenset(unit for kind in _KINDS.values() for unit in kind.units)
_COMMON = frozenset(unit.translate(_SPELLINGS) for unit in _SUGGESTED)


def _kind(kind: str) -> _Kind:
    try:
        return _KINDS[kind]
    except KeyError:
        raise ValueError(f"{shown(kind)} is no kind of quantity; they are {', '.join(KINDS)}") from None


def _finite(value: Fraction, text: object) -> float:
    """The nearest float, refused if it has left the range of floats."""
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if math.isinf(number) or (number == 0.0 and value != 0):
        raise UnitError(f"{shown(text)} is beyond the range of numbers")
    return number


def _spelled(text: str, longest: int = _LONGEST) -> str:
    """One spelling for the signs that look alike; the length bounded, strange characters refused."""
    if not isinstance(text, str):
        raise UnitError(f"{shown(text)} is not a text with a unit")
    if len(text) > longest:
        raise UnitError(f"{shown(text)} is too long for a quantity or unit")
    spelled = text.translate(_SPELLINGS).strip()
    if spelled.startswith("[") and spelled.endswith("]"):
        spelled = spelled[1:-1].strip()
    for character in spelled:
        if not (character.isascii() and character.isprintable()) and character not in "µ°‰":
            raise UnitError(f"{shown(text)} has a character that no unit has: {shown(character)}")
    return spelled


def _number_and_unit(text: object, kind: str | None) -> tuple[Fraction, str]:
    """The exact number and the text of the unit, empty if there is none."""
    example = _kind(kind).example if kind is not None else "4 mV/N"
    if isinstance(text, numbers.Real) and not isinstance(text, bool):
        if not math.isfinite(text):
            raise UnitError(f"{shown(text)} is not a finite number")
        return Fraction(repr(float(text))), ""
    if not isinstance(text, str):
        raise UnitError(f"{shown(text)} is not a quantity; write it as in '{example}'")
    spelled = _spelled(text)
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
    """The numbers of "18" or "10:24:0.5"; the stop counts if a step ends within a millionth of it."""
    pieces = part.split(":")
    if len(pieces) not in (1, 3) or not all(re.fullmatch(_NUMBER, piece.strip()) for piece in pieces):
        raise UnitError(f"frequencies {shown(text)}: {shown(part)} is no number or start:stop:step; {example}")
    values = [Fraction(Decimal(piece.strip())) for piece in pieces]
    if len(values) == 1:
        yield values[0]
        return
    start, stop, step = values
    if step <= 0 or stop < start:
        raise UnitError(f"frequencies {shown(text)}: {shown(part)} must rise, as start:stop:step; {example}")
    steps = min((stop - start) / step + Fraction(1, 10**6), Fraction(_MOST_POINTS))
    yield from (start + index * step for index in range(math.floor(steps) + 1))


def _affine(unit: str, kind: str) -> tuple[Fraction, Fraction]:
    """Scale and offset: SI value = scale * value + offset."""
    if kind == "temperature":
        found = _TEMPERATURES.get(_spelled(unit))
        if found is None:
            raise UnitError(_wrong(unit, None, (kind,)))
        return found
    return _scale_of(unit, (kind,))[1], Fraction(0)


@lru_cache(maxsize=1024)
def _scale_of(unit: str, kinds: tuple[str, ...]) -> tuple[str, Fraction]:
    """The first of the kinds that the unit is, and its scale to that kind's SI unit."""
    spelled = _spelled(unit)
    for kind in kinds:
        if spelled == _kind(kind).si:  # the commonest case needs no pint
            return kind, Fraction(1)
    gravity = "acceleration" in kinds and "mass" not in kinds
    try:
        scale, dimensions = _parse(spelled, gravity)
    except UnitError as error:
        alike = _nearest(spelled, kinds)
        hint = f"; did you mean '{alike}'?" if alike else ""
        raise UnitError(f"{error}{hint} (known: {_usual(kinds)})") from None
    for kind in kinds:
        factor = _kind_scale(kind, dimensions)
        if factor is not None:
            return kind, scale * factor
    raise UnitError(_wrong(unit, dimensions, kinds))


def _kind_scale(kind: str, dimensions: _Dimensions) -> Fraction | None:
    """What brings a scale in root units to the kind's SI unit; None if the dimensions are not the kind's."""
    if kind == "temperature":
        return None
    one, wanted = _parse(_kind(kind).si, False)
    if dimensions == wanted:
        return 1 / one
    if kind == "frequency" and dimensions == _sum((wanted, 1), ((("radian", 1),), 1)):
        return 1 / _lookup("revolution")[0]  # a radian per second is 1/(2 pi) Hz
    return None


def _kind_of(dimensions: _Dimensions) -> str | None:
    return next((kind for kind in KINDS if _kind_scale(kind, dimensions) is not None), None)


def _wrong(unit: str, dimensions: _Dimensions | None, kinds: tuple[str, ...]) -> str:
    """The message for a unit that is known but not of these kinds."""
    found = _kind_of(dimensions) if dimensions is not None else None
    what = f"{shown(unit)} is {_article(found)}" if found else f"{shown(unit)} is of another kind"
    wanted = ", ".join(map(_article, kinds[:-1])) + " or " * (len(kinds) > 1) + _article(kinds[-1])
    alike = _likely(_spelled(unit), kinds)
    hint = f"; did you mean '{alike}'?" if alike else ""
    return f"{what}; {wanted} is needed: {_usual(kinds)}{hint}"


def _article(kind: str) -> str:
    return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


def _usual(kinds: tuple[str, ...]) -> str:
    """The usual units of some kinds, as a list to show."""
    most = 5 if len(kinds) == 1 else 3
    return ", ".join(dict.fromkeys(unit for kind in kinds for unit in _kind(kind).units[:most]))


def _likely(spelled: str, kinds: tuple[str, ...]) -> str | None:
    """What was surely meant: another case, kgf for kg, lbf for lb, brackets after the solidus."""
    known = [unit for kind in kinds for unit in _kind(kind).units]
    forced = re.sub(r"^(kg|lb)(?=\s*/)", r"\1f", spelled)
    for unit in known:
        plain = unit.translate(_SPELLINGS)
        if plain.casefold() == spelled.casefold() or plain.replace("*", "") == forced:
            return unit
    numerator, _, rest = spelled.partition("/")
    if re.search(r"[A-Za-z0-9]", rest) and "(" not in rest and re.search(r"[ */.-]", rest.strip()):
        bracketed = f"{numerator.strip()}/({rest.strip()})"
        try:
            _, dimensions = _parse(bracketed, True)
        except UnitError:
            return None
        if any(_kind_scale(kind, dimensions) is not None for kind in kinds):
            return bracketed
    return None


def _nearest(spelled: str, kinds: tuple[str, ...]) -> str | None:
    known = [unit for kind in kinds for unit in _kind(kind).units]
    near = difflib.get_close_matches(spelled, known, n=1, cutoff=0.5)
    return _likely(spelled, kinds) or (near[0] if near else None)


def _sum(*parts: tuple[_Dimensions, int]) -> _Dimensions:
    """Dimensions of a product of powers."""
    total: Counter[str] = Counter()
    for dimensions, power in parts:
        for name, exponent in dimensions:
            total[name] += exponent * power
    return tuple(sorted((name, exponent) for name, exponent in total.items() if exponent))


@lru_cache(maxsize=1024)
def _parse(spelled: str, gravity: bool) -> _Scaled:
    """Scale to pint's root units and dimensions of a unit's text; `gravity` reads "g" as 9.80665 m/s²."""
    if spelled in ("", "-"):
        spelled = "1"
    if spelled.startswith("/"):
        spelled = "1" + spelled
    tokens = _tokens(spelled)
    scale, dimensions, rest = _product(tokens, 0, gravity, spelled, 0)
    if rest != len(tokens):
        raise UnitError(f"{shown(spelled)} has a bracket too many")
    return scale, dimensions


def _tokens(spelled: str) -> list[re.Match[str]]:
    tokens, at = [], 0
    while at < len(spelled):
        match = _TOKEN.match(spelled, at)
        if match is None:
            raise UnitError(f"{shown(spelled)} is no unit: it cannot be read from {shown(spelled[at:])} on")
        tokens.append(match)
        at = match.end()
    if sum(token["name"] is not None for token in tokens) > _MOST_NAMES:
        raise UnitError(f"{shown(spelled)} has too many parts for a unit")
    return tokens


def _product(
    tokens: list[re.Match[str]], at: int, gravity: bool, spelled: str, depth: int
) -> tuple[Fraction, _Dimensions, int]:
    """Factors up to a closing bracket or the end, from left to right: a/b c is (a/b) c, as in N s/m."""
    scale, dimensions = Fraction(1), _PURE
    sign, wanted = 1, True  # wanted: a factor must come next
    if depth > _DEEPEST:
        raise UnitError(f"{shown(spelled)} has too many brackets for a unit")
    while at < len(tokens) and tokens[at]["mark"] != ")":
        token, at = tokens[at], at + 1
        mark = token["mark"]
        if mark == "(":
            factor, inner, at = _product(tokens, at, gravity, spelled, depth + 1)
            at += 1  # past the closing bracket, or past the end if there is none
            if at > len(tokens):
                raise UnitError(f"{shown(spelled)} lacks a closing bracket")
        elif mark is None:
            factor, inner = _factor(token, gravity, spelled)
        elif wanted:
            raise UnitError(f"{shown(spelled)} is no unit: there is nothing before '{mark}'")
        else:
            sign, wanted = (-1 if mark == "/" else 1), True
            continue
        scale *= factor**sign
        dimensions = _sum((dimensions, 1), (inner, sign))
        sign, wanted = 1, False
    if wanted:
        raise UnitError(f"{shown(spelled)} is no unit: something is missing in it")
    return scale, dimensions, at


def _factor(token: re.Match[str], gravity: bool, spelled: str) -> _Scaled:
    """One name with its power."""
    if token["one"]:
        return Fraction(1), _PURE
    written = (token["power"] or "1").lstrip("^* ")
    power = int(written) if len(written) < 4 else 0
    if not 0 < abs(power) <= _HIGHEST_POWER:
        raise UnitError(f"{shown(spelled)} is no unit: its power {shown(written)} is out of range")
    name = "standard_gravity" if gravity and token["name"] == "g" else token["name"]
    joined = _JOINED.fullmatch(name)
    first, last = joined.groups() if joined else (None, name)
    scale, dimensions = _lookup(_ALIASES.get(last, last))
    scale, dimensions = scale**power, _sum((dimensions, power))
    if first:  # "Nm2" is N m², as it is read aloud
        factor, inner = _lookup(first)
        scale, dimensions = scale * factor, _sum((dimensions, 1), (inner, 1))
    return scale, dimensions


@lru_cache(maxsize=1)
def _registry() -> UnitRegistry[Any]:
    import pint  # here: it takes a quarter of a second

    return pint.UnitRegistry(non_int_type=Fraction, cache_folder=None)


@lru_cache(maxsize=512)
def _lookup(name: str) -> _Scaled:
    """Scale to root units and dimensions of one name; shifted and logarithmic scales are refused."""
    from pint.util import to_units_container

    registry = _registry()
    try:
        one = registry.Quantity(Fraction(1), name).to_root_units()
        two = registry.Quantity(Fraction(2), name).to_root_units()
        scale = Fraction(str(one.magnitude))
        powers = {root: Fraction(str(power)) for root, power in to_units_container(one.units).items()}
    except Exception:  # noqa: BLE001 - pint and its parser raise of all sorts at a strange name
        raise UnitError(f"unknown unit {shown(name)}") from None
    if Fraction(str(two.magnitude)) != 2 * scale or any(power.denominator != 1 for power in powers.values()):
        raise UnitError(f"unknown unit {shown(name)}")
    return scale, tuple(sorted((root, int(power)) for root, power in powers.items()))
