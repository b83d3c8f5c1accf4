"""The static test as the tangent of a ramp, against an integration in time of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fourpole.core.loadcurve import LoadCurve
from fourpole.errors import ModelError
from fourpole.models.causality import check_possible, passive_range
from fourpole.models.choice import choose, fit_conditions
from fourpole.models.data import StiffnessData
from fourpole.models.families import model_named
from fourpole.models.ramp import Loop, Ramp, static_derivative, static_stiffness, takes_k1

BAND = 2 * np.pi * np.linspace(6.0, 30.0, 13)
LOW = 2 * np.pi * np.array([0.05, 0.1, 0.3, 1.0])
#: K_inf, and stiffness and relaxation time of each arm.
ZENER = (180e3, np.array([120e3]), np.array([700 / 120e3]))
THREE = (150e3, np.array([20e3, 30e3, 80e3]), np.array([3.0, 0.1, 0.004]))


def cole_cole(k0, k_inf, tau, alpha):
    """The spectrum of the fractional Zener model in closed form, on a fine grid (Cole and Cole, 1941)."""
    z = np.arange(-90.0, 90.0, 0.05)
    density = np.sin(alpha * np.pi) / (2 * np.pi * (np.cosh(alpha * z) + np.cos(alpha * np.pi)))
    return k0, (k_inf - k0) * 0.05 * density, tau * np.exp(z)


FRACTIONAL = cole_cole(150e3, 900e3, 2e-5, 0.35)


def exact_tangents(tyre, ramp):
    """Tangents of loading and unloading: arm forces by exact steps from turn to turn, and a difference quotient."""
    rest, springs, times = tyre

    def force_and_place(time):
        arms, since, sign, place = np.zeros(times.size), 0.0, 1.0, 0.0
        while since < time:
            step = min(ramp.time, time - since)
            fades = np.exp(-step / times)
            arms, place = arms * fades + sign * springs * times * (1 - fades), place + sign * step
            since, sign = since + step, -sign
        return rest * place + arms.sum(), place

    found, h = [], 1e-4 * ramp.time
    for branches, share in ((2 * ramp.cycle - 2, ramp.place), (2 * ramp.cycle - 1, 1 - ramp.place)):
        (f1, x1), (f2, x2) = (force_and_place((branches + share) * ramp.time + side * h) for side in (1, -1))
        found.append((f1 - f2) / (x1 - x2))
    return found


def stiffness(tyre, omega):
    rest, springs, times = tyre
    x = 1j * np.asarray(omega)[:, None] * times
    return rest + np.sum(springs * x / (1 + x), axis=1)


def draws(tyre, ramp, count, noise, *, factor=1.0, prior=0.05, seed=1):
    """Data of many draws, and K* without error."""
    rng = np.random.default_rng(seed)
    clean = stiffness(tyre, BAND)
    tangent = factor * np.mean(exact_tangents(tyre, ramp))
    for _ in range(count):
        off = noise * abs(clean) * (rng.standard_normal(BAND.size) + 1j * rng.standard_normal(BAND.size))
        k1 = tangent * (1 + 0.003 * rng.standard_normal())
        yield Loop(ramp, k1, 0.003 * k1, prior).joined(StiffnessData.of(BAND, clean + off, noise * abs(clean)))


@pytest.mark.parametrize("tyre", [ZENER, THREE, FRACTIONAL], ids=["zener", "three arms", "fractional"])
@pytest.mark.parametrize("ramp", [Ramp(20.0, 3, 0.4), Ramp(2.0, 1, 0.7), Ramp(100.0, 8, 0.1)])
def test_the_weighted_sum_is_the_tangent_of_the_loop(tyre, ramp):
    exact = np.mean(exact_tangents(tyre, ramp))
    omega, weights = ramp.weights()
    whole = tyre[0] + tyre[1].sum()
    assert tyre[0] + tyre[1] @ ramp.share(tyre[2]) == pytest.approx(exact, rel=1e-6)
    assert np.sum((weights * stiffness(tyre, omega)).real) == pytest.approx(exact, abs=2e-5 * whole)


@pytest.mark.parametrize("tyre", [THREE, FRACTIONAL], ids=["three arms", "fractional"])
def test_k1_of_a_recorded_loop_is_this_tangent(tyre):
    """A loop of three cycles, recorded with noise, through the reader of static tests."""
    rng, (rest, springs, times) = np.random.default_rng(3), tyre
    ramp, travel, points = Ramp(20.0, 3, 0.5), 0.02, 200
    step, speed = ramp.time / points, travel / ramp.time
    at = np.arange(6 * points + 1)
    branch, share = at // points, (at % points) / points
    place = travel * np.where(branch % 2 == 0, share, 1 - share)
    fades, arms, load = np.exp(-step / times), np.zeros(times.size), rest * place
    for row in at[1:]:
        sign = 1 if branch[row - 1] % 2 == 0 else -1
        arms = arms * fades + sign * speed * springs * times * (1 - fades)
        load[row] += arms.sum()
    curve = LoadCurve(place, load + rng.standard_normal(at.size), at * step)
    tangent = curve.tangent(0.5 * load.max())
    exact = np.mean(exact_tangents(tyre, replace(ramp, place=tangent.deflection / travel)))
    assert (curve.cycles, np.mean(curve.times)) == (3, pytest.approx(20.0, rel=0.01))
    assert abs(tangent.stiffness - exact) < 3 * tangent.std < 0.01 * exact


def test_the_sum_holds_for_every_relaxation_time_and_place():
    times = np.geomspace(1e-6, 1e8, 500)
    for cycle in (1, 2, 3, 60):
        for place in (0.05, 0.2, 0.5, 0.95):
            ramp = Ramp(10.0, cycle, place)
            omega, weights = ramp.weights()
            arms = 1 - 1 / (1 + 1j * np.outer(times, omega))
            assert abs((arms @ weights).real - ramp.share(times)).max() < 2e-4
            assert abs(weights).sum() < 10.0  # errors of K* of a model are not amplified


def test_the_derivative_is_that_of_the_tangent():
    model, values = model_named("fractional"), np.array([150e3, 900e3, 2e-5, 0.35])
    (data,) = draws(FRACTIONAL, Ramp(20.0, 3, 0.4), 1, 0.001)
    found = static_derivative(model, values, data)
    for at in range(4):
        step = np.zeros(4)
        step[at] = 1e-6 * values[at]
        rise = static_stiffness(model, values + step, data) - static_stiffness(model, values - step, data)
        assert rise / (2 * step[at]) == pytest.approx(found[at], rel=1e-4)


def test_models_that_flow_take_a_ramp_and_models_that_do_not_relax_keep_rest():
    (data,) = draws(ZENER, Ramp(20.0, 3, 0.4), 1, 0.001)
    at_rest = replace(data, static_omega=None, static_weights=None)
    structural, zener = model_named("structural"), model_named("zener")
    assert takes_k1(structural, data)
    assert static_stiffness(structural, np.array([1e5, 0.1]), data) == 1e5
    assert static_stiffness(zener, np.array([1e5, 1e5, 700.0]), at_rest) == 1e5


@pytest.mark.parametrize("factor", [1.0, 1.03])
@pytest.mark.sampled(2)
def test_intervals_below_the_band_hold_with_a_ramp_and_not_with_k1_at_rest(factor):
    exact, covered = stiffness(FRACTIONAL, LOW), {}
    for name in ("ramp", "rest"):
        data = list(draws(FRACTIONAL, Ramp(20.0, 3, 0.4), 60, 0.002, factor=factor))
        if name == "rest":
            data = [replace(one, static_omega=None, static_weights=None, k1_std=0.003 * one.k1) for one in data]
        hits = []
        for one in fit_conditions(model_named("fractional"), data):
            slopes = one.model.derivative(one.values, LOW)
            off = one.model.stiffness(one.values, LOW) - exact
            for rows, miss in ((slopes.real, off.real), (slopes.imag, off.imag)):
                hits.append(abs(miss) < 1.96 * np.sqrt(np.einsum("fp,pq,fq->f", rows, one.covariance, rows)))
        covered[name] = np.mean(hits)
    assert 0.88 <= covered["ramp"] <= 0.99  # 60 draws of 95 %
    assert covered["rest"] < 0.5


@pytest.mark.thorough
@pytest.mark.parametrize("tyre", [ZENER, THREE, FRACTIONAL], ids=["zener", "three arms", "fractional"])
@pytest.mark.sampled(2)
def test_the_range_of_all_passive_tyres_holds_the_truth(tyre):
    exact = stiffness(tyre, LOW)
    ends = np.array([passive_range(one, LOW) for one in draws(tyre, Ramp(20.0, 3, 0.4), 8, 0.003, factor=1.03)])
    truth = np.stack([exact.real, exact.imag], axis=-1)
    assert np.mean((ends[..., 0] <= truth) & (truth <= ends[..., 1])) > 0.85
    if tyre is not ZENER:  # a slow arm is possible, so that K' in the gap is not known well
        assert np.median(ends[:, 1, 0, 1] - ends[:, 1, 0, 0]) > 0.1 * exact[1].real


def test_the_factor_is_found_as_far_as_the_model_knows_the_tangent():
    loop = Loop(Ramp(20.0, 3, 0.4), 1.03 * 180e3, 0.003 * 180e3, 0.05)
    (data,) = draws(ZENER, loop.ramp, 1, 0.001, factor=1.03)
    (fit,) = fit_conditions(model_named("zener"), [data])
    tangent, slopes = static_stiffness(fit.model, fit.values, data), static_derivative(fit.model, fit.values, data)
    factor, std = loop.factor(float(tangent), float(np.sqrt(slopes @ fit.covariance @ slopes)))
    assert abs(factor - 1.03) < 3 * std < 0.02


def test_the_verdict_takes_the_ramp():
    (data,) = draws(THREE, Ramp(20.0, 3, 0.4), 1, 0.002, prior=0.0)
    assert check_possible(data).possible
    too_stiff = replace(data, k1=np.asarray(1.5 * data.k1), k1_std=np.asarray(0.003 * data.k1))
    assert check_possible(too_stiff).without_k1


def test_models_are_chosen_with_the_ramp_as_a_datum():
    conditions = list(draws(FRACTIONAL, Ramp(20.0, 3, 0.4), 2, 0.001))
    found = choose(conditions, ("structural", "zener", "fractional"))
    assert found.best.name == "fractional"
    assert np.isfinite(found.best.cross_validation)
    assert {one.fit.residuals.size for one in found.candidates} == {2 * BAND.size + 1}


def test_prony_has_times_down_to_the_ramp():
    (data,) = draws(THREE, Ramp(20.0, 3, 0.4), 1, 0.002)
    (fit,) = fit_conditions(model_named("prony:3"), [data])
    assert fit.model.times.max() > 20.0
    assert static_stiffness(fit.model, fit.values, data) == pytest.approx(float(data.k1), rel=0.1)


@pytest.mark.parametrize("arguments", [(0.0, 3, 0.5), (20.0, 0, 0.5), (20.0, 3, 0.01), (np.nan, 3, 0.5)])
def test_a_loop_that_is_none_is_refused(arguments):
    with pytest.raises(ModelError):
        Ramp(*arguments)
