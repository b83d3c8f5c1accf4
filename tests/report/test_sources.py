"""Sources of error in words: every kind has a name inside a sentence, and a remedy that can be followed."""

import re
from dataclasses import replace

import pytest

from fourpole.campaign.channels import ChannelFile
from fourpole.campaign.schema import ConditionsFile, SpecimenFile
from fourpole.core.components import COMPONENTS
from fourpole.core.rig import PARAMETERS
from fourpole.core.sources import RATIOS, Kind, Role, Source
from fourpole.report.words.limits import About, remedy, source_in_words

PLAIN = About(joint=True, massed=False, with_v2=True, fits=True, scatter=False, candidate="")
SITUATIONS = [
    PLAIN,
    replace(PLAIN, joint=False),
    replace(PLAIN, joint=False, with_v2=False),
    replace(PLAIN, massed=True),
    replace(PLAIN, massed=True, joint=False),
    replace(PLAIN, fits=False, candidate="a frame of 1e+06 N/m"),
    replace(PLAIN, scatter=True),
    replace(PLAIN, joint=False, with_v2=False, blocked=True),
    replace(PLAIN, joint=False, with_f1=False),
]
#: Keys of campaign.toml that a remedy may name.
STATED = (
    ChannelFile.model_fields,
    ConditionsFile.model_fields,
    SpecimenFile.model_fields,
    PARAMETERS,
    ("fixture_stiffness",),
)
KEYS = {name for keys in STATED for name in keys}
SOURCES = [
    *(Source(kind, of) for kind in Kind for of in kind.of or ("something new" if kind is Kind.OTHER else "",)),
    *(Source(Kind.GAIN, *pair) for pair in RATIOS),
    Source(Kind.ADDED_MASS, mass=10.0),
]


@pytest.mark.parametrize("source", [source for source in SOURCES if source.role in (Role.CHANNEL, Role.RIG)])
def test_no_remedy_names_the_joint_route_where_no_force_is_recorded(source):
    for situation in (
        replace(PLAIN, joint=False, with_f1=False),
        replace(PLAIN, joint=False, massed=True, with_f1=False),
    ):
        assert "joint" not in remedy(source, situation)
    spring = Source(Kind.RIG_VALUE, "preload_stiffness")
    assert remedy(spring, situation).endswith("test at higher frequencies or with a heavier mass")


def test_all_kinds_are_looked_at():
    assert {source.kind for source in SOURCES} == set(Kind)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (Source(Kind.NOISE), "the noise of the sensors"),
        (Source(Kind.FREQUENCY), "the uncertainty of the frequency"),
        (Source(Kind.RIG_MISFIT), "the misfit of the rig"),
        (Source(Kind.GAIN, "F1"), "F1's gain"),
        (Source(Kind.PHASE, "V1"), "V1's phase"),
        (Source(Kind.DELAY, "V2"), "V2's delay"),
        (Source(Kind.RESPONSE_GAIN, "F1"), "the gain of F1's calibrated response"),
        (Source(Kind.RESPONSE_PHASE, "F1"), "the phase of F1's calibrated response"),
        (Source(Kind.RIG_VALUE, "tyre_mass"), "the moving part of the tyre"),
        (Source(Kind.UNSTATED, "friction"), "dry friction that is not stated"),
        (Source(Kind.ADDED_MASS, mass=10.0), "the weight of the added mass 10 kg"),
        (Source(Kind.K1), "K1"),
        (Source(Kind.K1_FIT), "the fit of K1"),
        (Source(Kind.K1_CYCLES), "the change of K1 from cycle to cycle"),
        (Source(Kind.K1_GAINS), "the calibration of load and deflection in K1"),
        (Source(Kind.K1_REPEATS), "the scatter of K1 between repeated static tests"),
        (Source(Kind.K1_STATED), "K1 as stated"),
        (Source(Kind.OTHER, "the moon"), "the moon"),
        (Source(Kind.CROSSTALK, "V2 in F1"), "the cross-talk of V2 in F1"),
        (Source(Kind.GAIN_DRIFT, "V1"), "the drift of V1's gain"),
        (Source(Kind.DRIFT, "radial"), "the drift of radial over the run"),
        (Source(Kind.ANGLE_DRIFT, "radial"), "the drift of the loss angle of radial over the run"),
        (Source(Kind.K1_DRIFT), "the drift of the specimen between its static and its dynamic test"),
        (Source(Kind.K1_TEMPERATURE), "the temperature of the static test, which is not that of the dynamic test"),
        (Source(Kind.UNSTATED, "input"), "an input mass that is not stated"),
        (Source(Kind.LOW_CUT, "V2"), "V2's low-cut"),
        (Source(Kind.SLOPE, "F1"), "the rise of F1's gain with frequency"),
        (Source(Kind.MOUNTING_GAIN, "V1"), "the gain of V1 in each mounting"),
        (Source(Kind.MOUNTING_PHASE, "V1"), "the phase of V1 in each mounting"),
        (Source(Kind.REMOUNTING_GAIN, "F1"), "the gain of F1 with each added mass"),
        (Source(Kind.REMOUNTING_PHASE, "V2"), "the phase of V2 with each added mass"),
        (Source(Kind.BLOCK, "radial"), "the change of |K*| of radial with the added mass"),
        (Source(Kind.ANGLE_BLOCK, "radial"), "the change of the loss angle of radial with the added mass"),
        (Source(Kind.SCATTER), "the scatter of K* from test to test"),
        (Source(Kind.STRANGE), "tests of one condition that do not go together"),
        (Source(Kind.UNSTEADY), "the unsteady drive"),
        (Source(Kind.K1_LINEARITY), "the linearity of load and deflection in K1"),
    ],
    ids=lambda one: one if isinstance(one, str) else "",
)
def test_the_name_of_a_source(source, words):
    assert source_in_words(source) == words


@pytest.mark.parametrize(
    ("source", "text"),
    [
        (Source(Kind.NOISE), "record longer or over more cycles: four times as many halve it"),
        (Source(Kind.FREQUENCY), "record longer at a steady speed"),
        (Source(Kind.RIG_MISFIT), "resolve the misfit first: look for a part of the rig that is not stated"),
        (Source(Kind.GAIN, "V1"), ", or calibrate the gain of V1"),
        (Source(Kind.PHASE, "V1"), ", or calibrate the phase of V1"),
        (Source(Kind.DELAY, "V1"), ", or measure the delay of V1 and state std_delay"),
        (Source(Kind.RESPONSE_GAIN, "V1"), ", or calibrate the response of V1 with a smaller uncertainty"),
        (Source(Kind.UNSTATED, "mass"), "or measure it and state it in campaign.toml"),
        (Source(Kind.ADDED_MASS, mass=10.0), "weigh the added mass on a better balance"),
        (Source(Kind.K1_STATED), "state K1 with a smaller uncertainty, or add a static test"),
        (Source(Kind.K1_FIT), "repeat the static test with finer steps of load round the preload"),
        (Source(Kind.K1_GAP), "(the gap is the rubber's own hysteresis, which no test closes)"),
        (Source(Kind.K1_CYCLES), "repeat the static test with more cycles, until two follow each other closely"),
        (Source(Kind.K1_GAINS), "calibrate the load and deflection channels of the static rig"),
        (Source(Kind.K1_REPEATS), "repeat them more often: four times as many halve the uncertainty of their mean"),
        (Source(Kind.OTHER, "the moon"), "state the moon with a smaller uncertainty"),
    ],
    ids=lambda one: one if isinstance(one, str) else "",
)
def test_the_remedy_of_a_source(source, text):
    assert remedy(source, PLAIN).endswith(text)


def test_without_a_weighed_mass_a_channel_wants_one():
    assert remedy(Source(Kind.GAIN, "V1"), PLAIN).startswith(
        "repeat one condition with a weighed mass added and use the joint route, which makes calibrated sensors "
        "unnecessary, or "
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("moving_mass", "weigh it and state it with a smaller uncertainty"),
        ("preload_stiffness", "measure it by itself and state it with a smaller uncertainty"),
    ],
)
def test_a_value_of_the_rig_is_weighed_or_measured(value, text):
    assert remedy(Source(Kind.RIG_VALUE, value), replace(PLAIN, massed=True)) == text


def test_without_a_weighed_mass_a_value_of_the_rig_wants_one():
    text = remedy(Source(Kind.RIG_VALUE, "moving_mass"), PLAIN)
    assert text.endswith(", or repeat one condition with a weighed mass added")


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.text)
def test_every_source_has_words_and_a_remedy_in_every_situation(source):
    said = source_in_words(source)
    assert said
    assert not re.search(r"[{}_]", said)
    for about in SITUATIONS:
        text = remedy(source, about)
        assert re.match(r"[a-z]", text)
        assert not re.search(r"[{}]", text)
        assert set(re.findall(r"[a-z]+_\w+", text)) <= KEYS


@pytest.mark.parametrize("source", [Source(Kind.CROSSTALK, "V2 in F1"), Source(Kind.GAIN_DRIFT, "V1")])
def test_a_weighed_mass_calibrates_no_cross_talk_and_no_drift(source):
    assert "mass" not in remedy(source, replace(PLAIN, massed=True))
    assert "state" not in remedy(source, PLAIN)


def test_what_nobody_states_is_not_asked_to_be_stated():
    """A scatter, a fit or a gap is no statement: to state it with a smaller uncertainty is no remedy."""
    stated = {Role.RIG, Role.CHANNEL, Role.RATIO, Role.OTHER}
    for source in SOURCES:
        if source.role not in stated and source.kind not in (Kind.K1, Kind.K1_STATED, Kind.UNSTATED):
            assert not remedy(source, PLAIN).startswith("state "), source


def test_where_no_mass_moves_or_v2_is_not_recorded_the_remedy_is_another():
    gain, bare = Source(Kind.GAIN, "V1"), replace(PLAIN, joint=False, with_v2=False)
    assert remedy(gain, replace(bare, blocked=True)) == "calibrate the gain of V1"
    assert remedy(gain, bare).startswith("measure V2 too, repeat one condition with a weighed mass")


#: The key of an ordinary error that is not that of the table, because the remedy is another one.
OTHER_KEYS = {
    Kind.GAIN: "",
    Kind.PHASE: "",
    Kind.CROSSTALK: "",
    Kind.MOUNTING_GAIN: "mounted",
    Kind.MOUNTING_PHASE: "mounted",
    Kind.REMOUNTING_GAIN: "remounted_with_mass = false",
    Kind.REMOUNTING_PHASE: "remounted_with_mass = false",
}


@pytest.mark.parametrize("row", [row for row in COMPONENTS if row.key], ids=lambda row: row.kind.name)
def test_the_remedy_of_an_ordinary_error_names_its_key_after_a_weighed_mass(row):
    of = row.key if row.kind is Kind.RIG_VALUE else row.kind.of[0] if row.kind.of else ""
    assert OTHER_KEYS.get(row.kind, row.key) in remedy(Source(row.kind, of), replace(PLAIN, massed=True))


def test_a_delay_and_a_low_cut_are_stated_sooner_than_measured():
    after_mass = replace(PLAIN, massed=True)
    assert "[logger] simultaneous = true" in remedy(Source(Kind.DELAY, "V1"), after_mass)
    assert 'coupling = "dc"' in remedy(Source(Kind.LOW_CUT, "V1"), after_mass)
    assert "weighed mass in each mounting" in remedy(Source(Kind.MOUNTING_GAIN, "V1"), after_mass)
