"""The commands: make campaigns, check them, run a method on them, score what methods answered; each resumes."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import polars as pl

from elastomer_truth.adapters import METHODS, Answer, method
from elastomer_truth.drawing import names
from elastomer_truth.page import OWN, PAGES, page
from elastomer_truth.score import KEY, NUMBERS, read_answers, read_laboratories, read_truth, score
from elastomer_truth.write import checksum, make, write_rows

HERE = Path(__file__).resolve().parents[1]
#: Marks of a page between which the tables stand.
BEGIN, END = "<!-- begin: made by make benchmark -->", "<!-- end: made by make benchmark -->"


def main(arguments: list[str] | None = None) -> int:
    """Run a command."""
    parser = argparse.ArgumentParser(prog="elastomer_truth", description=__doc__)
    parser.add_argument("command", choices=["make", "check", "run", "score"])
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="campaigns, as H001, or the start of several; by default all"
    )
    parser.add_argument("--work", type=Path, default=HERE / "work", help="folder of data, truth and results")
    parser.add_argument("--method", action="append", choices=list(METHODS), help="by default all that are installed")
    parser.add_argument("--clean", action="store_true", help="make: no noise of sensors, and words of any length")
    parser.add_argument(
        "--page", type=Path, action="append", default=[],
        help=f"score: a page that gets the tables of its name between its marks: {', '.join(PAGES)}; may be repeated",
    )  # fmt: skip
    asked = parser.parse_intermixed_args(arguments)
    chosen = [name for name in names() if not asked.names or name.startswith(tuple(asked.names))]
    if not chosen:
        parser.error(f"{' '.join(asked.names)}: no name of a campaign starts so; names are H001 to F060")
    return {"make": _make, "check": _check, "run": _run, "score": _score}[asked.command](asked, chosen)


def _make(asked: argparse.Namespace, chosen: list[str]) -> int:
    for name in chosen:
        if not (asked.work / "truth" / name / "laboratory.json").exists():
            _say(f"making {name}")
            make(name, asked.work / "data", asked.work / "truth", clean=asked.clean)
    return 0


def _check(asked: argparse.Namespace, chosen: list[str]) -> int:
    """Compare with the checksums that the repository keeps; for names that it does not have they are printed."""
    kept = dict(line.split() for line in (HERE / "checksums.txt").read_text(encoding="utf-8").splitlines())
    other = []
    for name in chosen:
        folder = asked.work / "data" / name
        if not folder.exists():
            continue
        if name not in kept:
            print(name, checksum(folder))
        elif kept[name] != checksum(folder):
            other.append(name)
    if other:
        _say(f"{', '.join(other)}: not as when the checksums were made; other machines round the last bits differently")
    return int(bool(other))


def _run(asked: argparse.Namespace, chosen: list[str]) -> int:
    for name in asked.method or METHODS:
        try:
            answer = method(name)
        except ImportError as error:
            extra = name.split()[0]
            _say(f"{name}: skipped, its package is missing ({error}); pip install 'elastomer-truth[{extra}]'")
            continue
        parts = asked.work / "results" / name.replace(" ", "-") / "parts"
        parts.mkdir(parents=True, exist_ok=True)
        for campaign in chosen:
            data, part = asked.work / "data" / campaign, parts / f"{campaign}.json"
            if part.exists() or not data.exists():
                continue
            _say(f"{name}: {campaign}")
            part.write_text(json.dumps(answer_apart(answer, data)), encoding="utf-8")
        _gather(parts.parent)
    return 0


def answer_apart(answer: Callable[[Path], Answer], data: Path) -> dict[str, object]:
    """What a method answers in a folder that has the campaign alone, without truth; an error is noted."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / data.name
        shutil.copytree(data, folder)
        try:
            values, causes = answer(folder)
        except Exception as error:  # noqa: BLE001 - a method that fails has no values for this campaign
            _say(f"  failed: {type(error).__name__}: {error}")
            return {"values": [], "causes": [], "error": f"{type(error).__name__}: {error}"}
    return {"values": values, "causes": causes}


def _gather(folder: Path) -> None:
    """values.csv and causes.csv of all parts."""
    values, causes = [], []
    for part in sorted((folder / "parts").glob("*.json")):
        found = json.loads(part.read_text(encoding="utf-8"))
        values += [
            (part.stem, *(_text(row.get(head)) for head in (*KEY[1:], *NUMBERS, "verdict"))) for row in found["values"]
        ]
        causes += [
            (part.stem, *(row.get(head, "") for head in ("rank", "cause", "channel or part", "said")))
            for row in found["causes"]
        ]
    write_rows(folder / "values.csv", (*KEY, *NUMBERS, "verdict"), values)
    write_rows(folder / "causes.csv", ("campaign", "rank", "cause", "channel or part", "said"), causes)


def _text(value: object) -> object:
    return "" if value is None or value != value else value


def _score(asked: argparse.Namespace, chosen: list[str]) -> int:
    """Score all results that are there; score.csv and score.md are written beside them, and tables into pages."""
    truth = read_truth(asked.work / "truth", chosen)
    results = asked.work / "results"
    methods = {name.replace(" ", "-"): name for name in asked.method or METHODS}
    others = sorted({path.name for path in results.iterdir() if path.is_dir()} - methods.keys())
    found = {}
    for folder in [*methods, *(others if asked.method is None else ())]:
        if (results / folder / "parts").is_dir():  # of a run that was stopped, too
            _gather(results / folder)
        if (results / folder).is_dir():
            values, causes = read_answers(results / folder)
            # A method is scored on the campaigns that it was run on.
            run = set(values["campaign"]) | {path.stem for path in (results / folder / "parts").glob("*.json")}
            own = [table.filter(pl.col("campaign").is_in(run)) for table in truth]
            if own[0].height:
                found[methods.get(folder, folder)] = score((own[0], own[1]), (values, causes))
    if not found or (asked.page and OWN not in found):
        raise SystemExit(f"{results}: no results of {OWN if asked.page else 'any method'}; run it first")
    pl.concat(
        [one.table.insert_column(0, pl.lit(name).alias("method")) for name, one in found.items()],
        how="vertical_relaxed",
    ).write_csv(results / "score.csv")
    (results / "score.md").write_text(page(found), encoding="utf-8")
    laboratories = read_laboratories(asked.work / "truth", truth[0]["campaign"].unique())
    for path in asked.page:
        if path.stem not in PAGES:
            raise SystemExit(f"{path}: no tables for a page of this name; pages are {', '.join(PAGES)}")
        _between_marks(path, PAGES[path.stem](found, laboratories))
    print(page(found))
    return 0


def _between_marks(path: Path, text: str) -> None:
    before, begin, rest = path.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise SystemExit(f"{path}: the marks {BEGIN} and {END} are missing; put them where the tables belong")
    path.write_text(f"{before}{BEGIN}\n\n{text}\n{END}{after}", encoding="utf-8")


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
