"""What the package computes for the reference cases, by calls.toml; what is more than one call stands here."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping
from importlib import resources
from pkgutil import resolve_name
from typing import Any

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.chain import Calibrated, Geophone, HighPass, LowPass
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.demodulation.demodulate import demodulate
from fourpole.core.identify import identify
from fourpole.core.phasor import Phasors
from fourpole.core.recording import Channel, Recording
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.routes import arm_slopes, maxwell_arm, paper_d, stiffness_by
from fourpole.core.spectra.random import random_amplitudes
from fourpole.core.spectra.sweep import sweep_amplitudes
from fourpole.core.twoport import cascade, damper, deembed, mass, spring
from fourpole.core.tyre import transmissibility, zener_mobility, zener_stiffness, zener_transmissibility
from fourpole.models.data import StiffnessData
from fourpole.models.families import model_named
from fourpole.models.fit import fit
from fourpole.models.interface import Model
from fourpole.models.maxwell import Prony
from fourpole.models.problem import start_of
from fourpole.models.shift_law import ShiftLaw, fit_laws
from fourpole.models.step import simulate
from fourpole.units import quantity

#: Inputs of a case, and what is calculated, by name.
Inputs = Mapping[str, Any]
Values = dict[str, Any]
#: Values of a rig by their names in the cases.
_OF_RIG = {
    "m": "moving_mass",
    "K3": "preload_stiffness",
    "c3": "preload_damping",
    "preload loss factor": "preload_loss_factor",
    "tyre mass": "tyre_mass",
    "frame stiffness": "frame_stiffness",
    "input mass": "input_mass",
}
_CHANNELS = ("F1", "V1", "V2")
_CALLS = tomllib.loads(resources.files("fourpole.report.selftest").joinpath("calls.toml").read_text(encoding="utf-8"))


def calculated(case: Mapping[str, Any]) -> Values:
    """The values of a case by name; one with "Re" and "Im" in the case is complex."""
    inputs = _inputs_of(case)
    values: Values = {}
    for names, call in _CALLS[case["function"]].items():
        result = _result(call, inputs)
        values |= result if isinstance(result, dict) else zip(names.split(", "), _flat(result), strict=False)
    return values


def _inputs_of(case: Mapping[str, Any]) -> Values:
    """The inputs of a case: series as arrays, complex ones whole, and the angular frequency."""
    inputs = {name: np.array(value) if isinstance(value, list) else value for name, value in case["inputs"].items()}
    inputs |= {name: np.array(values) for name, values in case.get("series", {}).items()}
    inputs |= {name[3:]: inputs[name] + 1j * inputs[f"Im {name[3:]}"] for name in list(inputs) if name[:3] == "Re "}
    if "frequency" in inputs:
        inputs["omega"] = 2 * np.pi * inputs["frequency"]
    if "order" in inputs:
        inputs["order"] = int(inputs["order"])
    return {**inputs, "channels": case.get("channels", {})}


def _result(call: Any, inputs: Inputs) -> Any:
    """The result of a call or an argument; calls.toml says what they are."""
    if isinstance(call, str):
        return inputs if call == "inputs" else call[1:] if call.startswith("=") else inputs[call]
    if not isinstance(call, list):
        return call
    path, *stated = call
    if path == "of":
        owner = _result(stated[0], inputs)
        return [getattr(owner, name) for name in stated[1:]]
    named = _named(stated.pop(), inputs) if isinstance(stated[-1], dict) else {}
    given = [_result(argument, inputs) for argument in stated]
    if path == "list":
        return given
    return resolve_name(f"{__name__}:{path[1:]}" if path.startswith(".") else f"fourpole.{path}")(*given, **named)


def _named(stated: Mapping[str, Any], inputs: Inputs) -> Values:
    """Named arguments without those that a case does not state."""
    missing = [key for key, name in stated.items() if isinstance(name, str) and name[:1] != "=" and name not in inputs]
    return {key: _result(name, inputs) for key, name in stated.items() if key not in missing}


def _flat(result: Any) -> Iterator[Any]:
    """The numbers of a result in their order."""
    if isinstance(result, tuple | list):
        for part in result:
            yield from _flat(part)
    else:
        yield from np.ravel(result)


def chain_of(v: Inputs) -> ComplexArray:
    """The four-pole of mass, spring, damper and mass in a chain."""
    return cascade(mass(v["m"], v["omega"]), spring(v["K"], v["omega"]), damper(v["C"]), mass(v["M"], v["omega"]))


def behind(v: Inputs) -> ComplexArray:
    """The four-pole behind the tyre: the moving mass and the preload spring."""
    return cascade(mass(v["m"], v["omega"]), spring(v["K3"], v["omega"]))


def deembedded(v: Inputs) -> complex:
    """The entry a21 of a tyre, found between the input mass and the rig."""
    before, after = mass(v["input mass"], v["omega"]), behind(v)
    whole = cascade(before, spring(v["K*"], v["omega"]), after)
    return complex(deembed(whole, before=before, after=after)[1, 0])


def on_papers_rig(v: Inputs) -> list[Any]:
    """K*, mobility, d, TR and the angle of V2/V1 of a tyre on the rig of the paper."""
    tyre, above = (v["K1"], v["K2"], v["C"], v["omega"]), {"mass": v["m"], "preload_stiffness": v["K3"]}
    stiffness = zener_stiffness(*tyre)
    ratio = transmissibility(stiffness, v["omega"], **above)
    return [
        stiffness,
        zener_mobility(*tyre, **above),
        paper_d(stiffness, v["K1"]),
        zener_transmissibility(*tyre, **above),
        np.angle(ratio),
    ]


def rig_of(v: Inputs, blocked: bool = False) -> Rig:
    """The rig of a case, with the uncertainties that it states."""
    stated = {name: v[key] for key, name in _OF_RIG.items() if key in v}
    return Rig(**stated, blocked=blocked, std={name: v[f"u {key}"] for key, name in _OF_RIG.items() if f"u {key}" in v})


def gradient_of_rig(v: Inputs) -> Values:
    """The derivatives of the impedance by the values of the rig and the added mass."""
    gradient = rig_of(v).impedance_gradient(v["omega"], v["added mass"])
    names = {**_OF_RIG, "added mass": "added_mass"}
    places = [*PARAMETERS, "added_mass"]
    return {f"dZr/d {key}": gradient[places.index(name)] for key, name in names.items() if key in v}


def by_route(route: str, v: Inputs) -> ComplexArray:
    """K* of amplitudes and the impedance of the rig by a route."""
    return stiffness_by(route, [np.array([v[name]]) for name in _CHANNELS], v["Zr"], v["omega"])


def slopes_of_arm(stiffness: complex, k1: float, omega: float) -> FloatArray:
    """The derivatives of K2 and C by Re K*, Im K* and K1."""
    rows = np.array([stiffness]), np.array([k1]), np.array([omega])
    return arm_slopes(*rows[:2], maxwell_arm(*rows), rows[2], np.array([[1.0, 1j, -1.0]]))[0]


def phasors_of(v: Inputs) -> Phasors:
    """The amplitudes of a case, with the noise that it states."""
    own = np.diag(np.repeat([v.get(f"u {name}", 0.0) for name in _CHANNELS], 2) ** 2)
    both = np.outer([0, 0, 1, 0, 1, 0], [0, 0, 1, 0, 1, 0]) + np.outer([0, 0, 0, 1, 0, 1], [0, 0, 0, 1, 0, 1])
    return Phasors(
        np.array([v["frequency"]]),
        np.array([[v[name] for name in _CHANNELS]]),
        (own + v.get("common noise of V1, V2", 0.0) ** 2 * both)[None],
        np.array([v.get("u frequency", 0.0)]),
        np.array([np.inf]),
    )


def uncertainties(route: str, v: Inputs) -> Values:
    """The uncertainties and correlations of all values of a test by a route."""
    gains, phases = np.array([v["gain F1"], 0.0, 0.0]), np.array([0.0, v["phase V1"], 0.0])
    response = np.array([[0.0, 0.0, complex(v["response gain V2"], v["response phase V2"])]])
    test = identify(
        phasors_of(v),
        rig_of(v),
        v["K1"],
        k1_std=v["u K1"],
        route=route,
        added_mass=v["added mass"],
        added_mass_std=v["u added mass"],
        channels=ChannelUncertainty(gains, phases, np.array([0.0, 0.0, v["delay V2"]]), response=response),
    )
    of_stiffness, of_arm = test.stiffness_covariance[0], test.arm_covariance[0]
    u_re, u_im = np.sqrt(np.diag(of_stiffness))
    u_k2, u_c = np.sqrt(np.diag(of_arm))
    own_re, own_im = np.sqrt(np.diag(test.condition_covariance[0]))
    common_re, common_im = (np.linalg.norm(row) for row in test.stiffness_shared[0])
    return {
        "own u(Re K*)": own_re,
        "own u(Im K*)": own_im,
        "common u(Re K*)": common_re,
        "common u(Im K*)": common_im,
        "u(Re K*)": u_re,
        "u(Im K*)": u_im,
        "corr(Re,Im K*)": of_stiffness[0, 1] / (u_re * u_im),
        "u(loss factor)": test.loss_factor_std[0],
        "u(K2)": u_k2,
        "u(C)": u_c,
        "corr(K2,C)": of_arm[0, 1] / (u_k2 * u_c),
        "u(TR)": test.tr_std[0],
    }


def coverage(level: float, dof: float) -> FloatArray:
    """The coverage factor of amplitudes with these degrees of freedom."""
    zero = np.zeros(1)
    tests = Phasors(zero, np.zeros((1, 3), dtype=complex), np.zeros((1, 6, 6)), zero, np.array([dof]))
    return tests.coverage_factor(level)


def _model(name: str, v: Inputs) -> tuple[Model, list[float]]:
    """A model, and the values of its parameters."""
    model = Prony(1, [v["tau_1"], v["tau_2"]]) if name == "prony" else model_named(name)
    if "amplitude" in v:
        model = model.at_amplitude(v["amplitude"])
    return model, [v[symbol] for symbol in model.symbols]


def slopes_of_model(name: str, v: Inputs) -> Values:
    """K* of a model, and its derivatives by the parameters."""
    model, values = _model(name, v)
    slopes = model.derivative(values, [v["omega"]])[0]
    by_parameter = {f"dK*/d {symbol}": slope for symbol, slope in zip(model.symbols, slopes, strict=True)}
    return {"K*": model.stiffness(values, [v["omega"]])[0], **by_parameter}


def by_states(name: str, v: Inputs) -> ComplexArray:
    """K* of a model by its state space."""
    model, values = _model(name, v)
    return model.state_space(values).stiffness(v["omega"])


def arms_of_zener(v: Inputs) -> list[Any]:
    """The stiffness at once and the relaxation time of a Zener model."""
    model, values = _model("zener", v)
    arms = model.prony(values)
    return [arms.instantaneous, arms.times]


def force_of_ramp(v: Inputs) -> float:
    """The force of two Maxwell arms at the end of a ramp."""
    model, values = _model("maxwell:2", v)
    time = np.linspace(0.0, v["time"], 5)
    return float(simulate(model.state_space(values), v["rate"] * time, np.full(5, v["rate"]), time[1])[-1])


def fitted(name: str, frequency: FloatArray, stiffness: ComplexArray) -> Values:
    """Parameters and their uncertainties, from K* that is known to 100 N/m."""
    model, data = model_named(name), StiffnessData.of(2 * np.pi * frequency, stiffness, 100.0)
    best = fit(model, data, start_of(model, data))
    stds = np.sqrt(np.diag(best.covariance))
    by_name = zip(model.symbols, best.values, strict=True)
    return {**dict(by_name), **{f"u({symbol})": u for symbol, u in zip(model.symbols, stds, strict=True)}}


def fitted_law(name: str, temperature: FloatArray, log_a: FloatArray) -> FloatArray:
    """The constants of a law of time and temperature, with the reference 20 degC."""
    choice = fit_laws(temperature, log_a, 1e-4 * np.eye(temperature.size), temperature.tolist().index(20.0))
    return next(law for law in choice.laws if law.name == name).values


def wlf(v: Inputs) -> ShiftLaw:
    """A WLF law with the uncertainties that a case states."""
    std = np.array([v.get("u C1", 0.0), v.get("u C2", 0.0)])
    correlation = np.array([[1.0, v.get("corr", 0.0)], [v.get("corr", 0.0), 1.0]])
    return ShiftLaw("WLF", v["reference"], np.array([v["C1"], v["C2"]]), correlation * std * std[:, None])


def arrhenius(v: Inputs) -> ShiftLaw:
    """An Arrhenius law with the uncertainty that a case states."""
    return ShiftLaw("Arrhenius", v["reference"], np.array([v["E"]]), np.array([[v.get("u E", 0.0) ** 2]]))


def calibrated_of(v: Inputs) -> Calibrated:
    """A sensor with a calibrated response at two frequencies."""
    frequency, gain, phase = (np.array([v[f"{key}1"], v[f"{key}2"]]) for key in "fgp")
    return Calibrated(frequency, gain, phase, gain / 100, phase / 50)


def quantity_by_text(text: str, kind: str) -> Values:
    """A quantity in SI by its text."""
    return {text: quantity(text, kind)}


def amplitudes(v: Inputs) -> list[Any]:
    """V1/F1, V2/V1, the amplitude of F1 and the frequency of a recording."""
    links = {"low pass": LowPass, "high pass": HighPass, "geophone": Geophone}
    channels = {}
    for role, stated in v["channels"].items():
        chain = tuple(link(*stated[key]) for key, link in links.items() if key in stated)
        others = {key: value for key, value in stated.items() if key not in links}
        channels[role] = Channel(v[role], **others, chain=chain)
    test = demodulate(Recording(v["rate"], channels)).phasors
    return [test.mobility, test.transmissibility, abs(complex(test.force_in)), test.frequency]


def lines(method: str, v: Inputs) -> Values:
    """K*, F1/V1 and V2/V1 at each line of a recording, by the frequency of the line."""
    force, contact, wheel = (np.tile(v[role], v["periods"]) for role in ("force_in", "motion_in", "motion_out"))
    time = np.arange(contact.size) / v["rate"]
    recording = Recording.from_arrays(time, force_in=force, motion_in=contact, motion_out=wheel)
    reduce: Callable[..., Any] = {"random": random_amplitudes, "sweep": sweep_amplitudes}[method]
    test = reduce(recording, (v["low"], v["high"])).phasors
    values: Values = {}
    for frequency, omega, (f1, v1, v2) in zip(test.frequency, test.omega, test.amplitudes, strict=True):
        at = f"at {float(frequency):g} Hz"
        values |= {f"K* {at}": 1j * omega * f1 / (v1 - v2), f"F1/V1 {at}": f1 / v1, f"V2/V1 {at}": v2 / v1}
    return values
