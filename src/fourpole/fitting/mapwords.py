"""The choice of an operating map: its mean uncertainty, and the map in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fourpole.fitting.modelparts import split_column
from fourpole.models.operating import OperatingMap


def mean_uncertainty(found: OperatingMap) -> float:
    """Mean relative uncertainty of K* over the conditions, at the middle of the band."""
    points = found.axes.points if found.axes.names else np.zeros((1, 0))
    answer = found.ask(points, np.full(len(points), float(np.sqrt(found.band[0] * found.band[1]))))
    variance = answer.covariance[:, 0, 0] + answer.covariance[:, 1, 1]
    return float(np.mean(np.sqrt(variance) / np.abs(answer.stiffness)))


def map_text(best: OperatingMap, good: Sequence[OperatingMap]) -> str:
    """The model of a map, its leave-one-out error, and what to take for a simulation in time."""
    over = ", ".join(split_column(name)[0] for name in best.axes.names) or "one condition"
    many = f"{len(best.terms)} terms" if len(best.terms) > 1 else "one value"
    parts = [f"{best.model.name} over {over}, {many} for each parameter"]
    errors = best.leave_one_out
    if np.isfinite(errors.error):
        inside = f"{100 * errors.inside:.0f} % of K' and K'' inside their 95 % intervals"
        parts.append(f"leave-one-out error {100 * errors.error:.2g} %, {inside}")
    elif len(best.axes.points) > 1:
        parts.append("linear between the conditions, which are too few for a leave-one-out error or a scatter")
    for axis in best.axes.straight:
        name = split_column(best.axes.names[axis])[0]
        parts.append(f"the uncertainty between the two tested values of {name} includes a bend")
    text = "; ".join(parts)
    if best.model.causal:
        return text
    text += ". It is not causal" if best.model.by_amplitude else ". It describes K2 and C and is not causal"
    causal = [one for one in good if one.model.causal]
    if causal:
        first = min(causal, key=lambda one: one.leave_one_out.error)
        error = first.leave_one_out.error
        text += f": for a simulation in time take {first.model.name}"
        text += f" ({100 * error:.2g} %)" if np.isfinite(error) else ""
    return text
