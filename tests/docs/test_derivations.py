"""The equations of the theory pages on rig, specimen and uncertainty, derived again from the physics.

Each test begins with equations of motion, or with a definition, and not with the formula that is to be shown.
"""

from functools import cache
from itertools import product

import mpmath
import numpy as np
import pytest
import sympy as sp

from fourpole import ChannelUncertainty, Phasors, Rig, identify, maxwell_arm, twoport
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.routes import mobility_route, paper_d, relative_route, transmissibility_route
from fourpole.core.specimen import Form, Specimen
from fourpole.core.stats import share_within
from fourpole.core.tyre import mobility, zener_mobility, zener_stiffness, zener_transmissibility

j, mp, mpc, mpf = sp.I, mpmath.mp, mpmath.mpc, mpmath.mpf

pytestmark = pytest.mark.thorough

k1, k2, c, w, m, k3, c3 = sp.symbols("K1 K2 C omega m K3 c3", positive=True)
jw = j * w
#: Values (K1, K2, C, omega, m, K3) at which a float is held against 50 digits.
POINTS = [(180e3, 120e3, 700.0, 62.5, 15.0, 12440.0), (110e3, 75e3, 6518.0, 88.0, 25.0, 12440.0)]


def zero(expression):
    """Whether a rational expression is identically zero."""
    return sp.cancel(sp.together(expression)) == 0


def conjugate(expression):
    """The complex conjugate of an expression in real symbols."""
    return expression.subs(j, -j)


@pytest.fixture(scope="module")
def motion():
    """F1, V1, V2 of the paper's rig per unit of x1, from Newton's law and the laws of springs and dampers."""
    x2, inner = sp.symbols("x2 inner")
    through = k1 * (1 - x2) + k2 * (1 - inner)  # K1 beside the arm, whose inner point is massless
    laws = [sp.Eq(k2 * (1 - inner), jw * c * (inner - x2)), sp.Eq(through - k3 * x2, -(w**2) * m * x2)]
    found = sp.solve(laws, [x2, inner], dict=True)[0]
    return sp.cancel(through.subs(found)), jw, jw * sp.cancel(found[x2])


def test_the_elements_follow_from_newton_and_from_the_laws_of_spring_and_damper():
    f1, v1, f2, v2 = sp.symbols("F1 V1 F2 V2")
    laws = {
        "mass": ([f1 - f2 - jw * m * v1, v1 - v2], twoport.mass(15.0, 62.5)),
        "spring": ([f1 - f2, f2 - k1 * (v1 - v2) / jw], twoport.spring(180e3, 62.5)),
        "damper": ([f1 - f2, f2 - c * (v1 - v2)], twoport.damper(700.0)),
    }
    for equations, made in laws.values():
        found = sp.solve(equations, [f1, v1], dict=True)[0]
        matrix = sp.Matrix([[sp.diff(found[one], other) for other in (f2, v2)] for one in (f1, v1)])
        assert zero(matrix.det() - 1)
        values = np.array(matrix.subs({m: 15.0, k1: 180e3, c: 700.0, w: 62.5}).evalf().tolist(), dtype=complex)
        assert np.allclose(values, made, rtol=1e-14)


@pytest.mark.sampled(4)
def test_a_belt_between_two_springs_is_the_two_port_of_the_page():
    x1, x2, xb, k, r, mb, z = sp.symbols("x1 x2 xb K r mb Zr")
    contact, rim = (1 + r) * k, (1 + r) * k / r
    belt = sp.solve(sp.Eq(contact * (x1 - xb) - rim * (xb - x2), -(w**2) * mb * xb), xb)[0]
    forces = [contact * (x1 - belt), -rim * (belt - x2)]
    found = sp.Matrix([[sp.diff(force, x) for x in (x1, x2)] for force in forces])
    m12 = mb * r / (1 + r) ** 2
    masses = sp.Matrix([[r * m12, m12], [m12, m12 / r]])
    page = k * sp.Matrix([[1, -1], [-1, 1]]) - w**2 / (1 - w**2 * m12 / k) * masses
    assert all(zero(one) for one in found - page)
    assert zero(sum(masses) - mb)
    ratio = -page[1, 0] / (page[1, 1] + jw * z)
    assert zero(k**2 - ratio * ((k + jw * z) * (k - w**2 * m12) - w**2 * m12 / r * k))
    values = {k: 3e5 + 2e4j, r: 0.2, mb: 7.0, w: 150.0}
    ours = Specimen(Form.BELT, 7.0, 0.2).dynamic_stiffness([3e5 + 2e4j], [150.0])[0]
    assert np.array(page.subs(values).evalf(), dtype=complex) == pytest.approx(ours, rel=1e-12)


@pytest.mark.sampled(4)
def test_the_work_of_a_cycle_is_pi_times_the_loss_stiffness():
    t, size, storage, loss = sp.symbols("t X S L", positive=True)
    force = size * (storage * sp.cos(w * t) - loss * sp.sin(w * t))  # Re of K* X e^{jwt}
    moved = sp.diff(size * sp.cos(w * t), t)
    assert sp.simplify(sp.integrate(force * moved, (t, 0, 2 * sp.pi / w)) - sp.pi * loss * size**2) == 0


@pytest.mark.sampled(4)
def test_equations_8_to_10_and_the_misprint_of_8(motion):
    force, v1, _ = motion
    whole = v1 / force
    top = w**2 * c * k2**2 + jw * (k1 * k2**2 + w**2 * c**2 * (k1 + k2))
    assert zero(whole - top / (k1**2 * k2**2 + w**2 * c**2 * (k1 + k2) ** 2) - jw / (k3 - w**2 * m))
    assert not zero(whole - top / (k1 * k2**2 + w**2 * c**2 * (k1 + k2) ** 2) - jw / (k3 - w**2 * m))
    r = w * c / k2
    below = k1**2 + r**2 * (k1 + k2) ** 2
    assert zero((whole + conjugate(whole)) / 2 - w**2 * c / below)
    assert zero((whole - conjugate(whole)) / (2 * j) - w * ((k1 + r**2 * (k1 + k2)) / below + 1 / (k3 - w**2 * m)))


def test_equations_11_to_13_and_the_misprint_of_12(motion):
    force, v1, _ = motion
    whole = sp.cancel(v1 / force)
    real, imaginary = sp.cancel((whole + conjugate(whole)) / 2), sp.cancel((whole - conjugate(whole)) / (2 * j))
    d = sp.cancel(k1 * (imaginary / w - 1 / (k3 - m * w**2)))
    a, b = k1 / w, sp.cancel((1 - d) / real)
    assert zero(real * (a**2 + b**2) - c)
    assert zero(k1 * (a**2 + b**2) / (d * (1 - d) / real**2 - a**2) - k2)
    assert not zero(k1 * (a + b) / (d * (1 - d) / real - a**2) - k2)


def test_equation_14_and_its_misprint(motion):
    _, v1, v2 = motion
    square = sp.cancel(v2 / v1) * conjugate(sp.cancel(v2 / v1))
    x = k3 - w**2 * m

    def printed(factor):
        return (k1**2 + factor * (k1 + k2) ** 2) / ((k1 + x) ** 2 + factor * (k1 + k2 + x) ** 2)

    assert zero(square - printed((w * c / k2) ** 2))
    assert not zero(square - printed(w * c * k2))


def test_the_three_routes_invert_the_motion(motion):
    force, v1, v2 = motion
    across = sp.cancel(jw * force / (v1 - v2))
    rig = jw * m + k3 / jw
    assert zero(across - (k1 + 1 / (1 / k2 + 1 / (jw * c))))
    assert zero(jw / (v1 / force - 1 / rig) - across)
    assert zero(jw * rig * (v2 / v1) / (1 - v2 / v1) - across)
    assert zero(force - rig * v2)  # holds for any tyre


def test_the_amplitudes_of_the_joint_model_and_their_derivatives(motion):
    force, v1, v2 = motion
    stiffness, rig, inertia = sp.symbols("S Z m_in")
    ratio = stiffness / (stiffness + jw * rig)
    of_rig = {rig: jw * m + k3 / jw, stiffness: k1 + 1 / (1 / k2 + 1 / (jw * c))}
    assert zero(v2 / v1 - ratio.subs(of_rig))
    at_cell = force + inertia * jw * v1  # the cell accelerates the mass between itself and the contact
    assert zero(at_cell / v1 - (rig * ratio + jw * inertia).subs(of_rig))
    assert zero(stiffness * sp.diff(ratio, stiffness) - ratio * (1 - ratio))
    assert zero(stiffness * sp.diff(rig * ratio, stiffness) - rig * ratio * (1 - ratio))
    assert zero(sp.diff(rig * ratio, rig) - ratio**2)
    assert zero(sp.diff(ratio, rig) + jw * stiffness / (stiffness + jw * rig) ** 2)


@pytest.mark.parametrize("values", POINTS)
def test_the_package_agrees_with_50_digits(motion, values):
    a, b, damper, omega, mass, spring = values
    force, v1, v2 = (mpc(one.subs(dict(zip((k1, k2, c, w, m, k3), map(sp.Float, values, [60] * 6), strict=True)))
                         .evalf(50)) for one in motion)  # fmt: skip
    rig = {"mass": mass, "preload_stiffness": spring}
    stiffness = zener_stiffness(a, b, damper, omega)
    f1, w1, w2 = complex(force), complex(v1), complex(v2)
    exact = complex(v1 / force)
    assert abs(zener_mobility(a, b, damper, omega, **rig) / exact - 1) < 1e-13
    assert abs(mobility(stiffness, omega, **rig) / exact - 1) < 1e-13
    assert abs(zener_transmissibility(a, b, damper, omega, **rig) / float(abs(v2 / v1)) - 1) < 1e-13
    impedance = Rig(moving_mass=mass, preload_stiffness=spring).impedance(omega)
    for found in (
        mobility_route(exact, 1 / impedance, omega),
        relative_route(f1, w1, w2, omega),
        transmissibility_route(w2 / w1, impedance, omega),
    ):
        assert abs(found / stiffness - 1) < 1e-12
    assert np.allclose(maxwell_arm(stiffness, a, omega), (b, damper), rtol=1e-11)
    assert np.isclose(paper_d(stiffness, a), float((a / mpc(stiffness)).real), rtol=1e-14)


@pytest.mark.sampled(4)
def test_the_rig_is_the_chain_of_the_page():
    """All parts: equations of motion of the moving mass and of the massless point between spring and frame."""
    mt, extra, eta, frame = sp.symbols("m_t D eta K_f", positive=True)
    x2, xf = sp.symbols("x2 x_f")
    leaf = k3 * (1 + j * eta) + jw * c3
    push = sp.Symbol("F")
    laws = [push - leaf * (x2 - xf) + w**2 * (m + mt + extra) * x2, leaf * (x2 - xf) - frame * xf]
    found = sp.solve(laws, [x2, xf], dict=True)[0]
    impedance = sp.cancel(push / (jw * found[x2]))
    stated = {"moving_mass": 15.0, "preload_stiffness": 12440.0, "preload_damping": 15.0, "preload_loss_factor": 0.05,
              "tyre_mass": 0.8, "frame_stiffness": 1e6}  # fmt: skip
    values = dict(zip((m, k3, c3, eta, mt, frame), stated.values(), strict=True)) | {extra: 10.0, w: 62.5}
    assert abs(Rig(**stated).impedance(62.5, 10.0) / complex(impedance.subs(values).evalf(30)) - 1) < 1e-13
    chain = Rig(**stated).chain(62.5, 10.0)
    assert abs(twoport.chain_mobility(chain) * complex(impedance.subs(values).evalf(30)) - 1) < 1e-12


# What three phasors tell

STIFFNESS = sp.Symbol("S", real=True) + j * sp.Symbol("L", real=True)
GAINS = sp.symbols("aF a1 a2 pF p1 p2", real=True)


def recorded(stiffness, omega, added, input_mass=0):
    """Recorded F1/V2 and V1/V2 of a massless specimen on the rig, by Newton's law for the moving mass."""
    x2 = sp.Symbol("x2")
    law = stiffness * (1 - x2) - (k3 + j * omega * c3) * x2 + omega**2 * (m + added) * x2
    far = sp.solve(law, x2)[0]
    gain_f, gain_1, gain_2 = (sp.exp(GAINS[i] + j * GAINS[i + 3]) for i in range(3))
    force = stiffness * (1 - far) - omega**2 * input_mass
    return gain_f * force / (gain_2 * j * omega * far), gain_1 / (gain_2 * far)


@cache
def gradients():
    """Changes of the logarithms of both ratios with each unknown, for symbols of one test."""
    mu, added = sp.symbols("mu D", positive=True)
    parts = STIFFNESS.as_real_imag()
    ratios = recorded(STIFFNESS, w, added, mu)
    return [[sp.diff(one, by) / one for by in (*GAINS, m, c3, k3, *parts, mu)] for one in ratios]


def slopes(count, masses, input_mass=0):
    """Exact derivatives of all recorded ratios by gains, phases, m, c3, K3, K* at `count` frequencies, input mass."""
    rig = dict.fromkeys(GAINS, 0) | {m: 15, c3: 20, k3: 12440}
    rows = []
    for i, added in product(range(count), masses):
        storage, loss = STIFFNESS.as_real_imag()
        at = rig | {storage: 150000 + 9000 * i, loss: 20000 + 1000 * i * i, w: 60 + 25 * i}
        at |= {sp.Symbol("D", positive=True): added, sp.Symbol("mu", positive=True): input_mass}
        for ratio in gradients():
            by = [sp.expand(one.subs(at), complex=True).as_real_imag() for one in ratio]
            for part in (0, 1):
                row = [one[part] for one in by]
                own = [sp.S.Zero] * (2 * count)
                own[2 * i : 2 * i + 2] = row[9:11]
                rows.append([*row[:9], *own, *row[11 : 11 + bool(input_mass)]])
    known = [15, 20, 12440, *(part for i in range(count) for part in (150000 + 9000 * i, 20000 + 1000 * i * i))]
    return sp.Matrix(rows), known


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.sampled(4)
def test_one_mass_leaves_five_directions_unseen_and_two_masses_leave_the_drive_alone(count):
    one, known = slopes(count, [0])
    two, _ = slopes(count, [0, 10])
    assert one.shape[1] == 9 + 2 * count
    assert one.rank() == 4 + 2 * count
    assert two.rank() == 7 + 2 * count
    drives = [[1, 1, 1, 0, 0, 0], [0, 0, 0, 1, 1, 1]]
    for drive in drives:
        direction = sp.Matrix([*drive, *([0] * (3 + 2 * count))])
        assert (one * direction).is_zero_matrix
        assert (two * direction).is_zero_matrix
    scale = sp.Matrix([1, *([0] * 5), *(-value for value in known)])  # F1's gain, and all of the rig and K* over it
    assert (one * scale).is_zero_matrix
    assert not (two * scale).is_zero_matrix
    gain_of_v1 = one[:, 1]
    by_stiffness = one[:, 9:]
    assert by_stiffness.row_join(gain_of_v1).rank() == by_stiffness.rank()  # K* at each frequency balances it
    phase_of_f1, rig = one[:, 3], one[:, 6:]
    assert rig.row_join(phase_of_f1).rank() == rig.rank() + 1  # no rig and no tyre balance it


@pytest.mark.sampled(6)
def test_a_mass_at_the_force_cell_is_seen_over_frequency_only():
    for count, more in ((1, 0), (2, 1)):
        with_it, _ = slopes(count, [0, 10], 1)
        assert with_it.rank() == with_it[:, :-1].rank() + more


@pytest.mark.sampled(4)
def test_the_formula_of_the_added_mass_has_no_sensor_and_no_rig():
    added, stiffness = sp.symbols("D", positive=True), STIFFNESS
    (a, b), (with_a, with_b) = recorded(stiffness, w, 0), recorded(stiffness, w, added)
    found = w**2 * added * (a / (with_a - a) - b / (with_b - b))
    assert sp.simplify(found - stiffness) == 0
    rig = jw * m + c3 + k3 / jw
    assert sp.simplify(jw * added * a / (with_a - a) - rig) == 0
    assert sp.simplify((with_a - a) / (jw * added) - sp.exp(GAINS[0] - GAINS[2] + j * (GAINS[3] - GAINS[5]))) == 0


# Uncertainty


def test_the_derivatives_of_the_routes():
    f1, v1, v2, z = sp.symbols("F1 V1 V2 Z")
    by_mobility = jw / (v1 / f1 - 1 / z)
    assert zero(sp.diff(by_mobility, v1) + by_mobility**2 / jw / f1)
    assert zero(sp.diff(by_mobility, z) + by_mobility**2 / jw / z**2)  # d(1/Z) = -dZ/Z², and dM - d(1/Z)
    relative = jw * f1 / (v1 - v2)
    assert zero(sp.diff(relative, f1) / relative - 1 / f1)
    assert zero(sp.diff(relative, v2) / relative - 1 / (v1 - v2))
    t = sp.Symbol("T")
    by_ratio = jw * z * t / (1 - t)
    assert zero(sp.diff(by_ratio, t) / by_ratio - 1 / (t * (1 - t)))
    assert zero(sp.diff(by_ratio, z) / by_ratio - 1 / z)


def test_k2_and_c_to_second_order():
    a, b, da, db, e = sp.symbols("a b da db e", real=True, nonzero=True)
    compliance = 1 / (a + j * b)
    real, imaginary = sp.simplify(sp.re(compliance)), sp.simplify(sp.im(compliance))
    spring, damper = sp.simplify(1 / real), sp.simplify(-1 / imaginary)
    assert zero(spring - (a + b**2 / a))
    assert zero(damper - (b + a**2 / b))
    assert zero(-sp.diff(spring, a) - (b**2 / a**2 - 1))
    assert zero(-sp.diff(damper, a) / w + 2 * a / (w * b))
    bend = db - b / a * da
    for value, factor in ((spring, 1 / a), (damper, a**2 / b**3)):
        along = value.subs({a: a + e * da, b: b + e * db}, simultaneous=True)
        second = sp.diff(along, e, 2).subs(e, 0) / 2
        assert zero(second - factor * bend**2)


def test_the_moments_of_a_second_order_term():
    z, q, sigma = sp.symbols("z q sigma", positive=True)
    density = sp.exp(-(z**2) / (2 * sigma**2)) / (sigma * sp.sqrt(2 * sp.pi))
    mean, square = (2 * sp.integrate((q * z**2) ** n * density, (z, 0, sp.oo)) for n in (1, 2))
    assert sp.simplify(mean - q * sigma**2) == 0
    assert sp.simplify(square - mean**2 - 2 * mean**2) == 0
    assert sp.simplify(square - 3 * mean**2) == 0


def test_the_uncertainty_of_k2_and_c_is_that_of_50_digit_derivatives():
    """u of K2 and C by the mobility route, with every input uncertain, against derivatives of the physics."""
    mp.dps = 50
    omega, rig_std, gains = 62.5, {"moving_mass": 0.1, "preload_stiffness": 60.0}, np.array([0.004, 0.006, 0.0])
    f1 = 31.0 + 52.0j
    v1 = complex(mobility(150e3 + 40e3j, omega, mass=15.0, preload_stiffness=12440.0) * f1)
    noise = np.diag([0.01, 0.02, 1e-5, 2e-5, 0.0, 0.0]) ** 2
    phasors = Phasors(
        np.array([omega / (2 * np.pi)]), np.array([[f1, v1, np.nan]]), noise[None], np.zeros(1), np.array([np.inf])
    )
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0, std=rig_std)
    found = identify(phasors, rig, np.array([100e3]), k1_std=np.array([500.0]), route="mobility",
                     channels=ChannelUncertainty(gains, np.zeros(3)))  # fmt: skip

    def difference(re_f, im_f, re_v, im_v, mass, spring, static, gain_f, gain_v):
        force, speed = mpc(re_f, im_f) * mp.exp(gain_f), mpc(re_v, im_v) * mp.exp(gain_v)
        x1 = speed / (mpc(0, 1) * mpf(omega))
        x2 = force / (spring - mpf(omega) ** 2 * mass)  # Newton: the tyre has no mass
        return force / (x1 - x2) - static

    at = [31, 52, mpf(v1.real), mpf(v1.imag), 15, 12440, 100000, 0, 0]
    std = [0.01, 0.02, 1e-5, 2e-5, 0.1, 60.0, 500.0, *gains[:2]]
    arm = difference(*at)
    by = [mp.diff(difference, at, tuple(int(i == j) for j in range(9))) * std[i] for i in range(9)]
    a, b = arm.real, arm.imag
    bend = sum((one.imag - b / a * one.real) ** 2 for one in by)
    compliance = [-one / arm**2 for one in by]
    exact = {
        "K2": (1 / (1 / arm).real, [one.real for one in compliance], bend / a),
        "C": (-1 / (omega * (1 / arm).imag), [omega * one.imag for one in compliance], a**2 * bend / (omega * b**3)),
    }
    for which, name in enumerate(exact):
        value, slopes_of_inverse, shift = exact[name]
        linear = sum((value**2 * one) ** 2 for one in slopes_of_inverse)
        assert abs(float(value) / (found.k2, found.c)[which][0] - 1) < 1e-11
        assert np.isclose(found.arm_covariance[0, which, which], float(linear + 3 * shift**2), rtol=1e-9)


def test_a_common_error_stays_in_a_mean():
    n = 7
    common, own = sp.symbols("u_c u_i", positive=True)
    covariance = own**2 * sp.eye(n) + common**2 * sp.ones(n)
    mean = sp.ones(1, n) / n
    assert sp.expand((mean * covariance * mean.T)[0] - common**2 - own**2 / n) == 0


@pytest.mark.sampled(6)
def test_the_probability_behind_the_guard_band():
    z = sp.Symbol("z")
    density = sp.exp(-(z**2) / 2) / sp.sqrt(2 * sp.pi)
    for value, std, low, high in ((10.0, 1.0, -np.inf, 12.0), (10.0, 2.0, 9.0, 13.0)):
        ends = [(sp.nsimplify(end) - 10) / sp.nsimplify(std) if np.isfinite(end) else -sp.oo for end in (low, high)]
        exact = float(sp.integrate(density, (z, *ends)))
        assert np.isclose(share_within(value, std, low, high), exact, rtol=1e-12)
    edge = float(sp.integrate(density, (z, -sp.oo, sp.Rational(int(COVERAGE_FACTOR)))))
    assert f"{100 * edge:.1f}" == "97.7"
