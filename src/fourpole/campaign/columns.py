"""The columns of tests.csv: those with a defined meaning, and those of the user's own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fourpole import units
from fourpole.campaign.doubts import doubtful_columns
from fourpole.campaign.schema import CampaignFile
from fourpole.errors import CampaignError, UnitError

#: Kind of quantity and allowed sign of each column of numbers, by the name of the column.
QUANTITIES: dict[str, tuple[str, str]] = {
    "pressure": ("pressure", "zero or positive"),
    "preload": ("force", "any"),
    "frequency": ("frequency", "positive"),
    "K1": ("stiffness", "positive"),
    "u(K1)": ("stiffness", "zero or positive"),
    "added_mass": ("mass", "zero or positive"),
    "u(added_mass)": ("mass", "zero or positive"),
    "temperature": ("temperature", "any"),
}
#: Columns of texts, and all columns with a defined meaning.
_TEXTS = ("test", "file", "kind", "tyre", "rig", "excluded")
_NAMES = (*_TEXTS, *QUANTITIES, "window", "time")
#: Roles of the columns that pass through to the results unchanged.
PASSED = ("extra", "time")
#: Columns that tests.csv must have.
_REQUIRED = ("test", "file", "kind", "tyre")
#: Largest number of columns; least similarity of a name that was meant as a required one.
_MOST_COLUMNS, _ALIKE = 1000, 0.6


@dataclass(frozen=True)
class Column:
    """A column of tests.csv; its `role`: "text", "quantity", "window", "time", "extra" (of the user's own)."""

    label: str
    name: str
    role: str
    unit: str = ""
    kind: str = ""


def columns_of(header: list[str]) -> list[Column]:
    """The columns that the first row names; CampaignError if one is missing or named twice, or too many are."""
    if len(header) > _MOST_COLUMNS:
        raise CampaignError(f"tests.csv row 1: names {len(header)} columns, at most {_MOST_COLUMNS} are taken")
    columns = [_column(label) for label in header]
    names = [column.name for column in columns if column.role not in PASSED]
    for name in names:
        if names.count(name) > 1:
            raise CampaignError(f"tests.csv row 1: column '{name}' stands twice: keep one of them")
    for name in _REQUIRED:
        if name not in names:
            near = units.nearest(name, header, _ALIKE)
            hint = f"; did you mean {units.shown(near)}?" if near else ""
            raise CampaignError(f"tests.csv row 1: column '{name}' is missing{hint}")
    labels = [column.label for column in columns if column.role in PASSED and column.label]
    if len(set(labels)) < len(labels):
        raise CampaignError("tests.csv row 1: two further columns have the same name: rename one of them")
    return columns


def _plain(name: str) -> str:
    """A column's name in small letters, with underscores instead of spaces."""
    return name.strip().casefold().replace(" ", "_")


_MEANT = {_plain(name): name for name in _NAMES}


def _column(label: str) -> Column:
    """The column with this head; CampaignError if it lacks its unit, or is probably misspelt."""
    written, unit = units.column_unit(label)
    name = _MEANT.get(_plain(written), written)
    if name == written and (near := units.nearest(_plain(written), _MEANT, 0.9)) and name not in _NAMES:
        raise CampaignError(
            f"tests.csv row 1: column {units.shown(label)} is not known; did you mean '{_MEANT[near]}'? "
            "(a column of your own needs a name less like it)"
        )
    if name in _TEXTS:
        return Column(label, name, "text")
    if name == "specimen":
        return Column(label, "tyre", "text")
    if name == "time":
        return Column(label, name, "time", unit or "s")
    if name not in QUANTITIES and name != "window":
        return Column(label, label, "extra")
    kind = "time" if name == "window" else QUANTITIES[name][0]
    if unit is None:
        example = {"temperature": "degC", "frequency": "Hz", "window": "s", "pressure": "bar"}.get(
            name, units.si_unit(kind)
        )
        raise CampaignError(f"tests.csv row 1: column '{name}' has no unit: write '{name} [{example}]'")
    try:
        units.to_si([1.0], unit, kind)
    except UnitError as error:
        raise CampaignError(f"tests.csv row 1: column {units.shown(label)}: {error}") from None
    return Column(label, name, "window" if name == "window" else "quantity", unit, kind)


def doubts_of(columns: list[Column], stated: CampaignFile) -> Iterator[str]:
    """The columns of the user's own, but for axes of the conditions, that were probably meant as known ones."""
    axes = {axis.name for axis in stated.conditions.axes}
    own = tuple(column.label for column in columns if column.role == "extra" and column.label not in axes)
    kinds = {name: kind for name, (kind, _) in QUANTITIES.items()}
    return doubtful_columns(own, kinds, tuple(column.name for column in columns))
