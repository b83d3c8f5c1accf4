"""Recordings of virtual tests: the columns that the sensors of both rigs record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from math import ceil
from typing import Any

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.virtual.cam import Cam
from fourpole.virtual.dynamic_rig import run, run_block
from fourpole.virtual.plan import Planned
from fourpole.virtual.sensors import Sensor
from fourpole.virtual.static_rig import load_cycles
from fourpole.virtual.truth import Truth

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
