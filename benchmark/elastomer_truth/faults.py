"""Faults of a laboratory that its files do not mention."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from elastomer_truth.laboratory import PER_KELVIN, Fault, Laboratory, Test, Value

Apply = Callable[[Laboratory, float, np.random.Generator], None]


def _value(name: str, relative: bool = True) -> Apply:
    """The true value is another one: times 1 + size, or larger by size."""

    def apply(lab: Laboratory, size: float, _: np.random.Generator) -> None:
        value = lab.values.setdefault(name, Value(0.0))
        value.true = value.true * (1 + size) if relative else value.true + size

    return apply


def _sensor(role: str, name: str) -> Apply:
    """An error of a channel: of its gain, a factor; of its phase, delay or low-cut a sum."""

    def apply(lab: Laboratory, size: float, _: np.random.Generator) -> None:
        value = getattr(lab.sensors[role], name)
        value.true = value.true * (1 + size) if name == "gain" else value.true + size

    return apply


def _flaw(role: str, name: str) -> Apply:
    def apply(lab: Laboratory, size: float, _: np.random.Generator) -> None:
        lab.sensors[role].flaws[name] = size

    return apply


def _frame(lab: Laboratory, size: float, _: np.random.Generator) -> None:
    """A frame that gives way: its stiffness over that of the preload spring, or of the specimen on a bench."""
    spring = lab.true("preload spring") or max(one.stiffness for one in lab.specimens.values())
    mass = 10 * (lab.true("moving mass") or 10.0)
    damping = 0.04 * (size * spring * mass) ** 0.5
    lab.values |= {"frame stiffness": Value(size * spring), "frame mass": Value(mass), "frame damping": Value(damping)}


def _fixture(lab: Laboratory, size: float, _: np.random.Generator) -> None:
    """A part between V1 and the specimen that gives way: its compliance over that of the specimen."""
    softest = min(one.stiffness for one in lab.specimens.values())
    lab.sensors["V1"].flaws["fixture"] = size / softest


def _jitter(lab: Laboratory, size: float, rng: np.random.Generator) -> None:
    for test in _dynamic(lab):
        test.flaws.setdefault("V2", {})["jitter"] = size * float(rng.standard_normal())


def _specimens(name: str) -> Apply:
    """All specimens scatter, drift, or warm up by nobody's knowledge."""

    def apply(lab: Laboratory, size: float, rng: np.random.Generator) -> None:
        for test in _dynamic(lab):
            stiffer, lossier = test.factors
            if name == "scatter":
                stiffer *= 1 + size * float(rng.standard_normal())
            elif name == "drift":
                stiffer *= 1 + size * test.place
            else:
                warm = size * (1 - np.exp(-3 * test.place))
                stiffer, lossier = stiffer * (1 + PER_KELVIN[0] * warm), lossier * (1 + PER_KELVIN[1] * warm)
            test.factors = stiffer, lossier

    return apply


def _one_test(change: Callable[[Laboratory, Test, float], None], loaded: bool = False) -> Apply:
    """A fault of one test between the lowest and the highest frequency."""

    def apply(lab: Laboratory, size: float, rng: np.random.Generator) -> None:
        tests = [test for test in _dynamic(lab) if not loaded or not test.added_mass]
        ends = min(test.frequency for test in tests), max(test.frequency for test in tests)
        inner = [test for test in tests if ends[0] < test.frequency < ends[1]] or tests
        test = inner[int(rng.integers(len(inner)))]
        change(lab, test, size)
        lab.faults[-1].part = test.name

    return apply


def _other_gain(_: Laboratory, test: Test, size: float) -> None:
    flaws = test.flaws.setdefault("V1", {})
    flaws["factor"] = flaws.get("factor", 1.0) * (1 + size)  # type: ignore[operator]


def _mass_left(_: Laboratory, test: Test, size: float) -> None:
    test.true["mass left on"] = size


def _other_preload(_: Laboratory, test: Test, size: float) -> None:
    test.true["preload"] = test.preload * (1 + size)


def _copied(lab: Laboratory, test: Test, _: float) -> None:
    others = [this for this in _dynamic(lab) if this.specimen == test.specimen and this.added_mass == test.added_mass]
    test.file_of = min((o for o in others if o is not test), key=lambda o: abs(o.frequency - test.frequency)).name


def _swapped(lab: Laboratory, size: float, rng: np.random.Generator) -> None:
    """The files of two tests are exchanged, which differ in the added mass."""
    del size
    plain = [test for test in _dynamic(lab) if not test.added_mass]
    one = plain[int(rng.integers(1, len(plain) - 1))]
    alike = (one.specimen, one.frequency, one.preload)
    heavier = [test for test in _dynamic(lab) if test.added_mass]
    other = next(test for test in heavier if (test.specimen, test.frequency, test.preload) == alike)
    one.file_of, other.file_of = other.name, one.name
    lab.faults[-1].part = one.name


def _added(lab: Laboratory, size: float, _: np.random.Generator) -> None:
    lab.added_mass.true *= 1 + size


def _dynamic(lab: Laboratory) -> list[Test]:
    return [test for test in lab.tests if test.kind != "static"]


def _always(_: Laboratory) -> bool:
    return True


def _moves(lab: Laboratory) -> bool:
    return not lab.blocked


def _linear_sines(lab: Laboratory) -> bool:
    return _sines(lab) and not any(one.slip for one in lab.specimens.values())


def _sines(lab: Laboratory) -> bool:
    return any(test.kind == "sine" for test in lab.tests)


def _moving_sines(lab: Laboratory) -> bool:
    return _moves(lab) and _sines(lab)


def _weighed(lab: Laboratory) -> bool:
    return bool(lab.added_mass.stated)


#: Name: cause, part, sizes, how it is applied, where it can be, and whether it is linear and the same in all tests.
FAULTS: dict[str, tuple[str, str, tuple[float, ...], Apply, Callable[[Laboratory], bool], bool]] = {
    "moving mass": ("moving mass", "rig", (0.05, 0.1, -0.07), _value("moving mass"), _moves, True),
    "preload spring": ("preload spring", "rig", (-0.25, 0.2), _value("preload spring"), _moves, True),
    "preload damping": ("preload damping", "rig", (150.0, 300.0), _value("preload damping", False), _moves, True),
    "input mass": ("input mass", "rig", (0.5, 1.5), _value("input mass", False), _always, True),
    "soft frame": ("frame", "rig", (5.0, 8.0), _frame, _always, True),
    "soft fixture": ("fixture", "V1", (0.05, 0.1), _fixture, _always, True),
    "guide friction": ("friction", "rig", (8.0, 20.0), _value("guide friction", False), _moving_sines, False),
    "base motion": ("base motion", "rig", (0.02, 0.05), _value("base motion", False), _moves, True),
    "gain of F1": ("gain", "F1", (0.06, -0.08), _sensor("F1", "gain"), _always, True),
    "gain of V1": ("gain", "V1", (0.06, -0.08), _sensor("V1", "gain"), _always, True),
    "gain of V2": ("gain", "V2", (0.06, -0.08), _sensor("V2", "gain"), _moves, True),
    "F1 late": ("delay", "F1", (5e-4, 3e-4), _sensor("F1", "delay"), _always, True),
    "V1 late": ("delay", "V1", (5e-4, 3e-4), _sensor("V1", "delay"), _always, True),
    "V2 late": ("delay", "V2", (5e-4, 3e-4), _sensor("V2", "delay"), _moves, True),
    "low-cut of V1": ("low-cut", "V1", (1.0, 2.0), _sensor("V1", "low_cut"), _always, True),
    "F1 in kgf": ("unit", "F1", (1 / 9.80665 - 1,), _sensor("F1", "gain"), _always, True),
    "V2 with the other sign": ("sign", "V2", (-2.0,), _sensor("V2", "gain"), _moves, True),
    "gain of F1 drifts": ("gain drift", "F1", (0.04, -0.06), _flaw("F1", "drift"), _sines, True),
    "cross-talk of V1 in V2": ("cross-talk", "V2", (0.02, 0.04), _flaw("V2", "crosstalk"), _moves, True),
    "soft clipping of F1": ("clipping", "F1", (0.5, 0.7), _flaw("F1", "limit"), _sines, False),
    "soft clipping of V1": ("clipping", "V1", (0.5, 0.7), _flaw("V1", "limit"), _sines, False),
    "hum of V1": ("hum", "V1", (0.05, 0.2), _flaw("V1", "hum"), _always, False),
    "alias in F1": ("tone", "F1", (0.1, 0.2), _flaw("F1", "tone"), _always, False),
    "drop-outs of F1": ("drop-outs", "F1", (0.03, 0.06), _flaw("F1", "dropouts"), _always, False),
    "noise of V2": ("noise", "V2", (0.1, 0.2), _flaw("V2", "noise"), _moves, False),
    "trigger of V2 jitters": ("jitter", "V2", (3e-4, 5e-4), _jitter, _moving_sines, False),
    "scatter": ("scatter", "specimen", (0.015, 0.03), _specimens("scatter"), _sines, False),
    "drift": ("drift", "specimen", (0.04, -0.06), _specimens("drift"), _sines, True),
    "heating": ("drift", "specimen", (12.0, 20.0), _specimens("heating"), _sines, True),
    "one test: gain of V1": ("one test", "", (0.2, -0.15), _one_test(_other_gain), _sines, False),
    "one test: mass left on": ("one test", "", (4.0, 6.0), _one_test(_mass_left, True), _moving_sines, False),
    "one test: preload": ("one test", "", (0.6, 1.0), _one_test(_other_preload), _linear_sines, False),
    "one test: file of another": ("one test", "", (0.0,), _one_test(_copied), _sines, False),
    "two files exchanged": ("one test", "", (0.0,), _swapped, lambda lab: _weighed(lab) and _sines(lab), False),
    "added mass": ("added mass", "added mass", (-0.05, 0.05), _added, _weighed, True),
    "gain of the load": ("static gain", "load", (0.05, -0.06), _sensor("load", "gain"), _always, False),
    "frame in the deflection": ("static frame", "deflection", (5e-7,), _flaw("deflection", "frame"), _always, False),
}


#: Unit of a size, and units per SI unit; other sizes are shares.
_UNITS = {
    "preload damping": ("N s/m", 1.0), "input mass": ("kg", 1.0), "guide friction": ("N", 1.0),
    "low-cut of V1": ("Hz", 1.0), "heating": ("K", 1.0), "one test: mass left on": ("kg", 1.0),
    "frame in the deflection": ("mm/kN", 1e6), "soft frame": ("times the spring", 1.0),
    **dict.fromkeys(("F1 late", "V1 late", "V2 late", "trigger of V2 jitters"), ("ms", 1e3)),
}  # fmt: skip
#: Faults whose size says nothing.
_WHOLE = ("F1 in kgf", "V2 with the other sign", "one test: file of another", "two files exchanged")


def sized(name: str, size: float) -> str:
    """The size of a fault in words; blank for one that has none.

    Examples
    --------
    >>> sized("gain of F1", -0.08), sized("V1 late", 5e-4)
    ('-8 %', '0.5 ms')
    """
    if name in _WHOLE:
        return ""
    unit, factor = _UNITS.get(name, ("", 1.0))
    return f"{factor * size:g} {unit}" if unit else f"{100 * size:+g} %"


def add_faults(rng: np.random.Generator, lab: Laboratory) -> None:
    """One fault, or in each third laboratory two."""
    able = [name for name, (*_, where, _linear) in FAULTS.items() if where(lab)]
    # Each fault stands once before one stands twice: the first is chosen by the number of the campaign.
    number = int(lab.name[1:]) - 1
    first = list(FAULTS)[number % len(FAULTS)]
    chosen = [first if first in able else str(rng.choice(able))]
    if rng.random() < 1 / 3:
        chosen.append(str(rng.choice([name for name in able if FAULTS[name][0] != FAULTS[chosen[0]][0]])))
    for name in chosen:
        apply_fault(lab, name, float(rng.choice(FAULTS[name][2])), rng)


def apply_fault(lab: Laboratory, name: str, size: float, rng: np.random.Generator) -> None:
    """Put a fault of this name and size into a laboratory."""
    cause, part, _, apply, _where, linear = FAULTS[name]
    lab.faults.append(Fault(name, cause, part, size, linear))
    apply(lab, size, rng)


def described(fault: Fault) -> dict[str, Any]:
    """A fault as a row of the truth."""
    return {"fault": fault.name, "cause": fault.cause, "channel or part": fault.part, "size": fault.size}
