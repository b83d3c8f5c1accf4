"""The statement of a campaign: campaign.toml and tests.csv."""

from fourpole.campaign.folder import Campaign, Test, read_campaign

__all__ = ["Campaign", "Test", "read_campaign"]
