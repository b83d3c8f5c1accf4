"""[report] of campaign.toml: how the results are shown."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from fourpole.campaign.channels import File
from fourpole.campaign.shown import shown_units, wanted_units
from fourpole.quantities import ShownUnits


class ReportFile(File):
    """[report]: the units in which results are shown, by the name of their kind."""

    units: Annotated[dict[str, str], BeforeValidator(wanted_units)] = Field(default_factory=dict)

    @property
    def shown(self) -> ShownUnits:
        """The units to show."""
        return shown_units(self.units)

    def summary(self) -> dict[str, Any]:
        """What is stated, as plain data."""
        return self.model_dump(mode="json", exclude_defaults=True)
