"""The documentation states the uncertainties that are taken where a campaign states none."""

from pathlib import Path

import numpy as np
import pytest

from fourpole.campaign.channels import ChannelFile
from fourpole.campaign.defaults import (
    FRAME_STD,
    FRICTION_STD,
    GAIN_STD,
    IEPE_STD,
    K1_STD,
    LOW_CUT_STD,
    MASS_STD,
    ON_DRIVE,
    PHASE_STD,
    RIG_STD,
    SIMULTANEOUS_STD,
    SUPPORT_STD,
)
from fourpole.campaign.schema import ConditionsFile, SpecimenFile
from fourpole.core.components import COMPONENTS, component
from fourpole.core.rig import PARAMETERS
from fourpole.core.sources import Kind
from fourpole.core.unstated import PRESLIDING, PRESLIDING_STD

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "campaign.md").read_text(encoding="utf-8")


def std(kind):
    return component(kind).std


def pair(gain, phase):
    return f"{100 * std(gain):g} % and {np.degrees(std(phase)):g}°"


MOUNTING = pair(Kind.MOUNTING_GAIN, Kind.MOUNTING_PHASE)
REMOUNTING = pair(Kind.REMOUNTING_GAIN, Kind.REMOUNTING_PHASE)
HALF = "half of `std_gain` and `std_phase`"


@pytest.mark.parametrize(
    ("row", "value"),
    [
        ("of a rig that moves add to its preload spring at each frequency", f"{100 * SUPPORT_STD:g} % of it"),
        ("none where no force is recorded, as a blocking mass hangs freely", f"{FRICTION_STD:g} N"),
        ("without `frame_stiffness`", f"{1e-6 / FRAME_STD:g} kN/mm, at least"),
        ("`std_gain` of a channel", f"{100 * GAIN_STD:g} %"),
        ("`std_phase` of a channel", f"{np.degrees(PHASE_STD):g}°"),
        ("`std` of a value of the rig", f"{100 * RIG_STD:g} % of it"),
        ("`u(K1)`, where tests.csv states `K1`", f"{100 * K1_STD:g} % of it"),
        ("`u(added_mass)`", f"{100 * MASS_STD:g} % of it"),
        ("`std_delay` of a channel", f"{1e6 * std(Kind.DELAY):g} µs"),
        ("`std_delay`, with `[logger] simultaneous = true`", f"{1e6 * SIMULTANEOUS_STD:g} µs"),
        ("`std_low_cut`, with another or no `coupling`", f"{std(Kind.LOW_CUT):g} Hz"),
        ('`std_low_cut`, with `coupling = "iepe"`', f"{IEPE_STD:g} Hz"),
        ("`std_low_cut` of an acceleration, without `coupling`", f"{IEPE_STD:g} Hz"),
        (
            "below it the friction is a spring",
            f"{1e3 * PRESLIDING:g} mm, within a factor of {np.exp(PRESLIDING_STD):.2g}",
        ),
        ("`std_low_cut`, with `low_cut`", f"{100 * LOW_CUT_STD:g} % of it"),
        ("`std_slope` of a channel", f"{100 * std(Kind.SLOPE):g} %"),
        ('`std_mounting` of V1, `mounted = "specimen"` or not stated', f"{HALF}, at most {MOUNTING}"),
        ('`std_mounting`, with `mounted = "drive"`', f"{ON_DRIVE:g} of that"),
        ("`std_remounting` of F1 and V2", f"{HALF}, at most {REMOUNTING}"),
        ("`std_remounting`, with `remounted_with_mass = true`", HALF),
        ("`linearity` of F1, load and deflection", f"{100 * std(Kind.K1_LINEARITY):g} %"),
        (
            "`preload_damping` of a rig that moves",
            f"0 ± {100 * std(Kind.RIG_VALUE):g} % of the critical damping 2 √(K3 m)",
        ),
        ("`std_block` in `[conditions]`", f"{100 * std(Kind.BLOCK):g} % and {std(Kind.ANGLE_BLOCK):g} rad"),
        ("`std_drift` in `[conditions]`", f"{100 * std(Kind.DRIFT):g} % and {std(Kind.ANGLE_DRIFT):g} rad"),
    ],
)
def test_the_documentation_states_what_is_taken(row, value):
    assert f"{row} | {value} |" in TEXT


@pytest.mark.parametrize("key", ChannelFile.model_fields)
def test_the_documentation_has_every_key_of_a_channel(key):
    assert f"`{key}`" in TEXT


def test_every_key_of_a_component_is_one_of_campaign_toml():
    known = {*ChannelFile.model_fields, *ConditionsFile.model_fields, *SpecimenFile.model_fields, *PARAMETERS}
    known.add("fixture_stiffness")
    assert {row.key for row in COMPONENTS if row.key} <= known
