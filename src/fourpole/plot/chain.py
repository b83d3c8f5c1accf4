"""The user's own rig as campaign.toml states it: its chain from the contact to the foundation, with the sensors.

Only what is stated is shown.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from fourpole import quantities as q
from fourpole.core.rig import PARAMETERS
from fourpole.plot.names import plain_text
from fourpole.plot.sheet import Sheet, floats, read_sheet
from fourpole.quantities import RIG_VALUES, Quantity, ShownUnits
from fourpole.study.record import section
from fourpole.study.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fourpole.plot.pen import Pen
    from fourpole.plot.style import Style

_MOST_RIGS, _MOST_NAMES = 2, 3
#: What the sensors measure, by their roles in campaign.toml.
_SENSORS = {"force_in": "F1", "motion_in": "V1", "motion_out": "V2", "load": "load", "deflection": "deflection"}


class Kind(StrEnum):
    """What a link of the chain is."""

    SENSOR = "sensor"
    MASS = "mass"
    SPECIMEN = "specimen"
    SPRING = "spring"
    FIXED = "fixed"


@dataclass(frozen=True)
class Link:
    """One link of the chain: what it is, its name in the drawing, and what is stated of it, line by line."""

    kind: Kind
    name: str
    stated: tuple[str, ...] = ()
    damped: bool = False


def chains(results: Study) -> dict[str, tuple[Link, ...]]:
    """The links of each rig by its name, from the contact upwards.

    Examples
    --------
    >>> import polars as pl
    >>> none, rig = pl.DataFrame(), {"output": "blocked"}
    >>> chains(Study(none, none, none, {"stated": {"rigs": {"": rig}}}))[""][-1]
    Link(kind=<Kind.FIXED: 'fixed'>, name='blocked: V2 = 0', stated=(), damped=False)
    """
    stated = section(results.record, "stated", "rigs")
    if not stated:
        return {}
    sheet = read_sheet(results, texts_only=True)
    channels = section(results.record, "stated", "channels")
    return {name: _chain(name, section(rig), channels, sheet, results.shown) for name, rig in stated.items()}


def _chain(
    name: str, rig: Mapping[str, Any], channels: Mapping[str, Any], sheet: Sheet, units: ShownUnits
) -> tuple[Link, ...]:
    values = {key: _value(units.of(RIG_VALUES[key]), rig[key]) for key in PARAMETERS if _stated(rig.get(key))}
    blocked = rig.get("output") == "blocked"
    own = np.array([one == name for one in sheet.rigs], dtype=bool)
    links = [_sensor("motion_in", channels), _sensor("force_in", channels)]
    links += [_mass("input mass", values, "input_mass")]
    links += [Link(Kind.SPECIMEN, "K*", (_specimens(sheet, own),))]
    links += [_mass("", values, "tyre_mass")]
    links += [] if blocked else [_sensor("motion_out", channels)]
    links += [_mass("m", values, "moving_mass", *_added(sheet, own))]
    if blocked:
        return (*_there(links), Link(Kind.FIXED, "blocked: V2 = 0"))
    spring = [values[key] for key in ("preload_stiffness", "preload_damping", "preload_loss_factor") if key in values]
    frame = "frame_stiffness" in values
    if spring:
        links += [Link(Kind.SPRING, "K3", tuple(spring), damped="preload_damping" in values)]
        links += [Link(Kind.SPRING, "", (values["frame_stiffness"],))] if frame else []
        links += [Link(Kind.FIXED, "foundation")]
    return tuple(_there(links))


def _there(links: list[Link | None]) -> list[Link]:
    return [one for one in links if one is not None]


def _stated(value: object) -> bool:
    """Whether a value is stated and is not zero; a part with the value zero is absent."""
    found = value.get("value") if isinstance(value, dict) else None
    return isinstance(found, int | float) and bool(np.isfinite(found)) and found != 0


def _value(known: Quantity, stated: Mapping[str, Any]) -> str:
    """A value with its standard uncertainty in the shown unit."""
    std = stated.get("std")
    unit = f" {known.suffix}" if known.suffix else ""
    text = f"{known.name} = {stated['value'] / known.scale:.6g}"
    if not isinstance(std, int | float) or not std > 0:
        return f"{text}{unit}"
    return f"{text} ± {std / known.scale:.2g}{unit}" + (" (u assumed)" if stated.get("assumed") is True else "")


def _mass(name: str, values: Mapping[str, str], key: str, *more: str) -> Link | None:
    return Link(Kind.MASS, name, (values[key], *more)) if key in values else None


def _sensor(role: str, channels: Mapping[str, Any]) -> Link | None:
    """The sensor of a channel: what it measures, and its column with its unit."""
    stated = section(channels, role)
    if not stated:
        return None
    column, unit = (plain_text(str(stated[key])) if stated.get(key) else "" for key in ("column", "unit"))
    named = " ".join(part for part in (column, f"[{unit}]" if unit else "") if part)
    words = {"force": "force", "displacement": "displacement", "velocity": "velocity", "acceleration": "acceleration"}
    quantity = words.get(str(stated.get("quantity", "")), "force" if role in ("force_in", "load") else "motion")
    return Link(Kind.SENSOR, _SENSORS[role], (f"{quantity}: column {named}" if named else quantity,))


def _specimens(sheet: Sheet, own: np.ndarray) -> str:
    names = [sheet.labels[at] for at in np.unique(sheet.tyre[own]) if sheet.names[at]]
    if len(names) > _MOST_NAMES:
        return f"{len(names)} specimens"
    return ", ".join(names) or "specimen"


def _added(sheet: Sheet, own: np.ndarray) -> tuple[str, ...]:
    masses = sorted({float(f"{mass:.4g}") for mass in floats(sheet.table, q.ADDED_MASS.head)[own] if mass > 0})
    shown = ", ".join(f"{mass:g}" for mass in masses[:6])
    return (f"in some tests {shown} kg added",) if masses else ()


def own_rig(results: Study, style: Style) -> Figure | None:
    """The chains of the rigs beside each other, from the contact at the bottom to the foundation at the top."""
    from fourpole.plot.pen import Pen

    found = list(chains(results).items())
    if not found:
        return None
    shown = found[:_MOST_RIGS]
    high = max(sum(_HEIGHTS[link.kind] for link in links) for _, links in shown) + 0.5
    pen = Pen(high + (0.5 if len(shown) > 1 else 0.0) + 0.35, style)
    for at, (name, links) in enumerate(shown):
        x, y = (3.6 if len(shown) == 1 else 1.5 + 5.0 * at), 0.55
        for link in links:
            _draw(pen, x, y, link)
            y += _HEIGHTS[link.kind]
        if len(shown) > 1:
            pen.text(x, high + 0.4, f"rig {plain_text(name)}" if name else "rig", ha="center")
    more = f"; {_MOST_RIGS} of {len(found)} rigs shown" if len(found) > _MOST_RIGS else ""
    pen.text(0.15, 0.15, f"As campaign.toml states it{more}.", size=7.0)
    return pen.figure


#: Height of each kind of link in the drawing.
_HEIGHTS = {Kind.SENSOR: 0.42, Kind.MASS: 0.75, Kind.SPECIMEN: 1.0, Kind.SPRING: 1.15, Kind.FIXED: 0.3}
_BESIDE = 1.35


def _draw(pen: Pen, x: float, y: float, link: Link) -> None:
    """One link from the height y upwards, with what is stated of it on its right."""
    high = _HEIGHTS[link.kind]
    top, middle = y + high, y + 0.5 * high
    if link.kind is Kind.SENSOR:  # a point of the chain with an arrow for what is measured there
        pen.line([x, x], [y, top])
        pen.mark(x, middle)
        pen.line([x, x + 0.55], [middle, middle], 0.6)
        pen.up(x + 0.55, middle - 0.17, middle + 0.2)
        pen.text(x + 0.68, middle, link.name)
    elif link.kind is Kind.FIXED:
        pen.ground(x - 0.9, x + 0.9, y, up=True)
        pen.text(x + _BESIDE, y + 0.08, link.name, size=8.0)
    elif link.kind is Kind.SPRING and link.damped:
        pen.line([x - 0.4, x + 0.4], [y, y])
        pen.line([x - 0.4, x + 0.4], [top, top])
        pen.spring(x - 0.4, y, top)
        pen.damper(x + 0.4, y, top)
    elif link.kind is Kind.SPRING:
        pen.spring(x, y, top)
    else:  # a body, with lines that join it to its neighbours
        mass = link.kind is Kind.MASS
        half, stub = (0.8, 0.1) if mass else (0.95, 0.12)
        pen.line([x, x], [y, y + stub])
        pen.line([x, x], [top - stub, top])
        pen.box(x - half, y + stub, 2 * half, high - 2 * stub, "grid" if mass else "paper")
        pen.text(x, middle, link.name, "center", 9.0 if mass else 10.0)
    for row, text in enumerate(link.stated):
        pen.text(x + _BESIDE, middle + 0.26 * (0.5 * (len(link.stated) - 1) - row), plain_text(text, 60), size=8.0)


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"rig": own_rig}
