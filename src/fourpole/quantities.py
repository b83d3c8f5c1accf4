"""Quantities: one entry for each column of the result tables; tables, axes and sentences take names and units from it.

The head of a column is `column` with the SI unit, "Re K* [N/m]"; that of its standard uncertainty "u(Re K*) [N/m]".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi
from typing import Any, Literal

__all__ = ["DERIVED", "QUANTITIES", "RIG_VALUES", "Quantity", "ShownUnits", "meaning_of"]


@dataclass(frozen=True)
class Quantity:
    """One quantity: its names in code, files, axes and sentences, and its SI unit and shown unit.

    Attributes
    ----------
    key : str
        Name in Python, JSON and tests.csv.
    symbol : str
        Symbol in the tables of the report.
    name : str
        Name on an axis.
    unit : str
        SI unit of the column, "1" for a ratio; empty for a column without a unit.
    meaning : str
        Definition in words.
    shown : str
        Unit in figures and in the report; by default the SI unit.
    scale : float
        SI value of one shown unit.
    column, u_column : str
        Name in the head of the column, by default `name`; name in the head of its uncertainty, by default `column`.
    kind : {"number", "text", "count", "lists"}
        Type of the cells.
    digits : int
        Significant digits of a value that is shown without its uncertainty.
    pair : tuple of Quantity
        The two quantities of a correlation; empty for other quantities.
    topic : str
        The part of the findings that reports the quantity, one of `fourpole.findings.Topic`; empty if none does.
    more : str
        Predicate of the tyre with the larger value: "is the stiffer".
    start : str
        The quantity as the subject of a sentence: "The loss factor".
    over : tuple of str
        Axes over which findings compare the quantity.
    from_row : callable, optional
        Function from a row of dynamic.csv, by heads, to value and standard uncertainty, for a derived quantity.

    Examples
    --------
    >>> STORAGE.head, STORAGE.u_head, STORAGE.label
    ('Re K* [N/m]', 'u(Re K*) [N/m]', "K' [kN/m]")
    """

    key: str
    symbol: str
    name: str
    unit: str = ""
    meaning: str = ""
    shown: str = ""
    scale: float = 1.0
    column: str = ""
    u_column: str = ""
    kind: Literal["number", "text", "count", "lists"] = "number"
    digits: int = 4
    pair: tuple[Quantity, ...] = ()
    topic: str = ""
    more: str = ""
    start: str = ""
    over: tuple[str, ...] = ("pressure", "load", "frequency")
    from_row: Callable[[Mapping[str, Any]], tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        """Fill in the attributes whose default is made from another attribute."""
        object.__setattr__(self, "shown", self.shown or self.unit)
        object.__setattr__(self, "column", self.column or self.name)
        object.__setattr__(self, "u_column", self.u_column or self.column)
        object.__setattr__(self, "more", self.more or f"has the larger {self.column}")
        object.__setattr__(self, "start", self.start or f"{self.column[:1].upper()}{self.column[1:]}")

    @cached_property
    def head(self) -> str:
        """Head of the column."""
        return self._headed(self.column)

    @cached_property
    def u_head(self) -> str:
        """Head of the column of its standard uncertainty."""
        return self._headed(f"u({self.u_column})")

    @property
    def whole_head(self) -> str:
        """Head of its standard uncertainty with the errors that all rows share, where `u_head` is without."""
        return self._headed(f"u({self.column}) with shared errors")

    @cached_property
    def heads(self) -> tuple[str, str]:
        """Heads of the value and of its standard uncertainty."""
        return self.head, self.u_head

    @property
    def parts(self) -> tuple[str, str]:
        """Heads of the real and the imaginary part of a complex amplitude."""
        return self._headed(f"Re {self.column}"), self._headed(f"Im {self.column}")

    @property
    def relative_head(self) -> str:
        """Head of the relative standard uncertainty."""
        return f"u({self.column})/{self.column} [1]"

    def u_head_from(self, other: Quantity) -> str:
        """Head of the part of the standard uncertainty that another quantity contributes."""
        return self._headed(f"u({self.column}) from {other.column}")

    def _headed(self, column: str) -> str:
        return f"{column} [{self.unit}]" if self.unit else column

    @property
    def label(self) -> str:
        """Label of an axis: the name with the shown unit."""
        return f"{self.name} [{self.shown}]"

    @property
    def stated_head(self) -> str:
        """Head of its column in tests.csv."""
        return f"{self.key} [{self.unit if self.scale == 1 else self.shown}]"

    @property
    def suffix(self) -> str:
        """Unit after a shown number; empty for a ratio."""
        return "" if self.shown == "1" else self.shown


#: Unit shown for an SI unit and its SI value, where nothing else is wanted; other units are shown as they are.
_USUAL = {
    "Pa": ("bar", 1e5),
    "N/m": ("kN/m", 1e3),
    "m": ("mm", 1e-3),
    "m/s": ("mm/s", 1e-3),
    "m/(N s)": ("mm/(N s)", 1e-3),
    "rad": ("°", pi / 180), "degC": ("°C", 1.0), "1": ("", 1.0),
}  # fmt: skip


@dataclass(frozen=True)
class ShownUnits:
    """The units in which people see quantities: those that a campaign wants, and otherwise the usual ones.

    Attributes
    ----------
    wanted : mapping of str to (str, float)
        The wanted unit and its SI value, by the SI unit of the quantity.

    Examples
    --------
    >>> units = ShownUnits({"Pa": ("kPa", 1e3)})
    >>> units.of(PRESSURE).label, units.of(K1).label, units.text(PRESSURE, 1.7e5)
    ('pressure [kPa]', 'K1 [kN/m]', '170 kPa')
    """

    wanted: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    def of(self, quantity: Quantity) -> Quantity:
        """The quantity with its unit shown and the scale of that unit."""
        if quantity.unit not in self.wanted:
            return quantity
        shown, scale = self.wanted[quantity.unit]
        return replace(quantity, shown=shown, scale=scale)

    def unit(self, si: str) -> tuple[str, float]:
        """The unit shown for an SI unit, empty for a ratio, and its SI value."""
        return self.wanted.get(si) or _USUAL.get(si) or (si, 1.0)

    def text(self, quantity: Quantity, value: float, digits: int = 4) -> str:
        """An SI value with its unit, to some significant digits: "1.7 bar"."""
        one = self.of(quantity)
        return _with_unit(value / one.scale, one.suffix, digits)

    def setting(self, head: str, value: float) -> str:
        """A value of a column of conditions with its unit, by the column's head: "1.7 bar", "camber 2 deg"."""
        name, _, si = head.removesuffix("]").partition(" [")
        unit, scale = self.unit(si)
        text = _with_unit(value / scale, unit)
        return text if name in _BY_UNIT else f"{name} {text}"


#: Axes of conditions that are known by their units.
_BY_UNIT = ("pressure", "preload", "temperature", "deflection amplitude")


def _with_unit(value: float, unit: str, digits: int = 4) -> str:
    """A number to some significant digits, without an exponent below ten millions, and its unit."""
    text = f"{value:.{digits}g}"
    text = f"{value:.0f}" if "e+" in text and abs(value) < 1e7 else text
    return f"{text}{'' if unit in ('', '°') else ' '}{unit}".replace("-", "−")


def _text(key: str, meaning: str = "") -> Quantity:
    return Quantity(key, key, key, meaning=meaning, kind="text")


def _listed(key: str, name: str, unit: str, meaning: str = "") -> Quantity:
    return Quantity(key, name, name, unit, meaning, kind="lists")


TEST = _text("test", "name of the test")
POINT = Quantity("point", "point", "point", meaning="which of several rows of a test, from 1 on", kind="count")
RIG = _text("rig", "name of the rig; empty where the campaign has one")
TYRE = _text("tyre", "name of the tyre or specimen")
CONSTRUCTION = _text("construction", "construction of the tyre")
ROUTE = _text("route", "how K* was found")
K_OF = _text("K* of", "springs: without inertia; driving point, blocked transfer: with that of the specimen")
VERDICT = _text("verdict", "ok, warning or rejected")
REMARKS = _text("remarks", "reasons for the verdict or the finding, and what to do")
VERDICT_K = _text("verdict K*", "verdict on K*")
VERDICT_ARM = _text("verdict K2 C", "verdict on K2 and C; empty where no K1 is, or they are not asked for")
VERDICT_TR = _text("verdict TR", "verdict on TR; empty where no rig with a moving mass is, or TR is not asked for")
CONDITION = Quantity("condition", "condition", "condition", meaning="number shared by tests of one K*", kind="count")

PRESSURE = Quantity("pressure", "p", "pressure", "Pa", "inflation pressure", "bar", 1e5, digits=3)
PRELOAD = Quantity("preload", "preload", "preload", "N", "static load on the specimen")
ADDED_MASS = Quantity("added_mass", "added mass", "added mass", "kg", "mass added to the moving mass")
TEMPERATURE = Quantity("temperature", "T", "temperature", "degC", "temperature of the test", "°C", digits=3)
FREQUENCY = Quantity("frequency", "f", "frequency", "Hz", "frequency found in the recording")
F1 = Quantity("f1", "F1", "F1", "N", "amplitude of the force at the contact")
V1 = Quantity("v1", "V1", "V1", "m/s", "amplitude of the velocity at the contact", "mm/s", 1e-3)
V2 = Quantity("v2", "V2", "V2", "m/s", "amplitude of the velocity of the moving mass", "mm/s", 1e-3)
PHASE_F1 = Quantity("phase_f1_v1", "F1 ahead of V1", "phase F1-V1", "rad", "phase of F1 ahead of V1", "°", pi / 180)
PHASE_V2 = Quantity("phase_v2_v1", "V2 ahead of V1", "phase V2-V1", "rad", "phase of V2 ahead of V1", "°", pi / 180)

DEFLECTION_AMPLITUDE = Quantity(
    "deflection_amplitude", "x", "deflection amplitude", "m",
    "amplitude of the deflection of the specimen, |V1 - V2|/w; where V2 is not known |F1/K*|", "mm", 1e-3,
)  # fmt: skip

R = Quantity("r", "R", "R", "m/(N s)", "real part of the mobility V1/F1", "mm/(N s)", 1e-3)
I = Quantity("i", "I", "I", "m/(N s)", "imaginary part of the mobility V1/F1", "mm/(N s)", 1e-3)  # noqa: E741  the paper's symbol
CORR_R_I = Quantity("corr_r_i", "corr(R, I)", "corr(R,I)", "1", "correlation of R and I", digits=2, pair=(R, I))
STORAGE = Quantity(
    "storage", "K′", "K'", "N/m", "real part of the dynamic stiffness", "kN/m", 1e3, "Re K*",
    topic="dynamic stiffness", more="is dynamically the stiffer",
)  # fmt: skip
LOSS = Quantity("loss", "K″", "K''", "N/m", "imaginary part of the dynamic stiffness", "kN/m", 1e3, "Im K*")
CORR_K = Quantity(
    "corr_k", "corr(K′, K″)", "corr(Re,Im K*)", "1", "correlation of Re K* and Im K*", digits=2, pair=(STORAGE, LOSS)
)
LOSS_FACTOR = Quantity(
    "loss_factor", "η", "loss factor", "1", "loss factor Im K* / Re K*",
    topic="loss", more="has the larger loss", start="The loss factor",
)  # fmt: skip
K_STAR = Quantity("k_star", "K*", "K*", "N/m", "dynamic stiffness, complex", "kN/m", 1e3)
MODULUS = Quantity("modulus", "|K*|", "|K*|", "N/m", "modulus of the dynamic stiffness", "kN/m", 1e3)
LOSS_ANGLE = Quantity("loss_angle", "δ", "loss angle", "rad", "argument of the dynamic stiffness", "°", pi / 180)
K1 = Quantity(
    "k1", "K1", "K1", "N/m", "static stiffness at the preload", "kN/m", 1e3,
    topic="static stiffness", more="is the stiffer", over=("pressure", "load"),
)  # fmt: skip
K2 = Quantity(
    "k2", "K2", "K2", "N/m", "stiffness of the spring in series with C", "kN/m", 1e3,
    topic="dynamic stiffness", more="is dynamically the stiffer",
)  # fmt: skip
C = Quantity(
    "c", "C", "C", "N s/m", "damping of the damper in series with K2", topic="damping", more="is the more damped"
)
CORR_K2_C = Quantity("corr_k2_c", "corr(K2, C)", "corr(K2,C)", "1", "correlation of K2 and C", digits=2, pair=(K2, C))
TR = Quantity("tr", "TR", "TR", "1", "modulus of V2/V1")
TR_MEASURED = Quantity("tr_measured", "TR", "TR measured", "1", "modulus of V2/V1, measured", u_column="TR")
TR_PREDICTED = Quantity(
    "tr_predicted", "TR predicted", "TR predicted", "1", "modulus of V2/V1 that K* and the rig give", u_column="TR"
)

ENERGY = Quantity(
    "cycle_energy", "W", "energy per cycle", "J",
    "energy that the specimen loses in a cycle, π K'' x² with x its deflection amplitude",
)  # fmt: skip

SECANT = Quantity(
    "secant", "secant", "secant", "N/m", "secant static stiffness, from the point of zero load", "kN/m", 1e3
)
K1_OF = _text(
    "K1 of", 'curve whose tangent is K1: "mean" of both branches, "loading", "unloading", "points" in no order'
)
K1_LOADING = Quantity(
    "k1_loading", "K1 loading", "K1 loading", "N/m", "tangent of the loading branch where the mean carries the preload",
    "kN/m", 1e3,
)  # fmt: skip
K1_UNLOADING = Quantity(
    "k1_unloading", "K1 unloading", "K1 unloading", "N/m",
    "tangent of the unloading branch where the mean carries the preload", "kN/m", 1e3,
)  # fmt: skip
GAP = Quantity(
    "gap", "gap", "branch gap", "N",
    "load of the loading less that of the unloading branch where the mean carries the preload",
)  # fmt: skip
BRANCH_TIME = Quantity(
    "branch_time", "time per branch", "time per branch", "s", "mean duration of the branches in use; blank if unknown"
)
CYCLE = Quantity("cycle", "cycle", "cycle", meaning="number of the cycle in use; blank for one branch", kind="count")
CYCLE_LOSS = Quantity(
    "cycle_loss", "loss", "hysteresis loss", "J", "energy lost in the last complete cycle of the static curve",
    topic="loss", over=("pressure",),
)  # fmt: skip
NONLINEARITY = Quantity(
    "nonlinearity", "nonlinearity", "nonlinearity", "1",
    "departure of the static curve from a line, over the load span", "%", 0.01, digits=3,
    topic="nonlinearity", over=("pressure",),
)  # fmt: skip

VALUE = _text("value", "name of the shared value")
UNIT = _text("unit", "unit of the values in the row")
FINDING = _text("finding", "found, not determined, contradicted, not calibrated or unstated")
STATED = Quantity("stated", "stated", "stated", meaning="value as stated; a gain is measured over true")
FOUND = Quantity("found", "found", "found", meaning="value after the tests")
POSTERIOR = Quantity(
    "posterior_over_prior", "", "posterior over prior", "1", "ratio of the uncertainties after and before the tests"
)
PULL = Quantity("pull", "pull", "pull", "1", "found less stated value over the uncertainty of their difference")
DETECTION_LIMIT = Quantity(
    "detection_limit", "", "detection limit", column="seen from",
    meaning="smallest undeclared error that the tests would show; blank where they show none",
)  # fmt: skip

RESIDUAL_RE = Quantity("residual_re", "", "Re residual", "N s/m", "real part of F1/V2 - Zr", u_column="Re")
RESIDUAL_IM = Quantity("residual_im", "", "Im residual", "N s/m", "imaginary part of F1/V2 - Zr", u_column="Im")
ZR = Quantity("zr", "Zr", "Zr", "N s/m", "impedance of the rig")
CHI2 = Quantity("chi2", "χ²", "chi2", "1", "chi-square of the residual")
DOF = Quantity("dof", "dof", "dof", "1", "degrees of freedom")
OUTLIER = Quantity("outlier", "", "outlier", "1", "factor by which the variance of an outlier is enlarged, else 1")

QUANTITY = _text("quantity", "symbol of the quantity")
SOURCE = _text("source", "source of the uncertainty")
U = Quantity("u", "u", "u", meaning="standard uncertainty from this source, in the unit of the row")
SHARE = Quantity("share", "share", "share", "1", "share of the variance")
LOWER = Quantity("lower", "", "2.5 %", meaning="2.5 % quantile, in the unit of the row")
MEDIAN = Quantity("median", "", "50 %", meaning="median, in the unit of the row")
UPPER = Quantity("upper", "", "97.5 %", meaning="97.5 % quantile, in the unit of the row; blank where it has no limit")
NON_PASSIVE = Quantity(
    "non_passive", "", "non-passive share", "1", "share of the draws without a passive K2, C", column="impassive share"
)

CHANNEL = _text("channel", "F1, V1 or V2")
CORRECTION = _text("correction", "what was corrected: delay, filter, response or cross-talk")
GAIN = Quantity("gain", "gain", "gain", "1", "gain at the frequency, recorded over true")
PHASE = Quantity("phase", "phase", "phase", "rad", "phase at the frequency, recorded less true")

WIDTH = Quantity("width", "width", "width", "Hz", "width of the band that a line stands for")
AVERAGES = Quantity("averages", "n", "averages", "1", "number of independent averages")
COHERENCES = tuple(
    Quantity(f"coherence_{a}_{b}".lower(), f"γ²({a}, {b})", f"coherence {a}-{b}", "1", f"coherence of {a} and {b}")
    for a, b in (("F1", "V1"), ("V1", "V2"), ("V2", "F1"), ("drive", "F1"), ("drive", "V1"), ("drive", "V2"))
)
CLOSURE_PHASE = Quantity(
    "closure_phase", "closure", "closure phase", "rad", "phase of G(F1,V1)·G(V1,V2)·G(V2,F1); 0 without common noise",
    "°", pi / 180,
)  # fmt: skip
ESTIMATES = tuple(
    Quantity(name.lower(), name, name, "m/(N s)", f"mobility V1/F1 by {how}", "mm/(N s)", 1e-3)
    for name, how in (
        ("H1", "G(V1,F1)/G(F1,F1)"), ("H2", "G(V1,V1)/G(F1,V1)"), ("Hv", "the geometric mean of H1 and H2"),
    )
)  # fmt: skip

FORM = _text("form", "where the specimen has its mass: massless, belt (between two springs) or rod (spread along it)")
BELT_MASS = Quantity(
    "belt_mass", "m_b", "belt mass", "kg", "mass of the specimen between its ends; of a rod its whole mass"
)
BELT_FREE = Quantity(
    "belt_free", "f_b", "belt frequency, rim held, contact free", "Hz",
    "first frequency of this mass on the spring at the rim, sqrt(Re k_rim/m_b)/2π; FREQ_LONG of MF-Swift",
)  # fmt: skip
BELT_HELD = Quantity(
    "belt_held", "f_b2", "belt frequency, contact held", "Hz", "first frequency of this mass between both springs"
)
BELT_SHARE = Quantity(
    "belt_share", "r", "share of springs", "1", "stiffness of the spring at the contact over that at the rim, modulus"
)
BELT_EXPONENT = Quantity("belt_exponent", "p", "exponent", "1", "power of K* by which the share changes with frequency")
BELT_SPREAD = Quantity("belt_spread", "", "spread of the mass", "1", "of a rod of n masses: 1 - 1/n; 1 if it is even")
BELT_EVIDENCE = Quantity(
    "belt_evidence", "", "evidence over massless", "1",
    "gain of the logarithm of the evidence by the mass of all specimens",
)  # fmt: skip

CODE = _text("code", "name of the check")
STATISTIC = Quantity("statistic", "", "statistic", meaning="what the check found; blank for a check without a number")
LIMIT = Quantity("limit", "", "limit", meaning=(
    "limit that the statistic exceeds for this verdict; where the verdict is ok, the limit of a warning; mains and "
    "passive arm give a warning below it"
))  # fmt: skip
REMEDY = _text("remedy", "what to do")
VALUES = _text("values", "numbers with their units, and names, that the sentence of the check has, as JSON")

PHASOR_COVARIANCE = _listed(
    "phasor_covariance", "covariance Re F1, Im F1, Re V1, Im V1, Re V2, Im V2", "", "6×6, row by row"
)
OWN_COVARIANCE = _listed(
    "own_covariance", "own covariance Re, Im K*", "N2/m2",
    "covariance that this condition does not share with others: 2×2, row by row, Re before Im",
)  # fmt: skip
FAMILY = Quantity(
    "family", "family", "family", meaning="number shared by tests that differ in frequency only", kind="count"
)
SPECIMEN = Quantity("specimen", "specimen", "specimen", meaning="number of the specimen", kind="count")
RUN_PLACE = Quantity(
    "run_place", "place", "place in the run", "1", "time from the mean of the specimen, in lengths of the run"
)
PART_OF_RUN = Quantity("part_of_run", "part", "part of the run", meaning="eighth of the run, from 0", kind="count")
OFF_CURVE = Quantity(
    "off_curve", "off curve", "deflection off the curve", "1",
    "logarithm of the deflection over that of neighbouring frequencies; 0 if repeats hardly differ in it",
)  # fmt: skip
SPREAD = Quantity(
    "spread", "spread", "spread of log K*", "1", "standard deviation of K* of the test about that of its condition"
)
WEIGHTS = _listed(
    "weights", "weights Re F1, Im F1, Re V1, Im V1, Re V2, Im V2", "",
    "W with W S W^T = 1, S the covariance of the amplitudes as weighed: 6×6, row by row",
)  # fmt: skip
TURNS = _listed(
    "turns", "turns of F1, V1, V2", "",
    "change of the logarithm of each amplitude per unit of each error in study.json: Re, Im",
)  # fmt: skip
SHARED_STORAGE = _listed(
    "shared_storage", "shared Re K*", "N/m", "change of Re K* by one standard uncertainty of each common error"
)
SHARED_LOSS = _listed(
    "shared_loss", "shared Im K*", "N/m", "change of Im K* by one standard uncertainty of each common error"
)
DEFLECTION = _listed("deflection", "deflection", "m", "deflection of the static curve")
LOAD = _listed("load", "load", "N", "load of the static curve")
MEAN_DEFLECTION = _listed("mean_deflection", "mean deflection", "m", "deflection of the mean curve")
MEAN_LOAD = _listed("mean_load", "mean load", "N", "load of the mean curve")
TIME = _listed("time", "time", "s", "time of the samples shown")
RESIDUAL_TIME = _listed("residual_time", "residual time", "s", "time of the stretches whose residual is shown")

WINDOW = Quantity("window", "window", "window", "s", "part of the recording in use", kind="text")
LEFT_OUT = Quantity("left_out", "", "leave-one-out error", "1", "error of K* at conditions that a map does not use")
CROSS_VALIDATION = Quantity("cross_validation", "", "cross-validation error", "1", "error at frequencies left out")
OUTSIDE = Quantity("outside", "", "outside", "half spans", "distance from the measured conditions")

#: The values of a rig by key, in the order of every gradient.
RIG_VALUES = {one.key: one for one in (
    Quantity("moving_mass", "m", "moving mass m", "kg"),
    Quantity("preload_stiffness", "K3", "preload spring K3", "N/m", shown="kN/m", scale=1e3),
    Quantity("preload_damping", "c3", "damper c3", "N s/m"),
    Quantity("preload_loss_factor", "", "loss factor of K3", "1"),
    Quantity("tyre_mass", "", "moving part of the tyre", "kg"),
    Quantity("frame_stiffness", "", "frame stiffness", "N/m", shown="kN/m", scale=1e3),
    Quantity("input_mass", "", "input mass", "kg"),
)}  # fmt: skip

_COMFORT = Quantity(
    "comfort", "a_w", "weighted acceleration", "m/s^2", "vertical, at the seat, weighted by Wk: r.m.s.", "m/s²"
)  # fmt: skip
_ACCELERATION = Quantity("acceleration", "a", "acceleration", "m/s^2", "vertical, at the seat: r.m.s.", "m/s²")
_WHEEL_LOAD = Quantity("wheel load", "F", "dynamic wheel load", "N", "r.m.s. about the static load")
_TRAVEL = Quantity("travel", "travel", "suspension travel", "m", "r.m.s. about the rest", "mm", 1e-3)
#: The measures of a ride by the names that rides have for them.
RIDE_MEASURES = {one.key: one for one in (
    _COMFORT, _ACCELERATION, _WHEEL_LOAD, _TRAVEL,
    *(
        replace(one, key=f"{one.key} {place}", name=f"{one.name} {place}", column=f"{one.name} {place}", u_column="")
        for one in (_WHEEL_LOAD, _TRAVEL) for place in ("front", "rear")
    ),
    Quantity("power", "P", "power lost in the tyres", "W", "mean of K'' over all frequencies"),
    Quantity("crest", "", "crest factor", "1", "peak over r.m.s. of the weighted acceleration", digits=3),
    Quantity("vdv", "VDV", "vibration dose value", "m/s^1.75", "of the weighted acceleration", "m/s^1.75"),
    Quantity("mtvv", "MTVV", "maximum transient vibration value", "m/s^2", "greatest running r.m.s. over 1 s", "m/s²"),
)}  # fmt: skip

#: All quantities, in the order in which this module defines them.
QUANTITIES = tuple(one for one in list(globals().values()) if isinstance(one, Quantity))
#: Derived quantities: each follows from other columns of dynamic.csv; their columns are the last of that table.
DERIVED = tuple(one for one in QUANTITIES if one.from_row is not None)
_MEANINGS = {head: text for one in QUANTITIES for head, text in (
    (one.u_head, f"standard uncertainty of {one.u_column}"), (one.head, one.meaning)
)}  # fmt: skip


def meaning_of(head: str) -> str:
    """Meaning of a column in words; its name if it is no column of a table.

    Examples
    --------
    >>> meaning_of("loss factor [1]"), meaning_of("u(TR) [1]"), meaning_of("camber [deg]")
    ('loss factor Im K* / Re K*', 'standard uncertainty of TR', 'camber')
    """
    return _MEANINGS.get(head) or head.rpartition(" [")[0] or head
