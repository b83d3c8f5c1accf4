"""Small amplitudes in the words of a logger: their errors are within the uncertainty that the steps give."""

from __future__ import annotations

import numpy as np
import pytest

from fourpole.core.demodulation.words import step_of, word_variance

RATE, COUNT = 1024.0, 4096


def off(amplitude, noise, rng):
    """Error of a sine's amplitude that stands on steps of 1, and its standard uncertainty by the steps."""
    frequency, phase = rng.uniform(4, 40), rng.uniform(0, 2 * np.pi)
    turn = 2 * np.pi * frequency * np.arange(COUNT) / RATE
    true = amplitude * np.cos(turn + phase)
    samples = np.round(true + noise * rng.standard_normal(COUNT) + rng.uniform())
    basis = np.stack([np.cos(turn), -np.sin(turn), np.ones(COUNT)], axis=1)
    found = np.linalg.lstsq(basis, samples, rcond=None)[0]
    rest = float(np.std(samples - basis @ found))
    return complex(*found[:2]) - amplitude * np.exp(1j * phase), np.sqrt(word_variance(samples, amplitude, rest))


@pytest.mark.parametrize("amplitude", [3.0, 10.0, 40.0])
def test_without_noise_the_error_is_that_of_the_steps(amplitude):
    rng = np.random.default_rng(1)
    errors, stds = np.array([off(amplitude, 0.0, rng) for _ in range(200)]).T
    assert 0.5 < np.sqrt(np.mean(np.abs(errors / stds) ** 2) / 2) < 1.5


def test_noise_of_a_step_leaves_nothing_of_them():
    _, std = off(10.0, 1.0, np.random.default_rng(2))
    assert std < 1e-6


@pytest.mark.parametrize(
    ("samples", "step"),
    [
        (np.zeros(600), 0.0),
        (np.random.default_rng(3).standard_normal(600), 0.0),
        (np.round(np.random.default_rng(4).standard_normal(600), 2), 0.01),
        (np.append(np.nan, np.round(30 * np.random.default_rng(5).standard_normal(600))), 1.0),
    ],
)
def test_the_step_of_samples(samples, step):
    assert step_of(samples) == pytest.approx(step, rel=1e-6)
