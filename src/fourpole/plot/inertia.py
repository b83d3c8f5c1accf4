"""The mass of a specimen in figures: its modes, and what a reading that knows no mass would say of K*."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import with_std
from fourpole.core.specimen import Form
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series, look
from fourpole.plot.sheet import few, means, read_sheet, rigs_stated
from fourpole.plot.states import State, body_of, by_tyre, model_curve, part_of, stated_text, tested
from fourpole.study.study import Study

#: What is read as massless is not drawn where it is further from K* than this [1].
_FAR = 0.3
#: Line style of what is read as massless; preloads have those before it.
_DASH = 5
#: The curves of the modes go from this share of the lowest to this multiple of the highest of their frequencies.
_BELOW, _ABOVE = 0.8, 1.25
_POINTS, _MOST_TYRES, _MOST_COLUMNS = 500, 6, 2
#: The entry of the key.
MASSLESS_KEY = (look(Role.LINE, dash=_DASH), "read as massless")


def _stiffness(results: Study, state: State) -> tuple[FloatArray, ComplexArray]:
    """K* of the springs [N/m] at each tested frequency [Hz], as the mean of the tests in use."""
    sheet = read_sheet(results, texts_only=True)
    real, imag = sheet.values(q.STORAGE.head), sheet.values(q.LOSS.head)
    rows = state.rows & ~sheet.rejected & np.isfinite(real + imag) & (sheet.frequency >= 0)
    frequency, keys = sheet.values(q.FREQUENCY.head)[rows], sheet.frequency[rows].tolist()
    parts = [means(frequency, part[rows], keys) for part in (real, imag)]
    return parts[0][0], parts[0][1] + 1j * parts[1][1]


def massless_reading(results: Study, state: State, quantity: q.Quantity, like: Series) -> list[Series]:
    r"""What a reading that knows no mass would say of K* of a specimen that has one: :math:`F_1/(x_1 - x_2)`.

    On a rig of impedance :math:`Z_r` without an added mass, :math:`x_2/x_1 = -D_{21}/(D_{22} + j\omega Z_r)`. Where the
    far side is held, it is 0, and the reading is the stiffness at the driving point.
    """
    body, sheet = body_of(results, state), read_sheet(results, texts_only=True)
    rig = rigs_stated(results, sheet).get(sheet.rigs[int(np.flatnonzero(state.rows)[0])])
    frequency, stiffness = _stiffness(results, state)
    if body is None or rig is None or frequency.size < 2:
        return []
    specimen, curve = body.specimen(stiffness[stiffness.size // 2]), model_curve(results, state)
    if curve is not None:
        frequency, stiffness = curve.frequency, curve.stiffness
    omega = 2 * np.pi * frequency
    d = specimen.dynamic_stiffness(stiffness, omega)
    ratio = 0.0 if rig.blocked else -d[:, 1, 0] / (d[:, 1, 1] + 1j * omega * rig.impedance(omega))
    read = (d[:, 0, 0] + d[:, 0, 1] * ratio) / (1 - ratio)
    read[np.abs(read / stiffness - 1) > _FAR] = np.nan
    values = part_of(quantity, read)[0] / results.shown.of(quantity).scale
    return [replace(like, role=Role.LINE, x=frequency, y=values, dash=_DASH, label="")]


def modes(results: Study) -> FigureData | None:
    """The stiffness at the driving point and to the held far end, over and beyond the tested frequencies.

    Each specimen is shown at the middle one of its conditions; K* of its springs is that at the middle frequency.
    """
    sheet = read_sheet(results, texts_only=True)
    groups = by_tyre(state for state in tested(results, ~sheet.rejected) if body_of(results, state) is not None)
    if not groups:
        return None
    notes: list[str] = []
    panels, several = [], False
    for tyre in few(list(groups), _MOST_TYRES, "specimens", notes):
        own = groups[tyre]
        several |= len(own) > 1
        panels.append(_modes_panel(results, own[len(own) // 2], sheet.labels[tyre]))
    if several:
        notes.append("one of the tested conditions; the table of the report has all")
    key = [
        (look(Role.LINE, dash=0), "tested frequencies"), (look(Role.LINE, dash=1), "beyond them"),
        (look(hollow=True), "contact free, rim held"), (look(), "both held (± U, 95 %)"),
    ]  # fmt: skip
    return FigureData(
        tuple(panels), min(len(panels), _MOST_COLUMNS), sheet.labels, key=tuple(key), notes=tuple(notes),
        panel_height=2.6, shared=False,
    )  # fmt: skip


def _modes_panel(results: Study, state: State, title: str) -> Panel:
    body = body_of(results, state)
    assert body is not None
    tested_at, stiffness = _stiffness(results, state)
    middle = stiffness[stiffness.size // 2]
    marks = [body.pair(quantity) for quantity in (q.BELT_FREE, q.BELT_HELD)]
    x = np.linspace(_BELOW * tested_at[0], _ABOVE * max(tested_at[-1], marks[1][0]), _POINTS)
    x = np.union1d(x, [tested_at[0], tested_at[-1], *(value for value, _ in marks)])
    d = np.abs(body.specimen(middle).dynamic_stiffness(np.full(x.size, middle), 2 * np.pi * x))
    seen, series = results.shown.of(q.MODULUS), list[Series]()
    for place, name, (value, std), level in ((0, "driving point", marks[0], 1.0), (1, "transfer", marks[1], 0.4)):
        y = d[:, 0, place] / seen.scale
        like = look(Role.LINE, tyre=state.tyre, shade=level)
        for part, dash in ((x <= tested_at[0], 1), ((x >= tested_at[0]) & (x <= tested_at[-1]), 0)):
            series.append(replace(like, x=x[part], y=y[part], dash=dash))
        after = x >= tested_at[-1]
        series.append(replace(like, x=x[after], y=y[after], dash=1, label=name))
        at, high = np.array([value]), y[x == value]
        series.append(replace(like, role=Role.RANGE, x=at, y=high, across=np.array([COVERAGE_FACTOR * std])))
        said = " ± ".join(filter(None, with_std(value, COVERAGE_FACTOR * std))) + f" {q.BELT_FREE.unit}"
        series.append(replace(like, role=Role.POINTS, x=at, y=high, texts=(said,), hollow=place == 0))
    ordinate = AxisData("dynamic stiffness |k|", seen.shown, log=True)
    right = ", ".join(filter(None, ["a rod" if body.form is Form.ROD else "", stated_text(results, state.place)]))
    return Panel(AxisData.of(q.FREQUENCY), ordinate, tuple(series), title, right, state.tyre)


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"modes": modes}
