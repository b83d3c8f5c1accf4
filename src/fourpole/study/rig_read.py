"""The rig as found, from the tables and the record of a results folder."""

from __future__ import annotations

import math
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.core.joint.misfit import Candidate
from fourpole.core.sources import Kind, Role, Source
from fourpole.fitting.rows import keys_of
from fourpole.study.record import section
from fourpole.study.rig_estimate import (
    CELLS,
    NoteCode,
    Outlier,
    RigEstimate,
    RigFinding,
    RunOrder,
    SharedValue,
    Unseen,
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
    names = [str(name or "") for name in rig[q.RIG.head].to_list()] if q.RIG.head in rig.columns else []
    names += [name for name, record in section(joint).items() if isinstance(record, dict)]
    return tuple(
        _read(name, _of(rig, name), _of(residuals, name), section(joint, name)) for name in dict.fromkeys(names)
    )


def _read(name: str, rig: pl.DataFrame, residuals: pl.DataFrame, record: dict[str, Any]) -> RigEstimate:
    values = _values(rig)
    masses = residuals[q.ADDED_MASS.head].to_list() if q.ADDED_MASS.head in residuals.columns else []
    factors = residuals[q.OUTLIER.head].to_list() if q.OUTLIER.head in residuals.columns else []
    outliers = [(key, number(factor) or 0.0) for key, factor in zip(keys_of(residuals), factors, strict=False)]
    calibrated = all(value.finding is not RigFinding.NOT_CALIBRATED for value in values)
    return RigEstimate(
        name,
        values,
        fits=record.get("fits") is not False and calibrated,
        outliers=tuple(Outlier(test, factor, point) for (test, point), factor in outliers if factor > 1),
        massed=any((number(mass) or 0.0) > 0 for mass in masses)
        or any(value.source.role is Role.MASS for value in values),
        **_recorded(record),
    )


def _recorded(record: dict[str, Any]) -> dict[str, Any]:
    """The fields that study.json alone has."""
    candidates = _list(record.get("candidates"))
    numbers = {
        name: number(record.get(name)) for name in ("chi2", "dof", "rig_error", "inflation", "scatter", "unsteady")
    }
    return {
        **{name: value for name, value in numbers.items() if value is not None},
        **{name: int(number(record.get(name)) or 0) for name in ("steps", "tests", "conditions", "shared", "tied")},
        **{name: str(record.get(name) or "") for name in ("reason", "rests")},
        "converged": record.get("converged") is not False,
        "candidates": tuple(_candidate(cells) for cells in candidates if section(cells).get("text")),
        "unseen": tuple(_unseen(cells) for cells in _list(record.get("unseen")) if section(cells).get("component")),
        "order": next((order for order in RunOrder if order == record.get("order")), RunOrder.ROWS),
        "unshared_masses": NoteCode.UNSHARED_MASSES in _list(record.get("note_codes")),
        "mass_gain": mass_gain(*(section(record, "gain_of_masses", side) for side in ("without", "with"))),
    }


def _of(table: pl.DataFrame, rig: str) -> pl.DataFrame:
    """The rows of one rig."""
    if q.RIG.head not in table.columns:
        return pl.DataFrame()
    return table.filter(pl.col(q.RIG.head).fill_null("") == rig)


def _list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _values(rows: pl.DataFrame) -> tuple[SharedValue, ...]:
    sources = [Source.read(str(text or "")) for text in rows[q.VALUE.head]] if q.VALUE.head in rows.columns else []
    return tuple(
        SharedValue(
            source,
            str(row.get(q.UNIT.head) or ""),
            **{name: number(row.get(head)) for name, head in CELLS.items()},
            finding=next((code for code in RigFinding if code == row.get(q.FINDING.head)), RigFinding.UNKNOWN),
            hides=hidden_in(source, set(sources)),
        )
        for source, row in zip(sources, rows.rows(named=True), strict=True)
    )


def _unseen(cells: dict[str, Any]) -> Unseen:
    texts = [str(cells.get(name) or "") for name in ("unit", "result", "words", "key")]
    size, shift = (number(cells.get(name)) or 0.0 for name in ("size", "shift"))
    never = cells.get("never") is True
    return Unseen(Source.read(str(cells["component"])), texts[0], size, texts[1], shift, texts[2], texts[3], never)


def _candidate(cells: dict[str, Any]) -> Candidate:
    part = str(cells.get("part") or "")
    unstated, plain = Source.read(f"{Kind.UNSTATED.text}{part}"), Source.read(part)
    numbers = {name: number(cells.get(name)) for name in ("value", "std", "explains", "size")}
    known: dict[str, Any] = {name: math.nan if value is None else value for name, value in numbers.items()}
    return Candidate(
        str(cells.get("name") or ""),
        unit=str(cells.get("unit") or ""),
        source=unstated if unstated.kind is Kind.UNSTATED else plain,
        released=cells.get("released") is True,
        form="recorded",
        values={"text": str(cells["text"])},
        **known,
    )
