"""What the commands on models print: choices, parameters, maps and answers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.table import Table

from fourpole import quantities as q
from fourpole.app.console import harmless, out, say, table_console, warn
from fourpole.fitting.modelfile import ConditionFile, ModelEntry, column_of
from fourpole.fitting.modelling import TyreMap
from fourpole.models.operating import OperatingMap

__all__ = ["show_fit", "show_map", "show_rows"]

_MOST_ROWS = 40
_MOST_NAMED = 12


def show_fit(entry: ModelEntry) -> None:
    """The choice, the verdict and the parameters of a tyre."""
    if entry.tyre:
        out(f"Tyre {entry.tyre}")
    table = Table(box=box.SIMPLE)
    for name in ("model", "causal", "parameters", "chi2", "dof", "chi2/dof [1]", "AICc", "BIC - best"):
        table.add_column(name, justify="left" if name in ("model", "causal") else "right")
    for name in ("cross-validation [1]", "on a bound", "not converged"):
        table.add_column(name, justify="right")
    least = min(one.bic for one in entry.candidates)
    for one in entry.candidates:
        table.add_row(
            one.model + (" *" if one.model == entry.model else ""),
            "yes" if one.causal else "no",
            str(one.free),
            f"{one.chi2:.4g}",
            str(one.dof),
            f"{one.chi2 / max(one.dof, 1):.3g}",
            f"{one.aicc:.5g}",
            f"{one.bic - least:.3g}",
            "" if one.left_out is None else f"{one.left_out:.3g}",
            str(one.on_bound or ""),
            str(one.lost or ""),
        )
    table_console().print(table)
    out(entry.choice)
    if entry.granted:
        out(f"the model fits with a discrepancy of {100 * entry.granted:.2g} % of |K*|; the uncertainties include it")
    _show_verdicts(entry)
    _show_parameters(entry)


def _show_verdicts(entry: ModelEntry) -> None:
    verdicts = [one.verdict for one in entry.conditions if one.verdict is not None]
    bad = [one for one in verdicts if not one.possible]
    if bad:
        worst = max(one.misfit for one in bad)
        out(
            f"K* is not possible for a passive linear tyre in {len(bad)} of {len(verdicts)} conditions; it would be, "
            f"were it uncertain by up to {100 * worst:.2g} % (fourpole causality says where)"
        )
    elif verdicts:
        where = f" in all {len(verdicts)} conditions" if len(verdicts) > 1 else ""
        out(f"K* is possible for a passive linear tyre{where}")


def _show_parameters(entry: ModelEntry) -> None:
    alike = _held(entry)
    _show_values(entry, [at for at in range(len(entry.parameters)) if at not in alike])
    if alike:
        held = (
            f"{entry.parameters[at].symbol} = {entry.conditions[0].values[at]:.5g} {_unit_of(entry, at)}".rstrip()
            for at in alike
        )
        out(harmless(f"given, not fitted: {', '.join(held)}"))
    out("value ± standard uncertainty, 95 % interval by profile likelihood; (bound): on a bound, or unseen")
    if len(entry.conditions) > _MOST_ROWS:
        out(f"... and {len(entry.conditions) - _MOST_ROWS} more conditions, in the model file")
    alone = [one for one in entry.conditions if not one.converged]
    if alone:
        warn(f"{len(alone)} fits did not converge: {'; '.join(_words(one) for one in alone[:_MOST_NAMED])}")


def _held(entry: ModelEntry) -> list[int]:
    """Places of the parameters that are given, at one value in all conditions."""
    given = [at for at in range(len(entry.parameters)) if all(_is_given(one, at) for one in entry.conditions)]
    return [at for at in given if len({one.values[at] for one in entry.conditions}) == 1]


def _show_values(entry: ModelEntry, places: Sequence[int]) -> None:
    """The table of the parameters at some places, of each condition."""
    table = Table(box=box.SIMPLE)
    table.add_column("condition")
    for at in places:
        table.add_column(harmless(f"{entry.parameters[at].symbol} [{entry.parameters[at].unit}]"), justify="right")
    for one in entry.conditions[:_MOST_ROWS]:
        table.add_row(harmless(_words(one)), *(_cell(one, at) for at in places))
    table_console().print(table)


def _unit_of(entry: ModelEntry, at: int) -> str:
    unit = entry.parameters[at].unit
    return "" if unit == "1" else unit


def _words(one: ConditionFile) -> str:
    parts = []
    for item in one.state:
        if column_of(item.name, item.unit) == q.PRESSURE.head:
            parts.append(f"{item.value / 1e5:.4g} bar")
        else:
            named = "" if item.name in ("preload", "temperature") else f"{item.name} "
            parts.append(f"{named}{item.value:.5g} {item.unit}")
    return ", ".join(parts) or f"{one.band[0]:.4g} to {one.band[1]:.4g} Hz"


def _cell(one: ConditionFile, at: int) -> str:
    value, std = one.values[at], math.sqrt(max(one.covariance[at][at], 0.0))
    if std == 0:
        return f"{value:.5g} ({'given' if _is_given(one, at) else 'bound'})"
    low, high = one.intervals[at]
    ends = f"{'open' if low is None else f'{low:.4g}'} .. {'open' if high is None else f'{high:.4g}'}"
    return f"{value:.5g} ± {std:.2g}\n{ends}"


def _is_given(one: ConditionFile, at: int) -> bool:
    """Whether a parameter was known: it has an interval of no width."""
    low, high = one.intervals[at]
    return one.covariance[at][at] == 0 and low is not None and low == high


def show_map(found: TyreMap) -> None:
    """What was tried, and what was taken."""
    if found.tyre:
        out(f"Tyre {found.tyre}")
    table = Table(box=box.SIMPLE)
    for name in ("model", "causal", "terms", "leave-one-out error [%]", "inside 95 % [%]", "scatter [%]"):
        table.add_column(name, justify="left" if name in ("model", "causal") else "right")
    for name, one in found.others:
        if isinstance(one, OperatingMap):
            mark = " *" if one is found.best else ""
            left = one.left_out
            cells = (100 * left.error, 100 * left.inside, 100 * one.scatter.condition)
            shown = (f"{cell:.3g}" if math.isfinite(cell) else "" for cell in cells)
            table.add_row(name + mark, "yes" if one.model.causal else "no", str(len(one.terms)), *shown)
        else:
            table.add_row(name, "", "", "none", "", "")
    table_console().print(table)
    for name, one in found.others:
        if isinstance(one, str):
            out(harmless(f"{name}: none, for {one}"))
    out(found.text)


def show_rows(rows: Sequence[Mapping[str, Any]]) -> None:
    """One answer in lines, several as CSV."""
    if len(rows) > 1:
        import polars as pl

        out(pl.DataFrame(list(rows)).write_csv().rstrip("\n"))
        return
    row = rows[0]
    for name, value in row.items():
        if name in ("remarks", q.OUTSIDE.head) or name.startswith(("u(", "corr(")) or value in (None, ""):
            continue
        quantity, _, unit = name.removesuffix("]").partition(" [")
        std = row.get(f"u({quantity}) [{unit}]")
        text = value if isinstance(value, str) else f"{value:.6g}"
        sure = f" ± {std:.2g}" if isinstance(std, float) else ""
        out(f"{quantity:<12} {text}{sure} {unit if unit != '1' else ''}".rstrip())
    if row[q.K2.head] is None:
        say("K2 and C: none, for no passive arm beside K1 has this K*")
    if row[q.TR.head] is None:
        say("TR: state the rig, --mass and --preload-stiffness")
