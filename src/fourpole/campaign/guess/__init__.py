"""A bare folder of recordings becomes a campaign: what can be guessed, with its doubts beside it."""

from fourpole.campaign.guess.together import Doubt, Guess, Row, guess_campaign, keep_existing

__all__ = ["Doubt", "Guess", "Row", "guess_campaign", "keep_existing"]
