"""Cards, one per test on the page: packed curves, values as they are shown, and the lines of a test with many."""

from __future__ import annotations

import cmath
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.checks import VERDICTS, Verdict, worst_verdict
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import known, number
from fourpole.core.phasor import SYMBOLS
from fourpole.core.polar import value_of
from fourpole.core.recording import UNITS
from fourpole.findings.list import CheckRow, checks_by_point, kind_of
from fourpole.fitting.rows import KEY, Key, key_of, keyed, keys_of
from fourpole.plot.cards import dynamic_cards, in_equal_ratios
from fourpole.plot.sheet import floats
from fourpole.quantities import Quantity, ShownUnits
from fourpole.report.rows import DYNAMIC, STATIC, condition, texts, with_intervals, words
from fourpole.study.record import section, stated_blocked
from fourpole.study.study import Study
from fourpole.study.tables import DYNAMIC as TABLE
from fourpole.study.tables import verdict_of_lines

#: Two of these characters are one sample of a curve: 4095 levels between its extremes, and one for a missing sample.
ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
_LEVELS = 4094
_PAIRS = np.array([a + b for a in ALPHABET for b in ALPHABET], dtype="S2")


def extremes(values: FloatArray) -> tuple[float, float]:
    """Least and largest value; zeros if none is known."""
    seen = values[np.isfinite(values)]
    return (float(seen.min()), float(seen.max())) if seen.size else (0.0, 0.0)


def packed(values: FloatArray, low: float | None = None, high: float | None = None) -> list[float | str]:
    """A curve as its extremes and two characters per sample.

    Parameters
    ----------
    values : (n,) float array
        Not-a-number is kept as missing.
    low, high : float, optional
        Extremes to share with other curves; by default the curve's own.

    Returns
    -------
    list
        Least value, value of one level, text.
    """
    if low is None or high is None:
        low, high = extremes(values)
    step = (high - low) / _LEVELS
    level = np.zeros(values.size) if step == 0 else (values - low) / step
    index = np.where(np.isfinite(values), np.clip(np.rint(level), 0, _LEVELS), _LEVELS + 1).astype(int)
    return [float(f"{low:.8g}"), float(f"{step:.8g}"), _PAIRS[index].tobytes().decode()]


#: Most lines of a curve, and rows of the table of a card.
_CURVE, _ROWS = 400, 12
#: Most remarks of a card, those of most lines first.
_REMARKS = 6
#: Quantities over frequency with their expanded uncertainty, each a panel.
_PANELS = (q.STORAGE, q.LOSS, q.C)
#: Columns of the table, and values of a test that all of its lines have.
_TABLE = (q.FREQUENCY, q.MODULUS, q.LOSS_ANGLE, q.STORAGE, q.LOSS, q.K2, q.C)
_COMMON = (q.DEFLECTION_AMPLITUDE, q.K1)


def line_body(
    rows: pl.DataFrame, lines: pl.DataFrame, checks: Mapping[Key, Sequence[CheckRow]], units: ShownUnits
) -> dict[str, Any]:
    """The data of the card: rows of dynamic.csv and of lines.csv of one test, which may have none, and its checks."""
    frequency = floats(rows, q.FREQUENCY.head)
    kept = in_equal_ratios(frequency, _CURVE).tolist()
    panels = [one for quantity in map(units.of, _PANELS) if (one := _panel(rows[kept], quantity))]
    seen = rows.select(KEY).join(lines, on=KEY, how="left") if lines.height else rows.select(KEY)
    panels += [one for one in (_coherence(seen[kept]), _closure(seen[kept])) if one]
    first = rows.row(0, named=True)
    counts = rows[q.VERDICT.head].to_list()
    facts = [["lines", str(rows.height)]]
    facts += [[f"lines {verdict}", str(counts.count(verdict))] for verdict in VERDICTS if verdict in counts]
    facts += [[name, said] for name, said in _ranges(seen)]
    facts += [[one.symbol, said] for one in _COMMON if (said := words(one, first, units))]
    facts += [[name, str(first[name])] for name in ("rig", "route") if first.get(name)]
    used = np.flatnonzero((rows[q.VERDICT.head] != Verdict.REJECTED).to_numpy())
    every = used if used.size else np.arange(rows.height)
    few = rows[every[in_equal_ratios(frequency[every], _ROWS)].tolist()].rows(named=True)
    columns = [one for one in _TABLE if any(value_of(one, row) is not None for row in few)]
    return {
        "facts": facts,
        "remarks": _line_remarks(rows, checks),
        "lines": {"f": packed(np.log10(frequency[kept])), "panels": panels},
        "table": {
            "heads": [f"{one.symbol} [{one.shown}]" for one in map(units.of, columns)] + ["verdict"],
            "rows": [[_line_cell(row, one, units) for one in columns] + [str(row[q.VERDICT.head])] for row in few],
            "of": rows.height,
        },
    }


def band_words(rows: pl.DataFrame) -> str:
    """The frequencies and the number of the lines of a test: 5.23 to 199.5 Hz, 257 lines."""
    frequency = floats(rows, q.FREQUENCY.head)
    if not np.isfinite(frequency).any():
        return f"{rows.height} lines"
    return f"{number(np.nanmin(frequency))} to {number(np.nanmax(frequency))} Hz, {rows.height} lines"


def _panel(rows: pl.DataFrame, quantity: Quantity) -> dict[str, Any]:
    """A curve with the ends of its interval; empty if no line has a value. Rejected lines are missing."""
    used = (rows[q.VERDICT.head] != Verdict.REJECTED).to_numpy()
    value = np.where(used, floats(rows, quantity.head), np.nan) / quantity.scale
    reach = COVERAGE_FACTOR * np.where(used, floats(rows, quantity.u_head), np.nan) / quantity.scale
    if np.isfinite(value).sum() < 2:
        return {}
    room = _limits(value, reach)
    return {
        "title": f"{quantity.symbol} with U (k = {COVERAGE_FACTOR:g})", "unit": quantity.shown,
        "v": packed(value), "u": packed(reach), "room": room,
    }  # fmt: skip


def _limits(value: FloatArray, reach: FloatArray) -> list[float]:
    """Ends of the axis: those of the well-known lines, so that one uncertain line does not flatten the rest."""
    sure = np.isfinite(value) & (reach <= 4.0 * np.nanmedian(reach)) if np.isfinite(reach).any() else np.isfinite(value)
    sure = sure if sure.sum() > 1 else np.isfinite(value)
    low, high = (value - np.nan_to_num(reach))[sure].min(), (value + np.nan_to_num(reach))[sure].max()
    return [float(f"{low:.6g}"), float(f"{high:.6g}")]


def _coherence(lines: pl.DataFrame) -> dict[str, Any]:
    found = [(one, floats(lines, one.head)) for one in q.COHERENCES if one.head in lines.columns]
    curves = [{"name": one.symbol, "v": packed(values)} for one, values in found if np.isfinite(values).sum() > 1]
    return {"title": "coherence", "unit": "1", "curves": curves, "room": [0.0, 1.0]} if curves else {}


def _closure(lines: pl.DataFrame) -> dict[str, Any]:
    if q.CLOSURE_PHASE.head not in lines.columns:
        return {}
    value = np.degrees(floats(lines, q.CLOSURE_PHASE.head))
    reach = COVERAGE_FACTOR * np.degrees(floats(lines, q.CLOSURE_PHASE.u_head))
    if np.isfinite(value).sum() < 2:
        return {}
    most = float(np.nanquantile(np.abs(value) + reach, 0.9))
    return {
        "title": "closure phase with U about zero", "unit": "°", "v": packed(value), "u": packed(reach), "zero": True,
        "room": [-most, most],
    }  # fmt: skip


def _ranges(lines: pl.DataFrame) -> list[tuple[str, str]]:
    """Width and number of averages of the lines."""
    found = []
    for one in (q.WIDTH, q.AVERAGES):
        values = floats(lines, one.head)
        if np.isfinite(values).any():
            ends = [number(float(end), 3) for end in (np.nanmin(values), np.nanmax(values))]
            unit = f" {one.suffix}" if one.suffix else ""
            found.append((one.symbol, (ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}") + unit))
    return found


def _line_remarks(rows: pl.DataFrame, checks: Mapping[Key, Sequence[CheckRow]]) -> list[str]:
    """The remarks of most lines, each with the number of its lines; those of one kind are one."""
    alike: dict[object, list[str]] = {}
    for key, remark in zip(keys_of(rows), rows[q.REMARKS.head].to_list(), strict=True):
        if remark:
            alike.setdefault(kind_of(checks.get(key, ()), str(remark)), []).append(str(remark))
    ranked = sorted(alike.values(), key=len, reverse=True)
    said = [_counted(found, rows.height) for found in ranked[:_REMARKS]]
    left = sum(map(len, ranked[_REMARKS:]))
    return said + ([f"the remarks of {left} more lines are in dynamic.csv"] if left else [])


def _counted(remarks: Sequence[str], height: int) -> str:
    """A remark that differs between lines in its numbers, with the number of its lines."""
    if len(remarks) == height and len(set(remarks)) == 1:
        return remarks[0]
    where = f"{len(remarks)} of {height} lines"
    return f"{where}: {remarks[0]}" if len(set(remarks)) == 1 else f"{where}, as: {remarks[0]}"


def _line_cell(row: Mapping[str, Any], quantity: Quantity, units: ShownUnits) -> str:
    return " ".join(filter(None, texts(quantity, row, units)))


def lines_of(table: pl.DataFrame) -> dict[str, pl.DataFrame]:
    """The rows of each test in a table of lines, by test."""
    if q.TEST.head not in table.columns:
        return {}
    return {str(name): part for (name,), part in keyed(table).partition_by(q.TEST.head, as_dict=True).items()}


_LETTERS = {"displacement": "x", "velocity": "V", "acceleration": "a"}

_SEEN = (q.F1, q.V1, q.V2, q.PHASE_F1, q.PHASE_V2, q.DEFLECTION_AMPLITUDE)
_NONE: FloatArray = np.empty(0)
_TOGETHER = (q.CORR_R_I, q.CORR_K, q.CORR_K2_C)


@dataclass(frozen=True)
class Card:
    """One test: the key of its card, the text on the closed card, and the data of the open card."""

    key: str
    test: str
    tyre: str
    condition: str
    verdict: str
    body: dict[str, Any]

    @classmethod
    def of(cls, key: str, row: Mapping[str, Any], condition: str, verdict: str, body: dict[str, Any]) -> Card:
        """The card of a test by one of its rows."""
        return cls(key, str(row["test"]), str(row["tyre"] or ""), condition, verdict, body)


def make_cards(results: Study) -> tuple[list[Card], list[str], list[str]]:
    """All cards, static tests first; then the key of the card of each row of the static and of the dynamic table."""
    previews = _Previews(results.previews)
    static, static_keys = _static_cards(results, previews)
    dynamic, keys = _dynamic_cards(results, previews)
    return static + dynamic, static_keys, keys


class _Previews:
    """The previews by key; a row becomes arrays when it is asked for, because the table may be large."""

    def __init__(self, table: pl.DataFrame) -> None:
        self._table = table
        keys = table.select(name for name in KEY if name in table.columns)
        self._at = {key_of(row): at for at, row in enumerate(keys.rows(named=True))} if "test" in keys.columns else {}

    def of(self, key: Key) -> dict[str, FloatArray]:
        """The arrays of one test by column, without the room after their last sample; empty if there are none."""
        at = self._at.get(key)
        if at is None:
            return {}
        row = self._table.row(at, named=True)
        found = {name: np.asarray(one, dtype=np.float64) for name, one in row.items() if isinstance(one, list)}
        for time, *ends in ((q.TIME.head, "", " fit"), (q.RESIDUAL_TIME.head, " residual")):
            count = int(np.isfinite(found[time]).sum()) if time in found else 0
            for name in (time, *(f"{symbol}{end}" for symbol in SYMBOLS.values() for end in ends)):
                if name in found:
                    found[name] = found[name][:count]
        return {name: one for name, one in found.items() if np.isfinite(one).any()}


def _static_cards(results: Study, previews: _Previews) -> tuple[list[Card], list[str]]:
    frame, units = results.static, results.shown
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in frame.rows(named=True):
        groups.setdefault(row["test"], []).append(row)
    keys = {test: f"static-{at}" for at, test in enumerate(groups, 1)}
    cards = [
        Card.of(
            keys[test],
            rows[0],
            ", ".join(part for part in ("static", condition(rows[0], units, dynamic=False)) if part),
            worst_verdict([row["verdict"] for row in rows]),
            _static_body(rows, previews.of((str(test), 1)), units),
        )
        for test, rows in groups.items()
    ]
    return cards, [keys[test] for test in frame["test"].to_list()]


def _static_body(
    rows: Sequence[Mapping[str, Any]], preview: Mapping[str, FloatArray], units: ShownUnits
) -> dict[str, Any]:
    facts = []
    for row in rows:
        preload = known(row[q.PRELOAD.head])
        unit = units.of(q.PRELOAD)
        at = f" at {number(preload / unit.scale)} {unit.shown}" if preload is not None else ""
        facts += [[one.symbol + at, said] for one in STATIC[2:4] if (said := words(one, row, units))]
    facts += [[one.symbol, said] for one in STATIC[4:] if (said := words(one, rows[0], units))]
    body: dict[str, Any] = {"facts": facts, "remarks": _remarks(rows)}
    x, load = preview.get(q.DEFLECTION.head, _NONE), preview.get(q.LOAD.head, _NONE)
    mean_x, mean_load = preview.get(q.MEAN_DEFLECTION.head, _NONE), preview.get(q.MEAN_LOAD.head, _NONE)
    if x.size > 1 and x.size == load.size:
        body["curve"] = {"x": packed(x), "y": packed(load)}
        if mean_x.size > 1 and mean_x.size == mean_load.size:
            body["curve"] |= {"mx": packed(mean_x), "my": packed(mean_load)}
            body["curve"]["tangents"] = list(_tangents(rows, mean_x, mean_load))
    return body


def _tangents(rows: Sequence[Mapping[str, Any]], x: FloatArray, load: FloatArray) -> Iterator[list[float]]:
    """Deflection, load and slope of each K1 tangent, where the mean curve first reaches the preload."""
    for row in rows:
        preload, k1 = known(row[q.PRELOAD.head]), known(row[q.K1.head])
        if preload is None or k1 is None:
            continue
        crossings = np.flatnonzero((load[:-1] <= preload) & (preload <= load[1:]) & (load[:-1] < load[1:]))
        if crossings.size:
            at = int(crossings[0])
            share = (preload - load[at]) / (load[at + 1] - load[at])
            yield [_short(x[at] + share * (x[at + 1] - x[at])), _short(preload), _short(k1)]


def _dynamic_cards(results: Study, previews: _Previews) -> tuple[list[Card], list[str]]:
    quantities = {
        symbol: str(section(results.record, "stated", "channels", role).get("quantity", ""))
        for role, symbol in SYMBOLS.items()
    }
    more = [name for name in results.dynamic.columns if name not in (*TABLE.columns, *KEY)]
    cards, whole, units = dynamic_cards(results), results.dynamic, results.shown
    parts: dict[str, list[int]] = {}
    for at, card in enumerate(cards):
        parts.setdefault(card, []).append(at)
    lines, checks = lines_of(results.lines), checks_by_point(results.checks)
    made = []
    for card, rows in parts.items():
        (row,) = with_intervals(results, [whole.row(rows[0], named=True)])
        preview = previews.of(key_of(row))
        if len(rows) > 1:
            made.append(_line_card(card, keyed(whole[rows]), lines, _signals(preview, quantities), checks, units))
            continue
        blocked = stated_blocked(results.record, str(row["rig"] or ""))
        body = _dynamic_body(row, preview, quantities, more, units, blocked=blocked)
        made.append(Card.of(card, row, condition(row, units, dynamic=True), worst_verdict([row["verdict"]]), body))
    return made, cards


def _line_card(
    key: str,
    rows: pl.DataFrame,
    lines: Mapping[str, pl.DataFrame],
    signals: Mapping[str, Any],
    checks: Mapping[Key, Sequence[CheckRow]],
    units: ShownUnits,
) -> Card:
    """The card of a test with lines."""
    row = {**rows.row(0, named=True), q.FREQUENCY.head: None}
    about = (condition(row, units, dynamic=True), band_words(rows))
    body = {**line_body(rows, lines.get(str(row["test"]), pl.DataFrame()), checks, units), **signals}
    verdict = verdict_of_lines(rows[q.VERDICT.head].to_list())
    return Card.of(key, row, ", ".join(part for part in about if part), verdict, body)


def _dynamic_body(
    row: Mapping[str, Any],
    preview: Mapping[str, FloatArray],
    quantities: Mapping[str, str],
    more: Sequence[str],
    units: ShownUnits,
    *,
    blocked: bool,
) -> dict[str, Any]:
    loop = _loop(row, preview, blocked=blocked)
    facts = [[one.symbol, said] for one in (*_SEEN, *DYNAMIC[4:], *_TOGETHER) if (said := words(one, row, units))]
    if loop:
        facts.append(["energy lost per cycle", f"{number(pi * loop['f'] * loop['d'] * np.sin(loop['lag']))} J"])
    facts += [[name, str(row[name])] for name in ("rig", "route") if row.get(name)]
    facts += [[name, str(row[name])] for name in more if row[name] not in (None, "")]
    body: dict[str, Any] = {"facts": facts, "remarks": _remarks([row])}
    body |= _signals(preview, quantities)
    if loop:
        body["loop"] = loop
    return body


def _signals(preview: Mapping[str, FloatArray], quantities: Mapping[str, str]) -> dict[str, Any]:
    """The signals of a preview with their times; empty if there are none."""
    signals = [found for symbol in SYMBOLS.values() if (found := _signal(symbol, preview, quantities[symbol]))]
    time, blocks = preview.get(q.TIME.head, _NONE), preview.get(q.RESIDUAL_TIME.head, _NONE)
    return {"t": packed(time), "rt": packed(blocks), "signals": signals} if signals and time.size > 1 else {}


def _signal(symbol: str, preview: Mapping[str, FloatArray], quantity: str) -> dict[str, Any]:
    signal, fit, residual = (preview.get(f"{symbol}{what}", _NONE) for what in ("", " fit", " residual"))
    if signal.size < 2 or fit.size not in (0, signal.size):
        return {}
    low, high = extremes(np.concatenate([signal, fit]))
    fitted = {"f": packed(fit, low, high)} if fit.size else {}
    return {
        **fitted,
        "name": _LETTERS.get(quantity, symbol[0]) + symbol[1:],
        "unit": UNITS.get(quantity, "N" if symbol == "F1" else "SI"),
        "s": packed(signal, low, high),
        "r": packed(residual),
    }


def _loop(row: Mapping[str, Any], preview: Mapping[str, FloatArray], *, blocked: bool) -> dict[str, Any]:
    """The hysteresis loop: amplitudes of deflection and F1, the phase lead of F1, the deflection's phase at t = 0.

    The deflection is that across the tyre if V2 is known, otherwise that of the contact. The phase at t = 0 follows
    from the fit of F1 in the preview, because a preview has its own zero of time.
    """
    names = (q.FREQUENCY.head, q.F1.head, q.V1.head, q.PHASE_F1.head)
    frequency, f1, v1, ahead = (known(row[name]) for name in names)
    if not frequency or not f1 or not v1 or ahead is None:
        return {}
    v2, v2_ahead = known(row[q.V2.head]), known(row[q.PHASE_V2.head])
    across = blocked or (v2 is not None and v2_ahead is not None)
    moved = cmath.rect(v2, v2_ahead) if v2 is not None and v2_ahead is not None and not blocked else 0.0
    omega = 2 * pi * frequency
    deflection = (v1 - moved) / (1j * omega)
    if deflection == 0:
        return {}
    lag = cmath.phase(cmath.rect(f1, ahead) / deflection)
    loop = {"d": _short(abs(deflection)), "f": _short(f1), "lag": _short(lag), "w": _short(omega), "across": across}
    time, fit = preview.get(q.TIME.head, _NONE), preview.get("F1 fit", _NONE)
    if time.size > 3 and time.size == fit.size and np.all(np.isfinite(fit)):
        waves = np.stack([np.cos(omega * time), np.sin(omega * time), np.ones_like(time)], axis=1)
        a, b, _ = np.linalg.lstsq(waves, fit, rcond=None)[0]
        loop["p"] = _short(float(np.arctan2(-b, a)) - lag)
    return loop


def _remarks(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(str(row["remarks"]) for row in rows if row["remarks"]))


def _short(value: float) -> float:
    return float(f"{value:.6g}")


def embedded(value: object) -> str:
    """JSON without the characters that could end a script element."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text
