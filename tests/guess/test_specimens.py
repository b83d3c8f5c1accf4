"""Specimens by the names of files: serial numbers, folders, words in several languages; what is not sure is a doubt."""

from __future__ import annotations

import re

import pytest

from fourpole.guess.conditions import read_conditions
from fourpole.guess.names import Entry, kind_word, read_name

#: The words by which a name says what kind of test it is of.
STATIC = re.compile("stat|LD|静|Kennlinie|curve")


def found(names):
    """Specimen of each name, and the doubts on specimens."""
    entries = []
    for name in names:
        tokens = tuple(token for part in reversed(name.split("/")) for token in read_name(part))
        static = STATIC.search(name) is not None
        stated = [token.value for token in tokens if token.what == "frequency"]
        entries.append(Entry("static" if static else "dynamic", stated[0] if stated else float("nan"), tokens))
    conditions = read_conditions(entries, names)
    doubts = {text for one in conditions for about, text in one.doubts if about == "tyre"}
    return [one.tyre for one in conditions], doubts


def filled(scheme, specimens, pressures=("1.7", "2.4"), frequencies=("10", "15", "20")):
    """Names of a whole campaign: the specimen in each, and whether a static test has it."""
    static, dynamic = scheme
    for one in specimens:
        for pressure in pressures:
            yield one, static.format(s=one, p=pressure)
            for frequency in frequencies:
                yield one, dynamic.format(s=one, p=pressure, f=frequency)


def as_in_truth(tyres, truth):
    return len(set(zip(tyres, truth, strict=True))) == len(set(tyres)) == len(set(truth))


@pytest.mark.parametrize(
    ("scheme", "specimens"),
    [
        (("Probe_{s}_{p}bar_statisch", "Probe_{s}_{p}bar_3kN_{f}Hz"), ("A_0815", "A_0816", "B_0901")),
        (("SN{s}_{p}bar_static", "SN{s}_{p}bar_1000N_{f}Hz"), ("00123", "00124")),
        (("タイヤ{s}_静的_圧力{p}bar", "タイヤ{s}_荷重3kN_圧力{p}bar_{f}Hz"), ("12345", "12346")),
        (("{s}/圧力{p}bar_静特性", "{s}/圧力{p}bar_荷重3kN_周波数{f}Hz"), ("S220145", "S220146")),
        (("試験体{s}　内圧{p}bar　静的", "試験体{s}　内圧{p}bar　荷重３ｋＮ　{f}Ｈｚ"), ("Ａ", "Ｂ")),
        (("试样{s}_气压{p}bar_静态", "试样{s}_气压{p}bar_载荷1000N_频率{f}Hz"), ("甲", "乙")),
        (("{s}号轮胎_胎压{p}bar_静态", "{s}号轮胎_胎压{p}bar_载荷3000N_{f}Hz"), ("1", "2")),
        (("éprouvette {s} {p} bar statique", "éprouvette {s} {p} bar précharge 500N {f}Hz"), ("1", "2", "3")),
        (("pneu n°{s} {p} bar statique", "pneu n°{s} {p} bar 1,5 kN {f} Hz"), ("12", "13")),
        (("{p}bar/{s}_LD", "{p}bar/{s}_1000N_{f}Hz"), ("4711", "4712")),
        (("225_45R17_{s}_{p}bar_LD", "225_45R17_{s}_{p}bar_3kN_{f}Hz"), ("48120", "48121")),
        (("{s} Kennlinie {p}bar", "{s} Fv500N {p}bar {f}Hz"), ("5Q0199262BK", "5Q0199262BL")),
        (("DOT{s}_{p}bar_static", "DOT{s}_{p}bar_1kN_{f}Hz"), ("3823", "4123")),
        (("2026-03-01/{s} {p}bar stat", "2026-03-01/{s} {p}bar 1kN {f}Hz"), ("muster a", "muster b")),
        (("stat/{s}_{p}bar", "dyn/{s}_{p}bar_500N_{f}Hz"), ("T17", "T18")),
        (("{s}_static_{p}bar", "{s}_{p}bar_500N_{f}Hz"), ("S1", "S2")),
        (("{s}_{p}bar_static", "{s}_{p}bar_500N_{f}Hz"), ("a3f9c2d1", "77be01aa")),
        (("{s}_LD_{p}bar", "{s}_{p}bar_{f}Hz_500N"), ("201", "202", "203")),
        (("{s}_{p}bar_static", "{s}_{p}bar_500N_{f}Hz"), ("id7", "id8")),
        (("static {p}bar ({s})", "{f}Hz 1kN {p}bar ({s})"), ("A12", "B7")),
    ],
)
def test_what_splits_equal_conditions_is_the_specimen(scheme, specimens):
    truth, names = zip(*filled(scheme, specimens), strict=True)
    tyres, doubts = found(names)
    assert as_in_truth(tyres, truth), set(tyres)
    assert not doubts


@pytest.mark.parametrize(
    ("scheme", "specimens", "doubt"),
    [
        (
            ("{s}_{p}bar_static", "{s}_{p}bar_1kN_{f}Hz"),
            ("left", "right"),
            "may be a place, a direction, a state or a condition",
        ),
        (
            ("{s}_{p}bar_static", "{s}_{p}bar_1kN_{f}Hz"),
            ("camber0", "camber2"),
            "may be a place, a direction, a state or a condition",
        ),
        (("mount_{s}_2026_{p}bar_static", "mount_{s}_2026_{p}bar_1kN_{f}Hz"), ("L", "R"), "L, R may be a place"),
        (("{s}_{p}bar_static", "{s}_{p}bar_1kN_{f}Hz"), ("MK", "JB"), "initials"),
        (("{s}_{p}bar_static", "{s}_{p}bar_1kN_{f}Hz"), ("1", "2", "3"), "or are they repeats"),
        (("{s}/{p}bar_static", "{s}/{p}bar_1kN_{f}Hz"), ("2026-03-01", "2026-03-08"), "the dates"),
        (("{s}_{p}bar_static", "{s}_{p}bar_1kN_{f}Hz"), ("240312", "240319"), "the dates"),
        (("Test {s}/{p}bar_static", "Test {s}/{p}bar_1kN_{f}Hz"), ("1", "2"), "are they repeats"),
        (("t{s}_{p}bar_static", "t{s}_{p}bar_1kN_{f}Hz"), ("1_18", "1_24", "2_18", "2_24"), "the numbers 18, 24"),
    ],
)
def test_what_may_be_something_else_is_a_doubt(scheme, specimens, doubt):
    truth, names = zip(*filled(scheme, specimens), strict=True)
    tyres, doubts = found(names)
    assert as_in_truth(tyres, truth), set(tyres)
    assert any(doubt in text for text in doubts), doubts


def test_a_number_that_is_bound_to_a_condition_is_doubted():
    names = [f"{s}_{p}bar_{k}" for s, p in (("0815", 1.7), ("0816", 2.4)) for k in ("static", "1kN_10Hz", "1kN_15Hz")]
    tyres, doubts = found(names)
    assert set(tyres) == {"#0815", "#0816"}
    assert any("never at the same condition" in text for text in doubts)


def test_dates_and_counters_of_runs_are_no_specimens():
    names = [
        f"2026-03-0{day}_run{4 * day + at:03d}_{p}bar_{kind}"
        for day, p in ((1, 1.7), (2, 2.4))
        for at, kind in enumerate(("static", "1kN_10Hz", "1kN_15Hz", "1kN_20Hz"))
    ]
    tyres, doubts = found(names)
    assert set(tyres) == {"tyre"}
    assert doubts == {"no name of a specimen was found: all tests are taken as of one"}


def test_two_tests_at_one_condition_of_one_specimen_are_a_doubt():
    names = ["radial_2bar_static_17", "radial_2bar_static_31", "radial_2bar_1kN_10Hz_18", "radial_2bar_1kN_15Hz_19"]
    tyres, doubts = found(names)
    assert set(tyres) == {"radial"}
    (doubt,) = doubts
    assert doubt.startswith("2 static tests are at one condition of 'radial'")


def test_numbers_of_repeats_are_repeats():
    names = [f"{s}_2bar_{k}_{n}" for s in ("radial", "diagonal") for k in ("static", "1kN_10Hz") for n in (1, 2, 3)]
    tyres, doubts = found(names)
    assert set(tyres) == {"radial", "diagonal"}
    assert doubts == {"the numbers 1, 2, 3 of their names are taken as repeats: or are they specimens?"}


def test_temperatures_below_zero_keep_their_sign():
    (token,) = [token for token in read_name("mountX_-20C_800N") if token.what == "temperature"]
    assert token.value == -20.0


@pytest.mark.parametrize(
    ("word", "kind"), [("Rauschen", "random"), ("sweep", "sweep"), ("静的", "static"), ("chirp", "sweep")]
)
def test_words_of_kinds(word, kind):
    assert kind_word(word) == kind


def test_a_band_in_a_name():
    assert [(one.value, one.high) for one in read_name("mount_sweep_5-200Hz") if one.what == "band"] == [(5.0, 200.0)]
    assert not [one for one in read_name("radial_1.7-10Hz") if one.what == "band"]
