"""The scorer, on a hand-made perfect table and a hand-made wrong one."""

import json

import polars as pl
import pytest

from elastomer_truth import __main__ as command
from elastomer_truth.drawing import names, tier_of
from elastomer_truth.faults import sized
from elastomer_truth.page import PAGES, failures, page
from elastomer_truth.score import read_answers, read_truth, score

pytestmark = pytest.mark.thorough

QUANTITIES = {"K'": 200e3, "K''": 20e3, "TR": 1.5}


@pytest.fixture
def truth(tmp_path):
    """Two honest campaigns and two faulty ones, one sine each; the phasors of F002 do not show its fault."""
    causes = {
        "F001": ("gain of V1", "gain", "V1", "gain V1 | fixture V1"),
        "F002": ("gain of F1", "gain", "F1", "none"),
    }
    for name in ("H001", "H002", "F001", "F002"):
        folder = tmp_path / "truth" / name
        folder.mkdir(parents=True)
        rows = [f"{name},D1,12.07,{quantity},{value}" for quantity, value in QUANTITIES.items()]
        (folder / "values.csv").write_text("\n".join(["campaign,test,frequency [Hz],quantity,truth", *rows]))
        fault = ",".join([name, *causes[name][:3], "0.06", causes[name][3]]) if name in causes else ""
        (folder / "causes.csv").write_text(f"campaign,fault,cause,channel or part,size,alike\n{fault}\n")
        laboratory = {"rig": "paper", "specimens": {"A": {"kind": "belt"}}, "tests": [{"kind": "sine"}]}
        (folder / "laboratory.json").write_text(json.dumps(laboratory))
    return read_truth(tmp_path / "truth")


def answers(tmp_path, change=lambda row: row, causes=()):
    """Values with an uncertainty of 1 % in all campaigns, and the causes."""
    rows = []
    for name in ("H001", "H002", "F001", "F002"):
        for quantity, value in QUANTITIES.items():
            row = {"campaign": name, "test": "D1", "frequency [Hz]": 12.1, "quantity": quantity, "value": value,
                   "lower": 0.98 * value, "upper": 1.02 * value, "u": 0.01 * value, "verdict": "ok"}  # fmt: skip
            rows.append(change(row))
    pl.DataFrame(rows, infer_schema_length=None).write_csv(tmp_path / "values.csv")
    named = [f"{campaign},{rank},{cause},{part}" for campaign, rank, cause, part in causes]
    (tmp_path / "causes.csv").write_text("\n".join(["campaign,rank,cause,channel or part", *named]))
    return read_answers(tmp_path)


def whole(found, tier):
    return found.table.row(by_predicate=(pl.col("tier") == tier) & (pl.col("quantity") == "all"), named=True)


def test_a_perfect_table_has_the_best_score(truth, tmp_path):
    found = score(truth, answers(tmp_path, causes=[("F001", 1, "gain", "V1")]))
    row = whole(found, "honest")
    assert (row["answered"], row["coverage"], row["median error"], row["rms z"]) == (1.0, 1.0, 0.0, 0.0)
    assert (row["confident wrong values"], row["campaigns with one"], row["flagged"]) == (0.0, 0, 0.0)
    # The mean of the widths: 4 % of |K*| for K', a tenth of it for K'', and 4 % of TR.
    size = (200e3**2 + 20e3**2) ** 0.5
    assert row["interval score"] == pytest.approx((0.04 * 200e3 / size + 0.04 * 20e3 / size + 0.04) / 3)
    faulty = whole(found, "faulty")
    # The first is right; the second says nothing where nothing can be seen.
    assert [faulty[f"causes {word}"] for word in ("right", "fair", "wrong", "none")] == [1, 1, 0, 0]
    assert found.wrong.height == 0
    assert f"2 of {sum(tier_of(name) == 'honest' for name in names())}" in page({"perfect": found})


def test_a_wrong_table_has_its_errors_counted(truth, tmp_path):
    def change(row):
        if row["quantity"] == "K'":
            row |= {key: 1.1 * row[key] for key in ("value", "lower", "upper")}
        if row["quantity"] == "TR":
            row |= {"verdict": "rejected"} if row["campaign"] == "H001" else {"verdict": "warning", "value": 3.0}
        return row

    causes = [("F001", 1, "delay", "V1"), ("F001", 2, "fixture", "V1"), ("F002", 1, "delay", "V1")]
    found = score(truth, answers(tmp_path, change, causes))
    row = whole(found, "honest")
    assert row["answered"] == pytest.approx(5 / 6)
    # K' is 10 u off and not flagged; TR is far off in one campaign, and flagged.
    assert row["confident wrong values"] == pytest.approx(2 / 6)
    assert row["campaigns with one"] == 2
    assert row["flagged"] == pytest.approx(2 / 6)
    assert row["coverage"] == pytest.approx(3 / 5)
    by_hand = found.table.row(by_predicate=(pl.col("tier") == "honest") & (pl.col("quantity") == "K'"), named=True)
    size = (200e3**2 + 20e3**2) ** 0.5
    low, high, true = 1.1 * 0.98 * 200e3, 1.1 * 1.02 * 200e3, 200e3
    assert by_hand["interval score"] == pytest.approx(((high - low) + 40 * (low - true)) / size)
    blank = found.table.row(by_predicate=(pl.col("tier") == "honest") & (pl.col("quantity") == "TR"), named=True)
    # H001 scores as 0.1 to 10, H002 as its interval of 4 %; the median of two is their mean.
    assert blank["interval score"] == pytest.approx((9.9 + 0.04) / 2)
    judged = dict(found.causes.select("campaign", "judgement").rows())
    assert judged == {"H001": "none", "H002": "none", "F001": "fair", "F002": "wrong"}
    assert "| gain of F1 † | faulty | F002 | K' | 1 | +10.0 | D1 | 12.07 |" in failures(found)


def test_blanks_and_values_without_uncertainty_are_scored_on_error(truth, tmp_path):
    def change(row):
        return {**row, "lower": None, "upper": None, "u": None, "value": 1.02 * row["value"]}

    row = whole(score(truth, answers(tmp_path, change)), "honest")
    assert row["coverage"] is None
    assert row["confident wrong values"] is None
    # 2 % of K' over |K*|, 2 % of K'', 2 % of TR.
    assert row["median error"] == pytest.approx(0.0199, abs=1e-4)


@pytest.fixture
def pages(truth, tmp_path):
    """Three pages, and answers of Fourpole in which TR of F001 is 5 u off and a cause of H002 is named."""

    def change(row):
        return row | {"value": 1.05 * row["value"]} if (row["campaign"], row["quantity"]) == ("F001", "TR") else row

    own = tmp_path / "results" / "fourpole-joint"
    own.mkdir(parents=True)
    answers(own, change, [("F001", 1, "delay", "V1"), ("F001", 2, "gain", "V1"), ("H002", 1, "drift", "specimen")])
    said = (own / "causes.csv").read_text().replace("\n", ",\n").replace("part,\n", "part,said\n", 1)
    (own / "causes.csv").write_text(f"{said},\nF001,0,,,a gain of V1 of 1.06 moves |K*|\n")
    for name in PAGES:
        (tmp_path / f"{name}.md").write_text(f"before\n{command.BEGIN}\nold\n{command.END}\nafter\n")
    return tmp_path


def test_three_pages_have_their_tables(pages, capsys):
    options = [part for name in PAGES for part in ("--page", str(pages / f"{name}.md"))]
    assert command.main(["score", "--work", str(pages), *options]) == 0
    assert "| fourpole joint | faulty | 2 of 60 |" in capsys.readouterr().out
    texts = {name: (pages / f"{name}.md").read_text() for name in PAGES}
    for text in texts.values():
        assert text.startswith("before\n")
        assert text.endswith("\nafter\n")
        assert "old" not in text.split()
    assert "| gain of V1 | faulty | F001 | TR | 1 | +5.0 | D1 | 12.07 |" in texts["benchmark"]
    assert (
        "| honest | 2 of 80 | all but coverage, rms z |" in texts["validation"]
    )  # with errors of nothing, the intervals are too wide
    assert "| faulty | paper | 2 |" in texts["validation"]
    assert "| honest | 2 | 1 | 0 |" in texts["faults"]
    other, row = [line for line in texts["faults"].splitlines() if "paper; belt; 1 sine" in line]
    said = "a gain of V1 of 1.06 moves \\|K\\*\\| | delay V1, gain V1 | fair | 3 of 3 | 1 | 5.0"
    assert row == f"| gain of V1, +6 % | {said} |  | F001 | paper; belt; 1 sine |"
    assert other == "| gain of F1, +6 % † | nothing |  | fair | 3 of 3 | 0 | 0.0 |  | F002 | paper; belt; 1 sine |"


def test_a_page_without_tables_is_refused(pages):
    (pages / "faults.md").write_text("no marks")
    (pages / "other.md").write_text("")
    for name, said in (("faults", "the marks"), ("other", "no tables for a page of this name")):
        with pytest.raises(SystemExit, match=said):
            command.main(["score", "--work", str(pages), "--page", str(pages / f"{name}.md")])
    with pytest.raises(SystemExit, match="no results of fourpole joint"):
        command.main(["score", "--work", str(pages), "--method", "paper", "--page", str(pages / "benchmark.md")])


def test_sizes_of_faults_have_their_unit():
    assert sized("gain of F1", -0.08) == "-8 %"
    assert sized("V1 late", 5e-4) == "0.5 ms"
    assert sized("F1 in kgf", -0.9) == ""


def test_a_table_without_a_column_is_refused(tmp_path):
    (tmp_path / "values.csv").write_text("campaign,test\nH001,D1\n")
    with pytest.raises(ValueError, match=r"the columns frequency \[Hz\], quantity"):
        read_answers(tmp_path)
