"""The roles of the columns of recordings, found from their units, names and signals."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourpole import units
from fourpole.core.recording import DERIVATIVES
from fourpole.errors import UnitError
from fourpole.guess.signals import SignalShape
from fourpole.guess.words import COMMAND, IN, MAIN, MINOR, NAMES, NUMBERED, OUT
from fourpole.units import MOTIONS, shown

_KINDS = ("force", *MOTIONS, "voltage", "time", "pressure", "frequency", "angle")
#: Quantities of motion, the most suitable first.
_ORDER = ("velocity", "acceleration", "displacement")
_SPLIT = re.compile(r"[A-ZÄÖÜ]?[a-zäöüßà-ÿ]+|[A-ZÄÖÜ]+(?![a-zäöüßà-ÿ])|\d+")
#: Sides of a column of force, the likeliest last.
_SIDES = ("out", "", "in")
#: Units of columns that state none: from a size of the recorded numbers on, below it, and this size.
_STATIC_UNITS = {"force": ("N", "kN", 100.0), "displacement": ("mm", "m", 0.5)}
_DYNAMIC_UNITS = {
    "force": ("N", "kN", 1.0),
    "velocity": ("mm/s", "m/s", 3.0),
    "acceleration": ("m/s^2", "m/s^2", 0.0),
    "displacement": ("mm", "m", 0.02),
}
_MOTIONS = ("motion_in", "motion_out")
_SYMBOLS = {"force_in": "F1", "motion_in": "V1", "motion_out": "V2"}
#: Share of the tests that must be passive with a channel inverted, or it is not inverted [1].
_MOST = 0.9
#: Likely range of |K*| over the static stiffness.
_LIKELY = (0.3, 12.0)


@dataclass(frozen=True)
class Column:
    """Quantity and side of a column, as its name and unit state them.

    Attributes
    ----------
    name : str
    unit : str or None
    quantity : str
        Empty where neither name nor unit says it.
    side : str
        "in" at the contact, "out" at the moving mass; empty where the name does not say it.
    likely : int
        Number of words that say the column is the main one of its quantity, less those that say it is not.
    """

    name: str
    unit: str | None
    quantity: str
    side: str = ""
    likely: int = 0


@dataclass(frozen=True)
class Role:
    """The column of a role, with those `beside` it of one mean, the unit and sign of the numbers, and the doubts."""

    role: str
    column: str
    unit: str | None
    quantity: str
    invert: bool = False
    doubts: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()

    def doubted(self, doubt: str) -> Role:
        """The role with one more doubt."""
        return replace(self, doubts=(*self.doubts, doubt))


def column_of(name: str, unit: str | None) -> Column:
    """The quantity and the side of a column, by its unit and by the words of its name.

    Examples
    --------
    >>> column_of("Beschl_unten", "m/s2")
    Column(name='Beschl_unten', unit='m/s2', quantity='acceleration', side='in', likely=0)
    """
    words = name_words(name)
    named, stated = _named(words, name), _quantity(unit)
    aside = named in ("reference", "drive", "temperature", "pressure") and stated == "displacement"
    quantity = named if aside or stated in ("", "voltage") else stated
    if is_command(name) and not {named, stated} & {"temperature", "pressure", "frequency", "time"}:
        quantity = "drive"
    if NUMBERED & set(words):
        words = [word for word in words if not word.isdigit() and word not in ("input", "output")]
    sides = [side for side, known in (("in", IN), ("out", OUT)) if known & set(words)]
    return Column(name, unit, quantity, sides[0] if len(sides) == 1 else "", _likely(name_words(name)))


def name_words(name: str) -> list[str]:
    """The words of a name, without its unit, in small letters."""
    bare = units.column_unit(name)[0]
    found = [word.casefold() for word in _SPLIT.findall(bare)]
    return list(dict.fromkeys([*found, *filter(None, re.split(r"[\W_]+", bare.casefold()))]))


def _named(words: Sequence[str], name: str) -> str:
    """Quantity by the words of the name; a word of three letters or more counts before a shorter one."""
    if name.strip() == "T":
        return "temperature"
    hits = [
        (len(word) > 2, quantity)
        for quantity, known in NAMES.items()
        for word in words
        if word in known or _contains(word, known)
    ]
    if (True, "reference") in hits:
        return "reference"
    measured = {quantity for _, quantity in hits} & {"force", *MOTIONS}
    if (True, "drive") in hits and not measured:
        return "drive"
    return max((hit for hit in hits if hit[1] != "drive"), key=lambda hit: hit[0], default=(False, ""))[1]


def is_command(name: str) -> bool:
    """Whether a column is a command signal by its name, rather than a measured one.

    Examples
    --------
    >>> is_command("Sollweg [mm]"), is_command("変位指令"), is_command("Drive")
    (True, True, False)
    """
    return COMMAND.search(" ".join(name_words(name))) is not None


def _contains(word: str, known: frozenset[str]) -> bool:
    """Whether a word begins or ends with a known one of at least five letters."""
    return any(len(one) >= 5 and len(word) > len(one) and (word.startswith(one) or word.endswith(one)) for one in known)


def _quantity(unit: str | None) -> str:
    """Kind of quantity of a unit; empty where the unit is not known."""
    if unit is None or unit in ("1", "-"):
        return ""
    if unit.strip() in ("°C", "degC", "C", "K", "°F", "degF"):
        return "temperature"
    try:
        return units.channel_scale(unit, _KINDS)[0]
    except UnitError:
        return ""


def _likely(words: Sequence[str]) -> int:
    """Number of words that say the column is the main one of its quantity, less those that say it is not."""
    minor = [word for word in words if word in MINOR and (len(words) > 1 or len(word) > 1)]
    return sum(word in MAIN for word in words) - len(minor)


def static_roles(columns: Sequence[Column], shapes: Sequence[SignalShape]) -> dict[str, Role]:
    """Roles of load and deflection in the static tests."""
    of = {kind: [column for column in columns if column.quantity == kind] for kind in ("force", "displacement")}
    by_curve = not all(of.values())
    if by_curve:
        unknown = [column for column in columns if column.quantity in ("", "voltage")]
        moving = [column for column in unknown if any(shape.span(column.name) > 0 for shape in shapes)]
        of["force"], of["displacement"] = _by_curve(of["force"], of["displacement"], moving, shapes)
    return {
        role: _static_role(role, of[kind], kind, shapes, by_curve=by_curve)
        for role, kind in (("load", "force"), ("deflection", "displacement"))
        if of[kind]
    }


def _static_role(
    role: str, several: Sequence[Column], kind: str, shapes: Sequence[SignalShape], *, by_curve: bool
) -> Role:
    """The role of the likeliest of several columns, else of the one with the largest span."""
    spans = {one.name: max((shape.span(one.name) for shape in shapes), default=0.0) for one in several}
    column = max(several, key=lambda one: (not _in_volts(one), one.likely, spans[one.name]))
    ranges = [shape.ranges[column.name] for shape in shapes if column.name in shape.ranges] or [(0.0, 0.0)]
    low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
    largest = max(abs(low), abs(high))
    unit, doubt = _unit(
        column, _STATIC_UNITS[kind], largest, f"for it reaches {_plain(largest)}", '"4 mV/N" or "0.2 V/mm"'
    )
    loop = "known by its loop alone (loading lies above unloading): check that it is the right column"
    turned = "mostly negative, so its sign is turned: load and deflection are positive in compression"
    invert = -low > 2 * abs(high)
    doubts = (loop if by_curve and column.quantity != kind else "", doubt, _others(column, several))
    return Role(role, column.name, unit, kind, invert, tuple(filter(None, (*doubts, turned if invert else ""))))


def _unit(column: Column, usual: tuple[str, str, float], size: float, why: str, example: str) -> tuple[str | None, str]:
    """Unit of a column, and the doubt on it; None where a sensitivity as in the `example` is needed."""
    stated = _quantity(column.unit)
    if stated == "voltage":
        return None, f"recorded in volts: state its sensitivity, as sensitivity = {example}"
    if stated:
        return column.unit, ""
    large, small, limit = usual
    unit = large if size >= limit else small
    return unit, f"its unit is stated nowhere: taken as {unit}, {why}"


def _by_curve(
    forces: list[Column], travels: list[Column], unknown: list[Column], shapes: Sequence[SignalShape]
) -> tuple[list[Column], list[Column]]:
    """Columns of load and deflection by the sense of the loop, because a passive tyre absorbs work."""
    if len(unknown) == 1 and (forces or travels):
        return forces or unknown, travels or unknown
    if forces or travels or len(unknown) != 2:
        return forces, travels
    a, b = unknown
    work = [_work(shape, a.name, b.name) for shape in shapes]
    return ([a], [b]) if np.nansum(work) > 0 else ([b], [a])


def _work(shape: SignalShape, load: str, travel: str) -> float:
    """Area of the loop over that of the box around it [1]; it is positive if the first column is the load."""
    if load not in shape.samples or travel not in shape.samples:
        return 0.0
    y, x = shape.samples[load], shape.samples[travel]
    box = np.ptp(x) * np.ptp(y)
    return float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x)) / box) if box > 0 else 0.0


def _others(column: Column, several: Sequence[Column]) -> str:
    """A doubt that names the columns that were not taken; empty where there are none."""
    rest = [shown(other.name, 30) for other in several if other.name != column.name]
    return f"taken of several: {', '.join(rest[:4])} could be it too" if rest else ""


def dynamic_roles(columns: Sequence[Column], shapes: Sequence[SignalShape]) -> dict[str, Role]:
    """Roles of F1, V1 and V2 in the dynamic tests."""
    shapes = _sinusoids(shapes)
    found: dict[str, Role] = {}
    forces = [column for column in columns if column.quantity == "force"]
    if forces:
        best = max(
            forces,
            key=lambda one: (
                one.side != "out", not _in_volts(one), _SIDES.index(one.side), one.likely, _size(shapes, one.name)
            ),
        )  # fmt: skip
        found["force_in"] = _dynamic_role("force_in", best, shapes, _others(best, forces))
    motions = [column for column in columns if column.quantity in MOTIONS]
    pair, doubts = _pair(motions, found.get("force_in"), shapes)
    for role, column in zip(_MOTIONS, pair, strict=True):
        if column is not None:
            found[role] = _dynamic_role(role, column, shapes, *doubts)
    return _signs(found, shapes)


def drive_role(tests: Sequence[Sequence[Column]], shapes: Sequence[SignalShape]) -> Role | None:
    """The role of the command signal that all random tests and sweeps have recorded; None without such a column."""
    shared = set.intersection(*({one.name for one in columns} for columns in tests)) if tests else set()
    drives = [one for columns in tests[:1] for one in columns if one.quantity == "drive" and one.name in shared]
    moving = [one for one in drives if any(shape.span(one.name) > 0 for shape in shapes)]
    if not moving:
        return None
    best = max(moving, key=lambda one: (is_command(one.name), one.likely))
    word = "" if is_command(best.name) else "known by the word drive alone: check that it is the command signal"
    return Role("drive", best.name, best.unit, "drive", doubts=tuple(filter(None, (word, _others(best, moving)))))


def _sinusoids(shapes: Sequence[SignalShape]) -> list[SignalShape]:
    """The recordings whose strongest line shows the motion: those of a steady sinusoid, or else of many frequencies."""
    moving = [shape for shape in shapes if np.isfinite(shape.frequency)]
    steady = [shape for shape in moving if shape.kind == "dynamic"]
    return steady or [shape for shape in moving if shape.band is not None]


def _in_volts(column: Column) -> bool:
    """Whether a column has the unit of a voltage, so that its sensitivity would be needed."""
    return _quantity(column.unit) == "voltage"


def _size(shapes: Sequence[SignalShape], name: str) -> float:
    """Median amplitude of a column, in recorded units."""
    return float(np.median([abs(shape.amplitudes.get(name, 0.0)) for shape in shapes])) if shapes else 0.0


def _dynamic_role(role: str, column: Column, shapes: Sequence[SignalShape], *doubts: str) -> Role:
    """The role of a column, with its unit and doubts."""
    size = _size(shapes, column.name)
    why = f"a {column.quantity} by its name, of amplitude {_plain(size)}"
    unit, doubt = _unit(column, _DYNAMIC_UNITS[column.quantity], size, why, '"98.3 mV/g" or "4 mV/N"')
    return Role(role, column.name, unit, column.quantity, doubts=tuple(filter(None, (*doubts, doubt))))


#: The column of V1, that of V2, and the doubts on both; a column is None if it is not found.
_Pair = tuple[tuple[Column | None, Column | None], tuple[str, ...]]


def _pair(motions: list[Column], force: Role | None, shapes: Sequence[SignalShape]) -> _Pair:
    """The motions at the contact and at the moving mass, by their names or by the power that enters."""
    physical = [motion for motion in motions if not _in_volts(motion)]
    motions = physical if len(physical) > 1 else motions
    ins, outs, rest = _by_side(motions, shapes)
    listed = ", ".join(shown(motion.name, 30) for motion in motions)
    several = (f"taken of several motions: {listed}",) if len(motions) > 2 else ()
    if ins and outs:
        return _best_pair(ins, outs), several
    if (ins or outs) and rest:
        how = f"the other one of {listed}, for its name does not say where it was"
        return (ins[0], rest[0]) if ins else (rest[0], outs[0]), (*several, how)
    if len(rest) > 1:
        pair, how = _by_power(rest, force, shapes)
        return pair, (*several, how)
    far = ("by its name it is at the far side, but no other motion is there",) if outs else several
    return (motions[0] if motions else None, None), far


def _by_side(motions: list[Column], shapes: Sequence[SignalShape]) -> tuple[list[Column], list[Column], list[Column]]:
    """Motions at the contact, those at the moving mass, and those of unknown side with the likeliest first."""
    ins, outs, rest = ([one for one in motions if one.side == side] for side in ("in", "out", ""))
    for several in (ins, outs):
        several.sort(key=_in_volts)
    rest.sort(key=lambda one: (_in_volts(one), _ORDER.index(one.quantity), -one.likely, -_size(shapes, one.name)))
    return ins, outs, rest


def _best_pair(ins: list[Column], outs: list[Column]) -> tuple[Column, Column]:
    """One column of each side, if possible two of the same quantity."""
    pairs = [(a, b) for a in ins for b in outs]
    return min(
        pairs,
        key=lambda pair: (
            sum(map(_in_volts, pair)), pair[0].quantity != pair[1].quantity, _ORDER.index(pair[0].quantity)
        ),
    )  # fmt: skip


def _by_power(
    motions: Sequence[Column], force: Role | None, shapes: Sequence[SignalShape]
) -> tuple[tuple[Column, Column], str]:
    """V1, V2 and the doubt on them: power enters through V1, because only a mass and a spring follow the tyre.

    They are the likeliest motion, and the next one of the same quantity if there is one.
    """
    a, *others = motions
    b = next((other for other in others if other.quantity == a.quantity), others[0])
    unsaid = f"{shown(a.name, 30)} and {shown(b.name, 30)} do not say which is at the contact"
    if force is None or not shapes:
        return (a, b), f"{unsaid}: the first is taken as V1"
    of_a, of_b = (float(np.median([abs(_cosine(shape, force, motion)) for shape in shapes])) for motion in (a, b))
    pair = (a, b) if of_a >= of_b else (b, a)
    how = f"{unsaid}: V1 is {shown(pair[0].name, 30)}, through which power enters"
    sure = max(of_a, of_b) > 2 * min(of_a, of_b)
    return pair, how if sure else f"{how}, but hardly more than through the other"


def _cosine(shape: SignalShape, force: Role, column: Column) -> float:
    """Real over apparent power of a force and a motion [1]."""
    f = shape.amplitudes.get(force.column, 0j)
    v = shape.amplitudes.get(column.name, 0j) * 1j ** DERIVATIVES[column.quantity]
    return (f * v.conjugate()).real / (abs(f) * abs(v)) if f and v else 0.0


def _signs(roles: dict[str, Role], shapes: Sequence[SignalShape]) -> dict[str, Role]:
    """The roles with one sensor inverted, if only then most tests have a passive tyre."""
    if len(roles) < 3 or not shapes or any(role.unit is None for role in roles.values()):
        return roles
    shares = {"": _passive(_stiffness(roles, shapes))}
    if shares[""] > 0.5:
        return roles
    for name in ("motion_out", "force_in", "motion_in"):
        turned = replace(roles[name], invert=True)
        shares[name] = _passive(_stiffness({**roles, name: turned}, shapes))
    best = max(shares, key=lambda name: shares[name])
    if shares[best] < _MOST:
        doubt = "with F1, V1 and V2 as they are, K* is below zero in most tests: check columns and signs"
        return {**roles, "force_in": roles["force_in"].doubted(doubt)}
    doubt = (
        "its sign is turned: only so the specimen's stiffness and loss are positive "
        f"(or {_SYMBOLS[best]} and another one are meant)"
    )
    return {**roles, best: replace(roles[best], invert=True).doubted(doubt)}


def _stiffness(roles: dict[str, Role], shapes: Sequence[SignalShape]) -> np.ndarray:  # type: ignore[type-arg]
    """K* of each test by the relative route [N/m]."""
    phasors = np.array([[velocity(shape, roles[role]) for role in _SYMBOLS] for shape in shapes])
    omega = 2 * np.pi * np.array([shape.frequency for shape in shapes])
    with np.errstate(all="ignore"):
        return np.asarray(1j * omega * phasors[:, 0] / (phasors[:, 1] - phasors[:, 2]))


def _passive(stiffness: np.ndarray) -> float:  # type: ignore[type-arg]
    """Share of the tests with positive stiffness and loss [1]."""
    return float(np.mean((stiffness.real > 0) & (stiffness.imag > 0)))


def velocity(shape: SignalShape, role: Role) -> complex:
    """Amplitude of a force [N], or of the velocity of a motion [m/s], with the sign of the role."""
    amplitude = shape.amplitudes.get(role.column, complex(float("nan")))
    turn = (2j * np.pi * shape.frequency) ** DERIVATIVES[role.quantity]
    return complex(amplitude * channel_scale(role) * turn)


def channel_scale(role: Role) -> float:
    """SI value of one recorded unit, with the sign of the role; 1 where the unit is not known."""
    scale = 1.0 if role.unit is None else units.channel_scale(role.unit, (role.quantity,))[1]
    return scale * (-1 if role.invert else 1)


def motion_share(near: Role, far: Role, shapes: Sequence[SignalShape]) -> float:
    """Median of V2 over V1 [1]; not-a-number where an amplitude is not known."""
    if near.unit is None or far.unit is None:
        return float("nan")
    shares = [abs(velocity(shape, far)) / size for shape in _sinusoids(shapes) if (size := abs(velocity(shape, near)))]
    return float(np.median(shares)) if shares else float("nan")


def force_scale(
    roles: dict[str, Role], shapes: Sequence[SignalShape], static: dict[str, Role], curves: Sequence[SignalShape]
) -> float:
    """Median |K*| by the relative route over the slope of the static curves [1]: 1 to 3 if the units are right."""
    shapes = _sinusoids(shapes)
    if not _SYMBOLS.keys() <= roles.keys() or len(static) < 2 or not shapes or not curves:
        return float("nan")
    load, deflection = static["load"], static["deflection"]
    scale = abs(channel_scale(load) / channel_scale(deflection))
    with np.errstate(all="ignore"):
        spans = np.array([[curve.span(load.column), curve.span(deflection.column)] for curve in curves])
        slope = scale * np.median(spans[:, 0] / spans[:, 1])
        return float(np.median(np.abs(_stiffness(roles, shapes))) / slope)


def _plain(value: float) -> str:
    """A number to three significant digits, without an exponent below ten millions."""
    return f"{value:.3g}" if value < 1000 or value >= 1e7 else f"{float(f'{value:.3g}'):.0f}"


def checked_force(force: Role, ratio: float) -> Role:
    """F1 with the unit that fits, and with doubts; `ratio` is |K*| over the static stiffness with the present unit."""
    unstated = any("stated nowhere" in doubt for doubt in force.doubts)
    low, high = _LIKELY
    if low < ratio < high:
        fits = f", and it fits: K* is {ratio:.2g} times the static stiffness"
        return replace(
            force, doubts=tuple(doubt + fits if "stated nowhere" in doubt else doubt for doubt in force.doubts)
        )
    unit, factor = {"N": ("kN", 1e3), "kN": ("N", 1e-3)}.get(force.unit or "", ("", 1.0))
    if unstated and low < ratio * factor < high:
        with_it = f"with which K* is {ratio * factor:.2g} times the static stiffness"
        return replace(force, unit=unit, doubts=(f"its unit is stated nowhere: taken as {unit}, {with_it}",))
    return force.doubted(
        f"with these units K* is {ratio:.2g} times the static stiffness: check the units of all channels"
    )
