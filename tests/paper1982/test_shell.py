"""Tielking's tyre: the shell against rings, beams, plates and other theories; the model against itself in time."""

import json
from functools import cache

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.paper1982.ring import ring as chain

from fourpole.errors import ModelError
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelfile import read_model_file
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.fitting.query import Query, ask
from fourpole.io.seal import sealed
from fourpole.models.step import simulate
from fourpole.paper1982.cylinder import Cylinder, elasticity, flexibility, natural_frequencies, radial_answer, shares
from fourpole.paper1982.shell import CROSS_PLY, RADIAL_PLY, Shell

pytestmark = pytest.mark.thorough

OMEGA = 2 * np.pi * np.geomspace(1.0, 300.0, 30)
PRESSURE, WIDTH, SHARE = 4, 1, 9


def ring(membrane, **more):
    """R = 0.3 m, EI = 0.8 N m², 2.4 kg/m."""
    values = {"bending": 4.0, "pressure": 0.0, "foundation": 0.0, "mass": 12.0} | more
    return Cylinder(0.3, 0.2, membrane, **values)


# --- rings


def ring_frequencies(n, *, radius, bending, mass, tension=0.0, foundation=0.0):
    r"""In-plane natural frequencies [Hz] of a ring that bends without stretching, with n waves around.

    .. math:: \omega_n^2 = \frac{n^2}{m (n^2 + 1)}
              \left(\frac{EI (n^2 - 1)^2}{R^4} + \frac{N (n^2 - 1)}{R^2} + k\right)

    The condition v' = -w gives the motion w = cos(n theta), v = -sin(n theta)/n, and its potential and kinetic energy
    give the frequency. The tension is that of a constant pressure normal to the ring; it has no effect on a
    translation, n = 1.

    References
    ----------
    Lord Rayleigh, "The theory of sound", vol. 1, 2nd ed., 1894, section 233; S. C. Huang, W. Soedel, "Effects of
    Coriolis acceleration on the free and forced in-plane vibrations of rotating rings on elastic foundation", J. Sound
    Vib. 115, 1987 (with springs and tension).
    """
    square = np.asarray(n, dtype=float) ** 2
    stiffness = bending * (square - 1) ** 2 / radius**4 + tension * (square - 1) / radius**2 + foundation
    return np.sqrt(stiffness * square / ((square + 1) * mass)) / (2 * np.pi)


@pytest.mark.parametrize(
    ("more", "closed"),
    [
        ({}, {}),
        ({"foundation": 6e6}, {"foundation": 1.2e6}),
        ({"pressure": 2e5}, {"tension": 2e5 * 0.3 * 0.2}),
        ({"pressure": 2e5, "foundation": 6e6}, {"foundation": 1.2e6, "tension": 2e5 * 0.3 * 0.2}),
    ],
)
def test_it_becomes_the_ring_that_does_not_stretch(more, closed):
    """The difference goes as 1/S, so ten times S leaves a tenth of it."""
    waves = np.arange(2, 9)
    exact = ring_frequencies(waves, radius=0.3, bending=0.8, mass=2.4, **closed)
    soft, stiff = (natural_frequencies(ring(s, **more), waves, 0)[:, 0] / exact - 1 for s in (1e7, 1e8))
    assert np.abs(stiff).max() < 2e-4
    np.testing.assert_allclose(soft / stiff, 10.0, rtol=0.02)


def test_the_ring_of_the_textbook():
    """n (n² - 1)/sqrt(n² + 1) sqrt(EI/m)/(2 pi R²)."""
    n = np.arange(1, 8)
    expected = n * (n**2 - 1) / np.sqrt(n**2 + 1) * np.sqrt(0.8 / 2.4) / (2 * np.pi * 0.09)
    np.testing.assert_allclose(ring_frequencies(n, radius=0.3, bending=0.8, mass=2.4), expected, rtol=1e-14)


def test_rings_under_tension_are_membranes_of_a_string_where_short():
    """Many waves: a string of tension N and mass m, of waves 2 pi R/n long; the curved ring is within 2/n² of it."""
    n = 400
    found = ring_frequencies(n, radius=0.3, bending=1e-12, mass=2.4, tension=12e3)
    assert found == pytest.approx(n * np.sqrt(12e3 / 2.4) / (2 * np.pi * 0.3), rel=2 / n**2)


def test_breathing_stretches_and_a_translation_does_nothing():
    breathing = natural_frequencies(ring(1e7, foundation=6e6, pressure=2e5), 0, 0)
    np.testing.assert_allclose(breathing[0], np.sqrt((1e7 / 0.09 + 6e6) / 12.0) / (2 * np.pi), rtol=1e-12)
    assert np.isnan(breathing[1:]).all()
    # without springs a translation stretches, bends and lifts nothing, whatever the pressure
    _, uv, uw, vv, vw, ww = elasticity(ring(1e7, pressure=2e5), np.array([1.0]), np.array([0.0]))[:, 0]
    assert uw - uv == 0
    assert abs(vv - vw) < 1e-15 * vv
    assert abs(ww - vw) < 1e-15 * vv


@pytest.mark.parametrize("waves", [2, 5, 11])
def test_at_rest_a_ring_that_stretches_bends_more_easily(waves):
    """Eliminating v leaves D/(1 + D/(S R²)) in the place of D, exactly; round-off grows by S/(what is left of it)."""
    one = ring(1e4, foundation=6e6)
    bent = 4.0 / (1 + 4.0 / (1e4 * 0.09)) * (waves**2 - 1) ** 2 / 0.3**4 + 6e6
    found = radial_answer(elasticity(one, np.array([float(waves)]), np.zeros(1)))[2]
    np.testing.assert_allclose(1 / found, bent, rtol=1e-12)


# --- the beam and the plate


@pytest.mark.parametrize("radius", [8.0, 16.0])
def test_a_large_ring_is_a_beam_on_springs(radius):
    """K = 2 k/beta; the ring's (n² - 1)² for n⁴ takes beta_w²/(2 R²) = sqrt(D/k)/(2 R²) off, its stretch D/(4 S R²)."""
    bending, foundation, width, membrane = 25.0, 5e6, 0.2, 1e3
    beta = (foundation / (4 * bending)) ** 0.25
    beam = 2 * foundation * width / beta
    one = Cylinder(radius, width, membrane, bending, 0.0, foundation, 12.0)
    around = int(radius * 2e4)
    found = 1 / flexibility(one, 0.0, 1.0, around=around, across=1) / beam - 1
    curved = -np.sqrt(bending / foundation) / (2 * radius**2) - bending / (4 * membrane * radius**2)
    # the uniform deflection n = 0 stands on S/R² beside k, and gives 1/(2 pi R B) of its own
    hoop = membrane / radius**2
    even = beam / (2 * np.pi * radius * width) * (1 / foundation - 1 / (foundation + hoop))
    assert found == pytest.approx(curved + even, rel=2e-2)


def test_a_large_wide_cylinder_is_a_plate_on_springs():
    """K = 8 sqrt(k D) (Hertz 1884), within D/(S R²) = 5e-5; the rest falls by four when the terms double."""
    bending, foundation = 1.0, 1e4  # 0.1 m long are its waves
    plate = 8 * np.sqrt(foundation * bending)
    one = Cylinder(20.0, 4.0, 50.0, bending, 0.0, foundation, 1.0)
    coarse, middle, fine = (
        flexibility(one, 0.0, 0.0, around=around, across=across)
        for around, across in ((1000, 16), (2000, 32), (4000, 64))
    )
    assert (middle - coarse) / (fine - middle) == pytest.approx(4.0, rel=0.03)
    assert 1 / (fine + (fine - middle) / 3) == pytest.approx(plate, rel=1e-4)


def test_a_flat_membrane_of_pressure_between_supports():
    """A large cylinder's short waves: k + N_theta q² + N_y k_m² + D (q² + k_m²)², and nothing of its stretching."""
    one = Cylinder(50.0, 0.2, 1.0, 0.5, 1e3, 1e5, 1.0, axial=0.7, edges="supported")
    n, m = 2000.0, 3.0
    q, across, tension = n / 50.0, m * np.pi / 0.2, 1e3 * 50.0
    flat = 1e5 + tension * (q**2 + 0.7 * across**2) + 0.5 * (q**2 + across**2) ** 2
    found = radial_answer(elasticity(one, np.array([n]), np.array([m])))[2][0]
    assert 1 / found == pytest.approx(flat, rel=1e-3)


# --- shells


def other_theory(n, wave, thin, nu, flugge):
    """Frequencies of Flügge's or Donnell's shell between diaphragms (Leissa 1973, section 2.1), in its unit."""
    g = (1 - nu) / 2
    uu, uv, uw = wave**2 + g * n**2, (1 + nu) / 2 * wave * n, nu * wave
    vv, vw, ww = g * wave**2 + n**2, n, 1 + thin * (wave**2 + n**2) ** 2
    if flugge:
        uu += thin * g * n**2
        uw += thin * (wave**3 - g * wave * n**2)
        vv += thin * 3 * g * wave**2
        vw += thin * (3 - nu) / 2 * wave**2 * n
        ww += thin * (1 - 2 * n**2)
    return np.sqrt(np.linalg.eigvalsh([[uu, uv, uw], [uv, vv, vw], [uw, vw, ww]]))


def tube(thickness, length):
    return Cylinder(1.0, length, 1.0, thickness**2 / 12, 0.0, 0.0, 1.0, edges="supported")


def test_published_frequencies_of_a_tube():
    """C. T. Loy, K. Y. Lam, C. Shu, Shock and Vibration 4, 1997: h/R = 0.01, L/R = 20, nu = 0.3, m = 1, Flügge."""
    published = [0.016101, 0.009382, 0.022105, 0.042095, 0.068008]
    flugge = [other_theory(n, np.pi / 20, 1e-4 / 12, 0.3, flugge=True)[0] for n in range(1, 6)]
    np.testing.assert_allclose(flugge, published, atol=6e-7)
    found = 2 * np.pi * natural_frequencies(tube(0.01, 20.0), np.arange(1, 6), 1)[:, 0]
    np.testing.assert_allclose(found, published, rtol=5e-4)


@pytest.mark.parametrize("thickness", [0.05, 0.01, 0.002])
@pytest.mark.parametrize("length", [20.0, 1.0, 0.25])
def test_it_is_flugges_shell_within_a_twentieth_of_its_thinness(thickness, length):
    """First approximations may differ by some h/R (Koiter 1960); all three frequencies are looked at."""
    for n in range(1, 7):
        found = 2 * np.pi * natural_frequencies(tube(thickness, length), n, 1)
        expected = other_theory(n, np.pi / length, thickness**2 / 12, 0.3, flugge=True)
        np.testing.assert_allclose(found, expected, rtol=0.05 * thickness)


def test_short_shallow_waves_are_donnells():
    """What he neglects goes as 1/n², of what bends."""
    found = 2 * np.pi * natural_frequencies(tube(0.01, 0.25), 60, 1)[0]
    assert found == pytest.approx(other_theory(60, np.pi / 0.25, 1e-4 / 12, 0.3, flugge=False)[0], rel=2 / 60**2)


@pytest.mark.parametrize(
    ("edges", "n", "m"),
    [(edges, n, m) for edges in ("guided", "supported") for n, m in ((1, 1), (3, 2), (0, 1))] + [("guided", 2, 0)],
)
def test_what_the_tension_adds_is_its_work_on_the_deformed_shape(edges, n, m):
    """Second differences of the exact hoop and axial Green strains and of the exact volume enclosed, on a fine grid."""
    radius, width, pressure, axial = 0.3, 0.2, 2e5, 0.5
    count = 64  # the integrands are trigonometric, of few harmonics: sums of equal steps are exact
    theta = 2 * np.pi * np.arange(count)[:, None] / count
    y = (np.arange(count) + 0.5)[None, :] * width / count
    k = m * np.pi / width
    along, axially = (np.cos(k * y), np.sin(k * y)) if edges == "guided" else (np.sin(k * y), -np.cos(k * y))
    along_y = -k * np.sin(k * y) if edges == "guided" else k * np.cos(k * y)
    cos, sin = np.cos(n * theta), np.sin(n * theta)

    def energy(size, part):
        """Of tension and pressure over the area of the cylinder, p R and axial p R on the strains of the surface."""
        u, v, w = (size * one for one in part)
        ut, uy = -n * u * sin * axially, u * k * cos * along
        vt, vy, v0 = n * v * cos * along, v * sin * along_y, v * sin * along
        wt, wy, w0 = -n * w * sin * along, w * cos * along_y, w * cos * along
        hoop = np.stack([ut, radius + vt + w0, wt - v0])  # of the place: along y, around, outward
        axis = np.stack([1 + uy, vy, wy])
        strain = (np.sum(hoop**2, axis=0) / radius**2 - 1) / 2
        stretch = (np.sum(axis**2, axis=0) - 1) / 2
        section = (radius + w0) * (radius + vt + w0) - v0 * (wt - v0)
        slide = (radius + w0) * vy - v0 * wy
        volume = (section * (1 + uy) - slide * ut) / 2
        tension = pressure * radius * (strain + axial * stretch) * radius
        return np.sum(tension - pressure * volume) * (2 * np.pi / count) * (width / count)

    one = Cylinder(radius, width, 1e7, 4.0, pressure, 0.0, 12.0, axial=axial, edges=edges)
    uu, uv, uw, vv, vw, ww = pressure / radius * shares(one, np.array([n]), np.array([k * radius]))[2][:, 0]
    square = np.array([[uu, uv, uw], [uv, vv, vw], [uw, vw, ww]])
    area = np.pi * radius * width * (2 if n == 0 else 1) * (1 if m == 0 else 0.5)
    step = 1e-3 * radius
    parts = np.array([[1.0, 0.6, -0.8], [-0.3, 1.0, 0.5], [0.7, 0.2, 1.0]]) * [m > 0, n > 0, 1]
    for part in parts:
        second = (energy(step, part) + energy(-step, part) - 2 * energy(0.0, part)) / step**2
        # the strains are of second order; the volume's third is odd: nothing but round-off is left
        assert second == pytest.approx(area * part @ square @ part, abs=1e-8 * area * pressure / radius)


def test_arrays_of_cylinders_are_each_by_itself():
    many = Cylinder([0.25, 0.3], 0.2, [1e7, 2e7], 4.0, 2e5, 6e6, 12.0)
    found = natural_frequencies(many, np.arange(4)[:, None], [0, 2])
    assert found.shape == (2, 4, 2, 3)
    alone = natural_frequencies(Cylinder(0.3, 0.2, 2e7, 4.0, 2e5, 6e6, 12.0), 3, 2)
    np.testing.assert_allclose(found[1, 3, 1], alone, rtol=1e-12)
    np.testing.assert_allclose(
        flexibility(many, 0.1, [0.0, 1.0])[0],
        flexibility(Cylinder(0.25, 0.2, 1e7, 4.0, 2e5, 6e6, 12.0), 0.1, 0.0),
        rtol=1e-12,
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": 0.0}, "radius of a cylinder must be positive"),
        ({"foundation": -1.0}, "foundation of a cylinder must not be negative"),
        ({"poisson": 0.6}, "Poisson"),
        ({"edges": "free"}, "'guided' or 'supported'"),
    ],
)
def test_impossible_cylinders_are_refused(change, message):
    usual = {
        "radius": 0.3,
        "width": 0.2,
        "membrane": 1e7,
        "bending": 4.0,
        "pressure": 0.0,
        "foundation": 0.0,
        "mass": 1.0,
    }
    with pytest.raises(ModelError, match=message):
        Cylinder(**usual | change)


def test_impossible_questions_are_refused():
    with pytest.raises(ModelError, match="across at 1"):
        natural_frequencies(tube(0.01, 1.0), 1, 0)
    with pytest.raises(ModelError, match="buckles"):
        natural_frequencies(Cylinder(0.3, 1.0, 1e3, 1e-6, 2e5, 0.0, 1.0, axial=0.0), 1, 1)
    with pytest.raises(ModelError, match="at least one harmonic"):
        flexibility(tube(0.01, 1.0), 0.0, 0.0, around=0)


# --- the model

TYRES = {"radial": RADIAL_PLY, "cross": CROSS_PLY}
MODELS = {
    "guided": Shell(),
    "supported": Shell("supported", poisson=0.45, axial=0.8, around=30, across=6, moving=(8, 3)),
}


@pytest.mark.parametrize("edges", MODELS)
@pytest.mark.parametrize("tyre", TYRES)
@pytest.mark.parametrize("patch", ["usual", "point"])
def test_derivatives_are_those_of_the_stiffness(edges, tyre, patch):
    """Differences of sixth order: steps of 2e-3 leave (2e-3)^6 and round-off of 1e-13/2e-3, at resonances some 10."""
    model, values = MODELS[edges], np.array(TYRES[tyre])
    values[8:] = values[8:] if patch == "usual" else [1e-3, 1e-3]
    found, whole = model.derivative(values, OMEGA), np.abs(model.stiffness(values, OMEGA))
    assert found.shape == (OMEGA.size, 10)
    for at, value in enumerate(values):
        moved = np.repeat(values[None], 6, axis=0)
        moved[:, at] += 2e-3 * value * np.array([-3, -2, -1, 1, 2, 3])
        slope = np.array([-1, 9, -45, 45, -9, 1]) @ model.stiffness(moved, OMEGA) / (60 * 2e-3 * value)
        assert np.abs(found[:, at] - slope).max() < 1e-9 * whole.max() / value


def test_a_point_does_not_change_as_it_begins_to_grow():
    point = np.array(RADIAL_PLY)
    point[8:] = 0.0
    assert np.all(MODELS["guided"].derivative(point, OMEGA)[:, 8:] == 0)


@pytest.mark.parametrize("edges", MODELS)
def test_many_sets_at_once_are_each_by_itself(edges):
    model = MODELS[edges]
    sets = np.array(RADIAL_PLY) * np.array([[0.9], [1.0], [0.95]])
    together = model.stiffness(sets, OMEGA)
    assert together.shape == (3, OMEGA.size)
    np.testing.assert_array_equal(together[1], model.stiffness(sets[1], OMEGA))
    np.testing.assert_allclose(model.derivative(sets, OMEGA)[1], model.derivative(sets[1], OMEGA), rtol=1e-12)
    own = OMEGA * np.array([[0.8], [1.0], [1.1]])
    np.testing.assert_allclose(model.stiffness(sets, own)[2], model.stiffness(sets[2], own[2]), rtol=1e-13)
    slopes = model.derivative(sets, own)
    assert slopes.shape == (3, OMEGA.size, 10)
    np.testing.assert_allclose(slopes[0], model.derivative(sets[0], own[0]), rtol=1e-12)
    np.testing.assert_allclose(model.stiffness(sets[2], own)[0], model.stiffness(sets[2], own[0]), rtol=1e-13)
    assert model.static_stiffness(sets).shape == (3,)
    square = sets.reshape(1, 3, 10)
    np.testing.assert_allclose(model.stiffness(square, OMEGA)[0], together, rtol=1e-13)
    np.testing.assert_allclose(model.derivative(square, OMEGA)[0], model.derivative(sets, OMEGA), rtol=1e-12)
    np.testing.assert_allclose(model.derivative(sets[2], own)[0], model.derivative(sets[2], own[0]), rtol=1e-12)


@pytest.mark.parametrize("edges", MODELS)
@pytest.mark.parametrize("tyre", TYRES)
def test_the_state_space_is_the_model(edges, tyre):
    model, values = MODELS[edges], TYRES[tyre]
    space = model.state_space(values)
    wide = 2 * np.pi * np.geomspace(1e-3, 3e3, 60)
    np.testing.assert_allclose(space.stiffness(wide), model.stiffness(values, wide), rtol=2e-12)
    assert np.linalg.eigvals(space.a).real.max() < 0


@pytest.mark.parametrize("tyre", TYRES)
@pytest.mark.parametrize("frequency", [14.0, 90.0])
def test_stepped_in_time_it_is_its_own_frequency_response(tyre, frequency):
    """A steady sine of 1600 samples per cycle: the cubics between leave (2 pi/1600)^4/384 = 6e-13 of the deflection, at
    1600 times the frequency, where this tyre is some hundred times stiffer than at it."""
    model, values = Shell(moving=(10, 1)), TYRES[tyre]
    space, omega = model.state_space(values), 2 * np.pi * frequency
    step = 1 / (1600 * frequency)
    settle = int(np.ceil(26 / -np.linalg.eigvals(space.a).real.max() / step / 1600)) * 1600
    time = np.arange(settle + 1600) * step
    force = simulate(space, 1e-3 * np.cos(omega * time), -1e-3 * omega * np.sin(omega * time), step)[-1600:]
    found = 2 / 1600 * np.sum(force * np.exp(-1j * omega * time[-1600:])) / 1e-3
    assert abs(found / model.stiffness(values, [omega])[0] - 1) < 1e-9


@pytest.mark.parametrize("edges", MODELS)
def test_at_rest_it_is_its_static_stiffness(edges):
    """1 mHz is (1e-3/80)² = 2e-10 from rest."""
    model = MODELS[edges]
    slow = model.stiffness(RADIAL_PLY, [2e-3 * np.pi])[0]
    assert slow.real == pytest.approx(float(model.static_stiffness(RADIAL_PLY)), rel=1e-9)


_INSIDE = st.tuples(
    st.floats(0.05, 0.8),
    st.floats(0.01, 2.0),
    st.floats(5.7, 9.0).map(lambda x: 10**x),
    st.floats(0.0, 1e3),
    st.floats(0.0, 5e5),
    st.floats(2.0, 9.0).map(lambda x: 10**x),
    st.floats(1.0, 50.0),
    st.floats(1e-5, 1e-2),
    st.floats(0.0, 0.3),
    st.floats(0.0, 1.0),
)


@settings(max_examples=60, deadline=None)
@given(values=_INSIDE, edges=st.sampled_from(["guided", "supported"]), axial=st.sampled_from([0.5, 1.0]))
def test_within_its_bounds_it_is_stable_and_passive(values, edges, axial):
    """No harmonic buckles, so that every term of 1/K* lags, and so does their sum."""
    model = Shell(edges, axial=axial, around=20, across=4, moving=(6, 2))
    frequencies = natural_frequencies(model.cylinder(values), np.arange(20)[:, None], np.arange(1, 9))
    assert np.nanmin(frequencies) > 0
    stiffness = model.stiffness(values, OMEGA)
    assert np.all(stiffness.imag >= 0)
    assert np.all(model.energy_loss(values, OMEGA, 1e-3) >= 0)


def test_a_patch_over_the_whole_width_is_a_ring():
    """The sum over rings of the closed formula, as S grows; what moves and what does not are told apart alike."""
    model = Shell(around=30, across=4, moving=(29, 1))
    values = np.array(RADIAL_PLY)
    values[2], values[SHARE] = 1e12, 1.0
    radius, width, _, bending, pressure, foundation, mass, tau, length, _ = values
    n, w = np.arange(1, 30), OMEGA[:, None]
    own = (
        2
        * np.pi
        * ring_frequencies(
            n,
            radius=radius,
            bending=bending * width,
            mass=mass * width,
            tension=pressure * radius * width,
            foundation=foundation * width,
        )
    )
    inertia = np.pi * radius * width * mass * (1 + 1 / n**2)
    loss = 1 + 1j * w * tau
    receptance = np.sinc(n * length / (2 * np.pi * radius)) ** 2 / inertia / (own**2 * loss - w**2)
    still = 2 * np.pi * 1000 > OMEGA  # n = 29 has no inertia in the model, and little to say
    whole = np.sum(receptance, axis=1)
    np.testing.assert_allclose(model.stiffness(values, OMEGA)[still], 1 / whole[still], rtol=1e-4)


@pytest.mark.parametrize(("tyre", "low", "high"), [("radial", 75, 85), ("cross", 85, 110)])
def test_the_illustrative_tyres_are_plausible(tyre, low, high):
    model, values = Shell(), TYRES[tyre]
    assert low < natural_frequencies(model.cylinder(values), 1, 0)[0] < high
    sets = np.repeat(np.array(values)[None], 4, axis=0)
    sets[:, PRESSURE] = [80e3, 120e3, 160e3, 200e3]
    stiffness = model.static_stiffness(sets)
    assert np.all(np.diff(stiffness) > 0)
    assert np.all((stiffness > 100e3) & (stiffness < 250e3))
    assert Shell().static_stiffness(CROSS_PLY) > Shell().static_stiffness(RADIAL_PLY)


@pytest.mark.parametrize("values", [RADIAL_PLY, CROSS_PLY])
def test_the_usual_numbers_of_harmonics_do(values):
    """Static: within 1e-3 of four times as many. Moving: as the class says."""
    usual, all_move = Shell(), Shell(moving=(39, 10))
    more = Shell(around=160, across=40)
    assert usual.static_stiffness(values) == pytest.approx(float(more.static_stiffness(values)), rel=1e-3)
    omega = 2 * np.pi * np.array([50.0, 300.0])
    error = np.abs(usual.stiffness(values, omega) / all_move.stiffness(values, omega) - 1)
    assert np.all(error < [1e-5, 4e-4])


RUBBER = np.array([8e6, 16.0, 6e-4])  # k [N/m³], mu [kg/m²], tau [s]
WIDE = 2 * np.pi * np.linspace(8.0, 45.0, 10)


@cache
def simulated(pressure):
    """K* over `WIDE` and static stiffness [N/m] of a ring that is simulated without shell theory."""
    return chain(WIDE, pressure, 0.28, 0.11, 1e7, 10.0, *RUBBER, 0.06)


@pytest.mark.parametrize("pressure", [1.0e5, 2.5e5])
def test_it_has_the_stiffness_of_the_chain_within_their_discretisations(pressure):
    values = [0.28, 0.11, 1e7, 10.0, pressure, *RUBBER, 0.06, 1.0]
    clean, rest = simulated(pressure)
    assert np.abs(Shell().stiffness(values, WIDE) / clean - 1).max() < 3e-4
    assert Shell().static_stiffness(values) == pytest.approx(rest, rel=3e-4)


def chain_table(pressures):
    """K* of the simulated ring with noise of 0.1 %, and K1 known to 0.3 %."""
    rng, rows = np.random.default_rng(5), []
    for pressure in pressures:
        clean, rest = simulated(pressure)
        for omega, one in zip(WIDE, clean, strict=True):
            seen, std = one + 1e-3 * abs(one) * complex(*rng.standard_normal(2)), 1e-3 * abs(one)
            names = {"test": f"D{len(rows)}", "tyre": "a", "pressure [Pa]": pressure, "preload [N]": 1000.0}
            names |= {"frequency [Hz]": omega / (2 * np.pi), "Re K* [N/m]": seen.real, "Im K* [N/m]": seen.imag}
            names |= {"u(Re K*) [N/m]": std, "u(Im K*) [N/m]": std, "K1 [N/m]": rest, "u(K1) [N/m]": 0.003 * rest}
            rows.append(names)
    return measured_of(pl.DataFrame(rows))


@pytest.mark.sampled(4)
def test_a_fit_at_one_pressure_finds_springs_mass_and_loss_of_the_chain():
    (found,) = fit_tyres(chain_table([2.0e5]), "shell", given={"beta": 1.0})
    (fit,) = found.chosen.fits
    assert fit.values[4] == 2.0e5  # the pressure of the test
    assert np.all(np.abs(fit.values[5:8] - RUBBER) < 3.5 * fit.std[5:8] + 3e-4 * RUBBER)  # 3e-4: two discretisations
    assert np.all(fit.std[5:8] < [1e5, 1.0, 1e-5])


@pytest.mark.parametrize("make", [fit_tyres, map_tyres])
def test_several_pressures_are_refused_with_what_replaces_them(make):
    with pytest.raises(ModelError, match="the shell model is for one condition: for several, as over pressure"):
        make(chain_table([1.0e5, 2.5e5]), "shell")


@pytest.mark.sampled(4)
def test_a_former_fit_over_pressures_still_loads_and_answers_at_its_conditions(tmp_path):
    """A file of an earlier version, with the record of what the pressures shared, which is not written any more."""
    measured = chain_table([1.0e5])
    file = model_file(measured, fit_tyres(measured, "shell", given={"beta": 1.0}))
    content = json.loads(json.dumps(file.document))
    (entry,) = content["models"]
    entry["conditions"].append({**entry["conditions"][0], "state": [
        {**one, "value": 2.5e5} if one["name"] == "pressure" else one for one in entry["conditions"][0]["state"]
    ]})  # fmt: skip
    entry["pressures"] = [{"conditions": [0, 1], "shared": ["k", "mu", "tau"], "chi2": 1.0}]
    (tmp_path / "model.json").write_text(json.dumps(sealed(content)), encoding="utf-8")
    read = read_model_file(tmp_path / "model.json")
    assert len(ask(read, Query([12.0], {"pressure [Pa]": 2.5e5}))) == 1
    with pytest.raises(ModelError, match=r"no condition is the same.*make a map of the results with fourpole map"):
        ask(read, Query([12.0], {"pressure [Pa]": 2.0e5}))
    assert "pressures" not in read.document["models"][0]


def test_an_undamped_tyre_may_be_asked_too():
    values = np.array(RADIAL_PLY)
    values[7] = 0.0
    assert np.all(Shell().stiffness(values, OMEGA).imag == 0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"axial": 0.3}, "carries the end pressure"),
        ({"moving": (40, 2)}, "fewer than 40 around"),
        ({"poisson": 0.7}, "Poisson"),
    ],
)
def test_impossible_models_are_refused(arguments, message):
    with pytest.raises(ModelError, match=message):
        Shell(**arguments)


def test_impossible_values_are_refused():
    with pytest.raises(ModelError, match="p = 1e\\+06 Pa of the shell model is outside"):
        Shell().stiffness([*RADIAL_PLY[:4], 1e6, *RADIAL_PLY[5:]], OMEGA)
    with pytest.raises(ModelError, match="one set of parameters"):
        Shell().state_space([RADIAL_PLY, CROSS_PLY])
