"""Normal equations without a matrix over all conditions, against dense ones with a column for each unknown."""

import numpy as np
import pytest

from fourpole.models.laws import Laws, Normal

RNG = np.random.default_rng(0)
COUNT, PARAMETERS, SHARED = 5, 3, 2
BASIS = RNG.standard_normal((COUNT, 2))
ROWS = RNG.standard_normal((COUNT, 12, PARAMETERS + SHARED))
OFF = RNG.standard_normal((COUNT, 12))
GRAM, RIGHT = np.swapaxes(ROWS, 1, 2) @ ROWS, np.einsum("bml,bm->bl", ROWS, OFF)


def dense(designs, errors):
    """The normal matrix and right side with one column for each unknown, own values one by one."""
    matrices = [np.eye(COUNT) if one is None else one for one in designs]
    size = sum(one.shape[1] for one in matrices)
    whole = np.zeros((COUNT, PARAMETERS + SHARED, size + SHARED))
    start = 0
    for p, one in enumerate(matrices):
        whole[:, p, start : start + one.shape[1]] = one
        start += one.shape[1]
    whole[:, PARAMETERS:, size:] = np.eye(SHARED)
    normal = np.einsum("bla,blm,bmc->ac", whole, GRAM, whole)
    prior = np.append(np.zeros(size), np.ones(SHARED))
    right = np.einsum("bla,bl->a", whole, RIGHT) - prior * np.append(np.zeros(size), errors)
    return whole, normal + np.diag(prior), right


@pytest.mark.parametrize("designs", [(BASIS, BASIS, BASIS), (BASIS, None, np.ones((COUNT, 1))), (None, None, None)])
def test_steps_and_covariances_are_those_of_the_dense_equations(designs):
    errors = np.array([0.3, -0.2])
    laws = Laws(designs, SHARED, COUNT)
    normal = Normal(laws, GRAM, RIGHT, np.append(np.zeros(laws.coefficients), errors))
    whole, matrix, right = dense(designs, errors)
    step = np.linalg.solve(matrix, right)
    _, local = normal.step()
    np.testing.assert_allclose(local, whole @ step, rtol=1e-8, atol=1e-10)
    inverse = np.linalg.inv(matrix)
    found = normal.local_covariance(normal.covariance())
    np.testing.assert_allclose(found, whole @ inverse @ np.swapaxes(whole, 1, 2), rtol=1e-8, atol=1e-10)
    reduction = 2 * right @ step - step @ matrix @ step
    assert normal.reduction(*normal.step()) == pytest.approx(reduction, rel=1e-8)
