"""What the models leave of the tests: residuals of K' and K'' in standard uncertainties, as panels of a figure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.plot.cardids import dynamic_cards
from fourpole.plot.data import AxisData, Panel, Role, Series
from fourpole.plot.fitted import Drawn, curves_of
from fourpole.plot.names import plain_text
from fourpole.plot.sheet import Sheet, read_sheet, texts
from fourpole.quantities import Quantity
from fourpole.study.study import Study

#: Residuals of K' and K'', in this order.
RESIDUALS = tuple(Quantity("", "", f"residual {one.name}", "1") for one in (q.STORAGE, q.LOSS))
#: Bound that about 95 % of residuals lie within [standard uncertainties].
_USUAL = 2.0


def residual_points(results: Study, one: Drawn, which: Quantity, look: Series) -> Series:
    """The residuals of the tests of a condition, with the look of its series."""
    sheet = read_sheet(results, texts_only=True)
    frequency = sheet.values(q.FREQUENCY.head)
    rows = np.flatnonzero(one.rows)
    rows = rows[np.argsort(frequency[rows], kind="stable")]
    values = _residuals(results, one, sheet)[RESIDUALS.index(which)]
    known = np.isfinite(values)
    cards, names = dynamic_cards(results), texts(sheet.table, q.TEST.head)
    return Series(
        Role.POINTS, frequency[rows][known], values[known], tyre=look.tyre, shade=look.shade, marker=look.marker,
        level=look.level, tests=tuple(names[at] for at in rows[known]), cards=tuple(cards[at] for at in rows[known]),
    )  # fmt: skip


def residual_panel(which: Quantity, series: Sequence[Series], *, log: bool) -> Panel:
    """A panel of residuals with lines at zero and at the bounds that about 95 % lie within."""
    every = np.concatenate([one.x for one in series]) if series else np.array([1.0, 2.0])
    ends = np.array([every.min(), every.max()])
    lines = [
        Series(Role.LINE, ends, np.full(2, level), dash=0 if level == 0 else 1) for level in (0.0, -_USUAL, _USUAL)
    ]
    return Panel(AxisData.of(q.FREQUENCY, log=log), AxisData.of(which), (*lines, *series))


def residuals_said(results: Study, found: Sequence[Drawn]) -> list[str]:
    """How many residuals of some conditions are beyond the usual bounds."""
    sheet = read_sheet(results, texts_only=True)
    left = np.concatenate([np.zeros(0), *(np.concatenate(_residuals(results, one, sheet)) for one in found)])
    left = left[np.isfinite(left)]
    if not left.size:
        return []
    outside = int(np.sum(np.abs(left) > _USUAL))
    said = "residuals are in standard uncertainties of measurement and model together"
    return [f"{said}; {outside} of {left.size} are beyond ±{_USUAL:g}"]


def _residuals(results: Study, one: Drawn, sheet: Sheet) -> tuple[FloatArray, FloatArray]:
    key = ("residuals", one.entry.tyre, one.at, one.amplitude)
    if key not in results.derived:
        results.derived[key] = curves_of(one, sheet).residuals
    found: tuple[FloatArray, FloatArray] = results.derived[key]
    return found


def models_said(results: Study, sheet: Sheet, tyres: Sequence[int]) -> list[str]:
    """The models of some specimens, each with its model discrepancy."""
    entries = {one.tyre: one for one in (results.models.models if results.models is not None else ())}
    parts = {}
    for tyre in tyres:
        if (entry := entries.get(sheet.names[tyre])) is not None:
            more = f" (model discrepancy {100 * entry.discrepancy:.2g} %)" if entry.discrepancy > 0 else ""
            parts[tyre] = f"{plain_text(entry.model)}{more}"
    if len(set(parts.values())) == 1:
        return [f"model: {next(iter(parts.values()))}"]
    return ["models: " + ", ".join(f"{text} of {sheet.labels[tyre]}" for tyre, text in parts.items())]


def title_of(results: Study, sheet: Sheet, tyre: int) -> str:
    """The name of a specimen, or that of the model of a table without names."""
    if sheet.names[tyre] or results.models is None:
        return sheet.labels[tyre]
    return next((one.model for one in results.models.models if not one.tyre), sheet.labels[tyre])
