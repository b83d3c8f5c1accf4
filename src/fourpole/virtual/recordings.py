"""Recordings of virtual tests: the columns that the sensors of both rigs record; the truth, and what is stated of it.

The static rig has slow load cycles with rate-independent hysteresis; the first cycles condition the rubber.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, inf
from typing import Any

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.virtual.bench import Bench
from fourpole.virtual.cam import Cam
from fourpole.virtual.dynamic_rig import run, run_block
from fourpole.virtual.phasor_rig import CHANNELS, FAULTS
from fourpole.virtual.plan import Planned
from fourpole.virtual.sensors import Sensor
from fourpole.virtual.tyres import Tyre

STD_GAIN, STD_PHASE = 2e-4, float(np.deg2rad(0.01))
#: Stated values of the usual rig with their standard uncertainties [kg], [N/m], [N s/m].
_PLAIN_RIG = {"moving_mass": (15.0, 0.01), "preload_stiffness": (12440.0, 20.0), "preload_damping": (15.0, 0.5)}
FURTHER = ("tyre_mass", "frame_stiffness", "preload_loss_factor", "input_mass")
#: Channels of the static rig, which have a gain only.
_STATIC = ("F", "x")
_ERRORS = (*FAULTS, *(f"gain {channel}" for channel in _STATIC))
#: Relative standard uncertainty of a further part that is declared.
_FURTHER_STD = 0.02


@dataclass(frozen=True)
class Statement:
    """The content of campaign.toml about the rig and the accuracy of F1, V1 and V2.

    Parameters
    ----------
    rig : mapping of name to (value, std) [SI]
        Stated values of the rig with their standard uncertainties.
    std_gain, std_phase : float [1], [rad]
        Standard uncertainties of the gain and of the phase of each channel.
    clean : bool
        Whether all values are stated as exact.
    """

    rig: Mapping[str, tuple[float, float]]
    std_gain: float = STD_GAIN
    std_phase: float = STD_PHASE
    clean: bool = False


@dataclass(frozen=True)
class Truth:
    """True rig, and true errors of gain [1] and phase [rad] of each channel."""

    bench: Bench
    gain_errors: Mapping[str, float]
    phase_errors: Mapping[str, float]

    def bench_of(self, test: Planned) -> Bench:
        """The rig with the added mass of a test."""
        return replace(self.bench, mass=self.bench.mass + test.added_mass)


def state(
    *,
    clean: bool = False,
    sensors: tuple[float, float] = (STD_GAIN, STD_PHASE),
    rig_std: Mapping[str, float] | None = None,
    declared: Mapping[str, float] | None = None,
) -> Statement:
    """The statement of a campaign; see `simulate_campaign` for the arguments.

    Raises
    ------
    ValueError
        If a name is unknown or an uncertainty negative.

    Examples
    --------
    >>> state(declared={"tyre_mass": 0.8}).rig["tyre_mass"]
    (0.8, 0.016)
    """
    rig_std, declared = rig_std or {}, declared or {}
    _known("rig_std", rig_std, _PLAIN_RIG)
    _known("declared", declared, FURTHER)
    if min(*sensors, *rig_std.values()) < 0.0:
        raise ValueError("the uncertainties in sensors and rig_std must be zero or positive")
    if not all(0.0 < value < inf for value in declared.values()):
        raise ValueError("declared values must be positive and finite; leave out parts that the rig does not have")
    rig = {name: (value, rig_std.get(name, std)) for name, (value, std) in _PLAIN_RIG.items()}
    rig |= {name: (declared[name], _FURTHER_STD * declared[name]) for name in FURTHER if name in declared}
    return Statement(rig, *sensors, clean=clean)


def _known(where: str, given: Mapping[str, float], known: Sequence[str] | Mapping[str, object]) -> None:
    """Raise ValueError for a name that is not known."""
    for name in given:
        if name not in known:
            raise ValueError(f"{where} has {name!r}; it may have {', '.join(known)}")


def draw_truth(
    statement: Statement,
    rng: np.random.Generator,
    *,
    rig_error: Mapping[str, float] | None = None,
    undeclared: Mapping[str, float] | None = None,
) -> Truth:
    """True values drawn about the statement, within two standard uncertainties.

    `rng` gives the same numbers for every statement, so that campaigns which differ in one value have equal errors.

    Raises
    ------
    ValueError
        If a name is unknown, or an undeclared part is also stated.
    """
    rig_error, undeclared = rig_error or {}, undeclared or {}
    _known("rig_error", rig_error, statement.rig)
    unstated = [name for name in FURTHER if name not in statement.rig]
    _known("undeclared", undeclared, (*unstated, "leaf_friction", *_ERRORS))

    def near(stated: float, std: float) -> float:
        return stated if statement.clean else stated + std * float(np.clip(rng.standard_normal(), -2.0, 2.0))

    def of_rig(names: Sequence[str]) -> dict[str, float]:
        drawn = {name: near(*statement.rig.get(name, (0.0, 0.0))) for name in names}
        misstated = {name: statement.rig[name][0] * (1.0 + rig_error[name]) for name in names if name in rig_error}
        return {name: value for name, value in (drawn | misstated).items() if name in statement.rig}

    rig = of_rig(tuple(_PLAIN_RIG))
    gains = {one: undeclared.get(f"gain {one}", near(0.0, statement.std_gain)) for one in CHANNELS}
    gains |= {one: undeclared.get(f"gain {one}", near(0.0, STD_GAIN)) for one in _STATIC}
    phases = {one: undeclared.get(f"phase {one}", near(0.0, statement.std_phase)) for one in CHANNELS}
    rig["mass"] = rig.pop("moving_mass")
    rig |= of_rig(FURTHER)
    rig |= {name: value for name, value in undeclared.items() if name not in _ERRORS}
    bench = Bench(**rig)  # type: ignore[arg-type] # all of them are numbers
    bench.check()
    return Truth(bench, gains, phases)


#: Share of the tyre's conditioning effect in the first and in the second cycle; it is 0 in later cycles.
_CONDITIONING_LEFT = (1.0, 0.15)


@dataclass(frozen=True, eq=False)
class StaticCycles(ByValue):
    """Load cycles of a static test, without sensors.

    Parameters
    ----------
    time : (n,) float array [s]
        Time from the start of the first cycle.
    deflection, load : (n,) float arrays [m], [N]
        Deflection and load, positive in compression; both are 0 between cycles.
    """

    time: FloatArray
    deflection: FloatArray
    load: FloatArray


def load_cycles(
    tyre: Tyre,
    pressure: float,
    *,
    peak_load: float = 3500.0,
    cycles: int = 4,
    period: float = 20.0,
    sample_rate: float = 50.0,
) -> StaticCycles:
    r"""Load a tyre slowly from zero deflection to `peak_load` and back, `cycles` times.

    The deflection is :math:`x = x_p\,(1 - \cos 2\pi t/T)/2`. With :math:`u = x/x_p` the load of cycle n is

    .. math:: F = F_{mean}(x) \pm h\,F_p\,4u(1-u) + \mu_n\,F_{mean}(x)\,(1-u^2)

    with + for loading and - for unloading, so that the mean of the branches at equal deflection is the tyre's law. The
    last term is present only for loading, and only in the first two cycles: rubber is stiffer in its first deflections
    (Mullins effect). None of these terms depends on the rate.

    Parameters
    ----------
    tyre : VirtualTyre or ModelTyre
    pressure : float [Pa]
    peak_load : float [N]
        Mean load at the largest deflection; > 0.
    cycles : int
        Number of complete cycles; >= 1.
    period, sample_rate : float [s], [Hz]
        Duration of one cycle; samples per second; both > 0.

    Returns
    -------
    StaticCycles

    Raises
    ------
    ValueError
        If an argument is out of its range.

    Examples
    --------
    >>> from fourpole.virtual.tyres import RADIAL_PLY
    >>> slow = load_cycles(RADIAL_PLY, 170e3)
    >>> slow.time.size, float(slow.load.max().round(0)) >= 3500.0
    (4001, True)
    """
    if not (peak_load > 0.0 and period > 0.0 and sample_rate > 0.0 and cycles >= 1):
        raise ValueError("peak_load, period and sample_rate must be > 0 and cycles >= 1")
    time = np.arange(round(cycles * period * sample_rate) + 1) / sample_rate
    phase = time / period
    peak = float(tyre.deflection(peak_load, pressure))
    u = np.sin(np.pi * phase) ** 2
    cycle = np.floor(phase).astype(int)
    loading = phase - cycle < 0.5
    share = np.array((*_CONDITIONING_LEFT, 0.0))[np.minimum(cycle, len(_CONDITIONING_LEFT))]
    mean = tyre.load(peak * u, pressure)
    gap = tyre.hysteresis * peak_load * 4.0 * u * (1.0 - u)
    conditioning = tyre.conditioning * share * mean * (1.0 - u * u)
    load = mean + np.where(loading, gap + conditioning, -gap)
    return StaticCycles(time=time, deflection=peak * u, load=load)


#: Gain of F1 [1] and delay of V1 [s], as declared in campaign.toml.
F1_GAIN, V1_DELAY = 1.02, 0.2e-3
#: Sampling rate of dynamic tests [Hz].
_SAMPLE_RATE = 1000.0
#: Length of dynamic tests [s]; it is no multiple of the period of the usual frequencies or of the mains.
_DURATION = 4.096
#: Sampling rate of static tests [Hz].
_STATIC_RATE = 50.0
#: Largest relative departure of the cam's frequency from the stated one.
_SPEED_ERROR = 3e-3
#: A sensor of a laboratory, whose converter has 16 bits.
_WITH_BITS = partial(Sensor, bits=16)


def cam_frequency(test: Planned, rng: np.random.Generator, clean: bool) -> float:
    """True frequency of the cam [Hz]; not-a-number for a static test."""
    if clean or test.kind == "static":
        return test.frequency
    return test.frequency * (1.0 + rng.uniform(-_SPEED_ERROR, _SPEED_ERROR))


def record_static(test: Planned, truth: Truth, rng: np.random.Generator, clean: bool) -> list[tuple[str, FloatArray]]:
    """Columns of a static test: time [s], deflection [mm] and load [N]."""
    cycles = load_cycles(test.mounted, test.pressure, sample_rate=_STATIC_RATE)
    sensors, gain = {"x": Sensor(scale=1e3), "F": Sensor()}, truth.gain_errors
    if not clean:
        # The deflection transducer has an arbitrary zero; the force cell is zeroed before the test.
        zero, offset, phase = rng.uniform(2.0, 9.0), rng.uniform(-0.5, 0.5), rng.uniform(0.0, 2.0 * np.pi)
        drift: dict[str, Any] = {"drift": 0.3, "drift_period": 150.0, "drift_phase": phase}
        sensors = {
            "x": _WITH_BITS(scale=1e3, gain_error=gain["x"], offset=zero, noise=0.004, full_scale=50.0),
            "F": _WITH_BITS(gain_error=gain["F"], offset=offset, noise=0.8, full_scale=5000.0, **drift),
        }
    signals = {"x": cycles.deflection, "F": cycles.load}
    return _recorded(sensors, signals, (0.0, 1.0 / _STATIC_RATE), cycles.time, rng)


def record_dynamic(
    test: Planned, frequency: float, truth: Truth, rng: np.random.Generator, clean: bool
) -> list[tuple[str, FloatArray]]:
    """Columns t, F1, V1 and V2 of a dynamic test or a calibration at the true `frequency` of the cam [Hz]."""
    cam = Cam(frequency, test.eccentricity) if clean else _worn_cam(frequency, test.eccentricity, rng)
    late = {channel: -phase / (2.0 * np.pi * frequency) for channel, phase in truth.phase_errors.items()}
    oversampling = 10 if clean else 5
    latest = max(abs(delay) for delay in late.values()) + V1_DELAY
    guard = max(8, ceil(latest * _SAMPLE_RATE * oversampling) + 4)
    marched = partial(run_block, cam) if test.kind == "calibration" else partial(run, cam, test.element(frequency))
    motion = marched(
        truth.bench_of(test), duration=_DURATION, sample_rate=_SAMPLE_RATE, oversampling=oversampling, guard=guard
    )
    gain = truth.gain_errors
    sensors = {channel: Sensor(gain_error=gain[channel], delay=late[channel]) for channel in late}
    if not clean:
        sensors = _laboratory_sensors(gain, late, rng)
    times = np.arange(round(_DURATION * _SAMPLE_RATE)) / _SAMPLE_RATE
    signals = {"F1": motion.force, "V1": motion.v1, "V2": motion.v2}
    base = (float(motion.time[0]), float((motion.time[-1] - motion.time[0]) / (motion.time.size - 1)))
    return _recorded(sensors, signals, base, times, rng)


def _recorded(
    sensors: Mapping[str, Sensor],
    signals: Mapping[str, FloatArray],
    base: tuple[float, float],
    times: FloatArray,
    rng: np.random.Generator,
) -> list[tuple[str, FloatArray]]:
    """The time and the record of each channel; `base` is start and step [s] of the `signals`."""
    start, step = base
    return [("t", times)] + [
        (channel, sensors[channel].record(signal, start=start, step=step, times=times, rng=rng))
        for channel, signal in signals.items()
    ]


def _worn_cam(frequency: float, eccentricity: float, rng: np.random.Generator) -> Cam:
    """A cam with fixed profile errors and random phases of ripple and wander."""
    angle = rng.uniform(0.0, 2.0 * np.pi, 3)
    return Cam(
        frequency,
        eccentricity,
        profile=((2, 0.006, 0.7), (3, 0.002, 2.1)),
        ripple=((1, 1.5e-3, angle[0]), (2, 1.0e-3, angle[1])),
        wander=3.0e-5,
        wander_period=_DURATION,
        wander_phase=angle[2],
    )


#: Sensors of a dynamic test in a laboratory, in the units of the file [kN], [m/s], [m/s]; their offset is the largest.
_SENSORS = {
    "F1": _WITH_BITS(
        scale=1e-3 / F1_GAIN, offset=4e-3, drift=8e-4, drift_period=17.0, hum=6e-4, noise=2e-4, pink=1e-4, full_scale=1
    ),
    "V1": _WITH_BITS(
        delay=V1_DELAY, offset=1e-3, drift=1e-4, drift_period=13.0, hum=2e-4, noise=1e-4, pink=0.5e-4, full_scale=0.25
    ),
    "V2": _WITH_BITS(
        invert=True, offset=2e-3, drift=2e-4, drift_period=19.0, hum=2e-4, noise=1.5e-4, pink=0.7e-4, full_scale=0.5
    ),
}


def _laboratory_sensors(
    gain: Mapping[str, float], late: Mapping[str, float], rng: np.random.Generator
) -> dict[str, Sensor]:
    """The sensors of a test with their errors of gain [1], delays [s], offsets and phases of drift and hum."""
    phase = rng.uniform(0.0, 2.0 * np.pi, 6)
    sign = rng.uniform(-1.0, 1.0, 3)
    return {
        channel: replace(
            sensor,
            gain_error=gain[channel],
            delay=sensor.delay + late[channel],
            offset=sensor.offset * sign[at],
            drift_phase=phase[2 * at],
            hum_phase=phase[2 * at + 1],
        )
        for at, (channel, sensor) in enumerate(_SENSORS.items())
    }
