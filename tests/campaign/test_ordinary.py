"""The ordinary errors of a campaign: keys, units, unknown words, defaults, exact channels, and none at all."""

from math import radians, sqrt

import pytest

from fourpole.campaign.channels import CHANNEL_KINDS
from fourpole.campaign.schema import parse_campaign
from fourpole.core.chain import HighPass
from fourpole.core.components import component
from fourpole.core.phasor import CHANNELS
from fourpole.core.sources import Kind
from fourpole.errors import CampaignError

RIG = '[rig]\nmoving_mass = "15 kg"\npreload_stiffness = "12 kN/m"\n'
BLOCKED = '[rig]\noutput = "blocked"\n'
ZERO = '[unstated]\nordinary = "zero"\n'
UNITS = {"force_in": "N", "motion_in": "m/s", "motion_out": "m/s", "load": "N", "deflection": "mm"}
TOP = 50.0


def stated(role="motion_in", keys="", *, more="", drive="", **units):
    """A campaign with all channels, one of which has further keys."""
    lines = [
        f'{name} = {{ column = "c", unit = "{unit}"{f", {keys}" if name == role and keys else ""} }}'
        for name, unit in {**UNITS, **units}.items()
    ]
    return parse_campaign("\n".join([more if "[rig]" in more else RIG + more, "[channels]", *lines, drive]))


def errors_of(campaign, role="motion_in"):
    """Delay, low-cut, slope, mounting, remounting and linearity of a channel."""
    ordinary, channel = campaign.ordinary, campaign.channels.named(role)
    return {
        "delay": ordinary.delay(channel),
        "low_cut": ordinary.low_cut(channel),
        "slope": ordinary.slope(channel, TOP) * TOP**2,
        "mounting": ordinary.mounting(channel),
        "remounting": ordinary.remounting(channel),
        "linearity": ordinary.linearity(channel),
    }


def table(gain, angle=None):
    return component(gain).std if angle is None else complex(component(gain).std, component(angle).std)


TABLE = {
    "delay": table(Kind.DELAY),
    "low_cut": table(Kind.LOW_CUT),
    "slope": table(Kind.SLOPE),
    "mounting": table(Kind.MOUNTING_GAIN, Kind.MOUNTING_PHASE),
    "remounting": table(Kind.REMOUNTING_GAIN, Kind.REMOUNTING_PHASE),
    "linearity": table(Kind.K1_LINEARITY),
}
#: Half of std_gain and of std_phase where neither is stated.
HALF = complex(0.005, radians(0.25))
#: Change of a channel's keys, the error, and its size.
SIZES = {
    'std_delay = "3 us"': ("delay", 3e-6),
    'std_delay = "0 s"': ("delay", 0.0),
    'coupling = "dc"': ("low_cut", 0.0),
    'coupling = "ac"': ("low_cut", 0.05),
    'coupling = "iepe"': ("low_cut", 0.3),
    'low_cut = "0.5 Hz"': ("low_cut", 0.05),
    'low_cut = "0.5 Hz", coupling = "iepe"': ("low_cut", 0.05),
    'low_cut = "0.5 Hz", std_low_cut = "20 mHz"': ("low_cut", 0.02),
    'low_cut = "0.5 Hz", std_low_cut = "4 %"': ("low_cut", 0.02),
    'std_low_cut = "0.1 Hz"': ("low_cut", 0.1),
    'high_pass = { corner = "0.5 Hz", order = 1 }': ("low_cut", 0.0),
    'high_pass = "0.5 Hz", coupling = "iepe"': ("low_cut", 0.0),
    'high_pass = "0.5 Hz", std_low_cut = "0.1 Hz"': ("low_cut", 0.1),
    'geophone = { natural_frequency = "4.5 Hz", damping = 0.7 }': ("low_cut", 0.0),
    'std_slope = "0.3 %"': ("slope", 3e-3),
    "std_slope = 0": ("slope", 0.0),
    'resonance = "5 kHz"': ("slope", (TOP / 5e3) ** 2),
    'mounted = "specimen"': ("mounting", TABLE["mounting"]),
    'mounted = "drive"': ("mounting", 0.1 * TABLE["mounting"]),
    'mounted = "rig"': ("mounting", 0.0),
    'std_gain = "0.2 %"': ("mounting", complex(0.001, TABLE["mounting"].imag)),
    'std_phase = "0.1 deg"': ("mounting", complex(TABLE["mounting"].real, radians(0.05))),
    'std_mounting = "0.5 %"': ("mounting", 2 * TABLE["mounting"]),
    'std_mounting = "0.5 %", mounted = "drive"': ("mounting", 2 * TABLE["mounting"]),
    "std_mounting = 0": ("mounting", 0.0),
}


@pytest.mark.parametrize("keys", SIZES)
def test_a_key_of_v1_states_its_error(keys):
    error, size = SIZES[keys]
    assert errors_of(stated(keys=keys))[error] == pytest.approx(size, rel=1e-12)


@pytest.mark.parametrize(("keys", "size"), [("", 0.3), ('coupling = "ac"', 0.05), ('coupling = "dc"', 0.0)])
def test_an_accelerometer_of_which_nothing_is_stated_has_a_supply(keys, size):
    assert errors_of(stated(keys=keys, motion_in="m/s²"))["low_cut"] == pytest.approx(size, rel=1e-12)


@pytest.mark.parametrize(
    ("keys", "size"),
    [
        ("remounted_with_mass = true", HALF),
        ("remounted_with_mass = false", 0.0),
        ('std_remounting = "0.1 %"', 5 * TABLE["remounting"]),
        ('std_gain = "0.01 %"', complex(5e-5, TABLE["remounting"].imag)),
        ("", TABLE["remounting"]),
    ],
)
@pytest.mark.parametrize("role", ["force_in", "motion_out"])
def test_a_key_of_f1_or_v2_states_what_an_added_mass_changes(role, keys, size):
    assert errors_of(stated(role, keys), role)["remounting"] == pytest.approx(size, rel=1e-12)


@pytest.mark.parametrize("role", ["force_in", "load", "deflection"])
def test_linearity_is_a_part_of_the_range(role):
    assert errors_of(stated(role, 'linearity = "0.05 %"'), role)["linearity"] == pytest.approx(5e-4)
    assert errors_of(stated(), role)["linearity"] == TABLE["linearity"]


def test_what_nobody_states_is_that_of_the_table():
    assert errors_of(stated()) == TABLE
    assert errors_of(stated(more="[logger]\nsimultaneous = true\n"))["delay"] == 1e-5
    assert errors_of(stated(more="[logger]\nsimultaneous = false\n"))["delay"] == TABLE["delay"]


@pytest.mark.parametrize("role", CHANNEL_KINDS)
def test_an_exact_channel_has_none(role):
    more = "" if role not in CHANNELS else ', coupling = "iepe", low_cut = "1 Hz"'
    assert not any(errors_of(stated(role, f"exact = true{more}"), role).values())


@pytest.mark.parametrize("role", CHANNEL_KINDS)
def test_zero_takes_nothing_from_the_table(role):
    assert not any(errors_of(stated(more=ZERO), role).values())


@pytest.mark.parametrize("keys", [keys for keys in SIZES if "std_gain" not in keys and "std_phase" not in keys])
def test_what_is_stated_counts_beside_zero(keys):
    error, size = SIZES[keys]
    assert errors_of(stated(keys=keys, more=ZERO))[error] == pytest.approx(size, rel=1e-12)


def test_crosstalk_and_serial_number_are_kept():
    channel = stated(keys='std_crosstalk = "0.2 %", serial = "SN 4711"').channels.motion_in
    assert (channel.std_crosstalk, channel.serial) == (pytest.approx(2e-3), "SN 4711")


def test_a_low_cut_is_a_high_pass_of_first_order():
    short, long = (stated(keys=keys).channels for keys in ('low_cut = "0.5 Hz"', 'high_pass = "0.5 Hz"'))
    assert short.conversion("motion_in").chain == long.conversion("motion_in").chain == (HighPass(0.5, 1),)


@pytest.mark.parametrize(
    ("campaign", "mounting"),
    [
        ({"more": BLOCKED, "motion_in": "mm"}, 0.0),
        ({"drive": 'drive = "command"', "motion_in": "mm"}, 0.0),
        ({"motion_in": "mm"}, TABLE["mounting"]),
        ({"more": BLOCKED}, TABLE["mounting"]),
        ({"more": BLOCKED, "motion_in": "mm", "keys": 'mounted = "specimen"'}, TABLE["mounting"]),
        ({"more": '[rigs.a]\noutput = "blocked"\n[rigs.b]\n' + RIG.partition("\n")[2], "motion_in": "mm"},
         TABLE["mounting"]),
    ],
)  # fmt: skip
def test_the_displacement_of_an_actuator_is_mounted_on_the_rig(campaign, mounting):
    more = campaign.get("more", "")
    if "[rigs." in more:
        found = parse_campaign(more + '[channels]\nmotion_in = { column = "x", unit = "mm" }\n')
    else:
        found = stated(**campaign)
    assert errors_of(found)["mounting"] == mounting


#: Role, keys, and the message.
FAULTS = [
    ("motion_in", 'std_delay = "3 mm"', "std_delay: 'mm' is a length"),
    ("motion_in", "std_delay = 3", "std_delay: "),
    ("motion_in", 'std_delay = "-1 us"', "std_delay: "),
    ("motion_in", 'coupling = "icp"', r"coupling: .*'dc', 'ac' or 'iepe'"),
    ("motion_in", 'low_cut = "0.5 s"', "low_cut: "),
    ("motion_in", 'low_cut = "0 Hz"', "low_cut: "),
    ("motion_in", 'std_low_cut = "1 N"', "std_low_cut: 'N' is a force"),
    ("motion_in", 'std_low_cut = "5 %"', "std_low_cut in % needs low_cut"),
    ("motion_in", 'std_low_cut = "-1 Hz"', "std_low_cut: is negative"),
    ("motion_in", 'low_cut = "1 Hz", high_pass = "1 Hz"', "low_cut and high_pass are both stated: keep one"),
    ("motion_in", 'low_cut = "1 Hz", coupling = "dc"', 'coupling = "dc" and low_cut contradict each other'),
    ("motion_in", 'std_slope = "1 Hz"', "std_slope: "),
    ("motion_in", 'std_slope = "1 %", resonance = "1 kHz"', "std_slope and resonance are both stated"),
    ("motion_in", 'resonance = "1 N"', "resonance: "),
    ("motion_in", 'mounted = "tyre"', r"mounted: .*'specimen', 'drive' or 'rig'"),
    ("motion_in", 'mounted = "rig", std_mounting = "1 %"', 'mounted = "rig" and std_mounting contradict'),
    ("motion_in", 'std_mounting = "1 deg"', "std_mounting: "),
    ("force_in", 'mounted = "drive"', "force_in: mounted is a key of motion_in alone: remove it"),
    ("motion_in", "remounted_with_mass = true", "is a key of force_in and motion_out alone"),
    ("force_in", 'remounted_with_mass = "yes"', "remounted_with_mass: "),
    ("force_in", 'remounted_with_mass = true, std_remounting = "1 %"', "are both stated: keep one of them"),
    ("motion_in", 'linearity = "1 %"', "linearity is a key of force_in and load and deflection alone"),
    ("load", 'linearity = "1 N"', "linearity: "),
    ("load", 'coupling = "dc"', "coupling is for channels of dynamic tests"),
    ("load", 'resonance = "1 kHz"', "resonance is for channels of dynamic tests"),
    ("motion_in", "serial = 3", "serial: "),
    ("motion_in", 'mountd = "rig"', "did you mean 'mounted'"),
    *(
        ("motion_in", f"exact = true, {key}", f"exact = true and {key.partition(' ')[0]} contradict each other")
        for key in ('std_delay = "1 us"', 'std_low_cut = "1 Hz"', 'std_slope = "1 %"', 'resonance = "1 kHz"',
                    'std_mounting = "1 %"', 'std_crosstalk = "1 %"')
    ),
]  # fmt: skip


@pytest.mark.parametrize(("role", "keys", "message"), FAULTS)
def test_a_wrong_key_is_an_error_at_its_channel(role, keys, message):
    with pytest.raises(CampaignError, match=message) as error:
        stated(role, keys)
    assert str(error.value).startswith("campaign.toml: [channels]")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[logger]\nsimultaneous = "yes"\n', r"\[logger\] simultaneous: "),
        ("[logger]\nsimultanous = true\n", "did you mean 'simultaneous'"),
        ('[unstated]\nordinary = "none"\n', r"\[unstated\] ordinary: .*'table' or 'zero'"),
        ("[unstated]\nordinry = 1\n", "did you mean 'ordinary'"),
        ('[conditions]\nstd_block = "1 N"\n', r"\[conditions\] std_block: "),
        ('[conditions]\nstd_drift = "-1 %"\n', r"\[conditions\] std_drift: "),
    ],
)
def test_a_wrong_key_of_a_table_is_an_error(text, message):
    with pytest.raises(CampaignError, match=message):
        stated(more=text)


def test_a_rig_without_a_damper_has_one_that_may_be_there():
    critical = 2 * sqrt(12e3 * 15.0)
    rig = stated().all_rigs[""].rig()
    assert (rig.preload_damping, rig.std["preload_damping"]) == (0.0, pytest.approx(0.02 * critical))
    for more in (ZERO, BLOCKED, RIG + 'preload_damping = { value = 0, unit = "N s/m", exact = true }\n'):
        assert not stated(more=more).all_rigs[""].rig().std.get("preload_damping")


def test_block_and_drift_of_a_specimen():
    block, drift = table(Kind.BLOCK, Kind.ANGLE_BLOCK), table(Kind.DRIFT, Kind.ANGLE_DRIFT)
    taken = stated().specimen_uncertainty
    assert (taken.block, taken.drift) == (block, drift)
    more = '[conditions]\nstd_block = "0.6 %"\nstd_drift = 0\n'
    for known in (stated(more=more), stated(more=ZERO + more)):
        assert known.specimen_uncertainty.block == pytest.approx(2 * block)
        assert known.specimen_uncertainty.drift == 0
    none = stated(more=ZERO).specimen_uncertainty
    assert (none.block, none.drift) == (0, 0)


def test_the_assumptions_name_the_key_that_replaces_each():
    every = {
        "force_in": 'std_delay = "1 us", coupling = "dc", resonance = "4 kHz", remounted_with_mass = false',
        "motion_in": 'std_delay = "1 us", coupling = "ac", std_slope = 0, mounted = "drive"',
        "motion_out": "exact = true",
    }
    said = stated().assumptions()
    for key in (
        "std_delay",
        "coupling",
        "std_slope",
        "mounted",
        "remounted_with_mass",
        "linearity",
        "std_block",
        "std_drift",
    ):
        assert len([note for note in said if f"no {key} stated" in note]) == 1
    assert "[rig] preload_damping: not stated, taken as 0 ± 17 N s/m, 2 % of the critical one" in said
    assert any("force_in, motion_in, motion_out: no std_delay stated, taken as 20 µs" in note for note in said)
    lines = "\n".join(f'{role} = {{ column = "c", unit = "{UNITS[role]}", {keys} }}' for role, keys in every.items())
    damped = RIG + 'preload_damping = "0 N s/m"\n[conditions]\nstd_block = 0\nstd_drift = 0\n'
    assert len(parse_campaign(f"{damped}[channels]\n{lines}\n").assumptions()) == 3  # of the rig, std_gain, std_phase
    line = "[channels] load, deflection: no linearity stated, taken as 0.1 % of the range, in K1"
    assert line in said
    static = (
        '[channels]\nload = { column = "F", unit = "N" }\ndeflection = { column = "x", unit = "mm", linearity = 0 }\n'
    )
    assert [note for note in parse_campaign(static).assumptions() if "std_gain" not in note] == [
        line.replace(", deflection", "")
    ]
    assert any('taken as "rig"' in note for note in stated(more=BLOCKED, motion_in="mm").assumptions())


def test_zero_is_one_assumption():
    (note,) = [note for note in stated(more=ZERO).assumptions() if "std_" not in note and "no std" not in note]
    assert note.startswith('[unstated] ordinary = "zero"')
    static = '[channels]\nload = { column = "F", unit = "N", exact = true }\n'
    assert parse_campaign(static).assumptions() == parse_campaign(ZERO + static).assumptions() == []


def test_the_summary_has_what_is_stated():
    more = ZERO + '[logger]\nsimultaneous = true\n[conditions]\nstd_block = "1 %"\n'
    found = stated(keys='coupling = "ac", serial = "7", std_low_cut = "1 Hz"', more=more).summary()
    assert found["logger"] == {"simultaneous": True}
    assert found["unstated"] == {"ordinary": "zero"}
    assert found["conditions"] == {"std_block [1]": 0.01}
    assert {"coupling": "ac", "serial": "7", "std_low_cut": "1 Hz"}.items() <= found["channels"]["motion_in"].items()


def test_an_uncertainty_opens_no_recording_again():
    """What the demodulation depends on has the low-cut, and no key of an uncertainty."""
    plain = stated().channels.without_uncertainties("motion_in")
    more = 'std_delay = "1 us", coupling = "ac", std_slope = 0, mounted = "drive", serial = "3", std_low_cut = "1 Hz"'
    assert stated(keys=more).channels.without_uncertainties("motion_in") == plain
    assert stated(keys='low_cut = "1 Hz"').channels.without_uncertainties("motion_in") != plain
