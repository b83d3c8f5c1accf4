"""What the package computes for the reference cases of models, sensors, probabilities, units and whole records."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from fourpole.core import stats
from fourpole.core.chain import Calibrated, Delay, Geophone, HighPass, Link, LowPass
from fourpole.core.demodulation.demodulate import demodulate
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.phasor import Phasors
from fourpole.core.recording import Channel, Recording
from fourpole.core.spectra.excited import Excited
from fourpole.core.spectra.random import random_amplitudes
from fourpole.core.spectra.sweep import sweep_amplitudes
from fourpole.models.data import StiffnessData
from fourpole.models.families import model_named
from fourpole.models.fit import fit
from fourpole.models.interface import Model
from fourpole.models.prony import Prony
from fourpole.models.shift_law import ShiftLaw, fit_laws
from fourpole.models.starts import start_of
from fourpole.models.step import simulate
from fourpole.report.selftest.mechanics import Found, Inputs, omega, parts
from fourpole.units import quantity

_FAMILIES = (
    "spring", "kelvin", "structural", "zener", "maxwell:2", "prony", "fractional", "fractional5", "kraus",
)  # fmt: skip


def _model(name: str, v: Inputs) -> tuple[Model, list[float], list[str]]:
    """A model, the values of its parameters, and their symbols."""
    model = Prony(1, [v["tau_1"], v["tau_2"]]) if name == "prony" else model_named(name)
    if "amplitude" in v:
        model = model.at_amplitude(v["amplitude"])
    return model, [v[symbol] for symbol in model.symbols], model.symbols


def _of_model(name: str, v: Inputs) -> Found:
    model, values, symbols = _model(name, v)
    slopes = model.derivative(values, [omega(v)])[0]
    return {
        **parts("K*", model.stiffness(values, [omega(v)])),
        **{key: one for at, symbol in enumerate(symbols) for key, one in parts(f"dK*/d {symbol}", slopes[at]).items()},
    }


def _of_states(name: str, v: Inputs) -> Found:
    model, values, _ = _model(name, v)
    return parts("K*", model.state_space(values).stiffness(omega(v)))


def _ramp(v: Inputs) -> Found:
    model, values, _ = _model("maxwell:2", v)
    time = np.linspace(0.0, v["time"], 5)
    force = simulate(model.state_space(values), v["rate"] * time, np.full(5, v["rate"]), time[1])
    return {"force": force[-1]}


def _fit(name: str, v: Inputs) -> Found:
    """Parameters and their uncertainties, from K* that is known to 100 N/m."""
    model = model_named(name)
    data = StiffnessData.of(
        2 * np.pi * np.array(v["frequency"]), np.array(v["Re K*"]) + 1j * np.array(v["Im K*"]), 100.0
    )
    found = fit(model, data, start_of(model, data))
    std = np.sqrt(np.diag(found.covariance))
    names = zip(model.symbols, found.values, std, strict=True)
    return {key: one for symbol, value, u in names for key, one in ((symbol, value), (f"u({symbol})", u))}


def _fit_law(name: str, v: Inputs) -> Found:
    temperatures = np.array(v["temperature"])
    size, reference = temperatures.size, v["temperature"].index(20.0)
    choice = fit_laws(temperatures, np.array(v["ln aT"]), 1e-4 * np.eye(size), reference)
    law = next(one for one in choice.laws if one.name == name)
    return dict(zip(("C1", "C2") if name == "WLF" else ("E",), law.values, strict=True))


def _law(name: str, v: Inputs) -> ShiftLaw:
    values = np.array([v["C1"], v["C2"]] if name == "WLF" else [v["E"]])
    std = np.array([v.get("u C1", 0.0), v.get("u C2", 0.0)] if name == "WLF" else [v.get("u E", 0.0)])
    correlation = np.eye(values.size) + v.get("corr", 0.0) * (1 - np.eye(values.size))
    return ShiftLaw(name, v["reference"], values, correlation * std * std[:, None])


def _unsure(v: Inputs) -> Found:
    law = _law("WLF", v)
    return {"u(ln aT)": law.log_a_std(v["temperature"])[0], "u(C1)": law.at_reference(v["temperature"]).std[0]}


def _calibrated(v: Inputs) -> Found:
    frequency, gain, phase = (np.array([v[f"{key}1"], v[f"{key}2"]]) for key in "fgp")
    link = Calibrated(frequency, gain, phase, gain / 100, phase / 50)
    u_gain, u_phase = link.std_at(v["frequency"])
    return {**parts("H", link.at(v["frequency"])), "u gain": u_gain, "u phase": u_phase}


def _arms(v: Inputs) -> Found:
    model, values, _ = _model("zener", v)
    arms = model.prony(values)
    return {"K at once": arms.instantaneous, "tau": arms.times[0]}


def _coverage(v: Inputs) -> Found:
    zero = np.zeros(1)
    tests = Phasors(zero, np.zeros((1, 3), dtype=complex), np.zeros((1, 6, 6)), zero, np.array([v["dof"]]))
    return {"quantile": tests.coverage_factor(v["level"])[0]}


def _moved(v: Inputs) -> Found:
    return dict(zip(("C1", "C2"), _law("WLF", v).at_reference(v["temperature"]).values, strict=True))


def _at(link: Callable[[Inputs], Link]) -> Callable[[Inputs], Found]:
    return lambda v: parts("H", link(v).at(v["frequency"]))


def _filter(kind: type[HighPass] | type[LowPass], v: Inputs) -> Link:
    return kind(v["corner"], int(v["order"]))


def _statistic(function: Callable[..., Any], name: str, v: Inputs) -> Found:
    return {name: float(function(**v))}


def _unit(v: Inputs) -> Found:
    return {v["text"]: quantity(v["text"], v["kind"])}


def _curve(v: Inputs) -> Found:
    curve = LoadCurve(np.array(v["deflection"]), np.array(v["load"]))
    tangent = curve.tangent(v["at"])
    return {
        "K1": tangent.stiffness,
        "K1 loading": tangent.loading,
        "K1 unloading": tangent.unloading,
        "branch gap": tangent.gap,
        "secant": curve.secant(v["at"]).stiffness,
        "hysteresis loss": curve.hysteresis_loss,
    }


def _links(stated: Inputs) -> tuple[Link, ...]:
    made = {"low pass": LowPass, "high pass": HighPass, "geophone": Geophone}
    return tuple(kind(*stated[key]) for key, kind in made.items() if key in stated)


def _amplitudes(v: Inputs) -> Found:
    channels = {
        role: Channel(
            np.array(v[role]),
            stated["quantity"],
            delay=stated.get("delay", 0.0),
            rate=stated.get("rate"),
            start=stated.get("start", 0.0),
            chain=_links(stated),
        )
        for role, stated in v["channels"].items()
    }
    found = demodulate(Recording(v["rate"], channels)).phasors
    return {
        **parts("V1/F1", found.mobility),
        **parts("V2/V1", found.transmissibility),
        "|F1|": abs(complex(found.force_in)),
        "frequency": float(found.frequency),
    }


def _lines(method: Callable[..., Excited], v: Inputs) -> Found:
    """K*, F1/V1 and V2/V1 at each line of a recording, by the frequency of the line."""
    force, contact, wheel = (np.tile(v[role], v["periods"]) for role in ("force_in", "motion_in", "motion_out"))
    time = np.arange(contact.size) / v["rate"]
    recording = Recording.from_arrays(time, force_in=force, motion_in=contact, motion_out=wheel)
    found = method(recording, (v["low"], v["high"])).phasors
    values: Found = {}
    for at in range(found.frequency.size):
        f1, v1, v2 = found.amplitudes[at]
        omega = float(found.omega[at])
        for name, one in (("K*", 1j * omega * f1 / (v1 - v2)), ("F1/V1", f1 / v1), ("V2/V1", v2 / v1)):
            values |= {f"{key} at {float(found.frequency[at]):g} Hz": part for key, part in parts(name, one).items()}
    return values


#: What the package finds for the inputs of a case, by the function that the case names.
MATERIALS: dict[str, Callable[[Inputs], Found]] = {
    **{f"models {name}": partial(_of_model, name) for name in _FAMILIES},
    **{f"models.state_space {name}": partial(_of_states, name) for name in ("zener", "maxwell:2")},
    "models.step.simulate": _ramp,
    "models.shift_law WLF": lambda v: {"ln aT": float(_law("WLF", v).log_a(v["temperature"])[0])},
    "models.shift_law WLF moved": _moved,
    "models.shift_law Arrhenius": lambda v: {"ln aT": float(_law("Arrhenius", v).log_a(v["temperature"])[0])},
    **{f"models.fit {name}": partial(_fit, name) for name in ("kelvin", "zener", "maxwell:2", "fractional")},
    **{f"models.shift_law.fit_laws {name}": partial(_fit_law, name) for name in ("WLF", "Arrhenius")},
    "core.chain.Delay": _at(lambda v: Delay(v["seconds"])),
    "models.shift_law WLF u": _unsure,
    "models.shift_law Arrhenius u": lambda v: {"u(ln aT)": float(_law("Arrhenius", v).log_a_std(v["temperature"])[0])},
    "models.prony zener": _arms,
    "core.chain.Calibrated": _calibrated,
    "core.phasor.Phasors.coverage_factor": _coverage,
    "core.chain.HighPass": _at(partial(_filter, HighPass)),
    "core.chain.LowPass": _at(partial(_filter, LowPass)),
    "core.chain.Geophone": _at(lambda v: Geophone(v["natural frequency"], v["damping"])),
    "core.stats.t.ppf": lambda v: _statistic(stats.t.ppf, "quantile", v),
    "core.stats.t.isf": lambda v: _statistic(stats.t.isf, "quantile", v),
    "core.stats.chi2.sf": lambda v: _statistic(stats.chi2.sf, "probability", v),
    "core.stats.chi2.isf": lambda v: _statistic(stats.chi2.isf, "quantile", v),
    "core.stats.chi2.ppf": lambda v: _statistic(stats.chi2.ppf, "quantile", v),
    "core.stats.f.sf": lambda v: _statistic(stats.f.sf, "probability", v),
    "core.stats.f.isf": lambda v: _statistic(stats.f.isf, "quantile", v),
    "core.stats.norm.isf": lambda v: _statistic(stats.norm.isf, "quantile", v),
    "core.stats.share_within": lambda v: _statistic(stats.share_within, "probability", v),
    "units.quantity": _unit,
    "core.loadcurve.LoadCurve": _curve,
    "core.demodulation.demodulate": _amplitudes,
    "core.spectra.random.random_amplitudes": partial(_lines, random_amplitudes),
    "core.spectra.sweep.sweep_amplitudes": partial(_lines, sweep_amplitudes),
}
