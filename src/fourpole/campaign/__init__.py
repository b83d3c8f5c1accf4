"""The statement of a campaign: campaign.toml and tests.csv. Its names load when they are first used, for workers."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fourpole.campaign.folder import Campaign, read_campaign
    from fourpole.campaign.row import Test

__all__ = ["Campaign", "Test", "read_campaign"]
_HOME = {"Campaign": "folder", "read_campaign": "folder", "Test": "row"}


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f"fourpole.campaign.{_HOME[name]}"), name)
    raise AttributeError(f"module 'fourpole.campaign' has no attribute {name!r}")
