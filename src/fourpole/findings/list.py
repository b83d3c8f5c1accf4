"""All findings of a campaign, in the order of the report."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np

from fourpole.findings.claims import claims
from fourpole.findings.comparisons import Comparison, compare
from fourpole.findings.facts import Facts, pairs
from fourpole.findings.finding import Finding
from fourpole.findings.levels import Level, cycle_losses, level_of, linearity
from fourpole.findings.resonances import transmissibility
from fourpole.findings.trends import Trend, trend_of
from fourpole.findings.verdicts import verdicts
from fourpole.quantities import DERIVED, K1, K2, LOSS_FACTOR, STORAGE, C, Quantity
from fourpole.study.study import Study

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


def by_size(found: Sequence[Finding]) -> list[Finding]:
    """Findings as a reader wants them: within a topic the largest effects first, without those too small to matter.

    Only differences between specimens and trends have a size. One below 1 % is left out unless it exceeds three of its
    standard uncertainties. Levels come after them; other findings keep their places before them.
    """
    kept = [one for one in found if not _is_small(one)]
    first = {one.topic: at for at, one in reversed(list(enumerate(kept)))}
    return sorted(kept, key=lambda one: (first[one.topic], -_size(one)))


def _size(one: Finding) -> float:
    """The size of a relative effect, 0 for a level; infinite for a finding that has none."""
    if isinstance(one.detail, Level):
        return 0.0
    return abs(one.effect) if one.effect is not None and isinstance(one.detail, Comparison | Trend) else inf


def _is_small(one: Finding) -> bool:
    return not isinstance(one.detail, Level) and _size(one) < _SMALL and _size(one) <= _SURE * (one.std or 0.0)


def _lacks_arm(facts: Facts) -> bool:
    """Whether a specimen has K* but no K1 and so no K2; specimens are then compared by K*."""
    return any(facts.values(STORAGE, tyre) and not facts.values(K2, tyre) for tyre in facts.tyres)


def _quantity(facts: Facts, quantity: Quantity) -> list[Finding]:
    """Comparisons, levels and trends of one quantity."""
    values = {tyre: found for tyre in facts.tyres if (found := facts.values(quantity, tyre))}
    means = {tyre: float(np.mean([one.value for one in each.values()])) for tyre, each in values.items()}
    made = [compare(quantity, (a, b), (values[a], values[b])) for a, b in pairs(means)]
    for tyre, each in values.items():
        made.append(level_of(quantity, tyre, each))
        made += [trend_of(quantity, tyre, each, axis) for axis in quantity.over]
    return [finding for finding in made if finding is not None]
