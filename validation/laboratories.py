"""Laboratories as they come: a campaign of each, at phasor level, from its number alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.rig import Rig
from fourpole.virtual import CROSS_PLY, RADIAL_PLY
from fourpole.virtual.phasor_rig import RIG_VALUES, Conditions, Laboratory, PhasorCampaign, simulate_phasors

__all__ = ["MASSES", "RANGES", "TYRES", "Case", "case"]

SEED = 1982

TYRES = (CROSS_PLY.name, RADIAL_PLY.name)
MASSES = {"one mass": (0.0,), "two masses": (0.0, 10.0), "three masses": (0.0, 5.0, 10.0)}

#: What is drawn, and from where; the words of the document.
RANGES = {
    "gain of F1, V1, V2, each known to": "0.02 % to 3 %",
    "phase of each, known to": "20 degrees times that: 0.004 to 0.6 degrees",
    "moving mass and preload spring, known to": "0.5 % to 3 %",
    "preload damper": "15 N s/m, known to 0.5 to 20 N s/m",
    "noise of Re and Im of each amplitude": "3e-5 to 1e-3 of it",
    "tests with a tyre": "16 to 128",
    "masses": "0; or 0 and 10; or 0, 5 and 10 kg, weighed to 0.01 %",
    "tyres": "both virtual tyres, 1.0 to 2.4 bar, 1000 to 2000 N",
    "frequencies": "2 to 20 from 10 to 24 Hz; each test within 0.3 % of its nominal one",
    "K1, known to": "0.1 % to 1 %, one error per tyre, pressure and preload",
    "declared tyre mass, in 3 of 10 campaigns": "0.8 kg, known to 10 %",
    "declared frame, in 1 of 4": "0.3 to 3 MN/m, known to 10 %",
    "declared loss factor of the spring, in 1 of 4": "0.02 to 0.1, known to 20 %",
    "declared input mass, in 1 of 5": "0.5 kg, known to 5 %",
    "rigid blocks of 5, 10 and 15 kg, in 3 of 20": "each at 4 frequencies",
    "without V2, in 3 of 10": "one test in five",
    "belts, in 1 of 4": "of each tyre 0.5 to 8 kg; springs as 0.1 to 0.4 at rest, of one law, or constant at the rim",
    "weight of the tyres, stated in half of these": "the belt is 40 to 80 % of it",
}


@dataclass(frozen=True)
class Case:
    """One campaign: what is given to the estimator, and the truth."""

    number: int
    laboratory: Laboratory
    masses: str
    campaign: PhasorCampaign
    family: NDArray[np.int64]
    added_mass: NDArray[np.float64]
    k1: NDArray[np.float64]
    k1_std: NDArray[np.float64]
    specimen: NDArray[np.str_]
    belts: dict[str, float]
    weights: dict[str, float]

    @property
    def rig(self) -> Rig:
        """As stated."""
        stated = {name: getattr(self.laboratory, name) for name in RIG_VALUES}
        return Rig(**{n: value for n, (value, _) in stated.items()}, std={n: std for n, (_, std) in stated.items()})

    @property
    def channels(self) -> ChannelUncertainty:
        """As stated."""
        return ChannelUncertainty(np.array(self.laboratory.std_gain), np.array(self.laboratory.std_phase))

    @property
    def settings(self) -> dict[str, object]:
        """What the table is split by."""
        laboratory = self.laboratory
        return {
            "masses": self.masses,
            "sensors": laboratory.std_gain[0],
            "noise": laboratory.noise,
            "rig std": laboratory.moving_mass[1] / laboratory.moving_mass[0],
            "tests": int(self.family.size),
        }


def case(number: int) -> Case:
    """The campaign of that number."""
    rng = np.random.default_rng(np.random.SeedSequence(SEED, spawn_key=(0, number)))
    laboratory = _laboratory(rng)
    masses = str(rng.choice(list(MASSES)))
    added = np.array(MASSES[masses])
    target = _between(rng, 16, 128) / added.size
    families = int(
        rng.integers(int(np.ceil(target / 20)), 1 + min(8, max(1, int(target / 2))))
    )  # at most 20 frequencies
    frequencies = max(2, round(target / families))

    family = np.repeat(np.arange(families), frequencies * added.size)
    mean = np.tile(np.repeat(np.linspace(10.0, 24.0, frequencies), added.size), families)
    frequency = mean * (1 + rng.uniform(-0.003, 0.003, mean.size))
    mass = np.tile(added, frequencies * families)
    k1, k2, c, specimen = _tyres(rng, family, frequency)
    k1_std_share = _between(rng, 1e-3, 1e-2)
    stated_k1 = k1 * (1 + k1_std_share * rng.standard_normal(families)[family])
    has_v2 = ~((rng.random(mean.size) < 0.2) & (rng.random() < 0.3))
    block = np.zeros(mean.size, dtype=bool)
    if rng.random() < 0.15:
        blocks = np.repeat([5.0, 10.0, 15.0], 4)
        family, mass = np.append(family, np.full(12, -1)), np.append(mass, blocks)
        frequency = np.append(frequency, np.tile([10.0, 14.0, 19.0, 24.0], 3))
        k1, k2, c = (np.append(values, np.ones(12)) for values in (k1, k2, c))
        specimen = np.append(specimen, specimen[:1].repeat(12))
        stated_k1, has_v2 = np.append(stated_k1, np.full(12, np.nan)), np.append(has_v2, np.ones(12, dtype=bool))
        block = np.append(block, np.ones(12, dtype=bool))
    conditions = Conditions(frequency, k1, k2, c, added_mass=mass, calibration=block, has_motion_out=has_v2)
    belts, weights, share = _belts(
        np.random.default_rng(np.random.SeedSequence(SEED, spawn_key=(1, number))), conditions
    )
    belt_mass = [belts.get(name, 0.0) for name in specimen.tolist()]
    campaign = simulate_phasors(laboratory, replace(conditions, belt_mass=belt_mass, belt_share=share), rng)
    k1_std = np.abs(k1_std_share * stated_k1)
    return Case(number, laboratory, masses, campaign, family, mass, stated_k1, k1_std, specimen, belts, weights)


def _belts(
    rng: np.random.Generator, conditions: Conditions
) -> tuple[dict[str, float], dict[str, float], NDArray[np.complex128]]:
    """The belt of each tyre [kg], none in most campaigns; weights as stated [kg]; share of the springs in each test."""
    laden, constant = rng.random() < 0.25, rng.random() < 0.5
    masses = {tyre.name: _between(rng, 0.5, 8.0) for tyre in (CROSS_PLY, RADIAL_PLY)}
    share = _between(rng, 0.1, 0.4)
    weighed = rng.random() < 0.5
    weights = {name: mass / rng.uniform(0.4, 0.8) for name, mass in masses.items()}
    belts = masses if laden else {}, weights if laden and weighed else {}
    k1, k2, c, frequency = (
        np.asarray(values, dtype=float) for values in (conditions.k1, conditions.k2, conditions.c, conditions.frequency)
    )
    if not constant:
        return *belts, np.full(frequency.size, share, dtype=complex)
    flexibility = 1 / (k1 + 1 / (1 / k2 + 1 / (2j * np.pi * frequency * c)))
    rim = (1 + share) / share * k1
    return *belts, 1 / (rim * flexibility - 1)


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """Even in the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _laboratory(rng: np.random.Generator) -> Laboratory:
    gain, mass, spring = _between(rng, 2e-4, 0.03), _between(rng, 5e-3, 0.03), _between(rng, 5e-3, 0.03)
    damping, noise = _between(rng, 0.5, 20.0), _between(rng, 3e-5, 1e-3)
    frame, loss = _between(rng, 3e5, 3e6), _between(rng, 0.02, 0.1)
    has_tyre_mass, has_frame, has_loss, has_input_mass = rng.random(4) < (0.3, 0.25, 0.25, 0.2)
    return Laboratory(
        moving_mass=(15.0, 15.0 * mass),
        preload_stiffness=(12440.0, 12440.0 * spring),
        preload_damping=(15.0, damping),
        preload_loss_factor=(loss, 0.2 * loss) if has_loss else (0.0, 0.0),
        tyre_mass=(0.8, 0.08) if has_tyre_mass else (0.0, 0.0),
        frame_stiffness=(frame, 0.1 * frame) if has_frame else (float("inf"), 0.0),
        input_mass=(0.5, 0.025) if has_input_mass else (0.0, 0.0),
        std_gain=(gain,) * 3,
        std_phase=(float(np.deg2rad(20.0 * gain)),) * 3,
        noise=noise,
    )


def _tyres(
    rng: np.random.Generator, family: NDArray[np.int64], frequency: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.str_]]:
    """K1, K2 and C of each test, at its own frequency, and the name of the tyre."""
    k1, k2, c = np.empty((3, frequency.size))
    names = np.empty(frequency.size, dtype="U16")
    for at in range(int(family.max()) + 1):
        tyre = CROSS_PLY if rng.random() < 0.5 else RADIAL_PLY
        pressure, preload = rng.uniform(100e3, 240e3), rng.uniform(1000.0, 2000.0)
        rows = family == at
        names[rows] = tyre.name
        k1[rows] = tyre.static_stiffness(pressure, preload)
        k2[rows], c[rows] = tyre.k2(frequency[rows], pressure, preload), tyre.c(frequency[rows], pressure, preload)
    return k1, k2, c, names
