"""The true values of each test: the rows of truth.csv."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fourpole import quantities as q
from fourpole.models.interface import StateSpace
from fourpole.virtual.bench import Bench, Zener, amplification
from fourpole.virtual.cam import Cam
from fourpole.virtual.dynamic_rig import run
from fourpole.virtual.phasor_rig import CHANNELS, Conditions, Laboratory, simulate_phasors
from fourpole.virtual.runs import Run, cubic_of, tyre_of
from fourpole.virtual.truth import FURTHER, Truth
from fourpole.virtual.tyres import VirtualTyre

#: Length of the noise-free record from which the first harmonics of a tyre that is not linear are taken [s].
_DESCRIBED = 1.0

TRUTH_COLUMNS = (
    "test",
    "tyre",
    q.PRESSURE.head,
    q.PRELOAD.head,
    q.ADDED_MASS.head,
    q.FREQUENCY.head,
    q.K1.head,
    q.K2.head,
    q.C.head,
    q.STORAGE.head,
    q.LOSS.head,
    q.TR.head,
    "moving mass [kg]",
    "preload stiffness [N/m]",
    "preload damping [N s/m]",
)
#: Further columns for a campaign with other parts of the rig or other sensors than the usual ones.
MORE_COLUMNS = (
    "tyre mass [kg]",
    "frame stiffness [N/m]",
    "preload loss factor [1]",
    "input mass [kg]",
    "leaf friction [N]",
    *(f"gain error {channel} [1]" for channel in CHANNELS),
    *(f"phase error {channel} [rad]" for channel in CHANNELS),
)


def truth_rows(
    this: Run, truth: Truth, *, preloads: Sequence[float], frequency: float, more: bool
) -> list[tuple[object, ...]]:
    """Rows of truth.csv: one per test, or one per preload for a static test; with `MORE_COLUMNS` if `more`."""
    bench = this.bench
    shared: tuple[object, ...] = (bench.mass, bench.preload_stiffness, bench.preload_damping)
    if more:
        parts = (bench.tyre_mass, bench.frame_stiffness, bench.preload_loss_factor, bench.input_mass)
        errors = (errors[channel] for errors in (truth.gain_errors, truth.phase_errors) for channel in CHANNELS)
        shared = (*shared, *parts, bench.leaf_friction, *errors)
    row = this.row
    if row.kind == "static":
        tyre, pressure = this.as_labelled().real.mounted, row.pressure
        rows = ((load, None, None, float(tyre.static_stiffness(pressure, load)), *(None,) * 5) for load in preloads)
        return [(row.name, tyre.name, pressure, *values, *shared) for values in rows]
    if row.kind == "calibration":
        return [(row.name, None, None, None, row.added_mass, frequency, *(None,) * 5, 1.0, *shared)]
    return [(*_dynamic_row(this, frequency), *shared)]


def _dynamic_row(this: Run, frequency: float) -> tuple[object, ...]:
    """The row of a dynamic test up to TR, in the order of `TRUTH_COLUMNS`."""
    row, this = this.row, this.as_labelled()
    bench = this.loaded_bench
    tyre = tyre_of(this, frequency)
    stated = (row.name, row.mounted.name, row.pressure, row.preload, row.added_mass, frequency)
    k1 = float(this.real.mounted.static_stiffness(this.real.pressure, this.real.preload))
    if this.specimen.cubic:
        stiffness, ratio = _described(tyre, bench, frequency, cubic_of(this))
        return (*stated, k1, *_arm(stiffness, k1, frequency), stiffness.real, stiffness.imag, ratio)
    arm: tuple[float | None, float | None] = (None, None)
    if isinstance(tyre, Zener) and tyre.k1 == k1:
        arm = (tyre.k2, tyre.c)
    elif isinstance(this.real.mounted, VirtualTyre):
        arm = _arm(complex(*_two_parts(tyre, frequency)), k1, frequency)
    return (*stated, k1, *arm, *_two_parts(tyre, frequency), _transmissibility(tyre, bench, frequency))


def _arm(stiffness: complex, k1: float, frequency: float) -> tuple[float, float]:
    """K2 [N/m] and C [N s/m] whose deflections under one force add up to that of K* - K1."""
    flexibility = 1.0 / (stiffness - k1)
    return 1.0 / flexibility.real, -1.0 / (2.0 * np.pi * frequency * flexibility.imag)


def _described(tyre: Zener | StateSpace, bench: Bench, frequency: float, cubic: float) -> tuple[complex, float]:
    """K* [N/m] and |V2/V1| [1] of the first harmonics of a tyre that is not linear."""
    motion = run(Cam(frequency), tyre, bench, duration=_DESCRIBED, cubic=cubic)
    turn = np.exp(2j * np.pi * frequency * motion.time)
    columns = [part for order in range(1, 8) for part in (np.real(turn**order), -np.imag(turn**order))]
    signals = np.stack([motion.force, motion.deflection, motion.x1], axis=1)
    found, *_ = np.linalg.lstsq(np.stack(columns, axis=1), signals, rcond=None)
    force, deflection, x1 = found[0] + 1j * found[1]
    return complex(force / deflection), float(abs((x1 - deflection) / x1))


def _two_parts(tyre: Zener | StateSpace, frequency: float) -> tuple[float, float]:
    """Storage and loss stiffness of a tyre [N/m]."""
    if isinstance(tyre, StateSpace):
        stiffness = complex(tyre.stiffness(2.0 * np.pi * frequency))
        return stiffness.real, stiffness.imag
    x = 2.0 * np.pi * frequency * tyre.c / tyre.k2
    return tyre.k1 + tyre.k2 * x * x / (1.0 + x * x), tyre.k2 * x / (1.0 + x * x)


def _transmissibility(tyre: Zener | StateSpace, bench: Bench, frequency: float) -> float:
    """|V2/V1| [1]; with friction, that of its first harmonic."""
    if not bench.leaf_friction:
        return amplification(tyre, bench.damped_at(frequency), frequency)
    names = (*FURTHER, "preload_stiffness", "preload_damping")
    laboratory = Laboratory(
        moving_mass=(bench.mass, 0.0), undeclared={name: getattr(bench, name) for name in (*names, "leaf_friction")}
    )
    tests = Conditions(frequency, stiffness=complex(*_two_parts(tyre, frequency)))
    return float(simulate_phasors(laboratory, tests, np.random.default_rng(0)).transmissibility[0])
