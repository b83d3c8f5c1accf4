"""Which folder is meant: that of a campaign, or that of its results."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from fourpole.errors import CampaignError

#: A file that every campaign has, and one that all results have.
_CAMPAIGN, _RESULTS = "campaign.toml", "dynamic.csv"


def results_in(path: str | Path) -> Path:
    """The folder of results that a path means: `results` in the folder of a campaign, otherwise the path itself.

    Parameters
    ----------
    path : path
        A results folder, the folder of a campaign, or a file.

    Raises
    ------
    CampaignError
        If it is the folder of a campaign that has no results, or a folder with neither.

    Examples
    --------
    >>> results_in("tyres/results").name
    'results'
    """
    path = Path(path)
    if not path.is_dir() or (path / _RESULTS).exists():
        return path
    own = path / "results"
    check_no_way_out(path)
    if (own / _RESULTS).exists():
        return own
    if (path / _CAMPAIGN).is_file():
        raise CampaignError(f"{path}: a campaign without results: run fourpole analyse {path} first")
    if (path.parent / _CAMPAIGN).is_file():  # results that were stopped on their way, or moved
        raise CampaignError(f"{path}: holds no results: run fourpole analyse {path.parent} first")
    if (path / "master.csv").is_file():
        raise CampaignError(f"{path}: holds a master curve: name its table, {path / 'master.csv'}")
    raise CampaignError(
        f"{path}: holds neither results nor a campaign; fourpole init {path} makes a campaign of the recordings in it"
    )


def resolved(path: str | Path) -> Path:
    """The absolute path without links; `Path.resolve` fails at a circle of links before Python 3.13."""
    return Path(os.path.realpath(path))


def check_no_way_out(campaign: Path) -> None:
    """CampaignError if `results` of a campaign is a link out of the campaign, where nobody named a folder."""
    own = campaign / "results"
    if own.is_symlink() and not resolved(own).is_relative_to(resolved(campaign)):
        raise CampaignError(
            f"{own}: is a link out of the campaign, which is not followed: name the folder of the results itself, or "
            "fourpole analyse --out FOLDER"
        )


def model_in(path: str | Path) -> Path:
    """The model file that a path means: model.json, or else map.json, of results or a campaign; or the path itself.

    Raises
    ------
    CampaignError
        If the folder has no results or no model.
    """
    path = Path(path)
    if not path.is_dir():
        return path
    folder = results_in(path)
    for name in ("model.json", "map.json"):
        if (folder / name).is_file():
            return folder / name
    raise CampaignError(f"{path}: has no model yet: run fourpole fit {path}, or fourpole map {path}, first")


def is_for_keeping(folder: Path, campaign: Path) -> bool:
    """Whether a program may write and delete in a folder: it is no link, and no link in the campaign leads out to it.

    Parameters
    ----------
    folder : Path
        A folder, which need not exist.
    campaign : Path
        The campaign. A folder that is not named below it is the user's own word, and may lie anywhere.
    """
    try:
        if not stat.S_ISDIR(folder.lstat().st_mode):
            return False
    except (FileNotFoundError, NotADirectoryError):
        pass  # it will be made, or the error says why it cannot
    except (OSError, ValueError):
        return False
    if not Path(os.path.abspath(folder)).is_relative_to(os.path.abspath(campaign)):  # noqa: PTH100 - links are kept
        return True
    return Path(os.path.realpath(folder)).is_relative_to(os.path.realpath(campaign))


def why_no_folder(path: Path) -> str:
    """What is in place of a folder: nothing, or a file."""
    if path.is_file():
        return f"{path} is a file: name its folder, {path.parent}"
    return f"{path}: there is no such folder"


def why_no_tests(folder: Path) -> str:
    """What to do about a campaign without tests.csv."""
    return (
        f"{folder}: has campaign.toml, but no tests.csv, which lists the tests, and no tests.xlsx: put one there, or "
        f"fourpole init {folder} --force writes campaign.toml and tests.csv anew from the recordings"
    )


def why_no_campaign(folder: Path) -> str:
    """Why a folder without campaign.toml is no campaign, and what to do."""
    if (folder / _RESULTS).exists() and (folder.parent / _CAMPAIGN).is_file():
        return f"{folder}: holds results, not a campaign: name the campaign's folder, {folder.parent}"
    inner = sorted(one.parent for one in folder.glob(f"*/{_CAMPAIGN}"))
    if inner:
        return f"{folder}: has no {_CAMPAIGN}, but {inner[0]} has: name that folder"
    return f"{folder}: no campaign yet, for it has no {_CAMPAIGN}; fourpole init {folder} makes one of its recordings"


def make_folder(folder: str | Path) -> Path:
    """The folder, made where it does not exist; CampaignError where it cannot be made."""
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise CampaignError(f"{folder}: is a file, or lies below one: name a folder for the results") from None
    except (OSError, ValueError) as error:
        raise CampaignError(
            f"{folder}: the folder cannot be made: {getattr(error, 'strerror', None) or error}"
        ) from None
    return folder
