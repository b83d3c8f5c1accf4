"""Cases of models of K*, relaxation in time, shift laws, sensors, probabilities and units."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from mpmath import matrix, mp, mpc, mpf

from reference.cases import case, parts, value_row
from reference.mechanics import slope
from reference.physics import J, Network, Numbers, solved, turning

_FREQUENCIES = (3.1, 27.0)
_ARMS = {"K_inf": 150e3, "K_1": 40e3, "K_2": 65e3, "tau_1": 0.031, "tau_2": 0.0012}
_FRACTIONAL = {"K0": 150e3, "K_inf": 420e3, "tau": 1.3e-3, "alpha": 0.42}
_KRAUS = {
    **_FRACTIONAL, "D": 60e3, "L": 15e3, "x_c": 1e-3, "m": 0.6, "beta": 0.05, "eta": 0.07,
}  # fmt: skip
#: Digits that a verdict needs of a probability or of a quantile are three or four; these have ten.
_OF_PROBABILITY = mpf("1e-10")


def _stands(net: Network) -> mpc:
    """K* of a network that stands on the ground at its node "contact" [N/m]."""
    return 1 / net.displacements({"contact": mpf(1)})["contact"]


def _zener(v: Numbers) -> mpc:
    net = Network(turning(v)).link("contact", None, v["K1"])
    return _stands(net.link("contact", "arm", v["K2"]).damper("arm", None, v["C"]))


def _arms(v: Numbers) -> mpc:
    net = Network(turning(v)).link("contact", None, v["K_inf"])
    for i in (1, 2):
        spring = v[f"K_{i}"]
        net.link("contact", f"arm {i}", spring).damper(f"arm {i}", None, spring * v[f"tau_{i}"])
    return _stands(net)


def _fractional(v: Numbers) -> mpc:
    """K0 beside a spring and a springpot in series; the springpot's force is a fractional derivative."""
    rise = v["K_inf"] - v["K0"]
    net = Network(turning(v)).link("contact", None, v["K0"]).link("contact", "arm", rise)
    return _stands(net.link("arm", None, rise * (J * turning(v) * v["tau"]) ** v["alpha"]))


def _fractional5(v: Numbers) -> mpc:
    """Havriliak and Negami's law of the dielectric modulus, for stiffness."""
    fluid = 1 / (1 + (J * turning(v) * v["tau"]) ** (-v["alpha"]))
    return v["K0"] + (v["K_inf"] - v["K0"]) * fluid ** v["beta"]


def _kraus(v: Numbers) -> mpc:
    """The fractional law, and Kraus's law of broken and mended contacts of the filler, scaled to 10 Hz."""
    size = (v["amplitude"] / v["x_c"]) ** v["m"]
    whole = 1 / (1 + size**2)
    filler = mpc(v["D"] * whole, 2 * v["L"] * size * whole + v["eta"] * v["D"] * whole)
    return _fractional(v) + (v["frequency"] / 10) ** v["beta"] * filler


FAMILIES: dict[str, tuple[dict[str, float], Callable[[Numbers], mpc]]] = {
    "spring": ({"K": 181e3}, lambda v: _stands(Network(turning(v)).link("contact", None, v["K"]))),
    "kelvin": (
        {"K": 181e3, "C": 640.0},
        lambda v: _stands(Network(turning(v)).link("contact", None, v["K"]).damper("contact", None, v["C"])),
    ),
    "structural": (
        {"K": 181e3, "eta": 0.13},
        lambda v: _stands(Network(turning(v)).link("contact", None, v["K"] * mpc(1, v["eta"]))),
    ),
    "zener": ({"K1": 180e3, "K2": 120e3, "C": 700.0}, _zener),
    "maxwell:2": (_ARMS, _arms),
    "prony": (_ARMS, _arms),
    "fractional": (_FRACTIONAL, _fractional),
    "fractional5": ({**_FRACTIONAL, "beta": 0.66}, _fractional5),
    "kraus": (_KRAUS, _kraus),
}


def models() -> Iterator[dict[str, Any]]:
    """K* of each family and its derivatives by each parameter."""
    for name, (given, law) in FAMILIES.items():
        for frequency in _FREQUENCIES:
            more = {"frequency": frequency, **({"amplitude": 4e-4} if name == "kraus" else {})}

            def whole(v: Numbers, given=given, law=law) -> dict[str, mpf]:
                found = parts("K*", law(v))
                for symbol in given:
                    found |= parts(f"dK*/d {symbol}", slope(lambda x, s=symbol: law({**v, s: x}), v[symbol]))
                return found

            units = {"K*": "N/m", **{f"dK*/d {symbol}": f"N/m per unit of {symbol}" for symbol in given}}
            yield case("models of K*", f"models {name}", units, {**given, **more}, whole)
    for name in ("zener", "maxwell:2"):
        given, law = FAMILIES[name]
        yield case(
            "models in time", f"models.state_space {name}", {"K*": "N/m"}, {**given, "frequency": 8.0},
            lambda v, law=law: parts("K*", law(v)),
        )  # fmt: skip
    yield case(
        "models in time", "models.prony zener", {"K at once": "N/m", "tau": "s"}, FAMILIES["zener"][0],
        lambda v: {"K at once": v["K1"] + v["K2"], "tau": v["C"] / v["K2"]},
    )  # fmt: skip
    yield case(
        "models in time", "models.step.simulate", {"force": "N"}, {**_ARMS, "rate": 0.05, "time": 0.02}, _ramp,
    )  # fmt: skip


def _ramp(v: Numbers) -> dict[str, mpf]:
    """Force of relaxing arms at the end of a ramp: the hereditary integral."""
    force = v["K_inf"] * v["rate"] * v["time"]
    for i in (1, 2):
        tau = v[f"tau_{i}"]
        force += mp.quad(
            lambda s, i=i, tau=tau: v[f"K_{i}"] * v["rate"] * mp.exp(-(v["time"] - s) / tau),
            mp.linspace(0, v["time"], 9),
        )
    return {"force": force}


def fits() -> Iterator[dict[str, Any]]:
    """Parameters that a fit must find again in K* of a family, without noise, and laws in shift factors."""
    frequencies = [1.5 * 1.6**at for at in range(12)]
    for name in ("kelvin", "zener", "maxwell:2", "fractional"):
        given, law = FAMILIES[name]
        exact = {key: mpf(value) for key, value in given.items()}
        found = [law({**exact, "frequency": mpf(f)}) for f in frequencies]
        order = ["K_inf", "K_1", "K_2", "tau_1", "tau_2"] if name == "maxwell:2" else list(given)
        yield {
            "check": "fits of models", "function": f"models.fit {name}", "inputs": {},
            "series": {"frequency": frequencies, "Re K*": [float(k.real) for k in found],
                       "Im K*": [float(k.imag) for k in found]},
            "values": _fitted(law, exact, order, frequencies),
        }  # fmt: skip
    temperatures = [-20.0, 0.0, 20.0, 40.0, 60.0]
    laws = {"WLF": {"C1": 8.86, "C2": 101.6}, "Arrhenius": {"E": 61e3}}
    for name, constants in laws.items():
        v = {**{key: mpf(value) for key, value in constants.items()}, "reference": mpf(20)}
        shifted = [(_wlf if name == "WLF" else _arrhenius)(v, mpf(t)) for t in temperatures]
        yield {
            "check": "fits of models", "function": f"models.shift_law.fit_laws {name}", "inputs": {},
            "series": {"temperature": temperatures, "ln aT": [float(one) for one in shifted]},
            "values": [value_row(key, UNITS[key], v[key], mpf("1e-6") * v[key]) for key in constants],
        }  # fmt: skip


#: Standard uncertainty of K* in a fit [N/m], and of ln aT [1]; share of a parameter's uncertainty by which a fit may
#: miss it.
U_OF_K, OF_U = mpf(100), mpf("1e-3")


#: Units of constants of shift laws, and of parameters that are no stiffness.
UNITS = {"C1": "1", "C2": "K", "E": "J/mol", "C": "N s/m", "alpha": "1"}


def _unit_of(symbol: str) -> str:
    return UNITS.get(symbol, "s" if symbol.startswith("tau") else "N/m")


def _fitted(law: Callable[[Numbers], mpc], exact: Numbers, order: list[str], frequencies: list[float]) -> list[Any]:
    """Parameters of a fit, and their uncertainties from the Fisher information."""
    columns = []
    for symbol in order:
        slopes = [
            slope(lambda x, s=symbol, f=f: law({**exact, s: x, "frequency": mpf(f)}), exact[symbol])
            for f in frequencies
        ]
        columns.append([part for one in slopes for part in (one.real, one.imag)])
    information = matrix([[mp.fdot(one, other) / U_OF_K**2 for other in columns] for one in columns])
    covariance = mp.inverse(information)
    rows = []
    for at, symbol in enumerate(order):
        u = mp.sqrt(covariance[at, at])
        rows += [
            value_row(name, _unit_of(symbol), one, OF_U * u)
            for name, one in ((symbol, exact[symbol]), (f"u({symbol})", u))
        ]
    return rows


def shifts() -> Iterator[dict[str, Any]]:
    """Shift factors over temperature, and the constants of WLF for another reference."""
    wlf = {"C1": 8.86, "C2": 101.6, "reference": 20.0, "temperature": -12.0}
    unit = {"ln aT": "1", "C1": "1", "C2": "K"}
    yield case("shift laws", "models.shift_law WLF", unit, wlf, lambda v: {"ln aT": _wlf(v, v["temperature"])})
    yield case("shift laws", "models.shift_law WLF moved", unit, wlf, _moved)
    unsure = {**wlf, "u C1": 1e-2, "u C2": 0.2, "corr": 0.8}
    yield case("shift laws", "models.shift_law WLF u", {**unit, "u(ln aT)": "1", "u(C1)": "1"}, unsure, _unsure,
               followed=("temperature", "C2"))  # fmt: skip
    yield case("shift laws", "models.shift_law Arrhenius u", {"u(ln aT)": "1"},
               {"E": 61e3, "u E": 900.0, "reference": 20.0, "temperature": 63.0},
               lambda v: {"u(ln aT)": abs(_arrhenius({**v, "E": v["u E"]}, v["temperature"]))})  # fmt: skip
    arrhenius = {"E": 61e3, "reference": 20.0, "temperature": 63.0}
    yield case(
        "shift laws", "models.shift_law Arrhenius", unit, arrhenius,
        lambda v: {"ln aT": _arrhenius(v, v["temperature"])},
    )  # fmt: skip


def _arrhenius(v: Numbers, temperature: mpf) -> mpf:
    zero = mpf("273.15")
    return v["E"] / mpf("8.31446261815324") * (1 / (temperature + zero) - 1 / (v["reference"] + zero))


def _unsure(v: Numbers) -> dict[str, mpf]:
    """Uncertainty of a shift factor, and of C1 at another reference, from those of both constants."""
    found = {}
    for name, of in (("ln aT", lambda w: _wlf(w, w["temperature"])), ("C1", lambda w: _moved(w)["C1"])):
        one, other = (v[f"u {key}"] * slope(lambda x, k=key, f=of: f({**v, k: x}), v[key]) for key in ("C1", "C2"))
        found[f"u({name})"] = mp.sqrt(one**2 + other**2 + 2 * v["corr"] * one * other)
    return found


def _wlf(v: Numbers, temperature: mpf) -> mpf:
    away = temperature - v["reference"]
    return mp.log(10) * (-v["C1"] * away) / (v["C2"] + away)


def _moved(v: Numbers) -> dict[str, mpf]:
    """C1 and C2 with which the law from another reference gives the same ratios of shift factors."""
    at = (v["temperature"] + 15, v["temperature"] + 40)
    wanted = tuple(_wlf(v, one) - _wlf(v, v["temperature"]) for one in at)

    def forward(c1: mpf, c2: mpf) -> tuple[mpf, ...]:
        there = {"C1": c1, "C2": c2, "reference": v["temperature"]}
        return tuple(_wlf(there, one) for one in at)

    c1, c2 = solved(forward, wanted, (v["C1"] * mpf("1.2"), v["C2"] * mpf("0.8")))
    return {"C1": c1, "C2": c2}


def sensors() -> Iterator[dict[str, Any]]:
    """Responses of delays, filters and geophones."""
    unit, head = {"H": "1"}, "measurement chain"
    yield case(
        head, "core.chain.Delay", unit, {"seconds": 1.3e-3, "frequency": 17.0},
        lambda v: parts("H", mp.expj(-turning(v) * v["seconds"])),
    )  # fmt: skip
    # Butterworth polynomials of first to third order, from tables of filters
    tables = {1: (1, 1), 2: (1, mp.sqrt(2), 1), 3: (1, 2, 2, 1)}
    for kind, order, corner in (("HighPass", 1, 0.5), ("HighPass", 3, 1.7), ("LowPass", 2, 90.0), ("LowPass", 3, 60.0)):

        def law(v: Numbers, kind: str = kind, order: int = order) -> dict[str, mpf]:
            s = J * v["frequency"] / v["corner"]
            return parts("H", 1 / mp.polyval(tables[order], s if kind == "LowPass" else 1 / s))

        given = {"corner": corner, "order": order, "frequency": 17.0}
        yield case(head, f"core.chain.{kind}", unit, given, law, followed=("corner", "frequency"))

    calibration = {"f1": 10.0, "f2": 20.0, "g1": 0.99, "g2": 1.02, "p1": 0.02, "p2": -0.01, "frequency": 14.0}

    def calibrated(v: Numbers) -> dict[str, mpf]:
        """Gain and phase on the straight lines between two frequencies."""
        at = (v["frequency"] - v["f1"]) / (v["f2"] - v["f1"])
        gain, phase = (v[f"{key}1"] + at * (v[f"{key}2"] - v[f"{key}1"]) for key in "gp")
        return {**parts("H", gain * mp.expj(phase)), "u gain": gain / 100, "u phase": abs(phase) / 50}

    yield case(head, "core.chain.Calibrated", {**unit, "u gain": "1", "u phase": "rad"}, calibration, calibrated)

    def geophone(v: Numbers) -> dict[str, mpf]:
        """A mass on spring and damper, on a base that moves: their difference over the base."""
        own = 2 * mp.pi * v["natural frequency"]
        net = Network(turning(v)).mass("mass", mpf(1))
        suspension = own**2 + J * turning(v) * 2 * v["damping"] * own
        moved = net.link("mass", None, suspension).displacements({"mass": suspension})["mass"]  # a base that moves by 1
        return parts("H", 1 - moved)

    given = {"natural frequency": 4.5, "damping": 0.56, "frequency": 6.2}
    yield case(head, "core.chain.Geophone", unit, given, geophone)


def values() -> Iterator[dict[str, Any]]:
    """Modulus and loss angle, deflection, and units."""
    given = {"Re K*": 194e3, "Im K*": 38.8e3}
    units = {
        "|K*|": "N/m", "loss angle": "rad", "d|K*|/dK'": "1", "d|K*|/dK''": "1", "d delta/dK'": "rad m/N",
        "d delta/dK''": "rad m/N",
    }  # fmt: skip

    def polar(v: Numbers) -> dict[str, mpf]:
        both = {"|K*|": abs, "d delta": mp.arg}
        found = {"|K*|": abs(mpc(v["Re K*"], v["Im K*"])), "loss angle": mp.arg(mpc(v["Re K*"], v["Im K*"]))}
        for name, of in both.items():
            start = name if name == "d delta" else f"d{name}"
            found[f"{start}/dK'"] = slope(lambda x, of=of: of(mpc(x, v["Im K*"])), v["Re K*"])
            found[f"{start}/dK''"] = slope(lambda x, of=of: of(mpc(v["Re K*"], x)), v["Im K*"])
        return found

    yield case("modulus and loss angle", "core.polar.polar", units, given, polar)
    speeds = {"Re V1": 0.05, "Im V1": 0.02, "Re V2": -0.01, "Im V2": 0.04, "frequency": 14.0}
    forced = {"Re F1": 310.0, "Im F1": -55.0, "Re K*": 194e3, "Im K*": 38.8e3}
    yield case(
        "deflection", "core.deflection.deflection_amplitude of force", {"x": "m"}, forced,
        lambda v: {"x": abs(mpc(v["Re F1"], v["Im F1"]) / mpc(v["Re K*"], v["Im K*"]))},
    )  # fmt: skip
    yield case(
        "deflection", "core.deflection.deflection_amplitude blocked", {"x": "m"}, speeds,
        lambda v: {"x": abs(mpc(v["Re V1"], v["Im V1"]) / (J * turning(v)))},
    )  # fmt: skip
    yield case(
        "deflection", "core.deflection.deflection_amplitude", {"x": "m"}, speeds,
        lambda v: {"x": abs(mpc(v["Re V1"] - v["Re V2"], v["Im V1"] - v["Im V2"]) / (J * turning(v)))},
    )  # fmt: skip
    inch, pound, gravity = mpf("0.0254"), mpf("0.45359237"), mpf("9.80665")
    for text, kind, unit, value in (
        ("12.44 kN/m", "stiffness", "N/m", mpf(12440)),
        ("180 N/mm", "stiffness", "N/m", mpf(180000)),
        ("1027.5 lbf/in", "stiffness", "N/m", mpf("1027.5") * pound * gravity / inch),
        ("2.1 bar", "pressure", "Pa", mpf(210000)),
        ("32 psi", "pressure", "Pa", 32 * pound * gravity / inch**2),
        ("310 lbf", "force", "N", 310 * pound * gravity),
        ("250 kgf", "force", "N", 250 * gravity),
        ("0.35 mm", "displacement", "m", mpf("0.00035")),
        ("0.2 deg", "angle", "rad", mpf("0.2") * mp.pi / 180),
        ("600 rpm", "frequency", "Hz", mpf(10)),
        ("68 degF", "temperature", "degC", mpf(20)),
        ("1.5 g", "acceleration", "m/s2", mpf("1.5") * gravity),
        ("4.2 lbf s/in", "damping", "N s/m", mpf("4.2") * pound * gravity / inch),
    ):
        row = value_row(text, unit, value, 4 * mpf(2) ** -53 * abs(value))
        yield {"check": "units", "function": "units.quantity", "inputs": {"text": text, "kind": kind}, "values": [row]}


def probabilities() -> Iterator[dict[str, Any]]:
    """Tails and quantiles from incomplete gamma and beta functions; the probability of a value within limits."""

    def student(x: mpf, k: mpf) -> mpf:
        return 1 - mp.betainc(k / 2, mpf(1) / 2, 0, k / (k + x * x), regularized=True) / 2

    def chi2(x: mpf, k: mpf) -> mpf:
        return mp.gammainc(k / 2, x / 2, mp.inf, regularized=True)

    def fisher(x: mpf, a: mpf, b: mpf) -> mpf:
        return mp.betainc(b / 2, a / 2, 0, b / (b + a * x), regularized=True)

    def normal(low: mpf, high: mpf) -> mpf:
        return (mp.erf(high / mp.sqrt(2)) - mp.erf(low / mp.sqrt(2))) / 2

    def root(function: Callable[[mpf], mpf], start: float) -> mpf:
        return mp.findroot(function, (mpf(start), mpf(start) * mpf("1.01")), tol=mpf(10) ** -100)

    found = (
        ("core.stats.t.ppf", {"level": 0.975, "dof": 4}, root(lambda x: student(x, mpf(4)) - mpf(0.975), 2.7)),
        (
            "core.phasor.Phasors.coverage_factor",
            {"level": 0.95, "dof": 7},
            root(lambda x: 2 * student(x, mpf(7)) - 1 - mpf(0.95), 2.4),
        ),
        ("core.stats.t.isf", {"chance": 0.02275, "dof": 9}, root(lambda x: 1 - student(x, mpf(9)) - mpf(0.02275), 2.3)),
        ("core.stats.chi2.sf", {"x": 17.3, "dof": 8}, chi2(mpf(17.3), mpf(8))),
        ("core.stats.chi2.isf", {"chance": 0.001, "dof": 6}, root(lambda x: chi2(x, mpf(6)) - mpf(0.001), 22.0)),
        ("core.stats.chi2.ppf", {"level": 0.975, "dof": 4}, root(lambda x: 1 - chi2(x, mpf(4)) - mpf(0.975), 11.0)),
        ("core.stats.f.sf", {"x": 3.1, "more": 4, "rest": 12}, fisher(mpf(3.1), mpf(4), mpf(12))),
        (
            "core.stats.f.isf",
            {"chance": 0.01, "more": 3, "rest": 9},
            root(lambda x: fisher(x, mpf(3), mpf(9)) - mpf(0.01), 7.0),
        ),
        ("core.stats.norm.isf", {"chance": 0.02275}, root(lambda x: mpf(1) / 2 - normal(0, x) - mpf(0.02275), 2.0)),
        (
            "core.stats.share_within",
            {"value": 196e3, "std": 1.5e3, "low": 194.5e3, "high": 198e3},
            normal((mpf(194500) - 196000) / 1500, (mpf(198000) - 196000) / 1500),
        ),
        (
            "core.stats.share_within",
            {"value": 196e3, "std": 1.5e3, "high": 193e3},
            mpf(1) / 2 - normal(0, (mpf(196000) - 193000) / 1500),
        ),
    )
    for function, given, value in found:
        row = value_row("probability" if ".sf" in function or "share" in function else "quantile", "1", value,
                        _OF_PROBABILITY * abs(value))  # fmt: skip
        yield {"check": "probabilities", "function": function, "inputs": given, "values": [row]}
