"""Model: what was fitted and why, and the map with sliders; fitting and mapping run as jobs.

An answer of a model or a map is K* at a point, with the curve over frequency.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, get_args

import numpy as np
from markupsafe import Markup
from starlette.requests import Request
from starlette.routing import Route

from fourpole import quantities as q
from fourpole.core.condition import AMPLITUDE, AXES
from fourpole.core.confidence import NORMAL_95
from fourpole.errors import CampaignError, FourpoleError, ModelError
from fourpole.fitting.modelfile import MapEntry, ModelEntry, ModelFile
from fourpole.fitting.query import INTERVAL, Query, ask, polar_of
from fourpole.models.families import FAMILIES
from fourpole.models.operating import Purpose
from fourpole.plot.states import axis_shown, place_text
from fourpole.quantities import Quantity, ShownUnits
from fourpole.report.cards import embedded
from fourpole.report.digits import cell
from fourpole.report.models import inside, lacking
from fourpole.served.signals import plotted
from fourpole.served.site import LinkedFigure, Shown, Site, figure_of
from fourpole.served.workspace import Place
from fourpole.study.study import Study
from fourpole.units import quantity

#: Axes whose values are stated with a unit: name in the address and kind of quantity, by column.
_WITH_UNIT = {
    axis.column: (axis.name, kind)
    for axis, kind in zip((*AXES, AMPLITUDE), ("pressure", "force", "temperature", "displacement"), strict=True)
}
#: Rows of an answer, and the quantities whose curve is shown.
_ANSWERED = (q.STORAGE, q.LOSS, q.MODULUS, q.LOSS_ANGLE, q.LOSS_FACTOR, q.K1, q.K2, q.C, q.TR)
_CURVES = (q.STORAGE, q.LOSS, q.K2, q.C)
#: Number of points of a curve, and ratio of the ends of a band from which its frequencies are logarithmic.
_POINTS, _DECADE = 61, 10.0
_FREQUENCY = "frequency"


@dataclass(frozen=True)
class Field:
    """A value that a question states.

    Attributes
    ----------
    name : str
        Its name in the address: of an axis, or the head of the column of a further one.
    label, unit : str
        As shown.
    low, high, value : float
        Least and largest measured value, and the first one, in the unit shown.
    log : bool
        Whether the range is more than a decade.
    """

    name: str
    label: str
    unit: str
    low: float
    high: float
    value: float
    log: bool = False


@dataclass(frozen=True)
class Source:
    """What answers for one specimen: a map, or else the models of its conditions.

    Attributes
    ----------
    tyre : str
    file : ModelFile
    fields : tuple of Field
        The last one is the frequency.
    conditions : dict of str to dict
        The conditions of a model without a map: values by their names in the address, by the condition in words.
    constant : str
        Values that all tests share, in words.
    """

    tyre: str
    file: ModelFile
    fields: tuple[Field, ...]
    conditions: dict[str, dict[str, str]]
    constant: str


def sources(results: Study) -> dict[str, Source]:
    """What answers for each specimen: its map where it has one, else its models."""
    found: dict[str, Source] = {}
    if results.maps is not None:
        found |= {one.tyre: _of_map(results, results.maps, one) for one in results.maps.maps}
    if results.models is not None:
        found |= {
            one.tyre: _of_model(results, results.models, one)
            for one in results.models.models
            if one.tyre not in found and one.conditions
        }
    return found


def _of_map(results: Study, file: ModelFile, entry: MapEntry) -> Source:
    fields = [
        _field(results.shown, axis.column, min(axis.values), max(axis.values), value)
        for axis, value in zip(entry.axes, inside(entry), strict=True)
    ]
    frequency = _frequency(results, entry.band, entry.band)
    return Source(
        entry.tyre, file, (*fields, *_amplitude(results, entry.amplitude), frequency), {},
        ", ".join(place_text(results, one.column, one.value) for one in entry.constant),
    )  # fmt: skip


def _of_model(results: Study, file: ModelFile, entry: ModelEntry) -> Source:
    stated = [{one.column: one.value for one in each.state} for each in entry.conditions]
    law = entry.temperature
    fields = []
    if law is not None:
        low, high = law.range
        fields.append(_field(results.shown, q.TEMPERATURE.head, low, high, law.reference))
        stated = [{name: value for name, value in one.items() if name != q.TEMPERATURE.head} for one in stated]
    words = [", ".join(place_text(results, name, value) for name, value in one.items()) for one in stated]
    conditions = {
        text: {_name(name): _written(results.shown, name, value) for name, value in one.items()}
        for text, one in zip(words, stated, strict=True)
    }
    several = len(conditions) > 1
    band = min(one.band[0] for one in entry.conditions), max(one.band[1] for one in entry.conditions)
    frequency, amplitudes = _frequency(results, band, entry.conditions[0].band), entry.conditions[0].amplitude
    return Source(
        entry.tyre, file, (*fields, *_amplitude(results, amplitudes), frequency),
        conditions if several else {}, "" if several else words[0],
    )  # fmt: skip


def _field(units: ShownUnits, column: str, low: float, high: float, value: float) -> Field:
    label, unit, scale = axis_shown(column, units)
    low, high = _inward(low / scale, high / scale)
    first = float(np.clip(float(f"{value / scale:.6g}"), low, high))
    return Field(_name(column), label, unit, low, high, first, log=low > 0 and high > _DECADE * low)


def _inward(low: float, high: float) -> tuple[float, float]:
    """Both ends to six digits, not further apart."""
    ends = []
    for value, to in ((low, np.ceil), (high, np.floor)):
        step = 10.0 ** (np.floor(np.log10(abs(value))) - 5) if value else 1.0
        ends.append(float(f"{to(round(value / step, 6)) * step:.6g}"))
    return (ends[0], ends[1]) if ends[0] <= ends[1] else (low, high)


def _amplitude(results: Study, levels: Sequence[float] | None) -> tuple[Field, ...]:
    if not levels:
        return ()
    return (_field(results.shown, AMPLITUDE.column, levels[0], levels[-1], float(np.sqrt(levels[0] * levels[-1]))),)


def _frequency(results: Study, band: tuple[float, float], first: tuple[float, float]) -> Field:
    """The field of the frequency over a band; its first value is the middle of the band of the first condition."""
    (low, high), (least, largest) = band, first
    middle = float(np.clip(float(f"{np.sqrt(least * largest):.3g}"), least, largest))
    return replace(_field(results.shown, q.FREQUENCY.head, low, high, middle), name=_FREQUENCY)


def _name(column: str) -> str:
    """The name of an axis in an address."""
    return _WITH_UNIT[column][0] if column in _WITH_UNIT else column


def _written(units: ShownUnits, column: str, value: float) -> str:
    """A value as an address has it: with its unit, or a bare number in the unit of its column."""
    if column not in _WITH_UNIT:
        return f"{value:.10g}"
    _, unit, scale = axis_shown(column, units)
    return f"{value / scale:.10g} {unit}"


def answer(
    results: Study, source: Source, asked: Mapping[str, str], *, beyond: bool, purpose: Purpose | None = None
) -> dict[str, Any]:
    """The answer to a question, and the curves over frequency at its point; `fault` in place of both if it has none.

    Parameters
    ----------
    results : Study
    source : Source
    asked : mapping of str to str
        Values by the names of the fields; one that is not stated has the first value of its field.
    beyond : bool
        Whether to answer outside the tested conditions and frequencies.
    purpose : Purpose, optional
        What the intervals are for.
    """
    try:
        state, frequency = _state(source, asked)
        units = results.shown
        rows = ask(source.file, Query([frequency], state, source.tyre, beyond=beyond, units=units, purpose=purpose))
        row = {**rows[0], **{head: float(one[0]) for head, one in polar_of(rows).items()}}
        return {
            "fault": "",
            "remarks": [one for one in [str(row["remarks"]), *lacking(row), row[INTERVAL]] if one],
            "rows": [_shown(row, one, units) for one in _ANSWERED if row.get(one.head) is not None],
            "curves": _curves(source, state, frequency, units, beyond=beyond, purpose=purpose),
        }
    except FourpoleError as error:
        return {"fault": str(error), "remarks": [], "rows": [], "curves": None}


def _state(source: Source, asked: Mapping[str, str]) -> tuple[dict[str, float], float]:
    """Values by column in SI, and the frequency [Hz]."""
    state: dict[str, float] = {}
    known = {name: (column, kind) for column, (name, kind) in _WITH_UNIT.items()}
    first = next(iter(source.conditions.values()), {})
    texts = {**first, **{one.name: f"{one.value:.10g} {one.unit}" for one in source.fields}}
    texts |= {name: text for name, text in asked.items() if text and name in {*texts, *known}}
    frequency = quantity(texts.pop(_FREQUENCY), "frequency")
    for name, text in texts.items():
        if name in known:
            column, kind = known[name]
            state[column] = quantity(text, kind)
        else:
            state[name] = _number(name, text)
    return state, frequency


def _number(name: str, text: str) -> float:
    try:
        value = float(text.split(maxsplit=1)[0])
    except (ValueError, IndexError):
        value = np.nan
    if not np.isfinite(value):
        raise CampaignError(f"{name}: state a number")
    return value


def _shown(row: Mapping[str, Any], one: Quantity, units: ShownUnits) -> dict[str, str]:
    seen = units.of(one)
    text = cell(row, one.head, units)
    return {"name": one.meaning or one.name, "symbol": one.symbol, "text": text, "unit": seen.suffix}


def _curves(
    source: Source,
    state: dict[str, float],
    frequency: float,
    units: ShownUnits,
    *,
    beyond: bool,
    purpose: Purpose | None,
) -> dict[str, Any] | None:
    """The curves over the band, at the point of the answer; None where the band of the condition has no width."""
    band = source.fields[-1]
    low, high = (min(band.low, frequency), max(band.high, frequency)) if beyond else (band.low, band.high)
    if not high > low:
        return None
    grid = np.geomspace(low, high, _POINTS) if band.log else np.linspace(low, high, _POINTS)
    try:
        rows = ask(source.file, Query(grid.tolist(), state, source.tyre, beyond=True, units=units, purpose=purpose))
    except ModelError:
        return None
    return {
        "frequency": plotted(grid, 6),
        "at": frequency,
        "log": band.log,
        "panels": [made for one in _CURVES if (made := _curve(rows, one, units)) is not None],
    }


def _curve(rows: Sequence[Mapping[str, Any]], one: Quantity, units: ShownUnits) -> dict[str, Any] | None:
    values, stds = (np.array([row[head] for row in rows], dtype=float) for head in one.heads)
    if not np.isfinite(values).any():
        return None
    seen = units.of(one)
    return {
        "name": seen.name,
        "symbol": one.symbol,
        "unit": seen.shown,
        "y": plotted(values / seen.scale, 6),
        "half": plotted(NORMAL_95 * np.nan_to_num(stds) / seen.scale, 6),
    }


#: Figures of models and maps, in the order of the page.
_FIGURES = ("storage-loss", "model-choice", "spectrum", "amplitude", "map")


def routes(site: Site) -> list[Route]:
    """The page, and the answer at a point."""
    return [
        site.page_route("/c/{key}/model", "model.html", partial(_shown_in, site), of_results=True),
        site.document_route("/c/{key}/model/answer", partial(_answer, site)),
    ]


def _shown_in(site: Site, place: Place, request: Request) -> dict[str, Any]:
    asked = request.query_params
    shown = site.results(place)
    results = shown.results
    known = sources(results)
    source = known.get(asked.get("tyre", "")) or next(iter(known.values()), None)
    found = None if source is None else _answered(shown, source, asked)
    return {
        **shown.parts,
        "opened": "models",
        "specimens": list(known),
        "source": source,
        "asked": {} if source is None else _asked(source, asked),
        "condition": "" if source is None else _condition(source, asked),
        "beyond": "beyond" in asked,
        "purposes": get_args(Purpose),
        "purpose": _purpose(asked),
        "answer": found,
        "data": Markup(embedded(found["curves"] if found else None)),
        "pictures": _figures(site, shown),
        "fitted": results.models is not None,
        "mapped": results.maps is not None,
        "families": [one.removesuffix("[:N]") for one in FAMILIES],
    }


def _figures(site: Site, shown: Shown) -> list[LinkedFigure]:
    """The figures of models and maps: those of the report, or drawn where it has none."""
    results = shown.results
    if results.models is None and results.maps is None:
        return []
    figures = {figure.key: figure for _, figure in shown.parts["figures"]}
    made = []
    for key in _FIGURES:
        if key in figures:
            made.append(LinkedFigure(figures[key], shown))
        elif (one := figure_of(site, shown, results, key)) is not None:
            made.append(one)
    return made


def _asked(source: Source, asked: Mapping[str, str]) -> dict[str, str]:
    """The numbers that the form shows, in the units of the fields."""
    found = {}
    for one in source.fields:
        number = asked.get(one.name, "").removesuffix(one.unit).strip()
        found[one.name] = number or f"{one.value:.10g}"
    return found


def _condition(source: Source, asked: Mapping[str, str]) -> str:
    """The condition that the address states, in words."""
    known = source.conditions.items()
    return next((text for text, one in known if all(asked.get(name) == value for name, value in one.items())), "")


def _answered(shown: Shown, source: Source, asked: Mapping[str, str]) -> dict[str, Any]:
    units = {one.name: one.unit for one in source.fields}
    # A form without script sends bare numbers, which are in the unit beside the field.
    stated = {
        name: f"{text} {units[name]}" if _is_bare(text) and name in units else text for name, text in asked.items()
    }
    return answer(shown.results, source, stated, beyond="beyond" in asked, purpose=_purpose(asked))


def _purpose(asked: Mapping[str, str]) -> Purpose | None:
    """What the intervals are for; None for the usual one."""
    return next((one for one in get_args(Purpose) if one == asked.get("for")), None)


def _is_bare(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _answer(site: Site, place: Place, request: Request) -> dict[str, Any]:
    asked = request.query_params
    shown = site.results(place)
    known = sources(shown.results)
    if asked.get("tyre", "") not in known:
        raise CampaignError("there is no model of this specimen: it was fitted again a moment ago; load the page again")
    return _answered(shown, known[asked["tyre"]], asked)
