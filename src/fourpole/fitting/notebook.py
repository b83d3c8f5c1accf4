"""Fits and maps as HTML for a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import with_std
from fourpole.core.notebook import notebook_html
from fourpole.quantities import ShownUnits

if TYPE_CHECKING:
    from fourpole.fitting.modelling import TyreFit, TyreMap


def fit_html(found: TyreFit) -> str:
    """The choice, and the parameters of each condition with U."""
    units, covariances = ShownUnits(), [one.covariance for one in found.chosen.fits]
    shown = [(one.symbol, *units.unit(one.unit)) for one in found.model.parameters]
    rows = []
    for one, fit, covariance in zip(found.measured, found.chosen.fits, covariances, strict=True):
        std = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
        pairs = (
            with_std(float(value) / scale, COVERAGE_FACTOR * float(u) / scale)
            for value, u, (_, _, scale) in zip(fit.values, std, shown, strict=True)
        )
        rows.append([one.in_words(units) or "all", *(f"{text} ± {u}" if u else text for text, u in pairs)])
    heads = ["condition", *(f"{symbol} [{unit}]" if unit else symbol for symbol, unit, _ in shown)]
    name = found.model.name
    title = f"{name} for {found.tyre}" if found.tyre else name
    return notebook_html(title, [found.choice.text, "± is U (k = 2)"], heads, rows)


def map_html(found: TyreMap) -> str:
    """The choice, and the models that were tried."""
    rows = [
        (name, "none", "") if isinstance(one, str) else (name, str(len(one.terms)), f"{one.leave_one_out.error:.2%}")
        for name, one in found.others
    ]
    title = f"Map of {found.tyre}" if found.tyre else "Map"
    return notebook_html(title, [found.text], ("model", "terms", "leave-one-out error"), rows)
