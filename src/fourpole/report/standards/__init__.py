"""Standards as data: the requirements of each, with their sources, and what results say of them."""

from __future__ import annotations

from functools import partial

from fourpole.errors import CampaignError
from fourpole.report.standards.measures import MEASURES, STATED, Requirement, Standard, value_table
from fourpole.units import shown

#: The standards by their name in the command, from standards.toml, which says what stands in it.
STANDARDS = {
    key: Standard(
        key,
        stated["title"],
        tuple(stated["terms"]),
        tuple(
            Requirement(name, clause, text, limit, stated["sources"][source], MEASURES[measure], tuple(given))
            for name, clause, text, limit, source, measure, *given in stated["requirements"]
        ),
        partial(value_table, stated["values"]),
    )
    for key, stated in STATED["standards"].items()
}
#: The page of each, in the folder of the results.
PAGES = {name: f"report-{name}.html" for name in STANDARDS}


def standard_named(name: str) -> Standard:
    """The standard of a name; CampaignError with the list for another name."""
    found = STANDARDS.get(name.strip().lower())
    if found is None:
        raise CampaignError(f"--standard {shown(name)}: no such standard: choose one of {', '.join(STANDARDS)}")
    return found
