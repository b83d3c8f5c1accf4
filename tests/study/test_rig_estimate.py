"""The rig as found, read from the results as typed values."""

from dataclasses import replace

import pytest
from tests.plot.conftest import empty_results, results_of
from tests.plot.rig_found import MISFIT, VALUES, rig_table, with_rig_found

from fourpole.core.sources import Kind, Source
from fourpole.study.rig_estimate import NoteCode, Outlier
from fourpole.words import cause_words


@pytest.fixture(scope="module")
def plain():
    return with_rig_found(results_of(pressures=(170e3,), preloads=(1000.0,)))


def test_fit_gain_and_counts_are_numbers(plain):
    (found,) = plain.rigs
    assert (found.rig, found.fits, found.converged) == ("", True, True)
    assert (found.tests, found.conditions, found.shared) == (120, 60, 6)
    assert found.chi2_per_dof == 250.0 / 240.0
    assert found.mass_gain == {"K2": (0.056, 0.00037), "C": (0.086, 0.0004)}


def test_a_misfit_has_its_candidates_and_what_was_enlarged(plain):
    record = {"joint": {"": MISFIT}}
    (found,) = replace_record(plain, record).rigs
    assert (found.fits, found.rig_error, found.inflation) == (False, 0.02, 1.5)
    second = found.candidates[1]
    assert (cause_words(second), second.value, second.std) == ("a gain of F1 off by +4.5 %", 0.045, 0.001)
    assert (second.explains, second.source) == (2000.0, Source(Kind.GAIN, "F1"))
    assert found.notes == (NoteCode.MISFIT,)


def test_a_misfit_without_a_cause_claims_none_in_the_uncertainties(plain):
    record = {"joint": {"": {**MISFIT, "rig_error": 0.0}}}
    (found,) = replace_record(plain, record).rigs
    assert "the uncertainties include these causes" in found.note(NoteCode.MISFIT)
    assert "include no cause of it" in replace(found, candidates=()).note(NoteCode.MISFIT)


def test_a_value_that_is_not_calibrated_makes_a_rig_that_does_not_fit(plain):
    values = {name: (*cells[:7], "not calibrated") for name, cells in VALUES.items()}
    (found,) = replace(plain, tables={**plain.tables, "rig": rig_table(values)}).rigs
    assert not found.fits


def test_outliers_are_those_with_an_enlarged_variance(plain):
    rows = plain.residuals.to_dicts()
    rows[3]["outlier [1]"] = 90.0
    table = type(plain.residuals)(rows, schema=plain.residuals.schema)
    (found,) = replace(plain, tables={**plain.tables, "residuals": table}).rigs
    assert found.outliers == (Outlier(rows[3]["test"], 90.0),)


def test_another_route_leaves_no_estimate_and_a_strange_record_its_defaults(plain):
    assert empty_results().rigs == ()
    for joint in ({"": 1}, [], None, {"": {"candidates": "x", "notes": 3, "chi2": [], "dof": "y", "fits": "no"}}):
        (found,) = replace_record(plain, {"joint": joint}).rigs
        assert (found.fits, found.chi2_per_dof, found.candidates, found.notes) == (True, None, (), ())


def replace_record(results, record):
    return replace(results, record=record)
