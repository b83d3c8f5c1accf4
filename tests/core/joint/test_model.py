"""What the three phasors of a test should be: values against the rig in phasors, derivatives against differences."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.joint.model import FLOOR, Observed, inverse_upper, linearise, projected, upper_factor, whitened
from fourpole.core.joint.shared import Shared, SharedParameter
from fourpole.core.sources import PARTS, SHAPES, Kind, Role, Source
from fourpole.core.unstated import sliding

EPS = np.finfo(float).eps
#: Step in stated uncertainties, which are about 1 % of the values: central differences err by (1 % of) its square.
STEP = 1e-4


@pytest.fixture(scope="module")
def at_truth(make):
    """A campaign of everything at its truth: residuals are zero there, so that their derivatives are the model's."""
    made = make(masses=(0.0, 6.0, 10.0), frequencies=2, families=2, blocks=(5.0, 10.0), exact=True)
    problem = made.problem()
    z = made.true_z(problem.shared)
    stiffness = np.where(made.family < 0, 1.0, made.campaign.stiffness)
    return made, problem, z, stiffness


def scale_of(linear):
    """Round-off of a difference of residuals: that of the whitened amplitudes, measured and from the model."""
    return 2 * EPS * 1e3 / STEP


def test_the_model_gives_what_the_rig_gives(at_truth):
    made, problem, z, stiffness = at_truth
    linear = linearise(problem.observed, problem.shared, z, stiffness)
    assert np.abs(linear.predicted / made.phasors.amplitudes - 1).max() < 64 * EPS * 10  # Zr loses a digit
    assert np.abs(linear.drive / made.campaign.true_amplitudes[:, 1] - 1).max() < 64 * EPS * 10
    assert np.abs(linear.ratio) == pytest.approx(made.campaign.transmissibility, rel=1e-12)
    assert np.abs(linear.residual).max() < 1e3 * 640 * EPS  # noise is 1e-3 of each amplitude


def test_every_shared_value_of_every_kind_is_there(at_truth):
    _, problem, _, _ = at_truth
    names = [parameter.source.text for parameter in problem.shared.parameters]
    assert len(names) == 7 + 6 + 3  # of the rig, of the channels, and the masses of 5, 6 and 10 kg
    assert {parameter.source.role for parameter in problem.shared.parameters} == {Role.RIG, Role.CHANNEL, Role.MASS}


def test_derivatives_by_delays_and_calibrated_responses(make):
    """Errors whose shape over frequency is not flat, at values far from what is stated."""
    made = make(frequencies=3, families=2)
    count = made.family.size
    rng = np.random.default_rng(5)
    response = 1e-2 * (rng.random((count, 3)) + 1j * rng.random((count, 3)))
    channels = ChannelUncertainty(delay=np.array([1e-4, 2e-4, 0.0]), response=response)
    errors = channels.errors(made.phasors.omega)
    assert [error.source.text for error in errors][:3] == ["delay F1", "response gain F1", "response phase F1"]
    shared = Shared.stated(made.rig, errors, np.empty(0), np.empty(0))
    observed = Observed.of(made.phasors, np.full(count, -1), made.family < 0, errors)
    z = rng.standard_normal(len(shared))
    stiffness = made.campaign.stiffness
    seen = linearise(observed, shared, z, stiffness).predicted  # derivatives of the residual are the model's at zero
    observed = Observed.of(replace(made.phasors, amplitudes=seen), np.full(count, -1), made.family < 0, errors)
    here = linearise(observed, shared, z, stiffness)
    for at, parameter in enumerate(shared.parameters):
        step = STEP * np.eye(z.size)[at]
        above, below = (linearise(observed, shared, z + side * step, stiffness) for side in (1, -1))
        found = (below.residual - above.residual) / (2 * STEP)
        column = here.by_shared[:, :, at]
        assert np.abs(found - column).max() < STEP**2 * np.abs(column).max() + scale_of(here), parameter.source


def test_derivatives_by_every_shared_value(at_truth):
    _, problem, z, stiffness = at_truth
    here = linearise(problem.observed, problem.shared, z, stiffness)
    for at, parameter in enumerate(problem.shared.parameters):
        step = STEP * np.eye(z.size)[at]
        above, below = (linearise(problem.observed, problem.shared, z + side * step, stiffness) for side in (1, -1))
        found = (below.residual - above.residual) / (2 * STEP)
        column = here.by_shared[:, :, at]
        assert np.abs(column).max() > 0
        assert np.abs(found - column).max() < STEP**2 * np.abs(column).max() + scale_of(here), parameter.source
        by_zr = (above.impedance - below.impedance) / (2 * STEP)
        size = np.abs(here.impedance_by_shared[:, at]).max()
        limit = STEP**2 * size + 1e3 * EPS * np.abs(here.impedance).max() / STEP
        assert np.abs(by_zr - here.impedance_by_shared[:, at]).max() < limit, parameter.source


def test_derivatives_by_stiffness(at_truth):
    made, problem, z, stiffness = at_truth
    here = linearise(problem.observed, problem.shared, z, stiffness)
    for at, turn in enumerate((1.0, 1j)):
        above, below = (
            linearise(problem.observed, problem.shared, z, stiffness * np.exp(side * STEP * turn)) for side in (1, -1)
        )
        found = (below.residual - above.residual) / (2 * STEP)
        # by log K the third derivative may be 100 times the first, near the resonance of mass and tyre
        assert np.abs(found - here.by_stiffness[:, :, at]).max() < 100 * STEP**2 * np.abs(here.by_stiffness).max()
    assert not here.by_stiffness[made.family < 0].any()


def test_derivatives_by_impedance_are_those_by_a_mass(at_truth):
    _made, problem, z, stiffness = at_truth
    here = linearise(problem.observed, problem.shared, z, stiffness)
    by_mass = here.by_impedance[:, :, 1] * problem.observed.omega[:, None] * problem.shared.std[0]
    assert problem.shared.parameters[0].source.of == "moving_mass"
    assert np.abs(by_mass - here.by_shared[:, :, 0]).max() < 1e-12 * np.abs(by_mass).max()


@pytest.mark.parametrize("part", [part for part in PARTS if part not in SHAPES])
def test_derivatives_by_a_part_that_nobody_stated(at_truth, part):
    _, problem, z, stiffness = at_truth
    size = {"mass": 0.2, "spring": 200.0, "frame": 1e-6, "loss": 0.01, "friction": 0.5, "input": 0.1}[part]
    listed = (*problem.shared.parameters, SharedParameter(Source(Kind.UNSTATED, part), PARTS[part], 0, 0.0, size))
    shared = replace(problem.shared, parameters=listed)
    z = np.append(z, 0.0)
    step = STEP * np.eye(z.size)[-1]
    here, above, below = (linearise(problem.observed, shared, z + side * step, stiffness) for side in (0, 1, -1))
    found, column = (below.residual - above.residual) / (2 * STEP), here.by_shared[:, :, -1]
    assert np.abs(column).max() > 1
    assert np.abs(found - column).max() < STEP**2 * np.abs(column).max() + scale_of(here)


@pytest.mark.parametrize(
    ("part", "shapes"), [("frame", {"frame resonance": 20.0, "frame damping": 0.3}), ("friction", {"presliding": 1.0})]
)
def test_derivatives_by_the_shape_of_a_part(at_truth, part, shapes):
    """A mode of a frame has a resonance, friction holds until it slides: both move Zr by the size of the part."""
    _, problem, z, stiffness = at_truth
    size = {"frame": 1e-5, "friction": 2.0}[part]
    parts = {part: 0.0, **shapes}
    listed = [
        SharedParameter(Source(Kind.UNSTATED, one), PARTS[one], int(part == "frame"), of, size if one == part else 0.1)
        for one, of in parts.items()
    ]
    shared = replace(problem.shared, parameters=(*problem.shared.parameters, *listed))
    z = np.append(z, [1.0, *np.zeros(len(shapes))])
    here = linearise(problem.observed, shared, z, stiffness)
    for at in range(z.size - len(parts), z.size):
        step = STEP * np.eye(z.size)[at]
        above, below = (linearise(problem.observed, shared, z + side * step, stiffness) for side in (1, -1))
        found, column = (above.impedance - below.impedance) / (2 * STEP), here.impedance_by_shared[:, at]
        limit = 1e2 * STEP**2 * np.abs(column).max() + 1e3 * EPS * np.abs(here.impedance).max() / STEP
        assert 0 < np.abs(found - column).max() < limit, shared.parameters[at].source


@pytest.mark.parametrize("amplitude", [1e-3, 1.2e-4, 5e-5], ids=["slides", "slides little", "holds"])
def test_friction_is_the_fundamental_of_an_element_that_slips(amplitude):
    presliding, turn = 1e-4, np.linspace(0, 4 * np.pi, 8193)
    motion, force = amplitude * np.cos(turn), [0.0]
    for step in np.diff(motion):
        force.append(float(np.clip(force[-1] + step / presliding, -1.0, 1.0)))
    last = slice(4096, 8192)
    phasor = 2 * np.mean(np.array(force)[last] * np.exp(-1j * turn[last]))
    omega = np.array([50.0])
    found, _ = sliding(omega, omega * amplitude, presliding)
    assert abs(found[0] - phasor / (1j * omega[0] * amplitude)) < 1e-3 * abs(found[0])


@pytest.mark.parametrize(("part", "size"), [("frame", 1e-5), ("loss", 0.2), ("spring", 2e3), ("friction", 5.0)])
def test_derivatives_by_the_rig_beside_a_large_part_that_nobody_stated(at_truth, part, size):
    """A frame in series with the preload spring changes what the spring's stiffness does."""
    _, problem, z, stiffness = at_truth
    listed = (*problem.shared.parameters, SharedParameter(Source(Kind.UNSTATED, part), PARTS[part], 0, 0.0, size))
    shared, z = replace(problem.shared, parameters=listed), np.append(z, 1.0)
    here = linearise(problem.observed, shared, z, stiffness)
    for at, parameter in enumerate(shared.parameters):
        step = STEP * np.eye(z.size)[at]
        above, below = (linearise(problem.observed, shared, z + side * step, stiffness) for side in (1, -1))
        found = (above.impedance - below.impedance) / (2 * STEP)
        column = here.impedance_by_shared[:, at]
        limit = STEP**2 * np.abs(column).max() + 1e3 * EPS * np.abs(here.impedance).max() / STEP
        assert np.abs(found - column).max() < limit, parameter.source


def test_derivatives_by_the_drift_of_a_specimen(at_truth):
    """In modulus and angle, of one of two specimens, over the places of its tests in the run."""
    made, problem, z, stiffness = at_truth
    count = made.family.size
    observed = replace(problem.observed, specimen=np.arange(count) % 2, place=np.linspace(-0.5, 0.5, count))
    kinds = [(Kind.DRIFT, "1", 0.03), (Kind.ANGLE_DRIFT, "rad", 0.02)]
    drifts = tuple(SharedParameter(Source(kind, "b"), unit, 1, 0.0, std) for kind, unit, std in kinds)
    shared = replace(problem.shared, parameters=(*problem.shared.parameters, *drifts))
    z = np.append(z, [0.0, 0.0])
    assert np.abs(observed.drifted(shared, z) - 1).max() == 0
    turned = observed.drifted(shared, np.append(z[:-2], [1.0, 1.0]))
    expected = np.exp((0.03 + 0.02j) * observed.place)
    assert turned == pytest.approx(np.where(observed.specimen == 1, expected, 1.0), rel=1e-12)
    others = np.flatnonzero(observed.specimen == 0)  # as of a chunk of a large campaign
    assert np.abs(observed.part(others).drifted(shared, np.append(z[:-2], [1.0, 1.0])) - 1).max() == 0
    here = linearise(observed, shared, z, stiffness)
    for at in (-2, -1):
        step = STEP * np.eye(z.size)[at]
        above, below = (linearise(observed, shared, z + side * step, stiffness) for side in (1, -1))
        found, column = (below.residual - above.residual) / (2 * STEP), here.by_shared[:, :, at]
        assert np.abs(column).max() > 1
        assert np.abs(found - column).max() < 100 * STEP**2 * np.abs(column).max() + scale_of(here)


def test_the_tyre_s_mass_is_not_on_a_rigid_block(at_truth):
    made, problem, z, stiffness = at_truth
    here = linearise(problem.observed, problem.shared, z, stiffness)
    at = [parameter.source.text for parameter in problem.shared.parameters].index("tyre_mass")
    assert not here.by_shared[made.family < 0, :, at].any()
    assert here.by_shared[made.family >= 0, :, at].any(axis=1).all()


def test_the_drive_is_fitted_out(make):
    """The residual is the least that any drive leaves, and nothing that is left can be done by a drive."""
    made = make(masses=(0.0, 10.0), frequencies=3, families=2).without(2, [1]).without(0, [4])
    problem = made.problem()
    observed = problem.observed
    linear = linearise(observed, problem.shared, np.zeros(len(problem.shared)), made.campaign.stiffness)
    unit = linear.predicted / linear.drive[:, None]
    columns = whitened(observed.whiten, np.stack([unit, 1j * unit], axis=-1))
    measured = whitened(observed.whiten, observed.amplitudes[..., None])[..., 0]
    for test in range(made.family.size):
        best = np.linalg.lstsq(columns[test], measured[test], rcond=None)[0]
        left = measured[test] - columns[test] @ best
        assert np.abs(left - linear.basis[test] @ linear.residual[test]).max() < 1e3 * 640 * EPS
        assert best @ [1, 1j] == pytest.approx(linear.drive[test], rel=1e-12)
    for name in ("by_stiffness", "by_impedance", "by_shared"):
        part = linear.basis @ getattr(linear, name)
        assert name == "by_shared" or np.abs(part - linear.field(name)).max() < 64 * EPS * np.abs(part).max()
        left = np.swapaxes(columns, 1, 2) @ part
        assert np.abs(left).max() < 64 * EPS * np.abs(part).max() * np.abs(columns).max()
    assert np.abs(np.swapaxes(linear.basis, 1, 2) @ linear.basis - np.eye(4)).max() < 64 * EPS
    assert linear.field("drive") is linear.drive


def test_weights_by_scatter_undo_its_covariance(make):
    """Scatter from far below the noise to far above it."""
    made = make(frequencies=3, families=2, blocks=(5.0,))
    problem = made.problem()
    stiffness = np.where(made.family < 0, 1.0, made.campaign.stiffness)
    plain = linearise(problem.observed, problem.shared, np.zeros(len(problem.shared)), stiffness)
    scatter = np.where(made.family < 0, 0.0, np.geomspace(1e-8, 0.1, made.family.size))
    scattered = plain.scattered(scatter)
    along = scatter[:, None, None] * plain.by_stiffness
    covariance = np.eye(4) + along @ np.swapaxes(along, 1, 2)
    worst = np.linalg.norm(covariance, axis=(1, 2)).max()
    assert np.abs(scattered.weigh @ covariance @ scattered.weigh - np.eye(4)).max() < 64 * EPS * worst
    assert scattered.weigh == pytest.approx(np.swapaxes(scattered.weigh, 1, 2), abs=64 * EPS)
    assert scattered.by_shared == pytest.approx(scattered.weigh @ plain.by_shared, rel=1e-12, abs=1e-12)


@given(scale=st.floats(1e-3, 1e3), turn=st.floats(-np.pi, np.pi))
def test_a_larger_drive_changes_nothing(make, scale, turn):
    """The same test driven harder, or seen later: same residual and derivatives, if its noise grows with it."""
    made = make(frequencies=2, families=1)
    problem = made.problem()
    factor = scale * np.exp(1j * turn)
    phasors = made.phasors
    # the noise of Re and Im is alike, so that turning does not mix it
    other = replace(phasors, amplitudes=phasors.amplitudes * factor, covariance=phasors.covariance * scale**2)
    turned = Observed.of(other, problem.observed.mass_at, problem.observed.rigid, made.errors)
    z = np.zeros(len(problem.shared))
    one, two = (linearise(each, problem.shared, z, made.campaign.stiffness) for each in (problem.observed, turned))
    assert two.drive == pytest.approx(one.drive * factor, rel=1e-12)
    size = np.abs(two.residual).max()
    assert np.linalg.norm(two.residual, axis=1) == pytest.approx(np.linalg.norm(one.residual, axis=1), abs=1e-9 * size)
    assert np.linalg.norm(two.by_shared, axis=1) == pytest.approx(
        np.linalg.norm(one.by_shared, axis=1), abs=1e-9 * np.abs(one.by_shared).max()
    )


def test_weights_undo_a_covariance_that_joins_all_channels(make):
    made = make(frequencies=2, families=1)
    rng = np.random.default_rng(1)
    root = rng.standard_normal((2, 6, 6)) * np.array([10.0, 10.0, 1e-3, 1e-3, 1e-4, 1e-4])[:, None]
    covariance = root @ np.swapaxes(root, 1, 2)
    observed = Observed.of(replace(made.phasors, covariance=covariance), np.full(2, -1), np.zeros(2, dtype=bool))
    product = observed.whiten @ covariance @ np.swapaxes(observed.whiten, 1, 2)
    # the floor of 1e-7 of an amplitude beside a noise of 1e-4 of it and more; round-off by the condition of S
    assert np.abs(product - np.eye(6)).max() < 1e-3


def test_without_a_covariance_the_floor_is_the_noise(make):
    made = make(frequencies=2, families=1)
    observed = Observed.of(
        replace(made.phasors, covariance=np.zeros((2, 6, 6))), np.full(2, -1), np.zeros(2, dtype=bool)
    )
    expected = 1 / (FLOOR * np.repeat(np.abs(made.phasors.amplitudes), 2, axis=1))
    assert np.diagonal(observed.whiten, axis1=1, axis2=2) == pytest.approx(expected, rel=1e-12)


def test_an_absent_channel_weighs_nothing(make):
    made = make(frequencies=2, families=1).without(2, [1])
    observed = made.problem().observed
    assert not observed.whiten[1, 4:].any()
    assert not observed.whiten[1, :, 4:].any()
    assert observed.amplitudes[1, 2] == 0
    assert np.all(np.diagonal(observed.whiten[0]) > 0)


@given(st.floats(1e-6, 1e6), st.floats(-0.999, 0.999), st.floats(1e-6, 1e6))
def test_the_root_of_a_gram_matrix_and_its_inverse(a, correlation, d):
    gram = np.array([[a, correlation * np.sqrt(a * d)], [correlation * np.sqrt(a * d), d]])
    upper = upper_factor(gram)
    assert upper.T @ upper == pytest.approx(gram, rel=64 * EPS)
    lost = 64 * EPS / (1 - correlation**2)
    assert np.abs(upper @ inverse_upper(upper) - np.eye(2)).max() < lost


def test_columns_that_do_nothing_have_a_root_all_the_same():
    assert upper_factor(np.zeros((2, 2))).tolist() == np.eye(2).tolist()


@pytest.mark.parametrize("nearly", [1.0, 1e-3, 1e-6])
def test_two_columns_that_are_nearly_one_are_still_projected_out(nearly):
    rng = np.random.default_rng(2)
    first = rng.standard_normal((5, 6))
    columns = np.stack([first, first + nearly * rng.standard_normal((5, 6))], axis=2)
    left = projected(np.linalg.qr(columns)[0], columns)
    assert np.abs(left).max() < 64 * EPS * np.abs(columns).max()
