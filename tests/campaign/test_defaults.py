"""The documentation states the uncertainties that are taken where a campaign states none."""

from pathlib import Path

import numpy as np
import pytest

from fourpole.campaign.defaults import GAIN_STD, K1_STD, MASS_STD, PHASE_STD, RIG_STD

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "campaign.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("row", "value"),
    [
        ("`std_gain` of a channel", f"{100 * GAIN_STD:g} %"),
        ("`std_phase` of a channel", f"{np.degrees(PHASE_STD):g}°"),
        ("`std` of a value of the rig", f"{100 * RIG_STD:g} % of it"),
        ("`u(K1)`, where tests.csv states `K1`", f"{100 * K1_STD:g} % of it"),
        ("`u(added_mass)`", f"{100 * MASS_STD:g} % of it"),
    ],
)
def test_the_documentation_states_what_is_taken(row, value):
    assert f"| {row} | {value} |" in TEXT
