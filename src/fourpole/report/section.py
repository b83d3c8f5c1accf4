"""The section on the rig and the sensors as found, with links to the outliers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fourpole.report.digits import number
from fourpole.report.words.rig import RigInWords, rigs_in_words
from fourpole.report.words.shared_values import GROUPS, ShownValue
from fourpole.study.results import Results

#: Outliers that are listed by name.
_NAMED = 12


@dataclass(frozen=True)
class RigSection:
    """One rig on the page.

    Attributes
    ----------
    about : RigInWords
    groups : list of (heading, values)
        Values by group; groups without values are left out.
    outliers : list of (test, card, factor)
        The largest ones with their enlargement of the variance; the card is empty if the test has none.
    more : int
        Number of the other outliers.
    """

    about: RigInWords
    groups: list[tuple[str, list[ShownValue]]]
    outliers: list[tuple[str, str, str]]
    more: int


def rig_sections(results: Results, where: Mapping[str, str]) -> list[RigSection]:
    """The section of each rig; `where` has the card of each test."""
    return [_of_rig(found, where) for found in rigs_in_words(results)]


def _of_rig(found: RigInWords, where: Mapping[str, str]) -> RigSection:
    groups = [(heading, [value for value in found.values if value.group == group]) for group, heading in GROUPS.items()]
    named = [(item.test, where.get(item.test, ""), number(item.factor, 2)) for item in found.outliers[:_NAMED]]
    return RigSection(
        about=found,
        groups=[(heading, values) for heading, values in groups if values],
        outliers=named,
        more=len(found.outliers) - len(named),
    )
