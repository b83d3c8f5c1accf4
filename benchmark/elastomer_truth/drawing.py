"""A laboratory from a seed: honest, with unstated ordinary parts, or with faults that its files do not mention."""

from __future__ import annotations

import math

import numpy as np

from elastomer_truth.faults import add_faults
from elastomer_truth.laboratory import CHAINS, PER_KELVIN, Laboratory, Sensor, Specimen, Test, Value

#: Number of campaigns of each tier, and the letter of their names.
TIERS = {"honest": 80, "ordinary": 60, "faulty": 60}
#: Largest number of recordings of a campaign, and length of those over a band [s]; a sine has 3 to 5 s.
MOST_RECORDINGS = 24
_LENGTHS = {"random": 30.0, "sweep": 24.0, "multisine": 20.0}
_RIGS = ("paper", "servohydraulic", "soft", "stiff", "blocked, F1 at the drive", "blocked, F1 at the ground")
_RIG_SHARES = (0.3, 0.2, 0.15, 0.1, 0.15, 0.1)
#: Moving mass [kg], preload spring [N/m], specimen [N/m], preload [N] and band [Hz], lowest to highest.
_SIZES = {
    "paper": ((13, 17), (10e3, 15e3), (9e4, 2.2e5), (800, 2500), (5, 38)),
    "servohydraulic": ((40, 80), (2e4, 6e4), (2e5, 6e5), (1500, 4000), (4, 36)),
    "soft": ((20, 40), (4e3, 8e3), (1e5, 3e5), (800, 2500), (6, 46)),
    "stiff": ((8, 20), (6e4, 2e5), (1.5e5, 4e5), (800, 2500), (6, 46)),
    "blocked": ((0, 0), (0, 0), (1e5, 2e6), (500, 3000), (5, 95)),
}
_QUANTITIES = {
    "paper": ("velocity", "velocity"),
    "servohydraulic": ("displacement", "acceleration"),
    "soft": ("acceleration", "acceleration"),
    "stiff": ("velocity", "acceleration"),
    "blocked": ("displacement", "acceleration"),
}
_UNITS = {
    "force": (("N", 1.0), ("kN", 1e-3)),
    "displacement": (("mm", 1e3), ("m", 1.0)),
    "velocity": (("m/s", 1.0), ("mm/s", 1e3)),
    "acceleration": (("m/s2", 1.0),),
}
_KINDS = ("massless", "belt", "two masses", "mount", "hydromount", "Payne")


def names() -> list[str]:
    """Names of all campaigns, tier by tier, as H001."""
    return [f"{tier[0].upper()}{at:03d}" for tier, count in TIERS.items() for at in range(1, count + 1)]


def tier_of(name: str) -> str:
    """The tier of a campaign by its name."""
    found = [tier for tier in TIERS if tier[0].upper() == name[:1]]
    if not found or not name[1:].isdigit():
        raise ValueError(f"{name}: no name of a campaign; names are H001 to H080, O001 to O060 and F001 to F060")
    return found[0]


def draw(name: str) -> Laboratory:
    """The laboratory of this name, which is its seed.

    Examples
    --------
    >>> draw("H001").tier
    'honest'
    """
    tier, number = tier_of(name), int(name[1:])
    seed = 1000 * (1 + list(TIERS).index(tier)) + number
    rng = np.random.default_rng(seed)
    # Each second faulty laboratories leaves ordinary parts out, too.
    stated = tier == "honest" or (tier == "faulty" and number % 2 == 1)
    rig = str(rng.choice(_RIGS, p=_RIG_SHARES))
    key = rig.split(",", maxsplit=1)[0]
    excitation = str(rng.choice(["sine", "random", "sweep", "multisine"], p=[0.7, 0.12, 0.09, 0.09]))
    steps = excitation == "sine"
    kinds = [kind for kind in _KINDS if steps or kind != "Payne"]
    specimens = [_specimen(rng, f"specimen {letter}", str(rng.choice(kinds)), key, stated, steps)
                 for letter in "AB"[: 1 + int(steps and rng.random() < 0.25)]]  # fmt: skip
    if len(specimens) == 2:
        specimens[1] = _specimen(rng, "specimen B", specimens[0].kind, key, stated, steps)
    added = Value(0.0)
    if key != "blocked" and rng.random() < 0.6:
        u = float(10 ** rng.uniform(-3.3, -2.7)) * 10.0
        added = _known(rng, 10.0, u)
    rate = int(rng.choice([1024, 2048]))
    simultaneous = bool(rng.random() < 0.6)
    skew = {}
    if not simultaneous:
        skew = {role: at * float(rng.choice([5e-6, 1e-5])) for at, role in enumerate(("F1", "V1", "V2"))}
    lab = Laboratory(
        name, seed, tier, rig, _values(rng, rig, key, stated, steps), _sensors(rng, key, stated),
        {one.name: one for one in specimens}, [], added, rate, simultaneous, skew if not stated else {},
        None, int(rng.choice([12, 16, 24], p=[0.15, 0.45, 0.4])),
    )  # fmt: skip
    lab.tests = _tests(rng, lab, key, excitation)
    _scale(rng, lab)
    _repeat(rng, lab)
    if tier == "faulty":
        add_faults(rng, lab)
    return lab


def _known(rng: np.random.Generator, stated: float, u: float) -> Value:
    """A value whose statement is off by a normal error of its standard uncertainty."""
    return Value(stated + u * float(rng.standard_normal()), stated, u)


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """A value between two, uniform in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _specimen(rng: np.random.Generator, name: str, kind: str, key: str, stated: bool, steps: bool) -> Specimen:
    stiffness = _between(rng, *_SIZES[key][2])
    times = np.geomspace(3e-4, 8.0, 6)
    arms = [(float(g), float(time)) for g, time in zip(rng.uniform(0.02, 0.12, 6), times, strict=True)]
    top = _SIZES[key][4][1]
    bend = float(rng.uniform(0.0, 0.15)) * stiffness**2 / (4 * _SIZES[key][3][1])
    made = Specimen(name, kind, stiffness, bend, arms, Value(0.0))
    if kind in CHAINS:
        # The first own frequency lies 1.6 to 4 times above the band.
        mass = 4 * stiffness / (2 * math.pi * top * rng.uniform(1.6, 4.0)) ** 2
        mass *= {"belt": 1.0, "two masses": 3.0, "mount": 2.0}[kind]
        made.mass = _known(rng, mass, 0.02 * mass) if stated else Value(mass)
        made.share = _between(rng, 0.15, 0.6)
    if kind == "hydromount":
        made.track = float(rng.uniform(0.3, 1.0)), float(rng.uniform(9.0, 16.0)), float(rng.uniform(0.15, 0.4))
    if kind == "Payne":
        made.slip = [(float(rng.uniform(0.05, 0.2)), float(z)) for z in (3e-5, 1.5e-4, 7e-4)]
    wear = rng.random()
    if wear < 0.2:
        size = float(10 ** rng.uniform(-3.3, -2.3))
        made.scatter = Value(size, size if stated else None)
    elif wear < 0.4:
        u = float(10 ** rng.uniform(-2.7, -2.0))
        made.drift = Value(u * float(rng.standard_normal()), 0.0 if stated else None, u if stated else 0.0)
    elif wear < 0.5 and steps:
        made.heating = float(rng.uniform(2.0, 12.0))
    return made


def _values(rng: np.random.Generator, rig: str, key: str, stated: bool, steps: bool) -> dict[str, Value]:
    """The rig as it is and as stated; ordinary parts are there in each second laboratory that does not state them."""
    mass, spring, specimen, *_ = _SIZES[key]

    def ordinary() -> bool:
        return bool(not stated and rng.random() < 0.5)

    found: dict[str, Value] = {}
    if key != "blocked":
        m, k = _between(rng, *mass), _between(rng, *spring)
        found["moving mass"] = _known(rng, round(m, 2), m * _between(rng, 1e-3, 1e-2))
        found["preload spring"] = _known(rng, round(k, -1), k * _between(rng, 2e-3, 2e-2))
        damping = 2 * math.sqrt(k * m) * _between(rng, 3e-3, 3e-2)
        u = damping * 0.1
        found["preload damping"] = _known(rng, round(damping, 1), u) if stated else Value(damping)
        if ordinary():
            found["frame stiffness"] = Value(k * _between(rng, 100, 1000))
            found["frame mass"] = Value(10 * m)
        if ordinary() and steps:
            found["guide friction"] = Value(_between(rng, 0.2, 2.0))
        if ordinary():
            found["cable stiffness"] = Value(_between(rng, 50, 500))
            found["cable damping"] = Value(_between(rng, 0.5, 5.0))
    elif ordinary():
        found["frame stiffness"] = Value(specimen[1] * _between(rng, 20, 200))
        found["frame mass"] = Value(_between(rng, 30, 150))
    if "frame stiffness" in found:
        frame = math.sqrt(found["frame stiffness"].true * found["frame mass"].true)
        found["frame damping"] = Value(0.04 * frame)
    if ordinary():
        found["base motion"] = Value(_between(rng, 1e-4, 1e-3))
    if "drive" in rig or (key != "blocked" and rng.random() < 0.3):
        w = _between(rng, 0.2, 1.0)
        if stated:
            found["input mass"] = _known(rng, round(w, 3), 0.01 * w)
        elif ordinary():
            found["input mass"] = Value(0.1 * w)
    return found


def _sensors(rng: np.random.Generator, key: str, stated: bool) -> dict[str, Sensor]:
    fine = _between(rng, 5e-4, 1e-2)
    made = {}
    for role, column in (("F1", "force"), ("V1", "drive side"), ("V2", "far side")):
        if role == "V2" and key == "blocked":
            continue
        quantity = "force" if role == "F1" else _QUANTITIES[key][role == "V2"]
        u, angle = fine * _between(rng, 0.7, 1.5), fine * _between(rng, 0.2, 0.6)
        delay, late, cut, slope = 10e-6, 0.0, 0.0, 0.001
        if quantity == "acceleration" or (quantity == "force" and rng.random() < 0.3):
            cut = _between(rng, 0.05, 0.3)
        if stated:
            late = float(rng.choice([0.0, 2e-4]))
        mounting = min(0.5 * u, 0.002) if role == "V1" else 0.0
        unit, scale = _UNITS[quantity][rng.integers(len(_UNITS[quantity]))]
        made[role] = Sensor(
            f"{column} [{unit}]", role, quantity, unit, scale,
            # The part of one mounting is within u.
            Value(1 + math.sqrt(u**2 - mounting**2) * float(rng.standard_normal()), 1.0, u),
            _known(rng, 0.0, angle),
            _known(rng, late, 2e-6) if stated else Value(delay * float(rng.standard_normal())),
            (_known(rng, cut, 0.1 * cut) if stated else Value(cut)),
            _known(rng, 0.0, slope / 3) if stated else Value(slope * float(rng.standard_normal())),
            Value(mounting, mounting if stated else None),
        )  # fmt: skip
        made[role].low_cut.true = max(made[role].low_cut.true, 0.0)
        if rng.random() < 0.3:
            made[role].low_pass = 400.0
    for role, column, quantity, unit, scale in (
        ("load", "load", "force", "N", 1.0), ("deflection", "deflection", "displacement", "mm", 1e3),
    ):  # fmt: skip
        u = fine * _between(rng, 0.3, 1.0)
        line = 1e-3 if not stated else 3e-4
        made[role] = Sensor(f"{column} [{unit}]", role, quantity, unit, scale, _known(rng, 1.0, u), Value(0.0),
                            Value(0.0), Value(0.0), Value(0.0), Value(0.0),
                            Value(line * float(rng.standard_normal()), 0.0 if stated else None, line))  # fmt: skip
    return made


def _tests(rng: np.random.Generator, lab: Laboratory, key: str, excitation: str) -> list[Test]:
    """The rows of the campaign in the order in which they are run."""
    low, high = _SIZES[key][4]
    ends = _SIZES[key][3]
    preloads = sorted(
        round(_between(rng, *ends), -1) for _ in range(1 + int(excitation == "sine" and rng.random() < 0.25))
    )
    tests = [
        Test(f"S{at + 1}", "static", one, preload, duration=60.0)
        for at, (one, preload) in enumerate((one, preload) for one in lab.specimens for preload in preloads)
    ]
    masses = [0.0, lab.added_mass.stated] if lab.added_mass.stated else [0.0]
    blocks = [(one, preload, mass) for one in lab.specimens for mass in masses for preload in preloads]
    if excitation != "sine":
        duration = _LENGTHS[excitation]
        for at, (one, preload, mass) in enumerate(block for block in blocks for _ in range(2)):
            letter = {"random": "R", "sweep": "W", "multisine": "M"}[excitation]
            tests.append(Test(f"{letter}{at + 1}", excitation, one, preload, band=(low, high),
                              added_mass=mass, duration=duration))  # fmt: skip
        return tests
    count = min(10, (MOST_RECORDINGS - len(tests)) // len(blocks))
    frequencies = np.geomspace(low * rng.uniform(0.9, 1.2), high * rng.uniform(0.8, 1.0), count).round(1)
    at = 0
    for one, preload, mass in blocks:
        for frequency in rng.permutation(frequencies):
            at += 1
            tests.append(Test(f"D{at}", "sine", one, preload, float(frequency) + 0.07, added_mass=mass,
                              duration=float(rng.choice([3.0, 4.0, 5.0]))))  # fmt: skip
    return tests


def _scale(rng: np.random.Generator, lab: Laboratory) -> None:
    """Amplitudes of the drive, noise and full scale of the sensors, phases and times of the tests."""
    top = dict.fromkeys(("F1", "V1", "V2"), 0.0)
    dynamic = [test for test in lab.tests if test.kind != "static"]
    level = float(rng.uniform(0.2, 0.5))
    for at, test in enumerate(dynamic):
        test.place = at / max(len(dynamic) - 1, 1)
        test.start = 600.0 + 240.0 * at
        test.phase = float(rng.uniform(0, 2 * math.pi))
        # Excitation over a band has a largest deflection of some three standard deviations.
        f = np.array([test.frequency]) if test.frequency else np.geomspace(*(test.band or (1.0, 1.0)), 40)
        found = np.abs(lab.network(test).state_space().transfer(2 * np.pi * f))
        test.amplitude = min(1.5e-3, float((level * test.preload / found[:, 1]).min()))
        top["F1"] = max(top["F1"], test.amplitude * found[:, 1].max())
        for role, column in (("V1", 0), ("V2", 2)):
            if role in lab.sensors:
                power = {"displacement": 0, "velocity": 1, "acceleration": 2}[lab.sensors[role].quantity]
                top[role] = max(top[role], float(test.amplitude * (found[:, column] * (2 * np.pi * f) ** power).max()))
    for role in [role for role in top if role in lab.sensors]:
        lab.sensors[role].full_scale = 3.0 * top[role]
        lab.sensors[role].noise = top[role] * _between(rng, 1e-4, 2e-3)
    largest = 1.6 * max(test.preload for test in lab.tests)
    lab.sensors["load"].full_scale, lab.sensors["load"].noise = 2 * largest, 2e-4 * largest
    softest = min(one.stiffness for one in lab.specimens.values())
    lab.sensors["deflection"].full_scale, lab.sensors["deflection"].noise = (
        2 * largest / softest,
        1e-4 * largest / softest,
    )


def _repeat(rng: np.random.Generator, lab: Laboratory) -> None:
    """What differs from test to test of one specimen: scatter, drift over the run, temperature, mounting of V1."""
    gains = {name: float(rng.standard_normal()) for name in lab.specimens}
    for test in lab.tests:
        if test.kind == "static":
            continue
        one = lab.specimens[test.specimen]
        warm = one.heating * (1 - math.exp(-3 * test.place))
        change = 1 + one.drift.true * (test.place - 0.5) + one.scatter.true * float(rng.standard_normal())
        test.factors = change * (1 + PER_KELVIN[0] * warm), 1 + PER_KELVIN[1] * warm
        test.true["temperature rise"] = warm
        mounting = lab.sensors["V1"].mounting.true * gains[test.specimen]
        test.flaws.setdefault("V1", {})["factor"] = 1 + mounting
