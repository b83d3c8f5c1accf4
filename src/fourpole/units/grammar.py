"""The grammar of units: a text becomes a scale to root units and its dimensions.

The text is untrusted. Its length and letters are limited, and it is split here into unit names. pint looks up single
names only, so that no text can make pint evaluate an expression. Arithmetic is exact (fractions).
"""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from fractions import Fraction
from functools import lru_cache
from itertools import islice
from math import inf
from typing import TYPE_CHECKING, Any

from fourpole.errors import UnitError

if TYPE_CHECKING:
    from pint import UnitRegistry

Dimensions = tuple[tuple[str, int], ...]
_Scaled = tuple[Fraction, Dimensions]
_PURE: Dimensions = ()
_LONGEST = 100
_MOST_NAMES = 12
_DEEPEST = 3
_HIGHEST_POWER = 4
#: Longest word, and most known ones, that are compared: the time grows with their product.
_LONGEST_COMPARED, _MOST_COMPARED = 100, 500
_LARGEST = 1e30  # [SI] magnitude: the tenth power is still a number, and no quantity of a rig is as large
_SMALLEST = 1e-30  # [SI] magnitude other than zero: its inverse is within the same bound
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
SPELLINGS = str.maketrans(
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
_TOKEN = re.compile(
    r"\s*(?:(?P<name>[A-Za-zµ°%‰]+(?:_[A-Za-z0-9]+)*)(?P<power>(?:\^|\*\*)?\s*[+-]?[0-9]+)?"
    r"|(?P<one>1(?![0-9]))|(?P<mark>[*/().-]))\s*"
)
# Products of units written without a sign between them; pint reads "Nm" as a textile unit and does not know "lbfs".
_JOINED = re.compile(r"([kMGmµu]?(?:N|Pa|J)|lbf|kgf)(s|m|mm|cm)")


def shown(text: object, limit: int = 60) -> str:
    r"""A text made safe for a message: quoted, shortened, control characters escaped.

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
    try:
        whole = str(text)
    except ValueError:  # an integer of more digits than Python writes
        whole = f"{text:#x}"
    kept = whole if len(whole) <= limit else whole[: limit - 1] + "…"
    clean = "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in kept)
    return f"'{clean}'"


#: Number of words that may still be compared; None without a bound.
_LEFT: ContextVar[list[int] | None] = ContextVar("left", default=None)


@contextmanager
def hints(most: int) -> Iterator[None]:
    """At most so many words are compared by `nearest` within the context.

    A file with a mistake in each cell is then read about as fast as a sound one.
    """
    token = _LEFT.set([most])
    try:
        yield
    finally:
        _LEFT.reset(token)


def nearest(word: str, known: Iterable[str], cutoff: float = 0.5) -> str | None:
    """The known word most similar to a word of a user, for a message; None if none is similar, or the word is long.

    Parameters
    ----------
    word : str
        As written.
    known : iterable of str
        Only the first 500 are compared.
    cutoff : float [1]
        Least similarity, of at most 1, as in `difflib.get_close_matches`.

    Examples
    --------
    >>> nearest("radail", ["bias", "radial"])
    'radial'
    """
    left = _LEFT.get()
    if len(word) > _LONGEST_COMPARED or (left is not None and left[0] <= 0):
        return None
    if left is not None:
        left[0] -= 1
    return next(iter(difflib.get_close_matches(word, islice(known, _MOST_COMPARED), n=1, cutoff=cutoff)), None)


def spelled_out(text: str, longest: int = _LONGEST) -> str:
    """The text with one spelling for signs that look alike; UnitError if it is too long or has other characters."""
    if not isinstance(text, str):
        raise UnitError(f"{shown(text)} is not a text with a unit")
    if len(text) > longest:
        raise UnitError(f"{shown(text)} is too long for a quantity or unit")
    spelled = text.translate(SPELLINGS).strip()
    if spelled.startswith("[") and spelled.endswith("]"):
        spelled = spelled[1:-1].strip()
    if not (spelled.isascii() and spelled.isprintable()):
        for character in spelled:
            if not (character.isascii() and character.isprintable()) and character not in "µ°‰":
                raise UnitError(f"{shown(text)} has a character that no unit has: {shown(character)}")
    return spelled


def add_up(*parts: tuple[Dimensions, int]) -> Dimensions:
    """Dimensions of a product of powers."""
    total: Counter[str] = Counter()
    for dimensions, power in parts:
        for name, exponent in dimensions:
            total[name] += exponent * power
    return tuple(sorted((name, exponent) for name, exponent in total.items() if exponent))


@lru_cache(maxsize=1024)
def parse(spelled: str, gravity: bool) -> _Scaled:
    """Scale to pint's root units and dimensions of a unit's text; `gravity` reads "g" as 9.80665 m/s²."""
    if spelled in ("", "-"):
        spelled = "1"
    if spelled.startswith("/"):
        spelled = "1" + spelled
    tokens, place = list[re.Match[str]](), 0
    while place < len(spelled):
        match = _TOKEN.match(spelled, place)
        if match is None:
            raise UnitError(f"{shown(spelled)} is no unit: it cannot be read from {shown(spelled[place:])} on")
        tokens.append(match)
        place = match.end()
    if sum(token["name"] is not None for token in tokens) > _MOST_NAMES:
        raise UnitError(f"{shown(spelled)} has too many parts for a unit")
    scale, dimensions, rest = _product(tokens, 0, gravity, spelled, 0)
    if rest != len(tokens):
        raise UnitError(f"{shown(spelled)} has a bracket too many")
    return scale, dimensions


def _product(
    tokens: list[re.Match[str]], at: int, gravity: bool, spelled: str, depth: int
) -> tuple[Fraction, Dimensions, int]:
    """Factors up to a closing bracket or the end, from left to right: a/b c is (a/b) c, as in N s/m."""
    scale, dimensions = Fraction(1), _PURE
    sign, wanted = 1, True  # `wanted` is true while a factor must come next
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
        dimensions = add_up((dimensions, 1), (inner, sign))
        sign, wanted = 1, False
    if wanted:
        raise UnitError(f"{shown(spelled)} is no unit: something is missing in it")
    return scale, dimensions, at


def _factor(token: re.Match[str], gravity: bool, spelled: str) -> _Scaled:
    """Scale and dimensions of one unit name with its power."""
    if token["one"]:
        return Fraction(1), _PURE
    written = (token["power"] or "1").lstrip("^* ")
    power = int(written) if len(written) < 4 else 0
    if not 0 < abs(power) <= _HIGHEST_POWER:
        raise UnitError(f"{shown(spelled)} is no unit: its power {shown(written)} is out of range")
    name = "standard_gravity" if gravity and token["name"] == "g" else token["name"]
    joined = _JOINED.fullmatch(name)
    first, last = joined.groups() if joined else (None, name)
    scale, dimensions = lookup(_ALIASES.get(last, last))
    scale, dimensions = scale**power, add_up((dimensions, power))
    if first:  # "Nm2" is N m²: the power belongs to the last unit
        factor, inner = lookup(first)
        scale, dimensions = scale * factor, add_up((dimensions, 1), (inner, 1))
    return scale, dimensions


# ---- the units that most campaigns use, by pint's root units, so that pint is loaded for other units only: loading
# pint with its registry takes half a second, in every command and worker process. The tests compare them with pint.

_PI = Fraction("3.1415926535897932384626433832795028841971693993751")
_POUND, _GRAVITY, _INCH = Fraction("453.59237"), Fraction("9.80665"), Fraction("0.0254")
_PREFIXES = {
    prefix: Fraction(10) ** power
    for prefix, power in {"": 0, "M": 6, "k": 3, "h": 2, "da": 1, "c": -2, "m": -3, "µ": -6, "u": -6, "G": 9}.items()
}


def _powers(**powers: int) -> Dimensions:
    return tuple(sorted(powers.items()))


_LENGTH, _MASS, _TIME, _ANGLE = _powers(meter=1), _powers(gram=1), _powers(second=1), _powers(radian=1)
_FORCE = _powers(gram=1, meter=1, second=-2)
_PRESSURE = _powers(gram=1, meter=-1, second=-2)
#: Symbol -> its prefixes with blanks between them ("." is none), SI value in root units, dimensions.
_PREFIXED: dict[str, tuple[str, int | Fraction, Dimensions]] = {
    "m": (". k c m µ u", 1, _LENGTH),
    "g": (". k m", 1, _MASS),
    "s": (". m µ u", 1, _TIME),
    "N": (". M k da m", 1000, _FORCE),
    "Pa": (". G M k h", 1000, _PRESSURE),
    "bar": (". m", 10**8, _PRESSURE),
    "Hz": (". k m", 1, _powers(second=-1)),
    "rad": (". m", 1, _ANGLE),
    "J": (". k m", 1000, _powers(gram=1, meter=2, second=-2)),
    "V": (". k m µ u", 1000, _powers(gram=1, meter=2, second=-3, ampere=-1)),
}
_ALONE: dict[str, tuple[int | Fraction, Dimensions]] = {
    "micrometer": (Fraction(1, 10**6), _LENGTH),
    "in": (_INCH, _LENGTH),
    "ft": (12 * _INCH, _LENGTH),
    "mph": (5280 * 12 * _INCH / 3600, _powers(meter=1, second=-1)),
    "standard_gravity": (_GRAVITY, _powers(meter=1, second=-2)),
    "t": (10**6, _MASS),
    "lb": (_POUND, _MASS),
    "pound": (_POUND, _MASS),
    "kgf": (1000 * _GRAVITY, _FORCE),
    "kilogram_force": (1000 * _GRAVITY, _FORCE),
    "lbf": (_POUND * _GRAVITY, _FORCE),
    "psi": (_POUND * _GRAVITY / _INCH**2, _PRESSURE),
    "sec": (1, _TIME),
    "min": (60, _TIME),
    "h": (3600, _TIME),
    "rpm": (2 * _PI / 60, _powers(radian=1, second=-1)),
    "deg": (_PI / 180, _ANGLE),
    "degree": (_PI / 180, _ANGLE),
    "revolution": (2 * _PI, _ANGLE),
    "K": (1, _powers(kelvin=1)),
    "percent": (Fraction(1, 100), ()),
    "ppm": (Fraction(1, 10**6), ()),
}
#: Scale to root units and dimensions, by name.
USUAL: dict[str, tuple[Fraction, Dimensions]] = {
    **{
        prefix.strip(".") + symbol: (_PREFIXES[prefix.strip(".")] * scale, dimensions)
        for symbol, (prefixes, scale, dimensions) in _PREFIXED.items()
        for prefix in prefixes.split()
    },
    **{name: (Fraction(scale), dimensions) for name, (scale, dimensions) in _ALONE.items()},
}


@lru_cache(maxsize=1)
def _registry() -> UnitRegistry[Any]:
    import pint  # imported on first use, since the import takes a quarter of a second

    return pint.UnitRegistry(non_int_type=Fraction, cache_folder=None)


@lru_cache(maxsize=512)
def lookup(name: str) -> _Scaled:
    """Scale to root units and dimensions of one unit name; UnitError for shifted and logarithmic scales."""
    return USUAL[name] if name in USUAL else _looked_up(name)


def _looked_up(name: str) -> _Scaled:
    """The same, from pint."""
    from pint.util import to_units_container

    registry = _registry()
    try:
        one = registry.Quantity(Fraction(1), name).to_root_units()
        two = registry.Quantity(Fraction(2), name).to_root_units()
        scale = Fraction(str(one.magnitude))
        powers = {root: Fraction(str(power)) for root, power in to_units_container(one.units).items()}
    except Exception:  # noqa: BLE001 - pint and its parser raise errors of many types for an unknown name
        raise UnitError(f"unknown unit {shown(name)}") from None
    if Fraction(str(two.magnitude)) != 2 * scale or any(power.denominator != 1 for power in powers.values()):
        raise UnitError(f"unknown unit {shown(name)}")
    return scale, tuple(sorted((root, int(power)) for root, power in powers.items()))


def bounded(value: float | Fraction, text: object) -> float:
    """The value of a quantity [SI]; UnitError, with the text as written, unless it is 0 or of magnitude 1e-30 to 1e30.

    Examples
    --------
    >>> bounded(1e30, "1e30 N")
    1e+30
    """
    try:
        number = float(value)
    except OverflowError:
        number = inf
    if value != 0 and not _SMALLEST <= abs(number) <= _LARGEST:
        what = "is beyond the range of numbers"
        raise UnitError(f"{shown(text)} {what}: in SI units, magnitudes of {_SMALLEST:g} to {_LARGEST:g} are taken")
    return number
