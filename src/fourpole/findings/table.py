"""findings.csv: a row per finding, values in SI."""

from __future__ import annotations

from collections.abc import Sequence

import polars as pl

from fourpole.findings.claims import Claim
from fourpole.findings.finding import Conditions, Finding
from fourpole.findings.trends import Trend

__all__ = ["FINDING_COLUMNS", "findings_table"]

FINDING_COLUMNS = ("kind", "quantity", "specimens", "condition", "effect", "u(effect)", "unit", "holds", "tests")
_UNITS = {"pressure": "Pa", "load": "N", "frequency": "Hz"}


def findings_table(found: Sequence[Finding]) -> pl.DataFrame:
    """Findings as the rows of findings.csv.

    Parameters
    ----------
    found : sequence of Finding

    Returns
    -------
    polars.DataFrame
        `effect` and `u(effect)` are in `unit`, not-a-number is blank; several specimens, settings or tests are
        separated by "; ".
    """
    rows = [
        {
            "kind": _kind(each),
            "quantity": each.quantity.column if each.quantity else "",
            "specimens": "; ".join(each.specimens),
            "condition": _condition(each.conditions),
            "effect": each.effect,
            "u(effect)": each.std,
            "unit": each.unit,
            "holds": str(each.holds),
            "tests": "; ".join(each.tests),
        }
        for each in found
    ]
    numbers = ("effect", "u(effect)")
    schema = {name: pl.Float64 if name in numbers else pl.String for name in FINDING_COLUMNS}
    return pl.DataFrame(rows, schema=schema)


def _kind(finding: Finding) -> str:
    """The kind, with the number of a claim and the axis of a trend."""
    if isinstance(finding.detail, Claim):
        return f"{finding.kind} {finding.detail.number}"
    return f"{finding.kind} with {finding.detail.axis}" if isinstance(finding.detail, Trend) else finding.kind


def _condition(about: Conditions) -> str:
    """Lowest to highest setting of each axis in SI, and the set-up."""
    parts = []
    for axis in about.axes:
        values = about.values(axis)
        if values:
            span = f"{values[0]:.6g}" if len(values) == 1 else f"{values[0]:.6g} to {values[-1]:.6g}"
            parts.append(f"{axis} {span} {_UNITS[axis]}")
    if about.setup.rig:
        parts.append(f"rig {about.setup.rig}")
    if about.setup.added_mass:
        parts.append(f"added mass {about.setup.added_mass:.6g} kg")
    return "; ".join(parts)
