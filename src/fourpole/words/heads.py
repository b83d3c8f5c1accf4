"""What the head of a column says: its words, the quantity that they mean, and a unit at its end."""

from __future__ import annotations

import re
from collections.abc import Iterator
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
#: Characters of the longest head that ends with a unit.
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


def without_unit(name: str) -> tuple[str, str | None]:
    """A head without the unit that it ends with, and this unit; None where it ends with none that fits its words.

    Examples
    --------
    >>> [without_unit(head)[1] for head in ("F / kN", "Axial Displacement mm", "acc_ms2", "Kraft in N", "Fz")]
    ['kN', 'mm', 'm/s^2', 'N', None]
    """
    match = _AT_END.fullmatch(name.strip()) if len(name) <= _LONGEST else None
    if match is None:
        return name, None
    written, named = match["unit"], quantity_named(match["name"])
    if written.casefold() in _SIDES:  # "x_in" is an input, not in inches
        return name, None
    unit = _UNITS.get(written.casefold()) or meant(written)
    kind = kind_of_unit(unit)
    if kind == "other":
        fits = "/" in unit
    else:
        fits = named == kind or (named == "" and len(written) > 1) or (kind == "voltage" and written in ("V", "mV"))
    return (match["name"], unit) if kind and fits else (name, None)
