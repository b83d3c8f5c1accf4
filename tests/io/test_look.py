"""Summaries of channels that are fed in parts, and rates by the times of samples."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest

from fourpole.io.look import _Tally, rate_of
from fourpole.io.signals import Signal


def summary(parts: list[np.ndarray]) -> dict[str, object]:
    tally = _Tally(sum(part.size for part in parts))
    for part in parts:
        tally.feed(Signal("F1", "N", part, rate=1000.0))
    return asdict(tally.summary(""))


@pytest.mark.parametrize("seed", range(5))
def test_parts_have_the_summary_of_the_whole(seed: int) -> None:
    rng = np.random.default_rng(seed)
    samples = rng.normal(size=500)
    samples[rng.random(500) < 0.6] = np.nan
    samples[200:260] = np.nan
    parts = np.split(samples, np.sort(rng.integers(1, 500, 12)))
    whole, found = summary([samples]), summary(parts)
    gaps = "".join("x" if np.isnan(one) else " " for one in samples).split()
    assert (whole["missing"], whole["longest_gap"]) == (int(np.isnan(samples).sum()), max(map(len, gaps)))
    assert (found["missing"], found["longest_gap"]) == (whole["missing"], whole["longest_gap"])
    for name in ("least", "greatest", "mean", "std"):
        np.testing.assert_allclose(found[name], whole[name], rtol=1e-12)


def test_values_whose_square_is_too_large_have_an_infinite_std() -> None:
    found = summary([np.array([1e200, -1e200]), np.array([3e200, 1e200])])
    assert (found["least"], found["greatest"], found["std"]) == (-1e200, 3e200, np.inf)


def timed(time: np.ndarray) -> Signal:
    return Signal("F1", "N", np.zeros(time.size), time=time)


def test_a_stated_rate_is_the_rate() -> None:
    assert rate_of(Signal("F1", "N", np.zeros(3), rate=2048.0)) == 2048.0
    assert rate_of(Signal("F1", "N", np.zeros(3))) is None
    assert rate_of(timed(np.zeros(1))) is None


def test_the_rate_of_even_times_is_that_of_their_mean_step() -> None:
    jitter = np.random.default_rng(1).uniform(-2e-4, 2e-4, 1001)
    jitter[[0, -1]] = 0.0
    assert rate_of(timed(np.arange(1001) / 1000.0 + jitter)) == pytest.approx(1000.0, rel=1e-12)


def test_the_rate_of_rounded_times_is_that_of_the_clock() -> None:
    for rounded in ("%.5g", "%.4f"):
        stamps = np.array([float(rounded % time) for time in np.arange(60_000) / 4096.0])
        assert rate_of(timed(stamps)) == pytest.approx(4096.0, rel=1e-6)


@pytest.mark.parametrize(("lost", "rate"), [(99, 1000.0), (101, None)])
def test_lost_samples_leave_the_rate_up_to_a_tenth_of_the_steps(lost: int, rate: float | None) -> None:
    steps = np.full(999, 1e-3)
    steps[:lost] = 5e-3
    found = rate_of(timed(np.concatenate([[0.0], np.cumsum(np.random.default_rng(2).permutation(steps))])))
    assert found == (None if rate is None else pytest.approx(rate, rel=1e-9))
