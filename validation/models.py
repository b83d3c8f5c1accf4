"""Models after K*: verdicts, fits, choice and maps of campaigns with one and with two masses, whose tyres are known.

Rig, tyre and sensors are computed here by formulas of their own, in the frequency domain.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.joint import Joint, solve_joint
from fourpole.core.joint.outputs import identification
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.fitting.likelihood import likelihood_of
from fourpole.fitting.measured import Measured, MeasuredSet
from fourpole.fitting.modelling import fit_tyres, map_tyres
from fourpole.models.causality import check_possible
from fourpole.models.choice import choose
from fourpole.models.data import StiffnessData
from fourpole.models.families import model_named
from fourpole.models.recorded import Recorded

MASS, SPRING, DAMPER, ADDED = 15.0, 12e3, 20.0, 10.0
BAR = 1e5
#: What is drawn at random, in words.
RANGES = {
    "masses": "one (even numbers), or two: without and with 10 kg, weighed to 5 g",
    "gains of F1, V1, V2, each known to": "0.5 %, 1 % or 3 %; phases to a third of that in radians",
    "moving mass, preload spring, each known to": "2 %",
    "noise of each amplitude": "0.01 % to 0.1 % of it",
    "conditions": "7 pressures from 1.4 to 2.6 bar, of which one is left out of the map",
    "frequencies": "8 to 12, from 6 to 30 Hz",
    "tyre": "Zener or fractional Zener, whose parameters are straight lines or parabolas over the pressure",
}
_FAMILIES = ("zener", "fractional")
_RIVALS = ("zener", "fractional", "maxwell:2", "maxwell:3")


def run(number: int) -> dict[str, Any]:
    """One campaign: how far each answer is from the truth, in its uncertainty, and what is said."""
    rng = np.random.default_rng([14, number])
    family = _FAMILIES[int(rng.integers(2))]
    model, laws = model_named(family), _laws(family, rng)
    two, std = bool(number % 2), float(rng.choice([0.005, 0.01, 0.03]))
    noise, frequency = 10 ** rng.uniform(-4, -3), np.geomspace(6.0, 30.0, int(rng.integers(8, 13)))
    pressures = np.linspace(1.4, 2.6, 7)
    omega = 2 * np.pi * frequency
    truth = [np.array(model.stiffness(_at(laws, pressure), omega)) for pressure in pressures]
    odd = 180e3 + 1j * omega * 300.0 * (omega / 60) ** (0.05 if two else 0.2)
    joint = _solved([*truth, odd], frequency, std=std, noise=noise, two=two, rng=rng)
    measured = _measured(joint, frequency, [*pressures, 3.0])
    good = measured[:7]
    middle = good[3]
    verdicts = [check_possible(one.data).possible for one in measured]
    (fitted,) = fit_tyres(MeasuredSet((middle,), (), known=True), family)
    one, ends, true = fitted.chosen.fit, fitted.intervals[0], _at(laws, pressures[3])
    choice = choose(middle.data, _RIVALS)
    left = 2
    (mapped,) = map_tyres(MeasuredSet(tuple(m for at, m in enumerate(good) if at != left), (), known=True), family)
    answer = mapped.best.ask(np.array([[pressures[left] * BAR]]), np.array([12.0]))
    there = complex(model.stiffness(_at(laws, pressures[left]), np.array([2 * np.pi * 12.0]))[0])
    off = np.array([answer.stiffness[0].real - there.real, answer.stiffness[0].imag - there.imag])
    return {
        "number": number,
        "masses": "two masses" if two else "one mass",
        "std": std,
        "impossible": sum(not possible for possible in verdicts[:7]),
        "found": not verdicts[7],
        "fit": ((one.values - true) / one.std).tolist(),
        "inside": ((ends[:, 0] <= true) & (true <= ends[:, 1])).tolist(),
        "choice": _verdict(choice, family),
        "map": (off / np.sqrt(np.diagonal(answer.stiffness_covariance[0]))).tolist(),
    }


def _laws(family: str, rng: np.random.Generator) -> list[np.ndarray]:
    """Coefficients of each parameter over pressure - 2 bar."""
    middle = {"zener": (180e3, 90e3, 900.0), "fractional": (150e3, 300e3, 4e-3, 0.7)}[family]
    slopes = {"zener": (0.4, 0.2, -0.2), "fractional": (0.4, 0.2, -0.1, 0.0)}[family]
    return [
        value * rng.uniform(0.9, 1.1) * np.array([1.0, slope * rng.uniform(0.5, 1.0), 0.05 * slope])
        for value, slope in zip(middle, slopes, strict=True)
    ]


def _at(laws: list[np.ndarray], pressure: float) -> np.ndarray:
    x = pressure - 2.0
    return np.array([law @ [1.0, x, x * x] for law in laws])


def _solved(
    tyres: list[np.ndarray], frequency: np.ndarray, *, std: float, noise: float, two: bool, rng: np.random.Generator
) -> Joint:
    """The joint solution of one test for each tyre, frequency and mass."""
    masses = np.array([0.0, ADDED]) if two else np.zeros(1)
    true = masses + 0.005 * rng.standard_normal() * (masses > 0)
    count = frequency.size
    family = np.repeat(np.arange(len(tyres)), count * masses.size)
    w = 2 * np.pi * np.tile(frequency, len(tyres) * masses.size)
    k = np.concatenate([np.tile(tyre, masses.size) for tyre in tyres])
    added, weight = (np.tile(np.repeat(each, count), len(tyres)) for each in (masses, true))
    turn = np.exp(std * rng.standard_normal(3) + 1j * std / 3 * rng.standard_normal(3))
    beyond = DAMPER + 4 * rng.standard_normal() + 1j * w * (MASS * (1 + 0.02 * rng.standard_normal()) + weight)
    beyond = beyond + SPRING * (1 + 0.02 * rng.standard_normal()) / (1j * w)
    v1 = 2e-3 * w * np.exp(1j * rng.uniform(0, 2 * np.pi, w.size))
    v2 = v1 * k / (k + 1j * w * beyond)
    amplitudes = np.stack([beyond * v2, v1, v2], axis=1) * turn
    size = noise * np.abs(amplitudes)
    amplitudes = amplitudes + size * (rng.standard_normal(size.shape) + 1j * rng.standard_normal(size.shape))
    covariance = np.repeat(size, 2, axis=1)[:, :, None] ** 2 * np.eye(6)
    uncertain = {"moving_mass": 0.02 * MASS, "preload_stiffness": 0.02 * SPRING, "preload_damping": 4.0}
    return solve_joint(
        Phasors(w / (2 * np.pi), amplitudes, covariance, np.zeros(w.size), np.full(w.size, np.inf)),
        Rig(moving_mass=MASS, preload_stiffness=SPRING, preload_damping=DAMPER, std=uncertain),
        family=family,
        added_mass=added,
        added_mass_std=0.005 * (added > 0),
        channels=ChannelUncertainty(np.full(3, std), np.full(3, std / 3)),
    )


def _measured(joint: Joint, frequency: np.ndarray, pressures: list[float]) -> list[Measured]:
    """K* of each condition as a results folder gives it."""
    count = joint.condition.size
    phasors = Phasors(
        joint.problem.observed.omega[np.argsort(joint.order)] / (2 * np.pi),
        joint.problem.observed.amplitudes[np.argsort(joint.order)],
        np.zeros((count, 6, 6)), np.zeros(count), np.full(count, np.inf),
    )  # fmt: skip
    found = identification(joint, phasors, np.nan, 0.0)
    likelihood, size = likelihood_of(joint), frequency.size
    made = []
    for at, pressure in enumerate(pressures):
        places = np.arange(at * size, (at + 1) * size)
        rows = np.array([int(np.flatnonzero(joint.condition == place)[0]) for place in places])
        own = StiffnessData.of(
            2 * np.pi * frequency, found.stiffness[rows], covariance=found.condition_covariance[rows]
        )
        keys = tuple((f"D{row + 1}", 1) for row in rows.tolist())
        shared = found.stiffness_shared[rows].reshape(2 * size, -1)
        recorded = Recorded.of(likelihood, places.tolist(), own)
        made.append(Measured("tyre", {q.PRESSURE.head: pressure * BAR}, keys, own, shared, recorded))
    return made


def _verdict(choice: Any, family: str) -> str:
    """Whether the choice is right, leaves the right model open, or is wrong."""
    if choice.best.name == family:
        return "right"
    return "undecided" if family in (*choice.alike, *choice.unneeded) else "wrong"


def table(results: list[dict[str, Any]]) -> list[str]:
    """The tables of the document."""
    groups = {
        f"{masses}, sensors {100 * std:g} %": [one for one in results if one["masses"] == masses and one["std"] == std]
        for masses in ("one mass", "two masses")
        for std in (0.005, 0.01, 0.03)
    }
    groups = {name: some for name, some in groups.items() if some}
    told = [
        "| campaigns | possible tyres, called impossible | impossible tyre found | choice right, undecided, wrong |",
        "|---|---|---|---|",
    ]
    heads = (
        "parameters inside their 95 % intervals | mean error / u | rms | K\\* of the map within 1.96 u | mean error / u"
    )
    spread = [f"| campaigns | {heads} | rms |", "|---|---|---|---|---|---|---|"]
    for name, some in groups.items():
        impossible, found = (sum(one[key] for one in some) for key in ("impossible", "found"))
        chosen = ", ".join(str(sum(one["choice"] == word for one in some)) for word in ("right", "undecided", "wrong"))
        told.append(f"| {name} ({len(some)}) | {impossible} of {7 * len(some)} | {found} of {len(some)} | {chosen} |")
        inside, fits, maps = (np.concatenate([one[key] for one in some]) for key in ("inside", "fit", "map"))
        pairs = ((inside, fits), (np.abs(maps) < 1.96, maps))
        shares = [f"{100 * np.mean(each):.1f} % | {z.mean():+.2f} | {np.sqrt(np.mean(z**2)):.2f}" for each, z in pairs]
        spread.append(f"| {name} | {' | '.join(shares)} |")
    return [*told, "", *spread]
