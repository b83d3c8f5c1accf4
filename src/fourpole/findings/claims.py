"""The twelve conclusions of the 1982 paper, examined on a campaign of a cross-ply and a radial-ply tyre."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

from fourpole.findings import readings
from fourpole.findings.facts import Facts
from fourpole.findings.finding import Finding, FindingConditions, Holds, Topic
from fourpole.findings.readings import Evidence, Lack, LackError, Reading, Tyre
from fourpole.quantities import K1, K2, NONLINEARITY, TR, C, Quantity

#: Roles of the paper's two tyres.
CROSS, RADIAL = "cross-ply", "radial-ply"
_WORDS = (re.compile(r"cross[- ]?ply|bias[- ]?ply|diagonal", re.I), re.compile(r"radial", re.I))


@dataclass(frozen=True)
class Claim:
    """One conclusion of the paper, with the evidence of a campaign for or against it.

    Attributes
    ----------
    number : int
        1 to 12, in the paper's order.
    names : (str, str)
        The campaign's names of the cross-ply and the radial-ply.
    states : (str, str)
        Suffix of each name if a tyre was tested at several temperatures, such as " at 20 °C"; else empty.
    found : Evidence or Lack
        The numbers that decide, or the measurements that the campaign lacks.
    """

    number: int
    names: tuple[str, str]
    states: tuple[str, str]
    found: Evidence | Lack

    @property
    def kind(self) -> str:
        """Name of the kind in findings.csv, with the number of the claim."""
        return f"claim {self.number}"


@dataclass(frozen=True)
class NoCommonState:
    """The paper's two tyres have no temperature, or no value of a further axis, in common; no claim is examined."""

    kind: ClassVar[str] = "claims"


def pair_of_the_paper(facts: Facts, cross: Sequence[str], radial: Sequence[str]) -> tuple[str, str] | None:
    """The cross-ply and the radial-ply of the same state with the nearest temperatures; None if no states agree."""
    warmer = {pair: kelvin for pair in product(cross, radial) if (kelvin := facts.warmer(*pair)) is not None}
    return min(warmer, key=lambda pair: warmer[pair], default=None)


def _role(facts: Facts, tyre: str) -> int | None:
    """0 for a cross-ply, 1 for a radial-ply, None for a construction that names neither or both."""
    kinds = [bool(word.search(facts.constructions.get(tyre, ""))) for word in _WORDS]
    return kinds.index(True) if sum(kinds) == 1 else None


def claims(facts: Facts) -> list[Finding]:
    """All twelve claims, in the paper's order.

    There is none unless the campaign has a cross-ply, a radial-ply and no other tyre. A specimen of another
    construction without inflation pressure is no tyre, and takes no part.
    """
    kinds = [[tyre for tyre in facts.tyres if _role(facts, tyre) == role] for role in (0, 1)]
    stated = [{facts.stated[tyre] for tyre in names} for names in kinds]
    others = set(facts.tyres).difference(*kinds)
    if [*map(len, stated)] != [1, 1] or others & facts.inflated:
        return []
    names = pair_of_the_paper(facts, *kinds)
    if names is None:
        both = tuple(name for names in stated for name in names)
        return [Finding(Topic.CLAIMS, None, both, Holds.NOT_EXAMINED, NoCommonState())]
    cross, radial = (Tyre(role, name, facts) for role, name in zip((CROSS, RADIAL), names, strict=True))
    return [_claim(cross, radial, number, *each) for number, each in enumerate(_readings(cross, radial), start=1)]


Read = Callable[[], Reading]


def _readings(cross: Tyre, radial: Tyre) -> tuple[tuple[Quantity, tuple[Tyre, ...], Read], ...]:
    """The quantity of each claim, the tyres it concerns, and the function that examines it."""
    both = cross, radial
    return (
        (K1, both, lambda: readings.above(K1, *both)),
        (NONLINEARITY, both, lambda: readings.nonlinear(*both)),
        (C, (cross,), lambda: readings.optimum(cross)),
        (C, (radial,), lambda: readings.rising(C, radial.values(C), "pressure")),
        (C, both, lambda: readings.loads_apart(*both)),
        (C, (radial,), lambda: readings.rising(C, readings.in_band(radial.values(C)), "frequency")),
        (C, both, lambda: readings.above(C, *both)),
        (K2, (radial,), lambda: readings.turning(radial)),
        (K2, (radial,), lambda: readings.rising(K2, radial.values(K2), "frequency")),
        (K2, both, lambda: readings.likewise(*both)),
        (TR, both, lambda: readings.isolation(*both)),
        (TR, both, lambda: readings.resonance(*both)),
    )


def _claim(cross: Tyre, radial: Tyre, number: int, quantity: Quantity, tyres: tuple[Tyre, ...], read: Read) -> Finding:
    facts, about = cross.facts, tuple(tyre.name for tyre in tyres)
    tests = tuple(dict.fromkeys(row["test"] for row in facts.used(quantity) if row["tyre"] in about))
    stated = (facts.stated[cross.name], facts.stated[radial.name])
    states = (cross.name.removeprefix(stated[0]), radial.name.removeprefix(stated[1]))
    try:
        found = read()
    except LackError as error:
        detail = Claim(number, stated, states, error.lack)
        return Finding(Topic.CLAIMS, quantity, about, Holds.NOT_EXAMINED, detail, tests=tests)
    holds = Holds.FALSE if not found.holds else Holds.TRUE if found.sure else Holds.TRUE_UNSURE
    detail, size = Claim(number, stated, states, found.evidence), (found.effect, found.std, found.unit)
    return Finding(Topic.CLAIMS, quantity, about, holds, detail, FindingConditions(), *size, tests)
