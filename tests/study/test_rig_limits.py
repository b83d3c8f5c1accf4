"""What is said of a rig as found, and of K2 and C: just below each limit one decision, just above it the other."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.joint import solve_joint
from fourpole.core.joint.outputs import outputs
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind, Source
from fourpole.study.compare import _arm_check
from fourpole.study.identify import _skew, _with_specimen, added_masses
from fourpole.study.points import StaticStiffness
from fourpole.study.rig_estimate import NoteCode, RunOrder
from fourpole.study.rig_solution import rig_estimate

BELOW, ABOVE = 0.99, 1.01
STD = {"moving_mass": 0.3, "preload_stiffness": 100.0}


def solved(**further):
    """Four tests without noise on a rig that is as stated."""
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0, std=STD | dict.fromkeys(further, 0.1), **further)
    omega = 2 * np.pi * np.array([10.0, 12.0, 14.0, 16.0])
    impedance = rig.impedance(omega)
    ratio = (2e5 + 4e4j) / (2e5 + 4e4j + 1j * omega * impedance)
    amplitudes = 0.06 * np.stack([impedance * ratio, np.ones(4), ratio], axis=1)
    covariance = np.broadcast_to(1e-10 * np.eye(6), (4, 6, 6))
    phasors = Phasors(omega / (2 * np.pi), amplitudes, covariance, np.zeros(4), np.full(4, np.inf))
    return solve_joint(phasors, rig), phasors


@pytest.fixture(scope="module")
def bare():
    return solved()


def said(case, *, z=(0.0, 0.0), std=0.1, **misfit):
    """Rows of the rig's values and notes, for values found at z with one relative uncertainty of all."""
    joint, phasors = case
    count = len(joint.stated)
    z = np.append(z, np.zeros(count - len(z)))
    solution = replace(joint.solution, z=z, covariance=std**2 * np.eye(count))
    joint = replace(joint, solution=solution, misfit=replace(joint.misfit, fits=True, conflicts=(), **misfit))
    found = rig_estimate("", [(name, 1) for name in "ABCD"], joint, outputs(joint, phasors, np.nan))
    return {row["value"]: row for row in found.rows}, found.notes


@pytest.mark.parametrize(("std", "finding"), [(BELOW * 0.9, "found"), (ABOVE * 0.9, "not determined")])
def test_a_value_is_determined_below_nine_tenths_of_its_stated_uncertainty(bare, std, finding):
    assert said(bare, std=std)[0]["moving_mass"]["finding"] == finding


def test_above_half_of_its_stated_uncertainty_a_value_rests_in_part_on_the_statement(bare):
    remarks = [said(bare, std=std)[0]["moving_mass"]["remarks"] for std in (0.1, BELOW * 0.5, ABOVE * 0.5, 0.8)]
    assert remarks[0] == remarks[1] != remarks[2] == remarks[3]


@pytest.mark.parametrize(("information", "limit"), [(BELOW * 1e-8, False), (ABOVE * 1e-8, True)])
def test_without_information_there_is_no_detection_limit(bare, information, limit):
    row = said(bare, std=1 / np.sqrt(1 + information))[0]["moving_mass"]
    assert (row["seen from"] is not None) == limit


@pytest.mark.parametrize(("at", "name"), [*enumerate(STD)])
def test_a_value_two_uncertainties_from_its_statement_may_hold_a_part_nobody_stated(bare, at, name):
    """The uncertainty then has the whole distance in it."""
    near, far = (said(bare, z=factor * 2.0 * np.eye(2)[at])[0][name]["u(found)"] for factor in (BELOW, ABOVE))
    assert near == pytest.approx(0.1 * STD[name])
    assert far == pytest.approx(np.hypot(0.1, ABOVE * 2.0) * STD[name])


@pytest.mark.parametrize(
    ("at", "name", "declared"), [(0, "moving_mass", "tyre_mass"), (1, "preload_stiffness", "frame_stiffness")]
)
def test_a_value_whose_hidden_part_is_stated_hides_nothing(at, name, declared):
    case = solved(**{declared: 1.0 if declared == "tyre_mass" else 1e6})
    assert said(case, z=3.0 * np.eye(2)[at])[0][name]["u(found)"] == pytest.approx(0.1 * STD[name])


@pytest.mark.parametrize(("inflation", "notes"), [(1.19, 0), (1.21, 1)])
def test_noise_a_fifth_larger_than_the_recordings_say_is_worth_a_note(bare, inflation, notes):
    assert said(bare, inflation=inflation)[1].count(NoteCode.NOISE) == notes


def test_what_k_rests_on_is_said_with_its_share():
    """With a weighed mass on the mass, of which an error of 1 % would not show; without it on the gains."""
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0, std={"moving_mass": 0.3, "preload_stiffness": 250.0})
    omega = 2 * np.pi * np.tile([10.0, 12.0, 14.0, 16.0], 2)
    mass = np.repeat([0.0, 10.0], 4)
    impedance = rig.impedance(omega, mass)
    ratio = (2e5 + 4e4j) / (2e5 + 4e4j + 1j * omega * impedance)
    amplitudes = 0.06 * np.stack([impedance * ratio, np.ones(8), ratio], axis=1)
    noise = np.repeat(2e-4 * np.abs(amplitudes), 2, axis=1) ** 2
    phasors = Phasors(omega / (2 * np.pi), amplitudes, noise[:, :, None] * np.eye(6), np.zeros(8), np.full(8, np.inf))
    channels = ChannelUncertainty(np.full(3, 0.005), np.full(3, 0.005))
    said = []
    for rows in (slice(None), slice(0, 4)):
        some = phasors.part(rows)
        joint = solve_joint(some, rig, added_mass=mass[rows], added_mass_std=2e-3 * mass[rows], channels=channels)
        keys = [(f"D{i}", 1) for i in range(len(some.frequency))]
        said.append(rig_estimate("", keys, joint, outputs(joint, some, np.nan)))
    massed, bare = said
    share = float(re.search(r"the added mass of 10 kg \((\d+) % of its u²\)", massed.rests)[1])
    assert 50 < share <= 100
    assert any("an added mass of 10" in one.words for one in massed.unseen)  # its error shows late, and moves K' much
    assert "of V1" in bare.rests


def drifting():
    """Twelve tests in three rounds of a specimen that becomes 2 % stiffer over the run."""
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0, std=STD)
    omega, place = 2 * np.pi * np.tile([10.0, 12.0, 14.0, 16.0], 3), np.linspace(-0.5, 0.5, 12)
    impedance, stiffness = rig.impedance(omega), (2e5 + 4e4j) * np.exp(0.02 * place)
    ratio = stiffness / (stiffness + 1j * omega * impedance)
    amplitudes = 0.06 * np.stack([impedance * ratio, np.ones(12), ratio], axis=1)
    noise = np.repeat(2e-4 * np.abs(amplitudes), 2, axis=1) ** 2
    phasors = Phasors(omega / (2 * np.pi), amplitudes, noise[:, :, None] * np.eye(6), np.zeros(12), np.full(12, np.inf))
    return place, rig, phasors


@pytest.mark.parametrize("static", [None, -0.5, 0.25])
def test_a_drift_is_in_the_uncertainty_of_k1(static):
    """K1 was measured at one place of the run: at a known one, or at any."""
    place, rig, phasors = drifting()
    every, no = np.ones(12), np.full(12, np.nan)
    setup = {
        "rig": rig, "k1": 180e3 * every, "family": np.zeros(12, dtype=int), "nominal_frequency": no,
        "added_mass": 0 * every, "added_mass_std": 0 * every, "channels": ChannelUncertainty(),
        "specimen": np.full(12, "radial", dtype=object), "time": 7200.0 * place, "apart": 0 * every, "lines": every,
        "recording": np.arange(12),
    }  # fmt: skip
    joint = solve_joint(phasors, **setup)
    assert [source.of for source in joint.misfit.specimens] == ["radial", "radial"]
    when = np.nan if static is None else 7200.0 * static
    k1 = StaticStiffness(180e3, 500.0, parts={Source(Kind.K1_FIT): 500.0}, time=when)
    k1_std, parts = _with_specimen(setup, joint, [k1] * 12, RunOrder.TIME)
    apart = np.sqrt(place**2 + 1 / 12) if static is None else np.abs(place - static)
    expected = 0.02 * 180e3 * apart
    drawn = np.array([part[Source(Kind.K1_DRIFT)] for part in parts])
    assert drawn == pytest.approx(expected, rel=0.02, abs=1.0)
    assert k1_std == pytest.approx(np.hypot(500.0, drawn))


def test_a_scatter_that_was_found_is_in_the_uncertainty_of_k1():
    """K* of repeats scatters by 1 %, and so does K1 between the static and a dynamic test."""
    place, _, _ = drifting()
    joint = SimpleNamespace(
        misfit=SimpleNamespace(scatter=0.01), stated=SimpleNamespace(parameters=()), order=np.arange(12),
        found=np.zeros(0), found_std=np.zeros(0),
        problem=SimpleNamespace(observed=SimpleNamespace(place=place, block=lambda _: np.full(12, -1)), shared=None),
    )  # fmt: skip
    setup = {"k1": np.append(np.full(11, 180e3), np.nan), "time": place, "specimen": np.full(12, "radial")}
    k1 = [StaticStiffness(180e3, 500.0, parts={Source(Kind.K1_FIT): 500.0})] * 11 + [StaticStiffness()]
    k1_std, parts = _with_specimen(setup, joint, k1, RunOrder.TIME)
    assert k1_std[:11] == pytest.approx(np.hypot(500.0, 1800.0))
    assert np.isnan(k1_std[11])
    assert parts[0] == {Source(Kind.K1_FIT): 500.0, Source(Kind.SCATTER): pytest.approx(1800.0)}
    assert parts[11] == {}


# K2 and C of one test.


def result(*, relative=(0.01, 0.01), off=(20e3, 30e3), spread=(1e3, 1e3), k1_std=0.0, passive=True):
    """Of one test: K2 and C with their relative uncertainties; K* off K1 and zero, with its uncertainty."""
    k2, c = (120e3, 700.0) if passive else (np.nan, np.nan)
    return SimpleNamespace(
        arm_covariance=np.diag([(relative[0] * k2) ** 2, (relative[1] * c) ** 2])[None],
        frequency=np.array([10.0]),
        k1=np.array([180e3]),
        k1_std=np.array([k1_std]),
        k2=np.array([k2]),
        c=np.array([c]),
        stiffness=np.array([complex(180e3 + off[0], off[1])]),
        stiffness_covariance=np.diag(np.square(spread))[None],
        reasons=("" if passive else "no passive arm",),
    )


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize(("relative", "drawn"), [(BELOW * 0.1, False), (ABOVE * 0.1, True)])
def test_k2_and_c_are_drawn_where_they_are_known_to_more_than_a_tenth(relative, drawn, which):
    stds = np.where(np.arange(2) == which, relative, 0.01)
    assert _skew(result(relative=stds, spread=(1.0, 1.0)))[0] == drawn


@pytest.mark.parametrize("side", ["K'", "K1", "K''"])
@pytest.mark.parametrize(("factor", "drawn"), [(BELOW, False), (ABOVE, True)])
def test_k2_and_c_are_drawn_where_curvature_moves_an_end_of_an_interval_by_a_fifth_of_u(factor, drawn, side):
    """K2 = a + b²/a and w C = b + a²/b: the shift s = h u² of the more bent one is 0.2/1.96² of its whole u."""
    a, b = (40e3, 20e3) if side != "K''" else (20e3, 40e3)  # C is the more bent one, or K2
    slope, bend, share = 2 * 40e3 / 20e3, 1 / 20e3, 0.2 / 1.959964**2
    std = factor * share * slope / (bend * np.sqrt(1 - 3 * share**2))
    k1_std, spread = (std, (1.0, 1.0)) if side == "K1" else (0.0, np.where([side == "K'", side == "K''"], std, 1.0))
    assert _skew(result(off=(a, b), spread=spread, k1_std=k1_std))[0] == drawn


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize(("deviations", "drawn"), [(BELOW * 3.0, True), (ABOVE * 3.0, False)])
def test_k2_and_c_are_drawn_where_k_star_misses_them_by_no_more_than_three_uncertainties(deviations, drawn, which):
    off = np.where(np.arange(2) == which, -deviations * 1e3, 20e3)
    assert _skew(result(off=off, passive=False))[0] == drawn


def test_the_uncertainty_of_k1_counts_too():
    assert not _skew(result(off=(-4e3, 20e3), passive=False))[0]
    assert _skew(result(off=(-4e3, 20e3), passive=False, k1_std=1e3))[0]


def verdict(found, share=None):
    """Of K2 and C; `share` of the draws are not passive."""
    interval = SimpleNamespace(quantiles=np.array([1e3, 2e3, np.inf]), non_passive_share=share)
    group = SimpleNamespace(intervals={} if share is None else {0: (interval, interval)}, result=found)
    return _arm_check(group, 0, StaticStiffness()).verdict


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize(("relative", "expected"), [(BELOW * 0.3, "ok"), (ABOVE * 0.3, "warning")])
def test_k2_or_c_known_to_more_than_three_tenths_is_a_warning(relative, expected, which):
    assert verdict(result(relative=np.where(np.arange(2) == which, relative, 0.01))) == expected


@pytest.mark.parametrize(("share", "expected"), [(0.974, "warning"), (0.976, "rejected")])
def test_a_test_is_rejected_where_more_than_975_of_1000_draws_are_not_passive(share, expected):
    assert verdict(result(passive=False), share) == expected


@pytest.mark.parametrize(("stated", "expected"), [(None, 0.02), (0.03, 0.03), (0.0, 0.0)])
def test_an_added_mass_of_unstated_uncertainty_is_known_to_a_five_hundredth(stated, expected):
    """Bolts, brackets and the balance: 0.2 %."""
    weighed = {"added_mass": 10.0, "u(added_mass)": np.nan if stated is None else stated}
    assert added_masses([SimpleNamespace(added_mass=10.0, values=weighed)])[1] == pytest.approx([expected])
