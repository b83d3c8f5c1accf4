"""The finding in words: what a campaign shows, each sentence with its figures."""

from __future__ import annotations

from itertools import combinations

from fourpole.campaign.results import Results
from fourpole.report.words.claims import Claim, claim_findings, paper_claims
from fourpole.report.words.compare import comparison
from fourpole.report.words.facts import Facts, Finding, Measured
from fourpole.report.words.phrases import Key, Quantity, counted, joined, percents, ranged
from fourpole.report.words.resonance import transmissibility
from fourpole.report.words.trends import K1, K2, LOSS, STORAGE, C, level, trend, trend_sentence
from fourpole.report.words.trust import trust

__all__ = ["Finding", "findings", "headline"]

_NONLINEARITY = Quantity("nonlinearity", "nonlinearity [1]", "", "nonlinearity", ("pressure",))
_CYCLE_LOSS = Quantity("hysteresis loss", "hysteresis loss [J]", "", "loss", ("pressure",), 1.0, "J")
#: Departure from a straight line, over the load span, below which a curve is called nearly linear, and above which
#: markedly not.
_NEARLY, _MARKEDLY = 0.01, 0.03
#: With more tyres than these only the extremes are compared.
_MOST_PAIRED = 3
_HEADLINE = ("static stiffness", "dynamic stiffness", "damping", "loss", "resonance", "transmissibility")
_MOST_IN_HEADLINE = 8


def findings(results: Results) -> list[Finding]:
    """What a campaign shows, in plain sentences.

    Parameters
    ----------
    results : Results
        Tables of an analysed campaign.

    Returns
    -------
    list of Finding
        Only what is there: no comparison of one tyre, no trend over two values. A difference is claimed where it
        exceeds two standard uncertainties, see `fourpole.report.words.evidence`; otherwise the sentence says that it
        does not. The order of rows in the tables does not matter.

    Examples
    --------
    >>> from fourpole.campaign import read_results  # doctest: +SKIP
    >>> for found in findings(read_results("campaign/results")):  # doctest: +SKIP
    ...     print(found.topic, found.text)
    """
    facts = Facts.of(results)
    return [*_plain(facts), *claim_findings(paper_claims(facts))]


def headline(results: Results) -> list[str]:
    """The findings that come first, at most eight sentences.

    Parameters
    ----------
    results : Results

    Returns
    -------
    list of str
    """
    facts = Facts.of(results)
    plain = _plain(facts)
    texts = [plain[0].text]
    for topic in _HEADLINE:
        texts += [found.text for found in plain if found.topic == topic][:1]
    claims = paper_claims(facts)
    if claims:
        texts.append(_summary(claims))
    return texts[:_MOST_IN_HEADLINE]


def _plain(facts: Facts) -> list[Finding]:
    """All but the claims of the paper."""
    found = trust(facts)
    if not (facts.used_static or facts.used_dynamic):
        return found
    found += _quantity(facts, K1)
    found += _nonlinearity(facts)
    for quantity in (K2, STORAGE, C, LOSS):
        if quantity is not STORAGE or _lacks_arm(facts):
            found += _quantity(facts, quantity)
    return found + _cycle_loss(facts) + transmissibility(facts)


def _lacks_arm(facts: Facts) -> bool:
    """Whether a tyre has K* but no K2, for want of K1: then K* is what there is to compare."""
    return any(facts.values(STORAGE, tyre) and not facts.values(K2, tyre) for tyre in facts.tyres)


def _quantity(facts: Facts, quantity: Quantity) -> list[Finding]:
    """Comparison, level and trends of one quantity."""
    values = {tyre: found for tyre in facts.tyres if (found := facts.values(quantity, tyre))}
    texts = [text for a, b in _pairs(values) if (text := comparison(quantity, (a, b), (values[a], values[b])))]
    for tyre, found in values.items():
        texts.append(level(quantity, tyre, found))
        trends = (trend(found, quantity.axes, axis) for axis in quantity.axes)
        texts += [trend_sentence(quantity, tyre, each) for each in trends if each is not None]
    return [Finding(quantity.topic, text) for text in texts]


def _pairs(values: dict[str, dict[Key, Measured]]) -> list[tuple[str, str]]:
    """All pairs of a few tyres; of many, those with the lowest and the highest mean."""
    if len(values) <= _MOST_PAIRED:
        return list(combinations(values, 2))
    order = sorted(values, key=lambda tyre: sum(m.value for m in values[tyre].values()) / len(values[tyre]))
    return [(order[0], order[-1])]


def _nonlinearity(facts: Facts) -> list[Finding]:
    found = []
    for tyre in facts.tyres:
        shares = [m.value for m in facts.values(_NONLINEARITY, tyre).values()]
        if shares:
            most = max(shares)
            word = (
                "nearly linear"
                if most < _NEARLY
                else "markedly non-linear"
                if min(shares) > _MARKEDLY
                else "non-linear"
            )
            curves = "curve departs" if len(shares) == 1 else "curves depart"
            text = (
                f"Under static load {tyre} is {word}: its load-deflection {curves} from a straight line by "
                f"{percents(shares)} of the load span ({counted(len(shares), 'pressure')})."
            )
            found.append(Finding("nonlinearity", text))
    return found


def _cycle_loss(facts: Facts) -> list[Finding]:
    parts = []
    for tyre in facts.tyres:
        losses = [m.value for m in facts.values(_CYCLE_LOSS, tyre).values()]
        if losses:
            parts.append(f"{ranged(losses, 'J')} in {tyre} ({counted(len(losses), 'pressure')})")
    return [Finding("loss", f"A static cycle of loading and unloading loses {joined(parts)}.")] if parts else []


def _summary(claims: list[Claim]) -> str:
    """How many of the paper's claims hold."""
    by = {holds: [str(claim.number) for claim in claims if claim.holds is holds] for holds in (True, False, None)}
    unsure = [str(claim.number) for claim in claims if claim.holds and not claim.sure]
    held = len(by[True])
    if held == len(claims):
        text = "All twelve claims of the 1982 paper hold here"
    else:
        text = f"Of the twelve claims of the 1982 paper {held or 'none'} {'holds' if held == 1 else 'hold'} here"
    if unsure:
        text += f" ({'claim' if len(unsure) == 1 else 'claims'} {joined(unsure)} not beyond the uncertainty)"
    if by[False]:
        text += f", {joined(by[False])} {'does' if len(by[False]) == 1 else 'do'} not"
    if by[None]:
        text += f"; {joined(by[None])} cannot be told"
    return text + "."
