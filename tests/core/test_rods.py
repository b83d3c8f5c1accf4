"""A rod of masses is a chain that is built from its matrices, for whole numbers of masses and at its ends."""

from __future__ import annotations

import numpy as np
import pytest

from fourpole.core.specimen import Body, Form, Inertia, Specimen, ends_of, log_odds

STIFFNESS = np.full(5, 2e5 * (1 + 0.1j))
OMEGA = 2 * np.pi * np.array([0.01, 5.0, 20.0, 40.0, 80.0])
MASS = 3.0


def chain(count, stiffness, omega):
    """Dynamic stiffness (2, 2) of equal masses between equal springs, the inner ones eliminated."""
    each, size = (count + 1) * stiffness, count + 2
    whole = np.zeros((size, size), complex)
    for at in range(count + 1):
        whole[at : at + 2, at : at + 2] += each * np.array([[1, -1], [-1, 1]])
    inner, ends = np.arange(1, count + 1), [0, count + 1]
    whole[inner, inner] -= omega**2 * MASS / count
    across = np.linalg.solve(whole[np.ix_(inner, inner)], whole[np.ix_(inner, ends)])
    return whole[np.ix_(ends, ends)] - whole[np.ix_(ends, inner)] @ across


@pytest.mark.parametrize("count", [2, 3, 6, 50])
def test_a_rod_is_a_chain_of_masses(count):
    rod = Specimen(Form.ROD, MASS, spread=1 - 1 / count)
    exact = np.array([chain(count, *row) for row in zip(STIFFNESS, OMEGA, strict=True)])
    np.testing.assert_allclose(rod.dynamic_stiffness(STIFFNESS, OMEGA), exact, rtol=1e-12)


def test_the_ends_of_the_spread_are_one_mass_and_a_rod():
    """One mass in the middle is a belt between alike springs; a mass that is spread evenly has the poles of a rod."""
    one, belt = Specimen(Form.ROD, MASS, spread=0.0), Specimen(Form.BELT, MASS, 1.0)
    np.testing.assert_allclose(*(it.dynamic_stiffness(STIFFNESS, OMEGA) for it in (one, belt)), rtol=2e-3)
    angle = np.sqrt(OMEGA**2 * MASS / STIFFNESS)
    even = Specimen(Form.ROD, MASS, spread=1.0)
    poles = even.dynamic_stiffness(STIFFNESS, OMEGA)
    np.testing.assert_allclose(poles[:, 0, 1], -STIFFNESS * angle / np.sin(angle), rtol=1e-4)
    np.testing.assert_allclose(poles[:, 0, 0], STIFFNESS * angle / np.tan(angle), rtol=1e-3)
    root = np.sqrt(2e5 / MASS) / (2 * np.pi)
    np.testing.assert_allclose(even.frequencies(STIFFNESS[:1]), [[root * np.pi / 2, root * np.pi]], rtol=1e-4)


@pytest.mark.parametrize(("mass", "spread"), [(3.0, 0.5), (3.0, 0.95), (-0.5, 0.4), (0.0, 0.5)])
def test_derivatives_of_a_rod_are_those_of_differences(mass, spread):
    at = np.array([np.log(STIFFNESS[0]), mass, log_odds(spread)])

    def ends(values):
        ones = np.ones(OMEGA.size)
        found = ends_of(np.exp(values[0]) * ones, OMEGA, values[1].real * ones, 0j * ones, values[2].real * ones,
                        ones + 0j, ones > 0)  # fmt: skip
        return np.stack([np.log(found.spring), found.contact, found.wheel], axis=1), found.by

    for place, row in enumerate((0, 1, 3)):
        step = 1e-6 * np.eye(3)[place]
        slope = (ends(at + step)[0] - ends(at - step)[0]) / 2e-6
        np.testing.assert_allclose(ends(at)[1][:, row], slope, atol=1e-7 * max(np.abs(slope).max(), 1.0))


@pytest.mark.parametrize("at_ground", [False, True])
@pytest.mark.parametrize("count", [2, 5])
def test_springs_of_a_block_whose_far_end_is_held(count, at_ground):
    """A bench measures one pole; a stated mass and its spread give the springs back, within 5 % of the inertia."""
    some = slice(3 if at_ground else 5)  # that of the drive too where the inertia is above the springs
    poles = np.array([chain(count, *row) for row in zip(STIFFNESS[some], OMEGA[some], strict=True)])
    body = Body(MASS, 0.06, 1.0, spread=1 - 1 / count)
    measured = -poles[:, 0, 1] if at_ground else poles[:, 0, 0]
    found, _ = Inertia.of([body] * len(poles), measured.real).springs(measured, OMEGA[some], at_ground=at_ground)
    np.testing.assert_allclose(found, STIFFNESS[some], rtol=1e-9)
