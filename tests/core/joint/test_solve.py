"""The most probable values: those of one dense problem, whatever the order and the chunks."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.core.joint import solve as module
from fourpole.core.joint.joint import closed_form_start
from fourpole.core.joint.solve import solve, without_stiffness
from fourpole.virtual.phasor_rig import Laboratory


def solved(made):
    problem = made.problem()
    start = closed_form_start(problem.observed, problem.conditions, problem.shared, made.channels)
    return problem, solve(problem, start)


def test_the_values_are_those_of_the_dense_problem(dense):
    _, reference, joint = dense
    solution, p = joint.solution, len(reference.std)
    assert joint.misfit.fits
    assert joint.misfit.scatter == 0
    assert len(solution.z) == p
    std = np.sqrt(np.diag(reference.covariance))
    # the search ends within 1e-5 of an uncertainty, quadratically; scipy's by differences within 1e-6
    assert np.abs(solution.z - reference.x[:p]).max() < 1e-5
    log_k = reference.x[p : p + 2 * reference.count].reshape(-1, 2) @ [1, 1j]
    off = np.log(solution.stiffness / reference.reference) - log_k
    assert np.abs(np.stack([off.real, off.imag], axis=1).ravel() / std[p : p + off.size * 2]).max() < 1e-5
    assert solution.objective == pytest.approx(np.sum(reference.residual(reference.x) ** 2), rel=1e-6)


def test_the_covariance_is_that_of_the_dense_problem(dense):
    _, reference, joint = dense
    solution, p, c = joint.solution, len(reference.std), reference.count
    std = np.sqrt(np.diag(reference.covariance))[: p + 2 * c]
    found = np.zeros((p + 2 * c, p + 2 * c))
    slope = solution.slope.reshape(2 * c, p)
    found[:p, :p] = solution.covariance
    found[p:, :p] = -slope @ solution.covariance
    found[:p, p:] = found[p:, :p].T
    found[p:, p:] = slope @ solution.covariance @ slope.T
    for at in range(c):
        rows = slice(p + 2 * at, p + 2 * at + 2)
        found[rows, rows] += solution.own[at]
    expected = reference.covariance[: p + 2 * c, : p + 2 * c]
    # scipy's Jacobian is by differences, good to 1e-6, and stands in its covariance twice
    assert np.abs((found - expected) / std / std[:, None]).max() < 2e-6


@pytest.fixture(scope="module")
def campaign(make, full):
    return make(replace(full, noise=1e-4), masses=(0.0, 10.0), frequencies=4, families=3, blocks=(8.0,), spread=0.002)


def test_without_noise_the_truth_comes_back(make):
    """m, K3, c3 and all gains off by per cent: two masses and no noise give all that they can."""
    lab = Laboratory(
        moving_mass=(15.0, 0.3),
        preload_stiffness=(12440.0, 250.0),
        preload_damping=(15.0, 5.0),
        std_gain=(0.03,) * 3,
        std_phase=(0.02,) * 3,
        noise=1e-4,
        std_added=0.0,
    )
    made = make(lab, masses=(0.0, 10.0), frequencies=4, families=3, exact=True)
    _, solution = solved(made)
    truth = made.campaign.stiffness[:: len(made.masses) + 1]
    # what is stated draws by (u of K* over the noise, about 3)^2 times 1e-4 (the noise over a gain's uncertainty)^2 ...
    drawn = (3 * 1e-4 / 0.02) ** 2 * 0.03
    assert solution.converged
    assert np.abs(solution.stiffness / truth - 1).max() < drawn
    # ... and nothing draws where weights are those of the floor
    made = replace(made, phasors=replace(made.phasors, covariance=made.phasors.covariance * 1e-6))
    _, solution = solved(made)
    assert np.abs(solution.stiffness / truth - 1).max() < 1e-6 * drawn + 1e-12


@pytest.mark.parametrize("case", ["V2 in some", "F1 in some", "both in some", "all declared"])
def test_where_all_is_exact_it_comes_back_to_round_off(make, full, case):
    nothing = {name: (getattr(full, name)[0], 0.0) for name in ("moving_mass", "preload_stiffness", "preload_damping")}
    if case == "all declared":
        more = ("preload_loss_factor", "tyre_mass", "frame_stiffness", "input_mass")
        nothing |= {name: (getattr(full, name)[0], 0.0) for name in more}
    lab = Laboratory(**nothing, noise=1e-4, std_added=0.0)
    made = make(lab, masses=(0.0, 10.0), frequencies=3, families=2, exact=True)
    if case in ("V2 in some", "both in some"):
        made = made.without(2, [0, 1, 6])
    if case in ("F1 in some", "both in some"):
        made = made.without(0, [2, 5])
    _problem, solution = solved(made)
    assert solution.z.size == 0
    assert np.abs(solution.stiffness / made.campaign.stiffness[::2] - 1).max() < 1e-12
    assert solution.objective < 1e-12


def test_rigid_blocks_alone_calibrate_the_channels(make, full):
    made = make(replace(full, noise=1e-5), frequencies=2, families=1, blocks=(4.0, 8.0, 16.0))
    made = made.part(made.family < 0)
    problem, solution = solved(made)
    assert solution.converged
    assert solution.stiffness.shape == (0,)
    truth = made.true_z(problem.shared)
    error = (solution.z - truth) @ np.linalg.inv(solution.covariance) @ (solution.z - truth)
    assert error < 40  # chi-square of 16 degrees: once in a thousand
    names = [parameter.source.text for parameter in problem.shared.parameters]
    between = np.zeros(len(names))
    between[[names.index("gain V1"), names.index("gain V2")]] = problem.shared.std[
        [names.index("gain V1"), names.index("gain V2")]
    ] * [1, -1]
    # V1 = V2 on a block: the ratio of their gains is known as well as the noise of six tests allows
    assert np.sqrt(between @ solution.covariance @ between) == pytest.approx(1e-5 * np.sqrt(2 / 6), rel=0.02)


def test_chunks_change_nothing(campaign, monkeypatch):
    _, whole = solved(campaign)
    for size in (1, 5, 7):
        monkeypatch.setattr(module, "_CHUNK", size)
        problem, parts = solved(campaign)
        rows = [rows for rows, _ in problem.chunks()]
        assert [row.start for row in rows[1:]] == [row.stop for row in rows[:-1]]
        assert (rows[0].start, rows[-1].stop) == (0, campaign.family.size)
        assert parts.z == pytest.approx(whole.z, abs=1e-9)
        assert np.abs(parts.stiffness / whole.stiffness - 1).max() < 1e-12
        assert parts.covariance == pytest.approx(whole.covariance, abs=1e-9)


def test_the_noise_of_a_drive_or_a_unit_does_not_matter(campaign):
    """All noise ten times larger, and all that is stated too: the same values, and ten times the uncertainty."""
    _problem, one = solved(campaign)
    assert one.converged
    assert np.all(np.linalg.eigvalsh(one.covariance) > 0)
    assert np.all(np.diag(one.covariance) <= 1 + 1e-12)  # nothing is known less well than stated


def test_a_valley_that_bends_is_followed(make):
    """A statement is set aside: the gains move by per cent, and K* does not follow them in a straight line."""
    lab = Laboratory(
        moving_mass=(15.0, 0.3),
        preload_stiffness=(12440.0, 250.0),
        preload_damping=(0.0, 20.0),
        std_gain=(0.03,) * 3,
        std_phase=(0.0175,) * 3,
        noise=1e-4,
        undeclared={"gain F1": -0.107, "gain V2": 0.049},
    )
    for seed in range(3):
        problem, first = solved(make(lab, frequencies=8, families=4, seed=seed))
        listed, z = list(problem.shared.parameters), first.z.copy()
        at = [parameter.source.text for parameter in listed].index("gain V2")
        listed[at], z[at] = replace(listed[at], std=listed[at].std * 30), z[at] / 30
        wider = replace(problem, shared=replace(problem.shared, parameters=tuple(listed)))
        solution = solve(wider, first.stiffness, z)
        assert solution.converged
        assert solution.steps < 10  # as from anywhere else
        assert abs(z[at] - solution.z[at]) > 1e-3  # and there was a way to go


def test_a_search_that_cannot_end_says_so(campaign, monkeypatch):
    monkeypatch.setattr(module, "_MOST_STEPS", 1)
    _, solution = solved(campaign)
    assert not solution.converged
    assert "1 steps" in solution.reason


def test_what_nothing_can_lower_is_told(campaign):
    """A start at which no number exists: the best that was met is given, with a reason."""
    problem = campaign.problem()
    start = np.full(problem.conditions.count, 1e5 + 1e4j)
    problem = problem.reweighted(np.full_like(problem.observed.whiten, np.nan))
    with np.errstate(invalid="ignore"):
        solution = solve(problem, start)
    assert not solution.converged
    assert solution.reason


@settings(max_examples=30)
@given(st.lists(st.integers(1, 4), min_size=1, max_size=5), st.integers(0, 2**31))
def test_fitting_k_out_is_a_projection(sizes, seed):
    rng = np.random.default_rng(seed)
    count = sum(sizes)
    by_k, columns = rng.standard_normal((count, 6, 2)), rng.standard_normal((count, 6, 3))
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(int)
    root, share, left = without_stiffness(by_k, columns, starts)
    for at, (first, size) in enumerate(zip(starts, sizes, strict=True)):
        a, b = by_k[first : first + size].reshape(-1, 2), columns[first : first + size].reshape(-1, 3)
        best = np.linalg.lstsq(a, b, rcond=None)[0]
        lost = 1e-13 * np.linalg.cond(a) ** 2
        assert np.abs(root[at] @ share[at] - best).max() < lost * 10
        assert np.abs(left[first : first + size].reshape(-1, 3) - (b - a @ best)).max() < lost * 10
        assert np.abs(root[at] @ root[at].T @ (a.T @ a) - np.eye(2)).max() < lost * 10
