"""Load-deflection curves: tangent, secant, loss and nonlinearity of laws that are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from fourpole.core.loadcurve import LoadCurve
from fourpole.errors import FourpoleError, LoadCurveError

pytestmark = pytest.mark.thorough

DEPTH = 0.03
LAW = Polynomial([0.0, 150e3, 2e6])  # [N], in m
K1 = LAW.deriv()


def polynomial(order):
    """A rising law of this order: slopes of 0.6 to 1.6 times 150 kN/m."""
    terms = [150e3 * DEPTH] + [0.2 * 150e3 * DEPTH * (-1) ** k / (k + 1) for k in range(1, order)]
    return Polynomial([0.0, *(term / DEPTH ** (k + 1) for k, term in enumerate(terms))])


def tangents(curve, law, places=(0.004, 0.012, 0.02, 0.026)):
    return np.array([curve.tangent(float(law(x))).stiffness for x in places]) / law.deriv()(np.array(places))


# Exact curves ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", ["none", "friction", "parabola", "skewed", "ellipse"])
@pytest.mark.parametrize("order", range(1, 7))
@pytest.mark.sampled(3)
def test_polynomials_with_hysteresis_are_met_exactly(load_cycles, order, shape):
    """The gap is symmetric about the mean, its shape polynomial or elliptic: nothing but round-off is left."""
    law = polynomial(order)
    curve = LoadCurve(*load_cycles(law, shape=shape))
    assert curve.cycles == 3
    assert curve.order == order
    np.testing.assert_allclose(tangents(curve, law), np.ones(4), rtol=1e-9)
    tangent = curve.tangent(float(law(0.02)))
    assert tangent.deflection == pytest.approx(0.02, rel=1e-9)
    assert tangent.by_load == pytest.approx(law.deriv(2)(0.02) / law.deriv()(0.02), rel=1e-6, abs=1e-6)
    assert tangent.fit < 1e-6 * tangent.stiffness
    assert tangent.cycles < 1e-9 * tangent.stiffness


@pytest.mark.parametrize(("up", "down", "warp"), [(201, 57, 1.0), (40, 400, 1.0), (201, 201, 1.6), (90, 150, 0.7)])
@pytest.mark.parametrize("shape", ["parabola", "ellipse"])
def test_branches_need_not_be_sampled_alike(load_cycles, up, down, warp, shape):
    """A mean over points would lean to the branch with more of them; that at equal deflection does not."""
    law = polynomial(3)
    curve = LoadCurve(*load_cycles(law, up=up, down=down, warp=warp, shape=shape, gap=400.0))
    np.testing.assert_allclose(tangents(curve, law), np.ones(4), rtol=1e-9)


@settings(max_examples=30)
@given(st.floats(-0.5, 0.5))
@pytest.mark.sampled(4)
def test_the_zero_of_the_deflection_is_arbitrary(load_cycles, zero):
    x, f = load_cycles(LAW)
    here, there = LoadCurve(x, f), LoadCurve(x + zero, f)
    # a deflection 1/2 m off keeps 0.03/0.5 of its digits: 1e-15 m of 0.03, over the 250 points of a tangent's base
    assert there.tangent(3000.0).stiffness == pytest.approx(here.tangent(3000.0).stiffness, rel=1e-11)
    assert there.tangent(3000.0).deflection - zero == pytest.approx(here.tangent(3000.0).deflection, abs=1e-12)
    assert there.secant(3000.0).stiffness == pytest.approx(here.secant(3000.0).stiffness, rel=1e-11)
    assert there.hysteresis_loss == pytest.approx(here.hysteresis_loss, rel=1e-10)
    assert there.nonlinearity == pytest.approx(here.nonlinearity, rel=1e-9)


@settings(max_examples=30)
@given(st.floats(0.1, 10.0), st.floats(0.1, 10.0))
@pytest.mark.sampled(4)
def test_scaling(load_cycles, by_load, by_deflection):
    x, f = load_cycles(LAW)
    here, there = LoadCurve(x, f), LoadCurve(by_deflection * x, by_load * f)
    one, other = here.tangent(3000.0), there.tangent(3000.0 * by_load)
    assert other.stiffness == pytest.approx(one.stiffness * by_load / by_deflection, rel=1e-10)
    assert other.loading == pytest.approx(one.loading * by_load / by_deflection, rel=1e-9)
    assert other.gap == pytest.approx(one.gap * by_load, rel=1e-9)
    assert there.hysteresis_loss == pytest.approx(here.hysteresis_loss * by_load * by_deflection, rel=1e-10)
    assert there.nonlinearity == pytest.approx(here.nonlinearity, rel=1e-9)


@pytest.mark.parametrize("cycles", [3, 5])
def test_the_first_cycle_never_enters(load_cycles, cycles):
    """A first cycle with a load 30 % higher, as of rubber not yet conditioned, leaves K1 and its uncertainty alone."""
    conditioned = LoadCurve(*load_cycles(LAW, cycles=cycles))
    fresh = LoadCurve(*load_cycles(LAW, cycles=cycles, first=1.3))
    assert fresh.tangent(3000.0) == conditioned.tangent(3000.0)
    assert fresh.hysteresis_loss == conditioned.hysteresis_loss
    assert fresh.nonlinearity == conditioned.nonlinearity
    assert fresh.measured_loads == conditioned.measured_loads


def test_of_two_cycles_the_second_counts(load_cycles):
    fresh = LoadCurve(*load_cycles(LAW, cycles=2, first=1.3))
    tangent = fresh.tangent(3000.0)
    assert tangent.stiffness == pytest.approx(K1(tangent.deflection), rel=1e-9)
    assert tangent.cycles == 0.0
    assert fresh.remarks == ()


def test_change_between_the_last_cycles(load_cycles):
    x, f = load_cycles(LAW, shape="none", cycles=4)
    f = f.copy()
    f[2 * 402 : 3 * 402] *= 1.05  # the last but one
    tangent = LoadCurve(x, f).tangent(3000.0)
    # at 3000 N the stiffer cycle deflects less, to where the law carries 3000/1.05 N
    softer = (-150e3 + np.sqrt(150e3**2 + 8e6 * 3000 / 1.05)) / 4e6
    change = 1.05 * K1(softer) - K1(tangent.deflection)
    assert tangent.cycles == pytest.approx(abs(change) / np.sqrt(12), rel=1e-6)
    assert tangent.std == pytest.approx(np.hypot(tangent.cycles, np.hypot(tangent.fit, tangent.zero)), rel=1e-12)


def test_the_gap_of_the_branches_is_a_result_and_no_uncertainty(load_cycles):
    x = 0.02
    tangent = LoadCurve(*load_cycles(LAW, gap=200.0)).tangent(float(LAW(x)))
    place = 2 * x / DEPTH - 1
    apart = 200 * -2 * place * (2 / DEPTH)  # slope of 200 (1 - u²), u = 2x/D - 1
    assert (tangent.loading, tangent.unloading) == pytest.approx((K1(x) + apart, K1(x) - apart), rel=1e-6)
    assert tangent.gap == pytest.approx(2 * 200 * (1 - place**2), rel=1e-6)
    assert tangent.std < 1e-6 * tangent.stiffness


def test_a_shift_of_the_load_is_an_uncertainty_of_its_zero(load_cycles):
    """The load of the last of four cycles is 60 N higher: 240 N over the test, any part of it an error of the zero."""
    x, f = load_cycles(LAW, shape="none", cycles=4)
    f = f + 60.0 * (np.arange(f.size) >= 3 * 402)
    curve = LoadCurve(x, f)
    tangent = curve.tangent(3000.0)
    assert curve.shift == pytest.approx(60.0, rel=1e-6)
    # the bend of the curve over 240 N makes it a little more than dK1/dF
    assert tangent.zero == pytest.approx(tangent.by_load * 240.0 / np.sqrt(3), rel=0.03)


def test_a_drift_does_not_cancel_where_the_branches_differ_in_duration(load_cycles):
    """30 s up, 10 s down, and a load cell that drifts by 2 N/s: the mean's slope is off by (30 - 10) s · 2 N/s / 2D."""
    x, f = load_cycles(LAW, shape="none", cycles=4)
    time = np.concatenate([40.0 * n + np.append(np.linspace(0, 30, 201), np.linspace(30, 40, 201)) for n in range(4)])
    curve = LoadCurve(x, f + 2.0 * time, time)
    assert curve.times == pytest.approx((30.0, 10.0))
    tangent = curve.tangent(3000.0)
    assert tangent.stiffness - K1(tangent.deflection) == pytest.approx(20 * 2 / (2 * DEPTH), rel=1e-3)
    assert tangent.zero > np.hypot(tangent.by_load * curve.zero_std, 20 * 2 / (2 * DEPTH) / np.sqrt(3)) * 0.99
    there = float(np.interp(3000.0, f[:201], x[:201]))  # the zero has moved by 240 N and more in the last cycle
    assert abs(tangent.stiffness - K1(there)) < 2 * tangent.std


@pytest.mark.parametrize("cycles", [4, 6, 10])
def test_a_zero_that_wanders_counts_by_its_largest_change(load_cycles, cycles):
    """120 N of a sine that stands still between the last two cycles, which therefore show nothing of it."""
    x, f = load_cycles(LAW, cycles=cycles)
    place = np.linspace(0.0, 1.0, f.size)
    still = 1.0 - 1.0 / cycles
    curve = LoadCurve(x, f + 120.0 * np.cos(1.3 * 2.0 * np.pi * (place - still)))
    tangent = curve.tangent(3000.0)
    true = float(K1((-150e3 + np.sqrt(150e3**2 + 8e6 * 3000)) / 4e6))
    assert abs(tangent.stiffness - true) < 3.0 * tangent.std
    assert curve.zero_std > 3.0 * cycles * abs(curve.shift)


@pytest.mark.parametrize(("drift", "said"), [(0.0, False), (20.0, False), (300.0, True), (-300.0, True)])
def test_a_load_that_creeps_is_said(load_cycles, drift, said):
    """A load that fades is taken as that of rubber; where it fades by more than 1 % of the span, the remark says so."""
    x, f = load_cycles(LAW, cycles=5)
    curve = LoadCurve(x, f + drift * (1.0 - np.exp(-2.0 * np.linspace(0.0, 1.0, f.size))))
    assert any("from the second to the last cycle" in remark for remark in curve.remarks) == said


def test_rubber_that_has_relaxed_leaves_no_uncertainty(load_cycles):
    """Six cycles, a Maxwell arm of 15 % that fades within one of them: the last cycles are alike."""
    x, f = load_cycles(LAW, cycles=6, shape="none")
    arm = np.zeros_like(f)
    fade = float(np.exp(-1.0 / 402))
    for i, step in enumerate(np.diff(f), start=1):
        arm[i] = fade * arm[i - 1] + step
    tangent = LoadCurve(x, f + 0.15 * arm).tangent(3500.0)
    assert tangent.std < 2e-3 * tangent.stiffness


def test_a_drift_shows_in_two_cycles_too(load_cycles):
    x, f = load_cycles(LAW, shape="none", cycles=2)
    curve = LoadCurve(x, f + np.linspace(0.0, 200.0, f.size))
    assert curve.shift == pytest.approx(100.0, rel=0.05)
    tangent = curve.tangent(3000.0)
    there = float(np.interp(3000.0, f[:201], x[:201]))
    assert abs(tangent.stiffness - K1(there)) < 2 * tangent.std


def test_times_of_the_branches(load_cycles):
    x, f = load_cycles(LAW)
    assert LoadCurve(x, f).times == ()
    assert LoadCurve(x[:201], f[:201], 0.1 * np.arange(201)).times == pytest.approx((20.0,))
    shuffled = np.random.default_rng(0).permutation(201)
    assert LoadCurve(x[:201][shuffled], f[:201][shuffled], 0.1 * np.arange(201)).times == ()


def test_the_loss_has_the_uncertainty_of_noise_and_drift(load_cycles):
    """30 draws of 20 N of white noise: the loss scatters as its uncertainty says (± 13 %, the root of 1/60)."""
    x, f = load_cycles(LAW)
    rng = np.random.default_rng(3)
    curves = [LoadCurve(x, f + 20.0 * rng.standard_normal(f.size)) for _ in range(30)]
    noise = np.sqrt(2 * 200) * 20.0 * DEPTH / 200
    assert np.std([curve.hysteresis_loss for curve in curves]) == pytest.approx(noise, rel=0.5)
    assert np.median([curve.loss_std for curve in curves]) == pytest.approx(noise, rel=0.5)


def test_a_record_that_starts_loaded(load_cycles):
    x, f = load_cycles(LAW, cycles=2)
    whole = LoadCurve(x, f)
    backwards = LoadCurve(x[201:603], f[201:603])  # unloading, then loading
    assert backwards.cycles == 1
    assert backwards.tangent(3000.0).stiffness == pytest.approx(whole.tangent(3000.0).stiffness, rel=1e-9)
    assert backwards.hysteresis_loss == pytest.approx(whole.hysteresis_loss, rel=1e-9)


@pytest.mark.parametrize("part", [slice(0, 201), slice(201, 402)], ids=["loading", "unloading"])
def test_a_single_branch_gives_its_own_tangent_and_says_so(load_cycles, part):
    x, f = load_cycles(LAW, cycles=1)
    curve = LoadCurve(x[part], f[part])
    side = 1.0 if part.start == 0 else -1.0
    law = LAW + side * 200 * (1 - (Polynomial([-1, 2 / DEPTH])) ** 2)
    np.testing.assert_allclose(tangents(curve, law), np.ones(4), rtol=1e-9)
    assert curve.cycles == 0
    assert curve.measured == ("loading" if side > 0 else "unloading")
    assert np.isnan(curve.hysteresis_loss)
    tangent = curve.tangent(3000.0)
    assert tangent.cycles == 0.0
    own = {"loading": tangent.loading, "unloading": tangent.unloading}
    assert own.pop(curve.measured) == tangent.stiffness
    assert np.isnan([*own.values(), tangent.gap]).all()


def test_one_cycle_is_used_with_a_remark(load_cycles):
    curve = LoadCurve(*load_cycles(LAW, cycles=1))
    np.testing.assert_allclose(tangents(curve, LAW), np.ones(4), rtol=1e-9)
    assert "one complete cycle only" in curve.remarks[0]


def test_points_in_no_order():
    x = np.random.default_rng(0).uniform(0.0, DEPTH, 60)
    curve = LoadCurve(x, LAW(x))
    assert (curve.cycles, curve.measured) == (0, "points")
    np.testing.assert_allclose(tangents(curve, LAW), np.ones(4), rtol=1e-9)


def test_a_table_of_five_points_gives_a_line():
    x = np.linspace(0.0, DEPTH, 5)
    assert LoadCurve(x, 150e3 * x).tangent(2000.0).stiffness == pytest.approx(150e3, rel=1e-12)


# The ends of the curve ------------------------------------------------------------------------------------------


def test_no_extrapolation(load_cycles):
    curve = LoadCurve(*load_cycles(LAW, shape="none"))
    top = float(LAW(DEPTH))
    assert curve.measured_loads == pytest.approx((0.0, top), abs=1e-9)
    for load in (0.0, top):
        assert curve.tangent(load).stiffness == pytest.approx(K1(0.0 if load == 0 else DEPTH), rel=1e-9)
    for load in (-1.0, top + 1.0, 1e6, np.nan):
        for question in (curve.tangent, curve.secant):
            with pytest.raises(LoadCurveError, match=r"lies outside the measured loads.*no extrapolation") as caught:
                question(load)
    assert isinstance(caught.value, FourpoleError)
    assert isinstance(caught.value, ValueError)


def test_a_load_at_the_edge_of_a_loop_is_answered(load_cycles):
    """The largest load of a loop may lie a little past the end of the mean of its branches."""
    curve = LoadCurve(*load_cycles(LAW, shape="skewed", gap=20.0))
    highest = curve.measured_loads[1]
    tangent = curve.tangent(highest)
    assert tangent.deflection <= DEPTH * 1.02
    assert tangent.stiffness == pytest.approx(K1(DEPTH), rel=0.01)


def test_a_load_far_past_the_mean_is_refused(load_cycles):
    """Friction of 2000 N: loads were measured that the mean of the branches never has."""
    curve = LoadCurve(*load_cycles(LAW, shape="friction", gap=2000.0))
    with pytest.raises(LoadCurveError, match="the mean of the branches does not reach 8000 N"):
        curve.tangent(8000.0)


def test_a_curve_with_a_dip_is_read_where_it_first_rises_to_the_load():
    """It falls between 13.8 and 20.9 mm and rises again, so that loads there are met three times."""
    law = Polynomial([0.0, 200e3, -1.2e7, 2.3e8])
    x = np.linspace(0.0, DEPTH, 301)
    curve = LoadCurve(x, law(x))
    dip, top = law(0.0209), law(0.0138)
    for load in np.linspace(0.0, curve.measured_loads[1], 41):
        tangent = curve.tangent(float(load))
        assert law(tangent.deflection) == pytest.approx(load, abs=1e-8)
        assert tangent.stiffness == pytest.approx(law.deriv()(tangent.deflection), abs=1e-3)
        assert tangent.deflection < 0.0139 if load < top - 1 else tangent.deflection > 0.0209
    assert dip < top


def test_secant(load_cycles):
    curve = LoadCurve(*load_cycles(LAW))
    for x in (0.005, 0.02, 0.03):
        assert curve.secant(float(LAW(x))).stiffness == pytest.approx(LAW(x) / x, rel=1e-9)
        assert curve.secant(float(LAW(x))).reason == ""


def test_secant_from_just_above_zero():
    """A curve whose least load is below 0.5 % of its span is continued to zero, at most 2 % of the deflection."""
    x = np.linspace(0.0, DEPTH, 301)
    curve = LoadCurve(x, LAW(x) + 20.0)
    zero = -20.0 / K1(0.0)
    assert curve.secant(3000.0).stiffness == pytest.approx(3000 / (curve.tangent(3000.0).deflection - zero), rel=1e-4)


def test_no_secant_where_the_curve_starts_loaded():
    x = np.linspace(0.0, DEPTH, 301)
    curve = LoadCurve(x, LAW(x) + 400.0)
    secant = curve.secant(3000.0)
    assert np.isnan(secant.stiffness)
    assert secant.reason == "the curve starts at 400 N: no point of zero load"
    assert curve.tangent(3000.0).stiffness > 0


def test_free_travel_before_contact(load_cycles):
    """10 mm of air, then the law: neither tangent nor secant know of the air."""
    law = lambda x: np.where(x < 0.01, 0.0, LAW(np.maximum(x - 0.01, 0.0)))  # noqa: E731
    x, f = load_cycles(law, depth=0.04, shape="none", up=401, down=401)
    curve = LoadCurve(x, f)
    tangent = curve.tangent(3000.0)
    assert tangent.stiffness == pytest.approx(K1(tangent.deflection - 0.01), rel=1e-9)
    assert curve.secant(3000.0).stiffness == pytest.approx(3000 / (tangent.deflection - 0.01), rel=1e-9)
    rng = np.random.default_rng(0)
    noisy = LoadCurve(x, f + 5 * rng.standard_normal(x.size)).tangent(3000.0)
    assert abs(noisy.stiffness - tangent.stiffness) < 4 * noisy.std


# Loss and nonlinearity ------------------------------------------------------------------------------------------


def test_loss_of_an_ellipse(load_cycles):
    """An ellipse with half axes D/2 and 200 N; a polygon of 2·2000 points misses about 1/N^1.5 of it, 1e-5."""
    curve = LoadCurve(*load_cycles(LAW, shape="ellipse", up=2001, down=2001))
    assert curve.hysteresis_loss == pytest.approx(np.pi * 0.5 * DEPTH * 200.0, rel=2e-5)


@pytest.mark.parametrize(("shape", "area"), [("none", 0.0), ("friction", 2.0), ("parabola", 4 / 3), ("skewed", 4 / 3)])
def test_loss_of_other_loops(load_cycles, shape, area):
    """Twice the mean gap over -1 < u < 1; the trapezoidal rule of 200 steps is off by 1/200² times the end slopes."""
    curve = LoadCurve(*load_cycles(LAW, shape=shape))
    assert curve.hysteresis_loss == pytest.approx(2 * area * 200 * DEPTH / 2, rel=1e-4, abs=1e-9)


def test_loss_is_positive_whatever_the_sampling(load_cycles):
    x, f = load_cycles(LAW, up=60, down=333, warp=1.4, gap=100.0)
    # two trapezoidal rules with different steps of the law itself, off by its curvature times step² each
    assert LoadCurve(x, f).hysteresis_loss == pytest.approx(4 / 3 * 100 * DEPTH, rel=0.02)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.5])
def test_nonlinearity_of_a_quadratic(load_cycles, share):
    """Departure of (1-s) u + s u² from its line through 10 and 90 % of the load: at an end, or where slopes agree."""
    top = 5000.0
    law = Polynomial([0.0, (1 - share) * top / DEPTH, share * top / DEPTH**2])
    u = [
        (load if share == 0 else (share - 1 + np.sqrt((1 - share) ** 2 + 4 * share * load)) / (2 * share))
        for load in (0.1, 0.9)
    ]
    slope = 0.8 / (u[1] - u[0])
    inner = (slope - 1 + share) / (2 * share) if share else 0.5
    at = np.array([0.0, 1.0, inner])
    departure = np.max(np.abs((1 - share) * at + share * at**2 - (0.1 + slope * (at - u[0]))))
    curve = LoadCurve(*load_cycles(law, depth=DEPTH))
    assert curve.nonlinearity == pytest.approx(departure, abs=1e-5)  # looked for at 401 places: step²/8 of the bend


# Imperfect data -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("noise", "shape"), [(5.0, "parabola"), (50.0, "ellipse")])
@pytest.mark.sampled(2)
def test_fit_uncertainty_is_honest(load_cycles, noise, shape):
    """White noise in the load: errors over their uncertainties, which also have the orders that the data leave open.

    Of 30 draws the root mean square is 1 ± 0.13; orders in doubt may make the uncertainty twice as large.
    """
    x, f = load_cycles(LAW, shape=shape, up=101, down=101)
    errors, seeds = [], 30
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        tangent = LoadCurve(x, f + noise * rng.standard_normal(x.size)).tangent(3000.0)
        errors.append((tangent.stiffness - K1((-150e3 + np.sqrt(150e3**2 + 8e6 * 3000)) / 4e6)) / tangent.fit)
    assert 0.35 < np.sqrt(np.mean(np.square(errors))) < 1.4
    assert abs(np.mean(errors)) < 4 * np.std(errors) / np.sqrt(seeds)


# Loops with a known tangent -------------------------------------------------------------------------------------


def flat_friction(place, side):
    """Friction of ± 1 that turns over within 2 % of the way after each turn."""
    since = np.where(side > 0, place, 1.0 - place)
    return side * (1.0 - 2.0 * np.exp(-since / 0.02))


def relaxing(place, side):
    """A Maxwell arm under ramps, in steady cycles: its force fades over 0.3 of a branch."""
    since = np.where(side > 0, place, 1.0 - place)
    fade = np.exp(-1.0 / 0.3)
    return side * (1.0 - 2.0 * np.exp(-since / 0.3) / (1.0 + fade))


LOOPS = {
    "flat friction": (flat_friction, lambda x: 0.0 * x),
    "viscoelastic": (relaxing, lambda x: 0.0 * x),
    "S-shaped": (lambda place, side: 4 * side * place * (1 - place), lambda x: 400.0 * np.tanh((x - 0.014) / 0.004)),
}


def known(shape, x0):
    """Load of the mean of both branches at a deflection, and its tangent, by differences of the formulas."""
    gap, bump = LOOPS[shape]
    mean = lambda x: LAW(x) + bump(x) + 60.0 * (gap(x / DEPTH, 1.0) + gap(x / DEPTH, -1.0))  # noqa: E731
    return float(mean(x0)), float(mean(x0 + 1e-6) - mean(x0 - 1e-6)) / 2e-6


def cycles_of(shape, up=201, down=201, cycles=3):
    gap, bump = LOOPS[shape]
    place = np.concatenate([np.linspace(0, 1, up), np.linspace(1, 0, down)])
    side = np.repeat([1.0, -1.0], [up, down])
    x = DEPTH * place
    return np.tile(x, cycles), np.tile(LAW(x) + bump(x) + 120.0 * gap(place, side), cycles)


@pytest.mark.parametrize("branches", [(201, 201), (60, 400)])
@pytest.mark.parametrize("shape", LOOPS)
@pytest.mark.sampled(2)
def test_clean_loops_have_their_tangent_within_three_u_and_a_small_u(shape, branches):
    x, f = cycles_of(shape, *branches)
    for x0 in (0.009, 0.015, 0.021):
        load, true = known(shape, x0)
        tangent = LoadCurve(x, f).tangent(load)
        assert tangent.std < 2e-3 * true
        assert abs(tangent.stiffness - true) < 3 * tangent.std


@pytest.mark.statistical
@pytest.mark.parametrize("shape", LOOPS)
@pytest.mark.sampled(3)
def test_noise_resolution_and_drift_are_in_the_uncertainty(shape):
    """12 N of noise, steps of 8 N and 0.03 mm, or a drift of 300 N in 60 s: of 12 errors none beyond 3.5 u."""
    load, true = known(shape, 0.016)
    x, f = cycles_of(shape)
    errors = []
    for seed in range(4):
        noise = 12.0 * np.random.default_rng(seed).standard_normal(f.size)
        drift = np.linspace(0.0, 300.0, f.size)
        stepped = 3e-5 * np.round(x / 3e-5), 8.0 * np.round((f + 0.1 * noise) / 8.0)
        for curve in (LoadCurve(x, f + noise), LoadCurve(*stepped), LoadCurve(x, f + 0.1 * noise + drift)):
            tangent = curve.tangent(load)
            errors.append((tangent.stiffness - true) / tangent.std)
    assert np.max(np.abs(errors)) < 3.5
    assert np.sqrt(np.mean(np.square(errors))) < 2.0


def steps(order, points, rng, noise=80.0, own=0.0):
    """A straight line of 130 N/mm at seven loads, held in an order of their numbers."""
    level = np.linspace(200.0, 1600.0, 7)[list(order)]
    each = -(-points // level.size)
    x = np.repeat(level / 130e3, each)
    error = np.repeat(own * rng.standard_normal(level.size), each) + noise * rng.standard_normal(x.size)
    return x, 130e3 * x + error


ORDERS = {
    "rising": (range(7), "loading"),
    "there and back": ([*range(7), *range(5, -1, -1)], "mean"),
    "none": ([3, 1, 6, 2, 5, 0, 4], "points"),
}


@pytest.mark.statistical
@pytest.mark.parametrize("order", ORDERS)
def test_a_straight_line_at_seven_loads_in_noise(order):
    """80 N of white noise, 400 points: the straight line alone has 1.1 N/mm; twenty draws give ± 16 %."""
    levels, measured = ORDERS[order]
    errors, stds = [], []
    for seed in range(20):
        curve = LoadCurve(*steps(levels, 400, np.random.default_rng(seed)))
        assert curve.measured == measured
        tangent = curve.tangent(900.0)
        errors.append(tangent.stiffness - 130e3)
        stds.append(tangent.std)
    assert np.sqrt(np.mean(np.square(errors))) < 2e3
    assert 0.5 < np.sqrt(np.mean(np.square(np.array(errors) / stds))) < 2.0


@pytest.mark.statistical
def test_an_error_of_each_step_is_no_white_noise():
    """30 N of error for each of seven rests besides 80 N of noise: 2.6 N/mm, thrice what white noise would have."""
    draws = [LoadCurve(*steps(range(7), 400, np.random.default_rng(seed), own=30.0)) for seed in range(20)]
    found = [curve.tangent(900.0) for curve in draws]
    assert np.median([one.std for one in found]) > 2e3
    assert np.mean([abs(one.stiffness - 130e3) < 2 * one.std for one in found]) > 0.7


def test_gains_of_the_sensors():
    """The load's gain g moves F and the place at which it is read: dK1/dg = K1 - F dK1/dF; the deflection's -K1."""
    x = np.linspace(0.0, DEPTH, 301)
    tangent = LoadCurve(x, LAW(x)).tangent(3000.0)
    step = 1e-4
    by_load = [LoadCurve(x, (1 + g) * LAW(x)).tangent(3000.0).stiffness for g in (step, -step)]
    by_deflection = [LoadCurve((1 + g) * x, LAW(x)).tangent(3000.0).stiffness for g in (step, -step)]
    expected = np.hypot(
        0.01 * (by_load[0] - by_load[1]) / (2 * step), 0.02 * (by_deflection[0] - by_deflection[1]) / (2 * step)
    )
    assert tangent.std_with_gains(0.01, 0.02) == pytest.approx(expected, rel=1e-6)
    assert tangent.std_with_gains(0.0, 0.0) == tangent.std


@pytest.mark.parametrize("wave", [lambda s: np.sqrt(2.0) * np.sin(np.pi * s), lambda s: np.sqrt(30.0) * s * (1 - s)])
def test_a_departure_from_a_straight_line_moves_k1_by_its_slope(wave):
    """A departure over the range of 0.1 % as its standard deviation: a half wave, or a parabola."""
    x, size = np.linspace(0.0, DEPTH, 2001), 1e-3
    whole = 150e3 * DEPTH
    bent = LoadCurve(x, 150e3 * x + size * whole * wave(x / DEPTH))
    errors = [bent.tangent(load).stiffness - 150e3 for load in np.linspace(0.01, 0.99, 50) * whole]
    expected = LoadCurve(x, 150e3 * x).tangent(0.5 * whole).std_by_linearity(size, 0.0)
    assert expected == pytest.approx(np.pi * size * 150e3)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(expected, rel=0.05)


def test_missing_points_are_left_out_and_said(load_cycles):
    x, f = load_cycles(LAW)
    x, f = x.copy(), f.copy()
    x[7::50], f[31::50] = np.nan, np.inf
    curve = LoadCurve(x, f)
    np.testing.assert_allclose(tangents(curve, LAW), np.ones(4), rtol=1e-9)
    assert curve.missing == pytest.approx(0.04, abs=0.002)
    assert curve.remarks == ("4 % of the points are missing and were left out",)


def test_spikes_are_left_out_and_said(load_cycles):
    x, f = load_cycles(LAW)
    spiky = f + 2 * np.random.default_rng(0).standard_normal(f.size)
    spiky[[850, 1000, 1100]] += [3000.0, -1500.0, 8000.0]
    curve = LoadCurve(x, spiky)
    assert curve.outliers == 3
    assert "3 points lie far off the curve" in curve.remarks[0]
    tangent = curve.tangent(3000.0)
    assert abs(tangent.stiffness - K1(tangent.deflection)) < 4 * tangent.fit + 1e-3 * tangent.stiffness
    assert LoadCurve(x, f).outliers == 0


def test_a_clipped_load_cell_is_said(load_cycles):
    x, f = load_cycles(LAW, shape="none")
    curve = LoadCurve(x, np.minimum(f, 5000.0))
    reached = (-150e3 + np.sqrt(150e3**2 + 8e6 * 5000)) / 4e6
    assert curve.flat_top == pytest.approx(1 - reached / DEPTH, abs=0.01)
    assert any("the load cell was clipped" in remark for remark in curve.remarks)
    assert not any("clipped" in remark for remark in LoadCurve(x, f).remarks)


@pytest.mark.parametrize(
    ("x", "f", "says"),
    [
        ([0, 1, 2, 3], [0, 1, 2, 3], "the curve has 4 points, at least 5 are needed"),
        ([], [], "the curve has 0 points"),
        ([0, 1, 2, 3, 4, np.nan], [0, 1, np.nan, 3, 4, 5], "the curve has 4 points"),
        ([1, 1, 1, 1, 1], [0, 1, 2, 3, 4], "load or deflection does not change"),
        ([0, 1, 2, 3, 4], [7, 7, 7, 7, 7], "load or deflection does not change"),
        ([0, 1, 2, 3, 4], [0, 0, 0, 0, 0], "load or deflection does not change"),
        ([0, 1, 2, 3, 4], [0, -1, -2, -3, -4], "the load falls as the deflection grows: .* invert = true"),
    ],
)
def test_curves_that_are_none(x, f, says):
    with pytest.raises(LoadCurveError, match=says):
        LoadCurve(np.array(x, dtype=float), np.array(f, dtype=float))


# To be drawn ----------------------------------------------------------------------------------------------------


def test_loop_and_mean_curve(load_cycles):
    x, f = load_cycles(LAW, up=2001, down=2001, first=1.3)
    curve = LoadCurve(x, f)
    loop_x, loop_f = curve.loop()
    assert 160 <= loop_x.size < 320
    recorded = set(zip(x[2 * 4002 - 1 :], f[2 * 4002 - 1 :], strict=True))  # of the last cycle alone
    assert set(zip(loop_x, loop_f, strict=True)) <= recorded
    assert 4001 <= curve.loop(points=10**6)[0].size <= 4003  # the turns belong to both branches
    mean_x, mean_f = curve.mean_curve(points=31)
    assert mean_x[[0, -1]].tolist() == pytest.approx([0.0, DEPTH])
    np.testing.assert_allclose(mean_f, LAW(mean_x), atol=1e-8)


def test_a_deeper_first_cycle_never_enters_either(load_cycles):
    """Conditioning to 40 mm, then four cycles to 30 mm, which alone are the test."""
    deep_x, deep_f = load_cycles(LAW, depth=0.04, cycles=1, first=1.3)
    x, f = load_cycles(LAW, cycles=4)
    curve = LoadCurve(np.concatenate([deep_x, x]), np.concatenate([deep_f, f]))
    assert curve.tangent(3000.0).stiffness == pytest.approx(LoadCurve(x, f).tangent(3000.0).stiffness, rel=1e-9)
    assert curve.measured_loads == pytest.approx(LoadCurve(x, f).measured_loads)


@pytest.mark.parametrize("zero", [0.0, 0.01])
def test_cycles_of_few_points_by_hand(load_cycles, zero):
    """A table of six points a branch, as written down at a press."""
    x, f = load_cycles(lambda d: 150e3 * d + 1e6 * d**2, up=6, down=6, shape="none", zero=zero)
    exact = np.sqrt(150e3**2 + 4e6 * 3000.0)
    assert LoadCurve(x, f).tangent(3000.0).stiffness == pytest.approx(exact, rel=1e-9)


def test_friction_makes_no_spikes(load_cycles):
    """A loop whose load jumps where the motion turns, as that of a bushing does."""
    assert LoadCurve(*load_cycles(LAW, shape="friction")).remarks == ()


def test_no_secant_at_zero_load():
    x = np.linspace(0.0, DEPTH, 301)
    secant = LoadCurve(x, LAW(x)).secant(0.0)
    assert np.isnan(secant.stiffness)
    assert secant.reason
