"""Rig, sensors and limits in words: what was found, what was not, and what cannot be seen."""

from dataclasses import replace

import polars as pl
import pytest
from tests.plot.conftest import blank, empty_results, results_of
from tests.plot.rig_found import JOINT, MISFIT, UNSTATED, VALUES, rig_table, with_rig_found

from fourpole.report.words.limits import limits
from fourpole.report.words.rig import DASH, rigs_in_words
from fourpole.study.rig_estimate import NoteCode

NOT_DETERMINED = "not determined by your data, taken from your statement"


@pytest.fixture(scope="module")
def plain():
    return with_rig_found(results_of(pressures=(170e3,), preloads=(1000.0,)))


def with_values(results, values, **joint):
    return replace(results, rig=rig_table(values), record={**results.record, "joint": {"": {**JOINT, **joint}}})


def changed(name, values=VALUES, **cells):
    """The values with some cells of one row changed."""
    names = ("unit", "stated", "u(stated)", "found", "u(found)", "pull", "seen", "finding")
    row = dict(zip(names, values[name], strict=True)) | cells
    return {**values, name: tuple(row.values())}


def of(results):
    (found,) = rigs_in_words(results)
    return found


# ---- the values


def test_values_have_the_digits_and_units_of_people(plain):
    by = {value.source.text: value for value in of(plain).values}
    assert by["moving_mass"].words("stated") == ("15.00", "0.20")
    assert by["moving_mass"].words("found") == ("15.020", "0.020")
    assert (by["preload_stiffness"].unit, *by["preload_stiffness"].words("found")) == ("kN/m", "12.451", "0.012")
    assert (by["gain F1"].unit, *by["gain F1"].words("found")) == ("%", "+0.4", "1.4")
    assert by["gain V2"].words("found")[0] == "−0.4"
    assert (by["phase V1"].unit, *by["phase V1"].words("stated")) == ("°", "0.0", "1.1")
    assert by["gain F1/V1"].name == "gain of F1 over V1"
    assert by["moving_mass"].ratio_words == "0.10"
    assert by["gain F1"].pull_words == "+0.60"
    assert by["preload_stiffness"].detection_words == "0.061 kN/m"
    assert by["gain V1"].detection_words == "at no size"


def test_what_is_no_number_is_a_dash(plain):
    nothing = ("kg", 15.0, float("nan"), float("nan"), float("nan"), float("nan"), float("nan"), "found")
    (value,) = of(with_values(plain, {"moving_mass": nothing})).values
    assert value.words("found") == (DASH, "")
    assert value.words("stated") == ("15.000", "")
    assert value.ratio_words == value.pull_words == DASH


def test_what_is_said_of_a_value_goes_by_its_finding_and_not_by_its_remark(plain):
    other = replace(plain, rig=plain.rig.with_columns(pl.lit("worded in another way").alias("remarks")))
    for results in (plain, other):
        by = {value.source.text: value.value.remark for value in of(results).values}
        assert by["gain V1"] == NOT_DETERMINED
        assert by["gain F1"] == "found in part from your data, in part from your statement"


def test_the_fit(plain):
    assert of(plain).fit == (
        "120 tests at 60 conditions share 6 unknown values. With rig and sensors as stated chi-square is 250 at 240 "
        "degrees of freedom, 1.0 per degree, where chance gives about 1."
    )


def test_without_degrees_of_freedom_no_fit_is_claimed(plain):
    assert of(with_values(plain, VALUES, tests=1, conditions=1, dof=0.0)).fit == (
        "1 test at 1 condition share 6 unknown values; they leave no degree of freedom to check the rig and "
        "the sensors against each other."
    )


def test_the_summary_counts_what_was_found(plain):
    found = of(plain)
    assert found.summary == (
        "Of 6 shared values 4 were found by your data; 2 were not determined by your data, taken from your statement."
    )
    assert (found.estimate.fits, found.misfit, found.candidates) == (True, (), ())


def test_values_that_are_all_exact_leave_nothing_to_find(plain):
    assert of(with_values(plain, {})).summary == "All values were stated as exact: there was nothing to find."


def test_another_route_has_no_rig_as_found():
    assert rigs_in_words(empty_results()) == []
    assert limits(empty_results()) == []


# ---- the misfit


@pytest.fixture(scope="module")
def misfit(plain):
    """A rig that does not fit; no value of it is calibrated."""
    return of(with_values(plain, {name: (*cells[:7], "not calibrated") for name, cells in VALUES.items()}, **MISFIT))


def test_where_the_rig_does_not_fit_nothing_is_called_calibrated(misfit):
    assert not misfit.estimate.fits
    assert misfit.summary == "Of 6 shared values none is called calibrated, because the rig as stated does not fit."


@pytest.mark.parametrize(
    ("at", "text"),
    [
        (
            0,
            (
                "The rig and the sensors as stated do not fit these tests: chi-square is 10 per degree of freedom, "
                "not 1."
            ),
        ),
        (
            1,
            (
                "The uncertainties of all results were enlarged to cover the misfit: each test includes an error of "
                "the rig's impedance of 2.0 % of its largest part, so that K* rests on the channels and all noise "
                "was multiplied by 1.5."
            ),
        ),
        (2, "No row counts as ok, and no value of this rig is called calibrated."),
    ],
)
def test_the_misfit_in_sentences(misfit, at, text):
    assert (misfit.misfit[at], len(misfit.misfit)) == (text, 3)


def test_a_candidate(misfit):
    assert misfit.candidates[0] == (
        "a moving mass 0.81 kg larger than stated, as an undeclared tyre mass would make it (U 2.5 %): "
        "chi-square would fall by 2100"
    )


def test_a_candidate_that_is_as_good_as_the_best(misfit):
    assert misfit.candidates[1].endswith(", nearly as much, so that the data do not distinguish it from the first")


def test_a_statement_that_is_contradicted_is_named(plain):
    values = changed("moving_mass", found=15.81, pull=81.0, seen=None, finding="contradicted")
    found = of(with_values(plain, values, **{**MISFIT, "rig_error": 0.0, "inflation": 1.0}))
    assert len(found.misfit) == 3  # nothing was enlarged
    assert found.misfit[1] == (
        "The data contradict what you state of the moving mass m: this statement hardly counts now, and its departure "
        "is in the uncertainties of all results."
    )
    # It was seen, so it is not among what stays unseen.
    assert not any("moving mass m" in text for text in found.unseen)
    assert found.values[0].detection_words == DASH


def test_a_search_that_did_not_converge(plain):
    assert of(with_values(plain, VALUES, converged=False, reason="no step helps")).remarks == (
        "The joint route did not converge (no step helps): do not rely on it, use the relative route.",
    )


def test_scatter(plain):
    assert of(with_values(plain, VALUES, scatter=0.012)).remarks == (
        (
            "K* repeats to 1.2 % from test to test, besides the noise; each row has K* of its own test. Look at "
            "temperature, conditioning and amplitude if this scatter is too large."
        ),
    )


def test_what_nobody_stated_has_a_name_and_a_unit_of_people(plain):
    by = {value.source.text: value for value in of(with_values(plain, {**VALUES, **UNSTATED})).values}
    frame, crossed, drift, angle = (by[name] for name in UNSTATED)
    assert (frame.name, frame.unit, *frame.words("found")) == (
        "compliance of the frame, not stated",
        "mm/kN",
        "11.00",
        "0.60",
    )
    assert (crossed.name, crossed.unit, crossed.words("found")[0]) == ("cross-talk of V2 in F1", "%", "+1.20")
    assert (drift.name, drift.unit, drift.words("found")[0]) == ("drift of K* of radial over the run", "%", "−2.10")
    assert (angle.name, angle.unit) == ("drift of the loss angle of radial over the run", "°")
    for value in (frame, crossed, drift, angle):
        assert value.words("stated")[0] == value.pull_words == value.ratio_words == value.detection_words == DASH
        assert not value.hidden


def test_what_nobody_stated_is_said_where_the_rig_does_not_fit(plain):
    joint = {**MISFIT, "rig_error": 0.0, "inflation": 1.0}
    found = of(with_values(plain, {**VALUES, **UNSTATED}, **joint))
    assert found.misfit[1] == (
        "The tests show what you did not state: compliance of the frame, not stated and cross-talk of V2 in F1. The "
        "uncertainties of all results include it."
    )
    assert not any("enlarged" in text for text in found.misfit)


def test_a_drift_is_said_with_its_size_and_its_order(plain):
    drift = {"drift of radial": UNSTATED["drift of radial"]}
    for order, words in ((None, "the order of tests.csv"), ("the column time", "the column time")):
        (text,) = of(with_values(plain, {**VALUES, **drift}, order=order)).remarks
        assert text.startswith("K* of radial drifts by -2.1 % over the run")
        assert words in text


def test_what_the_scale_rests_on_is_said(plain):
    rests = "K' rests on the added mass of 10 kg (+1 % per 1 % of it)"
    assert of(with_values(plain, VALUES, rests=rests)).remarks == (f"{rests}.",)


def test_a_note_goes_by_its_code_and_not_by_its_words(plain):
    for code in (NoteCode.UNSHARED_MASSES, NoteCode.OUTLIERS, ""):
        found = of(with_values(plain, VALUES, notes=["worded in another way"], note_codes=[str(code)]))
        note = found.estimate.note(code) if code is NoteCode.UNSHARED_MASSES else ""
        assert found.remarks == ((f"{note[0].upper()}{note[1:]}.",) if note else ())
    for joint, code in (({"inflation": 1.5}, NoteCode.NOISE), ({"tests": 1}, NoteCode.ONE_TEST)):
        assert of(with_values(plain, VALUES, **joint)).estimate.notes == (code,)


def test_outliers_are_named_the_worst_first(plain):
    rows = plain.residuals.with_columns(
        pl.when(pl.col("test") == "D10").then(60.0).when(pl.col("test") == "D2").then(90.0).otherwise(1.0)
        .alias("outlier [1]")
    )  # fmt: skip
    assert [(item.test, item.factor) for item in of(replace(plain, residuals=rows)).outliers] == [
        ("D2", 90.0),
        ("D10", 60.0),
    ]


# ---- what cannot be seen


def component(**changes):
    return {
        "component": "cross-talk V2 in V1", "unit": "1", "size": 0.098, "result": "TR", "shift": 165.5,
        "words": "cross-talk of V2 in V1, +9.8 % of its size", "key": "std_crosstalk",
    } | changes  # fmt: skip


def test_what_the_tests_do_not_show_stands_with_its_size_its_effect_and_its_key(plain):
    (text,) = of(with_values(plain, VALUES, unseen=[component()])).unseen
    assert text == (
        "These data would not show cross-talk of V2 in V1, +9.8 % of its size, by which TR would be off by 166 u; "
        "std_crosstalk in campaign.toml states it."
    )


def test_what_shows_at_no_possible_size_has_a_remedy_and_no_number(plain):
    said = of(with_values(plain, VALUES, unseen=[component(never=True, shift=4425.0)]))
    what = "cross-talk of V2 in V1, +9.8 % of its size"
    text = (
        f"These data would not show {what}, at this or any smaller size, but TR would contain it. Remedy: look for a "
    )
    assert said.unseen == (
        f"{text}cable, a ground or an amplifier that the two channels share, or state std_crosstalk.",
    )
    assert said.estimate.unseen[0].brief == f"{what} at this or any smaller size (std_crosstalk states it)"


def test_of_many_components_the_first_are_listed(plain):
    texts = of(with_values(plain, VALUES, unseen=[component(shift=50.0 - at, key="") for at in range(10)])).unseen
    assert len(texts) == 9
    assert texts[-1] == "2 further components would move a result by more than 2 u."


def test_a_size_that_nobody_would_miss_is_no_size(plain):
    absurd = of(with_values(plain, changed("moving_mass", seen=3e5)))
    assert [value.source.text for value in absurd.values if value.hidden] == [
        "moving_mass",
        "gain V1",
        "phase V1",
        "gain F1/V1",
    ]


def test_what_the_weighed_mass_gained(plain):
    assert of(plain).gain == (
        "With the weighed mass the tests without it give K2 to 0.07 % instead of 11 % and C to 0.08 % instead of 17 % "
        "(median U)."
    )
    assert of(with_values(plain, VALUES, gain_of_masses=None)).gain == ""


def test_a_record_that_is_not_ours_breaks_nothing(plain):
    for joint in ({"": 1}, [], None, {"": {"candidates": "x", "notes": 3, "chi2": [], "dof": "y", "fits": "no"}}):
        (found,) = rigs_in_words(replace(plain, record={"joint": joint}))
        assert found.values
    broken = {"": {**MISFIT, "candidates": [1, {}, {"text": "x", "explains": "y", "value": 0, "std": None}]}}
    assert of(replace(plain, record={"joint": broken})).candidates == ("x",)


# ---- what limits


def limit(results, quantity="K2"):
    (found,) = [found for found in limits(results) if found.quantity == quantity]
    return found


def only(results, source, share=0.8, **joint):
    return limit(with_rig_found(results, shares={source: share, "frequency": 1 - share}, **joint))


def test_the_largest_source_is_named_with_its_share_and_its_remedy(plain):
    found = limit(plain)
    assert (found.source.text, found.share, found.tests) == ("K1 branch gap", 0.5, 12)
    assert found.text == (
        "U of K2 is 4.0 % (median of 12 tests). The gap between the branches of K1 makes most of that, with 50 % "
        "of the variance; without it about 2.8 % would be left. Next is the noise of the sensors with 30 %. Cheapest "
        "remedy: use K' and K'', which need no K1; or state the K1 that you mean, with its uncertainty, in tests.csv "
        "(the gap is the rubber's own hysteresis, which no test closes)."
    )
    assert [found.quantity for found in limits(plain)] == ["Re K*", "Im K*", "K2", "C"]


@pytest.mark.parametrize(
    ("share", "known", "words"),
    [
        (0.4, True, "F1's gain is the largest part of it, with 40 % of the variance"),
        (0.6, False, "F1's gain makes most of the uncertainty of K2, with 60 % of the variance"),
        (0.4, False, "F1's gain limits K2 most, with 40 % of the variance"),
    ],
)
def test_what_limits_by_its_share(plain, share, known, words):
    results = plain if known else blank(plain, "u(K2) [N/m]")
    shares = {"gain F1": share, "frequency": (1 - share) / 2, "sensor noise": (1 - share) / 2}
    assert words in limit(with_rig_found(results, shares=shares)).text


def test_a_misfit_comes_before_everything_that_it_makes_larger(plain):
    for source in ("rig misfit", "sensor noise"):
        assert only(plain, source, **MISFIT).remedy == (
            "resolve the misfit first; the best candidate is a moving mass 0.81 kg larger than stated, as an "
            "undeclared tyre mass would make it"
        )
    assert "look for a part" in only(plain, "rig misfit").remedy
    assert "scatter of repeats" in only(plain, "sensor noise", scatter=0.01).remedy


def test_a_mass_that_was_used_already_is_not_asked_for_again(plain):
    massed = replace(plain, dynamic=plain.dynamic.with_columns(pl.lit(10.0).alias("added mass [kg]")))
    assert only(massed, "gain V1").remedy.startswith("repeat the tests with the weighed mass, or record them longer")
    other = with_rig_found(massed, shares={"phase F1": 1.0}, route="mobility")
    assert limit(other).remedy == "use the joint route: with the weighed mass it needs no calibrated sensor"


def test_another_route_is_told_of_the_joint_one(plain):
    other = with_rig_found(plain, shares={"moving_mass": 1.0}, route="mobility")
    assert limit(other).remedy.startswith("use the joint route, which finds it from V2")
    blind = with_rig_found(blank(plain, "V2 [m/s]"), shares={"moving_mass": 1.0}, route="mobility")
    assert limit(blind).remedy.endswith("or measure V2 too and use the joint route")


def test_without_k2_it_is_k_star_that_is_limited(plain):
    budget = plain.budget.filter(~pl.col("quantity").is_in(["K2", "C"]))
    found = limits(replace(plain, budget=budget))
    assert [item.quantity for item in found] == ["Re K*", "Im K*"]
    assert found[0].text.startswith("U of K′ ")


def test_medians_count_tests_without_a_source_as_none_and_leave_rejected_ones_out(plain):
    rows = plain.budget.filter((pl.col("source") != "K1 branch gap") | (pl.col("test") == "D1"))
    found = limit(replace(plain, budget=rows))
    assert (found.source.text, found.share) == ("sensor noise", 0.3)
    rejected = plain.dynamic.with_columns(
        pl.when(pl.col("test") == "D1").then(pl.lit("ok")).otherwise(pl.lit("rejected")).alias("verdict")
    )
    found = limit(replace(plain, budget=rows, dynamic=rejected))
    assert (found.source.text, found.tests) == ("K1 branch gap", 1)


@pytest.mark.parametrize(("tied", "alike"), [(0, []), (1, []), (2, [1]), (3, [1, 2]), (6, [1, 2, 3, 4, 5])])
def test_all_candidates_that_explain_the_misfit_equally_well_are_listed_as_such(plain, tied, alike):
    first, second = MISFIT["candidates"]
    listed = [first, *[{**second, "explains": 1000.0 - at} for at in range(5)]]
    texts = of(with_values(plain, VALUES, **{**MISFIT, "candidates": listed, "tied": tied})).candidates
    assert len(texts) == max(4, tied)
    assert [at for at, text in enumerate(texts) if "do not distinguish it from the first" in text] == alike
