"""Campaigns with results, made on the virtual rig."""

from __future__ import annotations

import re
import shutil
from math import radians

import pytest
from tests.rig_errors import ERRORS

from fourpole import analyse
from fourpole.virtual import RADIAL_PLY, simulate_campaign


def campaign(folder, seed, *, date="", serials=True, **settings):
    """A campaign with results: one condition, four frequencies; sensors with serial numbers."""
    simulate_campaign(
        folder,
        seed=seed,
        tyres=[RADIAL_PLY],
        pressures=[170e3],
        preloads=[1000.0],
        frequencies=[11.0, 14.0, 18.0, 23.0],
        sensors=(5e-3, radians(0.2)),
        rig_std={"moving_mass": 0.15, "preload_stiffness": 120.0, "preload_damping": 5.0},
        **settings,
    )
    stated = folder / "campaign.toml"
    text = f"date = {date}\n" if date else ""
    text += stated.read_text()
    if serials:
        text = re.sub(r'column = "(F1|V1|V2|F|x)"', r'column = "\1", serial = "SN \1"', text)
    stated.write_text(text)
    analyse(folder, monte_carlo=0).write(folder / "results")
    return folder


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """Two campaigns that share their sensors and rig, in a tree of folders."""
    folder = tmp_path_factory.mktemp("lab")
    campaign(folder / "2024", 11, date="2024-05-31", **ERRORS)
    campaign(folder / "south" / "2025", 12, date="2025-05-31", **ERRORS)
    return folder


@pytest.fixture
def place(made, tmp_path):
    """A copy to change; times of change are kept."""
    return shutil.copytree(made, tmp_path / "lab-folder")
