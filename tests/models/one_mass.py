"""Campaigns with one mass, in phasors, by formulas of their own: gains, phases and rig as a laboratory draws them."""

from dataclasses import replace

import numpy as np

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.joint import Joint, solve_joint
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.fitting.likelihood import likelihood_of
from fourpole.models.data import StiffnessData
from fourpole.models.problem import Recorded

MASS, SPRING, DAMPER = 15.0, 12e3, 20.0


def zener(w, rng):
    k, k2, c = 180e3 * rng.uniform(0.8, 1.2), 60e3 * rng.uniform(0.5, 2), 700 * rng.uniform(0.5, 2)
    return k + k2 * 1j * w * c / (k2 + 1j * w * c)


def broad(w, rng):
    """A relaxation spectrum of nine times."""
    turn = 1j * np.outer(w, np.geomspace(1e-4, 1.0, 9))
    return 150e3 + np.sum(rng.uniform(2e3, 2e4, 9) * turn / (1 + turn), axis=1)


def impossible(w, rng):
    """A damper whose C rises with frequency, while K' does not."""
    return 180e3 + 1j * w * 300.0 * (w / 60) ** 0.2


def solved(seed, tyres, std, noise=1e-4, count=9, band=(6.0, 30.0), gain=1.0, delay=0.0) -> tuple[Joint, np.ndarray]:
    """The joint solution of one test per frequency and tyre, and the true K* of each test [N/m].

    `gain` and `delay` [s] of V1 are errors that nobody states.
    """
    rng = np.random.default_rng(seed)
    f = np.tile(np.geomspace(*band, count), len(tyres))
    w = 2 * np.pi * f
    truth = np.concatenate([tyre(w[:count], rng) for tyre in tyres])
    turn = np.exp(std * rng.standard_normal(3) + 1j * std / 3 * rng.standard_normal(3))
    beyond = DAMPER + 1j * w * MASS * (1 + 0.02 * rng.standard_normal())
    beyond = beyond + SPRING * (1 + 0.02 * rng.standard_normal()) / (1j * w)
    v1 = 2e-3 * w * np.exp(1j * rng.uniform(0, 6, w.size))
    v2 = v1 * truth / (truth + 1j * w * beyond)
    amplitudes = np.stack([beyond * v2, v1, v2], axis=1) * turn
    amplitudes[:, 1] *= gain * np.exp(-1j * w * delay)
    size = noise * np.abs(amplitudes)
    amplitudes = amplitudes + size * (rng.standard_normal(size.shape) + 1j * rng.standard_normal(size.shape))
    covariance = np.repeat(size, 2, axis=1)[:, :, None] ** 2 * np.eye(6)
    phasors = Phasors(f, amplitudes, covariance, np.zeros(f.size), np.full(f.size, np.inf))
    uncertain = {"moving_mass": 0.02 * MASS, "preload_stiffness": 0.02 * SPRING, "preload_damping": 4.0}
    joint = solve_joint(
        phasors,
        Rig(moving_mass=MASS, preload_stiffness=SPRING, preload_damping=DAMPER, std=uncertain),
        family=np.repeat(np.arange(len(tyres)), count),
        channels=ChannelUncertainty(np.full(3, std), np.full(3, std / 3)),
    )
    return joint, truth


def as_recorded(joint: Joint, tyres: int) -> list[StiffnessData]:
    """The data of each tyre, whose covariance and shared errors are those of the recordings near a model."""
    likelihood = likelihood_of(joint)
    made = []
    for places in np.split(np.arange(joint.solution.stiffness.size), tyres):
        omega = 2 * np.pi * joint.problem.conditions.mean_frequency[places]
        near = Recorded(likelihood, places, omega, np.ones(places.size, dtype=complex))
        found = near(likelihood.stiffness[places])
        made.append(replace(found, reference=None, recorded=np.array(near, dtype=object)))
    return made
