"""Standards as data: the requirements of each, with their sources, and what results say of them."""

from __future__ import annotations

from fourpole.errors import CampaignError
from fourpole.report.standards import iso_7626_2, iso_10846_2, sae_j1085
from fourpole.report.standards.requirement import Standard
from fourpole.units import shown

#: The standards by their name in the command.
STANDARDS = {one.key: one for one in (sae_j1085.STANDARD, iso_7626_2.STANDARD, iso_10846_2.STANDARD)}

#: The page of each, in the folder of the results.
PAGES = {name: f"report-{name}.html" for name in STANDARDS}


def standard_named(name: str) -> Standard:
    """The standard of a name; CampaignError with the list for another name."""
    found = STANDARDS.get(name.strip().lower())
    if found is None:
        raise CampaignError(f"--standard {shown(name)}: no such standard: choose one of {', '.join(STANDARDS)}")
    return found
