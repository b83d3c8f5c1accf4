"""The rig as found, read from the tables and the record of a results folder."""

from __future__ import annotations

import math
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.core.joint.misfit import Candidate
from fourpole.core.sources import Kind, Role, Source
from fourpole.fitting.rows import keys_of
from fourpole.study.rig_estimate import (
    CELLS,
    NoteCode,
    Outlier,
    RigEstimate,
    RigFinding,
    RunOrder,
    SharedValue,
    hidden_in,
    mass_gain,
    number,
)


def read_rig_estimates(rig: pl.DataFrame, residuals: pl.DataFrame, joint: object) -> tuple[RigEstimate, ...]:
    """The estimate of each rig, in the order of rig.csv; none where another route was used.

    Parameters
    ----------
    rig, residuals : polars.DataFrame
        rig.csv and residuals.csv.
    joint : object
        The record of study.json by the name of the rig; an entry of another form counts as missing.
    """
    records = _mapping(joint)
    names = [str(name or "") for name in rig[q.RIG.head].to_list()] if q.RIG.head in rig.columns else []
    names += [name for name, record in records.items() if isinstance(record, dict)]
    return tuple(_read(name, _of(rig, name), _of(residuals, name), records.get(name)) for name in dict.fromkeys(names))


def _read(name: str, rig: pl.DataFrame, residuals: pl.DataFrame, recorded: object) -> RigEstimate:
    record = _mapping(recorded)
    values = _values(rig)
    gain = _mapping(record.get("gain_of_masses"))
    names = ("chi2", "dof", "rig_error", "inflation", "scatter", "unsteady")
    known: dict[str, Any] = {one: found for one in names if (found := number(record.get(one))) is not None}
    masses = residuals[q.ADDED_MASS.head].to_list() if q.ADDED_MASS.head in residuals.columns else []
    return RigEstimate(
        name,
        values,
        fits=record.get("fits") is not False and not any(one.finding is RigFinding.NOT_CALIBRATED for one in values),
        converged=record.get("converged") is not False,
        reason=str(record.get("reason") or ""),
        **{one: int(number(record.get(one)) or 0) for one in ("steps", "tests", "conditions", "shared")},
        **known,
        candidates=tuple(_candidates(record.get("candidates"))),
        outliers=_outliers(residuals),
        massed=any((number(mass) or 0.0) > 0 for mass in masses) or any(one.source.role is Role.MASS for one in values),
        tied=int(number(record.get("tied")) or 0),
        rests=str(record.get("rests") or ""),
        drift_by_mass=record.get("drift_by_mass") is True,
        order=next((order for order in RunOrder if order == record.get("order")), RunOrder.ROWS),
        unshared_masses=NoteCode.UNSHARED_MASSES in _list(record.get("note_codes")),
        mass_gain=mass_gain(_mapping(gain.get("without")), _mapping(gain.get("with"))),
    )


def _of(table: pl.DataFrame, rig: str) -> pl.DataFrame:
    """The rows of one rig."""
    if q.RIG.head not in table.columns:
        return pl.DataFrame()
    return table.filter(pl.col(q.RIG.head).fill_null("") == rig)


def _mapping(value: object) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _values(rows: pl.DataFrame) -> tuple[SharedValue, ...]:
    sources = [Source.read(str(text or "")) for text in rows[q.VALUE.head]] if q.VALUE.head in rows.columns else []
    stated = set(sources)
    return tuple(
        SharedValue(
            source,
            str(row.get(q.UNIT.head) or ""),
            **{name: number(row.get(head)) for name, head in CELLS.items()},
            finding=_finding(row.get(q.FINDING.head)),
            hides=hidden_in(source, stated),
        )
        for source, row in zip(sources, rows.rows(named=True), strict=True)
    )


def _finding(text: object) -> RigFinding:
    return next((finding for finding in RigFinding if finding == text), RigFinding.UNKNOWN)


def _candidates(listed: object) -> list[Candidate]:
    found = [item for item in _list(listed) if isinstance(item, dict) and item.get("text")]
    texts, numbers = ("name", "unit"), ("value", "std", "explains", "size")
    cells: list[dict[str, Any]] = [
        {name: str(item.get(name) or "") for name in texts} | {name: _or_nan(item.get(name)) for name in numbers}
        for item in found
    ]
    kinds = [(_candidate_source(str(item.get("part") or "")), item.get("released") is True) for item in found]
    return [
        Candidate(source=one, released=two, form="recorded", values={"text": str(item["text"])}, **row)
        for (one, two), row, item in zip(kinds, cells, found, strict=True)
    ]


def _candidate_source(part: str) -> Source:
    unstated = Source.read(f"{Kind.UNSTATED.text}{part}")
    return unstated if unstated.kind is Kind.UNSTATED else Source.read(part)


def _or_nan(value: object) -> float:
    found = number(value)
    return math.nan if found is None else found


def _outliers(residuals: pl.DataFrame) -> tuple[Outlier, ...]:
    factors = residuals[q.OUTLIER.head].to_list() if q.OUTLIER.head in residuals.columns else []
    known = [(key, number(factor) or 0.0) for key, factor in zip(keys_of(residuals), factors, strict=False)]
    return tuple(Outlier(test, factor, point) for (test, point), factor in known if factor > 1)
