"""Campaigns whose truth is known, from the rig in phasors, which shares no formula with the core."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.joint import solve_joint
from fourpole.core.joint.conditions import JointConditions, group_conditions
from fourpole.core.joint.model import Observed
from fourpole.core.joint.outputs import identification
from fourpole.core.joint.shared import Shared
from fourpole.core.joint.solve import Problem
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind, Role
from fourpole.virtual.phasor_rig import CHANNELS, RIG_VALUES, Laboratory, PhasorCampaign, draw, simulate_phasors
from fourpole.virtual.phasor_rig import Conditions as Run

#: Usual sensors and a rig that is known to 1 %.
USUAL = Laboratory(
    moving_mass=(15.0, 0.15),
    preload_stiffness=(12440.0, 120.0),
    preload_damping=(15.0, 5.0),
    std_gain=(0.005,) * 3,
    std_phase=(0.003,) * 3,
    noise=2e-4,
)
#: Everything a laboratory can state, with an uncertainty of each.
FULL = Laboratory(
    moving_mass=(15.0, 0.15),
    preload_stiffness=(12440.0, 120.0),
    preload_damping=(15.0, 2.0),
    preload_loss_factor=(0.05, 0.01),
    tyre_mass=(0.8, 0.05),
    frame_stiffness=(1e6, 5e4),
    input_mass=(0.5, 0.02),
    std_gain=(0.01, 0.012, 0.014),
    std_phase=(0.004, 0.005, 0.006),
    noise=1e-3,
)


#: Errors that a joint solution adds after all that is stated.
_NOBODY_STATES = {*Kind} - {Kind.RIG_VALUE, Kind.GAIN, Kind.PHASE, Kind.ADDED_MASS}
CHANNEL = {"F1": 0, "V1": 1, "V2": 2}


@dataclass(frozen=True)
class Made:
    """A campaign as it is given to the estimator, with its truth."""

    laboratory: Laboratory
    campaign: PhasorCampaign
    phasors: Phasors
    family: np.ndarray
    added_mass: np.ndarray
    k1: np.ndarray
    time: np.ndarray | None = None

    @property
    def rig(self):
        stated = {name: getattr(self.laboratory, name) for name in RIG_VALUES}
        return Rig(**{n: value for n, (value, _) in stated.items()}, std={n: std for n, (_, std) in stated.items()})

    @property
    def channels(self):
        return ChannelUncertainty(np.array(self.laboratory.std_gain), np.array(self.laboratory.std_phase))

    @property
    def errors(self):
        return self.channels.errors(self.phasors.omega, possible=True)

    @property
    def masses(self):
        return sorted(set(self.added_mass.tolist()) - {0.0})

    def identify(self, **changes):
        given = {
            "family": self.family,
            "added_mass": self.added_mass,
            "added_mass_std": self.laboratory.std_added * self.added_mass,
            "channels": self.channels,
            "time": self.time,
        } | changes
        return solve_joint(self.phasors, given.pop("rig", self.rig), given.pop("k1", self.k1), **given)

    def problem(self):
        """Of tests that stand in the order of their conditions."""
        label = group_conditions(self.family, self.phasors.frequency)
        assert np.all(np.diff(label) >= 0)
        masses = np.array(self.masses)
        at = np.searchsorted(masses, self.added_mass) if masses.size else np.zeros(self.family.size, dtype=int)
        return Problem(
            Observed.of(self.phasors, np.where(self.added_mass > 0, at, -1), self.family < 0, self.errors),
            JointConditions(label, self.family, self.phasors.frequency, self.k1),
            Shared.stated(self.rig, self.errors, masses, self.laboratory.std_added * masses),
            tuple(error.source for error in self.errors),
        )

    def true_z(self, shared):
        """The truth in stated uncertainties; a gain by its logarithm, as the model has it."""
        truth = self.campaign.truth
        true = {
            Role.RIG: lambda one: getattr(truth, one.source.of) - one.stated,
            Role.CHANNEL: lambda one: (
                np.log1p(truth.gain[CHANNEL[one.source.of]]) if one.is_gain else truth.phase[CHANNEL[one.source.of]]
            ),
            Role.MASS: lambda one: truth.added_mass[self.masses[one.index]] - one.stated,
        }
        stated = [one for one in shared.parameters if one.source.kind not in _NOBODY_STATES]
        assert shared.parameters[: len(stated)] == tuple(stated)
        return np.array([true[one.source.role](one) / one.std for one in stated])

    def part(self, rows):
        """Some of the tests, in any order."""
        return replace(
            self,
            phasors=Phasors(*(getattr(self.phasors, name)[rows] for name in Phasors.__dataclass_fields__)),
            family=self.family[rows],
            added_mass=self.added_mass[rows],
            k1=self.k1[rows],
            time=None if self.time is None else self.time[rows],
        )

    def recorded(self, amplitudes):
        """The campaign with other amplitudes in its recordings."""
        return replace(self, phasors=replace(self.phasors, amplitudes=amplitudes))

    def errors_of(self, joint):
        """Errors of Re and Im K* of each test in its uncertainty (N, 2), and of K' relative to K' (N,)."""
        found = identification(joint, self.phasors, self.k1, 0.0)
        error = found.stiffness - self.campaign.stiffness
        std = np.sqrt(np.diagonal(found.stiffness_covariance, axis1=1, axis2=2))
        return np.stack([error.real, error.imag], axis=1) / std, error.real / self.campaign.stiffness.real

    def without(self, channel, rows):
        """A channel is absent in some tests."""
        amplitudes, covariance = self.phasors.amplitudes.copy(), self.phasors.covariance.copy()
        amplitudes[rows, channel] = np.nan
        both = slice(2 * channel, 2 * channel + 2)
        covariance[rows, both], covariance[rows, :, both] = 0.0, 0.0
        return replace(self, phasors=replace(self.phasors, amplitudes=amplitudes, covariance=covariance))


def make_campaign(
    laboratory=FULL,
    *,
    seed=0,
    masses=(0.0,),
    frequencies=5,
    families=3,
    blocks=(),
    spread=0.0,
    exact=False,
    scatter=0.0,
    drift=0.0,
    within=np.inf,
):
    """Tests in the order of their conditions, rigid blocks first.

    `exact`: no noise, but weights as if there were; `spread` of the frequencies in a condition and `scatter` of log K*,
    both relative; `drift` of log K* over the run, in which all conditions are tested once before any is repeated;
    `within`: the truth is no further than so many uncertainties from what is stated.
    """
    rng = np.random.default_rng(seed)
    k1, k2, c = rng.uniform([[1.2e5], [7e4], [600.0]], [[2.4e5], [1.6e5], [1400.0]], (3, families))
    mean = np.linspace(10.0, 24.0, frequencies)
    family = np.repeat(np.arange(families), frequencies * len(masses))
    frequency = np.tile(np.repeat(mean, len(masses)), families) * (1 + spread * rng.uniform(-1, 1, family.size))
    added = np.tile(masses, frequencies * families)
    block_mass, block_frequency = np.repeat(blocks, 2).astype(float), np.tile([11.0, 21.0], len(blocks))
    family = np.append(np.full(block_mass.size, -1), family)
    frequency, added = np.append(block_frequency, frequency), np.append(block_mass, added)
    k2, c = k2[family] * (frequency / 15) ** 0.6, c[family] * (frequency / 15) ** 0.2
    time = np.tile(np.arange(len(masses)), frequencies * families) * frequencies * families
    time = np.append(np.zeros(block_mass.size), time + np.repeat(np.arange(frequencies * families), len(masses)))
    if scatter or drift:
        arm = 1 / (1 / k2 + 1 / (2j * np.pi * frequency * c))
        place = time / np.ptp(time)
        moved = np.random.default_rng(seed + 1000).standard_normal((2, family.size))
        arm = 1 / ((k1[family] + arm) * np.exp(scatter * (moved[0] + 1j * moved[1]) + drift * place) - k1[family])
        k2, c = 1 / arm.real, -1 / (2 * np.pi * frequency * arm.imag)
    run = Run(frequency, k1[family], k2, c, added_mass=added, calibration=family < 0)
    truth = None
    if np.isfinite(within):
        truth = limited(laboratory, draw(laboratory, rng, added_masses=[*masses, *blocks]), within)
    campaign = simulate_phasors(laboratory, run, rng, truth=truth)
    phasors = campaign.phasors
    if exact:
        turn = (1 + campaign.truth.gain) * np.exp(1j * campaign.truth.phase)
        phasors = replace(phasors, amplitudes=campaign.true_amplitudes * turn)
    known = np.where(family < 0, np.nan, k1[family])
    return Made(laboratory, campaign, phasors, family, added, known, time if drift else None)


def limited(laboratory, truth, within):
    """The truth with nothing that was drawn further from what is stated than so many uncertainties."""
    rig = {}
    for name in set(RIG_VALUES) - set(laboratory.undeclared):
        value, std = getattr(laboratory, name)
        rig[name] = float(np.clip(getattr(truth, name), value - within * std, value + within * std))
    errors = {"gain": truth.gain.copy(), "phase": truth.phase.copy()}
    for what, stated in (("gain", laboratory.std_gain), ("phase", laboratory.std_phase)):
        for at, channel in enumerate(CHANNELS):
            if f"{what} {channel}" not in laboratory.undeclared:
                errors[what][at] = np.clip(errors[what][at], -within * stated[at], within * stated[at])
    return replace(truth, **errors, **rig)


class Dense:
    """The whole least-squares problem of a campaign at once, drives and all, by scipy and differences alone."""

    def __init__(self, made):
        self.made, lab = made, made.laboratory
        stated = {name: getattr(lab, name)[1] for name in RIG_VALUES}
        stated |= dict(zip([f"gain {c}" for c in CHANNELS], lab.std_gain, strict=True))
        stated |= dict(zip([f"phase {c}" for c in CHANNELS], lab.std_phase, strict=True))
        # in the order of the estimator: gain and phase of each channel in turn
        order = [*RIG_VALUES, *(f"{what} {c}" for c in CHANNELS for what in ("gain", "phase"))]
        stated = {name: stated[name] for name in order} | {f"mass {m:g}": lab.std_added * m for m in made.masses}
        self.std = {name: std for name, std in stated.items() if std > 0}
        self.condition = group_conditions(made.family, made.phasors.frequency)
        self.count, self.tests = int(self.condition.max()) + 1, made.family.size
        self.omega, self.rigid = made.phasors.omega, made.family < 0
        first = [int(np.argmax(self.condition == c)) for c in range(self.count)]
        self.reference = made.campaign.stiffness[first]
        amplitudes = made.phasors.amplitudes
        self.seen = np.repeat(np.isfinite(amplitudes), 2, axis=1)
        sigma = np.sqrt(np.diagonal(made.phasors.covariance, axis1=1, axis2=2))
        self.weight = np.where(self.seen, 1 / np.where(self.seen, sigma, 1.0), 0.0)
        self.measured = np.nan_to_num(np.stack([amplitudes.real, amplitudes.imag], axis=2).reshape(-1, 6))

    def moved(self, x):
        return {name: value * std for (name, std), value in zip(self.std.items(), x, strict=False)}

    def stiffness(self, x):
        parts = x[len(self.std) :][: 2 * self.count].reshape(-1, 2)
        k = self.reference * np.exp(parts[:, 0] + 1j * parts[:, 1])
        return np.where(self.rigid, 1.0, np.append(k, 1.0)[self.condition])

    def impedance(self, x):
        moved, s, lab = self.moved(x), 1j * self.omega, self.made.laboratory
        rig = {name: getattr(lab, name)[0] + moved.get(name, 0.0) for name in RIG_VALUES}
        added = self.made.added_mass + np.array([moved.get(f"mass {m:g}", 0.0) for m in self.made.added_mass])
        mass = rig["moving_mass"] + added + np.where(self.rigid, 0.0, rig["tyre_mass"])
        leaf = rig["preload_stiffness"] * (1 + 1j * rig["preload_loss_factor"]) + s * rig["preload_damping"]
        return s * mass + 1 / (s / leaf + s / rig["frame_stiffness"]), rig["input_mass"]

    def ratio(self, x):
        k, (impedance, _) = self.stiffness(x), self.impedance(x)
        return np.where(self.rigid, 1.0, k / (k + 1j * self.omega * impedance))

    def residual(self, x):
        moved, (impedance, input_mass), ratio = self.moved(x), self.impedance(x), self.ratio(x)
        drive = x[-2 * self.tests :].reshape(-1, 2) @ [1, 1j] * self.made.campaign.true_amplitudes[:, 1]
        turn = np.exp([moved.get(f"gain {c}", 0.0) + 1j * moved.get(f"phase {c}", 0.0) for c in CHANNELS])
        unit = np.stack([impedance * ratio + 1j * self.omega * input_mass, np.ones_like(ratio), ratio], axis=1)
        model = unit * turn * drive[:, None]
        parts = np.stack([model.real, model.imag], axis=2).reshape(-1, 6)
        return np.concatenate([x[: len(self.std)], ((parts - self.measured) * self.weight).ravel()])

    def solve(self):
        start = np.zeros(len(self.std) + 2 * self.count + 2 * self.tests)
        start[-2 * self.tests :: 2] = 1.0
        found = least_squares(self.residual, start, "3-point", x_scale="jac", xtol=3e-16, ftol=3e-16, gtol=3e-16)
        scale = np.linalg.norm(found.jac, axis=0)
        self.x = found.x
        self.covariance = np.linalg.inv((found.jac / scale).T @ (found.jac / scale)) / scale / scale[:, None]
        return self

    def outputs(self, x):
        k, k1 = self.stiffness(x), self.made.k1
        arm = 1 / np.where(self.rigid, 1 + 1j, k - k1)
        tr = np.abs(self.ratio(x))
        return np.stack([k.real, k.imag, k.imag / k.real, 1 / arm.real, -1 / (self.omega * arm.imag), tr], axis=1)

    def output_covariance(self):
        step = 1e-5 * np.sqrt(np.diag(self.covariance))  # far inside what is linear, far above round-off
        by = []
        for at, size in enumerate(step):
            move = np.zeros(step.size)
            move[at] = size
            by.append((self.outputs(self.x + move) - self.outputs(self.x - move)) / (2 * size))
        return np.einsum("pni,pq,qnj->nij", by, self.covariance, by)


@pytest.fixture(scope="session")
def make():
    return make_campaign


@pytest.fixture(scope="session")
def full():
    return FULL


@pytest.fixture(scope="session")
def dense():
    """A campaign solved by `Dense`, and by the estimator."""
    made = make_campaign(
        replace(FULL, noise=1e-4), masses=(0.0, 10.0), frequencies=3, families=2, blocks=(8.0,), seed=4
    )
    made = made.without(2, np.array([3, 8])).without(0, np.array([5]))
    return made, Dense(made).solve(), made.identify()
