"""A campaign of a laboratory that has one fault: its recordings are written, read, demodulated and analysed."""

from __future__ import annotations

import re
import tempfile
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole.study import Study, analyse
from fourpole.virtual import BELTED, FAULTS, RADIAL_PLY, simulate_campaign
from fourpole.virtual.faults import Fault, scatter

__all__ = ["CELLS", "QUANTITIES", "Cell", "run", "table"]

#: Standard deviation of K* between tests of every laboratory here, relative.
_SCATTER = 0.001
#: Seeds of the laboratories without a fault. The seed of a fault is its place in the list, from 1 on.
_HONEST = range(1001, 1009)
_PLANS: Mapping[str, Mapping[str, Any]] = {"one mass": {"repeats": 3}, "weighed mass": {"added_masses": (0.0, 10.0)}}
_LABORATORY: Mapping[str, Any] = {
    "tyres": BELTED[1:],  # the radial-ply
    "pressures": (170e3,),
    "preloads": (1000.0,),
    "frequencies": (10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0),
    "sensors": (0.005, float(np.deg2rad(0.5))),
    "rig_std": {"moving_mass": 0.3, "preload_stiffness": 250.0, "preload_damping": 5.0},
}
#: Columns of value, its standard uncertainty and its truth.
QUANTITIES = {
    "K'": ("Re K* [N/m]", "u(Re K*) [N/m]", "Re K* [N/m]"),
    "K''": ("Im K* [N/m]", "u(Im K*) [N/m]", "Im K* [N/m]"),
    "K2": ("K2 [N/m]", "u(K2) [N/m]", "K2 [N/m]"),
    "C": ("C [N s/m]", "u(C) [N s/m]", "C [N s/m]"),
    "TR": ("TR predicted [1]", "u(TR) [1]", "TR [1]"),
}
#: Error over u beyond which a row with verdict ok stands out.
_BEYOND = 4.0
_LONGEST = 260
#: Error over u that a number without a u counts as.
_NO_U = 9999.0
_NUMBER = re.compile(r"(?<![A-Za-z\d.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
#: Largest numbers of each sentence, by the sentence without its numbers.
_Usual = Mapping[str, Sequence[float]]


@dataclass(frozen=True)
class Cell:
    """One campaign: a fault (None: as stated), with one mass or with a weighed one."""

    fault: Fault | None
    masses: str
    seed: int

    @property
    def title(self) -> str:
        """The fault in words."""
        return self.fault.title if self.fault else "none"


def _cells() -> list[Cell]:
    honest = [Cell(None, masses, seed) for masses in _PLANS for seed in _HONEST]
    return honest + [
        Cell(fault, masses, seed)
        for seed, fault in enumerate(FAULTS.values(), start=1)
        for masses in _PLANS
        if masses == "weighed mass" or "added_masses" not in fault.plan
    ]


#: All campaigns of docs/faults.md by number.
CELLS = _cells()


def run(number: int) -> dict[str, Any]:
    """Simulate and analyse a campaign: its messages in the order printed, its verdicts, and largest errors over u.

    The virtual rig moves a cubic force only without a mass of the tyre.
    """
    cell = CELLS[number]
    faults = [scatter(_SCATTER), *([cell.fault] if cell.fault else [])]
    laboratory = {**_LABORATORY, "tyres": [RADIAL_PLY]} if cell.title.startswith("cubic") else _LABORATORY
    plan = {**laboratory, **_PLANS[cell.masses], **(cell.fault.plan if cell.fault else {})}
    with tempfile.TemporaryDirectory() as place, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        made = simulate_campaign(Path(place) / "campaign", seed=cell.seed, faults=faults, **plan)
        study = analyse(made.folder, route="joint")
        truth = pl.read_csv(made.folder / "truth.csv", infer_schema_length=None)
    rows = study.dynamic.join(truth, on="test", suffix=" true")
    ok = rows.filter(pl.col("verdict") == "ok")
    return {
        "number": number,
        "title": cell.title,
        "masses": cell.masses,
        "seed": cell.seed,
        "verdicts": dict(Counter(rows["verdict"].to_list())),
        "said": [sentence.replace(str(made.folder), "") for sentence in _said(study)],
        "fits": all(rig.fits for rig in study.rigs),
        "worst": {name: _worst(ok, *columns) for name, columns in QUANTITIES.items()},
    }


def _said(study: Study) -> list[str]:
    """Notes, then the remarks of tests with a warning, then those of rejected tests, as `fourpole analyse` has them."""
    tests = pl.concat([each.select("test", "verdict", "remarks") for each in (study.static, study.dynamic)])
    remarks = [
        remark
        for verdict in ("warning", "rejected")
        for remark in tests.filter(pl.col("verdict") == verdict)["remarks"].to_list()
    ]
    return list(dict.fromkeys([*study.notes, *map(str, remarks)]))


def _worst(rows: pl.DataFrame, found: str, u: str, true: str) -> float | None:
    """Largest error over u; None without a row."""
    true = f"{true} true" if f"{true} true" in rows.columns else true
    values = [rows[name].cast(pl.Float64).fill_null(float("nan")).to_numpy() for name in (found, true, u)]
    with np.errstate(divide="ignore", invalid="ignore"):
        over = np.abs(values[0] - values[1]) / values[2]
    over = np.where(np.isfinite(values[0]) & ~np.isfinite(values[2]), _NO_U, over)
    over = over[np.isfinite(over)]
    return float(f"{over.max():.4g}") if over.size else None


def table(results: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lines of Markdown: the laboratories without a fault, then a table of faults per part of the laboratory."""
    honest = [result for result in results if result["title"] == "none"]
    usual = _usual(sentence for result in honest for sentence in result["said"])
    lines = _without_fault(honest)
    for part in dict.fromkeys(fault.part for fault in FAULTS.values()):
        lines += ["", f"## Faults of the {part}" if part != "tests" else "## Faults of single tests", ""]
        lines += [f"| fault | masses | what is said first | ok, warning, rejected | {' | '.join(QUANTITIES)} |"]
        lines += ["|---" * (4 + len(QUANTITIES)) + "|"]
        lines += [_line(result, usual) for result in results if _part(result) == part]
    return [*lines, "", *_summary(results), ""]


def _part(result: Mapping[str, Any]) -> str | None:
    fault = FAULTS.get(result["title"])
    return fault.part if fault else None


def _without_fault(results: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = ["## Without a fault", ""]
    lines += [f"| masses | campaigns | rigs that do not fit | ok, warning, rejected | {' | '.join(QUANTITIES)} |"]
    lines += ["|---" * (4 + len(QUANTITIES)) + "|"]
    for masses in _PLANS:
        some = [result for result in results if result["masses"] == masses]
        if some:
            verdicts = sum((Counter(result["verdicts"]) for result in some), Counter())
            worst = {name: max(result["worst"][name] or 0.0 for result in some) for name in QUANTITIES}
            misfits = sum(not result["fits"] for result in some)
            lines += [f"| {masses} | {len(some)} | {misfits} | {_counts(verdicts)} | {_errors(worst)} |"]
    return lines


def _line(result: Mapping[str, Any], usual: _Usual) -> str:
    fault = FAULTS[result["title"]]
    unseen = " †" if result["masses"] in fault.unseen else ""
    said = next((sentence for sentence in result["said"] if not _is_usual(sentence, usual)), "nothing")
    cells = (
        fault.title,
        result["masses"] + unseen,
        _short(said),
        _counts(result["verdicts"]),
        _errors(result["worst"]),
    )
    return f"| {' | '.join(cells)} |"


def _counts(verdicts: Mapping[str, int]) -> str:
    return ", ".join(str(verdicts.get(name, 0)) for name in ("ok", "warning", "rejected"))


def _errors(worst: Mapping[str, float | None]) -> str:
    return " | ".join(
        "" if over is None else f"**{over:.1f}**" if over > _BEYOND else f"{over:.1f}" for over in worst.values()
    )


def _usual(sentences: Iterable[str]) -> _Usual:
    """Largest number of each place in sentences that are the same but for their numbers."""
    usual: dict[str, list[float]] = {}
    for sentence in sentences:
        pattern, numbers = _parts(sentence)
        usual[pattern] = [max(pair) for pair in zip(numbers, usual.get(pattern, numbers), strict=True)]
    return usual


def _is_usual(sentence: str, usual: _Usual) -> bool:
    """Whether a sentence is also said without a fault, with numbers no larger than twice those there."""
    pattern, numbers = _parts(sentence)
    return pattern in usual and all(one <= 2.0 * most for one, most in zip(numbers, usual[pattern], strict=True))


def _parts(sentence: str) -> tuple[str, list[float]]:
    """A sentence without its numbers, and the sizes of these."""
    return _NUMBER.sub("#", sentence), [abs(float(number)) for number in _NUMBER.findall(sentence)]


def _short(sentence: str) -> str:
    """The beginning of a sentence, as a cell of a table, without the name of the rig."""
    sentence = " ".join(sentence.removeprefix("[rig]: ").replace("|", "\\|").replace("*", "\\*").split())
    return sentence if len(sentence) <= _LONGEST else sentence[:_LONGEST].rsplit(" ", 1)[0] + " …"


def _summary(results: Sequence[Mapping[str, Any]]) -> list[str]:
    """How many campaigns have wrong rows with verdict ok."""
    faulty = [result for result in results if result["title"] != "none"]
    unseen = [result["masses"] in FAULTS[result["title"]].unseen for result in faulty]
    wrong = [max(over or 0.0 for over in result["worst"].values()) > _BEYOND for result in faulty]
    shown = sum(not hidden for hidden in unseen)
    missed = sum(bad and not hidden for bad, hidden in zip(wrong, unseen, strict=True))
    hidden = sum(bad and hidden for bad, hidden in zip(wrong, unseen, strict=True))
    text = (
        f"{len(faulty)} campaigns with a fault. Of the {shown} whose fault the data can show, {missed} have a row with "
        f"verdict ok that is off by more than {_BEYOND:g} u. Of the {len(faulty) - shown} whose fault no data of the "
        f"rig can show (†), {hidden} have one."
    )
    return ["## All faults together", "", text]
