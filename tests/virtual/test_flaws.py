"""Each fault of a channel does what it says, on signals whose answer is known."""

import numpy as np
import pytest

from fourpole.virtual import Flaw

STEP, COUNT = 1e-3, 4000
TIMES = STEP * np.arange(COUNT)
SINE = np.sin(2 * np.pi * 10.0 * TIMES)  # whole periods
SIGNALS = {"F1": 300.0 * SINE, "V1": 0.1 * SINE, "V2": 0.2 * np.cos(2 * np.pi * 10.0 * TIMES)}


def line(values, frequency):
    """Complex amplitude at a frequency with whole periods in the record: 1 for a sine."""
    return 2j * np.mean(values * np.exp(-2j * np.pi * frequency * TIMES))


def test_no_flaw_changes_nothing():
    none = Flaw()
    np.testing.assert_array_equal(none.heard("F1", SIGNALS), SIGNALS["F1"])
    np.testing.assert_array_equal(none.times(TIMES), TIMES)
    assert not none.disturbance(TIMES, np.random.default_rng(1)).any()
    np.testing.assert_array_equal(none.interrupted(SINE, np.random.default_rng(1)), SINE)


def test_scale_offset_and_crosstalk_add_up():
    heard = Flaw(scale=-2.0, offset=5.0, crosstalk=(("V2", 30.0), ("V1", 7.0))).heard("F1", SIGNALS)
    expected = -2.0 * (SIGNALS["F1"] + 30.0 * SIGNALS["V2"] + 7.0 * SIGNALS["V1"]) + 5.0
    np.testing.assert_allclose(heard, expected, rtol=1e-12)


def test_samples_are_late_and_the_clock_is_slow():
    flaw = Flaw(delay=2e-4, clock=3e-4)
    np.testing.assert_allclose(flaw.times(TIMES), TIMES * 1.0003 - 2e-4, rtol=1e-12)
    assert flaw.latest(4.0) == pytest.approx(2e-4 + 1.2e-3)


def test_loop_of_a_force_cell_turns_the_phase_and_has_a_third_harmonic():
    """cos |cos| has the Fourier coefficients 8/(3 pi) and 8/(15 pi); a jump within a step costs 1/COUNT of a period."""
    loop = 0.03 * 300.0 * (300.0 / 300.0)
    change = Flaw(hysteresis=0.03).heard("F1", SIGNALS) - SIGNALS["F1"]
    assert line(change, 10.0) == pytest.approx(-1j * loop * 8 / (3 * np.pi), abs=1e-3 * loop)
    assert abs(line(change, 30.0)) == pytest.approx(loop * 8 / (15 * np.pi), abs=1e-3 * loop)
    half = Flaw(hysteresis=0.03).heard("F1", {"F1": 0.5 * SIGNALS["F1"]}) - 0.5 * SIGNALS["F1"]
    assert line(half, 10.0) == pytest.approx(line(change, 10.0) / 4.0)


def test_soft_limit_compresses_the_peaks_only():
    heard = Flaw(limit=500.0).heard("F1", SIGNALS)
    assert heard.max() == pytest.approx(500.0 * np.tanh(0.6))
    small = np.abs(SIGNALS["F1"]) < 5.0
    np.testing.assert_allclose(heard[small], SIGNALS["F1"][small], rtol=0.01**2)


def test_loose_sensor_changes_at_half_time():
    ratio = Flaw(loose=0.3).heard("V1", {"V1": np.ones(COUNT)})
    np.testing.assert_array_equal(ratio, np.where(np.arange(COUNT) < COUNT // 2, 1.0, 1.3))


def test_hum_and_tone_are_lines_of_their_amplitude():
    """A tone of 982.7 Hz has the samples of one of 17.3 Hz; the record has 69.2 of its periods, so that lines leak."""
    rng = np.random.default_rng(1)
    hum = Flaw(hum=0.02).disturbance(TIMES, rng)
    assert abs(line(hum, 50.0)) == pytest.approx(0.02)
    tone = Flaw(tone=60.0).disturbance(TIMES, rng)
    turn = 2 * np.pi * 17.3 * TIMES
    _, (rest,), *_ = np.linalg.lstsq(np.stack([np.sin(turn), np.cos(turn)], axis=1), tone, rcond=None)
    assert rest < 1e-12 * np.sum(tone**2)
    assert np.sqrt(2 * np.mean(tone**2)) == pytest.approx(60.0, rel=0.01)


def test_noise_and_spikes_have_their_size_and_number():
    noise = Flaw(noise=3.0).disturbance(TIMES, np.random.default_rng(1))
    assert noise.std() == pytest.approx(3.0, rel=4 / np.sqrt(2 * COUNT))
    spikes = Flaw(spikes=50.0, spike=7.0).disturbance(TIMES, np.random.default_rng(1))
    assert set(np.abs(spikes)) == {0.0, 7.0}
    assert np.count_nonzero(spikes) == pytest.approx(200, abs=4 * np.sqrt(200))


def test_dropouts_are_gaps_of_zeros():
    lost = Flaw(dropouts=0.04).interrupted(np.ones(COUNT), np.random.default_rng(1)) == 0.0
    assert 0.04 <= lost.mean() < 0.04 + 40 / COUNT
    edges = np.flatnonzero(np.diff(lost.astype(int), prepend=0, append=0))
    assert (edges[1::2] - edges[::2]).min() >= 5
