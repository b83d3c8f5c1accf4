"""A bare folder of recordings becomes a campaign: what can be guessed, with its doubts beside it."""

from fourpole.guess.together import guess_campaign
from fourpole.guess.write import Doubt, GuessedCampaign, Row, keep_existing

__all__ = ["Doubt", "GuessedCampaign", "Row", "guess_campaign", "keep_existing"]
