"""All findings of a campaign, in the order of the report."""

from __future__ import annotations

from itertools import combinations

from fourpole.findings.claims import claims
from fourpole.findings.comparisons import compare
from fourpole.findings.facts import Facts, Measured
from fourpole.findings.finding import Finding, Key
from fourpole.findings.levels import cycle_losses, level_of, linearity
from fourpole.findings.resonances import transmissibility
from fourpole.findings.trends import trend_of
from fourpole.findings.verdicts import verdicts
from fourpole.quantities import DERIVED, K1, K2, LOSS_FACTOR, STORAGE, C, Quantity
from fourpole.study.results import Results

__all__ = ["findings"]

#: With more specimens than these only the extremes are compared.
_MOST_PAIRED = 3


def findings(results: Results) -> list[Finding]:
    """What a campaign shows, as data.

    Parameters
    ----------
    results : Results
        Tables of an analysed campaign: `Study.results`, or `read_results` of a folder.

    Returns
    -------
    list of Finding
        Only what is there: no comparison of one specimen, no trend over two values. A difference is claimed where it
        exceeds two standard uncertainties, see `fourpole.findings.evidence`; otherwise `holds` says that there is
        none. The order of rows in the tables does not matter.

    Examples
    --------
    >>> from fourpole import read_results  # doctest: +SKIP
    >>> for found in findings(read_results("campaign/results")):  # doctest: +SKIP
    ...     print(found.kind, found.quantity, found.specimens, found.holds, found.effect, found.std)
    """
    facts = Facts.of(results)
    found = verdicts(facts)
    if not (facts.used_static or facts.used_dynamic):
        return found
    found += [*_quantity(facts, K1), *linearity(facts)]
    for quantity in (K2, STORAGE, C, LOSS_FACTOR, *(one for one in DERIVED if one.topic)):
        if quantity is not STORAGE or _lacks_arm(facts):
            found += _quantity(facts, quantity)
    return [*found, *cycle_losses(facts), *transmissibility(facts), *claims(facts)]


def _lacks_arm(facts: Facts) -> bool:
    """Whether a specimen has K* but no K2, for want of K1: then K* is what there is to compare."""
    return any(facts.values(STORAGE, tyre) and not facts.values(K2, tyre) for tyre in facts.tyres)


def _quantity(facts: Facts, quantity: Quantity) -> list[Finding]:
    """Comparisons, levels and trends of one quantity."""
    values = {tyre: found for tyre in facts.tyres if (found := facts.values(quantity, tyre))}
    made = [compare(quantity, (a, b), (values[a], values[b])) for a, b in _pairs(values)]
    for tyre, each in values.items():
        made.append(level_of(quantity, tyre, each))
        made += [trend_of(quantity, tyre, each, axis) for axis in quantity.over]
    return [finding for finding in made if finding is not None]


def _pairs(values: dict[str, dict[Key, Measured]]) -> list[tuple[str, str]]:
    """All pairs of a few specimens; of many, those with the lowest and the highest mean."""
    if len(values) <= _MOST_PAIRED:
        return list(combinations(values, 2))
    order = sorted(values, key=lambda tyre: sum(m.value for m in values[tyre].values()) / len(values[tyre]))
    return [(order[0], order[-1])]
