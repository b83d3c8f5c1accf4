"""checks.csv: every check of every test with its code, on disk and back; old results are read without it."""

import polars as pl
import pytest
from tests.unlisted import unlisted

from fourpole.core.checks import Code, Verdict, reported
from fourpole.study.analysis import analyse
from fourpole.study.results import read_results
from fourpole.virtual import simulate_campaign


@pytest.fixture(scope="module")
def hurt(tmp_path_factory):
    """D1 is missing, D2 holds two cycles, D3's V1 stands still; K2 and C of the others are known poorly."""
    folder = tmp_path_factory.mktemp("hurt")
    conditions = {"pressures": [170e3], "preloads": [1000.0], "frequencies": [10.0, 12.0, 14.0]}
    campaign = simulate_campaign(folder, **conditions, clean=True)
    (folder / "recordings" / "D1.csv").unlink()
    lines = (folder / "recordings" / "D2.csv").read_text().splitlines()
    step = float(lines[2].split(",")[0]) - float(lines[1].split(",")[0])
    (folder / "recordings" / "D2.csv").write_text("\n".join(lines[: 1 + int(0.15 / step)]) + "\n")
    still = pl.read_csv(folder / "recordings" / "D3.csv")
    still.with_columns(pl.lit(0.01).alias(still.columns[2])).write_csv(folder / "recordings" / "D3.csv")
    return campaign


@pytest.mark.parametrize("monte_carlo", [0, 300])
def test_every_test_has_its_checks_whatever_is_drawn(hurt, monte_carlo):
    study = analyse(hurt.folder, monte_carlo=monte_carlo)
    worst = {}
    for row in study.checks.rows(named=True):
        code = Code.read(row["code"])
        assert code is not None
        if row["verdict"] == "rejected":
            worst[row["test"]] = code
    assert [worst[f"D{at}"] for at in (1, 2, 3)] == [Code.RECORDING, Code.TOO_SHORT, Code.CONSTANT]
    rejected = study.dynamic.filter(pl.col("verdict") == "rejected")["test"].to_list()
    assert set(rejected) == set(worst)


def test_the_table_is_read_back_as_it_was(hurt, tmp_path):
    study = analyse(hurt.folder, monte_carlo=0)
    found = read_results(study.write(tmp_path / "results"))
    assert found.checks.equals(study.checks)
    (unlisted(tmp_path / "results") / "checks.csv").unlink()
    assert read_results(tmp_path / "results").checks.is_empty()


def test_every_row_rests_on_its_checks(hurt):
    """The verdict of a test is the worst of its checks, and every remark is the sentence of one."""
    study = analyse(hurt.folder, monte_carlo=0)
    order = ["ok", "warning", "rejected"]
    for row in study.dynamic.rows(named=True):
        mine = study.checks.filter(pl.col("test") == row["test"])
        assert max(mine["verdict"].to_list(), key=order.index) == row["verdict"]
        for remedy in mine.filter(pl.col("verdict") != "ok")["remedy"].to_list():
            assert remedy in row["remarks"]


def test_equal_checks_are_one():
    """The same check of a static test at several preloads stands once; its not-a-number is no difference."""
    assert len({reported(Code.SECANT, Verdict.OK, error="x"), reported(Code.SECANT, Verdict.OK, error="x")}) == 1
