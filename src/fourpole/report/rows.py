"""The tables of the page as rows: results, the tests, and the statement; any content of study.json is accepted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees, inf
from types import SimpleNamespace
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import worst_verdict
from fourpole.core.condition import FREQUENCY, PRELOAD, PRESSURE, axis_of
from fourpole.core.digits import known, number
from fourpole.core.polar import value_of
from fourpole.findings.summary import skewed_intervals
from fourpole.fitting.rows import key_of
from fourpole.quantities import DERIVED, RIG_VALUES, Quantity, ShownUnits
from fourpole.report.digits import SENTENCES, expanded, spread, with_interval
from fourpole.study.record import section
from fourpole.study.study import Study
from fourpole.study.tables import verdict_counts

STATIC = (q.PRESSURE, q.PRELOAD, q.K1, q.SECANT, q.CYCLE_LOSS, q.NONLINEARITY)
DYNAMIC = (
    q.PRESSURE, q.PRELOAD, q.ADDED_MASS, q.TEMPERATURE, q.FREQUENCY, q.K1, q.MODULUS, q.LOSS_ANGLE, q.STORAGE, q.LOSS,
    q.LOSS_FACTOR, q.K2, q.C, q.TR_MEASURED, q.TR_PREDICTED, q.R, q.I, *DERIVED,
)  # fmt: skip
#: Columns of the condition, which stands in short below the specimen on a narrow screen.
PLACES = (q.PRESSURE, q.PRELOAD, q.ADDED_MASS, q.TEMPERATURE, q.FREQUENCY)
#: Columns that are shown only if a test has a value that is neither zero nor blank.
_SELDOM = (q.ADDED_MASS, q.TEMPERATURE)
#: A ratio below this is round-off.
_ROUND_OFF = 1e-9


def with_intervals(results: Study, rows: Sequence[dict[str, Any]]) -> Sequence[dict[str, Any]]:
    """Rows of dynamic.csv with the skewed 95 % intervals of K2 and C by Monte Carlo, by the quantity."""
    skewed = skewed_intervals(results)
    for row in rows if skewed else ():
        row |= {_interval(one): ends for one in (q.K2, q.C) if (ends := skewed.get((key_of(row), one.symbol)))}
    return rows


def _interval(quantity: Quantity) -> str:
    """The name of its interval in a row."""
    return f"95 % {quantity.symbol}"


def texts(quantity: Quantity, row: Mapping[str, Any], units: ShownUnits) -> tuple[str, str]:
    """A value of a row in the unit shown, and ± U or its interval; the measured TR has no uncertainty in the table."""
    value, std = value_of(quantity, row) or (None, 0.0)
    scale = units.of(quantity).scale
    if value is None or (quantity is q.NONLINEARITY and abs(value) < _ROUND_OFF):
        return "" if value is None else "0", ""
    if _interval(quantity) in row:
        low, high = row[_interval(quantity)]
        return with_interval(value / scale, low / scale, inf if high is None else high / scale)
    if std <= 0 or quantity.key == q.TR_MEASURED.key:
        return number(value / scale, quantity.digits), ""
    text, reach = expanded(value / scale, std / scale)
    return text, f"± {reach}" if reach else ""


def words(quantity: Quantity, row: Mapping[str, Any], units: ShownUnits) -> str:
    """Value, U or interval, and unit in one; blank where there is no value."""
    (value, about), quantity = texts(quantity, row, units), units.of(quantity)
    about = f"({about})" if " to " in about or about.startswith("above") else about
    text = " ".join(part for part in (value, about, quantity.suffix) if part) if value else ""
    return text.replace(" °", "°") if quantity.suffix == "°" else text


@dataclass(frozen=True)
class ResultTable:
    """Columns in use and their rows."""

    columns: tuple[Quantity, ...]
    rows: list[SimpleNamespace] = field(default_factory=list)
    rigs: bool = False
    remarks: bool = False
    places: tuple[str, ...] = tuple(one.key for one in PLACES)


def result_rows(results: Study, frame: pl.DataFrame, columns: tuple[Quantity, ...], cards: list[str]) -> ResultTable:
    """All rows of static.csv or dynamic.csv; `cards` has the card of each."""
    units = results.shown
    used = tuple(column for column in columns if column not in _SELDOM or any(map(known, _values(frame, column.head))))
    rows = [
        _row(row, used, card, units)
        for row, card in zip(with_intervals(results, frame.rows(named=True)), cards, strict=True)
    ]
    return ResultTable(tuple(map(units.of, used)), rows, any(row.rig for row in rows), any(row.remarks for row in rows))


def _values(frame: pl.DataFrame, name: str) -> list[Any]:
    return frame[name].to_list() if name in frame.columns else []


def _row(row: Mapping[str, Any], columns: tuple[Quantity, ...], card: str, units: ShownUnits) -> SimpleNamespace:
    """One row of a table of results."""
    return SimpleNamespace(
        card=card,
        test=str(row["test"]),
        place=condition(row, units, dynamic=True),
        tyre=str(row["tyre"] or ""),
        construction=str(row["construction"] or ""),
        rig=str(row.get("rig") or ""),
        cells=tuple(_cell(row, column, units) for column in columns),
        verdict=worst_verdict([row["verdict"]]),
        remarks=str(row["remarks"] or ""),
    )


def _cell(row: Mapping[str, Any], column: Quantity, units: ShownUnits) -> SimpleNamespace:
    """One number: the SI value as text, by which rows are sorted, and the value shown with U or its interval."""
    found = value_of(column, row)
    text, about = texts(column, row, units)
    key = "" if found is None else repr(found[0])
    return SimpleNamespace(key=key, text=text, about=about, place=column in PLACES)


def condition(row: Mapping[str, Any], units: ShownUnits, *, dynamic: bool) -> str:
    """The condition of a test in short: 1.7 bar, 1000 N, 10.01 Hz."""
    stood = (q.PRESSURE, *((q.PRELOAD,) if dynamic else ()), q.FREQUENCY, q.ADDED_MASS, q.TEMPERATURE)
    said = []
    for one in map(units.of, stood):
        value = known(row.get(one.head))
        if value is not None and (value or one.key != q.ADDED_MASS.key):
            added = " added" if one.key == q.ADDED_MASS.key else ""
            said.append(f"{number(value / one.scale, one.digits)} {one.shown}{added}")
    return ", ".join(said)


_SAID: dict[str, dict[str, Any]] = SENTENCES["channels"]
_STATIC_ROLES = {"load", "deflection"}


def tested(results: Study) -> list[SimpleNamespace]:
    """One row per tyre, in the order of the tables."""
    both = [results.static.select("tyre", "construction"), results.dynamic.select("tyre", "construction")]
    constructions: dict[str, str] = {}
    for frame in both:
        for tyre, construction in frame.iter_rows():
            constructions.setdefault(str(tyre or ""), str(construction or ""))
    stated = section(results.record, "stated", "specimens")
    return [_tested(results, tyre, text, section(stated, tyre)) for tyre, text in constructions.items()]


def _tested(results: Study, tyre: str, construction: str, stated: Mapping[str, Any]) -> SimpleNamespace:
    """One tyre with the conditions of its tests, and their number."""
    static, dynamic = (frame.filter(pl.col("tyre") == tyre) for frame in (results.static, results.dynamic))

    def values(name: str) -> list[Any]:
        return [*_values(static, name), *_values(dynamic, name)]

    pressure, preload = map(results.shown.of, (q.PRESSURE, q.PRELOAD))
    return SimpleNamespace(
        name=tyre,
        construction=construction,
        more=[(str(key), _plain(value)) for key, value in stated.items() if key != "construction"],
        pressures=spread(values(q.PRESSURE.head), PRESSURE, pressure.shown, scale=pressure.scale),
        preloads=spread(values(q.PRELOAD.head), PRELOAD, preload.shown, scale=preload.scale),
        temperatures=spread(values(q.TEMPERATURE.head), axis_of(q.TEMPERATURE.head), q.TEMPERATURE.shown),
        frequencies=spread(values(q.FREQUENCY.head), FREQUENCY, "Hz"),
        static=static["test"].n_unique(),
        dynamic=dynamic["test"].n_unique(),
        verdicts=verdict_counts(static, dynamic),
    )


def _plain(value: object) -> str:
    found = known(value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{found:.6g}" if found is not None else str(value)


def rig_rows(record: Mapping[str, Any]) -> list[SimpleNamespace]:
    """Each value of each rig with its uncertainty."""
    rows = []
    for name, stated in section(record, "stated", "rigs").items():
        if section(stated) and stated.get("output") == "blocked":
            rows.append(_shown_value(str(name), "far side", "blocked"))
        rows += [_rig_row(str(name), key, value) for key, value in section(stated).items() if isinstance(value, dict)]
    return rows


def _shown_value(
    rig: str, name: str, value: str = "", std: str = "", unit: str = "", *, assumed: bool = False
) -> SimpleNamespace:
    return SimpleNamespace(rig=rig, name=name, value=value, std=std, unit=unit, assumed=assumed)


def _rig_row(rig: str, key: str, stated: dict[str, Any]) -> SimpleNamespace:
    """One stated value of a rig."""
    unit = str(stated.get("unit", ""))
    known_value = RIG_VALUES.get(key) or Quantity(key, "", key.replace("_", " "), unit)
    words, shown, scale = known_value.name, known_value.suffix, known_value.scale
    value, std = known(stated.get("value")), known(stated.get("std"))
    if value is None:
        return _shown_value(rig, words, unit=shown)
    text, about = expanded(value / scale, (std or 0.0) / scale)
    if not about:
        text = f"{value / scale:.6g}".replace("-", "−")
    return _shown_value(rig, words, text, about or "exact", shown, assumed=stated.get("assumed") is True)


def channel_rows(record: Mapping[str, Any]) -> list[SimpleNamespace]:
    """A row per channel: column, quantity, conversion to SI values, and uncertainty."""
    channels = section(record, "stated", "channels")
    return [_channel_row(str(role), stated) for role, stated in channels.items() if isinstance(stated, dict)]


def _channel_row(role: str, stated: dict[str, Any]) -> SimpleNamespace:
    """One channel; `gain_std` and `phase_std` are each a text and a flag for an assumed value."""
    more = [f"{name} {_plain(stated[name])}" for name in ("gain", "offset", "sensitivity", "range") if name in stated]
    if delay := known(stated.get("delay")):
        more.append(f"delay {number(1e3 * delay, 3)} ms")
    if stated.get("invert") is True:
        more.append("inverted")
    more += _chain(stated)
    gain, phase = known(stated.get("std_gain [1]")), known(stated.get("std_phase [rad]", stated.get("std_phase")))
    return SimpleNamespace(
        role=_SAID["roles"].get(role, role),
        column=str(stated.get("column", "")),
        unit=str(stated.get("unit") or "V"),
        quantity=str(stated.get("quantity", "")),
        more=more,
        gain_std=_unknown(stated, "std_gain", None if gain is None else 100.0 * gain, "%"),
        phase_std=("", False)
        if role in _STATIC_ROLES
        else _unknown(stated, "std_phase", None if phase is None else degrees(phase), "°"),
    )


def _chain(stated: dict[str, Any]) -> list[str]:
    """The corrections of the channel's amplitudes, in words."""
    more = []
    for name, words in (("high_pass", "high-pass"), ("low_pass", "low-pass")):
        link = section(stated, name)
        if (corner := known(link.get("corner"))) is not None:
            more.append(f"{words} {corner:.6g} Hz, order {link.get('order', 1)}")
    geophone = section(stated, "geophone")
    if (natural := known(geophone.get("natural_frequency"))) is not None:
        more.append(f"geophone {natural:.6g} Hz, damping {_plain(geophone.get('damping'))}")
    if "response" in stated:
        more.append(f"calibrated response {stated['response']}")
    more += [f"cross-talk of {source} {text}" for source, text in section(stated, "crosstalk").items()]
    for key, (words, unit, scale) in _SAID["errors"].items():
        if (value := known(stated.get(key))) is not None:
            more.append(f"{words} {number(scale * value, 3)} {unit}")
    return [*more, *(f"{words} {stated[key]}" for key, words in _SAID["words"].items() if stated.get(key) is not None)]


def _unknown(stated: dict[str, Any], name: str, value: float | None, unit: str) -> tuple[str, bool]:
    if value is None:
        return "", False
    if value == 0:
        return "exact", False
    gap = "" if unit == "°" else " "
    return f"{value:.3g}{gap}{unit}", name not in stated and stated.get("exact") is not True
