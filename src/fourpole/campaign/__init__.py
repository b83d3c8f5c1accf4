"""A folder of tests becomes a Study: the only wiring of the pipeline."""

from fourpole.campaign.folder import Campaign, Test, read_campaign
from fourpole.campaign.study import DRAWS, Study, analyse

__all__ = ["DRAWS", "Campaign", "Study", "Test", "analyse", "read_campaign"]
