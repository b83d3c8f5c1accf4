"""The figure of the choice of a model: the candidates of each specimen by three criteria."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fourpole import quantities as q
from fourpole.fitting.modelfile import CandidateFile, ModelEntry
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series, look
from fourpole.plot.fitted import title_of
from fourpole.plot.names import plain_text
from fourpole.plot.sheet import leading, read_sheet
from fourpole.study.study import Study

#: Difference of BIC within which models are equally good, and difference up to which its axis is linear.
_ALIKE, _LINEAR = 6.0, 10.0
_MOST_CANDIDATES, _MOST_TYRES = 14, 8
#: Ratio of the ends of an axis beyond which it is logarithmic.
_DECADE = 10.0
#: A criterion that is ideally 1 is not shown below this; a model with as many parameters as data has none.
_FLOOR = 1e-3
_ROW, _MARGIN, _NAMES = 0.17, 0.2, 1.05
_CROSS_VALIDATION = 2


def choice(results: Study) -> FigureData | None:
    """Candidates by BIC, chi-square per degree of freedom and cross-validation error, a row of panels per specimen."""
    if results.models is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    entries = [one for one in results.models.models if len(one.candidates) > 1 and one.tyre in sheet.names]
    if not entries:
        return None
    notes: list[str] = []
    shown = leading(entries, _MOST_TYRES, "specimens", notes)
    most = max(len(one.candidates) for one in shown)
    if most > _MOST_CANDIDATES:
        notes.append(f"the best {_MOST_CANDIDATES} models shown")
    tried = [one for entry in shown for one in entry.candidates[:_MOST_CANDIDATES]]
    axes = (
        AxisData("BIC less the best", "1", linear=_LINEAR if _most_off(shown) > 5 * _LINEAR else 0.0),
        AxisData("chi-square / dof", "1", log=_steep([_chi2(one) for one in tried])),
        AxisData(q.CROSS_VALIDATION.name, "1", log=_steep([one.cross_validation for one in tried])),
    )
    panels: list[Panel] = []
    for entry in shown:
        tyre = sheet.names.index(entry.tyre)
        made = [_panel(entry, axis, criterion, tyre) for criterion, axis in enumerate(axes)]
        panels += [replace(made[0], title=title_of(results, sheet, tyre), tyre=tyre), *made[1:]]
    notes += ["dashed: BIC 6 above the best, up to which models are alike; chi-square/dof and error of 1",
              "cross-validation error: root mean square over the frequencies, in standard uncertainties"]  # fmt: skip
    if any(_chi2(one) < _FLOOR for one in tried):
        notes.append(f"values below {_FLOOR:g} stand there")
    if any(one.cross_validation is None for one in tried):
        notes.append("n: not tried, for the model is far from the best or too few frequencies are left")
    key = [(look(), "chosen"), (look(hollow=True), "others")]
    if not all(one.causal for one in tried):
        key.append((look(marker=2, hollow=True), "not causal"))
    return FigureData(
        tuple(panels), 3, sheet.labels, key=tuple(key), notes=tuple(notes), left=_NAMES, right=0.3, aligned=True,
        panel_height=_ROW * min(most, _MOST_CANDIDATES) + _MARGIN,
    )  # fmt: skip


def _most_off(entries: Sequence[ModelEntry]) -> float:
    """The largest difference of BIC that is shown."""
    return max(one.bic - min(each.bic for each in entry.candidates) for entry in entries
               for one in entry.candidates[:_MOST_CANDIDATES])  # fmt: skip


def _chi2(one: CandidateFile) -> float:
    return one.chi2 / max(one.dof, 1)


def _at_least(value: float | None) -> float | None:
    return None if value is None else max(value, _FLOOR)


def _steep(values: Sequence[float | None]) -> bool:
    """Whether some values and 1 span more than a decade."""
    known = [1.0, *(value for value in map(_at_least, values) if value is not None)]
    return max(known) > _DECADE * min(known)


def _panel(entry: ModelEntry, axis: AxisData, criterion: int, tyre: int) -> Panel:
    """The candidates of one specimen by one criterion, the best on top."""
    tried, least = entry.candidates[:_MOST_CANDIDATES], min(one.bic for one in entry.candidates)
    level = _ALIKE if criterion == 0 else 1.0
    high = np.array([-0.6, len(tried) - 0.4])
    series = [Series(Role.LINE, np.full(2, level), high, dash=1)]
    for row, one in enumerate(tried):
        value = (one.bic - least, _at_least(_chi2(one)), _at_least(one.cross_validation))[criterion]
        if value is not None:
            chosen = one.model == entry.model
            series.append(Series(Role.POINTS, np.array([value]), np.array([float(row)]), tyre=tyre if chosen else -1,
                                 marker=0 if one.causal else 2, hollow=not chosen))  # fmt: skip
    lacking = tuple("n" if one.cross_validation is None else "" for one in tried)
    return Panel(
        axis, AxisData("model", "1"), tuple(series), names=tuple(plain_text(one.model, 14) for one in tried),
        beside=lacking if criterion == _CROSS_VALIDATION else (),
    )  # fmt: skip


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"model-choice": choice}
