"""The queries of docs/lab.md, run by DuckDB as they stand there, against the same by polars."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fourpole.lab import difference, gather, scan

duckdb = pytest.importorskip("duckdb")

PAGE = Path(__file__).resolve().parents[2] / "docs" / "lab.md"
QUERIES = re.findall(r"```sql\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.fixture(scope="module")
def data(made, tmp_path_factory):
    """The data set of two campaigns with names as the page has them."""
    folder = tmp_path_factory.mktemp("page")
    for name in ("2024", "south/2025"):
        shutil.copytree(made / name, folder / name.rpartition("/")[2])
    return gather(folder).folder


def asked(data, query, monkeypatch):
    monkeypatch.chdir(data)
    table = duckdb.sql(query)
    return pl.DataFrame(table.fetchall(), schema=table.columns, orient="row")


def test_one_specimen_over_the_years(data, monkeypatch):
    found = asked(data, QUERIES[0], monkeypatch)
    assert [str(day) for day in found["date"]] == ["2024-05-31", "2025-05-31"]
    rows = scan(data).filter((pl.col("frequency [Hz]") / 14 - 1).abs() < 0.01).sort("date").collect()
    for head in ("Re K* [N/m]", "u(C) [N s/m]"):
        assert found[head].to_list() == rows[head].to_list()


def test_two_campaigns_compared(data, monkeypatch):
    """The query lacks the step to one frequency, which is part of u in Python."""
    found = asked(data, QUERIES[1], monkeypatch)
    table = difference(data, "2024", "2025").filter(pl.col("quantity") == "Re K*")
    np.testing.assert_allclose(found["f"], table["frequency [Hz]"])
    np.testing.assert_allclose(found["u_independent"], table["u independent"], rtol=0.01)
    assert (found["u_same_sensors"] <= table["u same sensors"] * (1 + 1e-9)).all()
    step = np.sqrt(table["u same sensors"].to_numpy() ** 2 - found["u_same_sensors"].to_numpy() ** 2)
    independent = np.sqrt(table["u independent"].to_numpy() ** 2 - step**2)
    np.testing.assert_allclose(found["u_independent"], independent, rtol=1e-9)


def test_duckdb_and_polars_see_the_same_rows(data):
    for table in ("tests", "static", "rig", "budget", "covariance"):
        rows = duckdb.sql(f"SELECT * FROM '{data}/{table}/*.parquet'")
        theirs = scan(data, table).collect()
        assert rows.columns == theirs.columns
        assert len(rows.fetchall()) == theirs.height
