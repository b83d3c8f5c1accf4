"""Figures of the rig as found, of its uncertainty budget, and the gain of an added mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray, IntArray
from fourpole.core.condition import FREQUENCY, Axis
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.sources import Kind, Source
from fourpole.core.sources import Role as Part
from fourpole.fitting.rows import KEY, keyed, keys_of
from fourpole.plot.cards import dynamic_cards, zero_line
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series, Tone, lacking, look, plain_text, value_label
from fourpole.plot.sheet import Sheet, floats, grouped, leading, means, phasors, read_sheet, rigs_stated, texts
from fourpole.quantities import Quantity, ShownUnits
from fourpole.study.rig_estimate import RigEstimate, RigFinding, SharedValue
from fourpole.study.study import Study

_MOST_RIGS = 4
#: Rule of equal added masses; equal masses have one marker.
_MASS = Axis("added mass", relative=1e-3)
#: Look of each finding, and its label in the key.
_FINDINGS: dict[RigFinding, tuple[Series, str]] = {
    RigFinding.FOUND: (look(tone=Tone.SURE), "found"),
    RigFinding.NOT_DETERMINED: (look(hollow=True), "not determined: as stated"),
    RigFinding.CONTRADICTED: (look(tone=Tone.ALARM, marker=3), "contradicts the statement"),
    RigFinding.NOT_CALIBRATED: (look(tone=Tone.DOUBT, marker=1, hollow=True), "not calibrated: the rig does not fit"),
    RigFinding.UNSTATED: (look(tone=Tone.ALARM, marker=3, hollow=True), "not stated: size as written"),
}
_GROUPS = {
    Part.RIG: "rig",
    Part.CHANNEL: "channels",
    Part.RATIO: "ratios that K* needs",
    Part.MASS: "added masses",
    Part.SPECIMEN: "specimens",
}
#: Errors that are shares of a whole, shown in per cent.
_SHARES = (Kind.DRIFT, Kind.BLOCK, Kind.GAIN_DRIFT, Kind.GAIN_STEP, Kind.SLOPE, Kind.CROSSTALK)
#: A value farther than this from its statement [stated standard uncertainties] is shown at the edge with its distance.
_EDGE = 6.0
#: Height of a row [in], and room for the names on the left [in].
_ROW, _NAMES = 0.17, 1.75


@dataclass(frozen=True, eq=False)
class _Tests(ByValue):
    """The rows of residuals.csv, with the groups of rig, tyre and added mass of each row, and its card."""

    rigs: tuple[str, ...]
    rig: np.ndarray
    tyre: np.ndarray
    mass: np.ndarray
    masses: tuple[float, ...]
    frequency: FloatArray
    parts: tuple[FloatArray, FloatArray]
    stds: tuple[FloatArray, FloatArray]
    outlier: BoolArray
    as_stated: tuple[FloatArray, FloatArray]
    tests: tuple[str, ...]
    cards: tuple[str, ...]


def residual(results: Study) -> FigureData | None:
    """Real and imaginary part of F1/V2 - Zr against frequency, a row per rig, a marker per added mass."""
    if q.RESIDUAL_RE.head not in results.residuals.columns:
        return None
    sheet = read_sheet(results, texts_only=True)
    tests = _tests(results, sheet)
    known = np.isfinite(tests.parts[0]) & np.isfinite(tests.frequency)
    if not known.any():
        return None
    rigs = [at for at in range(len(tests.rigs)) if np.any(known & (tests.rig == at))]
    notes: list[str] = []
    shown, panels = leading(rigs, _MOST_RIGS, "rigs are", notes), []
    for at in shown:
        estimate, here = results.rig_named(tests.rigs[at]), known & (tests.rig == at)
        name = f"rig {plain_text(tests.rigs[at])}" if tests.rigs[at] else ""
        for column, quantity in enumerate((q.RESIDUAL_RE, q.RESIDUAL_IM)):
            series = _residuals(tests, column, here, results.shown.of(quantity), fits=estimate.fits)
            axis = AxisData(f"{('Re', 'Im')[column]} (F1/V2 − Zr)", results.shown.of(quantity).shown, signed=True)
            panels.append(Panel(AxisData.of(q.FREQUENCY), axis, series, name if column == 0 else ""))
        notes += _fit_said(estimate)
    here = known & np.isin(tests.rig, shown)
    if np.any(here & tests.outlier):
        notes.append("an outlier is a test that does not go with the others")
    notes += lacking(int(np.sum(~known)), "F1 or no V2")
    key = [(look(marker=int(mass), hollow=bool(mass)), f"{results.shown.text(q.ADDED_MASS, tests.masses[mass])} added")
           for mass in np.unique(tests.mass[here])]  # fmt: skip
    if not all(results.rig_named(tests.rigs[at]).fits for at in shown):
        key.append((look(Role.LINE, tone=Tone.ALARM), "mean with rig and sensors as stated"))
    return FigureData(
        tuple(panels), 2, sheet.labels, keyed=tuple(int(at) for at in np.unique(tests.tyre[here]) if at >= 0),
        key=tuple(key), lost="outlier", notes=tuple(notes), panel_height=2.6 if len(shown) == 1 else 1.9, shared=False,
    )  # fmt: skip


def _fit_said(rig: RigEstimate) -> list[str]:
    """Whether a rig fits as stated."""
    which = f" of {plain_text(rig.rig)}" if rig.rig else ""
    said = []
    if rig.chi2_per_dof is not None:
        said.append(f"as stated{which}: χ²/dof = {rig.chi2_per_dof:.3g} ({rig.chi2:.4g} / {rig.dof:.4g})")
    if not rig.fits:
        said.append(f"the rig{which} as stated does not fit: its line should be at zero")
    return said


def _tests(results: Study, sheet: Sheet) -> _Tests:
    """The rows of residuals.csv as arrays."""
    rows, names = results.residuals, texts(results.residuals, "rig")
    rigs, keys = tuple(dict.fromkeys(names)), keys_of(rows)
    place = {key: row for row, key in enumerate(keys_of(sheet.table))}
    # A row whose test is not among the dynamic ones takes what is appended to their arrays.
    at, cards = np.array([place.get(key, len(place)) for key in keys], dtype=np.int64), [*dynamic_cards(results), ""]
    stated = np.append(_as_stated(results, sheet), np.nan)[at]
    masses, mass = grouped(np.nan_to_num(floats(rows, q.ADDED_MASS.head)), _MASS, lambda value, n: f"{value:.{n}g}")
    return _Tests(
        rigs=rigs,
        rig=np.array([rigs.index(name) for name in names], dtype=np.int64),
        tyre=np.append(sheet.tyre, -1)[at],
        mass=mass,
        masses=masses.values,
        frequency=floats(rows, q.FREQUENCY.head),
        parts=(floats(rows, q.RESIDUAL_RE.head), floats(rows, q.RESIDUAL_IM.head)),
        stds=(floats(rows, q.RESIDUAL_RE.u_head), floats(rows, q.RESIDUAL_IM.u_head)),
        outlier=floats(rows, q.OUTLIER.head) > 1,
        as_stated=(stated.real, stated.imag),
        tests=tuple(key[0] for key in keys),
        cards=tuple(cards[row] for row in at),
    )


def _as_stated(results: Study, sheet: Sheet) -> ComplexArray:
    """F1/V2 - Zr [N s/m] of each dynamic test with rig and sensors as stated; not-a-number if not stated."""
    omega = 2 * np.pi * sheet.values(q.FREQUENCY.head)
    names = np.array(sheet.rigs, dtype=object)
    residuals = np.full(omega.size, np.nan, dtype=complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        for name, rig in rigs_stated(results, sheet).items():
            if rig is not None and not rig.blocked:
                at = np.flatnonzero(names == name)
                f1, _, v2 = phasors(sheet, rig, at)
                residuals[at] = f1 / v2 - rig.impedance(omega[at], sheet.added[at])
    return residuals


def _residuals(tests: _Tests, column: int, here: BoolArray, shown: Quantity, *, fits: bool) -> tuple[Series, ...]:
    """The real part, column 0, or the imaginary part, column 1, of the residuals of one rig."""
    x, y, std = tests.frequency, tests.parts[column] / shown.scale, tests.stds[column] / shown.scale
    good, series = here & ~tests.outlier, [zero_line(x[here])]
    for tyre in np.unique(tests.tyre[here]):
        for mass in np.unique(tests.mass[here & (tests.tyre == tyre)]):
            alike = (tests.tyre == tyre) & (tests.mass == mass)
            for role, mask in ((Role.POINTS, good & alike), (Role.REJECTED, here & tests.outlier & alike)):
                at = np.flatnonzero(mask)
                if not at.size:
                    continue
                one = Series(role, x[at], y[at], std[at], tyre=int(tyre), marker=int(mass), hollow=bool(mass))
                linked = all(tests.cards[i] for i in at)
                names, cards = (tuple(each[i] for i in at) if linked else () for each in (tests.tests, tests.cards))
                series.append(replace(one, tests=names, cards=cards))
    if not fits:
        stated = tests.as_stated[column] / shown.scale
        line = (stated if np.any(np.isfinite(stated)) else y)[good]
        _, groups = grouped(x[good], FREQUENCY, lambda value, n: f"{value:.{n}g}")
        series.append(Series(Role.LINE, *means(x[good], line, groups.tolist()), tone=Tone.ALARM))
    return tuple(series)


def found(results: Study) -> FigureData | None:
    """Each shared value as stated and as found, in its stated U; a panel per rig."""
    rigs = [rig for rig in results.rigs if rig.values]
    if not rigs:
        return None
    notes: list[str] = []
    shown = leading(rigs, _MOST_RIGS, "rigs are", notes)
    panels = [_found_panel(rig, results.shown) for rig in shown]
    present = {value.finding for rig in shown for value in rig.values}
    key = [(replace(one, role=Role.POINTS), text) for finding, (one, text) in _FINDINGS.items() if finding in present]
    notes += ["dashed: the stated value ± its U", "on the right: U found over U stated"]
    most = max(len(panel.names) for panel in panels)
    return FigureData(
        tuple(panels), 1, key=tuple(key), notes=tuple(notes), panel_height=_ROW * (most + 1), left=_NAMES, right=0.5,
        shared=False,
    )  # fmt: skip


def _by_group(values: Sequence[SharedValue]) -> dict[Part, list[SharedValue]]:
    """The values by group; an unstated part, or a value of an unknown kind, stands with the rig's values."""
    groups: dict[Part, list[SharedValue]] = {role: [] for role in _GROUPS}
    for value in values:
        groups[value.source.role if value.source.role in groups else Part.RIG].append(value)
    return {role: members for role, members in groups.items() if members}


def _found_panel(rig: RigEstimate, units: ShownUnits) -> Panel:
    """Points and their uncertainties from the top down under the names of their groups."""
    names: list[str] = []
    beside: list[str] = []
    heads: list[int] = []
    series: list[Series] = []
    for group, values in _by_group(rig.values).items():
        heads.append(len(names))
        names.append(_GROUPS[group])
        beside.append("")
        for value in values:
            series += _dot(len(names), value, units)
            names.append(value_label(value.source))
            beside.append("" if value.ratio is None or not np.isfinite(value.ratio) else f"{value.ratio:.2g}")
    high = np.array([-0.6, len(names) - 0.4])
    lines = [Series(Role.LINE, np.full(2, level), high, dash=0 if level == 0 else 1) for level in (0.0, -1.0, 1.0)]
    return Panel(
        AxisData("found less stated, in stated U", "1"), AxisData("value", "1"), (*lines, *series),
        f"rig {plain_text(rig.rig)}" if rig.rig else "", names=tuple(names), heads=tuple(heads), beside=tuple(beside),
    )  # fmt: skip


def _dot(row: int, shared: SharedValue, units: ShownUnits) -> list[Series]:
    """One value; empty where nothing is known that it could be drawn by."""
    numbers = (shared.stated, shared.found, shared.stated_std, shared.found_std)
    stated, value, prior, std = (np.nan if x is None else x for x in numbers)
    kind, at = _FINDINGS.get(shared.finding, _FINDINGS[RigFinding.NOT_DETERMINED])[0], np.array([float(row)])
    if shared.finding is RigFinding.UNSTATED and np.isfinite(value):
        return [replace(kind, x=np.zeros(1), y=at, texts=(_size(shared, value, std, units),))]
    off, wide = ((value - stated) / (COVERAGE_FACTOR * prior), std / prior) if prior > 0 else (np.nan, np.nan)
    if not np.isfinite(off):
        return []
    if abs(off) > _EDGE:
        text = f"{off:+.0f}".replace("-", "−")
        return [replace(kind, x=np.array([np.copysign(_EDGE, off)]), y=at, marker=7 if off > 0 else 6, texts=(text,))]
    one = replace(kind, x=np.array([off]), y=at)
    return [one, replace(one, role=Role.RANGE, across=np.array([min(wide, _EDGE)]))] if np.isfinite(wide) else [one]


def _size(shared: SharedValue, value: float, std: float, units: ShownUnits) -> str:
    """A value without a statement, with its U and unit."""
    unit, scale = ("%", 0.01) if shared.source.kind in _SHARES else units.unit(shared.unit)
    return f"{value / scale:+.3g} ± {COVERAGE_FACTOR * std / scale:.2g} {unit}".rstrip().replace("-", "−")


def mass_gain(results: Study) -> FigureData | None:
    """Median relative uncertainty of K2 and C without and with the added mass, a panel per rig."""
    rigs = [one for one in results.rigs if one.mass_gain]
    if not rigs:
        return None
    notes: list[str] = []
    panels = [_gain_panel(rig) for rig in leading(rigs, _MOST_RIGS, "rigs are", notes)]
    key = ((look(), "without the weighed mass"), (look(tone=Tone.SURE), "with it"))
    most = max(len(panel.names) for panel in panels)
    return FigureData(
        tuple(panels), min(2, len(panels)), key=key, panel_height=0.2 + 0.36 * most, shared=False, left=1.0,
        notes=(*notes, "of the tests without the mass, from these alone and from all tests"),
    )  # fmt: skip


def _gain_panel(rig: RigEstimate) -> Panel:
    """Two points per quantity, with their values."""
    series = []
    for at, stds in enumerate(rig.mass_gain.values()):
        without, within = (COVERAGE_FACTOR * std for std in stds)
        less = f", {float(f'{without / within:.2g}'):g} times smaller" if 0 < within < without else ""
        for place, share, tone, more in ((at - 0.16, without, Tone.NONE, ""), (at + 0.16, within, Tone.SURE, less)):
            text = f"{100 * share:#.2g}".rstrip(".") + " %" if share < 0.1 else f"{100 * share:.0f} %"
            series.append(Series(Role.POINTS, np.array([100 * share]), np.array([place]), tone=tone,
                                 texts=(text + more,)))  # fmt: skip
    return Panel(
        AxisData("median U (k = 2)", "%", log=True), AxisData("quantity", "1"), tuple(series),
        f"rig {plain_text(rig.rig)}" if rig.rig else "", names=tuple(plain_text(name, 14) for name in rig.mass_gain),
    )  # fmt: skip


_QUANTITIES = {one.column: one.name for one in (q.K2, q.C, q.STORAGE, q.LOSS)}
_MOST_TYRES, _MOST_SOURCES = 4, 8
#: Sources with a smaller share in the median of the tests of every specimen are joined [1].
_LEAST = 0.01
#: Least share that the logarithmic axis shows [%].
_FLOOR = 0.1
#: Height of a row, and distance of the specimens in it as a share of the row.
_BUDGET_ROW, _APART = 0.17, 0.17


def budget(results: Study) -> FigureData | None:
    """Shares of the variance of K2, C, K' and K'' by source, a panel per quantity: median and range of each specimen.

    Sources below 1 % of the variance are joined.
    """
    if q.SHARE.head not in results.budget.columns or "test" not in results.dynamic.columns:
        return None
    sheet = read_sheet(results, texts_only=True)
    rows = _rows(results.budget, sheet)
    if rows.is_empty():
        return None
    there = set(rows["quantity"].to_list())
    tyres = sorted(rows["tyre"].unique().to_list())
    notes = ["points: median over the tests, lines: their range; sources below 1 % are joined as others"]
    if len(tyres) > _MOST_TYRES:
        notes.append(f"tests of all {len(tyres)} specimens together")
    panels = [
        _panel(name, rows.filter(pl.col("quantity") == column), tyres)
        for column, name in _QUANTITIES.items()
        if column in there
    ]
    keyed_tyres = tuple(tyres) if 1 < len(tyres) <= _MOST_TYRES else ()
    most = max(len(panel.names) for panel in panels)
    return FigureData(
        tuple(panels), min(2, len(panels)), sheet.labels, keyed=keyed_tyres, notes=tuple(notes), shared=False,
        panel_height=_BUDGET_ROW * (most + 1), left=1.75,
    )  # fmt: skip


def _rows(table: pl.DataFrame, sheet: Sheet) -> pl.DataFrame:
    """Rows of budget.csv with the tyre and the frequency group of their test; without rejected tests."""
    groups = pl.DataFrame({"tyre": sheet.tyre, "frequency": sheet.frequency, "rejected": sheet.rejected})
    hertz = pl.Series("hertz", sheet.values(q.FREQUENCY.head))
    tests = keyed(sheet.table).select(KEY).hstack([*groups, hertz]).unique(KEY, maintain_order=True)
    kept = tests.filter(~pl.col("rejected") & (pl.col("frequency") >= 0)).drop("rejected")
    share = pl.col(q.SHARE.head).cast(pl.Float64, strict=False).fill_nan(None).clip(lower_bound=0.0).alias("share")
    return (
        keyed(table)
        .select(*KEY, "quantity", "source", share)
        .drop_nulls()
        .filter(pl.col("quantity").is_in(list(_QUANTITIES)))
        .join(kept, on=KEY, how="inner")
    )


def _shares(rows: pl.DataFrame) -> tuple[list[str], IntArray, FloatArray]:
    """Sources, specimen of each test, and shares (tests, sources); 0 where a test does not have a source."""
    sources, keys = rows["source"].unique(maintain_order=True).to_list(), keys_of(rows)
    tests = {key: index for index, key in enumerate(dict.fromkeys(keys))}
    table, tyre = np.zeros((len(tests), len(sources))), np.zeros(len(tests), dtype=np.int64)
    lines, columns = [tests[key] for key in keys], [sources.index(source) for source in rows["source"].to_list()]
    np.add.at(table, (lines, columns), rows["share"].to_numpy())
    tyre[lines] = rows["tyre"].to_numpy()
    return sources, tyre, table


def _panel(name: str, rows: pl.DataFrame, tyres: list[int]) -> Panel:
    """The sources of one quantity in falling order, the joined ones last."""
    sources, tyre_of, table = _shares(rows)
    masks = {tyre: tyre_of == tyre for tyre in tyres}
    if len(tyres) > _MOST_TYRES:
        masks = {-1: np.ones(tyre_of.size, dtype=bool)}
    medians = np.array([np.median(table[mask], axis=0) for mask in masks.values() if mask.any()]).max(axis=0)
    order = [int(at) for at in np.argsort(-medians, kind="stable") if medians[at] >= _LEAST][:_MOST_SOURCES]
    rest = [at for at in range(len(sources)) if at not in order]
    shares, names = table[:, order], [value_label(Source.read(sources[at])) for at in order]
    if rest:
        shares = np.column_stack([shares, table[:, rest].sum(axis=1)])
        names.append(f"{len(rest)} others" if len(rest) > 1 else value_label(Source.read(sources[rest[0]])))
    series = []
    for place, (tyre, mask) in enumerate(masks.items()):
        if not mask.any():
            continue
        own = 100 * shares[mask]
        middle, low, high = np.median(own, axis=0), own.min(axis=0), own.max(axis=0)
        y = np.arange(len(names)) + _APART * (place - 0.5 * (len(masks) - 1))
        for row in np.flatnonzero(high > _FLOOR):
            ends = np.array([max(low[row], _FLOOR), high[row]])
            series.append(Series(Role.LINE, ends, np.full(2, y[row]), tyre=tyre))
        shown = middle >= _FLOOR
        series.append(Series(Role.POINTS, middle[shown], y[shown], tyre=tyre))
    axis = AxisData("share of the variance", "%", log=True)
    return Panel(axis, AxisData("source", "1"), tuple(series), title=name, names=tuple(names))


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"rig-found": found, "rig-residual": residual, "mass-gain": mass_gain, "budget": budget}
