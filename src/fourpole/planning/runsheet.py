"""The run sheet: a plan's tests in the order in which they are best run, as a tests.csv with instructions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.campaign.folder import Test
from fourpole.planning.plan import CampaignPlan

__all__ = ["INSTRUCTION", "run_sheet"]

INSTRUCTION = "instruction"
#: Standard gravity [m/s²]: what a weighed mass weighs.
_GRAVITY = 9.80665
_CONDITIONING = 5
_WARM_UP = 10
#: Columns that are written only where a test states them, with their units.
_OPTIONAL = {"u(added_mass)": "kg", "K1": "N/m", "u(K1)": "N/m", "temperature": "degC"}


@dataclass(frozen=True)
class _Row:
    test: Test
    repeat: int | None = None
    said: list[str] = field(default_factory=list)


def run_sheet(
    planned: CampaignPlan, *, masses: Sequence[float] = (), repeats: int = 1, seed: int = 1982
) -> pl.DataFrame:
    """All tests of a plan in the order in which they are to be run.

    Each tyre is conditioned and measured statically, then warmed up. Its dynamic tests stand in blocks of one pressure,
    preload and added mass, in random order; from one block to the next the masses run up and down in turn, so that
    they are changed as rarely as can be. Within a block the frequencies stand in random order, each repeat in
    another. Rigid blocks come last.

    Parameters
    ----------
    planned : CampaignPlan
    masses : sequence of float [kg]
        Every test without an added mass is run once more with each of these.
    repeats : int
        How often each dynamic test is run, >= 1.
    seed : int
        Of all that is random.

    Returns
    -------
    polars.DataFrame
        A tests.csv in the columns of the campaign folder, with ``repeat`` and ``instruction``, which pass through.

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
    rows = list(_ordered(planned.tests, masses, repeats, rng))
    return _frame(rows, planned.extra_columns)


def _ordered(tests: Sequence[Test], masses: Sequence[float], repeats: int, rng: np.random.Generator) -> Iterator[_Row]:
    dynamic = [test for test in tests if test.kind == "dynamic"]
    more = [_with_mass(test, mass) for mass in masses for test in dynamic if not test.value("added_mass")]
    dynamic += more
    tyres = list(dict.fromkeys(test.tyre for test in tests if test.kind != "calibration"))
    for at in rng.permutation(len(tyres)):
        tyre = tyres[at]
        mine = [test for test in dynamic if test.tyre == tyre]
        yield from _statics([test for test in tests if test.kind == "static" and test.tyre == tyre], mine, rng)
        yield from _dynamics(mine, repeats, rng)
    rigid = [test for test in tests if test.kind == "calibration"]
    for number, at in enumerate(rng.permutation(len(rigid))):
        said = ["fix the rigid block in place of the tyre, its mass weighed"] if number == 0 else []
        yield _Row(rigid[at], 1, said)


def _with_mass(test: Test, mass: float) -> Test:
    name = f"{test.name}-{mass:g}kg"
    return replace(test, name=name, file=_beside(test.file, f"-{mass:g}kg"), values={**test.values, "added_mass": mass})


def _beside(file: str, more: str) -> str:
    """The name of another recording in the same folder."""
    path = PurePosixPath(file.replace("\\", "/"))
    return str(path.with_name(f"{path.stem}{more}{path.suffix}"))


def _statics(tests: Sequence[Test], dynamic: Sequence[Test], rng: np.random.Generator) -> Iterator[_Row]:
    """Static tests of a tyre, in random order of their pressures."""
    for at in rng.permutation(len(tests)):
        test = tests[at]
        loads = [load for other in (test, *dynamic) if (load := other.value("preload")) is not None]
        past = f"well past {max(loads):g} N" if loads else "well past the highest preload"
        said = [
            *_pressure(test),
            f"condition: load {past} and unload {_CONDITIONING} times, slowly and evenly",
            "then record 3 more complete cycles without a pause",
        ]
        yield _Row(test, None, said)


def _pressure(test: Test) -> list[str]:
    pressure = test.value("pressure")
    return [] if pressure is None else [f"set {pressure / 1e5:.4g} bar"]


def _dynamics(tests: Sequence[Test], repeats: int, rng: np.random.Generator) -> Iterator[_Row]:
    """Dynamic tests of a tyre: blocks in random order, the masses up and down in turn."""
    states: dict[tuple[Any, ...], list[Test]] = {}
    for test in tests:
        states.setdefault((test.rig, test.value("pressure"), test.value("preload")), []).append(test)
    keys = list(states)
    order = _nested(keys, rng)
    fitted: float | None = None
    for key in order:
        by_mass: dict[float, list[Test]] = {}
        for test in states[key]:
            by_mass.setdefault(test.value("added_mass") or 0.0, []).append(test)
        listed = sorted(by_mass)
        if fitted is None:
            listed = listed if rng.random() < 0.5 else listed[::-1]
        elif abs(listed[-1] - fitted) < abs(listed[0] - fitted):
            listed = listed[::-1]
        for number, mass in enumerate(listed):
            said = _block(by_mass[mass][0], mass, fitted, new_state=number == 0)
            if fitted is None:
                said.append(_warm_up(tests))
            for repeat in range(1, repeats + 1):
                for at in rng.permutation(len(by_mass[mass])):
                    yield _Row(_repeated(by_mass[mass][at], repeat), repeat, said)
                    said = []
            fitted = mass


def _nested(keys: Sequence[tuple[Any, ...]], rng: np.random.Generator) -> list[tuple[Any, ...]]:
    """Keys in random order, but all of one rig together, and of one pressure."""
    ranks: list[dict[Any, int]] = []
    for level in (0, 1, 2):
        values = list(dict.fromkeys(key[level] for key in keys))
        drawn = rng.permutation(len(values))
        ranks.append({value: int(rank) for value, rank in zip(values, drawn, strict=True)})
    return sorted(keys, key=lambda key: tuple(ranks[level][key[level]] for level in (0, 1, 2)))


def _block(test: Test, mass: float, fitted: float | None, *, new_state: bool) -> list[str]:
    """What is to be done before a block of tests; `fitted` is the mass on the rig, None where nobody knows."""
    said = _pressure(test) if new_state else []
    load = test.value("preload")
    kept = f"the load on the tyre is {load:g} N" if load is not None else "the load on the tyre is as before"
    on = fitted or 0.0
    if mass != on or (fitted is None and mass == 0):
        if mass > 0:
            said.append(f"weigh {mass:g} kg and fix it rigidly to the moving mass" + (", all else off" if on else ""))
        else:
            said.append(f"take the {on:g} kg off" if on else "no added mass on the moving mass")
    if mass != on:
        more = "less" if mass > on else "more"
        said.append(f"reset the preload spring ({abs(mass - on) * _GRAVITY:.1f} N {more} from it) so that {kept} again")
    elif new_state:
        said.append(f"set the preload spring so that {kept}")
    return said


def _warm_up(tests: Sequence[Test]) -> str:
    frequencies = [frequency for test in tests if (frequency := test.value("frequency")) is not None]
    at = f"{np.median(frequencies):.3g} Hz" if frequencies else "a middle frequency"
    return f"warm up: run at {at} for {_WARM_UP} minutes without recording, then check load and pressure again"


def _repeated(test: Test, repeat: int) -> Test:
    if repeat == 1:
        return test
    return replace(test, name=f"{test.name}-r{repeat}", file=_beside(test.file, f"-r{repeat}"))


def _frame(rows: Sequence[_Row], extra: Sequence[str]) -> pl.DataFrame:
    """Rows in the columns of tests.csv."""
    tests = [row.test for row in rows]

    def numbers(name: str, scale: float = 1.0) -> list[float | None]:
        return [None if (value := test.value(name)) is None else value / scale for test in tests]

    columns: dict[str, Any] = {
        "test": [test.name for test in tests],
        "file": [test.file for test in tests],
        "kind": [test.kind for test in tests],
        "tyre": [test.tyre for test in tests],
        q.PRESSURE.stated_head: [None if p is None else round(p, 10) for p in numbers("pressure", 1e5)],
        q.PRELOAD.head: numbers("preload"),
        q.FREQUENCY.head: numbers("frequency"),
        q.ADDED_MASS.stated_head: [
            None if test.kind == "static" else test.value("added_mass") or 0.0 for test in tests
        ],
    }
    for name, unit in _OPTIONAL.items():
        if any(name in test.values for test in tests):
            columns[f"{name} [{unit}]"] = numbers(name)
    if any(test.rig for test in tests):
        columns["rig"] = [test.rig for test in tests]
    if any(test.window is not None for test in tests):
        columns[q.WINDOW.head] = ["" if (w := test.window) is None else f"{w[0]:g}..{w[1]:g}" for test in tests]
    for name in extra:
        if name not in ("repeat", INSTRUCTION):
            columns[name] = [test.extra.get(name, "") for test in tests]
    columns["repeat"] = [None if row.repeat is None else str(row.repeat) for row in rows]
    columns[INSTRUCTION] = ["; ".join(row.said) or None for row in rows]
    return pl.DataFrame(columns, strict=False, infer_schema_length=None)
