"""Models and maps in words, and the section on them: choice, parameters of each condition, the query of the map.

A function that serves the template returns what it shows of one thing, as a namespace.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.core.condition import FREQUENCY, axis_of
from fourpole.core.digits import number, with_std
from fourpole.findings.facts import Facts, Holds
from fourpole.findings.trends import Trend, trend_of
from fourpole.fitting.modelfile import CandidateFile, ConditionFile, MapEntry, ModelEntry, map_of
from fourpole.fitting.modelparts import VerdictFile
from fourpole.models.families import by_amplitude
from fourpole.models.inertial import Of
from fourpole.models.ladder import Lie, Rung, Verdict
from fourpole.quantities import ShownUnits
from fourpole.report.digits import expanded, percent, ranged, spread
from fourpole.report.words.levels import span
from fourpole.study.study import Study

#: Up to this number non-passive conditions are listed one by one.
_NAMED = 6
#: Shown unit, its SI value and the option of `fourpole query`, by the column of an axis.
_AXES = {one.head: (one.suffix, one.scale, f"--{one.key}") for one in (q.PRESSURE, q.PRELOAD, q.TEMPERATURE)}
#: The specimens of all rungs.
_ANY = "relaxing or with a mass or resonances"
_SPELLED = {"°C": "degC"}


def sentences(entry: ModelEntry, facts: Facts | None = None) -> list[str]:
    """The choice of the model, its discrepancy, and whether a massless, relaxing specimen can have this K*.

    If none can, and C rises with frequency in the `facts`, a sentence says why.
    """
    said = [chosen(entry.choice)]
    if entry.discrepancy > 0:
        said.append(discrepancy(entry))
    if not entry.causal:
        said.append("It is not causal: it describes K* at these frequencies, but cannot be stepped in time.")
    active = any(one.verdict is not None and not one.verdict.possible for one in entry.conditions)
    return [*said, *verdicts(entry), *(rising_damping(facts, entry.tyre) if facts is not None and active else [])]


def discrepancy(entry: ModelEntry) -> str:
    """The model discrepancy in two sentences, for a model that has one."""
    known = any(one.verdict is not None for one in entry.conditions)
    first = "The model does not fit within the measurement" if known else "The table does not state the"
    if by_amplitude(entry.model):  # such an entry has no verdicts
        first, known = "The model does not fit within the stated", True
    which = "a model discrepancy" if known else "a standard uncertainty"
    ratio = sum(one.chi2 for one in entry.conditions) / max(sum(one.dof for one in entry.conditions), 1)
    return (
        f"{first} uncertainty. With {which} of {number(100 * entry.discrepancy, 2)} % of |K*| added, chi-square per "
        f"degree of freedom is {ratio:.2g}; the intervals below include it."
    )


def chosen(text: str) -> str:
    """The choice as a sentence."""
    return text.strip().rstrip(".") + "."


def verdicts(entry: ModelEntry) -> list[str]:
    """Whether K* of each condition can be that of a massless, relaxing specimen, as sentences."""
    judged = [(one, one.verdict) for one in entry.conditions if one.verdict is not None]
    bad = [one for one, verdict in judged if not verdict.possible]
    worst = percent(max((verdict.misfit for _, verdict in judged if not verdict.possible), default=0.0))
    off = f"it would take an error of K* of up to {worst} at each frequency"
    if by_amplitude(entry.model):
        return ["K* depends on the amplitude of the deflection, so no linear specimen can have it at all amplitudes."]
    match len(judged), len(bad):
        case 0, _:
            return [
                "The uncertainty of K* is unknown, so a massless, relaxing specimen is neither excluded nor confirmed."
            ]
        case 1, 0:
            return [f"{_kinds(judged)} can have this K*, within its uncertainty."]
        case count, 0:
            return [f"{_kinds(judged)} can have K* as measured in all {count} conditions."]
        case 1, _:
            return [f"No specimen, {_ANY}, can have this K*: {off}. {_where(bad[0])}."]
    good = len(judged) - len(bad)
    opening = f"{good or 'None'} of {len(judged)} conditions {'is' if good < 2 else 'are'} possible"
    return [f"{opening} for a specimen, {_ANY}; {'in the others ' if good else ''}{off}.", _listed(bad)]


def kind_that_holds(verdict: Verdict) -> str:
    """The kind of specimen that can have K*, in words."""
    match verdict.holds:
        case Rung.RELAXING:
            return "possible for a massless, relaxing specimen"
        case Rung.MASS:
            mass = f"{verdict.mass:.3g} ± {2 * verdict.mass_std:.2g} kg"
            return f"possible with a mass of {mass} at the specimen: is a plate not stated?"
        case Rung.RESONANT:
            if verdict.of is Of.BLOCKED_TRANSFER:
                return (
                    f"possible for relaxing springs about a mass, at {verdict.resonances[0]:.3g} Hz with both ends held"
                )
            if (belt := verdict.belt) is not None:
                return f"possible for relaxing springs about a mass of {belt.mass:.3g} ± {2 * belt.mass_std:.2g} kg"
            places = " and ".join(f"{one:.3g}" for one in np.sort(verdict.resonances))
            return f"possible for a specimen with a resonance at {places} Hz, as a belt or a hydromount has"
    kinds = {
        Of.SPRINGS: "relaxing springs, the only ones that --of springs tries",
        Of.BLOCKED_TRANSFER: "relaxing springs, alone or about a mass",
        Of.DRIVING_POINT: "a passive specimen, relaxing, with a mass at its end or with resonances",
    }
    return f"NOT possible for {kinds[verdict.of]}"


def lie_in_words(lie: Lie) -> str:
    """An error of the laboratory that would explain K* too."""
    spring = f"{1 / abs(lie.size) / 1e6 if lie.size else np.inf:.3g} kN/mm, or less"
    words = {
        "delay": f"V1 {abs(1e3 * lie.size):.2g} ms {'late' if lie.size > 0 else 'early'} against F1, or more",
        # A spring in series with a relaxing specimen is one too, so that what explains K* is a spring that V1 lacks.
        "compliance": f"{spring}, in series"
        if lie.size > 0
        else f"V1 too small by the deflection of {spring}: is the fixture stiffer than stated?",
        "cross-talk": f"{abs(1e6 * lie.size):.2g} mm/s per kN, or more, of F1 in V1",
    }
    return f"or a massless, relaxing specimen with {words[lie.name]}"


def _kinds(judged: Sequence[tuple[ConditionFile, VerdictFile]]) -> str:
    """The kinds of specimen that can have K* of some conditions, as the subject of a sentence."""
    holds = {verdict.holds for _, verdict in judged}
    if holds == {None}:
        return "A massless, relaxing specimen"
    masses = [verdict.mass for _, verdict in judged if verdict.mass is not None]
    if holds <= {None, Rung.MASS}:
        low, high = min(masses), max(masses)
        mass = f"{low:.3g}" if high - low < 0.01 * high else f"{low:.3g} to {high:.3g}"
        return f"A relaxing specimen with a mass of {mass} kg at its driven end, which is taken off K* before the fit,"
    places = [one for _, verdict in judged for one in verdict.resonances]
    if all(one.inertia is not None for one, verdict in judged if verdict.resonances):
        return (
            f"A specimen with a belt, whose resonance near {np.median(places):.3g} Hz is taken off K* before the fit,"
        )
    return f"A specimen with a resonance near {np.median(places):.3g} Hz"


def _listed(bad: Sequence[ConditionFile]) -> str:
    """The frequencies at which K* cannot be passive, condition by condition, as a sentence."""
    alike = {_where(one) for one in bad}
    if len(alike) == 1:
        return f"There {_lowered(alike.pop())}."
    named = [f"{place(one) or 'here'}: {_lowered(_where(one))}" for one in bad[:_NAMED]]
    more = f"; and in {len(bad) - _NAMED} more" if len(bad) > _NAMED else ""
    return f"At {'; at '.join(named)}{more}."


def _lowered(text: str) -> str:
    """A text as it reads inside a sentence; K* stays as it is."""
    return text if text.startswith("K*") else text[:1].lower() + text[1:]


def _where(one: ConditionFile) -> str:
    """The frequencies at which K* of a condition cannot be passive, as a sentence without its stop."""
    found = one.verdict.impossible if one.verdict is not None else []
    if not found:
        return "No single frequency is at fault"
    if len(found) == 1:
        return f"K* at {number(found[0], 3)} Hz cannot be"
    if len(found) >= len(one.tests) > 0:
        return "K* cannot be at any of the frequencies"
    return f"K* cannot be at {spread(found, FREQUENCY, 'Hz')}"


def rising_damping(facts: Facts, tyre: str) -> list[str]:
    """The sentence that says why no passive specimen is like one whose C rises with frequency; none if it does not."""
    for name in facts.tyres:
        found = (
            trend_of(q.C, name, facts.by_tyre(q.C).get(name, {}), "frequency") if facts.stated(name) == tyre else None
        )
        if found is not None and found.holds is Holds.RISES and isinstance(found.detail, Trend):
            rise = percent(found.detail.mean.value)
            text = f"No massless, relaxing specimen has a C that rises with frequency, as here by {rise}"
            return [f"{text} from {span(found.detail, facts.results.shown)}: with any constant K1, C can only fall."]
    return []


def place(one: ConditionFile, units: ShownUnits | None = None) -> str:
    """The state of a condition in words, in the units that are wanted.

    Examples
    --------
    >>> from fourpole.fitting.modelparts import NamedValue, VerdictFile
    >>> state = [NamedValue(name="pressure", unit="Pa", value=1.7e5), NamedValue(name="camber", unit="deg", value=2.0)]
    >>> place(
    ...     ConditionFile(
    ...         state=state,
    ...         tests=[],
    ...         band=(1, 2),
    ...         values=[],
    ...         covariance=[],
    ...         intervals=[],
    ...         on_bound=[],
    ...         chi2=0,
    ...         dof=1,
    ...         converged=True,
    ...         agreed=1,
    ...         verdict=None,
    ...     )
    ... )
    '1.7 bar, camber 2 deg'
    """
    return ", ".join((units or ShownUnits()).setting(each.column, each.value) for each in one.state)


def _axis(column: str) -> tuple[str, float, str]:
    unit = column.rpartition(" [")[2].removesuffix("]")
    return _AXES.get(column, ("" if unit == "1" else unit, 1.0, "--at"))


def map_facts(entry: MapEntry) -> list[tuple[str, str]]:
    """A map's axes, band and leave-one-out error, as pairs of name and value."""
    facts = [("model", entry.model + ("" if entry.causal else " (not causal)"))]
    for axis in entry.axes:
        column = axis.column
        unit, scale, _ = _axis(column)
        facts.append((axis.name, spread(axis.values, axis_of(column), unit, scale=scale)))
    for constant in entry.constant:
        unit, scale, _ = _axis(constant.column)
        facts.append((f"{constant.name}, not varied", f"{constant.value / scale:.4g} {unit}".rstrip()))
    facts.append(("frequency", ranged(list(entry.band), "Hz")))
    said = (
        "leave-one-out error of K*",
        "of their K′ and K″ inside the 95 % intervals",
        "of these conditions inside at the middle frequency",
    )
    errors = zip(said, entry.leave_one_out, strict=True)
    return [*facts, *((words, percent(value)) for words, value in errors if value is not None)]


def remarks_on_map(entry: MapEntry) -> list[str]:
    """Sentences on the range in which the map is valid."""
    if not entry.axes:
        return ["The tests stand at one condition: the map holds there alone."]
    where = "between the tested conditions" + (" (inside their hull)" if len(entry.axes) > 1 else "")
    return [f"It holds {where} and in the band; fourpole query extrapolates beyond them only on request."]


def query_command(entry: MapEntry, *, several: bool) -> str:
    """The command that queries the map at a point inside the tested conditions."""
    parts = ["fourpole query map.json"]
    if several:
        parts.append(tyre_option(entry.tyre))
    for axis, value in zip(entry.axes, inside(entry), strict=True):
        column = axis.column
        unit, scale, option = _axis(column)
        if option == "--at":
            parts.append(f"--at {shlex.quote(f'{column}={value:.10g}')}")
        else:
            parts.append(f'{option} "{value / scale:.10g} {_SPELLED.get(unit, unit)}"')
    low, high = entry.band
    middle = float(f"{math.sqrt(low * high):.3g}")
    parts.append(f'--frequency "{min(max(middle, low), high):.10g} Hz"')
    return " ".join(parts)


def tyre_option(name: str) -> str:
    """The option that names a specimen."""
    return f"--specimen {shlex.quote(name)}"


def inside(entry: MapEntry) -> Sequence[float]:
    """The middle of the tested conditions to three digits if it is inside them, otherwise a tested condition."""
    axes = map_of(entry).axes
    if not axes.names:
        return []
    middle = np.array([float(f"{value:.3g}") for value in axes.points.mean(axis=0)])
    if axes.outside(middle)[0] == 0:
        return [float(value) for value in middle]
    return [float(value) for value in axes.points[len(axes.points) // 2]]


def lacking(row: Mapping[str, Any]) -> list[str]:
    """What an answer of a model file does not have, with the reason; `row` is one of `fourpole.fitting.query.ask`."""
    said = []
    if row[q.K1.head] is None:
        said.append("K1, K2 and C: none; the model states no static stiffness")
    elif row[q.K2.head] is None:
        said.append("K2 and C: none; no passive arm beside K1 has this K*")
    if row[q.TR.head] is None:
        said.append("TR: none without a rig; state --mass and --preload-stiffness")
    return said


#: The unit shown for an SI unit, and its SI value.
_UNITS = {"N/m": ("kN/m", 1e3), "1": ("", 1.0)}
#: Largest number of conditions whose table of parameters is open when the page opens; a longer table is folded.
_OPEN = 4


def models_section(results: Study) -> list[SimpleNamespace]:
    """The model and the map of each tyre, as the page shows them."""
    models = {one.tyre: one for one in (results.models.models if results.models else [])}
    maps = {one.tyre: one for one in (results.maps.maps if results.maps else [])}
    facts = Facts.of(results)
    return [
        SimpleNamespace(
            tyre=tyre,
            model=_model(models[tyre], facts, shared=_shares(results, tyre)) if tyre in models else None,
            map=_map(maps[tyre], several=len(maps) > 1) if tyre in maps else None,
        )
        for tyre in dict.fromkeys([*models, *maps])
    ]


def _shares(results: Study, tyre: str) -> bool:
    """Whether conditions of a tyre share parameters by option."""
    return results.models is not None and "share" in results.models.provenance.settings_of(tyre)


def _model(entry: ModelEntry, facts: Facts, *, shared: bool) -> SimpleNamespace:
    """The model of one tyre; each parameter as symbol, unit shown and meaning."""
    least = min((one.bic for one in entry.candidates), default=0.0)
    return SimpleNamespace(
        name=entry.model,
        intervals="from the covariance" if entry.pressures or shared else "by profile likelihood",
        sentences=sentences(entry, facts),
        candidates=[_candidate(one, entry.model, least) for one in entry.candidates],
        parameters=[(one.symbol, _unit(one.unit)[0], one.meaning) for one in entry.parameters],
        conditions=[_condition(one, entry) for one in entry.conditions],
        open=len(entry.conditions) <= _OPEN,
    )


def _candidate(one: CandidateFile, best: str, least: float) -> SimpleNamespace:
    """One model that was fitted."""
    return SimpleNamespace(
        model=one.model,
        chosen=one.model == best,
        causal="yes" if one.causal else "no",
        cells=(
            str(one.free),
            number(one.chi2 / max(one.dof, 1), 3),
            _round(one.aicc),
            _round(one.bic - least),
            "–" if one.cross_validation is None else number(one.cross_validation, 3),
            str(one.on_bound or "–"),
            str(one.not_converged or "–"),
        ),
    )


def _round(value: float) -> str:
    """An information criterion as text, to a tenth at most, because only its differences matter."""
    return number(value, max(2, len(f"{abs(value):.0f}")) if abs(value) >= 10 else 2)


def _unit(unit: str) -> tuple[str, float]:
    return _UNITS.get(unit, (unit, 1.0))


def _condition(one: ConditionFile, entry: ModelEntry) -> SimpleNamespace:
    """The parameters of one condition; `reduced` is chi-square per degree of freedom."""
    low, high = one.band
    return SimpleNamespace(
        place=place(one),
        band=f"{number(low, 3)} to {number(high, 3)}" if high > low else number(low, 3),
        cells=[_cell(one, at, entry) for at in range(len(entry.parameters))],
        reduced=number(one.chi2 / max(one.dof, 1), 3),
        remark="" if one.converged else "the fit did not converge",
    )


def _cell(one: ConditionFile, at: int, entry: ModelEntry) -> SimpleNamespace:
    """A parameter of a condition: value, U, 95 % interval, and a mark if it was not free."""
    parameter = entry.parameters[at]
    scale = _unit(parameter.unit)[1]
    value, std = one.values[at] / scale, math.sqrt(max(one.covariance[at][at], 0.0)) / scale
    low, high = (None if end is None else end / scale for end in one.intervals[at])
    bound, given = parameter.symbol in one.on_bound, std == 0
    text, about = (number(value), "") if bound or given else expanded(value, std)
    return SimpleNamespace(
        text=text,
        std=about,
        interval=_interval(low, high, 0.0 if bound else std) if bound or not given else "",
        mark="on a bound" if bound else "given" if given else "",
    )


def _interval(low: float | None, high: float | None, std: float) -> str:
    """The 95 % interval in words; an end that the data do not determine is open."""
    if low is None and high is None:
        return "open to both sides"
    if low is None:
        return f"open to {_end(high, std)}"
    if high is None:
        return f"{_end(low, std)} to open"
    if low == high:
        return ""
    return f"{_end(low, std)} to {_end(high, std)}"


def _end(value: float | None, std: float) -> str:
    """An end of an interval, with as many digits as the value."""
    return with_std(value, std)[0] if std else number(value, 3)


def _map(entry: MapEntry, *, several: bool) -> SimpleNamespace:
    """The map of one tyre."""
    return SimpleNamespace(
        text=chosen(entry.choice),
        facts=map_facts(entry),
        remarks=remarks_on_map(entry),
        command=query_command(entry, several=several),
    )
