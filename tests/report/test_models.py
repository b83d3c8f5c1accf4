"""The section on models and maps: sentences, tables, the question to a map, and what it does in a browser."""

import re
import shlex
from dataclasses import replace

import numpy as np
import pytest
from tests.findings.designed import Tables, Tyre
from tests.plot.conftest import results_of
from tests.plot.modelled import against, edited, elastomer, judged, named, study_with_models
from tests.report.test_page import Reader, on_page

from fourpole import units
from fourpole.core.digits import number, with_std
from fourpole.findings.facts import Facts
from fourpole.fitting.modelparts import VerdictFile
from fourpole.fitting.query import Query, ask
from fourpole.models.ladder import Lie
from fourpole.report.digits import expanded
from fourpole.report.models import (
    discrepancy,
    lie_in_words,
    map_facts,
    models_section,
    query_command,
    remarks_on_map,
    sentences,
    tyre_option,
)
from fourpole.report.page import render_report

HOSTILE = "<script>alert(1)</script>\"'& \x1b"
#: Options of fourpole query that name an axis: the kind of quantity, and the column.
OPTIONS = {
    "--pressure": ("pressure", "pressure [Pa]"),
    "--preload": ("force", "preload [N]"),
    "--temperature": ("temperature", "temperature [degC]"),
}


def test_a_deflection_that_v1_lacks_is_no_spring_in_series():
    """A spring in series with a relaxing specimen is one too: it explains no K* that a relaxing one cannot have."""
    lacking = lie_in_words(Lie("compliance", -1e-6, "m/N", 0.0))
    assert "V1 too small by the deflection of 1 kN/mm, or less" in lacking
    assert "in series" not in lacking
    assert "1 kN/mm, or less, in series" in lie_in_words(Lie("compliance", 1e-6, "m/N", 0.0))


@pytest.fixture(scope="module")
def fitted():
    return against(study_with_models(), "kelvin")


def section(results, at=0):
    return models_section(results)[at]


def asked(command):
    """What the options of a question say."""
    words = shlex.split(command)
    assert words[:3] == ["fourpole", "query", "map.json"]
    options = dict(zip(words[3::2], words[4::2], strict=True))
    frequency = units.frequency_grid(options.pop("--frequency"))
    tyre = options.pop("--specimen", None)
    state = {}
    for option, text in options.items():
        if option == "--at":
            column, _, value = text.rpartition("=")
            state[column] = float(value)
        else:
            kind, column = OPTIONS[option]
            state[column] = units.quantity(text, kind)
    return Query(frequency, state, tyre)


# ---- in words


def test_the_choice_and_the_model_discrepancy_are_said(fitted):
    entry = fitted.models.models[0]
    said = sentences(entry)
    assert said[0].startswith(entry.choice.rstrip("."))
    assert f"{100 * entry.discrepancy:.1f} %" in said[1]
    exact = sentences(entry.model_copy(update={"discrepancy": 0.0}))
    assert exact == [said[0], *said[2:]]


@pytest.mark.parametrize(
    ("known", "text"),
    [
        (True, "The model does not fit within the measurement uncertainty. With a model discrepancy of 2.0 % of"),
        (False, "The table does not state the uncertainty. With a standard uncertainty of 2.0 % of"),
    ],
)
def test_the_model_discrepancy(fitted, known, text):
    entry = judged(edited(fitted, discrepancy=0.02), [(True, 0.0, [])]).models.models[0]
    if not known:
        (one,) = entry.conditions
        entry = entry.model_copy(update={"conditions": [one.model_copy(update={"verdict": None})]})
    assert re.fullmatch(
        re.escape(text)
        + r" \|K\*\| added, chi-square per degree of freedom is \d(\.\d+)?; the intervals below include it\.",
        discrepancy(entry),
    )


def test_a_model_that_is_not_causal(fitted):
    entry = fitted.models.models[0]
    (more,) = {*sentences(entry.model_copy(update={"causal": False}))} - {*sentences(entry)}
    assert more == "It is not causal: it describes K* at these frequencies, but cannot be stepped in time."


def test_a_c_that_rises_with_frequency_is_why_no_passive_specimen_is_alike(fitted):
    def said(judgement, c):
        facts = Facts.of(Tables({"cross-ply": Tyre(c=c)}).results())
        return sentences(judged(fitted, [judgement]).models.models[0].model_copy(update={"tyre": "cross-ply"}), facts)

    def rising(p, load, f):
        return 900.0 * (f / 10.0) ** 0.3

    good, bad = (True, 0.01, []), (False, 0.0312, [10.0, 12.0])
    assert said(bad, rising)[-1] == (
        "No massless, relaxing specimen has a C that rises with frequency, as here by 23 % from 10 to "
        "22 Hz: with any constant K1, C can only fall."
    )
    for judgement, c in ((good, rising), (bad, 900.0), (bad, lambda p, load, f: 9000.0 / f)):
        assert not any("can only fall" in sentence for sentence in said(judgement, c))


def test_verdicts_are_summed_up(fitted):
    def verdicts(*judgements):
        return " ".join(sentences(judged(edited(fitted, discrepancy=0.0), judgements).models.models[0])[1:])

    good, bad = (True, 0.01, []), (False, 0.0312, [10.0, 12.0])
    assert verdicts(good) == "A massless, relaxing specimen can have this K*, within its uncertainty."
    assert verdicts(good, good) == "A massless, relaxing specimen can have K* as measured in all 2 conditions."
    assert verdicts(bad) == (
        "No specimen, relaxing or with a mass or resonances, can have this K*: it would take an "
        "error of K* of up to 3.1 % at each frequency. "
        "K* cannot be at 10, 12 Hz."
    )
    assert verdicts(good, bad, (False, 0.2, [14.0])) == (
        "1 of 3 conditions is possible for a specimen, relaxing or with a mass or resonances; in the others it would "
        "take an error of K* of up to 20 % at each frequency. At 1 bar, 2000 N: K* cannot be at 10, 12 Hz; at 1.7 bar, "
        "1000 N: K* at 14.0 Hz cannot be."
    )
    every = (False, 0.05, [10.0, 14.0, 17.0, 19.0, 24.0])
    assert verdicts(every, every) == (
        "None of 2 conditions is possible for a specimen, relaxing or with a mass or resonances; it would "
        "take an error of K* of up to 5.0 % at each frequency. There K* cannot be at any of the frequencies."
    )
    entry = judged(edited(fitted, discrepancy=0.0), [good]).models.models[0]
    (one,) = entry.conditions[:1]
    massed = one.verdict.model_copy(update={"holds": "mass", "mass": 1.02})
    assert (
        "with a mass of 1.02 kg at its driven end, which is taken off K* before the fit,"
        in sentences(entry.model_copy(update={"conditions": [one.model_copy(update={"verdict": massed})]}))[-1]
    )
    lone = judged(fitted, [(False, 0.1, [])]).models.models[0]
    assert "No single frequency is at fault" in sentences(lone)[-1]
    unknown = [one.model_copy(update={"verdict": None}) for one in lone.conditions]
    assert "uncertainty of K* is unknown" in sentences(lone.model_copy(update={"conditions": unknown}))[-1]


def test_many_impossible_conditions_are_not_all_named():
    entry = study_with_models().models.models[0]
    conditions = [
        one.model_copy(
            update={"verdict": VerdictFile(possible=False, chance=0.0, misfit=0.1, impossible=[10.0 + at, 20.0])}
        )
        for at, one in enumerate(entry.conditions * 2)
    ]
    said = sentences(entry.model_copy(update={"conditions": conditions}))[-1]
    assert said.count("cannot be") == 6
    assert said.endswith("; and in 6 more.")


# ---- the tables


def test_candidates_are_listed_with_the_chosen_marked(fitted):
    entry, model = fitted.models.models[0], section(fitted).model
    assert [row.model for row in model.candidates] == ["zener", "kelvin"]
    assert [row.chosen for row in model.candidates] == [True, False]
    best, other = model.candidates
    assert best.cells[3] == "0"
    worse = entry.candidates[1].bic - entry.candidates[0].bic
    assert float(other.cells[3]) == pytest.approx(worse, abs=0.5)
    assert float(best.cells[1]) == pytest.approx(entry.candidates[0].chi2 / entry.candidates[0].dof, rel=5e-3)
    assert best.cells[0] == str(entry.candidates[0].free)


def test_parameters_have_units_uncertainties_and_intervals(fitted):
    entry, model = fitted.models.models[0], section(fitted).model
    assert [(symbol, unit) for symbol, unit, _ in model.parameters] == [("K1", "kN/m"), ("K2", "kN/m"), ("C", "N s/m")]
    assert [row.place for row in model.conditions[:2]] == ["1 bar, 1000 N", "1 bar, 2000 N"]
    one, cell = entry.conditions[0], model.conditions[0].cells[1]
    std = np.sqrt(one.covariance[1][1]) * 1e-3
    assert (cell.text, cell.std) == expanded(one.values[1] * 1e-3, std)
    low, high = (with_std(end * 1e-3, std)[0] for end in one.intervals[1])
    assert cell.interval == f"{low} to {high}"
    assert model.conditions[0].band == f"{number(one.band[0], 3)} to {number(one.band[1], 3)}"
    assert not model.open
    assert section(judged(fitted, [(True, 0.0, [])])).model.open


def test_what_the_data_do_not_bound_is_said(fitted):
    entry = fitted.models.models[0]
    one = entry.conditions[0]
    still = [[0.0 if 2 in (row, column) else one.covariance[row][column] for column in range(3)] for row in range(3)]
    odd = one.model_copy(
        update={"intervals": [(None, 150e3), (None, None), (700.0, None)], "on_bound": ["K2"], "converged": False,
                "covariance": still}
    )  # fmt: skip
    lone = replace(
        fitted, models=fitted.models.model_copy(update={"models": [entry.model_copy(update={"conditions": [odd]})]})
    )
    (row,) = section(lone).model.conditions
    assert row.remark == "the fit did not converge"
    first, second, third = row.cells
    assert re.fullmatch(r"open to 1[45]\d(\.\d+)?", first.interval)
    assert (second.mark, second.std, second.interval) == ("on a bound", "", "open to both sides")
    assert (third.mark, third.interval) == ("given", "")


def test_a_table_without_tyre_has_a_section_without_name():
    nameless = replace(results_of(pressures=(170e3,), frequencies=(10.0,)), models=elastomer().models)
    said, page = on_page(nameless), render_report(nameless, findings=[], figures={})
    assert "Parameters of fractional in 1 condition" in said
    assert "all tests" in said
    assert "<h3><bdi></bdi></h3>" not in page


# ---- the map


@pytest.mark.parametrize("at", [0, 1])
def test_the_question_to_a_map_is_answered_inside(fitted, at):
    part = section(fitted, at)
    query = asked(part.map.command)
    assert query.tyre == part.tyre
    (row,) = ask(fitted.maps, query)
    assert row["outside [half spans]"] == 0
    assert row["remarks"].endswith("(scatter of the tests about the map)")  # and nothing of a place outside
    assert ";" not in row["remarks"]
    assert row["Re K* [N/m]"] > 0


def test_the_question_stays_inside_where_rounded_digits_would_leave():
    """Over one axis the middle in three digits will do; of tests along a slanting line it is beside the line."""
    whole = elastomer((0.0, 20.0, 40.0))
    entry = whole.maps.maps[0]
    query = asked(query_command(entry, several=False))
    assert query.tyre is None
    assert 0.0 <= query.state["temperature [degC]"] <= 40.0
    thin = entry.model_copy(
        update={
            "axes": [
                axis.model_copy(update={"name": name, "unit": unit, "values": values})
                for axis, name, unit, values in (
                    (entry.axes[0], "pressure", "Pa", [100123.4, 170345.6, 240567.8]),
                    (entry.axes[0], "camber of it", "deg", [1.00123, 2.00345, 3.00567]),
                )
            ],
            "terms": [[*term, 0] for term in entry.terms],
        }
    )
    query = asked(query_command(thin, several=False))
    assert query.state == pytest.approx({"pressure [Pa]": 170345.6, "camber of it [deg]": 2.00345}, rel=1e-9)


def test_a_map_says_where_it_holds_and_how_well(fitted):
    facts = dict(section(fitted).map.facts)
    entry = fitted.maps.maps[0]
    assert facts["pressure"] == "1, 1.7, 2.4 bar"
    assert facts["preload"] == "1000, 2000 N"
    assert facts["frequency"] == f"{entry.band[0]:.1f} to {entry.band[1]:.1f} Hz"
    assert float(facts["leave-one-out error of K*"].split()[0]) == pytest.approx(100 * entry.leave_one_out[0], rel=0.05)
    untold = entry.model_copy(update={"leave_one_out": (None, None, None)})
    assert list(dict(map_facts(untold))) == ["model", "pressure", "preload", "frequency"]


@pytest.mark.parametrize(
    ("axes", "text"),
    [
        (0, "The tests stand at one condition: the map holds there alone."),
        (
            1,
            (
                "It holds between the tested conditions and in the band; fourpole query extrapolates beyond them only "
                "on request."
            ),
        ),
        (
            2,
            (
                "It holds between the tested conditions (inside their hull) and in the band; fourpole query "
                "extrapolates beyond them only on request."
            ),
        ),
    ],
)
def test_the_range_of_a_map(fitted, axes, text):
    entry = fitted.maps.maps[0]
    assert remarks_on_map(entry.model_copy(update={"axes": entry.axes[:axes]})) == [text]


@pytest.mark.parametrize("name", ["a b", "it's $HOME `x`", "--help", "", "radial-ply"])
def test_a_name_of_a_tyre_reaches_the_command_as_it_is(name):
    option, read = shlex.split(tyre_option(name))
    assert (option, read) == ("--specimen", name)


# ---- on the page


def test_without_models_the_section_says_the_command_that_makes_them():
    results = results_of(pressures=(170e3,), frequencies=(10.0,))
    assert "<code>fourpole fit RESULTS</code>" in render_report(results, findings=(), figures={})
    bare = replace(results, tables={**results.tables, "dynamic": results.dynamic.clear()})
    assert 'id="models"' not in render_report(bare, findings=(), figures={})


def test_models_maps_and_faults_stand_on_the_page(fitted):
    said = on_page(replace(fitted, faults=("map.json is of other results and left out: run fourpole map again",)))
    for text in (
        "map.json is of other results and left out",
        "cross-ply",
        "radial-ply",
        "zener chosen",
        "Parameters of zener in 6 conditions",
        "Operating map",
        "To query it: fourpole query map.json --specimen cross-ply --pressure",
    ):
        assert text in said, text
    alone = on_page(replace(fitted, models=None, maps=None, faults=("model.json: is no model file",)))
    assert "model.json: is no model file" in alone


def test_whatever_a_model_file_holds_stays_text(fitted):
    names = {"cross-ply": HOSTILE, "radial-ply": "\u202e" + "x" * 300}
    entry = named(fitted.models, names).models[0]
    condition = entry.conditions[0]
    state = [one.model_copy(update={"name": HOSTILE, "unit": HOSTILE}) for one in condition.state]
    entry = entry.model_copy(update={"choice": HOSTILE, "conditions": [condition.model_copy(update={"state": state})]})
    hostile = replace(
        fitted,
        models=fitted.models.model_copy(update={"models": [entry]}),
        maps=named(fitted.maps, names),
        faults=(HOSTILE,),
    )
    text = render_report(hostile, findings=(), figures={})
    page = Reader(text)
    assert text.count("<script") == 2
    assert page.handlers == []
    assert len(set(page.ids)) == len(page.ids)
    assert "".join(page.texts).count("<script>alert(1)</script>") >= 5
    assert "\x1b" not in text
