"""Remedies that reach a wanted uncertainty of K2 and C, in the order of their cost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.plan.expect import arm_std
from fourpole.core.plan.remedies import MASSES, Effort, Plan, Remedy, k1_remedies, remedies

#: Uncertainties count as equal within this ratio.
_AS_GOOD = 1.02


@dataclass(frozen=True)
class Outcome:
    """Expected result of some remedies together.

    Attributes
    ----------
    remedies : tuple of Remedy
        The remedies; empty for the plan without changes.
    k2, c : float [1]
        Expected relative standard uncertainties of K2 and C: medians over the planned tests.
    """

    remedies: tuple[Remedy, ...]
    k2: float
    c: float

    @property
    def worst(self) -> float:
        """The larger of the expected relative uncertainties of K2 and C [1]."""
        return max(self.k2, self.c)

    @property
    def minutes(self) -> float:
        """Cost of the remedies together [min]."""
        return sum(remedy.minutes for remedy in self.remedies)

    @property
    def text(self) -> str:
        """The remedies as a text."""
        return "; ".join(remedy.text for remedy in self.remedies) or "the plan as it is"


@dataclass(frozen=True)
class Advice:
    """Advice for reaching a wanted uncertainty.

    Attributes
    ----------
    wanted : float [1]
        Wanted relative standard uncertainty of K2 and of C.
    route : str
        Name of the route by which all values are expected.
    now : Outcome
        Result of the plan without changes.
    alone : tuple of Outcome
        For each kind of remedy, the cheapest one that is sufficient; without one, the remedy that comes nearest.
    reaching : tuple of Outcome
        Sufficient remedies and combinations, one for each set of kinds, the cheapest first. Empty if the plan is
        sufficient without changes, or if no combination is.
    nearest : Outcome
        The cheapest combination whose uncertainty is within 2 % of the smallest possible.
    of_k1 : float [1]
        Relative uncertainty of K2 or C, the larger median, that the planned uncertainty of K1 alone causes.
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
        """Whether the plan without changes is sufficient."""
        return self.now.worst <= self.wanted


def advise(plan: Plan, wanted: float, *, masses: Sequence[float] = MASSES, effort: Effort | None = None) -> Advice:
    """Find the changes of a plan that reach a wanted uncertainty of K2 and C with the least effort.

    Parameters
    ----------
    plan : Plan
    wanted : float [1]
        Relative standard uncertainty, > 0, of K2 and of C: median over the planned tests.
    masses : sequence of float [kg]
        Masses that are available.
    effort : Effort, optional
        Costs of the remedies.

    Returns
    -------
    Advice

    Raises
    ------
    ValueError
        If `wanted` is not positive.

    Notes
    -----
    All combinations of one remedy each for noise, sensors, rig and K1 are compared. Combinations with an added mass or
    further frequencies have one remedy each for noise and K1, and none for sensors and rig.

    Examples
    --------
    >>> from fourpole.core.channelerrors import ChannelUncertainty
    >>> from fourpole.core.plan import PlannedTests
    >>> from fourpole.core.rig import Rig
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0, std={"moving_mass": 0.3, "preload_stiffness": 249.0})
    >>> unsure = ChannelUncertainty(np.full(3, 0.01), np.full(3, 0.0087))
    >>> plan = Plan(PlannedTests([10.0, 16.0, 24.0], 110e3, 100e3, 800.0), rig, unsure)
    >>> advise(plan, 0.003).reaching[0].text
    '2 kg added at 16 Hz; 160 cycles in place of 40'
    """
    if not wanted > 0:
        raise ValueError(f"the wanted uncertainty is {wanted:g}: it must be positive")
    effort = effort or Effort()
    route = plan.best_route
    of_k1 = k1_remedies(plan, effort)
    outcomes = []
    for chosen, covariance in _combinations(plan, remedies(plan, effort, masses), route):
        for better in (None, *of_k1):
            listed = chosen if better is None else (*chosen, better)
            outcomes.append(_outcome(plan, listed, covariance))
    now = outcomes[0]
    reaching: tuple[Outcome, ...] = ()
    if now.worst > wanted:
        reaching = tuple(_cheapest([outcome for outcome in outcomes if outcome.worst <= wanted]))
    static = _outcome(plan, (), 0.0)
    return Advice(
        wanted=wanted,
        route=route,
        now=now,
        alone=tuple(_alone(outcomes, wanted)),
        reaching=reaching,
        nearest=_nearest(outcomes),
        of_k1=static.worst,
    )


def _combinations(
    plan: Plan, listed: dict[str, list[Remedy]], route: str
) -> Iterator[tuple[tuple[Remedy, ...], FloatArray]]:
    """Combinations, each with the covariance (N, 2, 2) of K* [N²/m²]; the first has no remedy."""
    either = [*product((None, *listed["sensors"]), (None, *listed["rig"])), *((more,) for more in listed["more tests"])]
    for part in either:
        for noise in (None, *listed["noise"]):
            chosen = tuple(remedy for remedy in (*part, noise) if remedy is not None)
            changed = plan
            for remedy in chosen:
                changed = remedy.change(changed)
            expected = changed.expect(route)
            yield chosen, expected.stiffness_covariance[: len(plan.tests)]


def _outcome(plan: Plan, chosen: tuple[Remedy, ...], covariance: FloatArray | float) -> Outcome:
    """The outcome of remedies, from the covariance (N, 2, 2) of K* [N²/m²]."""
    tests = plan.tests
    k1_std = np.minimum(tests.k1_std, min((remedy.k1 for remedy in chosen), default=np.inf) * tests.k1)
    std = arm_std(tests, covariance, k1_std)
    k2, c = np.median((std / np.stack([tests.k2, tests.c], axis=1))[~tests.rigid], axis=0)
    return Outcome(chosen, float(k2), float(c))


def _cheapest(outcomes: Sequence[Outcome]) -> Iterator[Outcome]:
    """The cheapest outcome of each set of kinds, unless a cheaper one needs only some of these kinds."""
    kept: list[frozenset[str]] = []
    for outcome in sorted(outcomes, key=lambda outcome: (outcome.minutes, outcome.worst)):
        kinds = frozenset(remedy.kind for remedy in outcome.remedies)
        if not any(fewer <= kinds for fewer in kept):
            kept.append(kinds)
            yield outcome


def _alone(outcomes: Sequence[Outcome], wanted: float) -> Iterator[Outcome]:
    """The best single remedy of each kind."""
    single = [outcome for outcome in outcomes if len(outcome.remedies) == 1]
    for kind in dict.fromkeys(outcome.remedies[0].kind for outcome in single):
        of_kind = [outcome for outcome in single if outcome.remedies[0].kind == kind]
        enough = [outcome for outcome in of_kind if outcome.worst <= wanted]
        if enough:
            yield min(enough, key=lambda outcome: (outcome.minutes, outcome.worst))
        else:
            yield _nearest(of_kind)


def _nearest(outcomes: Sequence[Outcome]) -> Outcome:
    """The cheapest outcome whose uncertainty equals the smallest one."""
    limit = _AS_GOOD * min(outcome.worst for outcome in outcomes)
    return min((outcome for outcome in outcomes if outcome.worst <= limit), key=lambda outcome: outcome.minutes)
