"""Cards, one per test on the page: curves packed into few characters, values as they are shown."""

from __future__ import annotations

import cmath
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from fourpole import quantities as q
from fourpole.core.checks import worst_verdict
from fourpole.findings.list import CheckRow, checks_by_point
from fourpole.fitting.rows import KEY, Key, key_of, keyed
from fourpole.plot.cards import dynamic_cards
from fourpole.report.digits import known, number, shown_as
from fourpole.report.linecards import band_words, extremes, line_body, lines_of, packed
from fourpole.report.rows import DYNAMIC, STATIC, condition, words
from fourpole.study.record import section, stated_blocked
from fourpole.study.study import Study
from fourpole.study.tables import DYNAMIC as TABLE
from fourpole.study.tables import verdict_of_lines

_SIGNALS = (("F1", "force_in"), ("V1", "motion_in"), ("V2", "motion_out"))
_UNITS = {"force": "N", "displacement": "m", "velocity": "m/s", "acceleration": "m/s²"}
_SYMBOLS = {"displacement": "x", "velocity": "V", "acceleration": "a"}

_SEEN = (q.F1, q.V1, q.V2, q.PHASE_F1, q.PHASE_V2, q.DEFLECTION_AMPLITUDE)
_NONE: NDArray[np.float64] = np.empty(0)
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
    static, static_keys = _static_cards(results.static, previews)
    dynamic, keys = _dynamic_cards(results, previews)
    return static + dynamic, static_keys, keys


class _Previews:
    """The previews by key; a row becomes arrays when it is asked for, because the table may be large."""

    def __init__(self, table: pl.DataFrame) -> None:
        self._table = table
        keys = table.select(name for name in KEY if name in table.columns)
        self._at = {key_of(row): at for at, row in enumerate(keys.rows(named=True))} if "test" in keys.columns else {}

    def of(self, key: Key) -> dict[str, NDArray[np.float64]]:
        """The arrays of one test by column, without the room after their last sample; empty if there are none."""
        at = self._at.get(key)
        if at is None:
            return {}
        row = self._table.row(at, named=True)
        found = {name: np.asarray(one, dtype=np.float64) for name, one in row.items() if isinstance(one, list)}
        for time, *ends in ((q.TIME.head, "", " fit"), (q.RESIDUAL_TIME.head, " residual")):
            count = int(np.isfinite(found[time]).sum()) if time in found else 0
            for name in (time, *(f"{symbol}{end}" for symbol, _ in _SIGNALS for end in ends)):
                if name in found:
                    found[name] = found[name][:count]
        return {name: one for name, one in found.items() if np.isfinite(one).any()}


def _static_cards(frame: pl.DataFrame, previews: _Previews) -> tuple[list[Card], list[str]]:
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in frame.rows(named=True):
        groups.setdefault(row["test"], []).append(row)
    keys = {test: f"static-{at}" for at, test in enumerate(groups, 1)}
    cards = [
        Card.of(
            keys[test],
            rows[0],
            ", ".join(part for part in ("static", condition(rows[0], dynamic=False)) if part),
            worst_verdict([row["verdict"] for row in rows]),
            _static_body(rows, previews.of((str(test), 1))),
        )
        for test, rows in groups.items()
    ]
    return cards, [keys[test] for test in frame["test"].to_list()]


def _static_body(rows: Sequence[Mapping[str, Any]], preview: Mapping[str, NDArray[np.float64]]) -> dict[str, Any]:
    facts = []
    for row in rows:
        preload = known(row[q.PRELOAD.head])
        unit = shown_as(q.PRELOAD)
        at = f" at {number(preload / unit.scale)} {unit.shown}" if preload is not None else ""
        facts += [[one.symbol + at, said] for one in STATIC[2:4] if (said := words(one, row))]
    facts += [[one.symbol, said] for one in STATIC[4:] if (said := words(one, rows[0]))]
    body: dict[str, Any] = {"facts": facts, "remarks": _remarks(rows)}
    x, load = preview.get(q.DEFLECTION.head, _NONE), preview.get(q.LOAD.head, _NONE)
    mean_x, mean_load = preview.get(q.MEAN_DEFLECTION.head, _NONE), preview.get(q.MEAN_LOAD.head, _NONE)
    if x.size > 1 and x.size == load.size:
        body["curve"] = {"x": packed(x), "y": packed(load)}
        if mean_x.size > 1 and mean_x.size == mean_load.size:
            body["curve"] |= {"mx": packed(mean_x), "my": packed(mean_load)}
            body["curve"]["tangents"] = list(_tangents(rows, mean_x, mean_load))
    return body


def _tangents(
    rows: Sequence[Mapping[str, Any]], x: NDArray[np.float64], load: NDArray[np.float64]
) -> Iterator[list[float]]:
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
        for symbol, role in _SIGNALS
    }
    more = [name for name in results.dynamic.columns if name not in (*TABLE.columns, *KEY)]
    cards, whole = dynamic_cards(results), results.dynamic
    parts: dict[str, list[int]] = {}
    for at, card in enumerate(cards):
        parts.setdefault(card, []).append(at)
    lines, checks = lines_of(results.lines), checks_by_point(results.checks)
    made = []
    for card, rows in parts.items():
        row = whole.row(rows[0], named=True)
        preview = previews.of(key_of(row))
        if len(rows) > 1:
            made.append(_line_card(card, keyed(whole[rows]), lines, _signals(preview, quantities), checks))
            continue
        blocked = stated_blocked(results.record, str(row["rig"] or ""))
        body = _dynamic_body(row, preview, quantities, more, blocked=blocked)
        made.append(Card.of(card, row, condition(row, dynamic=True), worst_verdict([row["verdict"]]), body))
    return made, cards


def _line_card(
    key: str,
    rows: pl.DataFrame,
    lines: Mapping[str, pl.DataFrame],
    signals: Mapping[str, Any],
    checks: Mapping[Key, Sequence[CheckRow]],
) -> Card:
    """The card of a test with lines."""
    row = {**rows.row(0, named=True), q.FREQUENCY.head: None}
    about = (condition(row, dynamic=True), band_words(rows))
    body = {**line_body(rows, lines.get(str(row["test"]), pl.DataFrame()), checks), **signals}
    verdict = verdict_of_lines(rows[q.VERDICT.head].to_list())
    return Card.of(key, row, ", ".join(part for part in about if part), verdict, body)


def _dynamic_body(
    row: Mapping[str, Any],
    preview: Mapping[str, NDArray[np.float64]],
    quantities: Mapping[str, str],
    more: Sequence[str],
    *,
    blocked: bool,
) -> dict[str, Any]:
    loop = _loop(row, preview, blocked=blocked)
    facts = [[one.symbol, said] for one in (*_SEEN, *DYNAMIC[4:], *_TOGETHER) if (said := words(one, row))]
    if loop:
        facts.append(["energy lost per cycle", f"{number(pi * loop['f'] * loop['d'] * np.sin(loop['lag']))} J"])
    facts += [[name, str(row[name])] for name in ("rig", "route") if row.get(name)]
    facts += [[name, str(row[name])] for name in more if row[name] not in (None, "")]
    body: dict[str, Any] = {"facts": facts, "remarks": _remarks([row])}
    body |= _signals(preview, quantities)
    if loop:
        body["loop"] = loop
    return body


def _signals(preview: Mapping[str, NDArray[np.float64]], quantities: Mapping[str, str]) -> dict[str, Any]:
    """The signals of a preview with their times; empty if there are none."""
    signals = [found for symbol, _ in _SIGNALS if (found := _signal(symbol, preview, quantities[symbol]))]
    time, blocks = preview.get(q.TIME.head, _NONE), preview.get(q.RESIDUAL_TIME.head, _NONE)
    return {"t": packed(time), "rt": packed(blocks), "signals": signals} if signals and time.size > 1 else {}


def _signal(symbol: str, preview: Mapping[str, NDArray[np.float64]], quantity: str) -> dict[str, Any]:
    signal, fit, residual = (preview.get(f"{symbol}{what}", _NONE) for what in ("", " fit", " residual"))
    if signal.size < 2 or fit.size not in (0, signal.size):
        return {}
    low, high = extremes(np.concatenate([signal, fit]))
    fitted = {"f": packed(fit, low, high)} if fit.size else {}
    return {
        **fitted,
        "name": _SYMBOLS.get(quantity, symbol[0]) + symbol[1:],
        "unit": _UNITS.get(quantity, "N" if symbol == "F1" else "SI"),
        "s": packed(signal, low, high),
        "r": packed(residual),
    }


def _loop(row: Mapping[str, Any], preview: Mapping[str, NDArray[np.float64]], *, blocked: bool) -> dict[str, Any]:
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
