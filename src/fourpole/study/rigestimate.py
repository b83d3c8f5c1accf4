"""The rig as found: fit, scatter, candidates and notes of the joint route, as typed values read from the results."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fourpole import quantities as q
from fourpole.study.results import Results

__all__ = ["Candidate", "Note", "Outlier", "RigEstimate", "rig_estimates"]


@dataclass(frozen=True)
class Note:
    """A note of the analysis: its code, empty where an older version wrote none, and its text."""

    code: str
    text: str


@dataclass(frozen=True)
class Candidate:
    """An unstated part that would lower the misfit; `explains` is by how much chi-square would fall."""

    text: str
    value: float | None = None
    std: float | None = None
    explains: float | None = None


@dataclass(frozen=True)
class Outlier:
    """A test that does not go with the others; its variance was enlarged by `factor`."""

    test: str
    factor: float


@dataclass(frozen=True)
class RigEstimate:
    """What is known of the fit of one rig after the joint route; what an analysis did not record has its default.

    Attributes
    ----------
    rig : str
        Empty where the campaign has one rig without a name.
    fits, converged : bool
    reason : str
        Why the search ended.
    tests, conditions, shared : int
    chi2, dof : float or None
    rig_error, scatter : float [1]
        Error added to the rig's impedance, relative to its largest part; scatter of K* beyond the noise.
    inflation : float [1]
        Factor by which the noise was enlarged.
    candidates : tuple of Candidate
        The best first.
    notes : tuple of Note
    outliers : tuple of Outlier
        In the order of residuals.csv.
    mass_gain : mapping of str to (float, float)
        Median relative uncertainty of each quantity without and with the weighed mass.
    """

    rig: str
    fits: bool = True
    converged: bool = True
    reason: str = ""
    tests: int = 0
    conditions: int = 0
    shared: int = 0
    chi2: float | None = None
    dof: float | None = None
    rig_error: float = 0.0
    scatter: float = 0.0
    inflation: float = 1.0
    candidates: tuple[Candidate, ...] = ()
    notes: tuple[Note, ...] = ()
    outliers: tuple[Outlier, ...] = ()
    mass_gain: Mapping[str, tuple[float, float]] | None = None

    @property
    def chi2_per_dof(self) -> float | None:
        """Chi-square per degree of freedom; None where nothing is left over."""
        return self.chi2 / self.dof if self.chi2 is not None and self.dof else None


def rig_estimates(results: Results) -> list[RigEstimate]:
    """The estimate of each rig, in the order of rig.csv; none where another route was used.

    Parameters
    ----------
    results : Results
        Of a study, or read from a folder; what is not as an analysis writes it counts as not there.
    """
    joint = _mapping(results.record.get("joint"))
    names = [str(name or "") for name in results.rig[q.RIG.head].to_list()] if q.RIG.head in results.rig.columns else []
    names += [str(name) for name, record in joint.items() if isinstance(record, dict)]
    return [_estimate(results, name, _mapping(joint.get(name))) for name in dict.fromkeys(names)]


def _estimate(results: Results, rig: str, record: Mapping[str, Any]) -> RigEstimate:
    uncalibrated = _rows(results.rig, rig, q.FINDING.head)
    return RigEstimate(
        rig,
        fits=record.get("fits") is not False and "not calibrated" not in uncalibrated,
        converged=record.get("converged") is not False,
        reason=str(record.get("reason") or ""),
        **{name: int(_number(record.get(name)) or 0) for name in ("tests", "conditions", "shared")},
        chi2=_number(record.get("chi2")),
        dof=_number(record.get("dof")),
        rig_error=_number(record.get("rig_error")) or 0.0,
        scatter=_number(record.get("scatter")) or 0.0,
        inflation=_number(record.get("inflation")) or 1.0,
        candidates=tuple(_candidates(record.get("candidates"))),
        notes=tuple(_notes(record)),
        outliers=_outliers(results, rig),
        mass_gain=_mass_gain(_mapping(record.get("gain_of_masses"))),
    )


def _mapping(value: object) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def _rows(table: Any, rig: str, column: str) -> list[Any]:
    if column not in table.columns:
        return []
    return [value for name, value in table.select(q.RIG.head, column).iter_rows() if (name or "") == rig]


def _candidates(listed: object) -> list[Candidate]:
    numbers = ("value", "std", "explains")
    found = [item for item in _list(listed) if isinstance(item, dict) and item.get("text")]
    return [Candidate(str(item["text"]), *(_number(item.get(name)) for name in numbers)) for item in found]


def _notes(record: Mapping[str, Any]) -> list[Note]:
    texts, codes = ([str(item) for item in _list(record.get(name))] for name in ("notes", "note_codes"))
    codes += [""] * (len(texts) - len(codes))
    return [Note(code, text) for code, text in zip(codes, texts, strict=False) if text]


def _outliers(results: Results, rig: str) -> tuple[Outlier, ...]:
    names, factors = (_rows(results.residuals, rig, head) for head in (q.TEST.head, q.OUTLIER.head))
    known = [(str(name), _number(factor) or 0.0) for name, factor in zip(names, factors, strict=False)]
    return tuple(Outlier(name, factor) for name, factor in known if factor > 1)


def _mass_gain(record: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    after = _mapping(record.get("with"))
    pairs = {str(name): (_number(x), _number(after.get(name))) for name, x in _mapping(record.get("without")).items()}
    return {name: (a, b) for name, (a, b) in pairs.items() if a is not None and b is not None and a > 0 and b > 0}
