"""The twelve conclusions of the 1982 paper, read on a campaign of a cross-ply and a radial-ply tyre."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from fourpole.findings import readings
from fourpole.findings.facts import Facts
from fourpole.findings.finding import Conditions, Finding, Holds, Topic
from fourpole.findings.readings import LackError, Need, Reading, Tyre
from fourpole.quantities import K1, K2, NONLINEARITY, TR, C, Quantity

__all__ = ["CROSS", "RADIAL", "Claim", "Lack", "claims", "pair_of_the_paper"]

#: What the paper's two tyres are called.
CROSS, RADIAL = "cross-ply", "radial-ply"
_WORDS = (re.compile(r"cross[- ]?ply|bias[- ]?ply|diagonal", re.I), re.compile(r"radial", re.I))


@dataclass(frozen=True)
class Lack:
    """What a campaign lacks to tell: what is needed, of which quantity, of which of the two tyres."""

    need: Need
    quantity: Quantity | None = None
    tyre: str = ""


@dataclass(frozen=True)
class Claim:
    """One conclusion of the paper and what a campaign shows of it.

    Attributes
    ----------
    number : int
        1 to 12, in the paper's order.
    names : (str, str)
        What the campaign calls the cross-ply and the radial-ply.
    found : object or Lack
        The numbers, as the function in `readings` that reads this claim says; or what is needed to tell.
    """

    kind: ClassVar[str] = "claim"
    number: int
    names: tuple[str, str]
    found: Any


def pair_of_the_paper(facts: Facts) -> tuple[str, str] | None:
    """The cross-ply and the radial-ply, where the campaign has one of each and no other tyre."""
    if len(facts.tyres) != 2:
        return None
    kinds = [[bool(word.search(facts.constructions.get(tyre, ""))) for word in _WORDS] for tyre in facts.tyres]
    for cross, radial in ((0, 1), (1, 0)):
        if kinds[cross] == [True, False] and kinds[radial] == [False, True]:
            return facts.tyres[cross], facts.tyres[radial]
    return None


def claims(facts: Facts) -> list[Finding]:
    """All twelve, in the paper's order; none where the campaign is not one of the paper's two tyres."""
    names = pair_of_the_paper(facts)
    if names is None or not (facts.used_static or facts.used_dynamic):
        return []
    cross, radial = (Tyre(role, name, facts) for role, name in zip((CROSS, RADIAL), names, strict=True))
    return [_claim(facts, names, number, *each) for number, each in enumerate(_readings(cross, radial), start=1)]


Read = Callable[[], Reading]


def _readings(cross: Tyre, radial: Tyre) -> tuple[tuple[Quantity, tuple[Tyre, ...], Read], ...]:
    """Of each claim its quantity, the tyres it is about, and what reads it."""
    both = cross, radial
    return (
        (K1, both, lambda: readings.above(K1, cross.k1, radial.k1)),
        (NONLINEARITY, both, lambda: readings.nonlinear(cross, radial)),
        (C, (cross,), lambda: readings.optimum(cross)),
        (C, (radial,), lambda: readings.rising(C, radial.c, "pressure")),
        (C, both, lambda: readings.loads_apart(cross, radial)),
        (C, (radial,), lambda: readings.rising(C, readings.in_band(radial.c), "frequency")),
        (C, both, lambda: readings.above(C, cross.c, radial.c)),
        (K2, (radial,), lambda: readings.turning(radial)),
        (K2, (radial,), lambda: readings.rising(K2, radial.k2, "frequency")),
        (K2, both, lambda: readings.likewise(cross, radial)),
        (TR, both, lambda: readings.isolation(cross, radial)),
        (TR, both, lambda: readings.resonance(cross, radial)),
    )


def _claim(
    facts: Facts, names: tuple[str, str], number: int, quantity: Quantity, tyres: tuple[Tyre, ...], read: Read
) -> Finding:
    about = tuple(tyre.name for tyre in tyres)
    rows = facts.used_static if "frequency" not in quantity.over else facts.used_dynamic
    tests = tuple(dict.fromkeys(row["test"] for row in rows if row["tyre"] in about))
    try:
        found = read()
    except LackError as lack:
        detail = Claim(number, names, Lack(lack.need, lack.quantity, lack.tyre))
        return Finding(Topic.CLAIMS, quantity, about, Holds.UNTOLD, detail, tests=tests)
    holds = Holds.FALSE if not found.holds else Holds.TRUE if found.sure else Holds.TRUE_UNSURE
    detail, size = Claim(number, names, found.evidence), (found.effect, found.std, found.unit)
    return Finding(Topic.CLAIMS, quantity, about, holds, detail, Conditions(), *size, tests)
