"""The twelve conclusions of the 1982 paper, read on a campaign of a cross-ply and a radial-ply tyre."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from fourpole.report.words import readings
from fourpole.report.words.facts import Facts, Finding
from fourpole.report.words.readings import Found, NeededError, Tyre
from fourpole.report.words.trends import K1, C

__all__ = ["Claim", "claim_findings", "pair_of_the_paper", "paper_claims"]

_WORDS = (re.compile(r"cross[- ]?ply|bias[- ]?ply|diagonal", re.I), re.compile(r"radial", re.I))


@dataclass(frozen=True)
class Claim:
    """One conclusion and what a campaign shows of it.

    Attributes
    ----------
    number : int
    statement : str
    holds : bool or None
        None where it cannot be told.
    sure : bool
        Whether what was found is beyond the uncertainty.
    figures : str
        What was found, or what is needed.
    """

    number: int
    statement: str
    holds: bool | None
    sure: bool
    figures: str

    @property
    def text(self) -> str:
        """The sentence."""
        head = f"Claim {self.number} of the paper ({self.statement})"
        if self.holds is None:
            return f"{head} cannot be told here: it needs {self.figures}."
        if not self.holds:
            return f"{head} does not hold here: {self.figures}."
        return f"{head} holds here{'' if self.sure else ', though not beyond the uncertainty'}: {self.figures}."


def pair_of_the_paper(facts: Facts) -> tuple[str, str] | None:
    """The cross-ply and the radial-ply, where the campaign has one of each and no other tyre."""
    if len(facts.tyres) != 2:
        return None
    kinds = [[bool(word.search(facts.constructions.get(tyre, ""))) for word in _WORDS] for tyre in facts.tyres]
    for cross, radial in ((0, 1), (1, 0)):
        if kinds[cross] == [True, False] and kinds[radial] == [False, True]:
            return facts.tyres[cross], facts.tyres[radial]
    return None


def paper_claims(facts: Facts) -> list[Claim]:
    """All twelve, in the paper's order; none where the campaign is not one of the paper's two tyres."""
    names = pair_of_the_paper(facts)
    if names is None or not (facts.used_static or facts.used_dynamic):
        return []
    cross, radial = (
        Tyre(_label(kind, name), name, facts) for kind, name in zip(("cross-ply", "radial-ply"), names, strict=True)
    )
    a, b = cross.label, radial.label
    told: tuple[tuple[str, Callable[[], Found]], ...] = (
        (f"K1 of {a} is above that of {b}", lambda: readings.above("K1", K1, cross.k1, radial.k1)),
        (f"{a} is markedly non-linear under static load, {b} nearly linear", lambda: readings.nonlinear(cross, radial)),
        (f"C of {a} has its maximum near 1.68 bar", lambda: readings.optimum(cross)),
        (f"C of {b} rises with pressure", lambda: readings.rising("C", radial.c, "pressure")),
        (
            "at high pressure C is higher under the low load, at low pressure the loads hardly differ",
            lambda: readings.loads_apart(cross, radial),
        ),
        (
            f"C of {b} rises with frequency from 10 to 24 Hz",
            lambda: readings.rising("C", readings.in_band(radial.c), "frequency"),
        ),
        (f"C of {a} is above that of {b}", lambda: readings.above("C", C, cross.c, radial.c)),
        (
            f"K2 of {b} falls with pressure up to 16 Hz, hardly varies round 17.5 Hz and rises above 19 Hz",
            lambda: readings.turning(radial),
        ),
        (f"K2 of {b} rises with frequency", lambda: readings.rising("K2", radial.k2, "frequency")),
        (f"K2 of {a} behaves like that of {b}, at a higher level", lambda: readings.likewise(cross, radial)),
        (f"TR of {a} is the lower below 18 Hz, that of {b} above", lambda: readings.isolation(cross, radial)),
        (f"the resonance of {b} lies below that of {a}", lambda: readings.resonance(cross, radial)),
    )
    claims = []
    for at, (statement, read) in enumerate(told, start=1):
        try:
            claims.append(Claim(at, statement, *read()))
        except NeededError as lack:
            claims.append(Claim(at, statement, None, False, str(lack)))
    return claims


def claim_findings(claims: list[Claim]) -> list[Finding]:
    """The claims as sentences."""
    return [Finding("claims", claim.text) for claim in claims]


def _label(kind: str, name: str) -> str:
    return f"the {kind}" if kind.replace("-", "") in re.sub(r"[^a-z]", "", name.lower()) else f"the {kind} ({name})"
