"""Findings in words: each kind of finding has one template, which is filled with its numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from types import SimpleNamespace
from typing import Any

from fourpole import quantities as q
from fourpole.core.digits import number
from fourpole.core.specimen import Form
from fourpole.findings.facts import Finding, Holds, Topic
from fourpole.findings.list import Inertia, Reason, Tally, inertias
from fourpole.findings.resonances import Crossings, Prediction, Resonance, ResonanceOrder
from fourpole.findings.trends import Comparison, CycleLoss, Departure, Level, Trend
from fourpole.quantities import Quantity, ShownUnits
from fourpole.report.digits import SENTENCES, condition, counted, in_unit
from fourpole.report.words import levels
from fourpole.study.study import Study
from fourpole.words import template

_SAID: dict[str, str] = SENTENCES["inertia"]
#: The columns of the table after the condition.
COLUMNS = (q.BELT_MASS, q.BELT_FREE, q.BELT_HELD, q.BELT_SHARE)


def inertia(finding: Finding, found: Inertia, units: ShownUnits) -> str:
    """The mass of a specimen, its frequencies and its springs with U, as sentences."""
    values = {one.key: ranged_with_u(found, one, units) for one in COLUMNS}
    return _SAID[found.form.value].format(name=finding.specimens[0], **values)


def short_lines(results: Study, of: str | None = None) -> list[str]:
    """A line for each specimen that has a mass, or `of` one: the mass and the frequency with the rim held."""
    units = results.shown
    said = ((one, one.detail) for one in inertias(results))
    return [
        _SAID[f"short_{detail.form.value}"].format(
            name=one.specimens[0],
            mass=ranged_with_u(detail, q.BELT_MASS, units),
            free=ranged_with_u(detail, q.BELT_FREE, units),
        )
        for one, detail in said
        if isinstance(detail, Inertia) and of in (None, one.specimens[0])
    ]


def ranged_with_u(found: Inertia, quantity: Quantity, units: ShownUnits) -> str:
    """A value ± U, or the lowest and the highest one with theirs, in the unit shown; empty where there is none."""
    seen = units.of(quantity)
    texts = [" ± ".join(filter(None, in_unit(one, seen))) for one in found.ends(quantity)]
    return f"{' to '.join(dict.fromkeys(texts))} {seen.suffix}".rstrip()


def inertia_table(results: Study) -> SimpleNamespace | None:
    """The rows of the table of specimens with a mass; None without one."""
    found, units = inertias(results), results.shown
    rows = [
        SimpleNamespace(
            name=finding.specimens[0],
            place=condition(finding.conditions.axes, key, units),
            form=body.form.value,
            cells=[
                "–"
                if quantity is q.BELT_SHARE and body.form is Form.ROD
                else ranged_with_u(Inertia((body,)), quantity, units)
                for quantity in COLUMNS
            ],
            evidence=number(body.row[q.BELT_EVIDENCE.head], 3),
        )
        for finding in found
        if isinstance(finding.detail, Inertia)
        for key, body in zip(finding.conditions.keys, finding.detail.bodies, strict=True)
    ]
    return SimpleNamespace(columns=COLUMNS, rows=rows, meaning=q.BELT_EVIDENCE.meaning) if rows else None


__all__ = ["Sentence", "headline", "sentences"]

_HEADLINE = (Topic.STATIC, Topic.DYNAMIC, Topic.LOSS, Topic.DAMPING, Topic.RESONANCE, Topic.TRANSMISSIBILITY)
_MOST_IN_HEADLINE = 8


def tally(finding: Finding, found: Tally, _: ShownUnits) -> str:
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


def doubt(finding: Finding, _: Reason, __: ShownUnits) -> str:
    """How many tests were rejected, or used with a warning, for one reason; the page names them after the sentence."""
    advice = "Do not trust" if finding.holds is Holds.REJECTED else "Use with care"
    return f"{advice} {counted(len(finding.tests), 'test')}: {reason_of(finding)}."


def reason_of(finding: Finding) -> str:
    """Why tests were rejected or have a warning, in a few words."""
    found = finding.detail
    assert isinstance(found, Reason)
    return template(found.code, "short", finding.holds) if found.code else found.remark


_TEMPLATES: dict[type, Callable[[Finding, Any, ShownUnits], str]] = {
    Tally: tally,
    Reason: doubt,
    Inertia: inertia,
    Comparison: levels.comparison,
    Level: levels.level,
    Trend: levels.trend,
    Departure: levels.linearity,
    Resonance: levels.resonance,
    ResonanceOrder: levels.order,
    Crossings: levels.crossings,
    Prediction: levels.prediction,
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
    wanted = units or ShownUnits()
    made: list[Sentence] = []
    losses = [finding for finding in findings if isinstance(finding.detail, CycleLoss)]
    for finding in findings:
        if not isinstance(finding.detail, CycleLoss):
            text = _TEMPLATES[type(finding.detail)](finding, finding.detail, wanted)
            made.append(Sentence(finding.topic, text, _named(finding)))
        elif finding is losses[0]:
            made.append(Sentence(finding.topic, levels.cycle_loss(losses)))
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
