"""The run sheet: the tests of a plan in the order in which they are best run, as a tests.csv with instructions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import Any, TypeVar

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.campaign.row import Test, condition_of
from fourpole.core.condition import Sameness
from fourpole.planning.plan import CampaignPlan

_T = TypeVar("_T")

#: Head of the column of instructions.
INSTRUCTION = "instruction"
#: Standard gravity [m/s²], for the weight of an added mass.
_GRAVITY = 9.80665
#: Number of load cycles before the recorded ones of a static test.
_CONDITIONING = 5
#: Duration of the warm-up of a tyre [min].
_WARM_UP = 10
#: Columns that are written only where a test states them.
_OPTIONAL = ("u(added_mass) [kg]", q.K1.head, q.K1.u_head, q.TEMPERATURE.head, "rig", q.WINDOW.head)
#: Axes of a condition that are changed as rarely as possible, the slowest first.
_SLOW = ("temperature", "pressure")


@dataclass(frozen=True)
class _Row:
    """A row of the run sheet: a test, the number of its repeat, and the steps before it."""

    test: Test
    repeat: int | None = None
    steps: list[str] = field(default_factory=list)


def run_sheet(
    planned: CampaignPlan, *, masses: Sequence[float] = (), repeats: int = 1, seed: int = 1982
) -> pl.DataFrame:
    """All tests of a plan in the order in which they are to be run.

    Each tyre is conditioned and measured statically, then warmed up. Its dynamic tests stand in blocks of one
    condition and added mass, in random order; blocks of one temperature stand together, and so do those of one
    pressure. The added masses rise and fall in turn from one block to the next, so that they are changed as rarely as
    possible. The frequencies of a block stand in random order, which differs between repeats. Rigid blocks come last.

    Parameters
    ----------
    planned : CampaignPlan
    masses : sequence of float [kg]
        Each test without an added mass is run once more with each of these masses.
    repeats : int
        Number of runs of each dynamic test, >= 1.
    seed : int
        Seed of the random order.

    Returns
    -------
    polars.DataFrame
        The rows of a tests.csv, with the further columns ``repeat`` and ``instruction``.

    Raises
    ------
    ValueError
        If `repeats` is below 1.

    Examples
    --------
    >>> from fourpole.planning.plan import Guess, Run, bare_plan
    >>> from fourpole.core.rig import Rig
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    >>> planned = bare_plan(rig, Guess(110e3, 100e3, 800.0), Run(), [10.0, 16.0], preload=1000.0)
    >>> run_sheet(planned, masses=[10.0])["test"].to_list()
    ['S1', 'D2-10kg', 'D1-10kg', 'D2', 'D1']
    """
    if repeats < 1:
        raise ValueError(f"repeats is {repeats}: each test is run at least once")
    rng = np.random.default_rng(seed)
    tests = [*planned.tests, *_with_masses(planned.tests, masses)]
    rows: list[_Row] = []
    for tyre in _shuffled(list(dict.fromkeys(test.tyre for test in tests if test.kind != "calibration")), rng):
        mine = {kind: [one for one in tests if one.tyre == tyre and one.kind == kind] for kind in ("static", "dynamic")}
        rows += _statics(mine["static"], mine["dynamic"], rng)
        rows += _dynamics(mine["dynamic"], planned.rule, repeats, rng)
    rigid = _shuffled([test for test in tests if test.kind == "calibration"], rng)
    steps = ["fix the rigid block in place of the specimen, its mass weighed"]
    rows += [_Row(test, 1, [] if number else steps) for number, test in enumerate(rigid)]
    return _frame(rows, planned.extra_columns)


def _shuffled(values: Sequence[_T], rng: np.random.Generator) -> list[_T]:
    """The values in random order."""
    return [values[at] for at in rng.permutation(len(values))]


def _with_masses(tests: Sequence[Test], masses: Sequence[float]) -> Iterator[Test]:
    """Each dynamic test without an added mass once more with each of the masses."""
    bare = [test for test in tests if test.kind == "dynamic" and not test.value("added_mass")]
    for mass in masses:
        yield from (replace(_renamed(one, f"-{mass:g}kg"), values={**one.values, "added_mass": mass}) for one in bare)


def _renamed(test: Test, more: str) -> Test:
    """The test with another name, and another recording in the same folder."""
    path = PurePosixPath(test.file.replace("\\", "/"))
    return replace(test, name=test.name + more, file=str(path.with_name(f"{path.stem}{more}{path.suffix}")))


def _statics(tests: Sequence[Test], dynamic: Sequence[Test], rng: np.random.Generator) -> Iterator[_Row]:
    """The static tests of a tyre in random order."""
    for test in _shuffled(tests, rng):
        loads = [load for other in (test, *dynamic) if (load := other.value("preload")) is not None]
        past = f"well past {max(loads):g} N" if loads else "well past the highest preload"
        past += f" and below {min(loads):g} N" if loads and min(loads) <= 0 else ""
        steps = [
            *_settings(test),
            f"condition: load {past} and unload {_CONDITIONING} times, slowly and evenly",
            "then record 3 more complete cycles without a pause",
        ]
        yield _Row(test, None, steps)


def _settings(test: Test) -> list[str]:
    """The steps that bring the specimen to the temperature and the pressure of a test."""
    temperature, pressure = test.value("temperature"), test.value("pressure")
    steps = [] if temperature is None else [f"bring the specimen to {temperature:.4g} °C"]
    return steps if pressure is None else [*steps, f"set {pressure / 1e5:.4g} bar"]


def _dynamics(tests: Sequence[Test], rule: Sameness, repeats: int, rng: np.random.Generator) -> Iterator[_Row]:
    """The dynamic tests of a tyre: conditions in random order, the masses rising and falling in turn."""
    fitted: float | None = None
    for state in _conditions(tests, rule, rng):
        by_mass: dict[float, list[Test]] = {}
        for test in state:
            by_mass.setdefault(test.added_mass, []).append(test)
        masses = sorted(by_mass)
        falls = rng.random() >= 0.5 if fitted is None else abs(masses[-1] - fitted) < abs(masses[0] - fitted)
        for number, mass in enumerate(masses[::-1] if falls else masses):
            block = by_mass[mass]
            steps = _block(block[0], mass, fitted, new_state=number == 0)
            if fitted is None:
                steps.append(_warm_up(tests))
            for repeat in range(1, repeats + 1):
                for test in _shuffled(block, rng):
                    yield _Row(test if repeat == 1 else _renamed(test, f"-r{repeat}"), repeat, steps)
                    steps = []
            fitted = mass


def _conditions(tests: Sequence[Test], rule: Sameness, rng: np.random.Generator) -> list[list[Test]]:
    """Tests of each condition, in random order; tests of one rig, temperature and pressure follow each other."""
    slow = [Sameness(tuple(axis for axis in rule.axes if axis.name == name)) for name in _SLOW]
    rules = (*slow, rule.without(*_SLOW))
    groups = [each.groups([condition_of(test, each) for test in tests]).tolist() for each in rules]
    found: dict[tuple[Any, ...], list[Test]] = {}
    for test, *key in zip(tests, (test.rig for test in tests), *groups, strict=True):
        found.setdefault(tuple(key), []).append(test)
    levels = [list(dict.fromkeys(values)) for values in zip(*found, strict=True)]
    ranks = [dict(zip(values, rng.permutation(len(values)).tolist(), strict=True)) for values in levels]
    order = sorted(found, key=lambda key: [rank[part] for rank, part in zip(ranks, key, strict=True)])
    return [found[key] for key in order]


def _block(test: Test, mass: float, fitted: float | None, *, new_state: bool) -> list[str]:
    """The steps before a block of tests; `fitted` is the mass on the rig [kg], None where it is not known."""
    steps = _settings(test) if new_state else []
    load = test.value("preload")
    kept = f"the load on the specimen is {load:g} N" if load is not None else "the load on the specimen is as before"
    before = fitted or 0.0
    if mass > 0 and mass != before:
        steps.append(f"weigh {mass:g} kg and fix it rigidly to the moving mass" + (", all else off" if before else ""))
    elif mass != before:
        steps.append(f"take the {before:g} kg off")
    elif fitted is None:
        steps.append("no added mass on the moving mass")
    if mass != before:
        more = "less" if mass > before else "more"
        steps.append(
            f"reset the preload spring ({abs(mass - before) * _GRAVITY:.1f} N {more} from it) so that {kept} again"
        )
    elif new_state:
        steps.append(f"set the preload spring so that {kept}")
    return steps


def _warm_up(tests: Sequence[Test]) -> str:
    frequencies = [frequency for test in tests if (frequency := test.value("frequency")) is not None]
    at = f"{np.median(frequencies):.3g} Hz" if frequencies else "a middle frequency"
    return f"warm up: run at {at} for {_WARM_UP} minutes without recording, then check load and pressure again"


def _frame(rows: Sequence[_Row], extra: Sequence[str]) -> pl.DataFrame:
    """The rows in the columns of tests.csv, without the optional columns that no test states."""
    frame = pl.DataFrame([_cells(row, extra) for row in rows], strict=False, infer_schema_length=None)
    return frame.drop(head for head in _OPTIONAL if frame[head].null_count() == frame.height)


def _cells(row: _Row, extra: Sequence[str]) -> dict[str, Any]:
    """The cells of one row by the heads of their columns."""
    test = row.test
    pressure, window = test.value("pressure"), test.window
    return {
        "test": test.name,
        "file": test.file,
        "kind": test.kind,
        "tyre": test.tyre,
        q.PRESSURE.stated_head: None if pressure is None else round(pressure / 1e5, 10),
        q.PRELOAD.head: test.value("preload"),
        q.FREQUENCY.head: test.value("frequency"),
        q.ADDED_MASS.stated_head: None if test.kind == "static" else test.added_mass,
        **{head: test.value(head.partition(" [")[0]) for head in _OPTIONAL},
        "rig": test.rig or None,
        q.WINDOW.head: None if window is None else f"{window[0]:g}..{window[1]:g}",
        **{name: test.extra.get(name, "") for name in extra},
        "repeat": None if row.repeat is None else str(row.repeat),
        INSTRUCTION: "; ".join(row.steps) or None,
    }
