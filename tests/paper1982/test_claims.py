"""The claims of the 1982 paper at the edges of what they ask for."""

from types import SimpleNamespace

import pytest

from fourpole.core.condition import AXES
from fourpole.findings.facts import Curve, Estimate, _nominal
from fourpole.paper1982 import claims as readings
from fourpole.paper1982.claims import Lack, LackError, Need
from fourpole.quantities import K1, K2, NONLINEARITY, C

LOADS, BAND = (1000.0, 2000.0), (14.0, 17.5, 22.0)


def known(values, u=1e-6):
    return {key: Estimate(value, u * value) for key, value in values.items()}


def tyre(role="cross-ply", values=None, **more):
    """A tyre with the values of some quantities, by their keys."""
    return SimpleNamespace(role=role, values=(values or {}).get, **more)


def over(f, pressures, loads=LOADS, frequencies=(10.0, 12.0, 14.0)):
    return known({(p, load, at): f(p, load, at) for p in pressures for load in loads for at in frequencies})


@pytest.mark.parametrize(("more", "holds"), [(1.001, True), (1.0, False), (0.999, False)])
def test_above_means_above_at_every_condition(more, holds):
    lower = known({(1e5, 1000.0): 100.0, (2e5, 1000.0): 100.0})
    upper = known({(1e5, 1000.0): 100.0 * more, (2e5, 1000.0): 150.0})
    found = readings.above(K1, tyre(values={K1: upper}), tyre(values={K1: lower}))
    assert found.holds is holds
    with pytest.raises(LackError) as lack:
        readings.above(K1, tyre(values={K1: lower}), tyre(values={K1: {}}))
    assert lack.value.lack == Lack(Need.BOTH, K1)


@pytest.mark.parametrize(("u", "sure"), [(0.01, True), (0.05, False)])
def test_above_is_sure_where_each_difference_is_beyond_its_uncertainty(u, sure):
    values = ({(1e5, 1000.0): x} for x in (110.0, 100.0))
    assert readings.above(K1, *(tyre(values={K1: known(v, u)}) for v in values)).sure is sure


@pytest.mark.parametrize(("times", "holds"), [(3.001, True), (2.999, False)])
def test_markedly_non_linear_is_more_than_three_times(times, holds):
    a, b = (tyre(values={NONLINEARITY: known({(1e5,): x, (2e5,): x})}) for x in (0.01 * times, 0.01))
    assert readings.nonlinear(a, b).holds is holds


@pytest.mark.parametrize(("slope", "holds"), [(1e-6, True), (-1e-6, False)])
def test_rising_means_rising_on_every_line(slope, holds):
    values = over(lambda p, load, f: 100.0 + (slope if load == 1000.0 else 0.1) * f, (1e5,))
    assert readings.rising(C, values, "frequency").holds is holds
    with pytest.raises(LackError) as lack:
        readings.rising(C, over(lambda *_: 1.0, (1e5, 2e5)), "pressure", "cross-ply")
    assert lack.value.lack == Lack(Need.THREE_PRESSURES, C, "cross-ply")


def test_the_band_of_claim_6_allows_for_the_tolerance_of_a_frequency():
    values = known({(1e5, 1000.0, f): 1.0 for f in (9.79, 9.81, 24.47, 24.49)})
    assert [key[2] for key in readings.in_band(values)] == [9.81, 24.47]


@pytest.mark.parametrize(("top", "holds"), [(156.1e3, True), (155.9e3, False), (179.9e3, True), (180.1e3, False)])
def test_the_optimum_is_within_12_kpa_of_168(top, holds):
    pressures = sorted({100e3, 130e3, top, 200e3, 240e3})
    found = readings.optimum(tyre(values={C: over(lambda p, *_: 1000.0 - abs(p - top) / 1e3, pressures)}))
    assert found.holds is holds
    assert (found.effect, found.unit) == (pytest.approx(top), "Pa")


@pytest.mark.parametrize("pressures", [(156.1e3, 170e3, 240e3), (100e3, 170e3, 179.9e3), (100e3, 200e3)])
def test_an_optimum_needs_pressures_on_both_sides(pressures):
    with pytest.raises(LackError) as lack:
        readings.optimum(tyre(values={C: over(lambda *_: 1000.0, pressures)}))
    assert lack.value.lack.need is Need.OPTIMUM


@pytest.mark.parametrize(
    ("low", "high", "holds"),
    [(0.0, 0.0301, True), (0.0, 0.0299, False), (0.0199, 0.06, True), (0.0201, 0.06, False), (-0.0201, 0.06, False)],
)
def test_loads_are_apart_by_three_per_cent_and_hardly_is_a_third_of_it(low, high, holds):
    gap = {1e5: low, 2e5: high}
    c = over(lambda p, load, f: 1000.0 * (1 + gap[p] * (load == 1000.0)), (1e5, 2e5))
    assert readings.loads_apart(*(tyre(values={C: c}) for _ in range(2))).holds is holds


def turning_tyre(slopes, frequencies=BAND):
    slope = dict(zip(frequencies, slopes, strict=True))
    pressures = (100e3, 150e3, 200e3)
    k2 = over(lambda p, load, f: 100e3 + slope[f] * (p - 150e3), pressures, frequencies=frequencies)
    return tyre(values={K2: k2})


@pytest.mark.parametrize(
    ("slopes", "holds"),
    [
        ((-0.1, 0.0, 0.1), True),
        ((-0.1, 0.0499, 0.1), True),
        ((-0.1, 0.0501, 0.1), False),
        ((0.1, 0.0, 0.1), False),
        ((-0.1, 0.0, -0.1), False),
    ],
)
def test_k2_turns_where_it_falls_then_hardly_changes_then_rises(slopes, holds):
    found = readings.turning(turning_tyre(slopes))
    assert found.holds is holds
    assert found.effect == pytest.approx(slopes[2])


@pytest.mark.parametrize(
    "frequencies", [(16.1, 17.5, 22.0), (14.0, 16.4, 22.0), (14.0, 18.6, 22.0), (14.0, 17.5, 19.0)]
)
def test_the_bands_of_claim_8_have_edges(frequencies):
    with pytest.raises(LackError) as lack:
        readings.turning(turning_tyre((-0.1, 0.0, 0.1), frequencies))
    assert lack.value.lack == Lack(Need.BANDS, K2, "cross-ply")
    assert readings.turning(turning_tyre((-0.1, 0.0, 0.1), (16.0, 18.5, 19.1))).holds


def test_like_the_radial_ply_means_all_three_parts():
    def both(level, rise):
        def k2(p, load, f):
            return level + rise * (f - 10.0) + {14.0: -0.1, 17.5: 0.0, 22.0: 0.1}[f] * (p - 150e3)

        return tyre(values={K2: over(k2, (100e3, 150e3, 200e3), frequencies=BAND)})

    assert readings.likewise(both(200e3, 3e3), both(100e3, 3e3)).holds
    assert not readings.likewise(both(100e3, 3e3), both(200e3, 3e3)).holds
    assert not readings.likewise(both(200e3, -2e3), both(100e3, 3e3)).holds


@pytest.mark.parametrize(("f", "told"), [(16.81, False), (16.79, True)])
def test_tr_is_compared_only_clear_of_the_crossing(f, told):
    def tr(below, beyond):
        return known({(p, 1000.0, at): below if at < 18.0 else beyond for p in (100e3, 170e3) for at in (f, 19.21)})

    pair = tyre(tr=tr(1.0, 2.0)), tyre("radial-ply", tr=tr(2.0, 1.0))
    if told:
        assert readings.isolation(*pair).holds
        assert not readings.isolation(*pair[::-1]).holds
    else:
        with pytest.raises(LackError) as lack:
            readings.isolation(*pair)
        assert lack.value.lack.need is Need.SIDES


def test_tr_is_compared_at_the_pressures_nearest_to_the_papers():
    values = known({(p, 1000.0, f): 1.0 for p in (100e3, 135e3, 170e3, 240e3) for f in (14.0, 22.0)})
    assert readings.isolation(tyre(tr=values), tyre(tr=values)).evidence.pressures == (100e3, 170e3)


@pytest.mark.parametrize(("at", "holds"), [(14.0, True), (16.0, False), (18.0, False)])
def test_the_lower_resonance_is_that_of_the_largest_tr(at, holds):
    def curves(top):
        f = (12.0, 14.0, 16.0, 18.0, 20.0)
        return {(1e5, 1000.0): Curve(f, tuple(3.0 - 0.01 * abs(x - top) for x in f), (1e-3,) * 5)}

    facts = SimpleNamespace(nominal={"frequency": {}})
    found = readings.resonance(tyre(curves=curves(16.0), facts=facts), tyre(curves=curves(at), facts=facts))
    assert found.holds is holds
    assert (found.effect, found.unit) == (pytest.approx(16.0 - at), "Hz")


def test_a_pressure_is_shown_as_that_of_tests_that_are_used():
    """Three tests at 1.70 bar are rejected: 1.73 bar, which is the same within 2 %, is shown as 1.73 bar."""
    values, axis = [1.70e5, 1.70e5, 1.70e5, 1.73e5, 2.0e5], AXES[0]
    assert _nominal(values, axis, {1.73e5}) == {1.70e5: 1.73e5, 1.73e5: 1.73e5, 2.0e5: 2.0e5}
    assert _nominal(values, axis, {1.70e5, 1.73e5})[1.73e5] == 1.70e5  # the median of the four
