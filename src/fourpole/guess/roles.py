"""The columns of the roles of recordings: the assignment with the largest sum of evidence.

Unit, name, signal and physics of a column each give log-odds, by `channels.weights` of vocabulary.toml. The sums of all
assignments are compared; another assignment less than `margin` below the best is a doubt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from fourpole import units
from fourpole.core.arrays import FloatArray
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.recording import DERIVATIVES
from fourpole.core.routes import relative_route
from fourpole.guess.signals import SignalShape
from fourpole.units import MOTIONS, shown
from fourpole.words import vocabulary
from fourpole.words.heads import Column, Role, is_command, kind_of_unit

_W: dict[str, float] = vocabulary()["channels"]["weights"]
#: Quantities of motion, the most suitable first: beside another motion, and alone.
_ORDER = ("velocity", "acceleration", "displacement")
_ALONE = ("displacement", "velocity", "acceleration")
#: Units of columns that state none: from a size of the recorded numbers on, below it, and this size.
_STATIC_UNITS = {"force": ("N", "kN", 100.0), "displacement": ("mm", "m", 0.5)}
_DYNAMIC_UNITS = {
    "force": ("N", "kN", 1.0),
    "velocity": ("mm/s", "m/s", 3.0),
    "acceleration": ("m/s^2", "m/s^2", 0.0),
    "displacement": ("mm", "m", 0.02),
}
#: Share of the tests that must be passive with a channel inverted, or it is not inverted [1].
_MOST = 0.9
#: Likely range of |K*| over the static stiffness.
_LIKELY = (0.3, 12.0)
#: Relative difference of two velocities up to which they are of one point [1].
_TWIN = 0.05
#: Logarithm of the range of frequencies from which a ratio is known to be constant, and least ratio of one part [1].
_OCTAVES, _PART = 1.0, 0.5
#: Logarithm of the range of frequencies from which |K*| has an exponent, and largest exponent of a specimen [1].
_APART, _STEEP = 0.1, 0.5
#: Forces and motions with the largest sums of their own, whose assignments are compared.
_FORCES, _COMPARED = 4, 8
#: Smallest share of sinusoid that counts [1], and largest logarithms and exponents.
_LEAST, _CAPPED = 0.05, 3.0
#: Correlation of load and deflection from which its sign is that of the slope [1].
_TELLING = 0.5
#: Share of the samples at the ends of the range from which a channel is clipped [1]; a sinusoid has far less.
_CLIPPED = 0.15


# --- static tests ------------------------------------------------------------------------------------------------


def static_roles(columns: Sequence[Column], shapes: Sequence[SignalShape]) -> dict[str, Role]:
    """Roles of load and deflection in the static tests."""
    of = {kind: [column for column in columns if column.quantity == kind] for kind in ("force", "displacement")}
    by_loop = not all(of.values())
    if by_loop:
        unknown = [column for column in columns if column.quantity in ("", "voltage")]
        unknown = [column for column in unknown if any(shape.span(column.name) > 0 for shape in shapes)]
        few = len(unknown) == (1 if any(of.values()) else 2)
        of = {kind: found or (unknown if few else []) for kind, found in of.items()}
    spans = {kind: [_span(one, kind, shapes) for one in several] for kind, several in of.items()}
    scored: list[tuple[float, tuple[Column | None, ...]]] = []
    for pair in product(*map(_or_none, of.values())):
        score = _loop(pair[0], pair[1], shapes)[0 if by_loop else 1] * _W["curve"]
        for kind, column in zip(of, pair, strict=True):
            if column is not None:
                at, most = of[kind].index(column), max(spans[kind]) or 1.0
                score += _by_head(column, at) + _W["travel"] * _log(spans[kind][at] / most)
        scored.append((score if pair[0] is not pair[1] else -np.inf, pair))
    load, deflection = max(scored, key=lambda one: one[0])[1]
    turned = _turned(load, deflection, shapes)
    loop = "known by its loop alone (loading lies above unloading): check that it is the right column"
    found: dict[str, Role] = {}
    for at, (role, kind, column) in enumerate(zip(("load", "deflection"), of, (load, deflection), strict=True)):
        if column is not None:
            largest = _largest(column, shapes)
            why, example = f"for it reaches {_plain(largest)}", '"4 mV/N" or "0.2 V/mm"'
            unit, doubt = _unit(column, _STATIC_UNITS[kind], largest, why, example)
            by = loop if by_loop and column.quantity != kind else ""
            doubts = tuple(filter(None, (by, doubt, _several(_near_best(scored, at)), turned[at])))
            found[role] = Role(role, column.name, unit, kind, bool(turned[at]), doubts)
    return found


def _or_none(columns: Sequence[Column]) -> list[Column | None]:
    """The columns that may have a role; None alone if there are none."""
    return [*columns] if columns else [None]


def _ends(column: Column, shapes: Sequence[SignalShape]) -> tuple[float, float]:
    """Least and largest value of a column in all tests, in recorded units."""
    ranges = [shape.ranges[column.name] for shape in shapes if column.name in shape.ranges] or [(0.0, 0.0)]
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def _largest(column: Column, shapes: Sequence[SignalShape]) -> float:
    """Largest modulus of a column in any of the tests, in recorded units."""
    return max(map(abs, _ends(column, shapes)))


def _span(column: Column, kind: str, shapes: Sequence[SignalShape]) -> float:
    """Largest span of a column in any of the tests [SI, or volts]."""
    unit, _ = _unit(column, _STATIC_UNITS[kind], _largest(column, shapes))
    span = max((float(shape.span(column.name)) for shape in shapes), default=0.0)
    return span * channel_scale(Role("", column.name, unit, kind))


def _log(share: float) -> float:
    """Logarithm of a share to a tenth; the smallest share that counts is `_LEAST`."""
    return round(float(np.log(max(share, _LEAST))), 1)


def _loop(load: Column | None, deflection: Column | None, shapes: Sequence[SignalShape]) -> tuple[float, float, float]:
    """Sign of the work that a load does in its loops; modulus and value of the median correlation with a deflection."""
    work, slopes = 0.0, [0.0]
    for shape in shapes:
        y, x = (shape.samples.get(one.name if one else "", np.zeros(0)) for one in (load, deflection))
        if y.size == x.size > 2 and np.ptp(y) > 0 and np.ptp(x) > 0:
            work += float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x)) / (np.ptp(x) * np.ptp(y)))
            slopes.append(float(np.corrcoef(x, y)[0, 1]))
    slope = float(np.median(slopes[1:] or slopes))
    return float(np.sign(work)), abs(slope), slope


def _turned(load: Column | None, deflection: Column | None, shapes: Sequence[SignalShape]) -> tuple[str, str]:
    """Why load and deflection are inverted, empty if they are not: the load is positive, and grows with deflection."""
    negative = "mostly negative, so its sign is turned: load and deflection are positive in compression"
    falling = "its sign is turned: only so the load grows with it"
    slope = _loop(load, deflection, shapes)[2]
    ends = [(0.0, 0.0) if one is None else _ends(one, shapes) for one in (load, deflection)]
    first, second = (-low > 2 * abs(high) for low, high in ends)
    inverted = second if abs(slope) < _TELLING else first == (slope > 0)
    return (negative if first else ""), ("" if not inverted else negative if second else falling)


def _unit(
    column: Column, usual: tuple[str, str, float], size: float, why: str = "", example: str = ""
) -> tuple[str | None, str]:
    """Unit of a column, and the doubt on it; None where a sensitivity as in the `example` is needed."""
    stated = kind_of_unit(column.unit)
    if stated == "voltage":
        return None, f"recorded in volts: state its sensitivity, as sensitivity = {example}"
    if stated:
        return column.unit, ""
    large, small, limit = usual
    unit = large if size >= limit else small
    return unit, f"its unit is stated nowhere: taken as {unit}, {why}"


def _by_head(column: Column, place: int) -> float:
    """Evidence of the head of a column, and its place among others, that it is the main one of its quantity."""
    unit = _W["volts"] if column.in_volts else _W["unstated"] if column.unit is None else 0.0
    return unit + _W["likely"] * column.likely + _W["later"] * place


def _near_best(scored: Sequence[tuple[float, tuple[Column | None, ...]]], at: int) -> list[Column]:
    """Columns other than the best one of a role with nearly as much evidence, in the best assignment of each."""
    best, choice = max(scored, key=lambda one: one[0])
    near = [one[at] for score, one in scored if score > best - _W["margin"]]
    return [one for one in dict.fromkeys(near) if one is not None and one is not choice[at]]


def _several(others: Sequence[Column]) -> str:
    """A doubt that names the columns that were not taken; empty where there are none."""
    rest = [shown(other.name, 30) for other in others[:4]]
    return f"taken of several: {', '.join(rest)} could be it too" if rest else ""


# --- dynamic tests -----------------------------------------------------------------------------------------------

#: The columns of F1, V1 and V2; None for one that is not there.
_Choice = tuple[Column | None, Column | None, Column | None]


def dynamic_roles(columns: Sequence[Column], shapes: Sequence[SignalShape]) -> dict[str, Role]:
    """Roles of F1, V1 and V2 in the dynamic tests."""
    shapes = _sinusoids(shapes)
    forces = [column for column in columns if column.quantity == "force"]
    motions = [column for column in columns if column.quantity in MOTIONS]
    evidence = _Evidence([*forces, *motions], shapes)
    forces, motions = (
        sorted(several, key=lambda one: evidence.alone[one.name], reverse=True)[:most]
        for several, most in ((forces, _FORCES), (motions, _COMPARED))
    )
    choices = product(_or_none(forces), _or_none(motions), [*motions, None])
    scored = [(evidence.of_choice(*one), one) for one in choices if one[1] is not one[2] or one[1] is None]
    force, near, far = max(scored, key=lambda one: one[0])[1]
    found: dict[str, Role] = {}
    if force is not None:
        found["force_in"] = _dynamic_role("force_in", force, shapes, _several(_near_best(scored, 0)))
    doubts = [*_motion_doubts(scored, evidence), *_place_doubts(force, near, far, evidence, motions)]
    for role, column in (("motion_in", near), ("motion_out", far)):
        if column is not None:
            found[role] = _dynamic_role(role, column, shapes, *doubts)
    return _signs(found, shapes)


class _Evidence:
    """Log-odds of what dynamic recordings show of their columns, and of assignments of these."""

    def __init__(self, columns: Sequence[Column], shapes: Sequence[SignalShape]) -> None:
        self.omega = 2 * np.pi * np.array([shape.frequency for shape in shapes])
        roles = [_dynamic_role("", one, shapes) for one in columns]
        #: Columns of a known unit, or of one that their numbers suggest.
        self.known = {role.column for role in roles if role.unit is not None}
        #: Amplitudes of forces, and of the velocities of motions, in each test [SI, or the recorded unit].
        self.phasors = {role.column: phasors_of(role, shapes) for role in roles}
        names = [one.name for one in columns]
        spans = [[shape.span(name) or 1.0 for shape in shapes] or [1.0] for name in names]
        sizes = [[2 * abs(shape.amplitudes.get(name, 0.0)) for shape in shapes] or [1.0] for name in names]
        clean = [float(np.median(np.divide(*pair))) for pair in zip(sizes, spans, strict=True)]
        #: Evidence of each column alone: its head, how much of it is the sinusoid, and whether it is clipped.
        self.alone = {
            one.name: _by_head(one, at)
            + (_W["clean"] * _log(clean[at] / max(clean)) if clean[at] > 0 else _W["still"])
            + _W["clipped"] * any(_is_clipped(shape, one.name) for shape in shapes)
            for at, one in enumerate(columns)
        }

        whole = self._whole([one.name for one in columns if one.quantity == "force"])
        if whole:
            self.alone[whole] += _W["whole"]

    def _whole(self, forces: Sequence[str]) -> str:
        """The force that is the sum of all others, as of a plate on four cells; empty if none is."""
        every = sum((self.phasors[name] for name in forces), np.zeros(self.omega.size, dtype=complex))
        for name in forces if len(forces) > 2 and set(forces) <= self.known else ():
            with np.errstate(all="ignore"):
                share = every / self.phasors[name] - 2.0
            if share.size and np.isfinite(share).all() and np.max(np.abs(share)) < _TWIN:
                return name
        return ""

    def of_choice(self, force: Column | None, near: Column | None, far: Column | None) -> float:
        """Evidence that columns are F1, V1 and V2."""
        score = sum(self.alone[one.name] for one in (force, near, far) if one is not None)
        for one, side, other in ((near, "in", "out"), (far, "out", "in")):
            if one is not None:
                said = (one.side == side) - (one.side == other)
                score += _W["number" if one.by_number else "side"] * said
                score -= 0.1 * (_ALONE if far is None else _ORDER).index(one.quantity)
        if near is not None and far is not None:
            score += _W["second"] + _W["alike"] * (near.quantity == far.quantity)
            if self.is_twin(near, far):
                score += _W["twin"] / (2.0 if near.quantity == far.quantity else 1.0)
            if force is not None and force.side:
                score += _W[f"force_{force.side}"]
        return score if force is None or near is None else score + self._physics(force, near, far)

    def is_twin(self, a: Column, b: Column) -> bool:
        """Whether two motions are of one part: their velocities are equal, but perhaps for the sign.

        Those of a part that tilts, or of a fixed frame that gives way, have one real ratio at all frequencies, which no
        mass behind a specimen has.
        """
        if not {a.name, b.name} <= self.known:
            return False
        with np.errstate(all="ignore"):
            ratio = self.phasors[a.name] / self.phasors[b.name]
        used = np.isfinite(ratio)
        ratio = ratio[used]
        if not ratio.size:
            return False
        usual = float(np.median(ratio.real))
        wide = np.ptp(np.log(self.omega[used])) > _OCTAVES and ratio.size > 2
        likely = _PART < abs(usual) < 1.0 / _PART
        return any(
            np.max(np.abs(ratio / one - 1.0)) < _TWIN for one in (1.0, -1.0, *((usual,) if wide and likely else ()))
        )

    def power(self, force: Column, motion: Column) -> float:
        """Median of real over apparent power of a force and a motion, without sign [1]."""
        f, v = self.phasors[force.name], self.phasors[motion.name]
        with np.errstate(all="ignore"):
            found = np.abs((f * v.conjugate()).real) / (np.abs(f) * np.abs(v))
        return float(np.median(np.nan_to_num(found))) if found.size else 0.0

    def _physics(self, force: Column, near: Column, far: Column | None) -> float:
        """Evidence of power, which enters through V1; of passivity; and of |K*|, in which there is no mass."""
        if not self.omega.size:
            return 0.0
        score = 0.0
        if far is not None:
            ratio = (self.power(force, near) + 1e-3) / (self.power(force, far) + 1e-3)
            score += _W["power"] * float(np.clip(np.log(ratio), -_CAPPED, _CAPPED))
        if not {one.name for one in (force, near, far) if one is not None} <= self.known:
            return score
        f, v1 = self.phasors[force.name], self.phasors[near.name]
        v2 = np.zeros_like(v1) if far is None else self.phasors[far.name]
        found = []
        for v, cost in ((v1 - v2, 0.0), (v1 + v2, _W["inverted"])):
            with np.errstate(all="ignore"):
                k = 1j * self.omega * f / v
            k = np.where(np.isfinite(k), k, np.nan)
            for sign in (1, -1):
                share = _passive(sign * k) if far is not None else float(np.mean(sign * k.imag > 0))
                turned = cost if sign > 0 else min(cost, _W["inverted"])
                found.append(_W["passive"] * (2 * share - 1) + turned + _W["slope"] * self._slope(np.abs(k)))
        return score + max(found)

    def _slope(self, modulus: FloatArray) -> float:
        """Exponent by which |K*| falls with frequency, or rises beyond that of a specimen [1]: it has a mass in it."""
        usable = np.isfinite(modulus) & (modulus > 0)
        x, y = np.log(self.omega[usable]), np.log(modulus[usable])
        if x.size < 2 or np.ptp(x) < _APART:
            return 0.0
        exponent = float(np.polyfit(x, y, 1)[0])
        return min(max(-exponent, exponent - _STEEP, 0.0), _CAPPED)


def _is_clipped(shape: SignalShape, name: str) -> bool:
    """Whether a good part of the samples of a channel lies at the ends of its range."""
    samples = shape.samples.get(name, np.zeros(0))
    return bool(samples.size) and float(np.mean((samples == samples.max()) | (samples == samples.min()))) > _CLIPPED


def _motion_doubts(scored: Sequence[tuple[float, _Choice]], evidence: _Evidence) -> list[str]:
    """A doubt that names the motions of which V1 and V2 were taken, if others of other points have nearly as much."""
    pair = [one for one in max(scored, key=lambda one: one[0])[1][1:] if one is not None]
    rivals = [
        one
        for one in dict.fromkeys([*_near_best(scored, 1), *_near_best(scored, 2)])
        if one not in pair and not any(one.quantity != of.quantity and evidence.is_twin(one, of) for of in pair)
    ]
    names = ", ".join(shown(one.name, 30) for one in [*pair, *rivals[:4]])
    return [f"taken of several motions: {names}"] if rivals else []


def _place_doubts(
    force: Column | None, near: Column | None, far: Column | None, evidence: _Evidence, motions: Sequence[Column]
) -> list[str]:
    """Doubts on which end of the specimen a motion is at, because names do not say it."""
    if near is None:
        return []
    if far is None:
        twins = [shown(one.name, 30) for one in motions if one is not near and evidence.is_twin(one, near)]
        alike = f"{', '.join(twins)} shows the motion of the same point, so it is not V2" if twins else ""
        alone = "by its name it is at the far side, but no other motion is there" if near.side == "out" else ""
        return list(filter(None, (alone, alike)))
    names = f"{shown(near.name, 30)}{{}}{shown(far.name, 30)}"
    if near.side or far.side:
        said = bool(near.side) and bool(far.side)
        return [] if said else [f"the other one of {names.format(', ')}, for its name does not say where it was"]
    first, second = sorted((near, far), key=motions.index)
    unsaid = f"{shown(first.name, 30)} and {shown(second.name, 30)} do not say which is at the contact"
    if force is None or not evidence.omega.size:
        return [f"{unsaid}: the first is taken as V1"]
    how = f"{unsaid}: V1 is {shown(near.name, 30)}, through which power enters"
    sure = evidence.power(force, near) > 2 * evidence.power(force, far)
    return [how if sure else f"{how}, but hardly more than through the other"]


def drive_role(tests: Sequence[Sequence[Column]], shapes: Sequence[SignalShape]) -> Role | None:
    """The role of the command signal that all random tests and sweeps have recorded; None without such a column."""
    shared = set.intersection(*({one.name for one in columns} for columns in tests)) if tests else set()
    drives = [one for columns in tests[:1] for one in columns if one.quantity == "drive" and one.name in shared]
    moving = [one for one in drives if any(shape.span(one.name) > 0 for shape in shapes)]
    if not moving:
        return None
    best = max(moving, key=lambda one: (is_command(one.name), one.likely))
    word = "" if is_command(best.name) else "known by the word drive alone: check that it is the command signal"
    doubts = filter(None, (word, _several([one for one in moving if one is not best])))
    return Role("drive", best.name, best.unit, "drive", doubts=tuple(doubts))


def _sinusoids(shapes: Sequence[SignalShape]) -> list[SignalShape]:
    """The recordings whose strongest line shows the motion: those of a steady sinusoid, or else of many frequencies."""
    moving = [shape for shape in shapes if np.isfinite(shape.frequency)]
    steady = [shape for shape in moving if shape.kind == "dynamic"]
    return steady or [shape for shape in moving if shape.band is not None]


def _size(shapes: Sequence[SignalShape], name: str) -> float:
    """Median amplitude of a column, in recorded units."""
    return float(np.median([abs(shape.amplitudes.get(name, 0.0)) for shape in shapes])) if shapes else 0.0


def _dynamic_role(role: str, column: Column, shapes: Sequence[SignalShape], *doubts: str) -> Role:
    """The role of a column, with its unit and doubts."""
    size = _size(shapes, column.name)
    why = f"a {column.quantity} by its name, of amplitude {_plain(size)}"
    unit, doubt = _unit(column, _DYNAMIC_UNITS[column.quantity], size, why, '"98.3 mV/g" or "4 mV/N"')
    return Role(role, column.name, unit, column.quantity, doubts=tuple(filter(None, (*doubts, doubt))))


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
        f"(or {SYMBOLS[best]} and another one are meant)"
    )
    return {**roles, best: replace(roles[best], invert=True).doubted(doubt)}


def _stiffness(roles: dict[str, Role], shapes: Sequence[SignalShape]) -> np.ndarray:  # type: ignore[type-arg]
    """K* of each test by the relative route [N/m]."""
    force, near, far = (phasors_of(roles[role], shapes) for role in CHANNELS)
    omega = 2 * np.pi * np.array([shape.frequency for shape in shapes])
    with np.errstate(all="ignore"):
        return relative_route(force, near, far, omega)


def _passive(stiffness: np.ndarray) -> float:  # type: ignore[type-arg]
    """Share of the tests with positive stiffness and loss [1]."""
    return float(np.mean((stiffness.real > 0) & (stiffness.imag > 0)))


def phasors_of(role: Role, shapes: Sequence[SignalShape]) -> np.ndarray:  # type: ignore[type-arg]
    """Amplitudes in each test of a force [N], or of the velocity of a motion [m/s], with the sign of the role."""
    omega = 2j * np.pi * np.array([shape.frequency for shape in shapes])
    amplitudes = np.array([shape.amplitudes.get(role.column, complex("nan")) for shape in shapes], complex)
    return np.asarray(amplitudes * channel_scale(role) * omega ** DERIVATIVES[role.quantity])


def channel_scale(role: Role) -> float:
    """SI value of one recorded unit, with the sign of the role; 1 where the unit is not known."""
    scale = 1.0 if role.unit is None else units.channel_scale(role.unit, (role.quantity,))[1]
    return scale * (-1 if role.invert else 1)


def motion_share(near: Role, far: Role, shapes: Sequence[SignalShape]) -> float:
    """Median of V2 over V1 [1]; not-a-number where an amplitude is not known."""
    if near.unit is None or far.unit is None:
        return float("nan")
    shapes = _sinusoids(shapes)
    with np.errstate(all="ignore"):
        shares = np.abs(phasors_of(far, shapes) / phasors_of(near, shapes))
    return float(np.median(shares[np.isfinite(shares)])) if np.isfinite(shares).any() else float("nan")


def force_scale(
    roles: dict[str, Role], shapes: Sequence[SignalShape], static: dict[str, Role], curves: Sequence[SignalShape]
) -> float:
    """Median |K*| by the relative route over the slope of the static curves [1]: 1 to 3 if the units are right."""
    shapes = _sinusoids(shapes)
    if not SYMBOLS.keys() <= roles.keys() or len(static) < 2 or not shapes or not curves:
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
