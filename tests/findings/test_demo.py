"""The findings on a virtual campaign, one by one against what the tyres are."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fourpole import Study, analyse
from fourpole.findings import Holds, findings
from fourpole.study.tables import DYNAMIC, STATIC
from fourpole.virtual import CROSS_PLY, RADIAL_PLY, simulate_campaign

pytestmark = pytest.mark.thorough

PRESSURES, FREQUENCIES = [100e3, 170e3, 240e3], [14.0, 16.5, 18.0, 20.0, 23.0]
KEY = ["tyre", "pressure [Pa]", "preload [N]"]


@pytest.fixture(scope="session")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The two tyres at three pressures and two loads as the demonstration records them; tests.csv has one load."""
    folder = simulate_campaign(
        tmp_path_factory.mktemp("words"),
        seed=7,
        tyres=[CROSS_PLY, RADIAL_PLY],
        pressures=PRESSURES,
        preloads=[1000.0, 2000.0],
        frequencies=FREQUENCIES,
    ).folder
    tests = pl.read_csv(folder / "tests.csv", infer_schema=False)
    tests.filter(pl.col("preload [N]").cast(float).fill_null(1000.0) == 1000.0).write_csv(folder / "tests.csv")
    return folder


@pytest.fixture(scope="session")
def whole_truth(campaign: Path) -> pl.DataFrame:
    return pl.read_csv(campaign / "truth.csv", infer_schema_length=None)


@pytest.fixture(scope="session")
def demo(campaign, whole_truth) -> tuple[Study, pl.DataFrame]:
    """The campaign at one load, analysed, and its truth."""
    return analyse(campaign), whole_truth.filter(pl.col("preload [N]") == 1000.0)


@pytest.fixture(scope="session")
def told(demo):
    return findings(demo[0])


def only(told, kind, quantity, *specimens, **about):
    """The one finding of a kind on a quantity, of these specimens, with these attributes."""
    (found,) = (
        each
        for each in told
        if (each.kind, each.quantity and each.quantity.column) == (kind, quantity)
        and set(specimens) <= {*each.specimens}
        and all(getattr(each, name) == value for name, value in about.items())
    )
    return found


def curve(truth, column, **where):
    """Frequencies and values of a tyre at one condition."""
    rows = truth.filter(pl.col("test").str.starts_with("D"), *(pl.col(n) == v for n, v in where.items()))
    rows = rows.sort("frequency [Hz]")
    return rows["frequency [Hz]"].to_numpy(), rows[column].to_numpy()


def ratios(truth, column):
    cross, radial = (truth.filter(pl.col("tyre") == tyre) for tyre in ("cross-ply", "radial-ply"))
    by = ["pressure [Pa]", "preload [N]", "nominal"]
    pairs = cross.join(radial, on=by, suffix=" other", nulls_equal=True).drop_nulls([column, f"{column} other"])
    return (pairs[column] / pairs[f"{column} other"] - 1.0).to_numpy()


@pytest.fixture(scope="session")
def true(demo):
    """The truth with nominal frequencies, blank for static tests."""
    return demo[1].with_columns((2.0 * pl.col("frequency [Hz]")).round().alias("nominal") / 2.0)


@pytest.mark.parametrize(("symbol", "column"), [("K1", "K1 [N/m]"), ("K2", "K2 [N/m]"), ("C", "C [N s/m]")])
def test_the_comparison_is_true(told, true, symbol, column):
    detail = only(told, "comparison", symbol).detail
    assert (detail.upper, detail.lower) == ("cross-ply", "radial-ply")
    found = ratios(true.filter(pl.col("frequency [Hz]").is_null() == (symbol == "K1")), column)
    values = [effect.value for effect in detail.effects.values()]
    assert detail.mean.value == pytest.approx(found.mean(), rel=0.04)
    assert min(values) == pytest.approx(found.min(), rel=0.1, abs=0.01)
    assert max(values) == pytest.approx(found.max(), rel=0.1)
    assert len(values) == found.size


@pytest.mark.parametrize("tyre", ["cross-ply", "radial-ply"])
@pytest.mark.parametrize(("symbol", "column"), [("K1", "K1 [N/m]"), ("K2", "K2 [N/m]"), ("C", "C [N s/m]")])
def test_the_levels_are_true(told, true, tyre, symbol, column):
    found = only(told, "level", symbol, tyre).detail.numbers
    values = true.filter(pl.col("tyre") == tyre)[column].drop_nulls()
    assert min(found) == pytest.approx(values.min(), rel=0.05)
    assert max(found) == pytest.approx(values.max(), rel=0.05)


def test_the_trends_are_true(told, true):
    def relative(tyre, column, axis):
        rest = [n for n in ("pressure [Pa]", "preload [N]", "nominal") if n != axis]
        changes = {}
        for key, rows in true.filter(pl.col("tyre") == tyre, pl.col(column).is_not_null()).group_by(rest):
            x, y = rows[axis].to_numpy(), rows[column].to_numpy()
            if x[0] is not None and x.size > 2:
                changes[key] = np.polyfit(x, y, 1)[0] * np.ptp(x) / y.mean()
        return changes

    for tyre in ("cross-ply", "radial-ply"):
        rising = only(told, "trend with pressure", "K1", tyre, holds=Holds.RISES)
        found = np.mean([v for k, v in relative(tyre, "K1 [N/m]", "pressure [Pa]").items() if k[-1] is None])
        assert rising.effect == pytest.approx(found, abs=0.006)
        rising = only(told, "trend with frequency", "K2", tyre, holds=Holds.RISES)
        found = np.mean(list(relative(tyre, "K2 [N/m]", "nominal").values()))
        assert rising.effect == pytest.approx(found, abs=0.03)
        turn = only(told, "trend with pressure", "K2", tyre, holds=Holds.MIXED).detail
        assert (turn.parts[14.0].sign, turn.parts[23.0].sign) == (-1, 1)
        changes = relative(tyre, "K2 [N/m]", "pressure [Pa]")
        f = np.array(FREQUENCIES)
        mean = np.array([np.mean([v for k, v in changes.items() if k[-1] == at]) for at in f])
        zero = np.interp(0.0, mean, f)
        assert turn.zero == pytest.approx(zero, abs=0.3)
    rising = only(told, "trend with pressure", "C", "radial-ply", holds=Holds.RISES)
    found = np.mean(list(relative("radial-ply", "C [N s/m]", "pressure [Pa]").values()))
    assert rising.effect == pytest.approx(found, abs=0.015)
    assert only(told, "trend with frequency", "C", "radial-ply").holds is Holds.RISES


def true_peak(true, tyre, pressure, load):
    """Top of TR with K* between the tested frequencies."""
    where = {"tyre": tyre, "pressure [Pa]": pressure, "preload [N]": load}
    f = np.linspace(14.0, 23.0, 9001)
    parts = [np.polynomial.Polynomial.fit(*curve(true, f"{part} K* [N/m]", **where), 4)(f) for part in ("Re", "Im")]
    rig = [
        true[name].drop_nulls()[0]
        for name in ("moving mass [kg]", "preload stiffness [N/m]", "preload damping [N s/m]")
    ]
    w = 2 * np.pi * f
    stiffness = parts[0] + 1j * parts[1]
    tr = abs(stiffness / (stiffness + rig[1] - w**2 * rig[0] + 1j * w * rig[2]))
    return f, tr


@pytest.mark.parametrize("tyre", ["cross-ply", "radial-ply"])
def test_the_resonances_are_true(told, true, tyre):
    peaks = only(told, "resonance", "TR", tyre, holds=Holds.INSIDE).detail.peaks
    assert [round(pressure, -3) for pressure, _ in peaks] == PRESSURES
    for pressure, one in zip(PRESSURES, peaks.values(), strict=True):
        f, tr = true_peak(true, tyre, pressure, 1000.0)
        top = f[np.argmax(tr)]
        assert one.low < top < one.high
        assert one.top is None or one.top == pytest.approx(top, abs=0.25)
        _, tested = curve(true, "TR [1]", **dict(zip(KEY, (tyre, pressure, 1000.0), strict=True)))
        assert one.tr == pytest.approx(tested.max(), rel=0.005)


def test_the_crossing_is_true(told, true):
    crossings = []
    for pressure in PRESSURES:
        (f, cross), (_, radial) = (true_peak(true, tyre, pressure, 1000.0) for tyre in ("cross-ply", "radial-ply"))
        crossings.append(f[np.flatnonzero(np.diff(np.sign(cross - radial)))[-1]])
    found = only(told, "crossing", "TR", "cross-ply", "radial-ply", holds=Holds.ONE_CROSSING)
    single = found.detail.single.values()
    assert len(single) == len(found.detail.crossings) == 3
    # Below the crossing the second tyre has the higher TR.
    assert (found.specimens, {one.sign for one in single}) == (("cross-ply", "radial-ply"), {1})
    assert min(one.frequency for one in single) == pytest.approx(min(crossings), abs=0.15)
    assert max(one.frequency for one in single) == pytest.approx(max(crossings), abs=0.15)


def test_the_measured_tr_agrees_with_the_predicted(told):
    assert only(told, "prediction", "TR").holds is Holds.WITHIN


@pytest.fixture(scope="module")
def perfect(demo, whole_truth) -> Study:
    """Tables that hold the truth at both loads, known to 1 %."""

    def table(kind, columns, more):
        rows = whole_truth.filter(pl.col("test").str.starts_with(kind)).with_columns(
            pl.col("TR [1]").alias("TR measured [1]"),
            verdict=pl.lit("ok"),
            remarks=pl.lit(""),
            construction=pl.col("tyre"),
            **more,
        )
        known = {"K1 [N/m]": "u(K1) [N/m]", "K2 [N/m]": "u(K2) [N/m]", "C [N s/m]": "u(C) [N s/m]"}
        known |= {"TR measured [1]": "u(TR) [1]"}
        rows = rows.with_columns((0.01 * pl.col(name)).alias(std) for name, std in known.items())
        lacking = {n: kind for n, kind in columns.items() if n not in rows.columns}
        blanks = [pl.lit("" if kind == pl.String else None, kind).alias(n) for n, kind in lacking.items()]
        return rows.with_columns(blanks).select(list(columns))

    bent = pl.when(pl.col("tyre") == "cross-ply").then(0.04).otherwise(0.007)
    tables = table("S", STATIC.columns, {"nonlinearity [1]": bent}), table("D", DYNAMIC.columns, {})
    return Study(*tables, pl.DataFrame())


def agreeing(results, evaluate_claims):
    """Numbers of the claims that hold as in the reference, and of those that cannot be examined."""
    said = {each.detail.number: each.holds for each in findings(results) if each.topic == "claims"}
    told = {number: holds is not Holds.FALSE for number, holds in said.items() if holds is not Holds.NOT_EXAMINED}
    reference = {number: holds for number, holds, _ in evaluate_claims(results.static, results.dynamic)}
    assert sorted(said) == list(range(1, 13))
    assert told == {number: reference[number] for number in told}
    return {number for number in told if reference[number]}, said.keys() - told.keys()


def test_the_claims_hold_as_in_the_reference(demo, perfect, evaluate_claims):
    everything = set(range(1, 13))
    assert agreeing(perfect, evaluate_claims) == (everything, set())
    assert agreeing(demo[0], evaluate_claims) == (everything - {5}, {5})


@pytest.mark.parametrize("seed", range(6))
def test_the_claims_hold_as_in_the_reference_where_some_are_false(perfect, evaluate_claims, seed):
    rng = np.random.default_rng(seed)
    tables = [
        table.with_columns(
            pl.col(name) * pl.Series(rng.uniform(0.7, 1.4, table.height))
            for name in ("K1 [N/m]", "K2 [N/m]", "C [N s/m]", "TR measured [1]", "nonlinearity [1]")
            if name in table.columns
        )
        for table in (perfect.static, perfect.dynamic)
    ]
    true, untold = agreeing(Study(*tables, pl.DataFrame()), evaluate_claims)
    assert not untold
    assert len(true) < 12
