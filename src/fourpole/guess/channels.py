"""Which column of a recording is what: by its unit, by its name, and by what the signals show."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourpole import units
from fourpole.errors import UnitError
from fourpole.guess.signals import SignalShape
from fourpole.guess.words import IN, NAMES, OUT
from fourpole.units import MOTIONS, shown

__all__ = ["Column", "Role", "column_of", "dynamic_roles", "force_scale", "static_roles"]

_KINDS = ("force", *MOTIONS, "voltage", "time", "pressure", "frequency", "angle")
_TURNS = {"displacement": 1, "velocity": 0, "acceleration": -1}
_ORDER = ("velocity", "acceleration", "displacement")
_SPLIT = re.compile(r"[A-ZÄÖÜ]?[a-zäöüßà-ÿ]+|[A-ZÄÖÜ]+(?![a-zäöüßà-ÿ])|\d+")
#: What loggers call their channels: the number behind says nothing of the place.
_NUMBERED = frozenset(
    [
        "channel",
        "ch",
        "chan",
        "kanal",
        "voie",
        "canal",
        "sensor",
        "signal",
        "input",
        "ai",
        "analog",
        "col",
        "column",
        "spalte",
    ]
)
#: Of the tests, the share that must speak for a sign.
_MOST = 0.9


@dataclass(frozen=True)
class Column:
    """A column as its name and unit describe it; `quantity` is empty where neither says it."""

    name: str
    unit: str | None
    quantity: str
    side: str = ""
    likely: int = 0


@dataclass(frozen=True)
class Role:
    """The column of a role, how its numbers are to be read, and what is doubtful of that."""

    role: str
    column: str
    unit: str | None
    quantity: str
    invert: bool = False
    doubts: tuple[str, ...] = ()

    def doubted(self, doubt: str) -> Role:
        """The same with one more doubt."""
        return replace(self, doubts=(*self.doubts, doubt))


def column_of(name: str, unit: str | None) -> Column:
    """What a column's unit and name say of it.

    Examples
    --------
    >>> column_of("Beschl_unten", "m/s2")
    Column(name='Beschl_unten', unit='m/s2', quantity='acceleration', side='in', likely=0)
    """
    words = _words(name)
    named = _named(words, name)
    stated = _quantity(unit)
    quantity = named if stated in ("", "voltage") else stated
    if named in ("reference", "temperature", "pressure") and stated in ("", "voltage", "displacement"):
        quantity = named
    telling = [word for word in words if not (word.isdigit() and _NUMBERED & set(words))]
    if _NUMBERED & set(words):
        telling = [word for word in telling if word not in ("input", "output")]
    sides = {"in" for word in telling if word in IN} | {"out" for word in telling if word in OUT}
    return Column(name, unit, quantity, sides.pop() if len(sides) == 1 else "", _likely(words))


def _words(name: str) -> list[str]:
    """Words of a name; a unit in brackets is none of them."""
    bare = units.column_unit(name)[0]
    found = [word.casefold() for word in _SPLIT.findall(bare)]
    joined = [f"{word}" for word in re.split(r"[\W_]+", bare.casefold()) if word]
    return [*dict.fromkeys([*found, *joined])]


def _named(words: Sequence[str], name: str) -> str:
    """Quantity by the words of the name; a whole word goes before one letter."""
    if len(name.strip()) == 1 and name.strip() == "T":
        return "temperature"
    hits = [(len(word) > 2, quantity) for quantity, known in NAMES.items() for word in words if word in known]
    hits += [(True, quantity) for quantity, known in NAMES.items() for word in words if _begins(word, known)]
    if any(quantity == "reference" and whole for whole, quantity in hits):
        others = {quantity for _, quantity in hits if quantity in ("force", *MOTIONS)}
        if not others or not {"drive"} >= {word for word in words if word in NAMES["reference"]}:
            return "reference"
    best = sorted(hits, key=lambda hit: -hit[0])
    return best[0][1] if best else ""


def _begins(word: str, known: frozenset[str]) -> bool:
    return any(len(one) >= 5 and len(word) > len(one) and (word.startswith(one) or word.endswith(one)) for one in known)


def _quantity(unit: str | None) -> str:
    """Kind of a unit, empty where it is none."""
    if unit is None or unit in ("1", "-"):
        return ""
    if unit.strip() in ("°C", "degC", "C", "K", "°F", "degF"):
        return "temperature"
    try:
        return units.channel_scale(unit, _KINDS)[0]
    except UnitError:
        return ""


def _likely(words: Sequence[str]) -> int:
    """How well a name says that it is the main one of its quantity: vertical, wheel load, deflection."""
    good = {
        "z",
        "fz",
        "load",
        "last",
        "radlast",
        "loadcell",
        "deflection",
        "defl",
        "einfederung",
        "vertical",
        "vertikal",
    }
    bad = {"fx", "fy", "mx", "my", "mz", "lateral", "x", "y", "longitudinal", "quer", "längs", "raw", "command", "soll"}
    return sum(word in good for word in words) - sum(word in bad for word in words if len(words) > 1 or len(word) > 1)


def static_roles(columns: Sequence[Column], looks: Sequence[SignalShape]) -> dict[str, Role]:
    """Load and deflection of the static tests."""
    forces = [column for column in columns if column.quantity == "force"]
    travels = [column for column in columns if column.quantity == "displacement"]
    unknown = [column for column in columns if column.quantity in ("", "voltage")]
    by_curve = ""
    if not (forces and travels):
        moving = [column for column in unknown if any(_span(look, column.name) > 0 for look in looks)]
        forces, travels = _by_curve(forces, travels, moving, looks)
        by_curve = "known by its loop alone (loading lies above unloading): check that it is the right column"
    found: dict[str, Role] = {}
    for role, several, kind in (("load", forces, "force"), ("deflection", travels, "displacement")):
        if several:
            best = max(
                several, key=lambda one: (one.likely, max((_span(look, one.name) for look in looks), default=0.0))
            )
            found[role] = _static_role(role, best, kind, looks, by_curve, several)
    return found


def _static_role(
    role: str, column: Column, kind: str, looks: Sequence[SignalShape], by_curve: str, several: Sequence[Column]
) -> Role:
    low = min((look.ranges[column.name][0] for look in looks if column.name in look.ranges), default=0.0)
    high = max((look.ranges[column.name][1] for look in looks if column.name in look.ranges), default=0.0)
    largest = max(abs(low), abs(high))
    unit, doubt = _static_unit(column, kind, largest)
    doubts = [text for text in (by_curve if column.quantity != kind else "", doubt, _others(column, several)) if text]
    invert = -low > 2 * abs(high)
    if invert:
        doubts.append("mostly negative, so its sign is turned: load and deflection are positive in compression")
    return Role(role, column.name, unit, kind, invert, tuple(doubts))


def _static_unit(column: Column, kind: str, largest: float) -> tuple[str | None, str]:
    if column.quantity == kind and column.unit is not None and _quantity(column.unit) == kind:
        return column.unit, ""
    if _quantity(column.unit) == "voltage":
        return None, 'recorded in volts: state its sensitivity, as sensitivity = "4 mV/N" or "0.2 V/mm"'
    large, small, limit = ("N", "kN", 100.0) if kind == "force" else ("mm", "m", 0.5)
    unit = large if largest >= limit else small
    return unit, f"its unit is stated nowhere: taken as {unit}, for it reaches {largest:.3g}"


def _by_curve(
    forces: list[Column], travels: list[Column], unknown: list[Column], looks: Sequence[SignalShape]
) -> tuple[list[Column], list[Column]]:
    """Load and deflection by the sense of the loop: a passive tyre takes work."""
    if forces and len(unknown) == 1:
        return forces, unknown
    if travels and len(unknown) == 1:
        return unknown, travels
    if forces or travels or len(unknown) != 2:
        return forces, travels
    a, b = unknown
    work = [_work(look, a.name, b.name) for look in looks]
    return ([a], [b]) if np.nansum(work) > 0 else ([b], [a])


def _work(look: SignalShape, load: str, travel: str) -> float:
    """Area of the loop in units of its box, positive where the first is the load."""
    if load not in look.samples or travel not in look.samples:
        return 0.0
    y, x = look.samples[load], look.samples[travel]
    box = np.ptp(x) * np.ptp(y)
    return float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x)) / box) if box > 0 else 0.0


def _span(look: SignalShape, name: str) -> float:
    low, high = look.ranges.get(name, (0.0, 0.0))
    return high - low


def _others(column: Column, several: Sequence[Column]) -> str:
    rest = [shown(other.name, 30) for other in several if other.name != column.name]
    return f"taken of several: {', '.join(rest[:4])} could be it too" if rest else ""


def dynamic_roles(columns: Sequence[Column], looks: Sequence[SignalShape]) -> dict[str, Role]:
    """F1, V1 and V2 of the dynamic tests."""
    looks = [look for look in looks if look.kind == "dynamic" and np.isfinite(look.frequency)]
    found: dict[str, Role] = {}
    forces = [column for column in columns if column.quantity == "force"]
    if forces:
        rank = {"in": 2, "": 1, "out": 0}
        best = max(forces, key=lambda one: (rank[one.side], one.likely, _size(looks, one.name)))
        found["force_in"] = _dynamic_role("force_in", best, looks, _others(best, forces))
    motions = [column for column in columns if column.quantity in MOTIONS]
    pair, doubts = _pair(motions, found.get("force_in"), looks)
    for role, column in zip(("motion_in", "motion_out"), pair, strict=False):
        if column is not None:
            found[role] = _dynamic_role(role, column, looks, *doubts)
    return _signs(found, looks)


def _size(looks: Sequence[SignalShape], name: str) -> float:
    return float(np.median([abs(look.amplitudes.get(name, 0.0)) for look in looks])) if looks else 0.0


def _dynamic_role(role: str, column: Column, looks: Sequence[SignalShape], *doubts: str) -> Role:
    unit, doubt = _dynamic_unit(column, _size(looks, column.name))
    return Role(role, column.name, unit, column.quantity, doubts=tuple(text for text in (*doubts, doubt) if text))


def _dynamic_unit(column: Column, size: float) -> tuple[str | None, str]:
    stated = _quantity(column.unit)
    if stated == column.quantity:
        return column.unit, ""
    if stated == "voltage":
        return None, 'recorded in volts: state its sensitivity, as sensitivity = "98.3 mV/g" or "4 mV/N"'
    unit = {
        "force": "N" if size >= 1 else "kN",
        "velocity": "m/s" if size < 3 else "mm/s",
        "acceleration": "m/s^2",
        "displacement": "mm" if size > 0.02 else "m",
    }[column.quantity]
    how = f"its unit is stated nowhere: taken as {unit}, a {column.quantity} by its name, of amplitude {size:.3g}"
    return unit, how


def _pair(
    motions: list[Column], force: Role | None, looks: Sequence[SignalShape]
) -> tuple[tuple[Column | None, ...], tuple[str, ...]]:
    """The motions in and out."""
    ins, outs = ([one for one in motions if one.side == side] for side in ("in", "out"))
    rest = [one for one in motions if not one.side]
    rest.sort(key=lambda one: (_ORDER.index(one.quantity), -one.likely, -_size(looks, one.name)))
    spare = ", ".join(shown(one.name, 30) for one in motions)
    several = (f"taken of several motions: {spare}",) if len(motions) > 2 else ()
    if ins and outs:
        return _best_pair(ins, outs), several
    if ins or outs:
        other = rest[0] if rest else None
        pair = (ins[0], other) if ins else (other, outs[0])
        if pair[0] is None:
            return (outs[0],), ("by its name it is at the far side, but no other motion is there",)
        how = f"the other one of {spare}, for its name does not say where it was" if other else ""
        return pair, (*several, *([how] if how else []))
    if len(rest) < 2:
        return (rest[0] if rest else None,), ()
    alike = next((one for one in rest[1:] if one.quantity == rest[0].quantity), rest[1])
    return _by_power(rest[0], alike, force, looks, several)


def _best_pair(ins: list[Column], outs: list[Column]) -> tuple[Column, Column]:
    """In and out that recorded the same quantity, if there are any."""
    pairs = [(a, b) for a in ins for b in outs]
    return min(pairs, key=lambda pair: (pair[0].quantity != pair[1].quantity, _ORDER.index(pair[0].quantity)))


def _by_power(
    a: Column, b: Column, force: Role | None, looks: Sequence[SignalShape], several: tuple[str, ...]
) -> tuple[tuple[Column, Column], tuple[str, ...]]:
    """The motion through which power enters is V1: beyond the tyre there are but mass and spring."""
    names = f"{shown(a.name, 30)} and {shown(b.name, 30)}"
    if force is None or not looks:
        return (a, b), (
            *several,
            f"{names} do not say which is at the contact: the first is taken as V1",
        )
    shares = [[abs(_cosine(look, force, one)) for look in looks] for one in (a, b)]
    mine, theirs = (float(np.median(share)) for share in shares)
    pair = (a, b) if mine >= theirs else (b, a)
    sure = max(mine, theirs) > 2 * min(mine, theirs)
    how = f"{names} do not say which is at the contact: V1 is {shown(pair[0].name, 30)}, through which power enters"
    return pair, (*several, how if sure else f"{how}, but hardly more than through the other")


def _cosine(look: SignalShape, force: Role, column: Column) -> float:
    """Power over apparent power of a force and a motion."""
    f, v = look.amplitudes.get(force.column, 0j), look.amplitudes.get(column.name, 0j) * 1j ** _TURNS[column.quantity]
    return (f * v.conjugate()).real / (abs(f) * abs(v)) if f and v else 0.0


def _signs(roles: dict[str, Role], looks: Sequence[SignalShape]) -> dict[str, Role]:
    """Turn the one sensor whose sign makes no tyre passive, if there is exactly one."""
    if len(roles) < 3 or not looks or any(role.unit is None for role in roles.values()):
        return roles
    phasors = np.array(
        [[_velocity(look, roles[role]) for role in ("force_in", "motion_in", "motion_out")] for look in looks]
    )
    omega = 2 * np.pi * np.array([look.frequency for look in looks])
    ways = {"": (1, 1, 1), "motion_out": (1, 1, -1), "force_in": (-1, 1, 1), "motion_in": (1, -1, 1)}
    good = {name: _passive(phasors * np.array(way), omega) for name, way in ways.items()}
    best = max(good, key=lambda name: good[name])
    if not best or good[""] > 0.5 or good[best] < _MOST:
        if good[""] <= 0.5 and good[best] < _MOST:
            doubt = (
                "with F1, V1 and V2 as they are, most tests show no tyre (a stiffness below zero): check "
                "columns and signs"
            )
            return {**roles, "force_in": roles["force_in"].doubted(doubt)}
        return roles
    what = "V1" if best == "motion_in" else "V2" if best == "motion_out" else "F1"
    doubt = (
        f"its sign is turned: only so the tyre's stiffness and loss are positive (or {what} and another one are meant)"
    )
    return {**roles, best: replace(roles[best], invert=True, doubts=(*roles[best].doubts, doubt))}


def _velocity(look: SignalShape, role: Role) -> complex:
    """Amplitude of a force, or of the velocity of a motion, in recorded units."""
    amplitude = look.amplitudes.get(role.column, complex(float("nan")))
    scale = 1.0 if role.unit is None else units.channel_scale(role.unit, (role.quantity,))[1]
    return amplitude * scale * (2j * np.pi * look.frequency) ** _TURNS.get(role.quantity, 0)


def _passive(phasors: np.ndarray, omega: np.ndarray) -> float:  # type: ignore[type-arg]
    """Share of the tests whose stiffness and loss are positive by the relative route."""
    with np.errstate(all="ignore"):
        stiffness = 1j * omega * phasors[:, 0] / (phasors[:, 1] - phasors[:, 2])
    return float(np.mean((stiffness.real > 0) & (stiffness.imag > 0)))


def force_scale(
    roles: dict[str, Role], looks: Sequence[SignalShape], static: dict[str, Role], curves: Sequence[SignalShape]
) -> float:
    """|K*| by the relative route over the slope of the static curves: some 1 to 3 where the units are right."""
    looks = [look for look in looks if look.kind == "dynamic" and np.isfinite(look.frequency)]
    if not {"force_in", "motion_in", "motion_out"} <= roles.keys() or len(static) < 2 or not looks or not curves:
        return float("nan")
    parts = np.array(
        [[_velocity(look, roles[role]) for role in ("force_in", "motion_in", "motion_out")] for look in looks]
    )
    omega = 2 * np.pi * np.array([look.frequency for look in looks])
    with np.errstate(all="ignore"):
        stiffness = np.median(np.abs(omega * parts[:, 0] / (parts[:, 1] - parts[:, 2])))
        slopes = [_span_si(look, static["load"]) / _span_si(look, static["deflection"]) for look in curves]
        return float(stiffness / np.median(slopes))


def _span_si(look: SignalShape, role: Role) -> float:
    return _span(look, role.column) * (
        1.0 if role.unit is None else units.channel_scale(role.unit, (role.quantity,))[1]
    )
