"""Recursions in blocks are those of a loop, whatever their length."""

import numpy as np
import pytest

from fourpole.core.recursion import outputs_of, states_of


@pytest.mark.parametrize("count", [1, 2, 24, 48, 49, 50, 1000, 3001])
def test_outputs_and_states_are_those_of_a_loop(count):
    rng = np.random.default_rng(count)
    a = 0.97 * np.linalg.qr(rng.normal(size=(4, 4)))[0]
    b, c, d = rng.normal(size=(4, 2)), rng.normal(size=(3, 4)), rng.normal(size=(3, 2))
    u = rng.normal(size=(count, 2))
    x, states, outputs = np.zeros(4), [], []
    for one in u:
        states.append(x)
        outputs.append(c @ x + d @ one)
        x = a @ x + b @ one
    assert outputs_of(a, b, c, d, u) == pytest.approx(np.array(outputs).T, abs=1e-10)
    assert states_of(a, u @ b.T) == pytest.approx(np.array(states), abs=1e-10)
