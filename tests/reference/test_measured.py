"""Measured specimens and tyres: published figures that the core must find again."""

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

from fourpole.app.cli import app
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.reduced import identify_mobility
from fourpole.fitting.measured import read_measured
from fourpole.fitting.modelfile import read_model_file
from fourpole.io.tables.kstar import TableOptions, read_k_star
from fourpole.io.tables.pair import read_curve
from fourpole.io.text import read_table
from fourpole.models.choice import choose
from fourpole.models.discrepancy import model_discrepancy, with_error
from fourpole.models.families import model_named

pytestmark = pytest.mark.thorough

# Static curve of a truck tyre 335/65 R22.5 at 4.14 bar, as a cubic [N/m³, N/m², N/m]
# (Calspan test, 2010, in Project Chrono, data/vehicle/feda/tires, BSD-3).
TRUCK = np.array([-3.486667e7, 5.205933e6, 3.756533e5])


def truck_load(x):
    return x * (TRUCK[2] + x * (TRUCK[1] + x * TRUCK[0]))


def truck_slope(x):
    return TRUCK[2] + x * (2 * TRUCK[1] + 3 * x * TRUCK[0])


@pytest.fixture(scope="module")
def polymer(shared):
    """A polymer specimen in shear on a bench without motion behind it, by table and as identified."""
    table = read_k_star(shared / "data" / "polymer-shear-dma-20C.txt", TableOptions(ratio=True))
    return table, identify_mobility(table.frequency, table.mobility, 8.68e5)


def test_polymer_table(polymer, shared):
    table, found = polymer
    assert table.frequency.size == 24
    assert table.frequency[[0, -1]] == pytest.approx([1e-3, 562.0], rel=1e-2)
    assert any("not data" in warning for warning in table.warnings)  # its trailing line

    # K* = F/x e^{j phase} row by row, by hand
    raw = read_table(shared / "data" / "polymer-shear-dma-20C.txt")
    by_hand = raw.column("F") / (1e-6 * raw.column("x")) * np.exp(1j * raw.column("Phase"))
    np.testing.assert_allclose(found.stiffness, by_hand, rtol=1e-12)


def test_polymer_stiffness_is_proportional_to_the_instruments_modulus(polymer, shared):
    table, found = polymer
    modulus = read_table(shared / "data" / "polymer-shear-dma-20C.txt").column("G'")
    good = (table.frequency < 10.5) & ~np.isin(np.arange(24), [0, 1, 8])  # the others are poor measurements
    ratio = found.stiffness.real[good] / modulus[good]
    assert np.ptp(ratio) / ratio.mean() < 2 * 0.013


def test_polymer_arm(polymer):
    table, found = polymer
    at = [int(np.argmin(np.abs(np.log(table.frequency / f)))) for f in (0.1, 10.0, 562.0)]
    np.testing.assert_allclose(found.k2[at], [7.8e5, 3.60e6, 1.46e7], rtol=1e-2)
    np.testing.assert_allclose(found.c[at], [7.1e5, 8.33e4, 6.7e3], rtol=1e-2)

    used = np.flatnonzero(table.frequency >= 0.99 * table.frequency[at[0]])
    assert (np.diff(found.k2[used]) > 0).all()
    assert (np.diff(found.c[used]) < 0).all()


def test_polymer_rows_below_k1_are_refused_with_a_reason(polymer):
    table, found = polymer
    low = np.flatnonzero((table.frequency > 3e-3) & (table.frequency < 6e-3))
    assert low.size == 2
    for row in low:
        assert np.isnan(found.k2[row])
        assert np.isnan(found.c[row])
        assert "no passive K2 exists" in found.reasons[row]
        assert "not above the static K1" in found.reasons[row]
    above = np.flatnonzero(table.frequency > 0.09)
    assert {found.reasons[row] for row in above} == {""}
    assert np.isnan(found.tr).all()  # nothing moves on the far side


@pytest.mark.parametrize("points", [21, 501])
def test_truck_tyre_cubic(points):
    x = np.linspace(0.0, 0.1, points)
    curve = LoadCurve(x, truck_load(x))
    tangent = curve.tangent(21674.0)
    assert curve.order == 3
    assert tangent.deflection == pytest.approx(40.8788e-3, abs=5e-8)  # as many digits as are published
    assert tangent.stiffness == pytest.approx(626483, abs=1.0)
    assert curve.secant(21674.0).stiffness == pytest.approx(530201, abs=1.0)
    # round-off of 1e-13 of the largest load over the deflection, times the square of the order: below 1e-9
    for place in (0.005, 0.02, 0.05, 0.09):
        assert curve.tangent(truck_load(place)).stiffness == pytest.approx(truck_slope(place), rel=1e-9)
        assert curve.secant(truck_load(place)).stiffness == pytest.approx(truck_load(place) / place, rel=1e-9)


def test_truck_tyre_file(shared):
    table = read_curve(shared / "data" / "truck-tyre-335-65R22.5-414kPa.csv")
    # the published coefficients are rounded to 7 digits: up to 5 N/m³ and 0.5 N/m² at 0.1 m, 0.05 N/m
    np.testing.assert_allclose(table.load, truck_load(table.deflection), atol=5 * 1e-3 + 0.5 * 1e-2 + 0.05 * 0.1)
    curve = LoadCurve(table.deflection, table.load)
    tangent = curve.tangent(21674.0)
    # loads rounded to 1e-3 N: 3e-4 N rms on 21 points over 0.1 m moves the slope of a cubic by less than 0.1 N/m
    assert curve.order == 3
    assert tangent.stiffness == pytest.approx(626483, abs=1.0)
    assert tangent.fit < 0.1
    assert curve.secant(21674.0).stiffness == pytest.approx(530201, abs=1.0)
    assert (curve.measured, curve.remarks) == ("loading", ())


def test_light_truck_tyre_file(shared):
    table = read_curve(shared / "data" / "hmmwv-tyre-fiala.csv")
    assert table.deflection.size == 17
    upper = table.deflection >= 0.0299
    line = np.polyfit(table.deflection[upper], table.load[upper], 1)[0]
    assert line == pytest.approx(312.7e3, abs=0.05e3)
    # A fitted line's slope is the mean of the tangents along it, weighted with a parabola that is 0 at both ends.
    curve = LoadCurve(table.deflection, table.load)
    tangents = [curve.tangent(load) for load in np.linspace(6190.0, 21699.0, 60)]
    place = np.array([tangent.deflection for tangent in tangents])
    weight = np.gradient(place) * (place - 0.03) * (0.08 - place)
    mean = weight @ [tangent.stiffness for tangent in tangents] / weight.sum()
    # fully correlated at worst, so the mean is as uncertain as they are on average: 1.6 %, the choice of order included
    uncertainty = weight @ [tangent.fit for tangent in tangents] / weight.sum()
    assert uncertainty < 0.02 * line
    assert abs(mean - line) < uncertainty


@pytest.fixture
def polymer_table(shared, tmp_path):
    """Table of the polymer's K*, as `identify` writes it from the measured file."""
    table, source = tmp_path / "k.csv", shared / "data" / "polymer-shear-dma-20C.txt"
    ran = CliRunner().invoke(app, ["identify", str(source), "--k1", "868 kN/m", "--no-rig", "--out", str(table)])
    assert ran.exit_code == 3
    return table


def largest_error(model, values, table, low, high):
    """Largest |K*_model/K* - 1| in a band, in which there are twelve frequencies at least."""
    rows = pl.read_csv(table).filter(pl.col("frequency [Hz]").is_between(low, high))
    assert rows.height >= 12
    seen = rows["Re K* [N/m]"].to_numpy() + 1j * rows["Im K* [N/m]"].to_numpy()
    fitted = model_named(model).stiffness(values, 2 * np.pi * rows["frequency [Hz]"].to_numpy())
    return float(np.abs(fitted / seen - 1).max())


@pytest.mark.parametrize(
    ("model", "band", "within"), [("maxwell:5", "0.1:562.5 Hz", 0.03), ("fractional", "0.1:100 Hz", 0.016)]
)
def test_models_of_the_polymer(polymer_table, tmp_path, model, band, within):
    """As its file comes: identify, then fit. Within 3 % at every frequency with five arms, 1.6 % by 4 parameters."""
    out = tmp_path / "model.json"
    ran = CliRunner().invoke(app, ["fit", str(polymer_table), "--model", model, "--band", band, "--out", str(out)])
    assert ran.exit_code == 0
    condition = read_model_file(out).models[0].conditions[0]
    assert largest_error(model, condition.values, polymer_table, *condition.band) < within


def test_eight_arms_for_the_polymer(polymer_table):
    """Without the intervals of its 17 parameters, which take minutes."""
    data = read_measured(polymer_table).conditions[0].data
    data = data.part(np.flatnonzero(data.omega > 0.2 * np.pi))
    needed = model_discrepancy([data], always=True)
    found = choose(with_error(data, needed), ["maxwell:8"]).best.fit
    assert largest_error("maxwell:8", found.values, polymer_table, 0.1, 562.5) < 0.03
