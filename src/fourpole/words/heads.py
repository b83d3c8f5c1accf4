"""What the head of a column says: its words, the quantity that they mean, and a unit at its end; roles of columns."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache

from fourpole import units
from fourpole.errors import UnitError
from fourpole.units import MOTIONS
from fourpole.units.kinds import kind_named
from fourpole.words import vocabulary

_CHANNELS = vocabulary()["channels"]
_QUANTITIES = {quantity: frozenset(text.split()) for quantity, text in _CHANNELS["quantities"].items()}
_MODELS = tuple((quantity, re.compile(pattern)) for quantity, pattern in _CHANNELS["models"].items())
_TAILS, _UNITS = frozenset(_CHANNELS["tails"].split()), _CHANNELS["units"]
_DERIVED = frozenset(_CHANNELS["derived"].split())
_SIDES = frozenset(word for key in ("in", "out", "lower", "upper") for word in _CHANNELS[key].split())
_MAIN, _MINOR = frozenset(_CHANNELS["main"].split()), frozenset(_CHANNELS["minor"].split())
_COMMAND = re.compile(_CHANNELS["command"])
_SPLIT = re.compile(r"[A-ZÄÖÜ]?[a-zäöüßà-ÿ]+|[A-ZÄÖÜ]+(?![a-zäöüßà-ÿ])|\d+")
#: A unit behind the name: "F / kN", "Kraft in N", "Axial Force kN", "disp_mm".
_AT_END = re.compile(
    r"(?P<name>.*?[^\W_][)\]]?)(?:\s*/\s*|[\s_,]+in\s+|[\s_,]+)\(?(?P<unit>(?i:k?[mn]m?_(?:s2?|h))|[^\W\d_][^\s_,()]*|°[CF])\)?",
    re.DOTALL,
)
#: A unit with the kind of an amplitude: "N rms", "mm pk-pk".
_KINDED = re.compile(r"(?P<unit>\S+(?: \S+)?) (?P<kind>(?i:rms|p-?p|pk(?:-pk)?|peak|0-?pk?|eff))")
#: A unit that is set off: "E'/MPa", "f in Hz", "x, mm"; characters of the longest head that ends with a unit.
_SET_OFF = re.compile(r"(?P<name>[^/,]+?)(?:/|,|\sin\s)(?P<unit>[^,]+)")
_LONGEST = 100
#: Characters of a word that may be a part of a longer one, and of one in Chinese or Japanese letters.
_PART, _PART_HAN = 5, 2
_KINDS = ("force", *MOTIONS, "voltage", "time", "pressure", "frequency", "angle")
_MEANT = {one.casefold(): one for kind in reversed(_KINDS) for one in reversed(kind_named(kind).units)} | _UNITS


def words_of(name: str) -> list[str]:
    """The words of a head, without its unit, in small letters.

    Examples
    --------
    >>> words_of("AccTop_1 [g]")
    ['acc', 'top', '1', 'acctop']
    """
    bare = units.column_unit(name)[0]
    found = [word.casefold() for word in _SPLIT.findall(bare)]
    return list(dict.fromkeys([*found, *filter(None, re.split(r"[\W_]+", bare.casefold()))]))


def is_command(name: str) -> bool:
    """Whether a column is a command signal by its name, rather than a measured one.

    Examples
    --------
    >>> is_command("Sollweg [mm]"), is_command("変位指令"), is_command("Drive")
    (True, True, False)
    """
    return _COMMAND.search(" ".join(words_of(name))) is not None


def is_derived(name: str) -> bool:
    """Whether a column is computed from a measured one, such as a rate or the error of a controller, by its name."""
    words = words_of(name)
    return not _DERIVED.isdisjoint(words) and _QUANTITIES["time"].isdisjoint(words)


def likelihood(name: str) -> int:
    """Number of words of a head that say it is the main one of its quantity, less those that say it is not.

    Examples
    --------
    >>> likelihood("Fz_load"), likelihood("Traversenweg"), likelihood("x")
    (2, -1, 0)
    """
    words = words_of(name)
    minor = sum(word in _MINOR and (len(words) > 1 or len(word) > 1) for word in words)
    return sum(word in _MAIN for word in words) - minor - sum(one > "\u3000" and one in name for one in _MINOR)


def quantity_named(name: str) -> str:
    """The quantity that a head means, a key of `channels.quantities`; empty if it has no known word.

    A word of two letters or more counts before a symbol, an earlier quantity before a later one.

    Examples
    --------
    >>> [quantity_named(name) for name in ("Standardweg", "Schwinggeschwindigkeit", "208C03 SN 42", "Ch1")]
    ['displacement', 'velocity', 'force', '']
    """
    hits = set(_hits(name))
    if is_derived(name):
        return "other"
    if (True, "reference") in hits:
        return "reference"
    measured = {quantity for _, quantity in hits} & {"force", *MOTIONS}
    if (True, "drive") in hits and not measured:
        return "drive"
    ranked = [(is_long, -at, of) for at, of in enumerate(_QUANTITIES) if of != "drive" for is_long in (True, False)]
    is_long, _, found = max((one for one in ranked if (one[0], one[2]) in hits), default=(False, 0, ""))
    return "temperature" if found == "time" and not is_long and name.strip().startswith("T") else found


def _hits(name: str) -> Iterator[tuple[bool, str]]:
    """Whether a word is long, and its quantity, for each word of a head that is known."""
    for word in words_of(name):
        whole = [(len(word) > 1 or word > "\u3000", of) for of, known in _QUANTITIES.items() if word in known]
        yield from whole or [(True, of) for of, pattern in _MODELS if pattern.fullmatch(word)] or _parts(word)


@lru_cache(4096)
def _parts(word: str) -> list[tuple[bool, str]]:
    """The quantity of the longest known word at the end of a word, else of the longest at its beginning."""
    found = [
        (word.endswith(one), len(one), of)
        for of, known in _QUANTITIES.items()
        for one in known
        if (len(one) >= (_PART_HAN if one > "\u3000" else _PART) and (word.startswith(one) or word.endswith(one)))
        or (one in _TAILS and word.endswith(one))
    ]
    return [(True, max(found)[2])] if found else []


def kind_of_unit(unit: str | None) -> str:
    """Kind of quantity of a unit; "other" of a unit that is none of a channel, empty where it is not known."""
    if unit is None or unit in ("1", "-"):
        return ""
    if unit.strip() in ("°C", "degC", "deg C", "C", "K", "°F", "degF"):
        return "temperature"
    try:
        return units.channel_scale(unit, _KINDS)[0]
    except UnitError:
        return "other" if units.is_unit(unit) or unit.endswith(("/s", "/sec", "/min", "/h")) else ""


def meant(unit: str) -> str:
    """The known unit of a channel that a text means if only its case differs, or an ending of a head; else the text.

    Examples
    --------
    >>> meant("KN"), meant("LBF"), meant("ms2"), meant("mm"), meant("counts")
    ('kN', 'lbf', 'm/s^2', 'mm', 'counts')
    """
    return unit if kind_of_unit(unit) else _MEANT.get(unit.strip().casefold(), unit)


def head_and_unit(head: str, stated: str | None = None) -> tuple[str, str | None]:
    """The name in a head and its unit: that stated beside it, or in brackets, or at its end.

    Examples
    --------
    >>> [head_and_unit(head) for head in ("G' [kPa]", "E''/MPa", "f in Hz", "Hz", "V1/F1")]
    [("G'", 'kPa'), ("E''", 'MPa'), ('f', 'Hz'), ('Hz', 'Hz'), ('V1/F1', None)]
    """
    name, unit = units.column_unit(head)
    unit = unit if stated is None else stated
    if unit is not None and (kind := _KINDED.fullmatch(unit)) is not None and len(unit) <= _LONGEST:
        name, unit = f"{name} {kind['kind']}", kind["unit"]
    if unit is not None:
        return name.rstrip(" /"), unit
    return (name, name) if name in ("Hz", "kHz", "rad/s", "rpm") else without_unit(name)


def without_unit(name: str) -> tuple[str, str | None]:
    """A head without the unit that it ends with, and this unit; None where it ends with none that fits its words.

    Examples
    --------
    >>> [without_unit(head)[1] for head in ("F / kN", "Axial Displacement mm", "acc_ms2", "K_n_per_mm", "Fz")]
    ['kN', 'mm', 'm/s^2', 'N/mm', None]
    """
    if len(name) > _LONGEST or name.strip().casefold() in _MEANT:
        return name, None
    apart = _SET_OFF.fullmatch(name.strip())
    if apart is not None and units.is_unit(apart["unit"]) and not apart["unit"].strip().isdigit():
        unit = apart["unit"].strip()
        return apart["name"].strip(), unit[1:-1] if unit.startswith("(") and unit.endswith(")") else unit
    whole = name.strip().split("_")
    for at in range(1, len(whole) - 1):
        if (unit := _snake(tuple(one.casefold() for one in whole[at:]))) and _fits("_".join(whole[:at]), unit, "__"):
            return "_".join(whole[:at]), unit
    match = _AT_END.fullmatch(name.strip())
    if match is None or match["unit"].casefold() in _SIDES:  # "x_in" is an input, not in inches
        return name, None
    unit = _UNITS.get(match["unit"].casefold()) or meant(match["unit"])
    return (match["name"], unit) if _fits(match["name"], unit, match["unit"]) else (name, None)


def _fits(name: str, unit: str, written: str) -> bool:
    """Whether a head may end with a unit, by its other words."""
    named, kind = quantity_named(name), kind_of_unit(unit)
    if kind in ("", "other"):
        return kind != "" and ("/" in unit or unit == "%")
    unclear = kind == "angle" or named in ("reference", "drive") or not any(is_long for is_long, _ in _hits(name))
    return named == kind or (unclear and len(written) > 1) or (kind == "voltage" and written in ("V", "mV"))


@lru_cache(4096)
def _snake(words: tuple[str, ...]) -> str:
    """The unit of the last words of a head in snake case; empty if they are none.

    Examples
    --------
    >>> _snake(("n", "per", "mm")), _snake(("kn", "m")), _snake(("ms2", "per", "n")), _snake(("phase", "deg"))
    ('N/mm', 'kN/m', '(m/s^2)/N', '')
    """
    if (whole := "_".join(words)) in _UNITS:
        return _UNITS[whole]
    parts = " ".join(("1", *words) if words[0] == "per" else words).split(" per ")
    parts = list(words) if len(parts) == 1 else parts
    atoms = ["" if one in _SIDES - {"1"} else _MEANT.get(one, one if one == "1" else "") for one in parts]
    if not 2 <= len(atoms) <= 3 or not all(atoms):
        return ""
    unit = "/".join(f"({one})" if "/" in one else one for one in atoms)
    return unit if units.is_unit(unit) else ""


_IN, _OUT, _NUMBERED, LOWER, UPPER = (
    frozenset(vocabulary()["channels"][key].split()) for key in ("in", "out", "numbered", "lower", "upper")
)


@dataclass(frozen=True)
class Column:
    """Quantity and side of a column, as its name and unit state them.

    Attributes
    ----------
    name : str
    unit : str or None
    quantity : str
        Empty where neither name nor unit says it; "other" for one that no role has.
    side : str
        "in" at the contact, "out" at the moving mass; empty where the name does not say it.
    likely : int
        Number of words that say the column is the main one of its quantity, less those that say it is not.
    by_number : bool
        Whether only a number says the side, as in "LVDT 2".
    """

    name: str
    unit: str | None
    quantity: str
    side: str = ""
    likely: int = 0
    by_number: bool = field(default=False, repr=False)

    @property
    def in_volts(self) -> bool:
        """Whether the column has the unit of a voltage, so that its sensitivity would be needed."""
        return kind_of_unit(self.unit) == "voltage"


@dataclass(frozen=True)
class Role:
    """The column of a role, with those `beside` it of one mean, the unit and sign of the numbers, and the doubts."""

    role: str
    column: str
    unit: str | None
    quantity: str
    invert: bool = False
    doubts: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()

    def doubted(self, doubt: str) -> Role:
        """The role with one more doubt."""
        return replace(self, doubts=(*self.doubts, doubt))


def column_of(name: str, unit: str | None) -> Column:
    """The quantity and the side of a column, by its unit and by the words of its name.

    Examples
    --------
    >>> column_of("Beschl_unten", "m/s2")
    Column(name='Beschl_unten', unit='m/s2', quantity='acceleration', side='in', likely=0)
    >>> column_of("Axial Force kN", None)
    Column(name='Axial Force kN', unit='kN', quantity='force', side='', likely=0)
    """
    bare, ending = without_unit(name) if unit is None else (name, None)
    unit = meant(unit) if unit else ending
    words, named, stated = words_of(bare), quantity_named(bare), kind_of_unit(unit)
    aside = named in ("reference", "drive", "temperature", "pressure") and stated == "displacement"
    quantity = named if aside or stated in ("", "voltage") else stated
    if is_derived(bare):
        quantity = "other"
    elif is_command(bare) and not {named, stated} & {"temperature", "pressure", "frequency", "time"}:
        quantity = "drive"
    if _NUMBERED & set(words):
        words = [word for word in words if not word.isdigit() and word not in ("input", "output")]
    parts = {*words, *(one for one in _IN | _OUT | LOWER | UPPER if one > "\u3000" and one in bare)}
    said = {side: ends & parts for side, ends in (("in", _IN | LOWER), ("out", _OUT | UPPER))}
    by_word = {side: found - {"1", "2"} for side, found in said.items()}
    sides = [side for side, found in (by_word if any(by_word.values()) else said).items() if found]
    by_number = len(sides) == 1 and not by_word[sides[0]]
    symbol = any(len(word) == 2 and word[1].isdigit() for word in words)  # V1 says it, as a word does
    side = sides[0] if len(sides) == 1 else ""
    return Column(name, unit, quantity, side, likelihood(bare), by_number and not symbol)
