"""Results of the commands on models: comparisons, parameters, maps and answers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fourpole import quantities as q
from fourpole.answer import Part, Table
from fourpole.app.console import more, say, warn
from fourpole.core.digits import number
from fourpole.fitting.modelfile import ConditionFile, ModelEntry
from fourpole.fitting.modelling import TyreMap
from fourpole.fitting.modelparts import PutBackFile
from fourpole.fitting.query import INTERVAL, PURPOSE
from fourpole.models.operating import OperatingMap
from fourpole.quantities import ShownUnits
from fourpole.report.digits import PLUS_MINUS, cell, with_u
from fourpole.report.models import discrepancy, lacking, place, verdicts
from fourpole.words import first_of

_MOST_ROWS = 40
#: More parameters than this are listed one below the other, for the first so many conditions.
_MOST_COLUMNS, _MOST_TABLES = 9, 4
_MOST_NAMED = 12
#: A relative standard uncertainty below this is that of a parameter without influence.
_NEGLIGIBLE = 1e-9
#: Heads of the numbers by which fits are compared.
_COMPARED = (
    "parameters",
    "chi2",
    "dof",
    "chi2/dof [1]",
    "AICc",
    "BIC - best",
    "cross-validation [1]",
    "on a bound",
    "not converged",
)
#: Heads of the numbers by which surfaces of a map are compared.
_MAPPED = ("terms", "log density - best", "leave-one-out error [%]", "inside 95 % [%]", "scatter [%]")


def show_fit(entry: ModelEntry, units: ShownUnits, *, shared: bool) -> Iterator[Part]:
    """The compared models, the verdict and the parameters of a tyre; `shared` if conditions share some."""
    if entry.tyre:
        yield f"Specimen {entry.tyre}"
    least = min(one.bic for one in entry.candidates)
    rows = [
        (
            one.model + (" *" if one.model == entry.model else ""),
            "yes" if one.causal else "no",
            str(one.free),
            number(one.chi2),
            str(one.dof),
            number(one.chi2 / max(one.dof, 1), 3),
            number(one.aicc, 5),
            number(one.bic - least, 3),
            "" if one.cross_validation is None else number(one.cross_validation, 3),
            str(one.on_bound or ""),
            str(one.not_converged or ""),
        )
        for one in entry.candidates
    ]
    yield Table(("model", "causal", *_COMPARED), rows, right=_COMPARED)
    yield entry.choice
    if entry.discrepancy:
        yield discrepancy(entry)
    yield from verdicts(entry)
    yield from _show_parameters(entry, units, shared=shared)


def put_back_shown(found: PutBackFile | None, tyre: str = "") -> Iterator[Part]:
    """How many of the data lie in the interval that a query gives for them; a warning if these are too few."""
    if found is None:
        return
    said = f"{tyre}: {found.sentence}" if tyre else found.sentence
    if found.low:
        warn(said)
    else:
        yield said


def _show_parameters(entry: ModelEntry, units: ShownUnits, *, shared: bool) -> Iterator[Part]:
    fixed = [at for at in range(len(entry.parameters)) if _is_fixed(entry, at)]
    heads = {at: _head(entry, at, units) for at in range(len(entry.parameters)) if at not in fixed}
    if len(heads) > _MOST_COLUMNS:
        yield from _show_down(entry, list(heads), units)
        fixed = [at for at in fixed if not entry.parameters[at].symbol.startswith("tau_")]
    else:
        shown = entry.conditions[:_MOST_ROWS]
        rows = [(_condition(one, units), *("\n".join(_cell(entry, one, at, units)) for at in heads)) for one in shown]
        yield Table(("condition", *heads.values()), rows, right=list(heads.values()))
    if fixed:
        named = (f"{entry.parameters[at].symbol} = {_fixed_value(entry, at, units)}" for at in fixed)
        yield f"fixed, not fitted: {', '.join(named)}"
    how = "from the covariance" if entry.pressures or shared else "by profile likelihood"
    yield f"{PLUS_MINUS}, below it the 95 % interval {how}; (bound): on a bound, or without influence"
    if len(heads) <= _MOST_COLUMNS:
        yield from more(entry.conditions, _MOST_ROWS, " conditions, in the model file")
    alone = [_condition(one, units) for one in entry.conditions if not one.converged]
    if alone:
        warn(f"{len(alone)} fits did not converge: {first_of(alone, _MOST_NAMED)}")


def _show_down(entry: ModelEntry, places: Sequence[int], units: ShownUnits) -> Iterator[Part]:
    """Many parameters of a tyre one below the other, a table for each condition."""
    symbols = [one.symbol for one in entry.parameters]
    for one in entry.conditions[:_MOST_TABLES]:
        rows = []
        for at in places:
            symbol = symbols[at]
            time = symbol.replace("K_", "tau_")
            arm = f"{one.values[symbols.index(time)]:.4g}" if time != symbol and time in symbols else ""
            value, ends = _cell(entry, one, at, units)
            rows.append((_head(entry, at, units), arm, value, ends))
        yield Table(
            (_condition(one, units), "relaxation time [s]", "value", "95 %"),
            rows,
            right=("relaxation time [s]", "value", "95 %"),
        )
    yield from more(entry.conditions, _MOST_TABLES, " conditions, in the model file")


def _is_fixed(entry: ModelEntry, at: int) -> bool:
    """Whether a parameter has the same fixed value in all conditions."""
    return (
        all(_is_given(one, at) for one in entry.conditions) and len({one.values[at] for one in entry.conditions}) == 1
    )


def _head(entry: ModelEntry, at: int, units: ShownUnits) -> str:
    """Symbol of a parameter with the unit shown."""
    one = entry.parameters[at]
    unit, _ = units.unit(one.unit)
    return f"{one.symbol} [{unit}]" if unit else one.symbol


def _fixed_value(entry: ModelEntry, at: int, units: ShownUnits) -> str:
    """A fixed value with its unit."""
    unit, scale = units.unit(entry.parameters[at].unit)
    return f"{number(entry.conditions[0].values[at] / scale, 5)} {unit}".rstrip()


def _condition(one: ConditionFile, units: ShownUnits) -> str:
    return place(one, units) or f"{one.band[0]:.4g} to {one.band[1]:.4g} Hz"


def _cell(entry: ModelEntry, one: ConditionFile, at: int, units: ShownUnits) -> tuple[str, str]:
    """Value with U, and the 95 % interval, in the unit shown and to the digits of U."""
    scale = units.unit(entry.parameters[at].unit)[1]
    value, std = one.values[at], math.sqrt(max(one.covariance[at][at], 0.0))
    std = std if std > _NEGLIGIBLE * abs(value) else 0.0
    low, high = one.intervals[at]
    if std == 0 and (_is_given(one, at) or high is None):
        return f"{number(value / scale, 5)} ({'given' if _is_given(one, at) else 'bound'})", ""
    ends = " .. ".join(
        "open" if end is None else with_u(end, std or None, scale).partition(" ")[0] for end in (low, high)
    )
    return (with_u(value, std, scale), ends) if std else (f"{number(value / scale, 5)} (bound)", ends)


def _is_given(one: ConditionFile, at: int) -> bool:
    """Whether a parameter was fixed: its interval has no width."""
    low, high = one.intervals[at]
    return one.covariance[at][at] == 0 and low is not None and low == high


def show_map(found: TyreMap) -> Iterator[Part]:
    """The compared surfaces and the chosen one."""
    if found.tyre:
        yield f"Specimen {found.tyre}"
    yield Table(
        ("model", "causal", "link", *_MAPPED), [_map_row(name, one, found) for name, one in found.others], right=_MAPPED
    )
    for name, one in found.others:
        if isinstance(one, str):
            yield f"{name}: none, for {one}"
    yield found.text


def _map_row(name: str, one: OperatingMap | str, found: TyreMap) -> tuple[str, ...]:
    """Cells of one surface; a text instead of a map says why there is none."""
    if isinstance(one, str):
        return name, "", "", "", "none", "", "", ""
    density = one.leave_one_out.density - max(each.leave_one_out.density for each in found.maps)
    numbers = (one.leave_one_out.error, one.leave_one_out.inside, max(one.scatter.condition))
    shown = (f"{100 * each:.3g}" if math.isfinite(each) else "" for each in numbers)
    less = number(density, 3) if math.isfinite(density) else ""
    mark = " *" if one is found.best else ""
    return name + mark, "yes" if one.model.causal else "no", one.link, str(len(one.terms)), less, *shown


def show_row(row: Mapping[str, Any], units: ShownUnits) -> Iterator[Part]:
    """One answer of a model file in lines."""
    for head, value in row.items():
        if (
            head in (q.REMARKS.head, q.OUTSIDE.head, PURPOSE, INTERVAL)
            or head.startswith(("u(", "corr("))
            or value in (None, "")
        ):
            continue
        name, _, si = head.removesuffix("]").partition(" [")
        yield f"{name:<12} {cell(row, head, units)} {units.unit(si)[0]}".rstrip()
    yield f"{PLUS_MINUS}. {row[INTERVAL]}"
    say(*lacking(row))
