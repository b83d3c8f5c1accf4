"""The figures and tables of the documentation that are made, not drawn or typed by hand.

    python docs/build/figures.py [NAME ...]

writes the figures into docs/made and the tables into the pages, between their marks. Each function of `FIGURES` returns
a figure as data, and `fourpole.plot.drawn` draws it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import passive_tyre as pt
from tables import TABLES, written

from fourpole import ChannelUncertainty, Recording, Rig, demodulate, identify_joint, maxwell_arm
from fourpole.campaign.row import Test
from fourpole.core.allpoles import Setups, all_poles, reciprocal
from fourpole.core.specimenfit import fit_specimen
from fourpole.core.tyre import zener_stiffness
from fourpole.models.fractional import FractionalZener
from fourpole.models.maxwell import GeneralisedMaxwell, Prony
from fourpole.models.ramp import Ramp
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series
from fourpole.plot.drawn import figure_of
from fourpole.plot.layout import figure_bytes
from fourpole.plot.plan import two_port_figure
from fourpole.plot.style import Size, Style, drawing
from fourpole.study.twoports import TwoPort
from fourpole.virtual.phasor_rig import Conditions, DrawnLaboratory, Laboratory, draw, simulate_phasors

MADE = Path(__file__).resolve().parent.parent / "made"
_HZ = AxisData("frequency", "Hz")


def line(x: np.ndarray, y: np.ndarray, label: str = "", colour: int = 0, dash: int = 0) -> Series:
    """A curve with a label at its end, in one of the colours of specimens."""
    return Series(
        Role.LINE, np.asarray(x, dtype=float), np.asarray(y, dtype=float), label=label, tyre=colour, dash=dash
    )


def beside(*panels: Panel, height: float = 2.6) -> FigureData:
    """Panels beside each other, each with its own ordinate."""
    return FigureData(panels, columns=len(panels), panel_height=height, shared=False)


def mobility() -> FigureData:
    """|V1/F1| of the tyre, of the rig above it, and of both in series."""
    f = np.geomspace(2.0, 60.0, 400)
    omega = 2 * np.pi * f
    over_rig = np.asarray(Rig(moving_mass=15.0, preload_stiffness=12440.0, preload_damping=15.0).mobility(omega))
    over_tyre = 1j * omega / zener_stiffness(120e3, 90e3, 800.0, omega)
    axes = AxisData("frequency", "Hz", log=True), AxisData("|V1/F1|", "mm/(N s)", log=True)
    parts = {"tyre": (over_tyre, 0), "rig": (over_rig, 1), "both": (over_tyre + over_rig, 2)}
    curves = tuple(line(f, 1e3 * np.abs(one), name, colour) for name, (one, colour) in parts.items())
    return beside(Panel(*axes, curves), height=2.9)


def masses() -> FigureData:
    """Uncertainty of K' and K'' over frequency: one mass, two masses, two masses with sensors ten times worse."""
    f = np.arange(10.0, 25.0)
    stiffness = pt.tyre(f)
    panels: dict[str, list[Series]] = {"K'": [], "K''": []}
    for at, (label, added, gain) in enumerate(
        (("one mass", (0.0,), 0.01), ("two masses", (0.0, 10.0), 0.01), ("two, 10 × worse", (0.0, 10.0), 0.1))
    ):
        uncertainty = _of_masses(f, stiffness, added, gain)
        for name, column in zip(panels, uncertainty.T, strict=True):
            panels[name].append(line(f, column, label, at, at // 2))
    axes = {name: AxisData(f"u({name})/|K*|", "%", log=True) for name in panels}
    return beside(*(Panel(_HZ, axes[name], tuple(curves)) for name, curves in panels.items()))


def _of_masses(f: np.ndarray, stiffness: np.ndarray, added: tuple[float, ...], gain: float) -> np.ndarray:
    """u(K') and u(K'') over |K*| (F, 2) [%] by the joint route, for exact phasors with the noise of a laboratory."""
    count, angle = len(added), gain / 0.01 * np.radians(0.5)
    mass = np.repeat(added, f.size)
    laboratory = Laboratory(std_added=0.0)
    nominal = draw(laboratory, np.random.default_rng(0), added_masses=list(added))
    stated = {"moving_mass": 15.0, "preload_stiffness": 12440.0, "preload_damping": 15.0}
    exact = DrawnLaboratory(**{**vars(nominal), **stated})
    tests = Conditions(frequency=np.tile(f, count), stiffness=np.tile(stiffness, count), added_mass=mass)
    phasors = simulate_phasors(laboratory, tests, np.random.default_rng(0), truth=exact).phasors
    spread = np.repeat(1e-4 * np.abs(phasors.amplitudes), 2, axis=1)
    phasors.covariance[:, range(6), range(6)] = spread**2
    rig = Rig(**stated, std={"moving_mass": 0.3, "preload_stiffness": 250.0, "preload_damping": 5.0})
    found = identify_joint(
        phasors,
        rig,
        added_mass=mass,
        added_mass_std=1e-4 * mass,
        channels=ChannelUncertainty(np.full(3, gain), np.full(3, angle)),
    )
    of_both = np.sqrt(np.diagonal(found.stiffness_covariance, 0, 1, 2))[: f.size]
    return np.asarray(100 * of_both / np.abs(stiffness)[:, None])


def curvature() -> FigureData:
    """K2 and C with their intervals over an error of K1, to first and to second order."""
    omega = 2 * np.pi * 10.0
    true = zener_stiffness(180e3, 120e3, 700.0, omega)
    off = np.linspace(-8e3, 8e3, 161)
    values = maxwell_arm(true, 180e3 + off, omega)
    panels = []
    for at, (name, unit, scale) in enumerate((("K2", "kN/m", 1e-3), ("C", "N s/m", 1.0))):
        middle = float(maxwell_arm(true, 180e3, omega)[at])
        slope = float((values[at][81] - values[at][79]) / (off[81] - off[79]))
        curves = (
            line(off / 1e3, scale * values[at], "exact", 0),
            line(off / 1e3, scale * (middle + slope * off), "first order", 1, 1),
        )
        panels.append(Panel(AxisData("error of K1", "kN/m"), AxisData(name, unit), curves))
    return beside(*panels)


def ramp() -> FigureData:
    """Share of an arm's stiffness in K1, over its relaxation time, for the first and later loops."""
    times = np.geomspace(1e-3, 1e3, 300)
    curves = tuple(
        line(times, 100 * np.round(Ramp(1.0, cycle, 0.5).share(times), 5), f"loop {cycle}", at)
        for at, cycle in enumerate((1, 3, 30))
    )
    axes = AxisData("relaxation time over time per branch", "1", log=True), AxisData("share of the arm in K1", "%")
    return beside(Panel(*axes, curves), height=2.6)


def relaxation() -> FigureData:
    """K' and loss factor of one arm, of eight arms and of the fractional model."""
    f = np.geomspace(0.1, 1000.0, 300)
    omega = 2 * np.pi * f
    models = {
        "one arm": GeneralisedMaxwell(1).stiffness([150e3, 100e3, 0.01], omega),
        "eight arms": pt.tyre(f),
        "fractional": FractionalZener().stiffness([110e3, 235e3, 0.01, 0.25], omega),
    }
    axes = AxisData("frequency", "Hz", log=True)
    stiff = tuple(line(f, one.real / 1e3, name, at) for at, (name, one) in enumerate(models.items()))
    loss = tuple(line(f, one.imag / one.real, name, at) for at, (name, one) in enumerate(models.items()))
    return beside(Panel(axes, AxisData("K'", "kN/m"), stiff), Panel(axes, AxisData("loss factor", "1"), loss))


def prony() -> FigureData:
    """Ripple of K'' of a flat spectrum that is replaced by one, two or three relaxation times per decade."""
    f = np.geomspace(1.0, 100.0, 400)
    curves = []
    for at, per_decade in enumerate((1, 2, 3)):
        times = np.logspace(6.0, -8.0, 14 * per_decade + 1)
        loss = Prony(per_decade, times).stiffness([0.0, *np.ones(times.size), *times], 2 * np.pi * f).imag
        curves.append(
            line(f, 100 * (loss / (np.pi / 2 * per_decade / np.log(10.0)) - 1), f"{per_decade} per decade", at)
        )
    axes = AxisData("frequency", "Hz", log=True), AxisData("ripple of K''", "%")
    return beside(Panel(*axes, tuple(curves)), height=2.6)


def leakage() -> FigureData:
    """Error of an amplitude by the Fourier sum and by the sine fit, over the number of cycles."""
    cycles = np.linspace(3.0, 7.8, 97)
    by_sum, by_fit = np.empty(cycles.size), np.empty(cycles.size)
    for at, count in enumerate(cycles.tolist()):
        t = np.arange(round(100 * count)) / 1000.0
        wave = np.sin(2 * np.pi * 10.0 * t + 0.3)
        by_sum[at] = abs(2 * np.mean(wave * np.exp(-2j * np.pi * 10.0 * t)))
        recording = Recording.from_arrays(t, force_in=wave, motion_in=wave)
        found = demodulate(recording, frequency=10.0, harmonics=2).phasors
        by_fit[at] = abs(found.force_in)
    curves = (line(cycles, 100 * (by_sum - 1), "Fourier sum", 1), line(cycles, 100 * (by_fit - 1), "sine fit", 0))
    return beside(Panel(AxisData("length of the record", "cycles"), AxisData("error of the amplitude", "%"), curves))


def faults_in_c() -> FigureData:
    """C by the paper's route over frequency, with each of six faults, and with wrong K1."""
    return _by_fault(1, AxisData("C", "N s/m"), 1.0)


def faults_in_k2() -> FigureData:
    """K2 by the paper's route over frequency, with the same faults."""
    return _by_fault(0, AxisData("K2", "kN/m"), 1e-3)


def _by_fault(which: int, axis: AxisData, scale: float) -> FigureData:
    """K2 or C of the page's tyre by the paper's route, without a fault and with some."""
    named = {fault.name: fault for fault in pt.FAULTS}
    shown = (
        (
            "V1/F1 too low",
            "m stated too low",
            "K3 stated too high",
            "unweighed mass between cell and contact",
            "tyre's part moves with m, not counted",
            "V1 ahead in phase",
        ),
        (
            "V1/F1 too high",
            "tyre's part counted as m, moves with the contact",
            "K1 of a loop, each branch",
            "K1 too high",
            "K1 too low",
        ),
    )
    short = {
        "unweighed mass between cell and contact": "mass at the cell",
        "tyre's part moves with m, not counted": "tyre's mass, uncounted",
        "tyre's part counted as m, moves with the contact": "tyre's mass, counted as m",
        "K1 of a loop, each branch": "K1 of a loop",
    }
    panels = []
    for names in shown:
        curves = [line(pt.FREQUENCY, scale * pt.example()[which], "true", 6)]
        for at, name in enumerate(names):
            fault = named[name]
            label = f"{short.get(name, name)}, {fault.size:g} {fault.unit}".replace(" °", "°")
            curves.append(line(pt.FREQUENCY, scale * pt.example(fault)[which], label, at, 1))
        panels.append(Panel(_HZ, axis, tuple(curves)))
    return FigureData(tuple(panels), columns=1, panel_height=2.7, shared=False)


def twoport() -> list[TwoPort]:
    """The four poles of a tyre with a belt of 7 kg, as docs/twoport.md measures them."""
    f = np.arange(10.0, 101.0, 5.0)
    mass, rigid = np.repeat([6.0, 20.0, 0.0, 12.0], f.size), np.repeat([True, True, False, False], f.size)
    springs = np.tile(290e3 * (f / 10) ** 0.05 * (1 + 0.08j), 4)
    tests = Conditions(np.tile(f, 4), stiffness=springs, added_mass=mass, calibration=rigid, belt_mass=7.0)
    laboratory = Laboratory(noise=5e-4, std_gain=(0.05, 0.05, 0.05), std_phase=(0.05, 0.05, 0.05))
    phasors = simulate_phasors(laboratory, tests, np.random.default_rng(1982)).phasors
    measured = all_poles(phasors, Setups(rigid, mass, 1e-4 * mass, np.tile(np.arange(f.size), 4)))
    equal, chance = reciprocal(measured)
    return [TwoPort(Test("D1", 2), "car", measured, equal, chance, fit_specimen(measured))]


#: Each figure: the name of its file, its title, and the function that makes it.
FIGURES: dict[str, tuple[str, Callable[[], FigureData | list[TwoPort]]]] = {
    "mobility": ("Mobility of tyre and rig in series", mobility),
    "masses": ("Uncertainty of K* with one and with two masses", masses),
    "curvature": ("K2 and C are curved in K1", curvature),
    "ramp": ("Share of an arm in K1", ramp),
    "relaxation": ("Models of relaxation", relaxation),
    "prony": ("Relaxation times per decade", prony),
    "twoport": ("Four poles of a tyre with a belt", twoport),
    "leakage": ("Records of any length", leakage),
    "faults-in-c": ("C by the paper's route, with one fault each", faults_in_c),
    "faults-in-k2": ("K2 by the paper's route, with one fault each", faults_in_k2),
}


def svg(name: str, form: str = "svg") -> bytes:
    """The file of a figure."""
    title, make = FIGURES[name]
    style, made = Style(size=Size(width=6.0)), make()
    with drawing(style, name):
        figure = two_port_figure(made, style) if isinstance(made, list) else figure_of(made, style)
        return figure_bytes(figure, name, title, form, style)


def main(names: list[str]) -> None:
    """Write the named figures and tables, or all."""
    MADE.mkdir(exist_ok=True)
    for name in FIGURES:
        if not names or name in names:
            (MADE / f"{name}.svg").write_bytes(svg(name))
    for name in TABLES:
        if not names or name in names:
            page, text = written(name)
            page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
