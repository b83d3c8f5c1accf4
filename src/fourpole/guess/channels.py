"""Columns of recordings by their names and units, and the roles that columns may have."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from fourpole.words import vocabulary
from fourpole.words.heads import (
    is_command,
    is_derived,
    kind_of_unit,
    likelihood,
    meant,
    quantity_named,
    without_unit,
    words_of,
)

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
