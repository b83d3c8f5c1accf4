"""Sources of error: their text on disk, and the way back."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.core.phasor import SYMBOLS
from fourpole.core.rig import PARAMETERS
from fourpole.core.sources import PARTS, RATIOS, Kind, Role, Source

#: Each kind with what it can be of; a source of kind OTHER has any text.
OF = {kind: kind.of or ("",) for kind in Kind if kind is not Kind.OTHER}
ALL = [
    *(Source(kind, of) for kind, every in OF.items() for of in every),
    *(Source(kind, *pair) for kind in (Kind.GAIN, Kind.PHASE) for pair in RATIOS),
]


@pytest.mark.parametrize(
    ("source", "text"),
    [
        (Source(Kind.NOISE), "sensor noise"),
        (Source(Kind.FREQUENCY), "frequency"),
        (Source(Kind.RIG_MISFIT), "rig misfit"),
        (Source(Kind.GAIN, "F1"), "gain F1"),
        (Source(Kind.GAIN, "F1", "V1"), "gain F1/V1"),
        (Source(Kind.PHASE, "V2", "V1"), "phase V2-V1"),
        (Source(Kind.DELAY, "V1"), "delay V1"),
        (Source(Kind.RESPONSE_GAIN, "V2"), "response gain V2"),
        (Source(Kind.RESPONSE_PHASE, "V2"), "response phase V2"),
        (Source(Kind.RIG_VALUE, "preload_stiffness"), "preload_stiffness"),
        (Source(Kind.UNSTATED, "friction"), "unstated friction"),
        (Source(Kind.ADDED_MASS), "added mass"),
        (Source(Kind.ADDED_MASS, mass=2.5), "added mass 2.5 kg"),
        (Source(Kind.K1), "K1"),
        (Source(Kind.K1_FIT), "K1 fit"),
        (Source(Kind.K1_GAP), "K1 branch gap"),
        (Source(Kind.K1_CYCLES), "K1 cycles"),
        (Source(Kind.K1_ZERO), "K1 zero"),
        (Source(Kind.K1_GAINS), "K1 gains"),
        (Source(Kind.K1_REPEATS), "K1 repeats"),
        (Source(Kind.K1_STATED), "K1 stated"),
        (Source(Kind.OTHER, "the weather"), "the weather"),
    ],
)
def test_the_text_on_disk_is_fixed(source, text):
    assert source.text == text
    assert Source.read(text) == source


def test_every_kind_has_its_text_and_comes_back():
    assert {source.kind for source in ALL} | {Kind.OTHER} == set(Kind)
    assert len({source.text for source in ALL}) == len(ALL)
    assert [Source.read(source.text) for source in ALL] == ALL


@given(st.floats(allow_nan=False, min_value=0, allow_infinity=False))
def test_an_added_mass_comes_back_with_the_digits_of_its_text(mass):
    found = Source.read(Source(Kind.ADDED_MASS, mass=mass).text)
    assert found == Source(Kind.ADDED_MASS, mass=float(f"{mass:g}"))


OURS = [source.text for source in ALL]


@given(
    st.text()
    | st.sampled_from(OURS)
    | st.builds("{}{}".format, st.sampled_from(OURS), st.text(max_size=3))
    | st.builds("added mass {} kg".format, st.floats() | st.text(max_size=6))
)
def test_any_text_is_read_and_written_back_unchanged(text):
    assert Source.read(text).text == text


def test_the_rig_goes_with_the_source_but_is_no_part_of_its_text():
    found = Source.read("moving_mass", "second")
    assert (found.rig, found.text) == ("second", "moving_mass")
    assert found != Source.read("moving_mass")


def test_roles_are_those_of_the_shared_values():
    assert {Source(Kind.RIG_VALUE, name).role for name in PARAMETERS} == {Role.RIG}
    assert {Source(Kind.UNSTATED, part).role for part in PARTS} == {Role.UNSTATED}
    assert {Source(kind, name).role for kind in (Kind.GAIN, Kind.DELAY) for name in SYMBOLS.values()} == {Role.CHANNEL}
    assert Source(Kind.PHASE, "F1", "V1").role is Role.RATIO
    assert Source(Kind.ADDED_MASS, mass=10.0).role is Role.MASS
    assert {kind.role for kind in Kind if kind.name.startswith("K1")} == {Role.STATIC}
