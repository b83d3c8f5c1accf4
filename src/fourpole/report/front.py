"""The first page of the report: particulars, verdict, results with U, what to trust and what limits them.

Tests are named without their common beginning, or as the condition that they have in common.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from types import SimpleNamespace
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole import units
from fourpole.core.checks import VERDICTS, Code, Verdict
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import number
from fourpole.core.sources import Kind, Source
from fourpole.errors import UnitError
from fourpole.findings.conformity import Conformity, Decision, judged, outcome_of
from fourpole.findings.facts import UNSTATED, Facts, Holds
from fourpole.findings.list import Reason, verdicts
from fourpole.findings.summary import MOST_CONDITIONS, SUMMARISED, Range, SummaryRow, bounded, departing, summary
from fourpole.quantities import Quantity, ShownUnits
from fourpole.report.digits import SENTENCES, condition, counted, in_unit, joined, percent, some, with_interval
from fourpole.report.words.limits import Limit, limits, remedy_of, scales, source_in_words
from fourpole.report.words.sentence import reason_of, short_lines
from fourpole.study.record import section
from fourpole.study.rig_estimate import RigEstimate
from fourpole.study.study import Study
from fourpole.study.tables import verdict_counts

#: Names of up to this number of characters are shown whole.
_SHORT = 12
#: Separators at which a name may be cut: none inside a number, and no sign of one.
_CUT = re.compile(r"[_\s]|(?<!\d)\.|\.(?!\d)|(?<=[^\W\d_])-|(?<=\d)-(?!\d)")
_SHARED = ("pressure", "load", "frequency")


def short_names(names: Iterable[str]) -> dict[str, str]:
    """Each name without the beginning that all of them share, cut at a separator; short names stay as they are.

    Examples
    --------
    >>> list(short_names(["Sommer_B_1.8bar_8Hz", "Sommer_B_1.2bar_10Hz"]).values())
    ['1.8bar_8Hz', '1.2bar_10Hz']
    >>> list(short_names(["D1", "D2"]).values())
    ['D1', 'D2']
    """
    whole = list(dict.fromkeys(names))
    if len(whole) < 2 or max(map(len, whole)) <= _SHORT:
        return {name: name for name in whole}
    least = min(map(len, whole)) - 1  # of each name something is left
    shared = next((at for at in range(least) if len({name[at] for name in whole}) > 1), least)
    cut = max((found.end() for found in _CUT.finditer(whole[0]) if found.end() <= shared), default=0)
    return {name: name[cut:] for name in whole}


def named_by_condition(facts: Facts, tests: Collection[str]) -> str:
    """Some tests by what they have in common and others have not: 'the 8 tests at 8 Hz', 'the static test of A'."""
    wanted, (static, dynamic) = set(tests), facts.rows
    every = [*static, *dynamic]
    chosen = [row for row in every if row["test"] in wanted]
    if len(wanted) == len({row["test"] for row in every}):
        return f"all {len(wanted)} tests" if len(wanted) > 1 else "the only test"
    resting = {row["test"] for row in static}
    kind = "static test" if wanted <= resting else "test"
    specimens = {row["tyre"] for row in chosen}
    of = f" of {specimens.pop()}" if len(specimens) == 1 < len(facts.tyres) else ""
    places = []
    for axis in _SHARED:
        here = {facts.key(row, (axis,))[0] for row in chosen} - {UNSTATED}
        there = {facts.key(row, (axis,))[0] for row in every} - {UNSTATED}
        places.append(here.pop() if len(here) == 1 < len(there) else UNSTATED)
    at = condition(_SHARED, tuple(places), facts.results.shown) if any(one != UNSTATED for one in places) else ""
    if not (of or at):
        return f"{len(wanted)} of {counted(len({row['test'] for row in every}), 'test')}"
    number = f"the {len(wanted)} {kind}s" if len(wanted) > 1 else f"the {kind}"
    return f"{number}{of}{f' at {at}' if at else ''}"


#: Rows of the table of limits.
_MOST_JUDGED = 200
#: Tests with a warning that a row names.
_MOST_WARNED = 3
#: The badge of each outcome.
_KINDS = {Conformity.PASS: Verdict.OK, Conformity.UNDECIDED: Verdict.WARNING, Conformity.FAIL: Verdict.REJECTED}
_SAID: dict[str, Any] = SENTENCES["front"]
_AXES = {"pressure": q.PRESSURE, "preload": q.PRELOAD, "temperature": q.TEMPERATURE, "frequency": q.FREQUENCY}


def verdict_line(results: Study, held: Sequence[Decision]) -> SimpleNamespace:
    """The verdict in one line: on the limits if some are stated, else the number of tests by verdict.

    `misfit` has a line for each rig that does not fit with its sensors, which comes first.
    """
    misfit = [misfit_line(results, rig) for rig in results.rigs if not rig.fits]
    counts = verdict_counts(results.static, results.dynamic)
    if not held:
        kind = next((verdict for verdict in reversed(VERDICTS) if counts[verdict]), Verdict.OK)
        total = sum(counts.values())
        text = f"of {counted(total, 'test')}, {counts['warning']} with a warning, {counts['rejected']} rejected."
        used = f"{total - counts['rejected']} used"
        return SimpleNamespace(kind=kind, word=used, text=f"{text} No limits are stated.", misfit=misfit)
    outcome = outcome_of(held)
    number_of = {one: sum(each.outcome is one for each in held) for one in Conformity}
    text = f"{number_of[Conformity.PASS]} of {counted(len(held), 'result')} {'passes' if len(held) == 1 else 'pass'}"
    for one, words in ((Conformity.FAIL, "fail"), (Conformity.UNDECIDED, "undecided")):
        if number_of[one]:
            text += f", {number_of[one]} {words}"
    worst = next((each for each in held if each.outcome is outcome), None)
    if worst is not None and outcome is not Conformity.PASS:
        text += f". {_against_limits(_judged_row(worst, results.shown))}"
    if resting := sum(bool(each.warned) for each in held):
        text += f". {counted(resting, 'result')} {'rests' if resting == 1 else 'rest'} on tests with a warning"
    if counts[Verdict.WARNING] or counts[Verdict.REJECTED]:
        text += f". {counted(counts['warning'], 'test')} with a warning, {counts['rejected']} rejected"
    return SimpleNamespace(kind=_KINDS[outcome], word=outcome.value.upper(), text=f"{text}.", misfit=misfit)


def misfit_line(results: Study, rig: RigEstimate) -> SimpleNamespace:
    """A rig that does not fit with its sensors: what may be wrong, by how much, what it does to K*, what to do."""
    causes, channels = rig.causes or rig.candidates[:1], rig.wrong_channels
    dynamic = results.dynamic.filter((pl.col("verdict") == Verdict.REJECTED) & (pl.col("rig").fill_null("") == rig.rig))
    names = joined(dict.fromkeys(cause.source.of for cause in channels))
    sources = [cause.source for cause in causes] or [Source(Kind.RIG_MISFIT)]
    remedies = [_SAID["mend"].get(one.kind.name) or remedy_of(one) for one in sources]
    said = _SAID["misfit_channels" if channels else "misfit"]
    return SimpleNamespace(
        kind=Verdict.REJECTED if channels else Verdict.WARNING,
        lead=_SAID["misfit_of"].format(rig=rig.rig) if len(results.rigs) > 1 else _SAID["misfit_lead"],
        text=said.format(
            why=_first_large(rig.explained),
            channels=names,
            count=counted(dynamic["test"].n_unique(), "test"),
            remedy=" or ".join(dict.fromkeys(remedies)),
        ),
    )


def _first_large(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}"


def _against_limits(row: SimpleNamespace) -> str:
    """A result and its limits in words."""
    measured = f"is {row.value} {row.about} {row.unit}".rstrip() if row.value else "was not measured"
    within = f"{row.low or '−∞'} to {row.high or '∞'} {row.unit}".rstrip()
    return f"{row.quantity} of {row.condition} {measured}; the limits are {within}"


def conformity_table(results: Study, held: Sequence[Decision]) -> SimpleNamespace | None:
    """The limits with their results, by ILAC-G8:09/2019, 4.2.3, and JCGM 106, and their number; None without limits."""
    if not held:
        return None
    order = sorted(held, key=lambda one: -list(Conformity).index(one.outcome))
    return SimpleNamespace(
        specification=str(section(results.record, "stated").get("specification") or ""),
        rows=[_judged_row(one, results.shown) for one in order[:_MOST_JUDGED]],
        count=len(held),
    )


def _judged_row(one: Decision, shown: ShownUnits) -> SimpleNamespace:
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


#: Most items of each list, and most specimens that are described one by one.
_MOST_SAID, _MOST_DESCRIBED = 3, 4
#: Checks that a rig which does not fit makes fail, too.
_BY_MISFIT = {
    Code.CONSISTENCY, Code.PASSIVE_ARM, Code.UNCERTAINTY, Code.CERTAINTY, Code.AGREEMENT, Code.RIG, Code.SCATTER,
    Code.TWO_ROOTS, Code.V1_SCALE, Code.K1_RATIO, Code.K1_LARGE, Code.OFF_CURVE, Code.OTHER_CURVE, Code.EXCHANGED,
    Code.CONVERGENCE,
}  # fmt: skip
#: Characters of a specimen's name in the table.
_LONGEST = 60
_DAY = re.compile(r"\d{4}-\d{2}-\d{2}")
#: The quantities that name a row.
_PLACES = (q.PRESSURE, q.PRELOAD, q.TEMPERATURE, q.FREQUENCY, q.DEFLECTION_AMPLITUDE)


def front_page(results: Study) -> SimpleNamespace:
    """What the first page shows."""
    record = results.record
    stated = section(record, "stated", "report")
    logo = stated.get("logo")
    every = summary(results, most=None)
    rows = bounded(every, MOST_CONDITIONS)
    held = judged(results)
    return SimpleNamespace(
        laboratory=str(stated.get("laboratory") or section(record, "stated").get("laboratory") or ""),
        address=str(stated.get("address") or ""),
        number=str(stated.get("number") or ""),
        logo=logo if isinstance(logo, str) and logo.startswith("data:image/") else "",  # no image outside the record
        particulars=[(name, str(stated[key])) for key, name in _SAID["particulars"] if stated.get(key)],
        specimens=_specimens(results),
        verdict=verdict_line(results, held),
        inertia=short_lines(results),
        table=summary_table(results, rows[:MOST_CONDITIONS]),
        more=len(rows) - MOST_CONDITIONS,
        all_conditions=summary_table(results, every) if len(every) > MOST_CONDITIONS else None,
        conformity=conformity_table(results, held),
        equipment=_equipment(stated),
        doubts=_doubts(results, every),
        limits=_limits(results, every),
        scale=scales(results),
    )


def _specimens(results: Study) -> list[SimpleNamespace]:
    """Name and description of each specimen; of more than a few, none."""
    names = list(dict.fromkeys([*results.static["tyre"].to_list(), *results.dynamic["tyre"].to_list()]))
    stated = section(results.record, "stated", "specimens")
    if len(names) > _MOST_DESCRIBED:
        return [SimpleNamespace(name=f"{len(names)} specimens", about="listed under “What was tested”")]
    return [SimpleNamespace(name=str(name or ""), about=_described(section(stated, str(name)))) for name in names]


def _described(stated: Mapping[str, Any]) -> str:
    parts = [str(stated["construction"])] if stated.get("construction") else []
    return ", ".join(
        [*parts, *(f"{words} {stated[key]}" for key, words in _SAID["specimen"].items() if stated.get(key))]
    )


def summary_table(results: Study, rows: Sequence[SummaryRow]) -> SimpleNamespace:
    """Rows of the table of results: the condition, and each quantity with U or its interval."""
    facts = Facts.of(results)
    ranges = any(low is not high for row in rows for low, high in row.values.values())
    shown = results.shown
    used = tuple(shown.of(one) for one in SUMMARISED if any(one.key in row.values for row in rows))
    rated = {
        name: load
        for name, stated in section(results.record, "stated", "specimens").items()
        if (load := rated_load(section(stated))) is not None
    }
    made = [_row(row, used, shown, rated.get(facts.stated(row.specimen))) for row in rows]
    frequencies = [one for one in {row.frequency for row in rows} if one is not None]
    frequency = shown.of(q.FREQUENCY)
    at = f"{_span(frequencies[0], frequency.scale)} {frequency.suffix}" if len(frequencies) == 1 else ""
    return SimpleNamespace(
        columns=used,
        rows=made,
        frequency=at,
        ranges=ranges,
        places=[one for one in _places(shown) if any(getattr(row, one.of) for row in made)],
        skewed=any(row.intervals for row in rows),
    )


def _places(shown: ShownUnits) -> Iterator[SimpleNamespace]:
    """The columns of the condition: head, unit, and the attributes of a row that they show, one below the other."""
    for quantity, (head, below, unit, about) in zip(_PLACES, _SAID["places"], strict=True):
        one = shown.of(quantity)
        yield SimpleNamespace(of=quantity.key, head=head, below=below, unit=unit.format(unit=one.suffix), about=about)


def _row(row: SummaryRow, used: Iterable[Quantity], shown: ShownUnits, rated: float | None) -> SimpleNamespace:
    pressure, preload, temperature, frequency, amplitude = (shown.of(one).scale for one in _PLACES)
    return SimpleNamespace(
        specimen=row.specimen,
        name=_cut(row.specimen),
        pressure=_span(row.pressure, pressure),
        preload=_span(row.preload, preload),
        rated=_span(row.preload, rated / 100.0, 2) if rated else "",
        temperature=_span(row.temperature, temperature, 3),
        frequency=_span(row.frequency, frequency),
        deflection_amplitude=_span(row.amplitude, amplitude, 3),
        double=_span(row.amplitude, 0.5 * amplitude, 3),
        tests=len(row.tests),
        place=_place(row, shown),
        cells=[_cell(row, one) for one in used],
    )


def _place(row: SummaryRow, shown: ShownUnits) -> str:
    """The condition of a row in short, for a narrow screen: '1.7 bar, 1000 N, 14 Hz, 2 tests'."""
    ends = zip((row.pressure, row.preload, row.temperature, row.frequency), _PLACES, strict=False)
    parts = [f"{_span(end, shown.of(one).scale)} {shown.of(one).suffix}" for end, one in ends if end is not None]
    return ", ".join([*parts, counted(len(row.tests), "test")])


def _cut(name: str) -> str:
    """A name of at most three lines of the table, cut in the middle."""
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST // 2]}…{name[1 - _LONGEST // 2 :]}"


def _span(ends: Range, scale: float, digits: int = 4) -> str:
    """A value, or the lowest to the highest one; empty where there is none."""
    if ends is None:
        return ""
    low, high = (f"{end / scale:.{digits}g}".replace("-", "−") for end in ends)
    return low if low == high else f"{low}–{high}"


def _cell(row: SummaryRow, quantity: Quantity) -> SimpleNamespace:
    """A value with U; the interval where that is skewed; or the lowest and the highest value."""
    empty = SimpleNamespace(text="", about="")
    if quantity.key not in row.values:
        return empty
    low, high = row.values[quantity.key]
    if low is not high:
        reach = row.largest[quantity.key]
        least, most = (in_unit(replace(one, std=min(reach, 0.25 * abs(one.value))), quantity)[0] for one in (low, high))
        text = least if least == most else f"{least}–{most}"
        if quantity.key in row.intervals:
            first, last = (one / quantity.scale for one in row.intervals[quantity.key])
            about = f"{number(first, 2)} to {number(last, 2)}" if isfinite(last) else f"above {number(first, 2)}"
            return SimpleNamespace(text=text, about=about)
        _, about = in_unit(replace(high, std=reach), quantity)
        return SimpleNamespace(text=text, about=f"± {about}" if about else "")
    if quantity.key in row.intervals:
        ends = (one / quantity.scale for one in row.intervals[quantity.key])
        text, about = with_interval(low.value / quantity.scale, *ends)
        return SimpleNamespace(text=text, about=about)
    text, about = in_unit(low, quantity)
    return SimpleNamespace(text=text, about=f"± {about}" if about else "")


def _equipment(stated: Mapping[str, Any]) -> list[SimpleNamespace]:
    """The instruments; one whose certificate had run out on the last day of the tests is marked."""
    listed = stated.get("equipment")
    days = _DAY.findall(str(stated.get("tested") or ""))
    found = []
    for one in listed if isinstance(listed, list) else ():
        due = str(section(one).get("due") or "")
        late = "run out when tested" if days and _DAY.fullmatch(due) and due < max(days) else ""
        texts = {name: str(section(one).get(name) or "") for name in ("name", "serial", "certificate")}
        found.append(SimpleNamespace(**texts, due=due, late=late))
    return found


def _limits(results: Study, rows: Sequence[SummaryRow]) -> list[str]:
    """What limits the results, and the cheapest remedy, a sentence for each source; scatter of repeats comes first."""
    scattered = sum(row.scatters for row in rows)
    groups: dict[tuple[str, str, str], list[Limit]] = {}
    for one in limits(results):
        groups.setdefault((one.rig, one.source.text, one.remedy), []).append(one)
    said = []
    if scattered:
        said.append(
            f"The scatter of repeats makes most of U at {counted(scattered, 'condition')}. Cheapest remedy: bring the "
            "specimen to the same state before each repeat (break-in, temperature, rest), then more repeats."
        )
    for (rig, _, remedy), found in list(groups.items())[: _MOST_SAID - len(said)]:
        known = [f"{percent(COVERAGE_FACTOR * one.relative)} in {one.symbol}" for one in found if one.relative]
        source, share = source_in_words(found[0].source), min(one.share for one in found)
        opening = f"{source} makes {percent(share)} of the variance"
        opening += f" (U is {joined(known)})" if known else ""
        where = f"Rig {rig}: " if rig else ""
        where += "of a single test, " if scattered else ""
        text = f"{where}{opening}. Cheapest remedy: {remedy}."
        said.append(f"{text[:1].upper()}{text[1:]}")
    return said


def _doubts(results: Study, rows: Sequence[SummaryRow]) -> list[SimpleNamespace]:
    """What not to trust: repeats that scatter, models that depart, then tests by their commonest reasons.

    Where a rig does not fit, which the verdict says, what follows from that is left out.
    """
    misfit, facts = any(not rig.fits for rig in results.rigs), Facts.of(results)
    scattered = [] if misfit else _scattered(rows)
    models = [] if misfit else _misfits(results, scattered=bool(scattered))
    found = [SimpleNamespace(lead="", tests="", text=text) for text in (*scattered, *models)]
    for finding in verdicts(facts):
        reason = finding.detail
        if isinstance(reason, Reason) and not (misfit and reason.code in _BY_MISFIT):
            lead = _SAID["rejected" if finding.holds is Holds.REJECTED else "warned"]
            found.append(
                SimpleNamespace(lead=lead, tests=named_by_condition(facts, finding.tests), text=reason_of(finding))
            )
    more = len(found) - _MOST_SAID
    if more > 0:
        left = SimpleNamespace(lead="", tests=counted(more, "further reason"), text="")
        found = [*found[:_MOST_SAID], left]
    return found


def _scattered(rows: Sequence[SummaryRow]) -> list[str]:
    """Repeats of one condition whose scatter makes most of U, in a sentence."""
    off = [row for row in rows if row.scatters]
    if not off:
        return []
    worst = max(off, key=lambda row: row.scatter)
    where = f"{len(off)} of the conditions above" if len(off) > 1 else f"one condition ({worst.specimen})"
    text = (
        f"Repeats scatter by up to {percent(worst.scatter)} in |K*| at {where}, more than their uncertainties explain: "
        "U includes it, and it limits the results there."
    )
    return [text]


def _misfits(results: Study, *, scattered: bool) -> list[str]:
    """Models that depart from the data by more than a limit, in a sentence; no reason where repeats scatter."""
    off = departing(results)
    if not off:
        return []
    each = [f"{one.tyre or 'the specimen'} by {percent(one.discrepancy)} of |K*|" for one in off]
    none = all(any(at.verdict is not None and not at.verdict.possible for at in one.conditions) for one in off)
    why = "; no massless, relaxing specimen can have such a K*" if none and not scattered else ""
    return [f"The models depart from the data of {joined(each)}{why}. The tables do not rest on them."]


#: Load [kg] of the load indices from 60 on, and the highest index.
_LOADS: list[int] = SENTENCES["load_index"]["loads"]
_FIRST, _DECADE, _HIGHEST = 60, len(_LOADS), 279
_GRAVITY = 9.80665


def load_of_index(index: int) -> float | None:
    """Load [N] of a load index, times standard gravity; None for an index outside 0 to 279.

    Source: the table of load indices in ISO 4000-1, which repeats ten times larger every 80 indices.

    >>> round(load_of_index(91) / 9.80665), load_of_index(300)
    (615, None)
    """
    if not 0 <= index <= _HIGHEST:
        return None
    decades, at = divmod(index - _FIRST, _DECADE)
    return _LOADS[at] * 10.0**decades * _GRAVITY


def rated_load(stated: Mapping[str, Any]) -> float | None:
    """Rated load [N] of a specimen as campaign.toml states it: `rated_load`, else by `load_index`; None for neither.

    >>> rated_load({"load_index": "91V"}) == load_of_index(91), rated_load({"rated_load": "5 kN"}), rated_load({})
    (True, 5000.0, None)
    """
    if "rated_load" in stated:
        try:
            found = units.quantity(stated["rated_load"], "force")
        except (UnitError, TypeError):
            return None
        return found if found > 0 else None
    index = re.match(r"\s*(\d{1,3})(?!\d)", str(stated.get("load_index", "")))
    return load_of_index(int(index[1])) if index else None
