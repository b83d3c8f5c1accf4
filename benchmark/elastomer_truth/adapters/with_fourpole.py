"""Fourpole by its public command line: the plain statement becomes campaign.toml and tests.csv, tables become rows."""

from __future__ import annotations

import csv
import json
import math
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from elastomer_truth.adapters import Answer
from elastomer_truth.adapters.fourpole_bodies import combined, number, transfer
from elastomer_truth.adapters.fourpole_causes import causes
from elastomer_truth.adapters.fourpole_lines import lines_around, weights_of
from elastomer_truth.adapters.fourpole_statement import campaign_toml, tests_csv
from elastomer_truth.statement import Campaign, read

Table = list[dict[str, str]]
#: A value and its standard uncertainty in dynamic.csv, by quantity.
_COLUMNS = {
    "K'": ("Re K* [N/m]", "u(Re K*) [N/m]", "verdict K*"),
    "K''": ("Im K* [N/m]", "u(Im K*) [N/m]", "verdict K*"),
    "TR": ("TR predicted [1]", "u(TR) [1]", "verdict TR"),
}


def answer(folder: Path, route: str) -> Answer:
    """Rows of dynamic.csv and static.csv; k21 from K* and specimens.csv; causes from study.json."""
    campaign = read(folder)
    made = folder / "fourpole"
    shutil.copytree(folder / "recordings", made / "recordings")
    (made / "campaign.toml").write_text(campaign_toml(campaign), encoding="utf-8")
    (made / "tests.csv").write_text(tests_csv(campaign), encoding="utf-8")
    command = [sys.executable, "-m", "fourpole", "analyse", str(made), "--route", route, "--tables-only",
               "--no-models", "--monte-carlo", "0", "--workers", "1"]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 3):
        raise RuntimeError(f"fourpole analyse ended with {done.returncode}: {done.stderr[-600:]}")
    results = made / "results"
    preloads = {test["test"]: float(test["preload [N]"]) for test in campaign.tests}
    static = [row for row in _read(results / "static.csv") if row["preload [N]"]]
    rows = [_static(row) for row in static if abs(number(row["preload [N]"]) - preloads[row["test"]]) < 1]
    by_test: dict[str, Table] = {}
    for row in _read(results / "dynamic.csv"):
        by_test.setdefault(row["test"], []).append(row)
    bodies = _read(results / "specimens.csv") if (results / "specimens.csv").exists() else []
    for test, lines in by_test.items():
        for frequency in campaign.frequencies(test):
            rows += _line(campaign, lines, bodies, test, frequency)
    study = json.loads((results / "study.json").read_text(encoding="utf-8"))
    return rows, causes(study, _read(results / "checks.csv"), campaign.stated["specimens"].values())


def _read(path: Path) -> Table:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _row(test: str, frequency: float, quantity: str, value: float, u: float, verdict: str) -> dict[str, Any]:
    return {"test": test, "frequency [Hz]": frequency, "quantity": quantity, "value": value, "u": u,
            "lower": value - 1.96 * u, "upper": value + 1.96 * u, "verdict": verdict or "rejected"}  # fmt: skip


def _static(row: dict[str, str]) -> dict[str, Any]:
    value, u = number(row["K1 [N/m]"]), number(row["u(K1) [N/m]"])
    return _row(row["test"], 0.0, "K1", value, u, row["verdict"])


def _line(campaign: Campaign, lines: Table, bodies: Table, test: str, frequency: float) -> list[dict[str, Any]]:
    """The rows of one frequency, by interpolation between the lines around it; the worst verdict counts."""
    used = sorted((line for line in lines if line["frequency [Hz]"]),
                  key=lambda line: abs(float(line["frequency [Hz]"]) - frequency))  # fmt: skip
    if not used:
        return []
    near = lines_around(used, frequency)
    places, found = [float(line["frequency [Hz]"]) for line in near], []
    rank = ["ok", "warning", "rejected"]
    for name, (head, u, verdict) in _COLUMNS.items():
        words = [line.get(verdict) or line["verdict"] for line in near]
        worst = max(words, key=lambda word: rank.index(word) if word in rank else 2)
        # 1/TR^2 is nearly a parabola of f^2, K* one of log f.
        power = -2 if name == "TR" and len(near) > 1 else 1
        weights = weights_of(places, frequency, (lambda f: f * f) if power < 0 else math.log)
        size = sum(w * number(line[head]) ** power for w, line in zip(weights, near, strict=True))
        size = abs(size) ** (1 / power) if power < 0 else size
        stds = [number(line[u]) if power == 1 else size * number(line[u]) / number(line[head]) for line in near]
        if not (name == "TR" and campaign.blocked):
            found.append(_row(test, frequency, name, size, max(map(abs, stds)), worst))
    whole = complex(found[0]["value"], found[1]["value"])
    factor, u_factor = transfer(whole, near[0], bodies, frequency, campaign.stated["specimens"][near[0]["tyre"]])
    k21 = whole * factor
    for name, value, own, other in (("k21'", k21.real, 0, 1), ("k21''", k21.imag, 1, 0)):
        parts = factor.real * found[own]["u"], factor.imag * found[other]["u"]
        u = combined(math.hypot(*parts), abs(whole) * u_factor, together=campaign.blocked)
        found.append(_row(test, frequency, name, value, u, found[0]["verdict"]))
    # K* with the inertia of the specimen in it is said to be no K* of springs.
    return found if near[0]["K* of"] == "springs" else [row for row in found if row["quantity"] not in ("K'", "K''")]
