"""Nested least squares: the solution, its variances and the singular cases of one dense problem."""

import numpy as np
import pytest

from fourpole.core.curves import Nested, nested_fit


def problem(seed=0, families=7, each=9, common=2):
    """Seven families of three specimens with one to three unknowns each, complex columns common to all rows."""
    rng = np.random.default_rng(seed)
    family = rng.permutation(np.repeat(np.arange(families), each))
    specimen = np.arange(families) % 3
    own = rng.normal(size=(family.size, 3)) * (np.arange(3) < (1 + family % 3)[:, None])
    shared = rng.normal(size=(family.size, common)) + 1j * rng.normal(size=(family.size, common))
    rows = Nested(own, rng.normal(size=family.size), shared, family, specimen)
    values = rng.normal(size=family.size) + 1j * rng.normal(size=family.size)
    return rows, values, rng.uniform(0.1, 2.0, family.size), rng.uniform(0.1, 1.0, common)


def dense(rows):
    """The same columns as one matrix."""
    one = [rows.own * (rows.family == at)[:, None] for at in range(rows.specimen.size)]
    bends = [rows.bend * (rows.specimen[rows.family] == at) for at in range(rows.specimen.max() + 1)]
    return np.concatenate([*one, np.stack(bends, axis=1), rows.common], axis=1)


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_dense_solution(seed):
    rows, values, weights, prior = problem(seed)
    matrix = dense(rows)
    normal = matrix.conj().T @ (weights[:, None] * matrix)
    normal[-prior.size :, -prior.size :] += np.diag(prior)
    inverse = np.linalg.pinv(normal, rcond=1e-12, hermitian=True)
    expected = matrix @ inverse @ (matrix.conj().T @ (weights * values))
    found = nested_fit(rows, values, weights, prior)
    np.testing.assert_allclose(found.predicted(rows), expected, atol=1e-10)
    levers = np.sum((matrix @ inverse) * matrix.conj(), axis=1).real
    np.testing.assert_allclose(found.levers(rows), levers, atol=1e-10)


def test_rows_without_weight_say_nothing_and_break_nothing():
    """All rows of one family, and so of its specimen, are without weight: the others are as without them."""
    rows, values, weights, prior = problem(families=3)
    weights = np.where(rows.family == 1, 0.0, weights)
    found = nested_fit(rows, values, weights, prior)
    left = rows.family != 1
    fewer = Nested(rows.own[left], rows.bend[left], rows.common[left], rows.family[left] // 2, np.array([0, 1]))
    expected = nested_fit(fewer, values[left], weights[left], prior)
    np.testing.assert_allclose(found.predicted(rows)[left], expected.predicted(fewer), atol=1e-10)
    assert np.isfinite(found.levers(rows)).all()
