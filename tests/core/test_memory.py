"""Residuals with memory: whitening makes them independent, and its likelihood finds the memory."""

import numpy as np
import pytest

from fourpole.core.branches import memories, whitened


def covariance(count, decay, share):
    """Covariance of white noise beside a part that fades, of variance 1 in all."""
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    return share * decay**apart + (1.0 - share) * np.eye(count)


@pytest.mark.parametrize("number", [0, 1, 6, 11, 16, -1])
def test_whitening_is_the_inverse_root_of_the_covariance(number):
    decay, share, _ = memories()
    starts = np.arange(30) == 0
    rows, logs, _ = whitened(np.eye(30), starts)
    root = rows[number]
    wanted = covariance(30, decay[number], share[number])
    np.testing.assert_allclose(root @ wanted @ root.T, np.eye(30), atol=1e-10)
    assert logs[number] == pytest.approx(np.linalg.slogdet(wanted)[1], abs=1e-9)


def test_stretches_are_independent():
    starts = np.isin(np.arange(20), [0, 8])
    rows, _, _ = whitened(np.eye(20), starts)
    assert not rows[:, 8:, :8].any()


def test_white_noise_is_the_first_and_may_be_the_only_one():
    table = np.random.default_rng(0).standard_normal((15, 3))
    rows, logs, count = whitened(table, np.arange(15) == 0, plain=True)
    np.testing.assert_array_equal(rows, table[None])
    assert (logs.tolist(), count.tolist()) == ([0.0], [0.0])
    np.testing.assert_array_equal(whitened(table, np.arange(15) == 0)[0][0], table)
