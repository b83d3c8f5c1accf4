"""The registry of result tables: what is made is what it says, and a table with points goes through all of it."""

import math
import sys
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from fourpole import analyse
from fourpole.findings.facts import FINDING_COLUMNS
from fourpole.fitting.rows import KEY, key_of, keyed
from fourpole.io.published import Published, published
from fourpole.quantities import meaning_of
from fourpole.study.record import KEYS
from fourpole.study.results import read_results
from fourpole.study.study import Study
from fourpole.study.tables import TABLES, read_table

DOCS = Path(__file__).parents[2] / "docs" / "tables.md"


def described():
    """docs/tables.md, from the registry: `python tests/study/test_tables.py > docs/tables.md`."""
    lines = [
        "# The result tables",
        "",
        "The columns of every table that `fourpole analyse` writes; [the campaign folder](campaign.md) says how to",
        "read them. Values are in the unit of the column's head, SI. A table marked * has no file if it has no rows.",
        "Where a test has several rows, because its recording gave several frequencies, `point` stands after `test`",
        "and counts them. `static.csv` has further columns for the temperature and for each axis of `[conditions]`,",
        "where a static test states it; `dynamic.csv` has all further columns of tests.csv.",
    ]
    for spec in TABLES.values():
        files = ", ".join(f"`{spec.name}{ending}`" for ending in spec.endings)
        key = ", ".join(f"`{head}`" for head in spec.key)
        lines += ["", f"## {files}{'' if spec.always else ' *'}", "", f"A row: {spec.about}. Known by {key}.", ""]
        lines += ["| column | holds |", "|---|---|"]
        lines += [f"| `{head}` | {meaning_of(head)} |" for head in spec.columns]
    lines += ["", "## `findings.csv`", "", "A row: a finding. The heads have no unit: the column `unit` states it.", ""]
    lines += ["| column | holds |", "|---|---|", *(f"| `{head}` | {text} |" for head, text in FINDING_COLUMNS.items())]
    lines += [
        "",
        "## `study.json`",
        "",
        "What it takes to repeat the run, and to see whether files have changed since:",
    ]
    lines += ["[fourpole verify](selftest.md#check-results) does both. Further keys may come, none changes.", ""]
    lines += ["| key | holds |", "|---|---|", *(f"| `{key}` | {text} |" for key, text in KEYS.items())]
    return "\n".join(lines) + "\n"


def test_the_docs_list_all_tables_and_columns():
    assert DOCS.read_text(encoding="utf-8") == described(), "run python tests/study/test_tables.py > docs/tables.md"


@pytest.fixture(scope="module")
def study(noisy_campaign):
    return analyse(noisy_campaign)


def test_the_energy_of_a_cycle_is_that_of_the_amplitude_in_its_row(study):
    """Its u has that of K'' and twice that of the deflection, whose sensors are known to 0.02 %."""
    rows = study.dynamic
    loss, moved, energy = (rows[head] for head in ("Im K* [N/m]", "deflection amplitude [m]", "energy per cycle [J]"))
    assert energy.to_list() == pytest.approx((math.pi * loss * moved**2).to_list(), rel=1e-12)
    ratio = (rows["u(energy per cycle) [J]"] / energy).to_list()
    assert all(of < u < of + 0.02 for u, of in zip(ratio, rows["u(Im K*) [N/m]"] / loss, strict=True))


def test_results_without_a_column_that_came_later_are_read(study, tmp_path):
    study.write(tmp_path)
    table, heads = tmp_path / "dynamic.csv", ["energy per cycle [J]", "u(energy per cycle) [J]", "K* of"]
    table.write_text(pl.read_csv(table).drop(heads).write_csv())
    read = read_table(Published(tmp_path, {}), TABLES["dynamic"])
    assert read[heads].row(0) == (None, None, "")
    assert read.schema["energy per cycle [J]"] == pl.Float64


def test_study_json_has_the_keys_that_are_documented(written):
    assert set(published(written).record) == set(KEYS)


@pytest.fixture(scope="module")
def written(study, tmp_path_factory):
    return study.write(tmp_path_factory.mktemp("results"))


def test_what_is_written_has_the_columns_of_the_registry(study, written):
    for name, spec in TABLES.items():
        table, heads = study.tables[name], list(spec.columns)
        assert table.columns[: len(heads)] == heads, name
        assert {head: table.schema[head] for head in heads} == dict(spec.columns), name
        for ending in spec.endings:
            assert (written / f"{name}{ending}").is_file() == bool(table.height or spec.always), name


def test_the_key_tells_the_rows_of_a_table_apart(study):
    for name, spec in TABLES.items():
        table = keyed(study.tables[name]) if "point" in spec.key else study.tables[name]
        assert not table.select(spec.key).is_duplicated().any(), name


def test_results_hold_what_the_registry_reads(study, written):
    found = read_results(written)
    assert set(found.tables) == {name for name, spec in TABLES.items() if spec.read}
    for name, table in found.tables.items():
        assert table.equals(study.tables[name]) or not study.tables[name].height, name
        assert getattr(found, name) is table


def test_what_would_not_belong_to_the_tables_goes_and_the_rest_stays(study, tmp_path):
    for name in ("budget.csv", "corrections.csv", "findings.csv", "report.html", "notes.txt"):
        (tmp_path / name).write_text("old\n")
    empty = {name: table.clear() for name, table in study.tables.items() if not TABLES[name].always}
    replace(study, tables={**study.tables, **empty}).write(tmp_path)
    assert not (tmp_path / "budget.csv").exists()
    assert not (tmp_path / "corrections.csv").exists()
    assert not (tmp_path / "findings.csv").exists()
    assert not (tmp_path / "report.html").exists()
    assert (tmp_path / "notes.txt").exists()
    assert read_results(tmp_path).budget.is_empty()


def test_tables_of_results_are_attributes_and_can_be_replaced():
    one, two = pl.DataFrame({"test": ["D1"]}), pl.DataFrame({"test": ["D2"]})
    results = Study(dynamic=one)
    assert results.dynamic is one
    assert results.quantiles.columns == []
    assert replace(results, dynamic=two, record={"title": "x"}).dynamic is two


def test_a_row_without_a_point_has_the_first():
    assert key_of({"test": "D1"}) == key_of({"test": "D1", "point": None}) == ("D1", 1)
    table = keyed(pl.DataFrame({"test": ["D1", "D1"], "point": [None, 2]}))
    assert table.select(KEY).rows() == [("D1", 1), ("D1", 2)]


if __name__ == "__main__":
    sys.stdout.write(described())
