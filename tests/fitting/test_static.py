"""Static tests joined as ramps: from the tables of a results folder to the model file and its answers."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from fourpole import quantities as q
from fourpole.errors import ModelError, TableError
from fourpole.fitting.measured import Measured, read_measured
from fourpole.fitting.modelfile import read_model_file
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.fitting.query import Query, ask
from fourpole.fitting.static import LOOPS, STATIC, _is_of, join_static
from fourpole.models.data import StiffnessData
from fourpole.models.families import model_named

FREQUENCY = np.linspace(6.0, 30.0, 13)
#: K0 and K_inf [N/m], tau [s], alpha [1].
TRUTH = [150e3, 900e3, 2e-5, 0.35]
#: Tangent of this specimen in the middle of branches of 20 s in the third cycle, by integration of its spectrum.
TANGENT, PLACE, TRAVEL = 156785.0, 0.5, 0.02


@pytest.fixture
def results(tmp_path):
    """Tables as fourpole analyse writes them, of one condition with two repeats of the static test."""
    rng = np.random.default_rng(4)
    clean = model_named("fractional").stiffness(TRUTH, 2 * np.pi * FREQUENCY)
    noise = 0.002 * abs(clean)
    seen = clean + noise * (rng.standard_normal(13) + 1j * rng.standard_normal(13))
    state = {"tyre": "mount", "pressure [Pa]": 1.7e5, "preload [N]": 1560.0}
    rows = {"frequency [Hz]": FREQUENCY, "Re K* [N/m]": seen.real, "Im K* [N/m]": seen.imag}
    rows |= {"u(Re K*) [N/m]": noise, "u(Im K*) [N/m]": noise}
    names = [f"D{at}" for at in range(13)]
    known = [pl.lit(value).alias(name) for name, value in {**state, "K1 [N/m]": TANGENT, "u(K1) [N/m]": 400.0}.items()]
    pl.DataFrame({"test": names, **rows}).with_columns(*known).write_csv(tmp_path / "dynamic.csv")
    static = [
        {"test": name, **state, "K1 [N/m]": TANGENT + off, "u(K1) [N/m]": 400.0, "K1 of": "mean",
         "time per branch [s]": 20.0, "cycle": 3, "verdict": "ok", "remarks": ""}
        for name, off in (("S1", -100.0), ("S2", 100.0))
    ]  # fmt: skip
    pl.DataFrame(static).write_csv(tmp_path / STATIC)
    x = np.linspace(0.0, TRAVEL, 21)
    loop = {"deflection [m]": np.append(x, x[::-1]), "mean deflection [m]": x, "mean load [N]": 1560.0 / 0.01 * x}
    pl.DataFrame(
        [{"test": name, **{column: value.tolist() for column, value in loop.items()}} for name in ("S1", "S2")]
    ).write_parquet(tmp_path / LOOPS)
    return tmp_path


def changed(results, **columns):
    """static.csv with other values in the first row."""
    table = pl.read_csv(results / STATIC)
    for name, value in columns.items():
        first = pl.int_range(pl.len()) == 0
        table = table.with_columns(pl.when(first).then(pl.lit(value)).otherwise(pl.col(name)).alias(name))
    table.write_csv(results / STATIC)


def test_the_ramp_of_a_condition_is_that_of_its_static_tests(results):
    (one,) = join_static(read_measured(results), results, 0.05).conditions
    assert (one.loop.ramp.time, one.loop.ramp.cycle) == (20.0, 3)
    assert one.loop.ramp.place == pytest.approx(PLACE, abs=1e-6)
    assert float(one.data.k1_std) == pytest.approx(np.hypot(400.0, 0.05 * TANGENT))


@pytest.mark.sampled(2)
def test_a_fit_with_the_ramp_answers_below_the_band_and_says_what_it_rests_on(results, tmp_path):
    measured = join_static(read_measured(results), results / "dynamic.csv", 0.05)
    made = model_file(measured, fit_tyres(measured, "fractional"))
    made.write(tmp_path / "model.json")
    file = read_model_file(tmp_path / "model.json")
    static = file.models[0].conditions[0].static
    assert static.branch_time == 20.0
    assert abs(static.factor - 1.0) < 2 * static.factor_std < 0.1
    assert "joined as a ramp of 20 s per branch" in file.models[0].choice
    frequency = np.array([0.002, 0.05, 0.5, 3.0, 10.0])
    rows = ask(file, Query(tyre=None, state={}, frequency=frequency, beyond=True))
    exact = model_named("fractional").stiffness(TRUTH, 2 * np.pi * frequency)
    for row, truth in zip(rows, exact, strict=True):
        assert abs(row["Re K* [N/m]"] - truth.real) < 2.0 * row["u(Re K*) [N/m]"]
    inside, gap = rows[-1], rows[1]
    assert "static test" not in inside["remarks"]
    assert "rests on the static test (20 s per branch" in gap["remarks"]
    assert "slower than that test nothing was measured" in rows[0]["remarks"]
    assert gap["u(Re K*) [N/m]"] > 0.02 * exact[1].real  # a slow arm of some per cent is possible there
    ranges = file.models[0].conditions[0].ranges
    assert ranges[0].frequency < 0.01
    assert all(one.frequency <= 6.0 * 1.001 and one.storage[0] <= one.storage[1] for one in ranges)


def test_a_condition_without_k1_is_left_as_it_is(results):
    table = pl.read_csv(results / "dynamic.csv")
    other = table.with_columns(pl.lit(2.2e5).alias("pressure [Pa]"), pl.lit(None, pl.Float64).alias("K1 [N/m]"))
    other = other.with_columns(test="E" + pl.col("test"))
    pl.concat([table, other]).write_csv(results / "dynamic.csv")
    found = join_static(read_measured(results), results, 0.05)
    assert [one.loop is None for one in found.conditions] == [False, True]
    assert any("no static test is joined" in note for note in found.notes)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"time per branch [s]": None}, "states no time per branch"),
        ({"time per branch [s]": 40.0}, "took 20 to 40 s per branch"),
        ({"K1 of": "loading"}, "no closed loop"),
        ({"K1 [N/m]": 150e3}, "K1 is not that of the static tests S1, S2"),
        ({"preload [N]": 3000.0}, "K1 is not that of the static tests S2"),
        ({"verdict": "rejected"}, "K1 is not that of the static tests S2"),
    ],
)
def test_what_is_missing_is_named(results, columns, said):
    changed(results, **columns)
    with pytest.raises(ModelError, match=said):
        join_static(read_measured(results), results, 0.05)


def test_tables_that_are_missing_or_damaged_are_named(results, tmp_path_factory):
    measured = read_measured(results)
    for name in (STATIC, LOOPS):
        folder = shutil.copytree(results, tmp_path_factory.mktemp("part") / "results")
        (folder / name).unlink()
        with pytest.raises(ModelError, match=f"has no {name}"):
            join_static(measured, folder, 0.05)
        (folder / name).write_bytes(b"no table")
        with pytest.raises((ModelError, TableError), match=name):
            join_static(measured, folder, 0.05)


def test_a_preload_at_the_turn_is_refused(results):
    changed(results, **{"preload [N]": 1560.0})
    table = pl.read_parquet(results / LOOPS)
    table.with_columns(pl.col("mean load [N]").list.eval(pl.element() * 0.503)).write_parquet(results / LOOPS)
    with pytest.raises(ModelError, match="where the motion turns"):
        join_static(read_measured(results), results, 0.05)


def test_a_specimen_whose_name_begins_like_another_is_another():
    data = StiffnessData.of([60.0], [2e5 + 2e4j], 1e3)
    measured = Measured("radial-wide", {q.PRESSURE.head: 1.7e5, q.PRELOAD.head: 1000.0}, (("D1", 1),), data)
    row = {q.TYRE.head: "radial", q.K1.head: 1e5, q.VERDICT.head: "ok", q.PRESSURE.head: 1.7e5, q.PRELOAD.head: 1000.0}
    assert not _is_of(row, measured)
    assert _is_of(row, replace(measured, tyre="radial at 20 °C"))
    cold = replace(measured, tyre="radial", state={**measured.state, q.TEMPERATURE.head: 20.0})
    assert not _is_of({**row, q.TEMPERATURE.head: 60.0}, cold)
