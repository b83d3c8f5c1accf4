"""The campaign of the joint route: rig and sensors are misstated, and one weighed mass finds them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mpmath import matrix, mp, mpc, mpf

from reference.campaign import ESTIMATED, NOISE, SAMPLES, WITHIN, Campaign, recorded, u_head, u_of_part
from reference.mechanics import arm_of
from reference.physics import J, Numbers, amplitudes, rig_impedance, stiffness_of, turning

_JOINT = """title = "Reference: one weighed mass, and a rig that is misstated"

[unstated]
ordinary = "zero"

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
        made.expect("dynamic", f"test={name}", u_head(head), u, room, "Fisher information; noise is estimated")
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
