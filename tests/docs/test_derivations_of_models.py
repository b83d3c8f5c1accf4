"""The equations of the theory pages on K1, models, signals and estimates, derived again from their definitions.

The theorem of docs/paper-could-not-see.md is here: C of the paper's arm does not rise with frequency.
"""

import mpmath
import numpy as np
import pytest
import sympy as sp

from fourpole import LoadCurve, maxwell_arm
from fourpole.models.data import StiffnessData
from fourpole.models.discrepancy import model_discrepancy
from fourpole.models.fractional import FractionalZener
from fourpole.models.maxwell import GeneralisedMaxwell, Prony
from fourpole.models.ramp import Ramp

j, mp, mpf = sp.I, mpmath.mp, mpmath.mpf

pytestmark = pytest.mark.thorough

k, tau, t, w, u = sp.symbols("K tau t omega u", positive=True)


# The theorem


@pytest.mark.sampled(4)
def test_c_cannot_rise_for_two_arms_of_any_stiffness_and_time():
    """Two arms and a damper beside K1 = K* at rest: d(1/C)/d(omega²) is a quotient of positive terms."""
    a, b, short, longer, damper = sp.symbols("A B p q c", positive=True)
    times = short, short + longer  # the second arm is the slower one
    arms = (
        sum(one * j * w * time / (1 + j * w * time) for one, time in zip((a, b), times, strict=True)) + j * w * damper
    )
    inverse = 1 / sp.together(arms)
    imaginary = sp.cancel(sp.together((inverse - inverse.subs(j, -j)) / (2 * j)))
    of_square = sp.cancel((-w * imaginary).subs(w, sp.sqrt(u)))
    over, under = sp.fraction(sp.cancel(sp.together(sp.diff(of_square, u))))
    signs = [{sp.sign(one) for one in sp.Poly(part, a, b, short, longer, u, damper).coeffs()} for part in (over, under)]
    assert signs[0] == signs[1]
    assert len(signs[0]) == 1


def test_one_arm_has_a_constant_c():
    arm = k * j * w * tau / (1 + j * w * tau)
    assert sp.simplify(-1 / (w * sp.im(1 / arm)) - k * tau) == 0


def test_the_energy_of_one_arm_has_a_maximum_though_its_c_is_constant():
    arm = sp.expand(k * j * w * tau / (1 + j * w * tau), complex=True)
    slope = sp.factor(sp.diff(sp.simplify(arm.as_real_imag()[1]), w))  # tau = C/K2
    assert sp.solve(slope, w) == [1 / tau]
    assert sp.simplify(slope.subs(w, 1 / (2 * tau))).is_positive
    assert sp.simplify(-slope.subs(w, 2 / tau)).is_positive


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.sampled(2)
def test_the_steps_of_the_proof_hold_for_rational_tyres_and_any_k1(damped):
    """Zeros are real and simple, residues are positive and sum to 1/h, for exact numbers; C from them falls."""
    rng = np.random.default_rng(5)
    for _ in range(6):
        count = int(rng.integers(1, 5))
        times = [sp.Rational(int(one), 1000) for one in rng.choice(np.arange(1, 2000), count, replace=False)]
        springs = [sp.Rational(int(one)) for one in rng.integers(1, 50, count)]
        damper = sp.Rational(int(damped), 20)
        wrong = sp.Rational(int(rng.integers(-40, 90)), 1)  # K1 less K* at rest
        z = sp.Symbol("z")
        h = sum(a * z * b / (1 + z * b) for a, b in zip(springs, times, strict=True)) + z * damper - wrong
        top, bottom = sp.fraction(sp.cancel(sp.together(h)))
        top = sp.Poly(top, z)
        if top.degree() < count + damped:
            continue  # h at infinity is exactly zero
        assert sp.Poly(bottom, z).degree() == count
        assert sp.gcd(top, top.diff()).degree() == 0
        assert top.count_roots() == top.degree() == count + damped
        zeros = [sp.N(one, 40) for one in top.real_roots()]
        residues = [1 / sp.diff(h, z).subs(z, one) for one in zeros]
        assert min(residues) > 0
        assert sum(bool(one > 0) for one in zeros) == bool(wrong > 0 and (damped or wrong < sum(springs)))
        frequency = sp.Rational(7, 3)
        far = sp.S.Zero if damped else 1 / (sum(springs) - wrong)
        by_parts = far + sum(r / (j * frequency - one) for r, one in zip(residues, zeros, strict=True))
        assert abs(sp.N(by_parts * h.subs(z, j * frequency) - 1, 30)) < 1e-25
        inverse_c = sum(r * frequency**2 / (frequency**2 + one**2) for r, one in zip(residues, zeros, strict=True))
        assert abs(sp.N(inverse_c + frequency * sp.im(sp.N(1 / h.subs(z, j * frequency), 40)), 30)) < 1e-25


def test_c_falls_for_random_tyres_and_any_k1_and_k2_rises_below_rest():
    rng = np.random.default_rng(1982)
    omega = 2 * np.pi * np.geomspace(0.1, 1000.0, 60)
    falls_of_k2 = 0
    for _ in range(400):
        count = int(rng.integers(2, 9))
        springs, times = 80e3 * rng.random(count), 10.0 ** rng.uniform(-4, 2, count)
        stiffness = GeneralisedMaxwell(count).stiffness([110e3, *springs, *times], omega)
        for k1 in (110e3, 110e3 * (1 - rng.random()), 110e3 + springs.sum() * 1.2 * rng.random()):
            k2, c = maxwell_arm(stiffness, k1, omega)
            # Round-off of K* - K1, and what it makes of the compliance of the arm.
            off = 4 * np.finfo(float).eps * np.abs(stiffness) / np.abs(stiffness - k1) ** 2
            assert np.all(np.diff(1 / c) > -2 * (omega * off)[1:]), (springs, times, k1)
            assert np.all(c > 0)
            if k1 <= 110e3:
                assert np.all(np.diff(k2) > -2 * np.maximum((k2**2 * off)[1:], (k2**2 * off)[:-1]))
            else:
                falls_of_k2 += bool(np.any(np.diff(k2[k2 > 0]) < 0))
    assert falls_of_k2 > 100


def test_the_creep_compliance_is_the_answer_to_a_constant_force():
    """s times the Laplace transform of J(t) is 1/h(s); all its terms are positive."""
    mp.dps = 40
    springs, times = [mpf(90), mpf(20)], [mpf(3) / 10, mpf(4) / 1000]

    def h(z):
        return sum(a * z * b / (1 + z * b) for a, b in zip(springs, times, strict=True))

    slow = mp.findroot(h, (mpf(-1) / times[1] * 0.9, mpf(-1) / times[0] * 1.1), solver="anderson")
    residue, level, flow = 1 / mp.diff(h, slow), 1 / sum(springs), 1 / mp.diff(h, 0)
    assert min(residue, level, flow) > 0
    assert slow < 0

    def creep(time):
        return level + time * flow + residue / abs(slow) * (1 - mp.exp(slow * time))

    for z in (mpf(2), mpf(37)):
        transform = mp.quad(lambda time, z=z: creep(time) * mp.exp(-z * time), [0, 1 / z, 10 / z, 80 / z])
        assert abs(z * transform * h(z) - 1) < 1e-12


def test_a_passive_sum_has_rising_storage_and_falling_loss_over_frequency():
    storage, loss = (
        sp.simplify(one) for one in sp.expand(k * j * w * tau / (1 + j * w * tau), complex=True).as_real_imag()
    )
    assert sp.simplify(storage - k * w**2 * tau**2 / (1 + w**2 * tau**2)) == 0
    assert sp.factor(sp.diff(storage, w)).is_positive
    assert sp.factor(-sp.diff(sp.simplify(loss / w), w)).is_positive


# K1


def test_the_tangent_at_a_load_and_its_parts():
    x, g, load = sp.symbols("x g F0", positive=True)
    curve = sp.Function("P")
    place = sp.Function("x0")(load)
    implied = sp.diff(curve(place), load)
    slope = sp.solve(implied - 1, sp.diff(place, load))[0]  # P(x0) = F0
    derivative = sp.diff(curve(x), x, 2).subs(x, place) * slope
    assert sp.simplify(derivative - (sp.diff(curve(x), x, 2) / sp.diff(curve(x), x)).subs(x, place)) == 0
    a, b = 150e3, 1e6  # P = a x + b x²: the load reads (1 + g) P, so that K1 is read at the true load F0/(1 + g)
    at_true = sp.sqrt(a**2 + 4 * b * load / (1 + g))
    by_gain = float(sp.diff((1 + g) * at_true, g).subs({g: 0, load: 2000}))
    deflection = np.linspace(0.0, 0.03, 301)
    tangent = LoadCurve(deflection, a * deflection + b * deflection**2).tangent(2000.0)
    assert np.isclose(tangent.by_load, 2 * b / tangent.stiffness, rtol=1e-6)
    assert np.isclose(tangent.stiffness - 2000.0 * tangent.by_load, by_gain, rtol=1e-6)
    extra = tangent.std_with_gains(0.01, 0.02) ** 2 - tangent.std**2
    assert np.isclose(extra, (0.01 * by_gain) ** 2 + (0.02 * tangent.stiffness) ** 2, rtol=1e-6)


@pytest.mark.sampled(4)
def test_an_arm_in_a_loop_that_repeats():
    """The arm's force f' = K v - f/tau on loading and f' = -K v - f/tau on unloading, periodic over 2 T."""
    v, whole, part = sp.symbols("v T s", positive=True)
    first = sp.Symbol("f0")
    up = k * tau * v + (first - k * tau * v) * sp.exp(-t / tau)
    assert sp.simplify(sp.diff(up, t) + up / tau - k * v) == 0
    start = sp.solve(sp.Eq(up.subs(t, whole), -first), first)[0]  # unloading is loading with the sign changed
    up = sp.simplify(up.subs(first, start))
    at, back = part * whole, (1 - part) * whole  # times at one deflection, on loading and on unloading
    tangent = (sp.diff(up, t).subs(t, at) + sp.diff(up, t).subs(t, back)) / (2 * k * v)
    share = sp.cosh((sp.Rational(1, 2) - part) * whole / tau) / sp.cosh(whole / (2 * tau))
    assert sp.simplify((tangent - share).rewrite(sp.exp)) == 0
    gap = up.subs(t, at) + up.subs(t, back)
    assert sp.simplify((gap - 2 * k * tau * v * (1 - share)).rewrite(sp.exp)) == 0
    half = sp.nsolve(sp.cosh(1 / (2 * u)) - 2, u, 0.4)
    assert f"{half:.2f}" == "0.38"
    for place, time in ((0.5, 0.3), (0.2, 2.0)):
        exact = float(share.subs({part: place, whole: 1, tau: time}))
        assert np.isclose(Ramp(1.0, 50, place).share(time), exact, rtol=1e-9)


def test_the_gap_of_a_flat_spectrum_does_not_depend_on_the_speed():
    times = np.geomspace(1e-6, 1e9, 3001)

    def gap(branch):  # of equal arms, per unit of the stroke, at 0.3 of the branch
        near, far = 0.2 * branch / times, 0.5 * branch / times
        share = np.exp(near - far) * (1 + np.exp(-2 * near)) / (1 + np.exp(-2 * far))  # cosh over cosh
        return 2 * np.sum(times / branch * (1 - share))

    assert abs(gap(20.0) / gap(2.0) - 1) < 1e-4


def test_a_loop_that_begins_at_rest():
    place, cycle, time = 0.4, 3, 1.7
    force, slopes = 0.0, []
    for branch in range(2 * cycle):
        sign = 1.0 if branch % 2 == 0 else -1.0
        since = place if sign > 0 else 1.0 - place
        slopes.append((sign - force / time) * np.exp(-since / time) * sign)  # f' at this time, over the speed
        force = sign * time + (force - sign * time) * np.exp(-1.0 / time)
    assert np.isclose(Ramp(1.0, cycle, place).share(time), np.mean(slopes[-2:]), rtol=1e-12)


# Models


@pytest.mark.parametrize("alpha", [0.2, 0.5, 0.9])
@pytest.mark.sampled(3)
def test_the_fractional_model_is_a_positive_sum_of_arms(alpha):
    mp.dps = 20
    order = mpf(alpha)

    def share(x):
        return mp.sin(mp.pi * order) / (mp.cosh(order * x) + mp.cos(mp.pi * order)) / (2 * mp.pi)

    ends = [-400, -40, -10, 0, 10, 40, 400]
    assert abs(mp.quad(share, ends) - 1) < 1e-12
    for omega in (0.3, 5.0):
        made = mp.quad(lambda x, w=1j * omega: share(x) * w * mp.exp(x) / (1 + w * mp.exp(x)), ends)
        (found,) = FractionalZener().stiffness([0.0, 1.0, 1.0, alpha], [omega])
        assert abs(complex(made) - found) < 1e-9


def test_the_ripple_of_a_flat_spectrum():
    omega = np.geomspace(1.0, 100.0, 2000)
    for per_decade in (1, 2):
        times = np.logspace(8.0, -10.0, 18 * per_decade + 1)
        loss = Prony(per_decade, times).stiffness([0.0, *np.ones(times.size), *times], omega).imag
        ripple = np.max(loss) / np.mean(loss[:-1]) - 1
        first = 2 / np.cosh(np.pi**2 * per_decade / np.log(10.0))
        second = 2 / np.cosh(2 * np.pi**2 * per_decade / np.log(10.0))
        assert abs(ripple - first) < second + 1e-3 * first


def test_least_squares_with_a_common_relative_error_is_drawn_down():
    y1, y2, e = sp.symbols("y1 y2 epsilon", positive=True)
    data, ones = sp.Matrix([y1, y2]), sp.ones(2, 1)
    weight = (u**2 * sp.eye(2) + e**2 * data * data.T).inv()
    found = (ones.T * weight * data)[0] / (ones.T * weight * ones)[0]
    page = (y1 + y2) / 2 / (1 + e**2 * (y1 - y2) ** 2 / (2 * u**2))
    assert sp.simplify(found - page) == 0


def test_model_discrepancy_is_the_excess_of_the_scatter():
    off = np.array([3.0, -2.0, 2.5, -3.5, 1.0, -1.5]) * 1e3  # departures of K' from a model of no parameters
    data = StiffnessData.of(2 * np.pi * np.arange(10.0, 16.0), np.full(6, 200e3) + 0j, 1e3)

    def misfit(conditions):
        (one,) = conditions
        return float(np.sum(off**2 / one.covariance[:, 0, 0])), off.size

    chi2, dof = misfit([data])
    exact = 1e3 * np.sqrt(chi2 / dof - 1) / 200e3
    assert abs(model_discrepancy([data], misfit) / exact - 1) < 0.01  # the search ends within 1 % of chi-square


# Estimates


def test_a_projection_and_an_elimination_are_the_least_over_what_is_linear():
    rng = np.random.default_rng(2)
    drive, own, shared, residual = (rng.normal(size=(12, n)) for n in (2, 4, 3, 1))
    everything = np.hstack([drive, own, shared])
    least = np.linalg.lstsq(everything, residual, rcond=None)[0]
    frame = np.linalg.qr(np.hstack([drive, own]))[0]
    columns, rest = (one - frame @ (frame.T @ one) for one in (shared, residual))
    fisher = columns.T @ columns + np.eye(3)  # and the statement, one unit each
    prior = np.zeros((9, 9))
    prior[6:, 6:] = np.eye(3)
    whole = np.linalg.inv(everything.T @ everything + prior)
    assert np.allclose(np.linalg.inv(fisher), whole[6:, 6:])
    assert np.allclose(np.linalg.lstsq(columns, rest, rcond=None)[0], least[6:])
    # log K* of the conditions: own part and what the shared values do to it
    away = np.linalg.qr(drive)[0]
    k_columns, z_columns = (one - away @ (away.T @ one) for one in (own, shared))
    lead = np.linalg.lstsq(k_columns, z_columns, rcond=None)[0]
    own_part = np.linalg.inv(k_columns.T @ k_columns)
    assert np.allclose(whole[2:6, 2:6], own_part + lead @ np.linalg.inv(fisher) @ lead.T)


def test_paule_and_mandel_for_equal_covariances():
    n, scatter, variance = sp.symbols(
        "n S v", positive=True
    )  # S: sum of squares over 2(n - 1), real and imaginary part
    found = sp.solve(sp.Eq(2 * (n - 1) * scatter / (u**2 + variance), 2 * (n - 1)), variance)[0]
    assert sp.simplify(found - (scatter - u**2)) == 0


# Signals


def test_variances_of_amplitude_phase_and_frequency():
    """The information of a sine in white noise, averaged over its phase, with time from a place of the record."""
    count, sigma, size, length, shift, angle = sp.symbols("N sigma A T t0 theta", positive=True)
    x = size * sp.cos(angle)
    by = [sp.cos(angle), -size * sp.sin(angle), -size * sp.sin(angle) * (t - shift)]  # by amplitude, phase, frequency
    assert sp.diff(x, size) == by[0]
    information = sp.zeros(3)
    for i in range(3):
        for j in range(3):
            over_phase = sp.integrate(by[i] * by[j], (angle, 0, 2 * sp.pi)) / (2 * sp.pi)
            over_time = sp.integrate(over_phase, (t, 0, length)) / length
            information[i, j] = sp.simplify(count / sigma**2 * over_time)
    middle, start = (sp.simplify(information.subs(shift, at).inv()) for at in (length / 2, 0))
    assert sp.simplify(middle[0, 0] - 2 * sigma**2 / count) == 0
    assert sp.simplify(middle[2, 2] - 24 * sigma**2 / (count * size**2 * length**2)) == 0
    assert middle[1, 2] == 0
    assert sp.simplify(sp.sqrt(start[1, 1] / middle[1, 1]) - 2) == 0


def test_third_harmonics_are_a_third_of_what_they_give_to_the_fundamental():
    angle = sp.Symbol("theta", real=True)

    def of_sign(n):  # the sign of cos over half a period is +1 up to pi/2 and -1 beyond
        halves = [sp.integrate(sp.cos(n * angle), (angle, *ends)) for ends in ((0, sp.pi / 2), (sp.pi / 2, sp.pi))]
        return 2 * (halves[0] - halves[1]) / sp.pi

    assert of_sign(1) == 4 / sp.pi
    assert of_sign(3) == -sp.Rational(4, 3) / sp.pi
    cube = (sp.exp(j * angle) + sp.exp(-j * angle)) ** 3 / 8
    series = sp.Rational(3, 4) * sp.cos(angle) + sp.Rational(1, 4) * sp.cos(3 * angle)
    assert sp.expand(cube - series.rewrite(sp.exp)) == 0


def test_the_inverse_of_an_estimated_covariance_is_too_large():
    """For nu complex bins and p channels by nu/(nu - p): exact for one channel, by draws for three."""
    nu = sp.Symbol("nu", positive=True, integer=True)
    x = sp.Symbol("x", positive=True)
    inverse = sp.integrate(nu / x * x ** (nu - 1) * sp.exp(-x) / sp.gamma(nu), (x, 0, sp.oo), conds="none")
    assert sp.simplify(inverse.rewrite(sp.gamma) - nu / (nu - 1)) == 0
    rng = np.random.default_rng(30)
    bins = (rng.standard_normal((4000, 3, 30)) + 1j * rng.standard_normal((4000, 3, 30))) / np.sqrt(2)
    estimated = bins @ np.conj(np.swapaxes(bins, 1, 2)) / 30
    trace = np.trace(np.linalg.inv(estimated), axis1=1, axis2=2).real / 3
    assert abs(trace.mean() - 30 / 27) < 4 * trace.std() / np.sqrt(trace.size)


def test_an_alias_cannot_be_told_from_a_true_line():
    rate, samples = 100.0, np.arange(50)
    for frequency, times in ((130.0, 1), (270.0, 3)):
        seen = abs(frequency - times * rate)
        assert np.allclose(np.cos(2 * np.pi * frequency * samples / rate), np.cos(2 * np.pi * seen * samples / rate))
