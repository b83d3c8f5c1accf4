"""The Payne effect: the kraus family against rubbers of other formulas, and amplitude told from frequency."""

from dataclasses import replace

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models.choice import fit_conditions
from fourpole.models.data import StiffnessData
from fourpole.models.families import automatic, by_amplitude, contains
from fourpole.models.kraus import MOST_INFLATION, Kraus, separation
from fourpole.models.profile import profile_intervals

LEVELS = np.array([0.1e-3, 0.5e-3, 2e-3])
FREQUENCY = np.geomspace(1.0, 60.0, 9)
NOISE = 0.002
#: Parameters of the family itself.
TRUTH = np.array([150e3, 250e3, 3e-3, 0.5, 80e3, 20e3, 0.5e-3, 0.55, 0.08, 0.05])


def plateaus(f, x):
    """Kraus's law with plateaus that grow with ln f, and a loss that does not vanish at large amplitudes."""
    y = (x / 0.45e-3) ** 0.55
    small, large = 240e3 * (1 + 0.06 * np.log(f / 10)), 145e3 * (1 + 0.03 * np.log(f / 10))
    peak, rest = 30e3 * (f / 10) ** 0.06, 9e3 * (f / 10) ** 0.12
    return large + (small - large) / (1 + y**2) + 1j * (rest + 2 * (peak - rest) * y / (1 + y**2))


def product(f, x):
    """A fractional element times a law of the amplitude: frequency and amplitude as factors."""
    w, y = 2 * np.pi * f, (x / 0.5e-3) ** 0.55
    s = (2e-3j * w) ** 0.5
    return (1 + 0.8 * s / (1 + s)) * (150e3 + 80e3 / (1 + y**2) + 1j * (5e3 + 30e3 * y / (1 + y**2)))


def friction(f, x):
    """A spring, a fractional element and Berg's friction element in parallel (M. Berg, Vehicle Syst. Dyn. 30, 1998)."""
    w, limit, half = 2 * np.pi * f, 60.0, 0.4e-3
    force = limit / (2 * half) * (np.sqrt(half**2 + x**2 + 6 * half * x) - half - x)
    a = force / limit
    loss = 2 * limit * (2 * x - half * (1 + a) ** 2 * np.log((half * (1 + a) + 2 * x) / (half * (1 + a))))
    return 150e3 + 10e3 * (1j * w) ** 0.2 + force / x + 1j * loss / (np.pi * x**2)


def own(f, x):
    return Kraus(x).stiffness(TRUTH, 2 * np.pi * f)


def data_of(rubber, levels=LEVELS, seed=1):
    """K* at all frequencies and amplitudes, with noise."""
    rng = np.random.default_rng(seed)
    f, x = (one.ravel() for one in np.meshgrid(FREQUENCY, levels, indexing="ij"))
    k = rubber(f, x)
    k = k * (1 + NOISE * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size)))
    return replace(StiffnessData.of(2 * np.pi * f, k, NOISE * np.abs(k)), amplitude=x)


@pytest.mark.parametrize("rubber", [plateaus, product, friction], ids=lambda one: one.__name__)
@pytest.mark.parametrize("levels", [LEVELS, LEVELS / 2], ids=["0.1 to 2 mm", "0.05 to 1 mm"])
def test_an_amplitude_between_three_that_were_tested_is_predicted_within_two_per_cent(rubber, levels):
    (found,) = fit_conditions(Kraus(), [data_of(rubber, levels)])
    for x in np.geomspace(levels[0], levels[-1], 13):
        exact = rubber(FREQUENCY, np.full(FREQUENCY.size, x))
        shown = Kraus(x).stiffness(found.values, 2 * np.pi * FREQUENCY)
        assert np.abs(shown / exact - 1).max() < 0.02


def test_95_per_cent_intervals_hold_the_exponent_and_the_amplitude():
    """Of 30 draws of two parameters at least 51 of 60 intervals hold: 95 % with three standard deviations."""
    inside = 0
    for seed in range(30):
        data = data_of(own, LEVELS, seed)
        (found,) = fit_conditions(Kraus(), [data])
        half = 1.96 * found.std
        inside += int(np.sum(np.abs(found.values - TRUTH)[[6, 7]] < half[[6, 7]]))
    assert inside >= 51


def test_profile_intervals_see_the_amplitude():
    data = data_of(own)
    (found,) = fit_conditions(Kraus(), [data])
    ends = profile_intervals(found, data)
    at = Kraus().symbols.index("x_c")
    assert ends[at, 0] < TRUTH[at] < ends[at, 1]
    assert ends[at, 1] < 1.3 * TRUTH[at]


def test_the_limits_of_small_and_large_amplitudes_are_kraus_s():
    omega = 2 * np.pi * np.array([10.0])
    (small,), (large,) = (Kraus(x).stiffness(TRUTH, omega) for x in (1e-15, 1e9))
    (peak,) = Kraus(TRUTH[6]).stiffness(TRUTH, omega)
    assert small - large == pytest.approx(TRUTH[4] * (1 + 1j * TRUTH[9]), rel=2e-4)
    assert peak - large == pytest.approx(TRUTH[4] * (1 + 1j * TRUTH[9]) / 2 + 1j * TRUTH[5], rel=2e-4)


def test_without_an_amplitude_it_has_no_stiffness():
    with pytest.raises(ModelError, match="amplitude of the deflection"):
        Kraus().stiffness(TRUTH, [60.0])
    with pytest.raises(ModelError, match="must be positive"):
        Kraus().at_amplitude([1e-3, 0.0])
    with pytest.raises(ModelError, match="needs the amplitude"):
        fit_conditions(Kraus(), [replace(data_of(own), amplitude=None)])


def test_auto_does_not_try_it_and_fractional_is_its_special_case():
    assert by_amplitude("kraus")
    assert not any(by_amplitude(name) for name in (*automatic(), "auto", "maxwell"))
    assert contains("kraus", "fractional")


def test_the_energy_of_a_cycle_is_that_of_its_amplitude():
    found = Kraus().energy_loss(TRUTH, [60.0], [1e-3])
    assert found == pytest.approx(np.pi * Kraus(1e-3).stiffness(TRUTH, [60.0]).imag * 1e-6)


def cam(frequency, resonance=15.0, loss=0.2):
    """Deflection of a specimen of constant K* under a moving mass that a cam of 1 mm moves."""
    ratio = (frequency / resonance) ** 2
    return 1e-3 * np.abs(ratio / (1 + 1j * loss - ratio))


@pytest.mark.parametrize("count", [5, 8, 12, 30])
def test_on_a_cam_rig_amplitude_cannot_be_told_from_frequency(count):
    frequency = np.linspace(8.0, 26.0, count)
    found = separation(frequency, cam(frequency))
    assert not found.possible
    assert found.inflation > MOST_INFLATION


def test_repeats_on_a_cam_rig_do_not_tell_them_apart():
    rng = np.random.default_rng(2)
    frequency = np.repeat(np.linspace(8.0, 26.0, 8), 3) * (1 + 1e-3 * rng.normal(size=24))
    assert not separation(frequency, cam(frequency) * (1 + 1e-3 * rng.normal(size=24))).possible


def test_one_amplitude_at_all_frequencies_tells_nothing():
    rng = np.random.default_rng(2)
    assert not separation(np.geomspace(1, 60, 30), 1e-3 * (1 + 0.01 * rng.normal(size=30))).possible


def test_levels_at_each_frequency_and_scattered_settings_tell_them_apart():
    f, x = (one.ravel() for one in np.meshgrid(FREQUENCY, LEVELS))
    found = separation(f, x)
    assert found.possible
    assert found.inflation == pytest.approx(1.0)
    assert found.spread == pytest.approx(np.std(np.log(LEVELS)))
    rng = np.random.default_rng(3)
    assert separation(rng.uniform(5, 50, 30), np.exp(rng.uniform(-9, -6, 30))).possible
