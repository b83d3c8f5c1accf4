"""The figure of rides: spectra with bands, or accelerations and loads over time."""

import numpy as np
import pytest
from tests.ride.test_compare import BODY, SPEED, tyres

from fourpole.core.confidence import NORMAL_95
from fourpole.plot.data import Role
from fourpole.plot.layout import command_figure
from fourpole.plot.ride import draw_ride, ride_figure
from fourpole.ride.compare import compare_in_time, compare_on_class
from fourpole.ride.road import ClassRoad, cleat


@pytest.fixture(scope="module")
def spectra():
    return compare_on_class(BODY, tyres(), ClassRoad.of("C"), SPEED, (10.0, 10.0))


def test_spectra_have_the_bands_of_their_models(spectra):
    data = ride_figure(spectra, ["one", "two"], ["a car"])
    plain, weighted = data.panels
    assert [one.title for one in data.panels] == ["acceleration at the seat", "weighted by Wk"]
    assert (data.names, data.notes) == (("one", "two"), ("a car",))
    assert all(one.spread is not None for one in data.series)
    ride, std = spectra.spectra[1]
    series = plain.series[1]
    at = int(np.argmax(series.y))
    there = int(np.argmax(ride.spectrum))
    assert (series.x[at], series.y[at]) == pytest.approx((ride.frequency[there], ride.spectrum[there]))
    assert series.spread[at] == pytest.approx(NORMAL_95 * std[there])
    assert weighted.series[0].y.max() == pytest.approx(spectra.spectra[0][0].weighted_spectrum.max())
    assert plain.y.label == "spectrum [m²/s³]"


def test_rides_in_time_are_lines():
    heights = cleat(0.01, 0.3).in_time(SPEED, 1e-3, after=0.5)[None]
    found = compare_in_time(BODY, tyres(), heights, 1e-3, (10.0, 10.0))
    data = ride_figure(found, ["one", "two"])
    acceleration, load = data.panels
    assert {one.role for one in (*acceleration.series, *load.series)} == {Role.LINE}
    assert (acceleration.y.label, load.y.label) == ("weighted acceleration [m/s²]", "dynamic wheel load [kN]")
    shown = acceleration.series[0].x.size
    assert 300 < shown < heights.shape[1]
    rest = np.array([one.weighted[shown:] for one in found.series])
    assert np.abs(rest).max() <= 0.005 * max(np.abs(one.weighted).max() for one in found.series)
    assert data.notes == ("until 0.5 % of the largest is left",)


def test_of_many_tyres_the_first_ones_are_shown(spectra):
    many = compare_on_class(BODY, tyres()[:1] * 8, ClassRoad.of("C"), SPEED, (10.0,) * 8)
    data = ride_figure(many, [f"tyre {at}" for at in range(8)])
    assert len(data.panels[0].series) == 6
    assert data.notes == ("6 of 8 tyres shown",)


@pytest.mark.parametrize(("form", "begin"), [("svg", b"<?xml"), ("png", b"\x89PNG"), ("pdf", b"%PDF")])
@pytest.mark.sampled(3)
def test_the_file_has_each_format(spectra, form, begin):
    made = command_figure(draw_ride(ride_figure(spectra, ["<b>one</b>", "two"])), "ride", form)
    assert made.startswith(begin)
    assert b"<b>one" not in made


def test_of_a_long_ride_the_part_about_the_largest_acceleration_is_shown():
    heights = ClassRoad.of("C").realisation(12.0, 1e-3, SPEED, seed=2)[None]
    found = compare_in_time(BODY, tyres(), heights, 1e-3, (10.0, 10.0))
    data = ride_figure(found, ["one", "two"])
    series = data.panels[0].series[0]
    assert np.ptp(series.x) == pytest.approx(3.0, abs=2e-3)
    assert np.abs(series.y).max() == pytest.approx(np.abs(found.series[0].weighted).max())
    assert "the 3 s about the largest weighted acceleration of the first tyre" in data.notes
