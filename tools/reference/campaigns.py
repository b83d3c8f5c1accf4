"""Whole campaigns: the paper's route, a bench, static tests, tests that must be rejected; and a list of all."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence

from mpmath import matrix, mp, mpc, mpf

from reference.campaign import WITHIN, Campaign, noise_of, parts_of, recorded, spread, table_text, u_head
from reference.mechanics import arm_of
from reference.physics import J, Numbers, rig_impedance, turning
from reference.weighed_mass import joint

# The paper's route

_PAPER = """title = "Reference: the paper's route"

[unstated]
ordinary = "zero"

[rig]
moving_mass       = { value = 15.0, unit = "kg", std = 0.01 }
preload_stiffness = { value = 12.44, unit = "kN/m", std = 0.02 }
preload_damping   = { value = 20, unit = "N s/m", std = 0.5 }

[channels]
sample_rate = "300 Hz"
force_in   = { column = "F1", unit = "N", std_gain = "0.1 %", std_phase = "0.05 deg" }
motion_in  = { column = "V1", unit = "m/s", std_gain = "0.08 %", std_phase = "0.04 deg" }
load       = { column = "F", unit = "N", exact = true }
deflection = { column = "x", unit = "mm", exact = true }

[tyres.reference]
"""


def paper() -> Campaign:
    """One tyre, five frequencies and a static test; gains, phases and rig with uncertainties, correctly stated."""
    made = Campaign("paper-route", "mobility", _PAPER, "test,file,kind,tyre,pressure [bar],preload [N]", 82)
    slope, bend = mpf("150e3"), mpf("2.5e6")
    load = mpf(1200)
    place = (-slope + mp.sqrt(slope**2 + 4 * bend * load)) / (2 * bend)
    k1 = slope + 2 * bend * place
    u_k1 = _static(made, "S1", (slope, bend, mpf(0)), mpf(900), mpf("0.05"))
    made.tests.append("S1,recordings/S1.csv,static,reference,1.7,")
    made.expect("static", "test=S1", "K1 [N/m]", k1, WITHIN * u_k1, "tangent of the polynomial; noise of the load")
    for at, frequency in enumerate((10.0, 13.0, 16.0, 19.5, 24.0), start=1):
        test = f"D{at}"
        v = {"K1": k1, "K2": mpf(120e3), "C": mpf(700), "m": mpf(15), "K3": mpf(12440), "c3": mpf(20)}
        v["frequency"] = mpf(frequency)
        found = recorded(v)
        used = {name: found[name] for name in ("F1", "V1")}
        made.tones(test, used, frequency, {"F1": 1200.0})
        made.tests.append(f"{test},recordings/{test}.csv,dynamic,reference,1.7,1200")
        _expect_by_paper(made, test, {**v, **parts_of(used)}, used, u_k1)
    return made


def _by_paper(w: Numbers) -> dict[str, mpf]:
    """Results of the paper's route, by their columns, from F1, V1, K1 and the rig."""
    f1, v1 = mpc(w["Re F1"], w["Im F1"]), mpc(w["Re V1"], w["Im V1"])
    stiffness = f1 / ((v1 - f1 / rig_impedance(w)) / (J * turning(w)))
    arm = arm_of({**w, "Re K*": stiffness.real, "Im K*": stiffness.imag})
    ratio = stiffness / (stiffness + J * turning(w) * rig_impedance(w))
    return {
        "Re K* [N/m]": stiffness.real, "Im K* [N/m]": stiffness.imag, "K2 [N/m]": arm["K2"],
        "C [N s/m]": arm["C"], "TR predicted [1]": abs(ratio),
        "loss factor [1]": stiffness.imag / stiffness.real,
        "R [m/(N s)]": (v1 / f1).real, "I [m/(N s)]": (v1 / f1).imag,
    }  # fmt: skip


def _stated_errors(used: Mapping[str, mpc]) -> dict[str, dict[str, mpf]]:
    """By its source, the change of the inputs by each stated standard uncertainty of rig, gains and phases."""
    stated = {
        "moving_mass": {"m": mpf("0.01")},
        "preload_stiffness": {"K3": mpf(20)},
        "preload_damping": {"c3": mpf("0.5")},
    }
    for name, gain, phase in (("F1", "0.001", "0.05"), ("V1", "0.0008", "0.04")):
        one, angle = used[name], mpf(phase) * mp.pi / 180
        stated[f"gain {name}"] = {f"Re {name}": one.real * mpf(gain), f"Im {name}": one.imag * mpf(gain)}
        stated[f"phase {name}"] = {f"Re {name}": -one.imag * angle, f"Im {name}": one.real * angle}
    return stated


def _second_order(column: str, u: mpf, value: mpf) -> mpf:
    """The part of second order in u of K2 and C, over u: about the square of their relative uncertainty."""
    return (u / value) ** 2 if column[0] in "KC" else mpf(0)


def _expect_by_paper(made: Campaign, test: str, inputs: Numbers, used: Mapping[str, mpc], u_k1: mpf) -> None:
    """Results of a test by the paper's route, their uncertainties, and for one test the sources of these."""
    expected = _by_paper(inputs)
    noise = spread(_by_paper, inputs, [*noise_of(used), {"K1": u_k1}])
    stated = _stated_errors(used)
    whole = spread(_by_paper, inputs, list(stated.values()))
    for column, value in expected.items():
        made.expect("dynamic", f"test={test}", column, value, WITHIN * noise[column], "network; noise and K1")
        second = _second_order(column, whole[column], value)
        share = mpf("0.01") + 3 * second + (noise[column] / whole[column]) ** 2
        made.expect(
            "dynamic", f"test={test}", u_head(column), whole[column], share * whole[column],
            "numeric derivatives times stated uncertainties",
        )  # fmt: skip
    if test == "D3":
        # a derivative is taken where noise has moved the values, by a few times its share of them
        largest = max(noise[column] / abs(value) for column, value in expected.items())
        for source, error in stated.items():
            parts = spread(_by_paper, inputs, [error])
            _expect_in_budget(made, f"test={test}", source, parts, whole, expected, 4 * WITHIN * largest)
    made.expect_word("dynamic", f"test={test}", "verdict", "ok", "nothing is wrong with it")


def _expect_in_budget(
    made: Campaign,
    test: str,
    source: str,
    parts: Mapping[str, mpf],
    whole: Mapping[str, mpf],
    expected: Mapping[str, mpf],
    moved: mpf,
) -> None:
    """The parts of a source that count in the uncertainties of a test; noise moves them by the share `moved`."""
    for column, u in parts.items():
        name = column.partition(" [")[0].replace("TR predicted", "TR")
        # what hardly counts is a difference of larger parts
        if u < whole[column] / 20 or name in ("R", "I"):
            continue
        room = (moved + 3 * _second_order(column, whole[column], expected[column])) * u
        row = f"{test}; quantity={name}; source={source}"
        made.expect("budget", row, "u", u, room, "numeric derivative times stated uncertainty")


def _static(made: Campaign, test: str, terms: Sequence[mpf], gap: mpf, noise: mpf, points: int = 60) -> mpf:
    """Record a curve a x + b x² + c x³ ± gap, three cycles to 30 mm; returns u of its tangent at 1200 N [N/m].

    The tangent is that of a cubic and a quadratic gap, fitted to the last cycle.
    """
    stroke = mpf("0.03")
    up = [stroke * at / points for at in range(points + 1)]
    path = [(x, 1) for x in up] + [(x, -1) for x in reversed(up[1:-1])]

    def load(x: mpf, side: int) -> mpf:
        return sum(a * x ** (i + 1) for i, a in enumerate(terms)) + side * gap * 4 * x / stroke * (1 - x / stroke)

    cells = [
        (f"{float(1000 * x):.7g}", f"{float(load(x, side)) + made.random.gauss(0.0, float(noise)):.7g}")
        for x, side in [*path, *path, *path, path[0]]
    ]
    made.files[f"recordings/{test}.csv"] = table_text(("x", "F"), cells)
    place = mp.findroot(lambda x: sum(a * x ** (i + 1) for i, a in enumerate(terms)) - 1200, stroke / 4)
    rows = matrix([[1, x, x**2, x**3, side, side * x, side * x**2] for x, side in path])
    information = mp.inverse(rows.T * rows) * noise**2
    by = matrix([0, 1, 2 * place, 3 * place**2, 0, 0, 0])
    return mp.sqrt((by.T * information * by)[0])


# A bench without motion behind the specimen

_BLOCKED = """title = "Reference: an elastomer bench"

[unstated]
ordinary = "zero"

[rig]
output = "blocked"
input_mass = { value = 0.6, unit = "kg", exact = true }

[channels]
sample_rate = "300 Hz"
force_in  = { column = "F1", unit = "N", exact = true }
motion_in = { column = "x1", unit = "mm", exact = true }

[specimens.bush]
"""


def blocked() -> Campaign:
    """A specimen on a bench: force and displacement, K1 stated."""
    columns = "test,file,kind,specimen,preload [N],K1 [N/m],u(K1) [N/m]"
    made = Campaign("blocked-bench", "mobility", _BLOCKED, columns, 5)
    for at, frequency in enumerate((8.0, 15.0, 28.0, 45.0), start=1):
        test = f"D{at}"
        v = {"K1": mpf(900e3), "K2": mpf(450e3), "C": mpf(2600), "input mass": mpf("0.6"), "frequency": mpf(frequency)}
        found = recorded(v, cam=2e-4, blocked=True)
        moved = 1000 * found["V1"] / (J * turning(v))
        made.tones(test, {"F1": found["F1"], "x1": moved}, frequency, {"F1": 500.0})
        made.tests.append(f"{test},recordings/{test}.csv,dynamic,bush,500,900000,0")
        used = {"F1": found["F1"], "x1": moved}
        inputs = {**v, **parts_of(used)}

        def results(w: Numbers) -> dict[str, mpf]:
            x = mpc(w["Re x1"], w["Im x1"]) / 1000
            stiffness = mpc(w["Re F1"], w["Im F1"]) / x + w["input mass"] * turning(w) ** 2
            arm = arm_of({**w, "Re K*": stiffness.real, "Im K*": stiffness.imag})
            return {
                "Re K* [N/m]": stiffness.real, "Im K* [N/m]": stiffness.imag, "K2 [N/m]": arm["K2"],
                "C [N s/m]": arm["C"], "loss factor [1]": stiffness.imag / stiffness.real,
            }  # fmt: skip

        noise = spread(results, inputs, noise_of(used))
        for column, value in results(inputs).items():
            made.expect("dynamic", f"test={test}", column, value, WITHIN * noise[column], "network; noise")
        made.expect_word("dynamic", f"test={test}", "verdict", "ok", "nothing is wrong with it")
    return made


# Static tests alone

_STATIC = """title = "Reference: static tests"

[unstated]
ordinary = "zero"

[channels]
load       = { column = "F", unit = "N", std_gain = "0.2 %" }
deflection = { column = "x", unit = "mm", std_gain = "0.1 %" }

[tyres.reference]
"""


def static() -> Campaign:
    """Two load-deflection curves with hysteresis, which are polynomials."""
    made = Campaign("static", "relative", _STATIC, "test,file,kind,tyre,pressure [bar],preload [N]", 41)
    noise, stroke = mpf("0.05"), mpf("0.03")
    for at, (terms, gap) in enumerate(
        (((mpf("140e3"), mpf("1.2e6"), mpf("6e6")), mpf(60)), ((mpf("185e3"), mpf("0.9e6"), mpf("-4e6")), mpf(45))),
        start=1,
    ):
        test = f"S{at}"
        u = _static(made, test, terms, gap, noise)
        made.tests.append(f"{test},recordings/{test}.csv,static,reference,{1.3 + 0.4 * at:.1f},1200")
        place = mp.findroot(
            lambda x, terms=terms: sum(a * x ** (i + 1) for i, a in enumerate(terms)) - 1200, stroke / 4
        )
        slope = mp.diff(lambda x, terms=terms: sum(a * x ** (i + 1) for i, a in enumerate(terms)), place)

        def tangent(of_load: mpf, of_deflection: mpf, terms: Sequence[mpf] = terms) -> mpf:
            """K1 at 1200 N as it would be found with errors of the gains."""
            curve = lambda x: of_load * sum(a * (x / of_deflection) ** (i + 1) for i, a in enumerate(terms))  # noqa: E731
            return mp.diff(curve, mp.findroot(lambda x: curve(x) - 1200, stroke / 4))

        step = mpf(10) ** -12
        by = [(tangent(1 + a * step, 1 + b * step) - slope) / step for a, b in ((1, 0), (0, 1))]
        u_gains = mp.hypot(by[0] * mpf("0.002"), by[1] * mpf("0.001"))
        apart = 4 * gap / stroke * (1 - 2 * place / stroke)
        row = f"test={test}"
        made.expect("static", row, "K1 [N/m]", slope, WITHIN * u, "tangent of the polynomial; noise of the load")
        made.expect("static", row, "u(K1) [N/m]", u_gains, u + u_gains / 50, "gains; noise of the load")
        bent = _bend(terms, stroke)
        made.expect("static", row, "nonlinearity [1]", bent, bent / 100, "departure from the line; 401 points")
        for head, sign in (("loading", 1), ("unloading", -1)):
            made.expect("static", row, f"K1 {head} [N/m]", slope + sign * apart, 2 * WITHIN * u,
                        "tangent of a branch; noise of the load")  # fmt: skip
        made.expect("static", row, "branch gap [N]", 8 * gap * place / stroke * (1 - place / stroke), WITHIN * noise,
                    "gap of the polynomials; noise of one point")  # fmt: skip
        made.expect("static", row, "secant [N/m]", 1200 / place, WITHIN * noise / place, "load over deflection")
        # the loop is summed as a polygon, whose error the bend of the gap gives, and its noise adds up
        polygon = (stroke / 60) ** 2 / 12 * stroke * 16 * gap / stroke**2
        made.expect("static", row, "hysteresis loss [J]", 2 * gap * 4 * stroke / 6, polygon + WITHIN * noise * stroke,
                    "area of the loop; sum over a polygon")  # fmt: skip
        made.expect_word("static", row, "verdict", "ok", "nothing is wrong with it")
    return made


def _bend(terms: Sequence[mpf], stroke: mpf) -> mpf:
    """Largest departure of a curve from the line through 10 and 90 % of its load, over its load."""

    def load(x: mpf) -> mpf:
        return sum(a * x ** (i + 1) for i, a in enumerate(terms))

    top = load(stroke)
    low, high = (mp.findroot(lambda x, p=part: load(x) - p * top, stroke * part) for part in (mpf("0.1"), mpf("0.9")))
    slope = mpf("0.8") * top / (high - low)
    points = [stroke * at / 200 for at in range(201)]
    return max(abs(load(x) - mpf("0.1") * top - slope * (x - low)) for x in points) / top


# Tests that must not be used

_BAD = """title = "Reference: tests that must be rejected"

[unstated]
ordinary = "zero"

[rig]
moving_mass       = { value = 15.0, unit = "kg", exact = true }
preload_stiffness = { value = 12.44, unit = "kN/m", exact = true }
preload_damping   = { value = 20, unit = "N s/m", exact = true }

[channels]
sample_rate = "300 Hz"
force_in   = { column = "F1", unit = "N", exact = true }
motion_in  = { column = "V1", unit = "m/s", range = "0.2 m/s", exact = true }
motion_out = { column = "V2", unit = "m/s", exact = true }

[tyres.reference]
"""


def rejected() -> Campaign:
    """A good test, and others with a fault each: lift-off, a wrong frequency, clipping, no motion, a turned force."""
    columns = "test,file,kind,tyre,pressure [bar],preload [N],frequency [Hz],K1 [N/m],u(K1) [N/m]"
    made = Campaign("bad-tests", "relative", _BAD, columns, 29)
    tyre = {"K1": mpf(180e3), "K2": mpf(120e3), "C": mpf(700), "m": mpf(15), "K3": mpf(12440), "c3": mpf(20)}
    for test, frequency, stated, cam, load, code in (
        ("good", 14.0, 14.0, 1e-3, 1200, ""),
        ("lift-off", 14.0, 14.0, 1e-3, 150, "lift-off"),
        ("wrong-frequency", 14.0, 18.0, 1e-3, 1200, "stated frequency"),
        ("clipped", 23.0, 23.0, 1.6e-3, 2000, "clipping"),
        ("no-motion", 14.0, 14.0, 1e-3, 1200, "constant channel"),
        ("inverted", 14.0, 14.0, 1e-3, 1200, "passive arm"),
    ):
        v = {**tyre, "frequency": mpf(frequency)}
        found = recorded(v, cam=cam)
        if test == "inverted":
            found["F1"] = -found["F1"]
        made.tones(test, found, frequency, {"F1": 0.0})
        made.files[f"recordings/{test}.csv"] = _spoilt(made.files[f"recordings/{test}.csv"], test)
        made.tests.append(f"{test},recordings/{test}.csv,dynamic,reference,1.7,{load},{stated:g},180000,0")
        made.expect_word("dynamic", f"test={test}", "verdict", "rejected" if code else "ok", code or "nothing is wrong")
        if code:
            made.expect_word("checks", f"test={test}; code={code}", "verdict", "rejected", "the code of the fault")
    return made


def _spoilt(text: str, test: str) -> str:
    """The recording of a test with its fault."""
    rows = list(csv.reader(text.splitlines()))
    for row in rows[1:]:
        if test == "clipped":
            row[1] = f"{max(min(float(row[1]), 0.2), -0.2):.7g}"
        elif test == "no-motion":
            row[1] = "0.0123"
    return table_text(rows[0], rows[1:])


ALL: tuple[Callable[[], Campaign], ...] = (paper, joint, blocked, static, rejected)
