"""Sensors: each fault alone does what it says, and the perfect sensor nothing."""

import numpy as np
import pytest

from fourpole.virtual import Sensor, sample

STEP = 2e-4
START = -10 * STEP
TIMES = np.arange(4000) / 1000.0
OMEGA = 2.0 * np.pi * 24.0


def wave(times):
    return 3.0 * np.sin(OMEGA * times + 0.4)


FINE = wave(START + STEP * np.arange(20 + 5 * TIMES.size))


def recorded(seed=7, **faults):
    return Sensor(**faults).record(FINE, start=START, step=STEP, times=TIMES, rng=np.random.default_rng(seed))


def test_perfect_sensor_writes_what_is_there():
    np.testing.assert_array_equal(recorded(), FINE[10 : 10 + 5 * TIMES.size : 5])


@pytest.mark.parametrize("delay", [2e-4, 3.3e-4, -1e-4, 1e-7])
def test_late_samples_are_those_of_an_earlier_time(delay):
    # six-point Lagrange: (wh)^6/200 of the amplitude at most
    limit = 3.0 * (OMEGA * STEP) ** 6 / 200.0 + 1e-13
    np.testing.assert_allclose(recorded(delay=delay), wave(TIMES - delay), atol=limit)


def test_scale_gain_inversion_and_offset():
    expected = -1e-3 * 1.01 * wave(TIMES) + 0.5
    np.testing.assert_allclose(recorded(scale=1e-3, gain_error=0.01, invert=True, offset=0.5), expected, atol=1e-14)


def test_drift_and_hum_are_sines_of_their_periods():
    slow = recorded(drift=0.2, drift_period=8.0) - recorded()
    np.testing.assert_allclose(slow, 0.2 * np.sin(2 * np.pi * TIMES / 8.0), atol=1e-12)
    spectrum = np.abs(np.fft.rfft(recorded(hum=0.03) - recorded())) / (TIMES.size / 2)
    lines = {50.0: 0.03, 150.0: 0.01}
    for frequency, amplitude in lines.items():
        assert spectrum[round(frequency * 4.0)] == pytest.approx(amplitude, rel=1e-9)
    assert np.sum(spectrum > 1e-9) == len(lines)


def test_white_noise_has_its_rms_and_no_memory():
    noise = recorded(noise=0.1) - recorded()
    # 4000 samples: the rms is uncertain by 1/sqrt(8000), a correlation by 1/sqrt(4000)
    assert np.std(noise) == pytest.approx(0.1, rel=5.0 / np.sqrt(8000))
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 5.0 / np.sqrt(4000)


def test_pink_noise_has_its_rms_and_as_much_in_every_octave():
    noise = recorded(pink=0.1) - recorded()
    assert np.std(noise) == pytest.approx(0.1, rel=1e-9)
    power = np.abs(np.fft.rfft(noise)) ** 2
    octaves = [power[2**k : 2 ** (k + 1)].sum() for k in range(6, 10)]
    # the power of an octave of n lines is uncertain by 1/sqrt(n); the narrowest here has 64
    np.testing.assert_allclose(octaves / np.mean(octaves), 1.0, atol=5.0 / np.sqrt(64))


def test_noise_comes_from_the_generator_alone():
    np.testing.assert_array_equal(recorded(noise=0.1, pink=0.1), recorded(noise=0.1, pink=0.1))
    assert (recorded(noise=0.1) != recorded(seed=8, noise=0.1)).any()
    with pytest.raises(ValueError, match="random generator"):
        Sensor(noise=0.1).record(FINE, start=START, step=STEP, times=TIMES)


def test_converter_rounds_to_its_steps_and_clips():
    lsb = 2.0 * 4.0 / 2**16
    values = recorded(full_scale=4.0, bits=16)
    assert abs(values - recorded()).max() <= 0.5 * lsb * (1 + 1e-9)
    np.testing.assert_allclose(values / lsb, np.rint(values / lsb), atol=1e-9)
    clipped = recorded(full_scale=2.0, bits=16)
    assert clipped.min() == -2.0
    assert clipped.max() == 2.0 - 2.0 * 2.0 / 2**16


@pytest.mark.parametrize("times", [np.array([-0.1]), np.array([99.0]), np.array([START + 1.5 * STEP])])
def test_times_beyond_the_signal_are_refused(times):
    with pytest.raises(ValueError, match="reaches from"):
        sample(FINE, start=START, step=STEP, times=times)
