"""The findings in words: each sentence is held by one test here; other tests assert data, so words may change alone."""

import re

import numpy as np
import polars as pl
import pytest
from tests.findings.designed import Tables, Tyre, frame, rig_curve

from fourpole.core.checks import Code
from fourpole.findings import Finding, FindingConditions, Holds, Setup, Topic
from fourpole.findings import findings as found_in
from fourpole.findings.facts import UNSTATED, Estimate
from fourpole.findings.list import Reason, Tally
from fourpole.findings.resonances import Crossing, Crossings, Peak, Prediction, Resonance, ResonanceOrder
from fourpole.findings.trends import Comparison, CycleLoss, Departure, Effect, Extremum, Level, Trend
from fourpole.quantities import CYCLE_LOSS, K1, NONLINEARITY, TR, C
from fourpole.report.words.sentence import Sentence, headline, sentences
from fourpole.study.study import Study
from fourpole.study.tables import DYNAMIC, STATIC
from fourpole.words import template

P1, P2, P3, P4 = (1e5, 1000.0), (1e5, 2000.0), (2e5, 1000.0), (2e5, 2000.0)
AXES = ("pressure", "load")


def said(detail, holds, specimens=("A", "B"), quantity=K1, axes=AXES, tests=(), mass=0.0):
    """The sentence of one finding."""
    about = FindingConditions(axes, (), Setup("", mass))
    (one,) = sentences([Finding(Topic.STATIC, quantity, specimens, holds, detail, about, tests=tests)])
    return one.text


def effects(*values, at=(P1, P2, P3, P4), own=0.005):
    return {key: Effect(value, own) for key, value in zip(at, values, strict=False)}


# ---- tests used, and not to trust


@pytest.mark.parametrize(
    ("tally", "text"),
    [
        (Tally(0, 0, 0), "The campaign has no tests."),
        (Tally(0, 0, 1), "The only test was rejected, so nothing can be said of it."),
        (Tally(0, 0, 44), "None of the 44 tests could be used: all were rejected."),
        (Tally(1, 0, 0), "The only test was used without a warning."),
        (Tally(44, 0, 0), "All 44 tests were used without a warning."),
        (Tally(29, 2, 13), "Of 44 tests 31 could be used, 2 of them with a warning; 13 were rejected."),
    ],
)
def test_the_number_of_tests(tally, text):
    assert said(tally, tally.holds, (), None) == text


@pytest.mark.parametrize(
    ("detail", "holds", "tests", "text"),
    [
        (Reason(Code.CLIPPING), Holds.REJECTED, 2, f"Do not trust 2 tests: {template(Code.CLIPPING, 'short')}."),
        (Reason(None, "why"), Holds.WARNING, 12, "Use with care 12 tests: why."),
    ],
)
def test_tests_not_to_trust(detail, holds, tests, text):
    named = tuple(f"D{i + 1}" for i in range(tests))
    assert said(detail, holds, (), None, tests=named) == text


# ---- comparisons


@pytest.mark.parametrize(
    ("found", "holds", "text"),
    [
        (
            effects(0.2, 0.3, 0.3, 0.4),
            Holds.ABOVE,
            (
                "B is the stiffer: its K1 is above that of A at each of the 4 combinations of pressure and load in "
                "common, by 30 % on average, from 20 % (1.00 bar, 1000 N) to 40 % (2.00 bar, 2000 N)."
            ),
        ),
        (
            effects(0.001, 0.3, 0.3, 0.4),
            Holds.ABOVE,
            (
                "B is the stiffer: its K1 is above that of A at the 4 combinations of pressure and load in common, by "
                "25 % on average, from 0.1 % (1.00 bar, 1000 N) to 40 % (2.00 bar, 2000 N); no difference beyond the "
                "uncertainty at 1 of 4 conditions in common: (1.00 bar, 1000 N)."
            ),
        ),
        (
            effects(0.2),
            Holds.ABOVE,
            (
                "B is the stiffer: its K1 is above that of A at 1.00 bar, 1000 N, the only condition in common, by 20 "
                "% (U 1.0 %)."
            ),
        ),
        (
            effects(0.3, 0.1, -0.2, 0.0),
            Holds.MIXED,
            (
                "B has the higher K1, by up to 30 % at 2 of 4 conditions in common: (1.00 bar, 1000 N) and (1.00 bar, "
                "2000 N); A has the higher K1, by 20 % at 1 of 4 conditions in common: (2.00 bar, 1000 N); there is no "
                "difference beyond the uncertainty at 1 of 4 conditions in common: (2.00 bar, 2000 N)."
            ),
        ),
        (
            effects(0.002, 0.004),
            Holds.NO_DIFFERENCE,
            (
                "K1 of A and B shows no difference beyond the uncertainty at the 2 loads in common: that of B is 0.3 % "
                "higher on average, no more than the expanded uncertainty (95 %) of 1.0 %."
            ),
        ),
    ],
)
def test_a_comparison(found, holds, text):
    assert said(Comparison("B", "A", found), holds) == text


# ---- levels


def test_a_level():
    values = {P1: Estimate(100e3, 1e3), P4: Estimate(120e3, 2.4e3)}
    assert said(Level(values), Holds.MEASURED, ("A",)) == (
        "K1 of A lies between 100 kN/m (1.00 bar, 1000 N) and 120 kN/m (2.00 bar, 2000 N), each with U of "
        "2.0 to 4.0 % (k = 2)."
    )


def test_a_level_of_one_value():
    assert said(Level({P1: Estimate(100e3, 1e3)}), Holds.MEASURED, ("A",)) == (
        "K1 of A is 100 kN/m at 1.00 bar, 1000 N, with U of 2.0 % (k = 2)."
    )


def test_linearity():
    found = Departure({(1e5,): Estimate(0.01, 0.0), (2e5,): Estimate(0.02, 0.0)})
    assert said(found, Holds.NON_LINEAR, ("A",), NONLINEARITY, ("pressure",)) == (
        "Under static load A is non-linear: its load-deflection curves depart from a straight line by 1.0 to 2.0 % of "
        "the load span (2 pressures)."
    )
    mount = Departure({(UNSTATED,): Estimate(0.001, 0.0)})
    assert said(mount, Holds.NEARLY_LINEAR, ("A",), NONLINEARITY, ("pressure",)) == (
        "Under static load A is nearly linear: its load-deflection curve departs from a straight line by 0.1 % of the "
        "load span."
    )


def test_the_loss_of_a_cycle_of_all_specimens():
    about = FindingConditions(("pressure",))
    found = [
        Finding(Topic.LOSS, CYCLE_LOSS, (name,), Holds.MEASURED, CycleLoss({(1e5,): Estimate(loss, 0.0)}), about)
        for name, loss in (("A", 1.5), ("B", 2.5))
    ]
    assert [one.text for one in sentences(found)] == [
        "A static cycle of loading and unloading loses 1.50 J in A (1 pressure) and 2.50 J in B (1 pressure)."
    ]


# ---- trends


def trend(values, *, line=True, axis="pressure", split=None, extremum=None, own=0.005):
    at = ((10.0,), (14.0,), (18.0,), (22.0,))
    return Trend(axis, ("frequency",), (1e5, 2.5e5), line, effects(*values, at=at, own=own), split, extremum)


@pytest.mark.parametrize(
    ("found", "holds", "text"),
    [
        (
            trend((0.2, 0.3)),
            Holds.RISES,
            "C of A rises with pressure from 1.00 to 2.50 bar, by 25 % on average over 2 frequencies (20 to 30 %).",
        ),
        (trend((-0.2,)), Holds.FALLS, "C of A falls with pressure from 1.00 to 2.50 bar, by 20 % at 10 Hz."),
        (
            trend((0.2, 0.001), split="frequency"),
            Holds.RISES,
            (
                "C of A rises with pressure from 1.00 to 2.50 bar, by 10 % on average over 2 frequencies (0.1 to 20 "
                "%); at 14 Hz the change is within its uncertainty."
            ),
        ),
        (trend((0.2,), line=False), Holds.RISES, "C of A is higher at 2.50 bar than at 1.00 bar, by 20 % at 10 Hz."),
        (
            trend((0.001,)),
            Holds.NO_CHANGE,
            (
                "C of A does not vary measurably with pressure: from 1.00 to 2.50 bar it changes by +0.1 % at 10 Hz, "
                "no more than the expanded uncertainty (95 %) of 1.0 %."
            ),
        ),
        (
            trend((-0.001,), line=False),
            Holds.NO_CHANGE,
            (
                "C of A does not differ measurably between 1.00 and 2.50 bar: it changes by -0.1 % at 10 Hz, no more "
                "than the expanded uncertainty (95 %) of 1.0 %."
            ),
        ),
        (
            trend((0.2,), extremum=Extremum(Holds.MAXIMUM, 1.7e5, Effect(-0.4, 0.01), Effect(-0.2, 0.01))),
            Holds.MAXIMUM,
            (
                "C of A has its maximum against pressure at 1.70 bar at 10 Hz: it is 40 % below it at 1.00 bar and 20 "
                "% below it at 2.50 bar."
            ),
        ),
        (
            trend((-0.3, 0.0, 0.2), split="frequency"),
            Holds.MIXED,
            (
                "C of A, between 1.00 and 2.50 bar, falls with pressure at 10 Hz, by up to 30 % at 10 Hz; does not "
                "vary measurably with pressure at 14 Hz; and rises with pressure at 18 Hz, by up to 20 % at 18 Hz."
            ),
        ),
        (
            trend((-0.2, 0.2), split="frequency", line=False),
            Holds.MIXED,
            (
                "C of A, between 1.00 and 2.50 bar, is lower at 2.50 bar at 10 Hz, by up to 20 % at 10 Hz and is "
                "higher at 2.50 bar at 14 Hz, by up to 20 % at 14 Hz; the change with pressure crosses zero at about "
                "12 Hz."
            ),
        ),
    ],
)
def test_a_trend(found, holds, text):
    assert said(found, holds, ("A",), C) == text


# ---- transmissibility


@pytest.mark.parametrize(
    ("peaks", "holds", "text"),
    [
        (
            {P1: Peak(15.0, 3.0, 14.0, 16.0, 15.3), P3: Peak(16.0, 3.5, 15.0, 17.0, 16.1)},
            Holds.INSIDE,
            (
                "A (10 kg added) at 1000 N resonates at about 15.3 Hz (1.00 bar) and 16.1 Hz (2.00 bar); the largest "
                "measured TR is 3.00 (1.00 bar) and 3.50 (2.00 bar)."
            ),
        ),
        (
            {P1: Peak(15.0, 3.0, 14.0, 16.0)},
            Holds.INSIDE,
            (
                "A (10 kg added) at 1000 N resonates between the tested frequencies 14.0 and 16.0 Hz (1.00 bar); the "
                "largest measured TR is 3.00 (1.00 bar)."
            ),
        ),
        (
            {(1e5 + i, 1000.0): Peak(15.0 + i, 3.0, 14.0, 16.0) for i in range(9)},
            Holds.INSIDE,
            "A (10 kg added) at 1000 N resonates at 15.0 to 23.0 Hz over 9 pressures; the largest TR is 3.00.",
        ),
        (
            {P1: Peak(22.0, 3.0, 22.0, 22.0, side=1)},
            Holds.AT_HIGHEST,
            (
                "The largest TR of A (10 kg added) stands at the highest tested frequency, beyond which the resonance "
                "may lie: 3.00 at 22 Hz (1.00 bar, 1000 N)."
            ),
        ),
    ],
)
def test_resonances(peaks, holds, text):
    assert said(Resonance(peaks), holds, ("A",), TR, mass=10.0) == text


@pytest.mark.parametrize(
    ("gaps", "holds", "text"),
    [
        (
            (2.0, 3.0),
            Holds.BELOW,
            ("The resonance of A lies below that of B at each of 2 conditions in common, by 2.0 to 3.0 Hz."),
        ),
        (
            (0.2, 0.1),
            Holds.NO_DIFFERENCE,
            (
                "The resonances of A and B cannot be distinguished at each of 2 conditions in common: the tested "
                "frequencies resolve them to 0.50 Hz."
            ),
        ),
        (
            (3.0, -1.0, 0.1),
            Holds.MIXED,
            (
                "The resonance of A lies below that of B at 1 of 3 conditions in common, above it at 1, and cannot be "
                "distinguished from it at 1."
            ),
        ),
    ],
)
def test_the_order_of_resonances(gaps, holds, text):
    found = dict(zip((P1, P2, P3), gaps, strict=False))
    assert said(ResonanceOrder(found, dict.fromkeys(found, 0.5)), holds, quantity=TR) == text


FINE, WIDE = Crossing(18.2, 18.0, 19.0, 1), Crossing(17.0, 14.0, 20.0, 1)


@pytest.mark.parametrize(
    ("at", "text"),
    [
        ({P1: (), P2: ()}, "do not cross beyond their uncertainty at each of 2 conditions in common."),
        (
            {P1: (FINE,), P3: ()},
            "cross once at 1 of 2 conditions in common, at about 18.2 Hz; below it A has the lower TR, above it B.",
        ),
        (
            {P1: (WIDE,)},
            (
                "cross once at the only condition in common, between the tested frequencies 14.0 and 20.0 Hz; below it "
                "A has the lower TR, above it B."
            ),
        ),
        (
            {P1: (FINE,), P3: (Crossing(19.2, 19.0, 20.0, -1),)},
            (
                "cross once at each of 2 conditions in common, between 18.2 Hz (1.00 bar, 1000 N) and 19.2 Hz (2.00 "
                "bar, 1000 N), at 18.7 Hz on average."
            ),
        ),
        ({P1: (FINE, WIDE)}, "cross more than once, at 18.2 Hz and 14.0 to 20.0 Hz (1.00 bar, 1000 N)."),
    ],
)
def test_crossings(at, text):
    found = Crossings(at)
    assert said(found, found.holds, quantity=TR) == f"The TR curves of A and B {text}"


@pytest.mark.parametrize(
    ("off", "beyond", "text"),
    [
        (
            {"D1": 0.01},
            (),
            "The measured TR of test D1 differs from the predicted one by 1.0 %, which is within the uncertainty.",
        ),
        (
            {"D1": 0.1, "D2": -0.2},
            ("D1", "D2"),
            (
                "The measured TR differs from the one predicted from K* and the rig by -5.0 % on average over 2 tests "
                "and by -20 % at most (test D2), which is beyond the uncertainty in D1 and D2."
            ),
        ),
    ],
)
def test_measured_against_predicted(off, beyond, text):
    assert said(Prediction(off, beyond), Holds.WITHIN, quantity=TR) == text


# ---- all sentences of a campaign


def test_a_sentence_is_plain_and_belongs_to_a_topic():
    tyres = {"A": Tyre(tr=rig_curve(15.0)), "B": Tyre(k1=120e3, tr=rig_curve(17.0))}
    found = found_in(Tables(tyres).results())
    made = sentences(found)
    assert {type(each) for each in made} == {Sentence}
    assert [each.topic for each in made] == [each.topic for each in found]
    for each in made:
        assert each.text.endswith(".")
        assert not re.search(r"\bnan\b", each.text)
        assert not re.search(r"\de[+-]?\d|None|[][]", each.text)


def test_a_sentence_names_its_tests_where_it_is_about_tests():
    results = Tables({"A": Tyre(tr=rig_curve(15.0))}, verdicts={"D3": ("rejected", "why")}).results()
    bad = pl.when(pl.col("test") == "D12").then(1.2).otherwise(1.0)
    found = found_in(Study(results.static, results.dynamic.with_columns(pl.col("TR measured [1]") * bad)))
    named = {type(one.detail): each.tests for one, each in zip(found, sentences(found), strict=True) if each.tests}
    assert named == {Reason: ("D3",), Prediction: ("D12",)}


@pytest.mark.parametrize("kind", ["one test", "static only", "dynamic only"])
def test_little_is_enough(kind):
    results = Tables({"A": Tyre(tr=rig_curve(15.0), nonlinearity=0.02)}).results()
    none = {"one test": (0, 1), "static only": (99, 0), "dynamic only": (0, 999)}[kind]
    found = found_in(Study(results.static.head(none[0]), results.dynamic.head(none[1]), results.previews))
    if kind == "one test":
        assert {each.kind for each in found} == {"tests", "level", "prediction"}
    assert all(each.text.endswith(".") for each in sentences(found))


@pytest.mark.parametrize(
    "name",
    ["<script>alert(1)</script>", "{tyre}", "%s %d", "a, b and c", "x" * 300, "7" * 6000, "Reifen ß №5", "a\nb", ""],
)
@pytest.mark.sampled(2)
def test_a_name_stands_as_it_is(name):
    tyres = {name: Tyre(tr=rig_curve(15.0)), "other": Tyre(k1=150e3, tr=rig_curve(17.0))}
    found = found_in(Tables(tyres).results())
    assert sum(name in each.text for each in sentences(found)) >= 8
    assert headline(found)


# ---- the headline


def test_the_headline_is_short():
    tyres = {"A": Tyre(tr=rig_curve(15.0)), "B": Tyre(k1=130e3, tr=rig_curve(17.0))}
    found = found_in(Tables(tyres).results())
    lines, made = headline(found), sentences(found)
    assert 5 <= len(lines) <= 8
    assert lines[0] == made[0].text
    topics = [next(each.topic for each in made if each.text == line) for line in lines]
    assert topics == list(dict.fromkeys(topics))


def test_where_nothing_is_used_the_headline_is_the_number_of_tests():
    empty = Study(frame([], STATIC.columns), frame([], DYNAMIC.columns), pl.DataFrame())
    rejected = {f"{kind}{i}": ("rejected", "why") for kind in "SD" for i in range(1, 50)}
    tables = Tables({"A": Tyre(construction="cross-ply"), "B": Tyre(construction="radial-ply")}, verdicts=rejected)
    tables.pressures = tables.pressures[:2]
    for results in (empty, tables.results()):
        found = found_in(results)
        assert {type(each.detail) for each in found[1:]} <= {Reason}
        assert headline(found) == [sentences(found)[0].text]


def test_the_order_of_the_rows_does_not_matter():
    rng = np.random.default_rng(3)
    tyres = {
        "tyre 10": Tyre(tr=rig_curve(15.0), construction="Radial-ply steel", nonlinearity=0.01),
        "tyre 9": Tyre(k1=140e3, tr=rig_curve(17.0), construction="cross-ply", nonlinearity=0.05),
    }
    verdicts = {"D3": ("rejected", "x is clipped"), "D12": ("warning", "noise")}
    results = Tables(tyres, noise=0.01, verdicts=verdicts).results()
    first = found_in(results)
    assert next(each for each in first if each.kind == "level").specimens == ("tyre 9",)
    for _ in range(3):
        mixed = [t[rng.permutation(t.height).tolist()] for t in (results.static, results.dynamic)]
        again = found_in(Study(*mixed, results.previews))
        assert sentences(again) == sentences(first)
        assert headline(again) == headline(first)
