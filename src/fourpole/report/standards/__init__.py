"""Standards as data: the requirements of each, with their sources, and what results say of them."""

from __future__ import annotations

import tomllib

from fourpole.errors import CampaignError
from fourpole.report.html import packaged
from fourpole.report.standards.measures import MEASURES, VALUES
from fourpole.report.standards.requirement import Requirement, Standard
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
        VALUES[key],
    )
    for key, stated in tomllib.loads(packaged("standards.toml", "fourpole.report.standards")).items()
}
#: The page of each, in the folder of the results.
PAGES = {name: f"report-{name}.html" for name in STANDARDS}


def standard_named(name: str) -> Standard:
    """The standard of a name; CampaignError with the list for another name."""
    found = STANDARDS.get(name.strip().lower())
    if found is None:
        raise CampaignError(f"--standard {shown(name)}: no such standard: choose one of {', '.join(STANDARDS)}")
    return found
