"""Sums over blocks and in closed form are the sums as they are defined; the rows of a fit are those of a table."""

import numpy as np
import pytest

from fourpole.core.demodulation.sinefit import fit_sines
from fourpole.core.demodulation.sums import Blocks, Grid, Sines, sums_without_samples
from fourpole.core.demodulation.terms import Terms, rows_of
from fourpole.core.demodulation.tracks import Course, Track

RATE = 250.0


def times(samples):
    """Time from the middle [s], and the same over half the length."""
    time = (np.arange(samples) - 0.5 * (samples - 1)) / RATE
    return time, time / time[-1]


@pytest.mark.parametrize("samples", [7, 50, 1000, 9973])
def test_sums_over_blocks_are_those_over_samples(samples):
    signals = np.random.default_rng(samples).standard_normal((2, samples))
    time, place = times(samples)
    blocks, others = Blocks(signals, RATE), np.array([41.0, 300.0])
    omega = np.array([3.3, 6.6, 9.9, 41.0, 300.0])
    for p in range(3):
        expected = (signals * place**p) @ np.exp(-1j * np.outer(time, omega))
        # the largest phase, 6000 rad, is known to 7e-13; the sum has the root of the number of samples
        np.testing.assert_allclose(blocks.sums(3.3, 3, others)[:, p], expected, rtol=0, atol=2e-12 * np.sqrt(samples))
    np.testing.assert_allclose(blocks.drift, signals @ place[:, None] ** np.arange(4), rtol=0, atol=1e-11)


@pytest.mark.parametrize("samples", [50, 1000, 9973])
def test_sums_near_a_frequency_follow_from_its_moments(samples):
    """Without the samples, up to a turn of 0.15 rad at the ends; beyond, they are gone through again."""
    time, place = times(samples)
    signals = np.cos(np.outer([80.0, 81.3], time))
    blocks = Blocks(signals, RATE)
    blocks.sums(80.0, 2, np.empty(0))
    blocks.samples = np.full_like(blocks.samples, np.nan)
    omega = 80.0 + 0.07 / blocks.grid.half
    for p in range(3):
        expected = (signals * place**p) @ np.exp(-1j * np.outer(time, [omega, 2 * omega]))
        # of each sample: the series is off by 6e-12, and the cube of a block, 1/200³, is left out from s³ on
        left_out = 6e-12 + 0.14 ** (3 - p) / (6, 2, 1)[p] / 200**3
        found = blocks.sums(omega, 2, np.empty(0))[:, p]
        np.testing.assert_allclose(found, expected, rtol=0, atol=left_out * samples)
    assert np.isnan(blocks.sums(80.0 + 0.2 / blocks.grid.half, 2, np.empty(0))).any()


@pytest.mark.parametrize("samples", [16, 1000, 9973])
def test_sums_between_places_are_those_of_their_samples(samples):
    signals = np.random.default_rng(samples).standard_normal((2, samples))
    grid, edges = Grid(samples, RATE), np.array([0, samples // 5, samples // 4, samples // 2, samples])
    turned = signals * np.exp(-1j * 41.0 * times(samples)[0])
    found = Sines(grid, 41.0, 1, np.empty(0)).between(grid.split(signals), edges)
    np.testing.assert_allclose(found, np.add.reduceat(turned, edges[:-1], axis=1), rtol=0, atol=1e-11)
    np.testing.assert_array_equal(grid.joined(grid.split(signals)), signals)


@pytest.mark.parametrize("samples", [7, 50, 9973])
def test_a_wave_is_the_sum_of_its_terms(samples):
    rng = np.random.default_rng(samples)
    time, place = times(samples)
    sines = Sines(Grid(samples, RATE), 3.3, 2, np.array([41.0]))
    amplitudes = rng.standard_normal((2, 3, 3)) + 1j * rng.standard_normal((2, 3, 3))
    turning = np.exp(1j * np.outer([3.3, 6.6, 41.0], time))
    drift, powers = rng.standard_normal((2, 4)), place ** np.arange(4)[:, None]
    expected = np.einsum("cpf,pn,fn->cn", amplitudes, powers[:3], turning).real + drift @ powers
    np.testing.assert_allclose(sines.wave(amplitudes, drift), expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("samples", [16, 501, 10_000])
def test_closed_sums_are_those_over_samples(samples):
    time, place = times(samples)
    bins = 2 * np.pi * RATE / samples
    omega = bins * np.array([0.0, 1e-9, 0.05, 0.3, 1.0, 2.5, 7.3, 0.3 * samples, samples - 3.0])
    found = sums_without_samples(omega, samples, RATE, 5)
    for p in range(6):
        expected = (np.sin if p % 2 else np.cos)(np.outer(omega, time)) @ place**p
        # the phases at the ends, 2π N/2, have a round-off of 2e-16 of themselves
        np.testing.assert_allclose(found[p], expected, rtol=0, atol=1e-15 * samples * max(samples, 100))


@pytest.mark.parametrize(
    ("samples", "lines", "unsteady", "gaps"),
    [(500, [], (), False), (503, [211.0, 330.0], (), False), (1000, [211.0], (2,), True), (1000, [], (2, 3), True)],
)
def test_rows_without_a_table_are_those_of_a_table(samples, lines, unsteady, gaps):
    """A reference whose phase is the fundamental's own gives the same rows, as a table."""
    rng = np.random.default_rng(1)
    time, _ = times(samples)
    present = rng.random(samples) > 0.1 if gaps else np.ones(samples, dtype=bool)
    signals = rng.standard_normal((2, samples)) * present
    plain = Track(("force_in", "motion_in"), signals, present, time, RATE)
    course = Course(np.zeros(samples), np.empty((0, samples), dtype=complex))
    followed = Track(("force_in", "motion_in"), signals, present, time, RATE, course)
    terms = Terms(50.3, 3, np.array(lines), unsteady)
    one, other = rows_of(plain, terms), rows_of(followed, terms)
    coefficients = rng.standard_normal((one.size, 2))
    assert one.size == other.size
    for found, expected in (
        (one.products(), other.products()),
        (one.with_signals(), other.with_signals()),
        (one.model(coefficients), other.model(coefficients)),
        *zip(one.quarters(signals), other.quarters(signals), strict=True),
    ):
        # phases of 840 rad are known to 1e-13; sums have up to 1000 terms
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)


def test_a_track_of_other_times_has_its_phase_at_the_common_zero():
    """Samples that begin later than those of the others: amplitudes are those at time zero."""
    time = times(800)[0] + 0.37
    signals = np.array([np.cos(50.3 * time + 0.4), 2.0 * np.cos(2 * 50.3 * time - 1.0)])
    track = Track(("force_in", "motion_in"), signals, np.ones(800, dtype=bool), time, RATE)
    found = fit_sines(track, 50.3, 2, np.empty(0)).amplitudes()
    np.testing.assert_allclose(found, [[np.exp(0.4j), 0.0], [0.0, 2.0 * np.exp(-1j)]], atol=1e-12)
