"""Whole campaigns: recordings of networks with noise of a stated size, and results with the tolerance that it allows.

Each recording is a sum of tones whose amplitudes come from `physics`, with an offset, and Gaussian noise of a standard
deviation that is stated here. A tolerance is five standard uncertainties by the Cramér-Rao bound of that noise.
"""

from __future__ import annotations

import csv
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mpmath import matrix, mp, mpc, mpf

from reference.mechanics import arm_of
from reference.physics import J, Numbers, amplitudes, rig_impedance, stiffness_of, turning

RATE, SAMPLES = 300, 300
#: Noise over amplitude, and standard uncertainties within which a result must lie.
NOISE, WITHIN = mpf("1e-4"), 5
#: Noise as it may be estimated, over what it is: two standard uncertainties for 16 degrees of freedom.
ESTIMATED = mpf("1.36")
_STEP = mpf(10) ** -15
HEADS = ("table", "row", "column", "expected", "tolerance", "rests on", "route")


@dataclass
class Campaign:
    """A campaign on its way: statement, rows of tests.csv, recordings and expected results."""

    name: str
    route: str
    statement: str
    columns: str
    seed: int
    tests: list[str] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)
    rows: list[tuple[str, ...]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.random = random.Random(self.seed)

    def expect(self, table: str, row: str, column: str, value: Any, tolerance: Any, why: str) -> None:
        """Note an expected number."""
        texts = (mp.nstr(mpf(value), 17), mp.nstr(mpf(tolerance), 3))
        self.rows.append((table, row, column, *texts, why, self.route))

    def expect_word(self, table: str, row: str, column: str, word: str, why: str) -> None:
        """Note an expected text."""
        self.rows.append((table, row, column, word, "", why, self.route))

    def tones(self, test: str, columns: Mapping[str, mpc], frequency: float, offsets: Mapping[str, float]) -> None:
        """A recording of one tone per column, with noise of `NOISE` of its amplitude."""
        series = []
        for name, amplitude in columns.items():
            std = float(NOISE * abs(amplitude))
            samples = [
                float((amplitude * mp.expj(2 * mp.pi * mpf(frequency) * at / RATE)).real)
                + offsets.get(name, 0.0)
                + self.random.gauss(0.0, std)
                for at in range(SAMPLES)
            ]
            series.append([f"{one:.7g}" for one in samples])
        self.files[f"recordings/{test}.csv"] = _text(list(columns), zip(*series, strict=True))

    def write(self, folder: Path) -> None:
        """Write the folder of the campaign."""
        (folder / self.name / "recordings").mkdir(parents=True, exist_ok=True)
        expected = _text(HEADS, self.rows)
        files = {
            "campaign.toml": self.statement,
            "tests.csv": "\n".join([self.columns, *self.tests]) + "\n",
            "expected.csv": expected,
            **self.files,
        }
        for name, text in files.items():
            (folder / self.name / name).write_text(text, encoding="utf-8")


def _text(heads: Sequence[str], rows: Any) -> str:
    return "\n".join(",".join(f'"{cell}"' if "," in cell else cell for cell in row) for row in (heads, *rows)) + "\n"


def u_of_part(amplitude: mpc) -> mpf:
    """Cramér-Rao bound of the real or the imaginary part of an amplitude in white noise."""
    return NOISE * abs(amplitude) * mp.sqrt(mpf(2) / SAMPLES)


def u_of_frequency(channels: int) -> mpf:
    """Cramér-Rao bound of a frequency [Hz] that several channels share, each with the noise `NOISE`."""
    duration = mpf(SAMPLES) / RATE
    return mp.sqrt(24 / (channels * SAMPLES)) * NOISE / duration / (2 * mp.pi)


def spread(
    results: Callable[[Numbers], Mapping[str, mpf]], v: Numbers, along: Sequence[Mapping[str, mpf]]
) -> dict[str, mpf]:
    """Standard uncertainty of each result from independent errors, each given as a change of the inputs."""
    squares: dict[str, mpf] = {}
    for error in along:
        up, down = (results({**v, **{k: v[k] + sign * _STEP * by for k, by in error.items()}}) for sign in (1, -1))
        for name in up:
            squares[name] = squares.get(name, mpf(0)) + ((up[name] - down[name]) / (2 * _STEP)) ** 2
    return {name: mp.sqrt(square) for name, square in squares.items()}


def recorded(v: Numbers, *, cam: float = 1e-3, blocked: bool = False) -> dict[str, mpc]:
    """F1, V1 and V2 of a tyre on its rig with a cam of this amplitude [m]."""
    f1, v1, v2 = amplitudes(v, blocked=blocked)
    scale = J * turning(v) * mpf(cam) / v1 * mp.expj(mpf("0.3"))
    return {"F1": f1 * scale, "V1": v1 * scale, "V2": v2 * scale}


def parts_of(values: Mapping[str, mpc]) -> dict[str, mpf]:
    """Real and imaginary parts of amplitudes as inputs of `spread`."""
    return {f"{part} {name}": getattr(one, where) for name, one in values.items()
            for part, where in (("Re", "real"), ("Im", "imag"))}  # fmt: skip


def noise_of(values: Mapping[str, mpc]) -> list[dict[str, mpf]]:
    """The errors of amplitudes from noise, and that of the frequency."""
    errors = [{f"{part} {name}": u_of_part(one)} for name, one in values.items() for part in ("Re", "Im")]
    return [*errors, {"frequency": u_of_frequency(len(values))}]


# The paper's route

_PAPER = """title = "Reference: the paper's route"

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
        made.tones(test, {name: found[name] for name in ("F1", "V1")}, frequency, {"F1": 1200.0})
        made.tests.append(f"{test},recordings/{test}.csv,dynamic,reference,1.7,1200")
        used = {name: found[name] for name in ("F1", "V1")}
        inputs = {**v, **parts_of(used)}

        def results(w: Numbers) -> dict[str, mpf]:
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

        expected = results(inputs)
        noise = spread(results, inputs, [*noise_of(used), {"K1": u_k1}])
        stated = [{"m": mpf("0.01")}, {"K3": mpf(20)}, {"c3": mpf("0.5")}]
        sources = ["moving_mass", "preload_stiffness", "preload_damping", "gain F1", "phase F1", "gain V1", "phase V1"]
        for name, gain, phase in (("F1", "0.001", "0.05"), ("V1", "0.0008", "0.04")):
            one, angle = used[name], mpf(phase) * mp.pi / 180
            stated.append({f"Re {name}": one.real * mpf(gain), f"Im {name}": one.imag * mpf(gain)})
            stated.append({f"Re {name}": -one.imag * angle, f"Im {name}": one.real * angle})
        whole = spread(results, inputs, stated)
        for column, value in expected.items():
            made.expect("dynamic", f"test={test}", column, value, WITHIN * noise[column], "network; noise and K1")
            # K2 and C have a part of second order, which is about the square of their relative uncertainty
            second = (whole[column] / value) ** 2 if column[0] in "KC" else mpf(0)
            share = mpf("0.01") + 3 * second + (noise[column] / whole[column]) ** 2
            made.expect(
                "dynamic", f"test={test}", _u_head(column), whole[column], share * whole[column],
                "numeric derivatives times stated uncertainties",
            )  # fmt: skip
        # a derivative is taken where noise has moved the values, by a few times its share of them
        largest = max(noise[column] / abs(value) for column, value in expected.items())
        for source, error in zip(sources, stated, strict=True) if test == "D3" else ():
            for column, u in spread(results, inputs, [error]).items():
                if u < whole[column] / 20:  # what hardly counts is a difference of larger parts
                    continue
                name = column.partition(" [")[0].replace("TR predicted", "TR")
                if name not in ("R", "I"):
                    second = (whole[column] / expected[column]) ** 2 if column[0] in "KC" else mpf(0)
                    row = f"test={test}; quantity={name}; source={source}"
                    room = (4 * WITHIN * largest + 3 * second) * u
                    made.expect("budget", row, "u", u, room, "numeric derivative times stated uncertainty")
        made.expect_word("dynamic", f"test={test}", "verdict", "ok", "nothing is wrong with it")
    return made


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
    made.files[f"recordings/{test}.csv"] = _text(("x", "F"), cells)
    place = mp.findroot(lambda x: sum(a * x ** (i + 1) for i, a in enumerate(terms)) - 1200, stroke / 4)
    rows = matrix([[1, x, x**2, x**3, side, side * x, side * x**2] for x, side in path])
    information = mp.inverse(rows.T * rows) * noise**2
    by = matrix([0, 1, 2 * place, 3 * place**2, 0, 0, 0])
    return mp.sqrt((by.T * information * by)[0])


# Two masses, of which one is weighed: errors of the rig and the sensors are found

_JOINT = """title = "Reference: one weighed mass, and a rig that is misstated"

[rig]
moving_mass       = { value = 15.0, unit = "kg", std = 0.3 }
preload_stiffness = { value = 12.44, unit = "kN/m", std = 0.25 }
preload_damping   = { value = 20, unit = "N s/m", std = 4 }

[channels]
sample_rate = "300 Hz"
force_in   = { column = "F1", unit = "N", std_gain = "1 %", std_phase = "0.5 deg" }
motion_in  = { column = "V1", unit = "m/s", std_gain = "1 %", std_phase = "0.5 deg" }
motion_out = { column = "V2", unit = "m/s", std_gain = "1 %", std_phase = "0.5 deg" }

[tyres.reference]
"""
#: What the rig and the sensors truly are: value, stated value, stated uncertainty.
_TRUE = {
    "m": ("15.32", "15", "0.3"),
    "K3": ("12240", "12440", "250"),
    "c3": ("23", "20", "4"),
    "gain F1": ("1.009", "1", "0.01"),
    "gain V1": ("0.994", "1", "0.01"),
    "gain V2": ("1.006", "1", "0.01"),
    "phase F1": ("0.006", "0", "0.0087266462599716"),
    "phase V1": ("-0.004", "0", "0.0087266462599716"),
    "phase V2": ("0.005", "0", "0.0087266462599716"),
}
_IN_TABLE = {"m": "moving_mass", "K3": "preload_stiffness", "c3": "preload_damping"}
_MASSES, _U_MASS = (0.0, 6.0), mpf("0.0012")


def joint() -> Campaign:
    """Four frequencies with and without a weighed mass; rig and sensors are off by about their stated uncertainty."""
    columns = "test,file,kind,tyre,pressure [bar],preload [N],added_mass [kg],u(added_mass) [kg],K1 [N/m],u(K1) [N/m]"
    made = Campaign("weighed-mass", "joint", _JOINT, columns, 17)
    true = {name: mpf(value) for name, (value, _, _) in _TRUE.items()}
    tyre = {"K1": mpf(165e3), "K2": mpf(110e3), "C": mpf(800)}
    frequencies = (9.0, 12.5, 17.0, 23.0)
    tests = []
    for frequency in frequencies:
        for mass in _MASSES:
            name = f"D{len(tests) + 1}"
            v = {**tyre, **true, "frequency": mpf(frequency), "added mass": mpf(mass)}
            seen = _seen(v, recorded(v))
            made.tones(name, seen, frequency, {"F1": 1200.0})
            stated = f"{mass:g},{mp.nstr(_U_MASS, 3)}" if mass else ","
            made.tests.append(f"{name},recordings/{name}.csv,dynamic,reference,1.7,1200,{stated},165000,0")
            tests.append((name, frequency, mass, v))
    _expect_joint(made, tests, true)
    return made


def _seen(v: Numbers, true: Mapping[str, mpc]) -> dict[str, mpc]:
    """What sensors with errors of gain and phase record."""
    return {name: one * v[f"gain {name}"] * mp.expj(v[f"phase {name}"]) for name, one in true.items()}


def _expect_joint(made: Campaign, tests: Sequence[Any], true: Numbers) -> None:
    """Expected values, with tolerances from the Fisher information of all tests and all stated uncertainties."""
    frequencies = list(dict.fromkeys(frequency for _, frequency, _, _ in tests))
    shared = [*_TRUE, "added mass"]
    count = len(shared) + 2 * len(frequencies) + 2 * len(tests)
    stated, information = matrix(count, count), matrix(count, count)
    for at, name in enumerate(_TRUE):
        stated[at, at] += 1 / mpf(_TRUE[name][2]) ** 2
    stated[len(_TRUE), len(_TRUE)] += 1 / _U_MASS**2
    for number, (_, frequency, mass, v) in enumerate(tests):
        first = len(shared) + 2 * frequencies.index(frequency)
        own = len(shared) + 2 * len(frequencies) + 2 * number
        places = [*range(len(shared)), first, first + 1, own, own + 1]
        slopes = _slopes(v, shared, mass)
        for one, row in zip(places, slopes, strict=True):
            for other, column in zip(places, slopes, strict=True):
                information[one, other] += mp.fsum(a * b for a, b in zip(row, column, strict=True))
    covariance, wide = (mp.inverse(stated + information / scale**2) for scale in (1, ESTIMATED))
    for at, name in enumerate(_TRUE):
        head = _IN_TABLE.get(name, name)
        made.expect("rig", f"value={head}", "found", true[name], WITHIN * mp.sqrt(covariance[at, at]),
                    "what the rig truly is; Fisher information")  # fmt: skip
    _expect_ratios(made, true, covariance)
    for name, frequency, _, v in tests:
        places = [*range(len(shared)), *(len(shared) + 2 * frequencies.index(frequency) + i for i in (0, 1))]
        _expect_test(made, name, {**v, **_known(v)}, [*shared, "Re K*", "Im K*"], (covariance, wide), places)


def _known(v: Numbers) -> dict[str, mpf]:
    stiffness = stiffness_of(v, turning(v))
    return {"Re K*": stiffness.real, "Im K*": stiffness.imag}


def _expect_test(
    made: Campaign,
    name: str,
    v: Numbers,
    unknown: Sequence[str],
    covariances: tuple[matrix, matrix],
    places: Sequence[int],
) -> None:
    """Results of a test, and their uncertainties from the covariance of what the tests share.

    The second covariance is that of a noise which is estimated too large.
    """

    def results(w: Numbers) -> dict[str, mpf]:
        stiffness = mpc(w["Re K*"], w["Im K*"])
        arm = arm_of(w)
        ratio = stiffness / (stiffness + J * turning(w) * rig_impedance(w))
        return {
            "Re K* [N/m]": stiffness.real, "Im K* [N/m]": stiffness.imag, "K2 [N/m]": arm["K2"], "C [N s/m]": arm["C"],
            "loss factor [1]": stiffness.imag / stiffness.real, "TR predicted [1]": abs(ratio),
        }  # fmt: skip

    value = results(v)
    columns = []
    for key in unknown:
        if key == "added mass" and not v[key]:  # the mass is not on the rig in this test
            columns.append(dict.fromkeys(value, mpf(0)))
            continue
        step = mpf(10) ** -20 * (abs(v[key]) or mpf(1))
        moved = results({**v, key: v[key] + step})
        columns.append({head: (moved[head] - value[head]) / step for head in value})
    for head, one in value.items():
        u, more = (
            mp.sqrt(
                mp.fsum(
                    first[head] * second[head] * covariance[i, k]
                    for first, i in zip(columns, places, strict=True)
                    for second, k in zip(columns, places, strict=True)
                )
            )
            for covariance in covariances
        )
        made.expect("dynamic", f"test={name}", head, one, WITHIN * u, "network; Fisher information")
        room = more - u + u / 1000
        made.expect("dynamic", f"test={name}", _u_head(head), u, room, "Fisher information; noise is estimated")
    _expect_ratio_of_test(made, name, v, covariances)
    made.expect_word("dynamic", f"test={name}", "route", "joint", "the route that is asked for")


def _expect_ratio_of_test(made: Campaign, name: str, v: Numbers, covariances: tuple[matrix, matrix]) -> None:
    """R, I and TR of a test as they truly are: noise and the ratios of the gains may change them; u of R and I."""
    covariance = covariances[0]
    f1, v1, v2 = amplitudes(v)
    for head, along, across in (("R", (v1 / f1).real, (v1 / f1).imag), ("I", (v1 / f1).imag, (v1 / f1).real)):
        u, more = (
            mp.sqrt(
                (along**2 * _of_ratio(one, "gain")) + across**2 * _of_ratio(one, "phase")
                + (scale * NOISE * abs(v1 / f1)) ** 2 * 4 / SAMPLES
            )
            for one, scale in zip(covariances, (1, ESTIMATED), strict=True)
        )  # fmt: skip
        made.expect("dynamic", f"test={name}", f"u({head}) [m/(N s)]", u, more - u + u / 50,
                    "noise and ratios of gains; their correlation is left out")  # fmt: skip
    noise = NOISE * mp.sqrt(mpf(4) / SAMPLES)
    for heads, one, (over, under) in (
        (("R [m/(N s)]", "I [m/(N s)]"), v1 / f1, ("V1", "F1")),
        (("TR measured [1]",), v2 / v1, ("V2", "V1")),
    ):
        error = mpf(0)
        for kind in ("gain", "phase"):
            at, to = (list(_TRUE).index(f"{kind} {which}") for which in (over, under))
            error += abs(covariance[at, at] + covariance[to, to] - 2 * covariance[at, to])
        room = WITHIN * abs(one) * (mp.sqrt(error) + noise)
        for head, value in zip(heads, (abs(one),) if len(heads) == 1 else (one.real, one.imag), strict=True):
            made.expect("dynamic", f"test={name}", head, value, room, "network; noise and ratios of gains")


def _of_ratio(covariance: matrix, kind: str) -> mpf:
    """Relative variance of the ratio of the gains of F1 and V1, or variance of the difference of their phases."""
    names = [f"{kind} F1", f"{kind} V1"]
    at, to = (list(_TRUE).index(name) for name in names)
    one, other = (1 / mpf(_TRUE[name][0]) if kind == "gain" else mpf(1) for name in names)
    return one**2 * covariance[at, at] + other**2 * covariance[to, to] - 2 * one * other * covariance[at, to]


def _u_head(head: str) -> str:
    """Head of the uncertainty of a column."""
    name, _, unit = head.replace("TR predicted", "TR").partition(" [")
    return f"u({name}) [{unit}"


def _expect_ratios(made: Campaign, true: Numbers, covariance: matrix) -> None:
    """Ratios of gains and differences of phases, which the weighed mass calibrates."""
    places = list(_TRUE)
    for one, other in (("F1", "V1"), ("V2", "V1")):
        for kind, row in (("gain", f"gain {one}/{other}"), ("phase", f"phase {one}-{other}")):
            at, to = places.index(f"{kind} {one}"), places.index(f"{kind} {other}")
            first, second = true[f"{kind} {one}"], true[f"{kind} {other}"]
            sizes = (1 / second, -first / second**2) if kind == "gain" else (mpf(1), mpf(-1))
            square = mp.fsum(
                a * b * covariance[i, k]
                for a, i in zip(sizes, (at, to), strict=True)
                for b, k in zip(sizes, (at, to), strict=True)
            )
            value = first / second if kind == "gain" else first - second
            made.expect("rig", f"value={row}", "found", value, WITHIN * mp.sqrt(square),
                        "what the sensors truly do; Fisher information")  # fmt: skip


def _slopes(v: Numbers, shared: Sequence[str], mass: float) -> list[list[mpf]]:
    """Derivatives of the six parts that a test records, over their noise, by each unknown."""
    omega = turning(v)
    stiffness = stiffness_of(v, omega)
    plain = {name: one for name, one in v.items() if name not in ("K1", "K2", "C")}
    start = {**plain, "Re K*": stiffness.real, "Im K*": stiffness.imag, "Re x": mpf("0.001"), "Im x": mpf(0)}

    def parts(w: Numbers) -> list[mpf]:
        f1, v1, v2 = amplitudes(w)
        scale = J * omega * mpc(w["Re x"], w["Im x"]) / v1
        seen = _seen(w, {"F1": f1 * scale, "V1": v1 * scale, "V2": v2 * scale})
        return [part for one in seen.values() for part in (one.real, one.imag)]

    seen = parts(start)
    noise = [u_of_part(mpc(*seen[at : at + 2])) for at in (0, 2, 4) for _ in (0, 1)]
    found = []
    for name in (*shared, "Re K*", "Im K*", "Re x", "Im x"):
        if name == "added mass" and not mass:
            found.append([mpf(0)] * 6)
            continue
        step = mpf(10) ** -20 * (abs(start[name]) or mpf(1))
        moved = parts({**start, name: start[name] + step})
        found.append([(a - b) / step / n for a, b, n in zip(moved, seen, noise, strict=True)])
    return found


# A bench without motion behind the specimen

_BLOCKED = """title = "Reference: an elastomer bench"

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
    return _text(rows[0], rows[1:])


ALL: tuple[Callable[[], Campaign], ...] = (paper, joint, blocked, static, rejected)
