"""The command that compares two runs or two specimens."""

import json
import shutil

import polars as pl
import pytest

from fourpole import analyse
from fourpole.virtual import CROSS_PLY, RADIAL_PLY, simulate_campaign


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """A campaign of two tyres with results."""
    folder = tmp_path_factory.mktemp("compare") / "two tyres"
    simulate_campaign(
        folder, pressures=[170e3], preloads=[1000.0], frequencies=[12.0, 17.0], tyres=[CROSS_PLY, RADIAL_PLY]
    )
    analyse(folder, monte_carlo=0).write(folder / "results")
    return folder


def test_the_table_fits_80_columns_and_begins_with_the_largest_ratio(run, both, monkeypatch):
    ran = run("compare", both, "--specimens", "cross-ply", "radial-ply")
    assert (ran.exit_code, ran.stderr) == (0, "")
    lines = ran.stdout.splitlines()
    assert lines[0] == "radial-ply less cross-ply; ± is U (k = 2), z the difference over u"
    assert "differs (13 of 13):" in lines
    table = [line for line in lines if line.startswith("1.7 bar")]
    assert len(table) == 13
    assert max(map(len, table)) <= 80
    ratios = [abs(float(line.split()[-1].replace("−", "-"))) for line in table]
    assert ratios == sorted(ratios, reverse=True)
    assert "13 of 13 differences are beyond U = 2 u; one would be by chance" in ran.stdout
    assert "the covariance that the campaign found" in ran.stdout


def test_rows_and_page_are_written_and_json_is_in_si(run, both, tmp_path):
    file, page = tmp_path / "rows.csv", tmp_path / "compare.html"
    given = ("--specimens", "cross-ply", "radial-ply", "--out", file, "--page", page, "--json")
    ran = run("compare", both, *given)
    said = json.loads(ran.stdout)
    assert (said["first"], said["second"], said["beyond"], len(said["rows"])) == ("cross-ply", "radial-ply", 13, 13)
    rows = pl.read_csv(file)
    assert rows["quantity"].to_list() == [row["quantity"] for row in said["rows"]]
    k1 = rows.row(by_predicate=pl.col("quantity") == "K1", named=True)
    assert k1["unit"] == "N/m"
    assert k1["difference"] == pytest.approx(109950 - 149980, rel=0.002)
    text = page.read_text()
    assert text.count("<tr>") == 14
    assert "Content-Security-Policy" in text
    assert "<script" not in text
    assert "data:image/svg+xml;base64," in text


def test_equal_results_are_one_line(run, both, tmp_path):
    again = shutil.copytree(both, tmp_path / "again")
    ran = run("compare", both, again)
    assert ran.stdout == "no difference: all 26 values of again are those of two tyres\n"
    assert (ran.exit_code, ran.stderr) == (0, "")


def test_names_from_outside_are_escaped(run, both, tmp_path):
    again = shutil.copytree(both, tmp_path / "again <i>x")
    assert run("compare", both, again, "--page", tmp_path / "c.html").exit_code == 0
    text = (tmp_path / "c.html").read_text()
    assert "<i>" not in text
    assert "no difference seen" in text


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((), "compare takes two results, or one with two specimens: --specimens X Y"),
        (("--specimens", "cross-ply", "bias-ply"), "has no specimen 'bias-ply': choose one of cross-ply, radial-ply"),
        (("--specimens", "cross-ply", "radial-ply", "--out", "rows.txt"), "name it FILE.csv"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(run, both, given, said):
    ran = run("compare", both, *given)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert said in ran.stderr.replace("\n", " ")
