"""The sentences of checks: what was found and what to do, from the templates of their codes and from their values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum
from math import degrees, isfinite
from typing import Any, NamedTuple

from fourpole.core.checks import Check, Verdict
from fourpole.core.codes import Code
from fourpole.core.confidence import COVERAGE
from fourpole.errors import Message

#: Units of the values of checks, by name; other values are ratios, counts, names or enums.
UNITS = {
    **dict.fromkeys(("stated", "found", "hertz"), "Hz"),
    **dict.fromkeys(("mean", "preload", "peak", "without"), "N"),
    **dict.fromkeys(("k1", "storage", "loss_modulus", "spring", "inertia", "low K2", "high K2"), "N/m"),
    **dict.fromkeys(("low C", "high C"), "N s/m"),
    **dict.fromkeys(("length", "before", "after", "delay"), "s"),
    **dict.fromkeys(("smallest", "largest"), "mm"),
    **dict.fromkeys(("there", "own"), "degC"),
    "percent": "%",
    "phase": "rad",
    "degrees": "deg",
    "mass": "kg",
    "pressures": "Pa",
    "decibel": "dB",
}


#: What is doubtful in a load-deflection curve, by its code; {0} is its size, {1} the size in percent.
CURVE_DOUBTS = {
    "one cycle": "one complete cycle only: the rubber was not conditioned, and no repeat shows how steady it is",
    "missing points": "{1:.2g} % of the points are missing and were left out",
    "outliers": "{0} points lie far off the curve and were left out: look for spikes in the load",
    "creep": "the load at equal deflection changes by {0:.3g} N from the second to the last cycle: the specimen "
    "creeps, or the load cell drifts and K1 is that of another load",
    "clipped": "the load stands at its largest value over {0:.0%} of the deflection: the load cell was clipped; repeat "
    "the test with a larger range",
}


class Looks(Enum):
    """What a wrong sign, unit or column of a channel looks like."""

    F1_V2_INVERTED = "F1 or V2 looks inverted"
    V2_IN_G = "the unit of V2 looks like g read as m/s², a factor of 9.81"
    F1_IN_KGF = "the unit of F1 looks like kgf read as N, a factor of 9.81"
    F1_IN_N = "the unit of F1 looks like N read as kN, or that of V2 is 1000 times too small"
    F1_IN_KN = "the unit of F1 looks like kN read as N, or that of V2 is 1000 times too large"
    V1_V2_EXCHANGED = "V1 and V2 look exchanged"
    V1_INVERTED = "is inverted"
    V1_IN_G = "is 9.81 times too small, as g read as m/s²"
    V1_TIMES_G = "is 9.81 times too large"
    V1_IN_M = "is 1000 times too small, as m read as mm"
    V1_IN_MM = "is 1000 times too large, as mm read as m"


class Branch(Enum):
    """What K1 is where it is not the tangent of the mean of both branches."""

    LOADING = "the tangent of the loading branch alone"
    UNLOADING = "the tangent of the unloading branch alone"
    POINTS = "the tangent of a curve through points in no order of loading"


class Side(Enum):
    """The side that states a value of a condition which the other one leaves blank."""

    STATIC = "the static test"
    DYNAMIC = "this test"


class NoArm(Enum):
    """Why no passive K2 and C exist: what is found, and what to look for."""

    NO_STIFFNESS = ("K* could not be found, so neither can K2 and C", "")
    NO_STORAGE = (
        "no passive K2, C exist: K' = {storage:.5g} N/m is not positive; ",
        "look for an inverted force or motion channel, or a wrong moving mass",
    )
    NO_LOSS = (
        "no passive C exists: K'' = {loss_modulus:.5g} N/m is not positive, the tyre would give energy; ",
        "look for an inverted channel, an undeclared delay or phase of a channel, or a wrong rig value",
    )
    NO_K1 = ("no static stiffness K1 is known, so K2 and C are left blank", "")
    BELOW_K1 = (
        "no passive K2 exists: K' = {storage:.5g} N/m is not above the static K1 = {k1:.5g} N/m; ",
        "look for a K1 taken at another load, amplitude or branch, a wrong moving mass, or a gain error",
    )

    def says(self, stiffness: complex, k1: float) -> tuple[str, str]:
        """The cause and what to look for, for K* and K1 [N/m]."""
        cause, remedy = self.value
        return cause.format(storage=stiffness.real, loss_modulus=stiffness.imag, k1=k1), remedy


class NoK1(Enum):
    """Why a dynamic test has no K1."""

    NO_TEST = "no static test"
    NO_PRELOAD = "no preload"
    REJECTED = "static test rejected"


class Excitation(Enum):
    """The excitation of some tests of a condition."""

    SINES = "sines"
    RANDOM = "random excitation"
    SWEEP = "a sweep"


#: The classes that checks of recordings are made of.
CHECK_CLASSES = (Check, Code, Verdict, Message, Looks)


class Said(NamedTuple):
    """The sentence of a check in two parts; both are empty for a check that is plainly ok."""

    cause: str
    remedy: str

    @property
    def remark(self) -> str:
        """The whole sentence."""
        return self.cause + self.remedy


def said(check: Check) -> Said:
    """The sentence of a check.

    Examples
    --------
    >>> said(Check(Code.MEMORY, Verdict.REJECTED, values={"file": "D1.csv"})).remark
    'D1.csv does not fit into memory: cut it with window [s]'
    """
    if check.verdict is Verdict.OK and not check.values:
        return Said("", "")
    known = {"statistic": check.statistic, "limit": check.limit, "channel": check.channel, **check.values}
    known["short"] = check.code.short(check.verdict)
    known |= _WORDS[check.code](check.values) if check.code in _WORDS else {}
    cause, remedy = (part.format(**known) for part in check.code.says(check.verdict))
    return Said(f"at first, {cause}" if check.values.get("at_first") else cause, remedy)


def remark_of(check: Check) -> str:
    """The whole sentence of a check."""
    return said(check).remark


#: Values that say which case of a check it is, and are no number or name.
CASES = ("error", "because", "looks", "branch", "cause")


def kind_of(*checks: Check) -> str:
    """What checks have in common that differ in numbers and names only."""
    plain = [(check, plain_values(check)) for check in checks]
    return repr([(check.code.text, check.channel, *(values.get(case) for case in CASES)) for check, values in plain])


def plain_values(check: Check) -> dict[str, Any]:
    """The values of a check as plain data for a file: numbers under their name with its unit, names, codes.

    Examples
    --------
    >>> plain_values(Check(Code.K1_BRANCH, Verdict.WARNING, values={"branch": Branch.LOADING, "tests": ("S1",)}))
    {'branch': 'loading', 'tests': ['S1']}
    """
    return {f"{name} [{UNITS[name]}]" if name in UNITS else name: _plain(value) for name, value in check.values.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.name.lower().replace("_", " ")
    if isinstance(value, Message):
        return [value.code, value.site]
    if isinstance(value, Check):
        return {"code": value.code.text, **plain_values(value)}
    if hasattr(value, "source"):  # a cause of a misfit
        return value.source.text
    if isinstance(value, tuple | list):
        return [_plain(part) for part in value]
    if isinstance(value, str | bool | int):
        return value
    number = float(value)
    return number if isfinite(number) else None


# ---- words that are more than a value in a blank

_Values = Mapping[str, Any]


def _and(names: _Values | Any) -> str:
    return " and ".join(names)


def interval_words(low: float, high: float, unit: str) -> str:
    """An interval of probability `COVERAGE` by Monte Carlo."""
    if not isfinite(low):
        return " without a limit"
    upper = f"and {high:.3g} {unit}" if isfinite(high) else "and no upper limit"
    return f" between {low:.3g} {unit} {upper} ({100 * COVERAGE:g} % by Monte Carlo)"


def _halves(values: _Values) -> dict[str, str]:
    change = f"{100 * values['gain']:.2g} %" if "gain" in values else ""
    cause = "look for a loose sensor or a drifting gain"
    if "phase" in values:
        change = f"{degrees(values['phase']):.2g} degrees, as by a clock {values['ppm']:.0f} ppm off,"
        cause = "record all channels by one clock"
    causes = f"{cause}; if the specimen changed, let it settle first" if values["specimen"] else cause
    return {"change": change, "others": _and(values["others"]), "causes": causes}


def _late(values: _Values) -> dict[str, str]:
    delay = values["delay"]
    which = "V2 after F1" if delay > 0 else "F1 after V2"
    return {"looks": f", as by a delay of {which} of {1e3 * abs(delay):.2g} ms" if isfinite(delay) else ""}


def _consistency(values: _Values) -> dict[str, str]:
    looks = " or ".join(look.value for look in values["looks"])
    return {"looks": f"; {looks}" if looks else ""}


def _cut(values: _Values) -> dict[str, str]:
    before, after = values["before"], values["after"]
    start = [f"the first {before:.3g} s (lead-in, run-up)"] if before > 0 else []
    return {"cut": " and ".join([*start, *([f"the last {after:.3g} s (run-down)"] if after > 0 else [])])}


def _because(values: _Values) -> dict[str, str]:
    because = values["because"]
    return {"why": remark_of(because) if isinstance(because, Check) else str(because)}


def _k1(values: _Values) -> dict[str, str]:
    """Values that only one side states, then the doubts about static tests."""
    one_sided = [f"the {axis} is stated of {side.value} only and taken as the same" for axis, side in values["sides"]]
    parts = [f"K1 from {', '.join(values['tests'])}: {'; '.join(one_sided)}"] if one_sided else []
    doubts = [f"K1 from {name}: {'; '.join(map(remark_of, checks))}" for name, checks in values["doubts"]]
    return {"why": "; ".join([*parts, *doubts])}


def _k1_temperature(values: _Values) -> dict[str, str]:
    return {"names": ", ".join(values["tests"]), "side": "below" if values["there"] < values["own"] else "above"}


def _k1_branch(values: _Values) -> dict[str, str]:
    subject = f"K1 from {', '.join(values['tests'])}" if values["tests"] else "K1"
    return {"said": f"{subject} is {values['branch'].value}"}


def why_no_k1(values: _Values) -> dict[str, str]:
    """Why a dynamic test has no K1, and the remedy."""
    if values["because"] is NoK1.NO_PRELOAD:
        why, remedy = "no preload is stated, so K1 cannot be read off the static curve", "fill in preload [N]"
    elif values["because"] is NoK1.NO_TEST:
        at = ", ".join(f"{pressure / 1e5:.3g} bar" for pressure in values["pressures"])
        state = ", ".join(["this pressure", *values["axes"]])
        there = f"; static tests of it are at {at}" if at else ""
        why = f"no static test of tyre {values['tyre']!r} at {state}{there}"
        remedy = "add one, or state K1 [N/m] in tests.csv"
    else:
        sentences = [said(check) for check in values["checks"]]
        causes = "; ".join(dict.fromkeys(sentence.cause.rstrip(":; ") for sentence in sentences))
        why = f"no K1 at {values['preload']:.6g} N: static test {values['test']!r} was rejected: {causes}"
        remedy = " or ".join(dict.fromkeys(sentence.remedy for sentence in sentences if sentence.remedy))
    return {"why": why, "remedy": remedy}


def _passive_arm(values: _Values) -> dict[str, str]:
    if "because" in values:
        why, remedy = values["because"].says(complex(values["storage"], values["loss_modulus"]), values["k1"])
        return {"why": why, "remedy": remedy}
    return {"interval": interval_words(values["low K2"], values["high K2"], "N/m")}


def _uncertainty(values: _Values) -> dict[str, str]:
    name = values["name"]
    if f"low {name}" not in values:
        return {"interval": " so its interval is not symmetric"}
    return {"interval": interval_words(values[f"low {name}"], values[f"high {name}"], UNITS[f"low {name}"])}


def _rig(values: _Values) -> dict[str, str]:
    return {"causes": explained(values["causes"])}


#: Words for a misfit that no candidate explains.
_NO_CAUSE = (
    "no single error of a sensor or part of the rig explains it: look for what moves otherwise than stated (a frame, a "
    "foundation, a mass that rocks, friction in a guide, a spring that is not linear), and for a sensor not linear"
)


def explained(causes: Any) -> str:
    """What explains a misfit, in words; causes that explain it equally well stand together."""
    named = [cause.text for cause in causes]
    return f"best explained by {', or '.join(named)}" if named else _NO_CAUSE


def _exchanged_k1(values: _Values) -> dict[str, str]:
    named = [f"{tyre} at {pressure / 1e5:.4g} bar" if pressure else tyre for tyre, pressure in values["statics"]]
    return {"names": _and(named)}


def excitation_words(excitation: tuple[Excitation, float]) -> str:
    """An excitation with its level of deflection [mm]; the level of sines may change with their frequency."""
    kind, level = excitation
    return kind.value if kind is Excitation.SINES else f"{kind.value} of {level:.3g} mm"


def _excitations(values: _Values) -> dict[str, str]:
    return {"softer": excitation_words(values["softer"]), "stiffer": excitation_words(values["stiffer"])}


#: The words of codes whose sentences need more than their values.
_WORDS: dict[Code, Callable[[_Values], dict[str, str]]] = {
    Code.HALVES: _halves,
    Code.POOLED: _late,
    Code.SHARED: lambda values: {"pair": _and(values["pair"])},
    Code.CONSISTENCY: _consistency,
    Code.V1_SCALE: lambda values: {"looks": values["looks"].value},
    Code.STEADY: _cut,
    Code.LEFT_OUT: _because,
    Code.CONSTANT: lambda values: {"why": values.get("error", "no channel moves: check that the drive runs")},
    Code.K1: _k1,
    Code.K1_TEMPERATURE: _k1_temperature,
    Code.K1_MIXED: lambda values: {"axes": _and(values["axes"])},
    Code.K1_BRANCH: _k1_branch,
    Code.NO_K1: why_no_k1,
    Code.PASSIVE_ARM: _passive_arm,
    Code.UNCERTAINTY: _uncertainty,
    Code.RIG: _rig,
    Code.K1_EXCHANGED: _exchanged_k1,
    Code.EXCITATIONS: _excitations,
    Code.COPY: lambda values: {"others": _and(values["tests"])},
    Code.EXCHANGED: lambda values: {"names": _and(values["tests"])},
}
