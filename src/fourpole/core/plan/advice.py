"""Which remedies reach a wanted uncertainty of K2 and C, the cheapest first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.plan.expect import arm_by_k1
from fourpole.core.plan.remedies import MASSES, Effort, Plan, Remedy, k1_remedies, remedies

__all__ = ["Advice", "Outcome", "advise"]

#: Uncertainties that differ by less count as equal.
_AS_GOOD = 1.02


@dataclass(frozen=True)
class Outcome:
    """What some remedies together lead to.

    Attributes
    ----------
    remedies : tuple of Remedy
        Empty for the plan as it is.
    k2, c : float [1]
        Expected relative standard uncertainties of K2 and C: medians over the planned tests.
    """

    remedies: tuple[Remedy, ...]
    k2: float
    c: float

    @property
    def worst(self) -> float:
        """The larger of the two [1]."""
        return max(self.k2, self.c)

    @property
    def minutes(self) -> float:
        """What they cost together [min]."""
        return sum(remedy.minutes for remedy in self.remedies)

    @property
    def text(self) -> str:
        """The remedies in words."""
        return "; ".join(remedy.text for remedy in self.remedies) or "the plan as it is"


@dataclass(frozen=True)
class Advice:
    """What to do for a wanted uncertainty.

    Attributes
    ----------
    wanted : float [1]
        Of K2 and of C, relative.
    route : str
        The route that all numbers here are for.
    now : Outcome
        The plan as it is.
    alone : tuple of Outcome
        For each kind of remedy, the cheapest that reaches what is wanted, or else the one that comes nearest to it.
    reaching : tuple of Outcome
        Remedies and their combinations that reach it, one for each set of kinds, the cheapest first; empty where the
        plan does already, or where nothing does.
    nearest : Outcome
        The smallest that any combination leads to, within 2 %, by the cheapest of them.
    of_k1 : float [1]
        What K1, as planned, leaves in K2 or C however good the dynamic tests are: the larger of the two medians.
    """

    wanted: float
    route: str
    now: Outcome
    alone: tuple[Outcome, ...]
    reaching: tuple[Outcome, ...]
    nearest: Outcome
    of_k1: float

    @property
    def reached(self) -> bool:
        """Whether the plan as it is does."""
        return self.now.worst <= self.wanted


def advise(plan: Plan, wanted: float, *, masses: Sequence[float] = MASSES, effort: Effort | None = None) -> Advice:
    """Look for what brings the expected uncertainty of K2 and C to a wanted one at least effort.

    Parameters
    ----------
    plan : Plan
    wanted : float [1]
        Relative standard uncertainty, > 0, of K2 and of C: median over the planned tests.
    masses : sequence of float [kg]
        Masses that could be added.
    effort : Effort, optional
        What things cost.

    Returns
    -------
    Advice

    Raises
    ------
    ValueError
        If `wanted` is not positive.

    Notes
    -----
    Every combination of one remedy each for noise, sensors, rig and K1 is tried; a mass or further frequencies stand
    in the place of better sensors and rig, with noise and K1.

    Examples
    --------
    >>> from fourpole.core.channelerrors import ChannelUncertainty
    >>> from fourpole.core.plan import PlannedTests
    >>> from fourpole.core.rig import Rig
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0, std={"moving_mass": 0.3, "preload_stiffness": 249.0})
    >>> unsure = ChannelUncertainty(np.full(3, 0.01), np.full(3, 0.0087))
    >>> plan = Plan(PlannedTests.of([10.0, 16.0, 24.0], 110e3, 100e3, 800.0), rig, unsure)
    >>> advise(plan, 0.003).reaching[0].text
    '2 kg added at 16 Hz; 160 cycles in place of 40'
    """
    if not wanted > 0:
        raise ValueError(f"the wanted uncertainty is {wanted:g}: it must be positive")
    effort = effort or Effort()
    route = plan.best_route
    by_k1 = arm_by_k1(plan.tests)
    of_k1 = k1_remedies(plan, effort)
    outcomes = []
    for chosen, variance in _tried(plan, remedies(plan, effort, masses), route):
        for better in (None, *of_k1):
            listed = chosen if better is None else (*chosen, better)
            outcomes.append(_outcome(plan, listed, variance, by_k1))
    now = outcomes[0]
    reaching: tuple[Outcome, ...] = ()
    if now.worst > wanted:
        reaching = tuple(_cheapest([outcome for outcome in outcomes if outcome.worst <= wanted]))
    static = _outcome(plan, (), np.zeros_like(by_k1), by_k1)
    return Advice(
        wanted=wanted,
        route=route,
        now=now,
        alone=tuple(_alone(outcomes, wanted)),
        reaching=reaching,
        nearest=_nearest(outcomes),
        of_k1=static.worst,
    )


def _tried(plan: Plan, listed: dict[str, list[Remedy]], route: str) -> Iterator[tuple[tuple[Remedy, ...], FloatArray]]:
    """Combinations with the variance of K2 and C of the planned tests that they lead to, K1 apart; none first."""
    surely = replace(plan, tests=replace(plan.tests, k1_std=np.zeros(len(plan.tests))))
    either = [*product((None, *listed["sensors"]), (None, *listed["rig"])), *((more,) for more in listed["more tests"])]
    for part in either:
        for noise in (None, *listed["noise"]):
            chosen = tuple(remedy for remedy in (*part, noise) if remedy is not None)
            changed = surely
            for remedy in chosen:
                changed = remedy.change(changed)
            found = changed.expect(route)
            yield chosen, np.diagonal(found.arm_covariance, 0, 1, 2)[: len(plan.tests)]


def _outcome(plan: Plan, chosen: tuple[Remedy, ...], variance: FloatArray, by_k1: FloatArray) -> Outcome:
    tests = plan.tests
    k1_std = np.minimum(tests.k1_std, min((remedy.k1 for remedy in chosen), default=np.inf) * tests.k1)
    std = np.sqrt(variance + (by_k1 * k1_std[:, None]) ** 2)
    k2, c = np.median((std / np.stack([tests.k2, tests.c], axis=1))[~tests.rigid], axis=0)
    return Outcome(chosen, float(k2), float(c))


def _kinds(outcome: Outcome) -> frozenset[str]:
    return frozenset(remedy.kind for remedy in outcome.remedies)


def _cheapest(outcomes: Sequence[Outcome]) -> Iterator[Outcome]:
    """One for each set of kinds, and none that does more kinds of things than a cheaper one needs."""
    kept: list[frozenset[str]] = []
    for outcome in sorted(outcomes, key=lambda outcome: (outcome.minutes, outcome.worst)):
        kinds = _kinds(outcome)
        if not any(fewer <= kinds for fewer in kept):
            kept.append(kinds)
            yield outcome


def _alone(outcomes: Sequence[Outcome], wanted: float) -> Iterator[Outcome]:
    """For each kind of remedy the best of those that do nothing else."""
    single = [outcome for outcome in outcomes if len(outcome.remedies) == 1]
    for kind in dict.fromkeys(outcome.remedies[0].kind for outcome in single):
        of_kind = [outcome for outcome in single if outcome.remedies[0].kind == kind]
        enough = [outcome for outcome in of_kind if outcome.worst <= wanted]
        if enough:
            yield min(enough, key=lambda outcome: (outcome.minutes, outcome.worst))
        else:
            yield _nearest(of_kind)


def _nearest(outcomes: Sequence[Outcome]) -> Outcome:
    """The cheapest of those that lead as far as any, but for what nobody would notice."""
    limit = _AS_GOOD * min(outcome.worst for outcome in outcomes)
    return min((outcome for outcome in outcomes if outcome.worst <= limit), key=lambda outcome: outcome.minutes)
