"""Tolerances by which two campaigns of a data set have something in common: a case just inside each, one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

import shutil

import polars as pl
import pytest

from fourpole.lab import dataset, difference, gather


@pytest.fixture(scope="module")
def data(made, tmp_path_factory):
    """A data set of two campaigns, of one condition and four frequencies."""
    return gather(shutil.copytree(made, tmp_path_factory.mktemp("edges") / "made")).folder


#: Column of a condition -> its value in the first campaign, and cases in the second with the rows that are compared.
EDGES = {
    "temperature [degC]": (20.0, {24.9: 20, 25.1: 0, 15.1: 20, 14.9: 0}),
    "pressure [Pa]": (1.7e5, {1.7e5 / 0.981: 20, 1.7e5 / 0.979: 0}),
    "preload [N]": (1000.0, {1000.0 / 0.9905: 20, 1000.0 / 0.9895: 0}),
    "frequency [Hz]": (11.0, {11.0 / 0.9905: 5, 11.0 / 0.9895: 0}),
}


@pytest.mark.parametrize(("column", "first", "cases"), [(name, *edge) for name, edge in EDGES.items()], ids=EDGES)
@pytest.mark.sampled(4)
def test_a_tolerance_decides_between_two_cases(data, monkeypatch, column, first, cases):
    scan, found = dataset.scan, {}
    for case in cases:

        def changed(folder, table="tests", case=case):
            frame, value = scan(folder, table), pl.when(pl.col("campaign") == "2024").then(first).otherwise(case)
            there = column in frame.collect_schema().names()
            return frame.with_columns(value.alias(column)) if there else frame

        monkeypatch.setattr(dataset, "scan", changed)
        found[case] = difference(data, "2024", "south/2025").height
    assert found == cases
