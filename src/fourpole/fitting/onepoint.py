"""The fit at one condition as a map of one point, so that fits and maps answer alike."""

from __future__ import annotations

import numpy as np

from fourpole.fitting.modelfile import ConditionFile, ModelEntry, model_of
from fourpole.models.linearised import Scatter
from fourpole.models.operating import Offsets, OperatingMap
from fourpole.models.surface import Axes
from fourpole.models.together import LeaveOneOut


def map_of_condition(entry: ModelEntry, one: ConditionFile) -> OperatingMap:
    """The parameters of a condition as a map of one point with its band and covariance."""
    model = model_of(entry)
    linked = model.link(np.array(one.values))
    _, slopes = model.unlink(linked)
    scale = np.divide(1.0, slopes, out=np.zeros_like(slopes), where=np.abs(slopes) > 1e-100)
    covariance = np.array(one.covariance) * np.outer(scale, scale)
    return OperatingMap(
        model=model,
        axes=Axes((), np.zeros((1, 0)), dict(one.coordinates)),
        terms=((),),
        coefficients=linked[:, None],
        covariance=covariance,
        scatter=Scatter(frequency=(entry.discrepancy, entry.discrepancy)),
        band=one.band,
        leave_one_out=LeaveOneOut(),
        offsets=Offsets(np.zeros((1, 2)), np.pad(covariance, (0, 2))[None]),
    )
