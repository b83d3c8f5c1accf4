"""Edits of a sound campaign through the commands: each must end with results or one clear message, soon.

    python fuzz/fuzz_edits.py [--minutes 2] [--first N] [--only statement] [--state FILE]

A command is at fault if it blames Fourpole itself, prints a traceback or a warning of Python, has an exit code other
than 0, 2 and 3, or takes more than a second per MB beyond a fixed time. Every edit follows from its number alone; those
at fault are listed beside the state file, in `broken.txt`, with the edits and what was said.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType

os.environ["FOURPOLE_DEBUG"] = "1"
os.environ["NO_COLOR"] = "1"

from typer.testing import CliRunner

from fourpole.app.cli import app
from fourpole.virtual import RADIAL_PLY, simulate_campaign

#: Processor time of a command [s] beyond that for the sound campaign; memory of the process [byte].
TIME_LIMIT, MEMORY_LIMIT = 20, 6_000_000_000
NUMBERS = [
    "1e300",
    "-1e300",
    "1e308",
    "1e-300",
    "1e-320",
    "5e-324",
    "1e20",
    "-1e20",
    "1e999",
    "nan",
    "inf",
    "-inf",
    "0",
    "-0.0",
]
NUMBERS += [
    "1" * 5000,
    "-1",
    "1.7976931348623157e308",
    "9" * 19,
    str(2**63),
    str(2**64),
    "0x10",
    "1_0",
    "1e150",
    "1e-150",
]
NUMBERS += ["1e16", "1e12", "1e-12", "1e7", "0.1e1", "1,5", "1.5.5", "--1"]
UNITS = [
    "N",
    "kN",
    "m/s",
    "bar",
    "Pa",
    "Hz",
    "MHz",
    "%",
    "ppm",
    "m",
    "Ym",
    "ym",
    "N/m",
    "kg",
    "s",
    "degC",
    "V",
    "",
    "x" * 300,
    "m^4",
]
TEXTS = [
    "",
    "x",
    "radial",
    "D1",
    "S1",
    "é",
    "字",
    "\x00",
    "\x1b[31m",
    "a" * 200_000,
    '"',
    "'",
    ",",
    ";",
    "\n",
    "\r",
    "../x",
    "ok",
    "true",
]
TEXTS += [
    "warning",
    "rejected",
    "joint",
    "mobility",
    "[]",
    "{}",
    "static",
    "dynamic",
    "calibration",
    "random",
    "sweep",
    "5:200 Hz",
    "2..12",
]
TEXTS += ["-5..5", "1e300..2e300", "\ud7ff", "=1+1", "null", "None", "NA", "-", " ", "2024-02-30", "\u202e", "a" * 3000]
COLUMNS = [
    "K1 [N/m]",
    "u(K1) [N/m]",
    "added_mass [kg]",
    "u(added_mass) [kg]",
    "temperature [degC]",
    "window [s]",
    "excluded",
    "rig",
    "repeat",
]
COLUMNS += ["time", "segment", "batch", "amplitude [mm]", "x" * 150_000]
KEYS = [
    "sample_rate",
    "std_gain",
    "std_phase",
    "std_delay",
    "gain",
    "offset",
    "delay",
    "range",
    "sensitivity",
    "invert",
    "exact",
    "high_pass",
]
KEYS += [
    "low_pass",
    "crosstalk",
    "unit",
    "column",
    "value",
    "std",
    "input_mass",
    "tyre_mass",
    "preload_loss_factor",
    "frame_stiffness",
]
RIG = ["input_mass", "tyre_mass", "preload_loss_factor", "frame_stiffness", "mounting_stiffness"]
SETTINGS = ["--tables-only", "--no-models", "--monte-carlo", "200"]
READING = [
    ("report", "{}"),
    ("report", "{}", "--standard", "iso-10846-2"),
    ("report", "{}", "--standard", "iso-7626-2"),
    ("report", "{}", "--standard", "sae-j1085"),
    ("compare", "{}", "{base}"),
    ("compare", "{base}", "{}"),
    ("plot", "{}", "K2", "--over", "frequency", "--out", "{new}/a.png"),
    ("rig", "{}"),
    ("causality", "{}"),
    ("fit", "{}"),
    ("map", "{}"),
    ("verify", "{}"),
    ("lab", "{}", "--out", "{new}/lab"),
    ("query", "{}", "--frequency", "15 Hz"),
    ("ride", "{}", "--road", "C", "--speed", "80 km/h"),
]
EXPORTS = [
    "xlsx",
    "mat",
    "uff",
    "netcdf",
    "abaqus",
    "ansys",
    "lsdyna",
    "lsdyna-springs",
    "prony",
    "fmu",
    "fmu3",
    "table",
]
EXPORTS += ["statespace", "statespace-mat", "modelica"]
READING += [("export", "{}", "--to", kind, "--out", "{new}/export") for kind in EXPORTS]
READING += [("export", "{}", "--to", "tydex", "--out", "{new}/tydex")]
READING += [("export", "{}", "--to", "tir", "--out", "{new}/a.tir", "--frequency", "15 Hz")]


class Overdue(BaseException):
    """A command took longer than it may."""


def _overdue(_number: int, _frame: FrameType | None) -> None:
    raise Overdue


def value_of(chance: random.Random) -> str:
    """What is written in place of a cell or value."""
    kind = chance.randrange(5)
    if kind == 0:
        return chance.choice(TEXTS)
    number = chance.choice(NUMBERS)
    return f"{number} {chance.choice(UNITS)}" if kind == 1 else number


def edit_cells(path: Path, chance: random.Random, columns: list[str]) -> str:
    """A change of a table of cells: a cell, a column, a row, or the name of a column."""
    rows = list(csv.reader(path.read_text().splitlines()))
    row, column = chance.randrange(len(rows)), chance.randrange(len(rows[0]))
    value, kind = value_of(chance), chance.randrange(10)
    told = f"{path.name} row {row + 1} column {rows[0][column]!r}"
    if kind < 5 and row:
        rows[row][column] = value
    elif kind == 5:
        for one in rows[1:]:
            one[column] = value
    elif kind == 6:
        told = f"{told}: row twice"
        rows.append(list(rows[row]))
    elif kind == 7:
        told = f"{told}: no column"
        rows = [one[:column] + one[column + 1 :] for one in rows]
    elif kind == 8 and columns:
        value = chance.choice([value_of(chance), value_of(chance), "1000"])
        name = chance.choice(columns)
        told = f"{path.name} new column {name[:40]!r}"
        rows = [[*one, value if at else name] for at, one in enumerate(rows)]
    else:
        rows = rows[:1] if kind == 9 and chance.random() < 0.3 else rows[: row + 1] or rows
        told = f"{told}: cut"
    with path.open("w", newline="", encoding="utf-8", errors="surrogatepass") as file:
        csv.writer(file).writerows(rows)
    return f"{told} = {value[:60]!r} ({len(value)})"


def edit_toml(path: Path, chance: random.Random) -> str:
    """A change of campaign.toml: a number, a text, a key, or a line."""
    text = path.read_text()
    kind = chance.randrange(6)
    value = value_of(chance)
    if kind < 3:
        found = list(re.finditer(r'(?<=[ "=])-?[0-9][0-9.e+-]*|"[^"\n]*"', text))
        one = chance.choice(found)
        quoted = one[0].startswith('"')
        new = json.dumps(value) if quoted or chance.random() < 0.2 else chance.choice(NUMBERS)
        if quoted and re.match(r'"[0-9.]+ ', one[0]) and chance.random() < 0.7:
            new = json.dumps(f"{chance.choice(NUMBERS)} {one[0][1:-1].partition(' ')[2]}")
        text = text[: one.start()] + new + text[one.end() :]
        told = f"{one[0]} -> {new[:60]} ({len(new)})"
    elif kind == 3:
        lines = text.split("\n")
        at = chance.choice([at for at, line in enumerate(lines) if line.endswith("}")])
        key, new = (
            chance.choice(KEYS),
            chance.choice([json.dumps(value), chance.choice(NUMBERS), "true", "[1]", "{a=1}"]),
        )
        lines[at] = f"{lines[at][:-1]}, {key} = {new} }}"
        text, told = "\n".join(lines), f"{lines[at].split()[0]} {key} = {new[:60]}"
    elif kind == 4:
        name, new = chance.choice(RIG), f'"{chance.choice(NUMBERS)} {chance.choice(["kg", "N/m", "N s/m", "%", "1"])}"'
        text, told = text.replace("[rig]\n", f"[rig]\n{name} = {new}\n"), f"[rig] {name} = {new[:60]}"
    else:
        new = f'sample_rate = "{chance.choice(NUMBERS)} {chance.choice(["Hz", "kHz", "rpm"])}"'
        text, told = re.sub(r"time +=.*", new, text), new[:60]
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    return f"campaign.toml {told}"


def edit_samples(folder: Path, chance: random.Random) -> str:
    """A change of the samples of a recording: one, some, a column, or times."""
    path = chance.choice(sorted((folder / "recordings").iterdir()))
    lines = path.read_text().splitlines()
    column = chance.randrange(lines[0].count(",") + 1)
    first = chance.randrange(1, len(lines))
    last = chance.choice([first + 1, first + 50, len(lines)])
    value, factor = chance.choice([*NUMBERS, "x", ""]), chance.choice([None, None, 1e20, 1e-20, 1e150, 1e300, 0.0])
    for at in range(chance.choice([first, 1]), min(last, len(lines))):
        cells = lines[at].split(",")
        if column < len(cells):
            cells[column] = value if factor is None else repr(float(cells[column]) * factor)
            lines[at] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    return f"{path.name} column {column + 1} lines {first}..{last} = {value[:40] if factor is None else f'x {factor}'}"


def edit_results(folder: Path, chance: random.Random) -> str:
    """A change of a table of results, of study.json, or of a model file."""
    results = folder / "results"
    names = [
        "dynamic",
        "dynamic",
        "dynamic",
        "static",
        "static",
        "checks",
        "rig",
        "budget",
        "residuals",
        "findings",
        "corrections",
    ]
    path = results / f"{chance.choice(names)}.csv"
    return edit_cells(path, chance, [])


def edit_document(folder: Path, chance: random.Random) -> str:
    """A change of a value of study.json or model.json."""
    path = folder / "results" / chance.choice(["study.json", "model.json", "model.json"])
    document = json.loads(path.read_text())
    places: list[tuple[object, object]] = []

    def walk(value: object) -> None:
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):  # type: ignore[arg-type]
            places.append((value, key))
            if isinstance(inner, dict | list):
                walk(inner)

    walk(document)
    holder, key = chance.choice(places)
    kinds = [None, "x", 1e300, -1, 0, 1e-300, 1e20, [], {}, [1], True, "", "1e300", 2**62]
    value = chance.choice(kinds)
    if chance.random() < 0.2:
        del holder[key]  # type: ignore[attr-defined]
    else:
        holder[key] = value  # type: ignore[index]
    path.write_text(json.dumps(document))
    return f"{path.name} {key} = {value!r}"


def statement(folder: Path, chance: random.Random) -> str:
    """A change of campaign.toml or tests.csv."""
    return (
        edit_toml(folder / "campaign.toml", chance)
        if chance.random() < 0.5
        else edit_cells(folder / "tests.csv", chance, COLUMNS)
    )


EDITS: dict[str, Callable[[Path, random.Random], str]] = {
    "statement": statement,
    "samples": edit_samples,
    "results": edit_results,
    "models": edit_document,
}


def said(arguments: tuple[str, ...]) -> tuple[str, float, str]:
    """The fault of a command, empty if it has none; its processor time [s]; and what it said."""
    begun = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, 3 * TIME_LIMIT)
    try:
        result = CliRunner().invoke(app, list(arguments))
    except Overdue:
        return "overdue", time.process_time() - begun, ""
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    taken, text = time.process_time() - begun, result.output
    if isinstance(result.exception, Overdue):
        return "overdue", taken, text
    if "a fault in Fourpole itself" in text or "Traceback" in text or re.search("[a-z]Warning:", text):
        return "fault", taken, text
    if result.exit_code not in (0, 2, 3):
        return f"exit code {result.exit_code}", taken, f"{text}{result.exception!r}"
    if result.exit_code == 2 and "error:" not in text and arguments[0] not in ("check", "verify"):
        return "no message", taken, text
    if max(map(len, text.split("\n"))) > 4000:
        return "long line", taken, text[:500]
    return "", taken, text


def made(folder: Path) -> Path:
    """The sound campaign, analysed, with models; its results have no list that refuses edited tables."""
    runs = {"tyres": [RADIAL_PLY], "pressures": [170e3], "preloads": [1000.0], "frequencies": [10.0, 14.0, 18.0, 24.0]}
    simulate_campaign(folder, **runs)  # type: ignore[arg-type]
    for arguments in (("analyse", str(folder), "--no-models"), ("fit", str(folder))):
        fault, _, text = said(arguments)
        if fault:
            raise RuntimeError(text)
    shutil.rmtree(folder / "results" / ".store", ignore_errors=True)
    shutil.rmtree(folder / "results" / "cache", ignore_errors=True)
    path = folder / "results" / "study.json"
    record = json.loads(path.read_text())
    for key in ("results", "sizes", "seal"):
        record.pop(key, None)
    path.write_text(json.dumps(record))
    return folder


def commands(kind: str, chance: random.Random) -> list[tuple[str, ...]]:
    """The commands that an edited campaign goes through."""
    if kind in ("statement", "samples"):
        return [
            ("check", "{}"),
            ("analyse", "{}", *SETTINGS, "--route", chance.choice(["joint", "joint", "mobility", "relative"])),
        ]
    return chance.sample(READING, 5)


def main() -> int:
    parser = argparse.ArgumentParser(description="Edits of a sound campaign through the commands.")
    parser.add_argument("--minutes", type=float, default=2.0)
    parser.add_argument("--first", type=int, default=0, help="number of the first edit of a new state file")
    parser.add_argument("--only", choices=sorted(EDITS), action="append")
    parser.add_argument("--state", type=Path, default=Path("fuzz-state/edits.json"))
    asked = parser.parse_args()
    import fourpole.study.workers as workers

    workers._MOST = 1  # noqa: SLF001 - one process, whose time is measured
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    signal.signal(signal.SIGPROF, _overdue)
    asked.state.parent.mkdir(parents=True, exist_ok=True)
    state = json.loads(asked.state.read_text()) if asked.state.exists() else {}
    until = time.monotonic() + 60 * asked.minutes
    counts: Counter[str] = Counter()
    slowest = 0.0
    with tempfile.TemporaryDirectory() as place:
        base = made(Path(place, "base"))
        while time.monotonic() < until:
            for kind in asked.only or sorted(EDITS):
                number = state[kind] = state.get(kind, asked.first - 1) + 1
                chance = random.Random(f"{kind} {number}")
                folder, new = Path(place, "edited"), Path(place, "new")
                new.mkdir()
                shutil.copytree(base, folder)
                try:
                    edits = [EDITS[kind](folder, chance) for _ in range(chance.choice((1, 1, 1, 2, 3)))]
                except (csv.Error, IndexError, ValueError):  # an edit of what an edit has spoilt
                    edits = []
                size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6
                for command in commands(kind, chance) if edits else ():
                    arguments = tuple(one.format(folder, base=base, new=new) for one in command)
                    fault, taken, text = said(arguments)
                    fault = fault or ("slow" if taken > TIME_LIMIT + size else "")
                    slowest = max(slowest, taken)
                    counts[f"{kind} {command[0]}: {fault or 'answered'}"] += 1
                    if fault:
                        told = f"{kind} {number} {' '.join(command)}: {fault} ({taken:.1f} s)\n  " + "\n  ".join(edits)
                        with (asked.state.parent / "broken.txt").open("a") as file:
                            file.write(f"{told}\n{text[-3000:]}\n\n")
                        print(told, flush=True)
                shutil.rmtree(folder)
                shutil.rmtree(new)
            asked.state.write_text(json.dumps(state))
    for what, count in sorted(counts.items()):
        print(f"{what:40} {count}")
    print(f"slowest command: {slowest:.1f} s; edits so far: {state}")
    return 1 if any(not what.endswith("answered") for what in counts) else 0


if __name__ == "__main__":
    sys.exit(main())
