"""[report] of campaign.toml: what a report says of the laboratory and the items, and how it shows the results."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from fourpole.campaign.particulars import Particulars
from fourpole.campaign.shown import shown_units, wanted_units
from fourpole.quantities import FREQUENCY, ShownUnits


class ReportFile(Particulars):
    """[report]: particulars of the test, and the units in which results are shown, by the name of their kind."""

    units: Annotated[dict[str, str], BeforeValidator(wanted_units)] = Field(default_factory=dict)

    @property
    def shown(self) -> ShownUnits:
        """The units to show."""
        return shown_units(self.units)

    def summary(self) -> dict[str, Any]:
        """What is stated, as plain data; the frequency by its head with the unit."""
        found = self.model_dump(mode="json", exclude_defaults=True)
        if "frequency" in found:
            found[FREQUENCY.head] = found.pop("frequency")
        return found
