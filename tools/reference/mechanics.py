"""Cases of four-poles, the tyre on its rig, the routes to K*, K2 and C, and their uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from mpmath import matrix, mp, mpc, mpf

from reference.cases import case, parts
from reference.physics import (
    J,
    Network,
    Numbers,
    amplitudes,
    four_pole,
    rig_impedance,
    solved,
    stiffness_of,
    turning,
    with_tyre,
)

_POLES = {"a11": "1", "a12": "N s/m", "a21": "m/(N s)", "a22": "1"}
_CHAIN = {"m": 3.2, "K": 52e3, "C": 410.0, "M": 15.0, "frequency": 13.7}
#: Tyres and rigs: the magnitudes of the paper, a stiff truck tyre, a soft one near the resonance of its rig.
TYRES: list[dict[str, float]] = [
    {"K1": 180e3, "K2": 120e3, "C": 700.0, "m": 15.0, "K3": 12440.0, "c3": 0.0, "frequency": 10.0},
    {"K1": 120e3, "K2": 60e3, "C": 600.0, "m": 15.0, "K3": 12440.0, "c3": 18.0, "frequency": 16.0},
    {"K1": 165e3, "K2": 90e3, "C": 1500.0, "m": 22.5, "K3": 12440.0, "c3": 35.0, "frequency": 24.0},
    {"K1": 760e3, "K2": 330e3, "C": 2100.0, "m": 48.0, "K3": 30e3, "c3": 60.0, "frequency": 19.3},
    {"K1": 95e3, "K2": 41e3, "C": 260.0, "m": 15.0, "K3": 12440.0, "c3": 20.0, "frequency": 4.9},
]
_FULL = {
    "m": 15.0, "K3": 12440.0, "c3": 22.0, "preload loss factor": 0.03, "tyre mass": 1.7, "frame stiffness": 2.4e6,
    "added mass": 4.9, "frequency": 14.2,
}  # fmt: skip
#: A tyre on a rig with all that a test may have.
_TEST = {**TYRES[1], "input mass": 0.8, "added mass": 5.0}


def poles(found: matrix) -> dict[str, mpf]:
    """The entries of a four-pole by their names."""
    return {
        name: value
        for row in (0, 1)
        for column in (0, 1)
        for name, value in parts(f"a{row + 1}{column + 1}", found[row, column]).items()
    }


def _chain(v: Numbers) -> matrix:
    net = Network(turning(v)).mass("a", v["m"]).link("a", "b", v["K"]).damper("b", "c", v["C"]).mass("c", v["M"])
    return four_pole(net, "a", "c")


def _tyre_and_rig(v: Numbers) -> dict[str, Any]:
    f1, v1, v2 = amplitudes(v)
    return {"mobility": v1 / f1, "ratio": v2 / v1, "stiffness": stiffness_of(v, turning(v))}


def four_poles() -> Iterator[dict[str, Any]]:
    """Chains of parts, their inverse, and what is left of a chain without its known parts."""
    head = "four-poles"
    yield case(head, "twoport.cascade", _POLES, _CHAIN, lambda v: poles(_chain(v)))
    yield case(head, "twoport.inverse", _POLES, _CHAIN, lambda v: poles(mp.inverse(_chain(v))))
    tyre = {"Re K*": 194e3, "Im K*": 38.8e3, "m": 15.0, "K3": 12440.0, "input mass": 0.8, "frequency": 11.3}

    def inner(v: Numbers) -> dict[str, mpf]:
        net = with_tyre(Network(turning(v)), v, "a", "b")
        return parts("a21", four_pole(net, "a", "b")[1, 0])

    yield case(head, "twoport.deembed", _POLES, tyre, inner)
    for function, name, unit in (
        ("twoport.chain_mobility", "mobility", "m/(N s)"),
        ("twoport.chain_transmissibility", "ratio", "1"),
    ):
        plain = {name: value for name, value in tyre.items() if name != "input mass"}
        yield case(head, function, {name: unit}, plain, lambda v, name=name: parts(name, _tyre_and_rig(v)[name]))


def tyres() -> Iterator[dict[str, Any]]:
    """A tyre on its rig, in closed form."""
    for given in TYRES:
        tyre = {name: given[name] for name in ("K1", "K2", "C", "frequency")}
        yield case(
            "tyre", "core.tyre.zener_stiffness", {"K*": "N/m"}, tyre, lambda v: parts("K*", stiffness_of(v, turning(v)))
        )
        yield case(
            "tyre on its rig", "core.tyre.mobility", {"V1/F1": "m/(N s)"}, given,
            lambda v: parts("V1/F1", _tyre_and_rig(v)["mobility"]),
        )  # fmt: skip
        yield case(
            "tyre on its rig", "core.tyre.transmissibility", {"V2/V1": "1"}, given,
            lambda v: parts("V2/V1", _tyre_and_rig(v)["ratio"]),
        )  # fmt: skip
    units = {"K*": "N/m", "V1/F1": "m/(N s)", "d": "1", "TR": "1", "arg(V2/V1)": "rad"}
    for given in (TYRES[0], {**TYRES[1], "m": 15.0}, TYRES[2]):
        for frequency in (10.0, 14.0, 18.0, 24.0):
            undamped = {name: value for name, value in given.items() if name != "c3"} | {"frequency": frequency}
            yield case("the paper's rig", "core.tyre (the paper's rig)", units, undamped, _papers)
    paper = {name: value for name, value in TYRES[0].items() if name != "c3"}
    yield case(
        "tyre on its rig", "core.tyre.zener_mobility", {"V1/F1": "m/(N s)"}, paper,
        lambda v: parts("V1/F1", _tyre_and_rig(v)["mobility"]),
    )  # fmt: skip
    yield case(
        "tyre on its rig", "core.tyre.zener_transmissibility", {"TR": "1"}, paper,
        lambda v: {"TR": abs(_tyre_and_rig(v)["ratio"])},
    )  # fmt: skip
    loss = {"Re K*": 194e3, "Im K*": 38.8e3, "amplitude": 1.1e-3}
    yield case("tyre", "core.tyre.energy_loss", {"W": "J"}, loss, lambda v: {"W": _work(v)})
    yield case("tyre", "core.tyre.loss_factor", {"eta": "1"}, loss, lambda v: {"eta": v["Im K*"] / v["Re K*"]})


def _papers(v: Numbers) -> dict[str, mpf]:
    """All that the paper's program has of a tyre, and the phase of V2 ahead of V1."""
    found = _tyre_and_rig(v)
    d = _d({**v, "Re K*": found["stiffness"].real, "Im K*": found["stiffness"].imag})
    ratio = {"TR": abs(found["ratio"]), "arg(V2/V1)": mp.arg(found["ratio"])}
    return {**parts("K*", found["stiffness"]), **parts("V1/F1", found["mobility"]), **d, **ratio}


def _work(v: Numbers) -> mpf:
    """Work of the force on the deflection over one cycle, as an integral."""
    stiffness, size = mpc(v["Re K*"], v["Im K*"]), v["amplitude"]

    def power(angle: mpf) -> mpf:
        return (stiffness * size * mp.expj(angle)).real * (J * size * mp.expj(angle)).real

    return mp.quad(power, mp.linspace(0, 2 * mp.pi, 5))


def rigs() -> Iterator[dict[str, Any]]:
    """The rig with all its parts: impedance, mobility, and derivatives."""
    head = "rig"
    yield case(head, "core.rig.Rig.impedance", {"Zr": "N s/m"}, _FULL, lambda v: parts("Zr", rig_impedance(v)))
    yield case(head, "core.rig.Rig.mobility", {"1/Zr": "m/(N s)"}, _FULL, lambda v: parts("1/Zr", 1 / rig_impedance(v)))
    symbols = [name for name in _FULL if name != "frequency"]

    def chain(v: Numbers) -> dict[str, mpf]:
        net = Network(turning(v)).mass("wheel", v["m"] + v["tyre mass"] + v["added mass"])
        net.link("wheel", "foot", v["K3"] * mpc(1, v["preload loss factor"])).damper("wheel", "foot", v["c3"])
        return poles(four_pole(net.link("foot", "end", v["frame stiffness"]), "wheel", "end"))

    yield case(head, "core.rig.Rig.chain", _POLES, _FULL, chain)
    alone = {name: _FULL[name] for name in ("m", "K3", "tyre mass")}
    yield case(
        head, "core.rig.Rig.resonance", {"f": "Hz"}, alone,
        lambda v: {"f": mp.sqrt(v["K3"] / (v["m"] + v["tyre mass"])) / (2 * mp.pi)},
    )  # fmt: skip

    def gradient(v: Numbers) -> dict[str, mpf]:
        found: dict[str, mpf] = {}
        for name in symbols:
            found |= parts(f"dZr/d {name}", slope(lambda x, name=name: rig_impedance({**v, name: x}), v[name]))
        return found

    units = {f"dZr/d {name}": f"N s/m per unit of {name}" for name in symbols}
    yield case(head, "core.rig.Rig.impedance_gradient", units, _FULL, gradient)
    yield case(
        head, "core.rig.Rig.impedance_slope", {"dZr/dw": "N s2/m"}, _FULL,
        lambda v: parts("dZr/dw", slope(lambda f: rig_impedance({**v, "frequency": f}), v["frequency"]) / (2 * mp.pi)),
    )  # fmt: skip


def slope(function: Any, at: mpf) -> Any:
    """Derivative by a central difference with 40 digits and more."""
    step = (abs(at) or mpf(1)) * mpf(10) ** -12
    outer, inner = (
        (function(at + 2 * step) - function(at - 2 * step)) / (4 * step),
        (function(at + step) - function(at - step)) / (2 * step),
    )
    return (4 * inner - outer) / 3


def routes() -> Iterator[dict[str, Any]]:
    """K* by three routes from amplitudes of the network; K2 and C by solving the network for them."""
    unit = {"K*": "N/m"}
    for route, names in (
        ("mobility", ("V1/F1", "1/Zr")),
        ("relative", ("F1", "V1", "V2")),
        ("transmissibility", ("V2/V1", "Zr")),
    ):
        known = {name: mpf(value) for name, value in TYRES[2].items()}
        f1, v1, v2 = amplitudes(known)
        zr = rig_impedance(known)
        all_of = {"V1/F1": v1 / f1, "1/Zr": 1 / zr, "F1": f1, "V1": v1, "V2": v2, "V2/V1": v2 / v1, "Zr": zr}
        inputs = {"frequency": TYRES[2]["frequency"]}
        for name in names:
            inputs |= parts(name, all_of[name])
        yield case(
            "routes to K*", f"core.routes.{route}_route", unit, inputs,
            lambda v, route=route: parts("K*", _by_network(v, route)),
        )  # fmt: skip
    for route in ("mobility", "relative", "transmissibility"):
        inputs = {"frequency": TYRES[2]["frequency"]}
        for name in ("F1", "V1", "V2", "Zr"):
            inputs |= parts(name, all_of[name])

        def chosen(v: Numbers, route: str = route) -> dict[str, mpf]:
            f1, v1, v2, zr = (mpc(v[f"Re {name}"], v[f"Im {name}"]) for name in ("F1", "V1", "V2", "Zr"))
            f1, v2 = (zr * v2 if route == "transmissibility" else f1), (f1 / zr if route == "mobility" else v2)
            return parts("K*", f1 / ((v1 - v2) / (J * turning(v))))

        yield case("routes to K*", f"core.routes.stiffness_by {route}", unit, inputs, chosen)
    arm = {"K2": "N/m", "C": "N s/m"}
    for given in TYRES:
        known = {name: mpf(value) for name, value in given.items()}
        inputs = {
            **parts("K*", stiffness_of(known, turning(known))),
            "K1": given["K1"],
            "frequency": given["frequency"],
        }
        yield case("K2 and C", "core.routes.maxwell_arm", arm, inputs, arm_of)
    yield case("K2 and C", "core.routes.paper_d", {"d": "1"}, inputs, _d)
    names = {f"d{of}/d {by}": f"{arm[of]} per N/m" for of in arm for by in ("Re K*", "Im K*", "K1")}
    yield case("K2 and C", "core.routes.arm_slopes", names, inputs, _arm_slopes)


def _by_network(v: Numbers, route: str) -> mpc:
    """K* for which a spring between contact and wheel gives the amplitudes, by the balance of forces at its ends."""
    omega = turning(v)
    if route == "relative":
        f1, v1, v2 = (mpc(v[f"Re {name}"], v[f"Im {name}"]) for name in ("F1", "V1", "V2"))
    elif route == "mobility":
        f1, v1 = mpf(1), mpc(v["Re V1/F1"], v["Im V1/F1"])
        v2 = f1 * mpc(v["Re 1/Zr"], v["Im 1/Zr"])
    else:
        v1, v2 = mpf(1), mpc(v["Re V2/V1"], v["Im V2/V1"])
        f1 = mpc(v["Re Zr"], v["Im Zr"]) * v2
    return f1 / ((v1 - v2) / (J * omega))


def arm_of(v: Numbers) -> dict[str, mpf]:
    """K2 and C of a tyre with K* and K1, by solving the network for them."""
    omega = turning(v)

    def forward(k2: mpf, c: mpf) -> tuple[mpf, mpf]:
        found = stiffness_of({"K1": v["K1"], "K2": k2, "C": c}, omega)
        return found.real, found.imag

    stiffness = mpc(v["Re K*"], v["Im K*"])
    # Whatever the start, the result is what the network needs; one near it saves steps.
    yielding = 1 / (stiffness - v["K1"])
    start = 1 / abs(yielding.real), 1 / abs(omega * yielding.imag)
    k2, c = solved(forward, (stiffness.real, stiffness.imag), start)
    return {"K2": k2, "C": c}


def _arm_slopes(v: Numbers) -> dict[str, mpf]:
    """Derivatives of K2 and C by K* and K1."""
    return {
        f"d{of}/d {by}": slope(lambda x, of=of, by=by: arm_of({**v, by: x})[of], v[by])
        for of in ("K2", "C")
        for by in ("Re K*", "Im K*", "K1")
    }


def _d(v: Numbers) -> dict[str, mpf]:
    """The paper's d: the part of the deflection under a load that is in phase with it, times K1."""
    moved = Network(turning(v)).link("contact", None, mpc(v["Re K*"], v["Im K*"])).displacements({"contact": mpf(1)})
    return {"d": v["K1"] * moved["contact"].real}


def identified() -> Iterator[dict[str, Any]]:
    """Whole tests by the three routes, a blocked rig, and reduced tables."""
    units = {
        "K*": "N/m", "K2": "N/m", "C": "N s/m", "TR": "1", "TR measured": "1", "loss factor": "1", "V1/F1": "m/(N s)",
        "d": "1",
    }  # fmt: skip

    def whole(v: Numbers, *, blocked: bool = False) -> dict[str, mpf]:
        f1, v1, v2 = amplitudes(v, blocked=blocked)
        stiffness = stiffness_of(v, turning(v))
        found = {**parts("V1/F1", v1 / f1), **parts("K*", stiffness)}
        found |= {"loss factor": stiffness.imag / stiffness.real, "K2": v["K2"], "C": v["C"]}
        return found if blocked else {**found, "TR measured": abs(v2 / v1), "TR": abs(v2 / v1)}

    for route in ("mobility", "relative", "transmissibility"):
        yield _of_amplitudes("identification", f"core.identify.identify {route}", units, _TEST, whole, blocked=False)
    bench = {name: value for name, value in _TEST.items() if name not in ("m", "K3", "c3", "added mass")}
    yield _of_amplitudes(
        "blocked rig", "core.identify.identify blocked", units, bench, lambda v: whole(v, blocked=True), blocked=True
    )
    polar = {"F1": 61.0, "V1": 0.0628, "V2": 0.081, "phase F1": 1.21, "phase V2": -0.34, "frequency": 12.0}
    yield case(
        "identification", "core.phasor.Phasors.from_polar", {"V1/F1": "m/(N s)", "V2/V1": "1"}, polar,
        lambda v: {
            **parts("V1/F1", v["V1"] / (v["F1"] * mp.expj(v["phase F1"]))),
            **parts("V2/V1", v["V2"] * mp.expj(v["phase V2"]) / v["V1"]),
        },
    )  # fmt: skip
    for given in ({**TYRES[0], "input mass": 0.0}, {**TYRES[3], "input mass": 1.4}):

        def table(v: Numbers) -> dict[str, mpf]:
            found = whole(v)
            stiffness = mpc(found["Re K*"], found["Im K*"])
            return {
                **{name: found[name] for name in ("Re V1/F1", "Im V1/F1", "Re K*", "Im K*", "K2", "C", "TR")},
                **_d({**v, "Re K*": stiffness.real, "Im K*": stiffness.imag}),
            }

        yield case("reduced tables", "core.reduced.predict", units, given, table)
        found = table({name: mpf(value) for name, value in given.items()})
        rig = {name: given[name] for name in ("K1", "m", "K3", "c3", "frequency", "input mass")}
        stiff = {**rig, "Re K*": found["Re K*"], "Im K*": found["Im K*"]}
        measured = {**rig, "Re V1/F1": found["Re V1/F1"], "Im V1/F1": found["Im V1/F1"]}

        def of_stiffness(v: Numbers) -> dict[str, mpf]:
            return table({**v, **arm_of(v)})

        def of_mobility(v: Numbers) -> dict[str, mpf]:
            cell = mpc(v["Re V1/F1"], v["Im V1/F1"])
            contact = cell / (1 - J * turning(v) * v["input mass"] * cell)  # of 1 N at the cell, the mass takes a part
            stiffness = _by_network({**v, **parts("1/Zr", 1 / rig_impedance(v)), **parts("V1/F1", contact)}, "mobility")
            return of_stiffness({**v, "Re K*": stiffness.real, "Im K*": stiffness.imag})

        yield case("reduced tables", "core.reduced.identify_stiffness", units, stiff, of_stiffness)
        yield case("reduced tables", "core.reduced.identify_mobility", units, measured, of_mobility)


def _of_amplitudes(
    check: str, function: str, units: Mapping[str, str], given: Mapping[str, float], whole: Any, *, blocked: bool
) -> dict[str, Any]:
    """A case whose further inputs are the amplitudes that a network has; they are scaled to a cam of 1 mm."""
    known = {name: mpf(value) for name, value in given.items()}
    tyre = ("K2", "C")
    f1, v1, v2 = amplitudes(known, blocked=blocked)
    scale = J * turning(known) * mpf("0.001") / v1 * mp.expj(mpf("0.7"))
    stated = {name: value for name, value in given.items() if name not in tyre}
    for name, value in (("F1", f1), ("V1", v1), ("V2", v2)):
        stated |= {key: float(one) for key, one in parts(name, value * scale).items()}
    made = case(check, function, units, given, whole)
    route = function.rpartition(" ")[2]
    reach = case(check, function, {"K*": "N/m", "K2": "N/m", "C": "N s/m"}, stated, lambda v: _from(v, route))
    wide = {row["value"]: mpf(row["tolerance"]) for row in reach["values"]}
    for row in made["values"]:
        row["tolerance"] = mp.nstr(mpf(row["tolerance"]) + wide.get(row["value"], mpf(0)), 2)
    return {**made, "inputs": stated}


def _from(v: Numbers, route: str) -> dict[str, mpf]:
    """K*, K2 and C from recorded amplitudes: what round-off of these does to them."""
    f1, v1, v2 = (mpc(v[f"Re {name}"], v[f"Im {name}"]) for name in ("F1", "V1", "V2"))
    at_contact = f1 - J * turning(v) * v["input mass"] * v1
    if route == "mobility":
        v2 = at_contact / rig_impedance(v)
    elif route == "transmissibility":
        at_contact = v2 * rig_impedance(v)
    stiffness = at_contact / ((v1 - v2) / (J * turning(v)))
    return {**parts("K*", stiffness), **arm_of({**v, **parts("K*", stiffness)})}


def uncertainties() -> Iterator[dict[str, Any]]:
    """First-order uncertainty of a test whose inputs are independent: numeric derivatives, each times its u."""
    given = {**{name: value for name, value in _TEST.items() if name not in ("K2", "C")}}
    known = {name: mpf(value) for name, value in _TEST.items()}
    for name, value in zip(("F1", "V1", "V2"), amplitudes(known), strict=True):
        given |= {key: float(one) for key, one in parts(name, value * 60).items()}
    # relative uncertainties so small that what they do to K2 and C is linear
    stated = {"u m": 2e-6, "u K3": 0.01, "u c3": 0.001, "u K1": 0.02, "u added mass": 1e-6, "u frequency": 1e-8}
    stated |= {"u input mass": 3e-7}
    stated |= {"u F1": 1e-6, "u V1": 1e-9, "u V2": 1e-9, "gain F1": 2e-8, "phase V1": 3e-8, "delay V2": 2e-10}
    stated |= {"response gain V2": 1.5e-8, "response phase V2": 2.5e-8, "common noise of V1, V2": 4e-10}
    units = {
        "u(Re K*)": "N/m", "u(Im K*)": "N/m", "corr(Re,Im K*)": "1", "u(K2)": "N/m", "u(C)": "N s/m", "u(TR)": "1",
        "u(loss factor)": "1", "corr(K2,C)": "1", "common u(Re K*)": "N/m", "common u(Im K*)": "N/m",
        "own u(Re K*)": "N/m", "own u(Im K*)": "N/m",
    }  # fmt: skip
    for route in ("mobility", "relative", "transmissibility"):
        made = case(
            "uncertainty", f"core.identify.identify u {route}", units, {**given, **stated},
            lambda v, route=route: _uncertain(v, route), followed=("frequency", "m", "Im V2"),
        )  # fmt: skip
        for row in made["values"]:  # K2 and C have a second-order part of the square of these uncertainties, below 1e-9
            if row["value"] in ("u(K2)", "u(C)", "corr(K2,C)"):
                size = 1 if row["unit"] == "1" else abs(mpf(row["expected"]))
                row["tolerance"] = mp.nstr(mpf(row["tolerance"]) + mpf("1e-9") * size, 2)
        yield made


def _uncertain(v: Numbers, route: str) -> dict[str, mpf]:
    """Uncertainties and correlations of the results of a test."""
    outputs = ("Re K*", "Im K*", "loss factor", "K2", "C", "TR")

    def results(values: Numbers) -> list[mpf]:
        found = _from(values, route)
        stiffness = mpc(found["Re K*"], found["Im K*"])
        rig = J * turning(values) * rig_impedance(values)
        found |= {"TR": abs(stiffness / (stiffness + rig)), "loss factor": stiffness.imag / stiffness.real}
        return [found[name] for name in outputs]

    columns: list[list[mpf]] = []

    def add(along: Mapping[str, mpf]) -> None:
        step = mpf(10) ** -15
        up, down = (
            results({**v, **{name: v[name] + sign * step * by for name, by in along.items()}}) for sign in (1, -1)
        )
        columns.append([(one - other) / (2 * step) for one, other in zip(up, down, strict=True)])

    for name in ("m", "K3", "c3", "input mass", "added mass"):
        add({name: v[f"u {name}"]})
    add({f"{part} F1": v[f"{part} F1"] * v["gain F1"] for part in ("Re", "Im")})
    add({"Re V1": -v["Im V1"] * v["phase V1"], "Im V1": v["Re V1"] * v["phase V1"]})
    late = -turning(v) * v["delay V2"]
    add({"Re V2": -v["Im V2"] * late, "Im V2": v["Re V2"] * late})
    add({f"{part} V2": v[f"{part} V2"] * v["response gain V2"] for part in ("Re", "Im")})
    turned = v["response phase V2"]
    add({"Re V2": -v["Im V2"] * turned, "Im V2": v["Re V2"] * turned})
    common = {f"common u({name})": mp.sqrt(mp.fsum(column[at] ** 2 for column in columns))
              for at, name in enumerate(outputs[:2])}  # fmt: skip
    for name in ("K1", "frequency"):
        add({name: v[f"u {name}"]})
    for name in ("F1", "V1", "V2"):
        for part in ("Re", "Im"):
            add({f"{part} {name}": v[f"u {name}"]})
    for part in ("Re", "Im"):
        add({f"{part} V1": v["common noise of V1, V2"], f"{part} V2": v["common noise of V1, V2"]})

    def product(one: str, other: str) -> mpf:
        at, to = outputs.index(one), outputs.index(other)
        return mp.fsum(column[at] * column[to] for column in columns)

    u = {name: mp.sqrt(product(name, name)) for name in outputs}
    return {
        **common,
        **{f"own u({name})": mp.sqrt(u[name] ** 2 - common[f"common u({name})"] ** 2) for name in outputs[:2]},
        **{f"u({name})": value for name, value in u.items()},
        "corr(Re,Im K*)": product("Re K*", "Im K*") / (u["Re K*"] * u["Im K*"]),
        "corr(K2,C)": product("K2", "C") / (u["K2"] * u["C"]),
    }
