"""Statements of conformity as the page shows them: the verdict in one line, and the table of limits."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

from fourpole import quantities as q
from fourpole.core.checks import VERDICTS, Verdict
from fourpole.findings.conformity import Conformity, Judged, outcome_of
from fourpole.quantities import ShownUnits
from fourpole.report.digits import in_unit, number, with_interval
from fourpole.report.words.phrases import counted, some
from fourpole.study.record import section
from fourpole.study.study import Study
from fourpole.study.tables import verdict_counts

#: Rows of the table of limits.
_MOST_JUDGED = 200
#: Tests with a warning that a row names.
_MOST_WARNED = 3
#: The badge of each outcome.
_KINDS = {Conformity.PASS: Verdict.OK, Conformity.UNDECIDED: Verdict.WARNING, Conformity.FAIL: Verdict.REJECTED}
_AXES = {"pressure": q.PRESSURE, "preload": q.PRELOAD, "temperature": q.TEMPERATURE, "frequency": q.FREQUENCY}


def verdict_line(results: Study, held: Sequence[Judged]) -> SimpleNamespace:
    """The verdict in one line: on the limits if some are stated, else the number of tests by verdict."""
    counts = verdict_counts(results.static, results.dynamic)
    if not held:
        kind = next((verdict for verdict in reversed(VERDICTS) if counts[verdict]), Verdict.OK)
        total = sum(counts.values())
        text = f"of {counted(total, 'test')}, {counts['warning']} with a warning, {counts['rejected']} rejected."
        used = f"{total - counts['rejected']} used"
        return SimpleNamespace(kind=kind, word=used, text=f"{text} No limits are stated.")
    outcome = outcome_of(held)
    number_of = {one: sum(each.outcome is one for each in held) for one in Conformity}
    text = f"{number_of[Conformity.PASS]} of {counted(len(held), 'result')} {'passes' if len(held) == 1 else 'pass'}"
    for one, words in ((Conformity.FAIL, "fail"), (Conformity.UNDECIDED, "undecided")):
        if number_of[one]:
            text += f", {number_of[one]} {words}"
    worst = next((each for each in held if each.outcome is outcome), None)
    if worst is not None and outcome is not Conformity.PASS:
        row = _judged_row(worst, results.shown)
        measured = f"is {row.value} {row.about} {row.unit}".rstrip() if row.value else "was not measured"
        within = f"{row.low or '−∞'} to {row.high or '∞'} {row.unit}".rstrip()
        text += f". {row.quantity} of {row.condition} {measured}; the limits are {within}"
    if resting := sum(bool(each.warned) for each in held):
        text += f". {counted(resting, 'result')} {'rests' if resting == 1 else 'rest'} on tests with a warning"
    if counts[Verdict.WARNING] or counts[Verdict.REJECTED]:
        text += f". {counted(counts['warning'], 'test')} with a warning, {counts['rejected']} rejected"
    return SimpleNamespace(kind=_KINDS[outcome], word=outcome.value.upper(), text=f"{text}.")


def conformity_table(results: Study, held: Sequence[Judged]) -> SimpleNamespace | None:
    """The limits with their results, and the rule of the decision; None without limits."""
    if not held:
        return None
    rule = (
        "Decision rule: a result passes if it lies within the limits by at least its U (k = 2), fails if it lies "
        "beyond one by more than its U, and is undecided in between (guard band w = U; ILAC-G8:09/2019, 4.2.3). "
        "A skewed interval stands in place of ± U. “Within” is the probability that the true value is within the "
        "limits (JCGM 106)."
    )
    left_out = f" The first {_MOST_JUDGED} of {len(held)} rows are shown, the worst first."
    left_out = left_out if len(held) > _MOST_JUDGED else ""
    order = sorted(held, key=lambda one: -list(Conformity).index(one.outcome))
    return SimpleNamespace(
        specification=str(section(results.record, "stated").get("specification") or ""),
        rows=[_judged_row(one, results.shown) for one in order[:_MOST_JUDGED]],
        rule=rule + left_out,
    )


def _judged_row(one: Judged, shown: ShownUnits) -> SimpleNamespace:
    """One result and its limits in the unit shown."""
    quantity, value, about = shown.of(one.quantity), "", ""
    scale = quantity.scale
    if one.value is not None and one.interval is not None:
        if one.probability is None:
            value, about = with_interval(one.value.value / scale, *(end / scale for end in one.interval))
        else:
            value, reach = in_unit(one.value, quantity)
            about = f"± {reach}" if reach else ""
    stated = [shown.text(each, one.condition[name]) for name, each in _AXES.items() if name in one.condition]
    return SimpleNamespace(
        quantity=quantity.symbol,
        unit=quantity.suffix,
        condition=", ".join([one.specimen or "all specimens", *stated]),
        low="" if one.low is None else number(one.low / scale),
        high="" if one.high is None else number(one.high / scale),
        value=value,
        about=about,
        probability="" if one.probability is None else _per_cent(one.probability),
        outcome=one.outcome.value,
        warned=some(one.warned, _MOST_WARNED),
        kind=_KINDS[one.outcome],
    )


def _per_cent(probability: float) -> str:
    return (
        "above 99.9 %" if probability > 0.999 else "below 0.1 %" if probability < 1e-3 else f"{100 * probability:.1f} %"
    )
