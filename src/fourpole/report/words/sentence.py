"""Findings in words: each kind of finding has one template, which is filled with its numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from fourpole.findings.facts import Finding, Holds, Topic
from fourpole.findings.list import Inertia, Reason, Tally
from fourpole.findings.resonances import Crossings, Prediction, Resonance, ResonanceOrder
from fourpole.findings.trends import Comparison, CycleLoss, Departure, Level, Trend
from fourpole.quantities import ShownUnits
from fourpole.report.digits import in_units
from fourpole.report.words import resonances
from fourpole.report.words.inertia import inertia
from fourpole.report.words.levels import comparison, cycle_loss, level, linearity, trend
from fourpole.report.words.phrases import counted, some
from fourpole.words import template

__all__ = ["Sentence", "headline", "sentences"]

#: Tests that one sentence names; more are counted.
_MOST_NAMED = 10
_HEADLINE = (Topic.STATIC, Topic.DYNAMIC, Topic.DAMPING, Topic.LOSS, Topic.RESONANCE, Topic.TRANSMISSIBILITY)
_MOST_IN_HEADLINE = 8


def tally(finding: Finding, found: Tally) -> str:
    """The number of tests used, with a warning, and rejected, as a sentence."""
    many = found.total > 1
    if finding.holds is Holds.NO_TESTS:
        return "The campaign has no tests."
    if finding.holds is Holds.NONE_USED:
        if not many:
            return "The only test was rejected, so nothing can be said of it."
        return f"None of the {counted(found.total, 'test')} could be used: all were rejected."
    if finding.holds is Holds.ALL_USED:
        return f"{f'All {found.total} tests were' if many else 'The only test was'} used without a warning."
    return (
        f"Of {counted(found.total, 'test')} {found.total - found.rejected} could be used, {found.warning} of them with "
        f"a warning; {found.rejected or 'none'} {'was' if found.rejected <= 1 else 'were'} rejected."
    )


def doubt(finding: Finding, found: Reason) -> str:
    """The tests that were rejected, or used with a warning, for one reason, as a sentence."""
    advice = "Do not trust" if finding.holds is Holds.REJECTED else "Use with care"
    count = len(finding.tests)
    of = f" ({count} tests)" if count > _MOST_NAMED else ""
    reason = template(found.code, "short", finding.holds) if found.code else found.remark
    return f"{advice} {some(finding.tests, _MOST_NAMED)}{of}: {reason}."


_TEMPLATES: dict[type, Callable[[Finding, Any], str]] = {
    Tally: tally,
    Reason: doubt,
    Inertia: inertia,
    Comparison: comparison,
    Level: level,
    Trend: trend,
    Departure: linearity,
    Resonance: resonances.resonance,
    ResonanceOrder: resonances.order,
    Crossings: resonances.crossings,
    Prediction: resonances.prediction,
}
#: Modules of rooms above with `TEMPLATES` of their findings and a `summary` for the headline, which may be empty.
_FURTHER = [import_module(name) for name in ("fourpole.paper1982.words",)]
for _module in _FURTHER:
    _TEMPLATES |= _module.TEMPLATES


@dataclass(frozen=True)
class Sentence:
    """One finding in words.

    Attributes
    ----------
    topic : str
        The heading under which it stands, see `fourpole.findings.Topic`.
    text : str
        Plain text with figures and units, and with names of tyres and tests as in the campaign.
    tests : tuple of str
        The tests that it names; empty where it concerns all.
    """

    topic: str
    text: str
    tests: tuple[str, ...] = ()


def sentences(findings: Sequence[Finding], units: ShownUnits | None = None) -> list[Sentence]:
    """Findings in words.

    Parameters
    ----------
    findings : sequence of Finding
        See `fourpole.findings.findings`.
    units : ShownUnits, optional
        The units of the sentences, as `Study.shown` has them; by default the usual ones.

    Returns
    -------
    list of Sentence
        In the same order; the energy loss of a static cycle stands in one sentence for all specimens.

    Examples
    --------
    >>> from fourpole import read_results  # doctest: +SKIP
    >>> from fourpole.findings import findings  # doctest: +SKIP
    >>> for one in sentences(findings(read_results("campaign/results"))):  # doctest: +SKIP
    ...     print(one.topic, one.text)
    """
    with in_units(units or ShownUnits()):
        return _sentences(findings)


def _sentences(findings: Sequence[Finding]) -> list[Sentence]:
    made: list[Sentence] = []
    losses = [finding for finding in findings if isinstance(finding.detail, CycleLoss)]
    for finding in findings:
        if not isinstance(finding.detail, CycleLoss):
            text = _TEMPLATES[type(finding.detail)](finding, finding.detail)
            made.append(Sentence(finding.topic, text, _named(finding)))
        elif finding is losses[0]:
            made.append(Sentence(finding.topic, cycle_loss(losses)))
    return made


def headline(findings: Sequence[Finding]) -> list[str]:
    """The most important sentences, at most eight.

    Parameters
    ----------
    findings : sequence of Finding

    Returns
    -------
    list of str
        The number of tests used, the first sentence of each topic, and the number of the paper's claims that hold.
    """
    made = sentences(findings)
    texts = [made[0].text]
    for topic in _HEADLINE:
        texts += [each.text for each in made if each.topic == topic][:1]
    summaries = (module.summary(findings) for module in _FURTHER)
    return [*texts, *filter(None, summaries)][:_MOST_IN_HEADLINE]


def _named(finding: Finding) -> tuple[str, ...]:
    """The tests that the sentence names."""
    if isinstance(finding.detail, Reason):
        return finding.tests
    return finding.detail.beyond if isinstance(finding.detail, Prediction) else ()
