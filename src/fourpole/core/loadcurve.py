r"""LoadCurve: a load-deflection record becomes the static stiffness K1 at a load.

K1 is the tangent, at the load, of the mean of the loading and unloading branches at equal deflection, over the
last complete cycle. Both branches are fitted at once,

.. math:: F = P(x) + s\,H(x), \qquad s = +1 \text{ loading}, -1 \text{ unloading},

so that P is the mean and H half the gap at equal deflection, whatever the deflections that each branch sampled.
The orders of P and H and the memory of the residuals, along the record, are those of least BIC. The tangent is taken
from the part of the cycle round the load that gives it best. The fit reproduces data that are an exact polynomial.
Points in no order, as of a load that steps at random, are fitted as one curve. A stepped record is fitted through the
means of its rests (`meancurve`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, FloatArray
from fourpole.core.branches import Branches, in_contact, split_branches
from fourpole.core.checks import CURVE_DOUBTS
from fourpole.core.meancurve import Local, MeanCurve, Pairs, deflection_at, fit_curve, in_part, off_the_curve, surest
from fourpole.errors import LoadCurveError, Message

_FEWEST_POINTS = 5
#: A curve reaches zero load if its least load is below this share of its span.
_ZERO = 0.005
#: A load is clipped if it has its largest value over more than this share of the deflection, at more than this many
#: points.
_FLAT_TOP, _FEWEST_AT_TOP = 0.03, 4
#: The zero of the load is off if the load before contact is beyond this share of the span, that below which a load
#: counts as none.
ZERO_OFF = 0.01
#: The load creeps if it changes from the second to the last cycle by more than this share of its span.
_CREEP = 0.01
#: Standard deviation of a uniform distribution over its width (JCGM 100:2008, 4.3.7).
_UNIFORM = 1.0 / np.sqrt(12.0)


@dataclass(frozen=True)
class Tangent:
    """Static stiffness K1 at a load, with the contributions to its standard uncertainty.

    Attributes
    ----------
    load : float [N]
        Load at which K1 was evaluated.
    deflection : float [m]
        Deflection at this load, from the zero of the record.
    stiffness : float [N/m]
        K1.
    fit : float [N/m]
        Standard uncertainty from the fit and from the choice of its orders.
    cycles : float [N/m]
        Change from the last but one to the last complete cycle, over the square root of 12.
    zero : float [N/m]
        Standard uncertainty from the zero of the load and its drift.
    by_load : float [1/m]
        dK1/dF, which turns an error of the load into one of K1.
    loading, unloading : float [N/m]
        Tangents of the two branches at `deflection`; not-a-number for a branch that was not measured.
    gap : float [N]
        Load of the loading branch less that of the unloading branch at `deflection`; not-a-number without both.
    """

    load: float
    deflection: float
    stiffness: float
    fit: float
    cycles: float
    zero: float
    by_load: float
    loading: float = float("nan")
    unloading: float = float("nan")
    gap: float = float("nan")

    @property
    def std(self) -> float:
        """Standard uncertainty of K1 without the contributions of the channels' gains and linearity [N/m]."""
        return float(np.sqrt(self.fit**2 + self.cycles**2 + self.zero**2))

    def std_with_gains(self, load_gain: float, deflection_gain: float) -> float:
        """Standard uncertainty of K1 with relative standard uncertainties of the two gains [N/m]."""
        by_load_gain = self.stiffness - self.load * self.by_load
        return float(np.hypot(self.std, np.hypot(by_load_gain * load_gain, self.stiffness * deflection_gain)))

    def std_by_linearity(self, load: float, deflection: float) -> float:
        r"""Standard uncertainty of K1 from the departure of load and deflection from a straight line [N/m].

        .. math:: u = K_1 \pi \sqrt{\epsilon_F^2 + \epsilon_x^2}

        `load` and `deflection` are the standard uncertainties of the departures over the ranges of the sensors [1]. A
        departure is assumed smooth, and zero at both ends of the range R: a sin(pi s/R) at the reading s. Anywhere in
        the range it has the standard deviation a/sqrt(2), and its slope has pi a/(sqrt(2) R). A parabola gives sqrt(10)
        in place of pi. The part of the range that a test uses has no effect. The law of propagation is that of JCGM
        100:2008, 5.1.2; the shape is an assumption of ours.

        Examples
        --------
        >>> round(Tangent(1000.0, 8e-3, 120e3, 0.0, 0.0, 0.0, 0.0).std_by_linearity(1e-3, 0.0), 1)
        377.0
        """
        return float(self.stiffness * np.pi * np.hypot(load, deflection))


@dataclass(frozen=True)
class Secant:
    """Load over deflection from the point of zero load [N/m]; not-a-number, with the reason, without such a point."""

    stiffness: float
    reason: str = ""


@dataclass(frozen=True, eq=False)
class LoadCurve(ByValue):
    """Load against deflection, positive in compression, in the order in which it was recorded.

    Parameters
    ----------
    deflection : (N,) float array [m]
        Deflection from any zero.
    load : (N,) float array [N]
        Load; points with a missing value are removed.
    time : (N,) float array [s], optional
        Time of the points, for the duration of a branch.

    Raises
    ------
    LoadCurveError
        If there are fewer than 5 points, if load or deflection do not change, or if one falls as the other rises.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, section 4.1; SAE J2704 for the test alone.

    Examples
    --------
    >>> x = np.linspace(0.0, 0.03, 31)
    >>> curve = LoadCurve(x, 150e3 * x + 1e6 * x**2)
    >>> round(curve.tangent(2000.0).stiffness)
    174642
    >>> curve.tangent(9000.0)
    Traceback (most recent call last):
    ...
    fourpole.errors.LoadCurveError: 9000 N lies outside the measured loads, 0 to 5400 N: no extrapolation
    """

    deflection: FloatArray
    load: FloatArray
    time: FloatArray | None = None
    missing: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        x, f = np.asarray(self.deflection, dtype=float), np.asarray(self.load, dtype=float)
        there = np.isfinite(x) & np.isfinite(f)
        x, f = x[there], f[there]
        if self.time is not None:
            object.__setattr__(self, "time", np.asarray(self.time, dtype=float)[there])
        object.__setattr__(self, "deflection", x)
        object.__setattr__(self, "load", f)
        object.__setattr__(self, "missing", 1.0 - float(np.mean(there)) if there.size else 0.0)
        if x.size < _FEWEST_POINTS:
            raise LoadCurveError(f"the curve has {x.size} points, at least {_FEWEST_POINTS} are needed")
        if np.ptp(x) <= 1e-12 * np.max(np.abs(x)) or np.ptp(f) <= 1e-12 * np.max(np.abs(f)):
            raise LoadCurveError("load or deflection does not change: a sensor was off, or another column is meant")
        if np.corrcoef(x, f)[0, 1] <= 0:
            raise LoadCurveError(
                "the load falls as the deflection grows: one of the channels is inverted (state invert = true)"
            )

    @cached_property
    def branches(self) -> Branches:
        """Loading and unloading branches, in the order recorded."""
        return split_branches(self.deflection, self.load)

    @property
    def cycles(self) -> int:
        """Complete cycles; 0 for a single branch."""
        return len(self.branches.cycles)

    @property
    def measured(self) -> str:
        """What the tangent is of: "mean" of both branches, "loading", "unloading", or "points" in no order."""
        return self.branches.measured

    @property
    def times(self) -> tuple[float, ...]:
        """Duration of the branches in use, in the order recorded [s]; empty if the times are unknown."""
        if self.time is None or not self.branches.ordered:
            return ()
        used = self.branches.cycles[-1] if self.cycles else (0,)
        ends = [self.branches.ends[i] for i in used]
        return tuple(float(self.time[last] - self.time[first]) for first, last in ends)

    @property
    def _last(self) -> MeanCurve:
        """The mean curve of the last complete cycle."""
        return self._fitted[0]

    @cached_property
    def _fitted(self) -> tuple[MeanCurve, Pairs, BoolArray]:
        """Mean curve of the last complete cycle, the points that it uses, and which of all in contact these are."""
        return self._fit(-1)

    def _fit(self, cycle: int, *, alone: bool = False) -> tuple[MeanCurve, Pairs, BoolArray]:
        """Mean curve of a cycle without its outliers, the points that it uses, and which of those in contact."""
        points = self._cycle(cycle)
        curve = fit_curve(*points, alone=alone)
        used = ~off_the_curve(curve, points.load)
        if not used.all():
            points = points.part(used)
            curve = fit_curve(*points, alone=alone)
        return curve, points, used

    def _cycle(self, cycle: int) -> Pairs:
        """Those points of a cycle at which the specimen is in contact."""
        x, f, side = self.branches.of_cycle(cycle, self.deflection, self.load)
        return Pairs(x, f, side).part(in_contact(x, f))

    @cached_property
    def outliers(self) -> int:
        """Number of outliers in the last cycle, which the fit leaves out."""
        x = self._cycle(-1).deflection
        # The turns are not counted: they belong to both branches, and friction separates the branches there.
        inside = (x > x.min()) & (x < x.max())
        return int((inside & ~self._fitted[2]).sum())

    @cached_property
    def _last_but_one(self) -> tuple[MeanCurve, Pairs, BoolArray] | None:
        """The cycle before the last, as `_fitted`; None if it is the first, which conditions the rubber."""
        return self._fit(-2, alone=True) if self.cycles > 2 else None

    @property
    def order(self) -> int:
        """Order of the mean curve's polynomial."""
        return self._last.order

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the quality of the curve, for the reader of the result."""
        return tuple(map(str, self.doubts))

    @property
    def doubts(self) -> tuple[Message, ...]:
        """What is doubtful in the curve."""
        low, high = self.measured_loads
        creep = float(np.sum(self._shifts))
        sizes = {
            "one cycle": self.cycles == 1,
            "missing points": self.missing,
            "outliers": self.outliers,
            "creep": creep if abs(creep) > _CREEP * (high - low) else 0.0,
            "clipped": self.flat_top if self.flat_top > _FLAT_TOP else 0.0,
        }
        return tuple(
            Message(code, "", CURVE_DOUBTS[code].format(size, 100 * size)) for code, size in sizes.items() if size
        )

    @cached_property
    def flat_top(self) -> float:
        """Share of the deflection over which the load has its largest value, as with a clipped load cell [1]."""
        x, f, _ = self.branches.of_cycle(-1, self.deflection, self.load)
        top = x[f >= f.max() - 1e-9 * np.ptp(f)]
        return float(np.ptp(top) / np.ptp(x)) if top.size > _FEWEST_AT_TOP else 0.0

    @cached_property
    def measured_loads(self) -> tuple[float, float]:
        """Least and largest load of the last complete cycle [N]."""
        _, f, _ = self.branches.of_cycle(-1, self.deflection, self.load)
        return float(f.min()), float(f.max())

    def _deflection_at(self, curve: MeanCurve, load: float) -> float:
        """Deflection [m] on a mean curve at a measured load [N]."""
        low, high = self.measured_loads
        slack = 1e-9 * (high - low)
        if not low - slack <= load <= high + slack:
            raise LoadCurveError(f"{load:g} N lies outside the measured loads, {low:g} to {high:g} N: no extrapolation")
        return deflection_at(curve, load)

    def tangent(self, load: float) -> Tangent:
        r"""Static stiffness K1 at a load, :math:`K_1 = P'(x_0)` with :math:`P(x_0)` the load.

        Parameters
        ----------
        load : float [N]
            Within the measured loads of the last complete cycle.

        Returns
        -------
        Tangent
            K1 and the contributions to its uncertainty.

        Raises
        ------
        LoadCurveError
            If the load lies outside the measured loads, or the curve does not rise there.

        Examples
        --------
        >>> x = np.linspace(0.0, 0.03, 31)
        >>> round(LoadCurve(x, 150e3 * x).tangent(2000.0).stiffness, 3)
        150000.0
        """
        last, points, _ = self._fitted
        near = surest(points, last, self._deflection_at(last, load), load)
        curve, place, stiffness = near.curve, near.place, near.slope
        if not stiffness > 0:
            raise LoadCurveError(
                f"the curve does not rise at {load:g} N (tangent {stiffness:.4g} N/m): no stiffness there"
            )
        by_load = curve.bend(place) / stiffness
        own = {"loading": stiffness} if self.measured == "loading" else {}
        own |= {"unloading": stiffness} if self.measured == "unloading" else {}
        if self.cycles:
            apart = 0.5 * curve.slope_gap(place)
            own = {"loading": stiffness + apart, "unloading": stiffness - apart, "gap": curve.gap_at(place)}
        return Tangent(
            load=load,
            deflection=place,
            stiffness=stiffness,
            fit=near.std,
            cycles=self._change(near, load) * _UNIFORM,
            zero=float(np.hypot(max(abs(by_load) * self.zero_std, self._bent(load)), self._tilt)),
            by_load=by_load,
            **own,
        )

    def _change(self, now: Local, load: float) -> float:
        """Change of the tangent from the last but one to the last complete cycle [N/m]; 0 where there is none."""
        if self._last_but_one is None:
            return 0.0
        curve, points, _ = self._last_but_one
        if now.reach:
            before = in_part(points, now.middle, now.reach, load, alone=True)
            return 0.0 if before is None else abs(now.slope - before.slope)
        try:
            return abs(now.slope - curve.slope(self._deflection_at(curve, load)))
        except LoadCurveError:
            return 0.0

    @cached_property
    def shift(self) -> float:
        """Change of the load at equal deflection from the last but one to the last cycle [N], by drift or creep.

        Both cycles are held against the curve of the last, so that its misfit cancels.
        """
        if self.cycles < 2:
            return 0.0
        # The first cycle conditions the rubber, mostly while it is loaded.
        return self._level(-1, unloading=self.cycles == 2) - self._level(-2, unloading=self.cycles == 2)

    @cached_property
    def _shifts(self) -> FloatArray:
        """Changes of the load on unloading from each cycle to the next [N]; the first cycle conditions the rubber."""
        return np.diff([self._level(cycle, unloading=True) for cycle in range(1, self.cycles)])

    def _level(self, cycle: int, *, unloading: bool) -> float:
        """Median of the load of a cycle less the curve of the last [N], of its unloading branch or of both."""
        x, f, side = self._cycle(cycle)
        rest = f - self._last.load(x, side)
        return float(np.median(rest[side < 0] if unloading and side is not None else rest))

    def _bent(self, load: float) -> float:
        """Standard uncertainty of the tangent from the zero of the load, over which range the curve may bend [N/m]."""
        reach = self.zero_std / (2 * _UNIFORM)
        here = self._last.slope(self._deflection_at(self._last, load))
        changes = [0.0]
        for there in (load - reach, load + reach):
            try:
                changes.append(abs(self._last.slope(self._deflection_at(self._last, there)) - here))
            except LoadCurveError:
                continue
        return max(changes) * 2 * _UNIFORM

    @cached_property
    def without_contact(self) -> float:
        """Mean load before contact in the last cycle [N]; 0 where it was not recorded."""
        x, f, _ = self.branches.of_cycle(-1, self.deflection, self.load)
        free = ~in_contact(x, f)
        return float(np.mean(f[free])) if free.any() else 0.0

    @property
    def zero_off(self) -> float:
        """Load before contact over the span of the loads [1]."""
        low, high = self.measured_loads
        return abs(self.without_contact) / (high - low)

    @cached_property
    def zero_std(self) -> float:
        """Standard uncertainty of the zero of the load [N]: its shift over all cycles, and the load without contact.

        In each cycle the zero may have moved by as much as in the one with the largest change that does not fade: a
        change that fades is that of rubber which relaxes.
        """
        sizes = np.abs(self._shifts)
        fades = sizes.size > 0 and int(np.argmax(sizes)) == 0
        largest = float(np.max(np.append(sizes[sizes.size // 2 :] if fades else sizes, abs(self.shift))))
        return float(np.hypot(largest * self.cycles, self.without_contact)) * 2 * _UNIFORM

    @property
    def _tilt(self) -> float:
        """Standard uncertainty of the mean's slope [N/m] from a drift of the load, if the branches differ in duration.

        The shift over a cycle may be a drift of the load cell; with equal durations it cancels in the mean.
        """
        if not self.cycles:
            return 0.0
        durations = self.times or tuple(
            float(last - first) for first, last in (self.branches.ends[i] for i in self.branches.cycles[-1])
        )
        low, high = self._last.span
        uneven = (durations[0] - durations[1]) / (sum(durations) or 1.0)
        return abs(0.5 * self.shift * uneven / (high - low)) * 2 * _UNIFORM

    def secant(self, load: float) -> Secant:
        """Load over deflection from the point of zero load.

        Parameters
        ----------
        load : float [N]
            Within the measured loads.

        Returns
        -------
        Secant
            Not-a-number, with the reason, if the curve does not reach zero load.

        Raises
        ------
        LoadCurveError
            If the load itself lies outside the measured loads.

        Examples
        --------
        >>> x = np.linspace(0.0, 0.03, 31)
        >>> LoadCurve(x, 150e3 * x + 400.0).secant(2000.0).reason
        'the curve starts at 400 N: no point of zero load'
        """
        curve = self._last
        place = self._deflection_at(curve, load)
        lowest, highest = self.measured_loads
        if lowest > _ZERO * (highest - lowest):
            return Secant(float("nan"), f"the curve starts at {lowest:.4g} N: no point of zero load")
        try:
            travel = place - deflection_at(curve, 0.0)
        except LoadCurveError:
            return Secant(float("nan"), "the mean of the branches does not reach zero load")
        return Secant(load / travel) if travel and load else Secant(float("nan"), "the load is zero: no secant")

    @cached_property
    def hysteresis_loss(self) -> float:
        """Energy lost in the last complete cycle, the area of the loop [J]; not-a-number for one branch."""
        if self.cycles == 0:
            return float("nan")
        x, f, _ = self.branches.of_cycle(-1, self.deflection, self.load)
        closed_x, closed_f = np.append(x, x[0]), np.append(f, f[0])
        return float(np.sum(0.5 * (closed_f[1:] + closed_f[:-1]) * np.diff(closed_x)))

    @cached_property
    def loss_std(self) -> float:
        """Standard uncertainty of the loss [J] without that of the gains: noise, shift of the load, change by cycle."""
        if self.cycles == 0:
            return float("nan")
        x, _, _ = self.branches.of_cycle(-1, self.deflection, self.load)
        closed = np.concatenate([x[-1:], x, x[:1]])
        noise = float(np.std(self._last.residual)) * float(np.linalg.norm(0.5 * (closed[2:] - closed[:-2])))
        # A drift by `shift` over a cycle adds half of shift times travel to the area.
        drift = self.shift * float(np.ptp(x)) * _UNIFORM
        return float(np.hypot(noise, drift))

    def loop(self, points: int = 160) -> tuple[FloatArray, FloatArray]:
        """Deflection [m] and load [N] of the last complete cycle, thinned to some `points`."""
        x, f, _ = self.branches.of_cycle(-1, self.deflection, self.load)
        thin = slice(None, None, max(1, x.size // points))
        return x[thin], f[thin]

    def mean_curve(self, points: int = 60) -> tuple[FloatArray, FloatArray]:
        """Deflection [m] and load [N] along the mean of the branches of the last complete cycle."""
        x = np.linspace(*self._last.span, points)
        return x, self._last.value(x)

    @cached_property
    def nonlinearity(self) -> float:
        """Largest departure of the mean curve from the line through 10 and 90 % of the load span, over the span [1]."""
        curve = self._last
        x = np.linspace(*curve.span, 401)
        f = curve.value(x)
        low, high = float(f.min()), float(f.max())
        try:
            start, end = (deflection_at(curve, low + share * (high - low)) for share in (0.1, 0.9))
        except LoadCurveError:
            return float("nan")
        slope = 0.8 * (high - low) / (end - start)
        line = low + 0.1 * (high - low) + slope * (x - start)
        return float(np.max(np.abs(f - line)) / (high - low))
