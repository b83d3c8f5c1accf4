"""Decimation keeps what is in its band, refuses what is beyond, and does not care how it was fed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.core.recording import Decimator


def thinned(samples, factor, cuts=()):
    decimator = Decimator(factor)
    for piece in np.split(samples, sorted(cuts)):
        decimator.feed(piece)
    return decimator.samples(), decimator.shift


@settings(max_examples=40)
@given(factor=st.integers(1, 40), share=st.floats(0.0, 0.45), phase=st.floats(-3.0, 3.0))
def test_a_sine_in_the_band_is_the_same_sine(factor, share, phase):
    turn = 2 * np.pi * share / factor
    found, shift = thinned(np.cos(turn * np.arange(20_000) + phase), factor)
    assert found.size > 0
    expected = np.cos(turn * (shift + factor * np.arange(found.size)) + phase)
    assert np.abs(found - expected).max() < 3e-8  # ripple of 160 dB


@pytest.mark.parametrize("factor", [2, 7, 30])
@pytest.mark.parametrize("share", [0.56, 0.7, 1.0, 1.3])
def test_what_would_fold_onto_the_band_is_gone(factor, share):
    if share / factor > 0.5:
        pytest.skip("beyond half the rate that went in")
    found, _ = thinned(np.cos(2 * np.pi * share / factor * np.arange(20_000)), factor)
    assert np.abs(found).max() < 3e-8


@settings(max_examples=30)
@given(factor=st.integers(1, 12), cuts=st.lists(st.integers(0, 5000), max_size=8), gap=st.integers(0, 4999))
def test_pieces_make_the_whole(factor, cuts, gap):
    samples = np.random.default_rng(0).standard_normal(5000)
    samples[gap] = np.nan
    whole, _ = thinned(samples, factor)
    parted, _ = thinned(samples, factor, cuts)
    np.testing.assert_allclose(parted, whole, atol=1e-12)  # round-off of sums of some hundred normal numbers


def test_a_gap_is_as_long_as_the_filter():
    samples = np.zeros(10_000)
    samples[5000] = np.nan
    found, shift = thinned(samples, 5)
    missing = np.flatnonzero(np.isnan(found))
    assert missing.size == pytest.approx((2 * shift + 1) / 5, abs=1)
    assert shift + 5 * missing.mean() == pytest.approx(5000, abs=5)
