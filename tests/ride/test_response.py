"""Rides in the frequency domain against closed forms, Lyapunov's equation, differences and drawn models."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov
from tests.ride.test_vehicle import HALF

from fourpole.errors import ModelError
from fourpole.models import FractionalZener, GeneralisedMaxwell, KelvinVoigt, Spring, Structural, Zener
from fourpole.ride.comfort import weighting_system
from fourpole.ride.compare import Tyre, effects, relative_difference, spectrum_std, standard
from fourpole.ride.response import Condensed, frequencies_of, names, ride, transfers
from fourpole.ride.road import ClassRoad
from fourpole.ride.time import whole_system
from fourpole.ride.vehicle import HalfCar, QuarterCar

CAR = (250.0, 37.5, 15825.0, 1500.0)
ZENER = np.array([180e3, 120e3, 700.0])
MAXWELL = np.array([150e3, 20e3, 40e3, 60e3, 0.5, 0.02, 1e-3])
SPEED = 80 / 3.6
#: A road of all frequencies: its velocity is white.
WHITE = ClassRoad(64e-6, 2.0, 1e-5, 1e3)


def of(model, values, body=None, road=None, speed=SPEED, count=2048):
    body = QuarterCar(*CAR).body if body is None else body
    road = ClassRoad.of("C") if road is None else road
    omega = 2 * np.pi * frequencies_of(road, speed, count)
    return ride(body, model.stiffness(values, omega), road, speed)


def test_an_elastic_tyre_has_the_closed_form_of_the_quarter_car():
    r"""White velocity S (two-sided, per rad/s times 2 pi): ∫|H|² = (k_t c/m_s² + (m_s + m_u) k²/(c m_s²))/2."""
    ms, mu, k, c = CAR
    kt = 180e3
    found = of(Spring(), [kt], road=WHITE, count=65536)
    velocity = (2 * np.pi * 0.1) ** 2 * WHITE.level * SPEED  # one-sided, per Hz
    closed = 0.5 * velocity * 0.5 * (kt * c / ms**2 + (ms + mu) * k**2 / (c * ms**2))
    assert found.values[1] == pytest.approx(np.sqrt(closed), rel=1e-4)


@pytest.mark.parametrize("wheels", [1, 2])
@pytest.mark.parametrize(("model", "values"), [(KelvinVoigt(), (180e3, 300.0)), (Zener(), ZENER)])
def test_white_velocity_has_the_variance_of_lyapunovs_equation(model, values, wheels):
    """The variance of states under white noise; of both wheels at once, whose lag no such equation knows: none here."""
    body = QuarterCar(*CAR).body if wheels == 1 else HalfCar(**HALF).body
    system = whole_system(body, model.state_space(values))
    size, weight = len(system.a), weighting_system()
    # heights are integrals of white noise; the inertial coordinates drift, so take heights relative to the road
    together = np.ones((wheels, 1))
    n = len(body.mass)
    shift = np.zeros((size, 1))
    shift[:n, 0] = body_translation(body)
    noise = system.e @ together - shift  # ẋ_relative = A x_relative + noise · w
    accel, tail = system.c[:1], len(weight.a)
    a = np.block([[system.a, np.zeros((size, tail))], [weight.b @ accel, weight.a]])
    b = np.vstack([noise, np.zeros((tail, 1))])
    covariance = solve_continuous_lyapunov(a, -b @ b.T)
    velocity = 0.5 * (2 * np.pi * 0.1) ** 2 * WHITE.level * SPEED
    row = np.hstack([weight.d @ accel, weight.c])
    plain = np.pad(accel, ((0, 0), (0, tail)))
    wanted = [(one @ covariance @ one.T)[0, 0] for one in (row, plain)]
    still = type(body)(**{**vars(body), "behind": np.zeros(wheels)})
    found = of(model, values, body=still, road=WHITE, count=65536)
    assert found.values[:2] == pytest.approx(np.sqrt(velocity * np.array(wanted)), rel=1e-4)


def body_translation(body):
    """Coordinates when the whole vehicle is lifted by 1 m."""
    n, wheels = len(body.mass), body.wheels
    lifted = np.zeros(n)
    lifted[0], lifted[n - wheels :] = 1.0, 1.0
    return lifted


def test_a_kelvin_voigt_tyre_has_the_transfer_functions_of_the_textbook():
    ms, mu, k, c = CAR
    frequency = np.geomspace(0.3, 60, 50)
    s = 2j * np.pi * frequency
    tyre, strut = 180e3 + 300.0 * s, k + c * s
    whole = (mu * s**2 + strut + tyre) * (ms * s**2 + strut) - strut**2
    found, _ = transfers(Condensed.of(QuarterCar(*CAR).body, s.imag), tyre, np.zeros(1))
    assert found.acceleration == pytest.approx(s**2 * tyre * strut / whole, rel=1e-10)
    wheel = tyre * (ms * s**2 + strut) / whole
    assert found.deflection[:, 0] == pytest.approx(1 - wheel, rel=1e-9)
    assert found.load[:, 0] == pytest.approx(tyre * (1 - wheel), rel=1e-9)
    assert found.travel[:, 0] == pytest.approx(wheel - tyre * strut / whole, rel=1e-9)


def test_a_symmetrical_half_car_without_lag_is_two_quarter_cars():
    """With inertia m a b the ends of the body are independent masses."""
    ms, mu, k, c = CAR
    half = HalfCar(2 * ms, 2 * ms * 1.4**2, 1.4, 1.4, mu, mu, k, k, c, c, seat_ahead=1.4).body
    found = of(Zener(), ZENER, body=half).values
    wanted = of(Zener(), ZENER).values
    assert found == pytest.approx(wanted[[0, 1, 2, 2, 3, 3, 4]] * np.array([1, 1, 1, 1, 1, 1, 2]), rel=1e-9)
    assert len(names(2)) == found.size


def test_the_power_lost_is_the_power_of_the_road():
    """What the tyres and the dampers lose, the road gives: K'' of the whole as the wheel feels it."""
    found = of(Zener(), ZENER, body=QuarterCar(*CAR[:3], 0.0).body)
    omega = 2 * np.pi * found.frequency
    road = ClassRoad.of("C")
    t, _ = transfers(Condensed.of(QuarterCar(*CAR[:3], 0.0).body, omega), Zener().stiffness(ZENER, omega), np.zeros(1))
    given = np.sum(
        omega * t.load[:, 0].imag * road.spectrum_in_time(found.frequency, SPEED) * np.gradient(found.frequency)
    )
    assert found.values[-1] == pytest.approx(given, rel=2e-3)  # no damper: all is lost in the tyre


@pytest.mark.parametrize("wheels", [1, 2])
@pytest.mark.parametrize(("model", "values"), [(Zener(), ZENER), (FractionalZener(), (150e3, 400e3, 1e-3, 0.4))])
def test_derivatives_are_those_of_differences(model, values, wheels):
    body = QuarterCar(*CAR).body if wheels == 1 else HalfCar(**HALF).body
    values = np.array(values)
    found = of(model, values, body)
    tyre = Tyre(model, values, {"each": np.diag(1e-2 * values)})
    by = effects(found, tyre)["each"]
    for at in range(values.size):
        h = np.zeros(values.size)
        h[at] = 1e-5 * values[at]
        slope = (of(model, values + h, body).values - of(model, values - h, body).values) / 2e-5 * 1e-2
        assert by[at] == pytest.approx(slope, rel=1e-6, abs=1e-9 * found.values.max())
    spectrum = (of(model, values + h, body).spectrum - of(model, values - h, body).spectrum) / 2e-5 * 1e-2
    assert spectrum_std(found, Tyre(model, values, {"last": h[:, None] * 1e3})) == pytest.approx(
        np.abs(spectrum), rel=1e-4, abs=1e-9 * found.spectrum.max()
    )


@pytest.mark.statistical
@pytest.mark.parametrize("wheels", [1, 2])
@pytest.mark.parametrize(
    ("model", "values", "relative"), [(Zener(), ZENER, (0.03, 0.1, 0.1)), (GeneralisedMaxwell(3), MAXWELL, (0.03,) * 7)]
)
@pytest.mark.sampled(4)
def test_the_uncertainty_is_the_spread_of_drawn_models(model, values, relative, wheels):
    """450 draws know a standard deviation to 3.3 %: within 10 % is three of these."""
    rng = np.random.default_rng(8)
    body = QuarterCar(*CAR).body if wheels == 1 else HalfCar(**HALF).body
    root = rng.normal(size=(values.size, values.size))
    root *= (np.array(relative) * values / np.sqrt(np.sum(root**2, axis=1)))[:, None]
    tyre = Tyre(model, values, {"fit": root})
    stated = standard(effects(found := of(model, values, body, count=1024), tyre), found.values.size)
    drawn = of(model, values + rng.normal(size=(450, values.size)) @ root.T, body, count=1024)
    assert drawn.values.shape == (450, found.values.size)
    spread = np.std(drawn.values, axis=0, ddof=1)
    assert stated == pytest.approx(spread, rel=0.1)


@pytest.mark.statistical
def test_the_uncertainty_of_a_difference_is_the_spread_of_drawn_pairs():
    """Two tyres with a gain in common and errors of their own; 450 draws know a standard deviation to 3.3 %."""
    rng = np.random.default_rng(12)
    first, second = ZENER, ZENER * np.array([1.06, 1.0, 1.02])
    gain = 0.02 * np.array([1.0, 1.0, 1.0])
    own = np.diag([0.004, 0.02, 0.02])
    tyres = [
        Tyre(Zener(), one, {"gain": (gain * one)[:, None], f"fit {at}": own * one[:, None]})
        for at, one in enumerate((first, second))
    ]
    rides = [of(Zener(), one.values, count=1024) for one in tyres]
    apart, std = relative_difference(*((r.values, effects(r, t)) for r, t in zip(rides, tyres, strict=True)))
    draws = rng.normal(size=(450, 1))
    values = [
        of(Zener(), one * (1 + draws * gain + rng.normal(size=(450, 3)) @ own), count=1024).values
        for one in (first, second)
    ]
    assert std == pytest.approx(np.std(values[1] / values[0], axis=0, ddof=1), rel=0.1)
    assert apart == pytest.approx(np.mean(values[1] / values[0], axis=0) - 1, abs=3 * std.max() / np.sqrt(450) + 2e-4)
    alone = [standard(effects(r, t), r.values.size) / r.values for r, t in zip(rides, tyres, strict=True)]
    assert std[0] < 0.7 * np.hypot(*alone)[0]  # the gain cancels


def test_a_discrepancy_counts_at_all_frequencies_at_once():
    found = of(Zener(), ZENER)
    tyre = Tyre(Zener(), ZENER, discrepancy=(0.01, 0.02), name="a")
    (by,) = effects(found, tyre).values()
    h = 1e-5
    road = ClassRoad.of("C")
    k = tyre.stiffness(2 * np.pi * found.frequency)
    body = QuarterCar(*CAR).body
    for at, turn in enumerate((1.0, 1j)):
        slope = (
            (ride(body, k * (1 + h * turn), road, SPEED).values - ride(body, k * (1 - h * turn), road, SPEED).values)
            / 2
            / h
        )
        assert by[at] == pytest.approx(0.01 * (at + 1) * slope, rel=1e-6, abs=1e-9)


def test_the_share_outside_a_band_is_that_of_the_mean_square():
    found = of(Zener(), ZENER)
    assert found.share_outside(0.0, 1e3) == 0.0
    below, above = found.share_outside(12.0, 1e3), found.share_outside(0.0, 12.0)
    assert below + above == pytest.approx(1.0, abs=1e-9)
    assert 0.3 < below < 0.9


def test_more_frequencies_change_nothing():
    assert of(Zener(), ZENER).values == pytest.approx(of(Zener(), ZENER, count=20000).values, rel=1e-5)


def test_a_model_that_is_not_causal_is_refused_with_the_remedy():
    with pytest.raises(ModelError, match=r"structural model of B is not causal.*--model prony"):
        Tyre(Structural(), np.array([180e3, 0.1]), name="B")


def test_speed_zero_is_refused():
    with pytest.raises(ModelError, match="not positive"):
        frequencies_of(ClassRoad.of("C"), 0.0)
