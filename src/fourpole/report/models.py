"""The section on models and operating maps: choice, parameters of each condition, and the query of the map.

A function returns what the template shows of one thing, as a namespace.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

from fourpole.findings.facts import Facts
from fourpole.fitting.modelfile import CandidateFile, ConditionFile, MapEntry, ModelEntry
from fourpole.report.digits import number, with_std
from fourpole.report.words.models import chosen, map_facts, place, query_command, remarks_on_map, sentences
from fourpole.study.study import Study

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
    """A parameter of a condition: value, standard uncertainty, 95 % interval, and a mark if it was not free."""
    parameter = entry.parameters[at]
    scale = _unit(parameter.unit)[1]
    value, std = one.values[at] / scale, math.sqrt(max(one.covariance[at][at], 0.0)) / scale
    low, high = (None if end is None else end / scale for end in one.intervals[at])
    bound, given = parameter.symbol in one.on_bound, std == 0
    text, about = (number(value), "") if bound or given else with_std(value, std)
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
