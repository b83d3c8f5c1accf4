"""The finding in words: one template per kind of finding, filled with its numbers; nothing is computed here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from fourpole.findings.claims import Claim
from fourpole.findings.comparisons import Comparison
from fourpole.findings.finding import Finding, Topic
from fourpole.findings.levels import CycleLoss, Departure, Level
from fourpole.findings.resonances import Crossings, Prediction, Resonance, ResonanceAtEnd, ResonanceOrder
from fourpole.findings.trends import Trend
from fourpole.findings.verdicts import Doubt, Tally
from fourpole.report.words import resonances
from fourpole.report.words.claims import claim, claims_summary
from fourpole.report.words.comparison import comparison
from fourpole.report.words.levels import cycle_loss, level, linearity
from fourpole.report.words.trend import trend
from fourpole.report.words.verdicts import doubt, tally

__all__ = ["Sentence", "headline", "sentences"]

_HEADLINE = (Topic.STATIC, Topic.DYNAMIC, Topic.DAMPING, Topic.LOSS, Topic.RESONANCE, Topic.TRANSMISSIBILITY)
_MOST_IN_HEADLINE = 8
_TEMPLATES: dict[type, Callable[[Finding, Any], str]] = {
    Tally: tally,
    Doubt: doubt,
    Comparison: comparison,
    Level: level,
    Trend: trend,
    Departure: linearity,
    Resonance: resonances.inside,
    ResonanceAtEnd: resonances.at_an_end,
    ResonanceOrder: resonances.order,
    Crossings: resonances.crossings,
    Prediction: resonances.prediction,
    Claim: claim,
}


@dataclass(frozen=True)
class Sentence:
    """One finding in words.

    Attributes
    ----------
    topic : str
        What it is about, see `fourpole.findings.Topic`.
    text : str
        Plain text with figures and units; names of tyres and tests stand in it as the campaign has them.
    tests : tuple of str
        The tests that it names; empty where it concerns all.
    """

    topic: str
    text: str
    tests: tuple[str, ...] = ()


def sentences(findings: Sequence[Finding]) -> list[Sentence]:
    """Findings in words.

    Parameters
    ----------
    findings : sequence of Finding
        See `fourpole.findings.findings`.

    Returns
    -------
    list of Sentence
        In the same order; what a static cycle loses stands in one sentence for all specimens.

    Examples
    --------
    >>> from fourpole import read_results  # doctest: +SKIP
    >>> from fourpole.findings import findings  # doctest: +SKIP
    >>> for said in sentences(findings(read_results("campaign/results"))):  # doctest: +SKIP
    ...     print(said.topic, said.text)
    """
    said: list[Sentence] = []
    losses = [(finding, finding.detail) for finding in findings if isinstance(finding.detail, CycleLoss)]
    for finding in findings:
        if not isinstance(finding.detail, CycleLoss):
            said.append(
                Sentence(finding.topic, _TEMPLATES[type(finding.detail)](finding, finding.detail), _named(finding))
            )
        elif finding is losses[0][0]:
            said.append(Sentence(finding.topic, cycle_loss(losses)))
    return said


def headline(findings: Sequence[Finding]) -> list[str]:
    """The sentences that come first, at most eight.

    Parameters
    ----------
    findings : sequence of Finding

    Returns
    -------
    list of str
        How many tests were used, the first sentence of each topic, and how many of the paper's claims hold.
    """
    said = sentences(findings)
    texts = [said[0].text]
    for topic in _HEADLINE:
        texts += [each.text for each in said if each.topic == topic][:1]
    summary = claims_summary(findings)
    return [*texts, *([summary] if summary else [])][:_MOST_IN_HEADLINE]


def _named(finding: Finding) -> tuple[str, ...]:
    """The tests that the sentence names."""
    if isinstance(finding.detail, Doubt):
        return finding.tests
    return finding.detail.beyond if isinstance(finding.detail, Prediction) else ()
