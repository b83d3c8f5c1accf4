"""Four-poles: closed forms, what undoes what, and shapes."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fourpole.core.twoport import (
    cascade,
    chain_mobility,
    chain_transmissibility,
    damper,
    deembed,
    inverse,
    mass,
    spring,
)

pytestmark = pytest.mark.thorough

OMEGA = 2 * np.pi * np.array([1.0, 10.0, 24.0, 100.0])
EPS = np.finfo(float).eps


def positive(low, high):
    return st.floats(low, high, allow_nan=False)


@st.composite
def four_poles(draw):
    """A mass, a lossy spring or a damper, at one common frequency of 10 Hz."""
    omega = 2 * np.pi * 10.0
    return draw(
        st.one_of(
            st.builds(mass, positive(0.1, 100.0), st.just(omega)),
            st.builds(lambda k, eta: spring(k * (1 + 1j * eta), omega), positive(1e4, 1e6), positive(0.0, 0.5)),
            st.builds(damper, positive(100.0, 1e4)),
        )
    )


def in_common_units(matrix):
    """The matrix with force in units of 1000 N per m/s, so that its entries can be added up."""
    return np.asarray(matrix) * np.array([[1.0, 1e-3], [1e3, 1.0]])


def round_off(*matrices):
    """Bound of the round-off of a product of 2 x 2 matrices, by the product of their norms."""
    return 32 * EPS * np.prod([np.linalg.norm(in_common_units(m)) for m in matrices])


def test_elements():
    np.testing.assert_array_equal(mass(2.0, 5.0), [[1, 10j], [0, 1]])
    np.testing.assert_array_equal(spring(50.0, 5.0), [[1, 0], [0.1j, 1]])
    np.testing.assert_array_equal(damper(4.0), [[1, 0], [0.25, 1]])
    np.testing.assert_allclose(spring(30.0 + 40.0j, 5.0)[1, 0], 0.1j * (0.6 - 0.8j), rtol=1e-15)


@pytest.mark.parametrize(
    "make", [lambda: spring(0.0, 5.0), lambda: spring([1.0, 0.0], 5.0), lambda: damper([1.0, 0.0])]
)
def test_what_joins_nothing_is_an_error(make):
    with pytest.raises(ValueError, match="joins nothing: leave it out of the chain"):
        make()


def test_a_cascade_of_nothing_is_an_error():
    with pytest.raises(ValueError, match="at least one"):
        cascade()


def test_elements_broadcast_over_frequency_and_tests():
    tests = np.array([[10.0], [15.0], [20.0]])
    moving = mass(tests, OMEGA)
    assert moving.shape == (3, 4, 2, 2)
    whole = cascade(spring(2e5 + 4e4j, OMEGA), moving, spring(12440.0, OMEGA))
    assert whole.shape == (3, 4, 2, 2)
    assert chain_mobility(whole).shape == (3, 4)
    for i, m in enumerate(tests[:, 0]):
        for k, omega in enumerate(OMEGA):
            one = cascade(spring(2e5 + 4e4j, omega), mass(m, omega), spring(12440.0, omega))
            np.testing.assert_allclose(whole[i, k], one, rtol=8 * EPS)
    assert inverse(whole).shape == whole.shape
    assert deembed(whole, before=spring(1e6, OMEGA)).shape == whole.shape


def test_masses_add_and_springs_in_series_add_their_compliances():
    np.testing.assert_allclose(cascade(mass(2.0, OMEGA), mass(3.0, OMEGA)), mass(5.0, OMEGA), rtol=1e-15)
    both = cascade(spring(2e5, OMEGA), spring(3e5, OMEGA))
    np.testing.assert_allclose(both, spring(1.2e5, OMEGA), rtol=1e-15)


def test_the_order_of_a_cascade_matters():
    a, b = mass(2.0, 5.0), spring(50.0, 5.0)
    np.testing.assert_array_equal(cascade(a, b), a @ b)
    assert not np.allclose(cascade(a, b), cascade(b, a))


def test_chain_mobility_of_a_tyre_on_its_rig():
    stiffness, m, k3 = 2e5 + 4e4j, 15.0, 12440.0
    whole = cascade(spring(stiffness, OMEGA), mass(m, OMEGA), spring(k3, OMEGA))
    expected = 1j * OMEGA / stiffness + 1j * OMEGA / (k3 - m * OMEGA**2)
    np.testing.assert_allclose(chain_mobility(whole), expected, rtol=1e-12)


def test_chain_transmissibility_of_a_tyre_on_its_rig():
    stiffness, m, k3 = 2e5 + 4e4j, 15.0, 12440.0
    rig = cascade(mass(m, OMEGA), spring(k3, OMEGA))
    expected = stiffness / (stiffness + k3 - m * OMEGA**2)
    np.testing.assert_allclose(chain_transmissibility(spring(stiffness, OMEGA), rig), expected, rtol=1e-12)


def test_chain_mobility_of_mass_spring_damper_in_series():
    m, k, c = 3.0, 4e4, 500.0
    chain = cascade(mass(m, OMEGA), spring(k, OMEGA), damper(c))
    expected = 1 / (1j * OMEGA * m + 1 / (1j * OMEGA / k + 1 / c))
    np.testing.assert_allclose(chain_mobility(chain), expected, rtol=1e-12)


@given(st.lists(four_poles(), min_size=1, max_size=5))
def test_determinant_is_one(parts):
    whole = cascade(*parts)
    assert abs(np.linalg.det(whole) - 1) <= round_off(*parts) * np.linalg.norm(in_common_units(whole))


@example([mass(99.0, 20 * np.pi), spring(1e4 + 625j, 20 * np.pi)] * 2)
@given(st.lists(four_poles(), min_size=1, max_size=4))
def test_inverse_undoes_a_cascade(parts):
    whole = cascade(*parts)
    size = np.linalg.norm(in_common_units(whole))
    bound = round_off(*parts) * size
    for product in (cascade(inverse(whole), whole), cascade(whole, inverse(whole))):
        assert np.linalg.norm(in_common_units(product - np.eye(2))) <= bound
    # The determinant of the chain, a difference of products of entries, is off by the bound, and divides each entry.
    backwards = cascade(*(inverse(part) for part in reversed(parts)))
    assert np.linalg.norm(in_common_units(inverse(whole) - backwards)) <= bound * size


@given(four_poles(), four_poles(), four_poles())
def test_deembed_undoes_the_chain(before, inner, after):
    chain = cascade(before, inner, after)
    bound = round_off(before, before, inner, after, after)
    assert np.linalg.norm(in_common_units(deembed(chain, before=before, after=after) - inner)) <= bound
    assert np.linalg.norm(in_common_units(deembed(chain, before=before) - cascade(inner, after))) <= bound
    assert np.linalg.norm(in_common_units(deembed(chain, after=after) - cascade(before, inner))) <= bound
    np.testing.assert_array_equal(deembed(chain), chain)
