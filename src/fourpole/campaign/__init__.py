"""The statement of a campaign: campaign.toml and tests.csv."""

from fourpole.campaign.folder import Campaign, read_campaign
from fourpole.campaign.row import Test

__all__ = ["Campaign", "Test", "read_campaign"]
