"""All findings of a campaign, in the order of the report."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np

from fourpole.face import load
from fourpole.findings.facts import Facts, pairs
from fourpole.findings.finding import Finding
from fourpole.findings.inertia import inertias
from fourpole.findings.levels import Comparison, Level, compare, cycle_losses, level_of, linearity
from fourpole.findings.resonances import transmissibility
from fourpole.findings.trends import Trend, trend_of
from fourpole.findings.verdicts import verdicts
from fourpole.quantities import DERIVED, K1, K2, LOSS_FACTOR, STORAGE, C, Quantity
from fourpole.study.study import Study

#: Functions of rooms above, from `Facts` to findings, by their places.
_FURTHER = ("fourpole.paper1982.claims.claims",)
#: Effects below this are too small to matter unless they exceed so many standard uncertainties.
_SMALL, _SURE = 0.01, 3.0


def findings(results: Study) -> list[Finding]:
    """Findings of a campaign, as data.

    Parameters
    ----------
    results : Study
        Tables of an analysed campaign: `Study.results`, or `read_results` of a folder.

    Returns
    -------
    list of Finding
        One specimen gives no comparison, two values give no trend. A difference is claimed where it exceeds two
        standard uncertainties, see `fourpole.findings.evidence`; otherwise `holds` says that there is none. The order
        of rows in the tables has no influence.

    Examples
    --------
    >>> from fourpole import read_results  # doctest: +SKIP
    >>> for finding in findings(read_results("campaign/results")):  # doctest: +SKIP
    ...     print(finding.kind, finding.quantity, finding.specimens, finding.holds, finding.effect, finding.std)
    """
    facts = Facts.of(results)
    trust = verdicts(facts)
    if not (facts.used_static or facts.used_dynamic):
        return trust
    # A specimen may have K* but no K1 and so no K2; specimens are then compared by K*.
    by_k_star = (STORAGE,) if facts.by_tyre(STORAGE).keys() - facts.by_tyre(K2).keys() else ()
    quantities = (K2, *by_k_star, C, LOSS_FACTOR, *(quantity for quantity in DERIVED if quantity.topic))
    moving = [finding for quantity in quantities for finding in _quantity(facts, quantity)]
    static = [*_quantity(facts, K1), *linearity(facts)]
    mass = inertias(results)
    further = [finding for place in _FURTHER for finding in load(place)(facts)]
    return [*trust, *mass, *static, *moving, *cycle_losses(facts), *transmissibility(facts), *further]


def by_size(findings: Sequence[Finding]) -> list[Finding]:
    """Findings as a reader wants them: within a topic the largest effects first, without those too small to matter.

    Only differences between specimens and trends have a size. One below 1 % is left out unless it exceeds three of its
    standard uncertainties. Levels come after them; other findings keep their places before them.
    """
    kept = [finding for finding in findings if not _is_small(finding)]
    topics = list(dict.fromkeys(finding.topic for finding in kept))
    return sorted(kept, key=lambda finding: (topics.index(finding.topic), -_size(finding)))


def _size(finding: Finding) -> float:
    """The size of a relative effect, 0 for a level; infinite for a finding that has none."""
    if isinstance(finding.detail, Level):
        return 0.0
    sized = finding.effect is not None and isinstance(finding.detail, Comparison | Trend)
    return abs(finding.effect or 0.0) if sized else inf


def _is_small(finding: Finding) -> bool:
    size = _size(finding)
    return not isinstance(finding.detail, Level) and size < _SMALL and size <= _SURE * (finding.std or 0.0)


def _quantity(facts: Facts, quantity: Quantity) -> list[Finding]:
    """Comparisons, levels and trends of one quantity."""
    by_tyre = facts.by_tyre(quantity)
    means = {tyre: float(np.mean([measured.value for measured in by_tyre[tyre].values()])) for tyre in by_tyre}
    findings = [compare(quantity, (a, b), (by_tyre[a], by_tyre[b])) for a, b in pairs(means)]
    for tyre, values in by_tyre.items():
        findings.append(level_of(quantity, tyre, values))
        findings += [trend_of(quantity, tyre, values, axis) for axis in quantity.over]
    return [finding for finding in findings if finding is not None]
