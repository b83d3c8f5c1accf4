"""Means of repeats: twice their u covers the truth, whether or not a scatter is stated, and is not needlessly large."""

import numpy as np
import pytest

from fourpole.findings.summary import mean_of_repeats, scatter_in

CONDITIONS, DRAWS = 12, 400


def drawn(rng, repeats, scatter, stated):
    """Values (DRAWS, CONDITIONS, repeats) about 1 with a common error and a scatter of each."""
    common = stated * rng.standard_normal((DRAWS, 1, 1))
    return 1.0 + common + scatter * rng.standard_normal((DRAWS, CONDITIONS, repeats))


@pytest.mark.parametrize("repeats", [2, 3, 5])
@pytest.mark.parametrize("scatter", [0.001, 0.01, 0.05])
@pytest.mark.parametrize("pooling", [False, True])
@pytest.mark.sampled(3)
def test_twice_u_covers_the_truth(repeats, scatter, pooling):
    rng = np.random.default_rng(3)
    off, size = [], []
    for groups in drawn(rng, repeats, scatter, 0.003):
        pooled = scatter_in(groups) if pooling else None
        found = mean_of_repeats([(value, 0.003, "D") for value in groups[0]], pooled)
        off.append(abs(found.value - 1.0) <= 2 * found.std)
        size.append(2 * found.std)
    # 95.45 % of 400 draws, less three of its standard uncertainties
    assert np.mean(off) >= 0.9545 - 3 * np.sqrt(0.9545 * 0.0455 / DRAWS)
    if pooling:  # what an exactly known scatter would give, and a half more for what few repeats leave open
        assert np.median(size) <= 1.5 * 2 * np.hypot(0.003, scatter / np.sqrt(repeats))


def test_a_condition_that_scatters_more_than_the_others_is_not_hidden_by_them():
    groups = [[1.0, 1.001]] * 20 + [[1.0, 1.2]]
    found = mean_of_repeats([(1.0, 1e-3, "D1"), (1.2, 1e-3, "D2")], scatter_in(groups))
    assert 2 * found.std >= 2 * 0.1
