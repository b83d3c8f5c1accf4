"""Specimens with inertia: found by the evidence of the tests alone, K* that of their springs, and none invented."""

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import stats
from tests.core.joint.inertia import LABS, Lab

from fourpole.core.joint import joint as room
from fourpole.core.joint import solve_joint
from fourpole.core.joint.belts import found_specimens, own_stiffness, with_belts
from fourpole.core.joint.joint import _held
from fourpole.core.joint.outputs import outputs
from fourpole.core.phasor import Phasors
from fourpole.core.sources import Kind
from fourpole.core.specimen import Body, Form

BELT = {"kart": 1.2, "truck": 40.0, "mount": 0.4, "massless": 0.0}


#: Those of which one is solved each time, besides many of all.
QUICK = ["car", "car to 60 Hz, constant rim", "car at three pressures", "kart", "mount", "massless"]


def solved(lab, seed, **more):
    """The joint solution, and errors of K', K'' and TR in their standard uncertainties."""
    phasors, rig, keywords, stiffness, tr = lab.draw(seed)
    joint = solve_joint(phasors, rig, np.nan, **keywords, **more)
    values = outputs(joint, phasors, np.nan)
    std = np.sqrt(np.diagonal(values.covariance_of(slice(0, 6), np.zeros(tr.size)), 0, 1, 2))
    found, truth = values.value[:, [0, 1, 5]], np.stack([stiffness.real, stiffness.imag, tr], axis=1)
    return joint, (found - truth) / std[:, [0, 1, 5]]


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.sampled(4)
def test_k_star_is_that_of_the_springs_and_the_mass_is_found(name):
    joint, off = solved(LABS[name], 1)
    assert joint.misfit.fits
    assert not joint.two_roots.any()
    assert np.abs(off).max() < 4
    true = BELT.get(name, 7.0)
    form = Form.MASSLESS if not true else Form.ROD if name == "mount" else Form.BELT
    for found in found_specimens(joint.problem, joint.solution):
        assert found.specimen.form is form
        assert abs(found.specimen.mass - true) < 3 * found.mass_std or not true
        if name.startswith("car"):
            frequency = float(joint.problem.observed.omega[found.test]) / (2 * np.pi)
            _, rim = LABS[name].springs(frequency, int(joint.problem.observed.family[found.test]))
            free = np.sqrt(rim.real / true) / (2 * np.pi)
            off = found.specimen.frequencies(found.stiffness)[0, 0] - free
            assert abs(off) < 4 * found.stds[0]
            assert abs(off) < 0.05 * free


@pytest.mark.statistical
@pytest.mark.parametrize("name", LABS)
@pytest.mark.sampled(12)
def test_uncertainties_are_those_of_many_laboratories(name):
    each = [solved(LABS[name], seed) for seed in range(100, 103)]
    fits = [joint.misfit.fits for joint, _ in each]
    off = np.concatenate([off for joint, off in each if joint.misfit.fits])
    assert np.mean(fits) >= 0.9
    assert np.abs(off).max() < 4
    # The tests of one laboratory have its errors in common, so that each laboratory counts as one.
    assert np.all(np.mean(off**2, axis=0) < stats.chi2.isf(1e-3, len(each)) / len(each))
    if name == "massless":
        assert not any(joint.problem.shared.has_belts for joint, _ in each)


@pytest.mark.parametrize("seed", [2, 4])
@pytest.mark.sampled(2)
def test_a_frame_that_resonates_is_asked_for_by_each_form(seed):
    """Without the frame neither a belt nor a rod explains the tests, and masses at both ends of the specimen do."""
    lab = Lab(rod=2.2, k=2.2e5, share=1.0, frequencies=tuple(np.geomspace(6, 36, 12)), frame=(1.07e6, 144.0),
              std=(0.0015, 0.005, 1e-4), sensors=(0.002, np.deg2rad(0.05)))  # fmt: skip
    joint, off = solved(lab, seed, bodies={"": Body(share=1.0)})
    assert joint.problem.shared.has_belts
    assert np.abs(off).max() < 4


def test_a_search_that_comes_to_no_end_counts_where_massless_specimens_do_not_fit(monkeypatch):
    """As where a frame resonates too, which is asked for after the mass: without both, nothing fits."""
    true, (joint, off) = room.explained, solved(LABS["car"], 1)

    def endless(*args):
        return [(weight, wide, replace(found, converged=False)) for weight, wide, found in true(*args)]

    monkeypatch.setattr(room, "explained", endless)
    again, same = solved(LABS["car"], 1)
    assert joint.problem.shared.has_belts
    assert again.problem.shared.has_belts
    assert np.array_equal(off, same)
    assert not solved(LABS["massless"], 1)[0].problem.shared.has_belts


def test_the_uncertainty_holds_explanations_that_are_as_probable():
    """Two forms whose K* is 1 % and 0.02 rad apart, of which one contradicts the statement."""
    lab = replace(LABS["massless"], frequencies=(10.0, 24.0))
    joint, _ = solved(lab, 1)
    other = replace(joint.solution, stiffness=joint.solution.stiffness * np.exp(0.01 - 0.02j))
    contradicts = replace(joint.misfit, fits=False, tied=3)
    given = [(joint.problem, joint.solution, joint.outlier, joint.misfit), (joint.problem, other, None, contradicts)]
    _, held, _, misfit = _held(given)
    more = [[1e-4, -2e-4], [-2e-4, 4e-4]]
    assert held.doubt - joint.solution.doubt == pytest.approx(np.tile(more, (2, 1, 1)), rel=1e-9)
    assert not misfit.fits
    assert misfit.tied == 3
    alone = _held(given[:1])[1]
    assert np.array_equal(alone.doubt, np.broadcast_to(joint.solution.doubt, alone.doubt.shape))


@pytest.mark.sampled(4)
def test_a_second_mass_is_not_ok():
    joint, _ = solved(Lab(frequencies=LABS["car to 60 Hz"].frequencies, second=2.0), 3)
    assert not joint.misfit.fits


@pytest.mark.sampled(4)
def test_belts_that_differ_are_found_with_one_mass_and_little_noise():
    """A search that begins with one mass in all specimens ends nowhere. One seed: one rig with one set of sensors."""
    belts = {"light": 2.5, "heavy": 3.5, "none": 0.0}
    labs = [
        Lab(belt, mode, masses=(0.0,), conditions=5, k=k, noise=1e-5)
        for belt, mode, k in zip(belts.values(), (110.0, 85.0, 80.0), (0.0, 0.0, 2e5), strict=True)
    ]
    drawn = [lab.draw(6) for lab in labs]
    parts = [phasors for phasors, *_ in drawn]
    phasors = Phasors(*(np.concatenate([getattr(one, f.name) for one in parts]) for f in fields(Phasors)))
    _, rig, keywords, *_ = drawn[0]
    count = len(keywords["family"])
    tests = {name: np.concatenate([one[2][name] for one in drawn]) for name in keywords if name != "channels"}
    tests["family"] += np.repeat(10 * np.arange(3), count)
    joint = solve_joint(phasors, rig, channels=keywords["channels"], specimen=np.repeat(list(belts), count), **tests)
    assert joint.misfit.fits
    found = found_specimens(joint.problem, joint.solution)
    assert len(found) == 15
    for number, one in enumerate(found):
        true = list(belts.values())[number // 5]
        assert abs(one.specimen.mass - true) < 3 * one.mass_std or not true
        assert (one.specimen.form is Form.MASSLESS) == (not true)


@pytest.mark.parametrize("slices", [6, 400])
def test_a_block_whose_mass_is_stated_as_even_fits_and_is_no_exact_rod(slices):
    """Sensors known to 0.05 %. As an exact rod, a chain of six springs has a K' that is off by 0.3 % at 35 Hz."""
    lab = Lab(rod=6.7, k=1.9e5, share=1.0, slices=slices, frequencies=tuple(np.geomspace(5.0, 35.0, 10)),
              sensors=(5e-4, 3e-4), noise=1e-5, std=(5e-3, 2e-3, 1e-3))  # fmt: skip
    for seed in range(3):
        joint, off = solved(lab, seed, bodies={"": Body(mass=6.7, mass_std=0.13, share=1.0, spread=1.0)})
        assert joint.misfit.fits
        assert np.abs(off).max() < 4


def test_a_weight_that_is_stated_brings_a_mass_in_at_once():
    joint, off = solved(LABS["massless"], 5, bodies={"": Body.weighed(9.0)})
    assert joint.problem.shared.has_belts
    assert [one.specimen.form for one in found_specimens(joint.problem, joint.solution)] == [Form.MASSLESS]
    assert joint.misfit.fits
    assert np.abs(off).max() < 4


def test_a_stated_belt_and_frequency_make_k_star_more_certain():
    lab = LABS["car, one mass"]
    free, _ = solved(lab, 2)
    stated, off = solved(lab, 2, bodies={"": Body(7.0, 0.05, frequency=80.0, frequency_std=0.8)})
    assert np.abs(off).max() < 4
    stds = [np.sqrt(found_specimens(one.problem, one.solution)[0].mass_std) for one in (stated, free)]
    assert stds[0] < stds[1]


@pytest.mark.sampled(4)
def test_derivatives_by_the_mass_and_its_springs():
    """Against differences, at an arbitrary point, of a belt and of a rod."""
    phasors, rig, keywords, *_ = Lab(conditions=2, frequencies=(10.0, 24.0)).draw(4)
    problem = solve_joint(phasors, rig, np.nan, **keywords).problem
    bare = replace(problem, shared=replace(problem.shared, parameters=tuple(
        row for row in problem.shared.parameters if "BELT" not in row.source.kind.name)))  # fmt: skip
    for rod in (False, True):
        wide = with_belts(bare, {}, np.full(problem.conditions.count, 2.5e5 + 2e4j), rod=rod)
        z = 0.3 * np.random.default_rng(1).standard_normal(len(wide.shared))
        z += [0.5 * (row.source.kind is Kind.BELT_MASS) for row in wide.shared.parameters]
        stiffness = own_stiffness(wide, z)
        exact, step = wide.columns("by_shared", z, stiffness), 1e-6
        basis = wide.columns("basis", z, stiffness)
        by_k = np.einsum("nij,nik->njk", basis, wide.columns("by_stiffness", z, stiffness))
        for place, row in enumerate(wide.shared.parameters):
            change = step * (np.arange(z.size) == place)
            ends = [wide.columns("residual", z + side * change, stiffness) for side in (1, -1)]
            numeric = np.einsum("nij,ni->nj", basis, ends[1] - ends[0]) / (2 * step)
            assert numeric == pytest.approx(
                exact[:, :, place], rel=1e-4, abs=1e-5 * np.abs(exact[:, :, place]).max() + 1e-6
            ), row
        moved = [wide.columns("residual", z, stiffness * np.exp(side * step)) for side in (1, -1)]
        numeric = np.einsum("nij,ni->nj", basis, moved[1] - moved[0]) / (2 * step)
        assert numeric == pytest.approx(by_k[:, :, 0], rel=1e-4, abs=1e-5 * np.abs(by_k).max())
