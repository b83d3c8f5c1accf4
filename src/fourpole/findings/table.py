"""findings.csv: a row per finding, values in SI."""

from __future__ import annotations

from collections.abc import Sequence

import polars as pl

from fourpole.findings.finding import Finding, FindingConditions

#: Heads of findings.csv, each with its meaning.
FINDING_COLUMNS = {
    "kind": "level, comparison, trend with an axis, resonance, claim with its number, or another kind of finding",
    "quantity": "name of the quantity; blank where the finding is about tests",
    "specimens": "names of the specimens",
    "condition": "lowest to highest pressure, load and frequency, the rig, and the added mass",
    "effect": "size of the effect",
    "u(effect)": "its standard uncertainty; of a mean over conditions, that of one condition; blank where it has none",
    "unit": "unit of the effect, 1 for a relative one",
    "holds": "the outcome",
    "tests": "names of the tests that the finding uses",
}
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
        (
            each.kind,
            each.quantity.column if each.quantity else "",
            "; ".join(each.specimens),
            _condition(each.conditions),
            each.effect,
            each.std,
            each.unit,
            str(each.holds),
            "; ".join(each.tests),
        )
        for each in found
    ]
    numbers = ("effect", "u(effect)")
    schema = {name: pl.Float64 if name in numbers else pl.String for name in FINDING_COLUMNS}
    return pl.DataFrame(rows, schema=schema, orient="row")


def _condition(about: FindingConditions) -> str:
    """Lowest to highest setting of each axis in SI, and the set-up."""
    parts = []
    for axis in about.axes:
        if values := about.values(axis):
            span = f"{values[0]:.6g}" if len(values) == 1 else f"{values[0]:.6g} to {values[-1]:.6g}"
            parts.append(f"{axis} {span} {_UNITS[axis]}")
    if about.setup.rig:
        parts.append(f"rig {about.setup.rig}")
    if about.setup.added_mass:
        parts.append(f"added mass {about.setup.added_mass:.6g} kg")
    return "; ".join(parts)
