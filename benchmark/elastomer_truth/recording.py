"""Recordings of a laboratory: mechanics, sensors and logger; and the complex amplitudes without noise."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from elastomer_truth.laboratory import Laboratory, Test
from elastomer_truth.mechanics import GRID, Array, ComplexArray, steady_cycle, steady_period
from elastomer_truth.slipping import steady_slipping

#: Samples of one steady period of a sine; a network with friction has its own number.
_SAMPLES = 64
_HARMONICS = 40
_PLACES = {"V1": 0, "F1": 1, "V2": 2}


class Motion:
    """One steady period of a test: its length [s] and complex amplitudes (N, 4) of x1, F1, x2 and the force behind."""

    def __init__(self, outputs: Array, period: float) -> None:
        self.count, self.period = len(outputs), period
        # x(t) = Re sum c_k e^{j k w t}, k = 0 ... N/2
        self.amplitudes = np.fft.rfft(outputs, axis=0) * 2 / self.count
        self.amplitudes[0] /= 2
        self.frequency = np.arange(len(self.amplitudes)) / period


def motions(lab: Laboratory) -> dict[str, Motion]:
    """The steady motion of each dynamic test, by its name."""
    found: dict[str, Motion] = {}
    slipping, banded = [], []
    for test in lab.tests:
        if test.kind == "static":
            continue
        space = lab.network(test).state_space()
        if test.kind in ("random", "sweep"):
            banded.append((test, space))
        elif space.slips:
            slipping.append((test, space))
        elif test.kind == "multisine":
            frequencies, amplitudes = multisine(lab, test)
            found[test.name] = Motion(steady_cycle(space, frequencies, amplitudes, 1.0, GRID), 1.0)
        else:
            period = 1 / test.frequency
            outputs = steady_cycle(space, np.array([test.frequency]), np.array([test.amplitude + 0j]), period, _SAMPLES)
            found[test.name] = Motion(outputs, period)
    if slipping:
        tests, spaces = zip(*slipping, strict=True)
        frequency, amplitude = (
            np.array([getattr(test, name) for test in tests]) for name in ("frequency", "amplitude")
        )
        outputs = steady_slipping(spaces, frequency, amplitude)
        found |= {test.name: Motion(out, 1 / test.frequency) for test, out in zip(tests, outputs, strict=True)}
    if banded:
        tests, spaces = zip(*banded, strict=True)
        commands = np.array([command(lab, test) for test in tests])
        corner = 2.0 * max(test.band[1] for test in tests)
        outputs = steady_period(spaces, commands, corner)
        found |= {t.name: Motion(out, t.duration + 2.0) for t, out in zip(tests, outputs, strict=True)}
    return found


def multisine(lab: Laboratory, test: Test) -> tuple[Array, ComplexArray]:
    """Frequencies (L,) [Hz] and amplitudes (L,) of x1 [m] of a multisine with a period of 1 s."""
    low, high = test.band or (5.0, 50.0)
    frequencies = np.arange(np.ceil(low), np.floor(high) + 1)
    rng = np.random.default_rng([lab.seed, _number(lab, test), 3])
    phases = rng.uniform(0, 2 * np.pi, len(frequencies))
    size = test.amplitude / 3 * np.sqrt(2 / len(frequencies)) * (low / frequencies) ** 0.5
    return frequencies, size * np.exp(1j * phases)


def command(lab: Laboratory, test: Test) -> Array:
    """The command of the actuator over one period on the grid (N,) [m], 2 s longer than the recording."""
    low, high = test.band or (5.0, 50.0)
    count = round((test.duration + 2.0) * GRID)
    if test.kind == "sweep":
        time = np.arange(count) / GRID
        share = np.clip((time - 0.5) / test.duration, 0, 1)
        rate = np.log(high / low)
        phase = 2 * np.pi * low * test.duration / rate * (np.exp(rate * share) - 1)
        rise = np.clip(np.minimum(time, time[-1] - time) / 0.5, 0, 1)
        size = test.amplitude * (low / (low * np.exp(rate * share))) ** 0.5
        return size * np.sin(phase) * np.sin(np.pi / 2 * rise) ** 2
    rng = np.random.default_rng([lab.seed, _number(lab, test), 4])
    frequency = np.fft.rfftfreq(count, 1 / GRID)
    level = np.where(
        (frequency >= 0.8 * low) & (frequency <= 1.15 * high), (low / np.maximum(frequency, low)) ** 0.5, 0
    )
    spectrum = level * (rng.standard_normal(frequency.size) + 1j * rng.standard_normal(frequency.size))
    signal = np.fft.irfft(spectrum, count)
    return signal * (test.amplitude / 3 / signal.std())


def recorded(lab: Laboratory, test: Test, motion: Motion) -> dict[str, ComplexArray]:
    """Complex amplitudes (N,) of each channel as recorded [SI], by its role; without noise, clipping and words."""
    frequency = motion.frequency
    raw = {role: motion.amplitudes[:, place] for role, place in _PLACES.items()}
    if lab.rig.endswith("ground"):
        raw["F1"] = motion.amplitudes[:, 3]
    found = {}
    for role, sensor in lab.sensors.items():
        if role not in raw:
            continue
        own = raw[role]
        own = own + float(sensor.flaws.get("fixture", 0.0)) * raw["F1"]  # type: ignore[arg-type]
        own = own + float(sensor.flaws.get("crosstalk", 0.0)) * raw["V1"]  # type: ignore[arg-type]
        found[role] = own * lab.response(test, role, frequency)
    return found


def amplitudes(lab: Laboratory, test: Test, frequency: Array) -> ComplexArray:
    """F1, V1 and V2 (N, 3) as recorded over x1 [m] at frequencies (N,) [Hz], from the transfer matrix; V2 may be 0."""
    transfer = lab.network(test).state_space().transfer(2 * np.pi * frequency)
    motion = Motion.__new__(Motion)
    motion.frequency, motion.amplitudes = np.asarray(frequency, dtype=float), transfer
    found = recorded(lab, test, motion)
    return np.stack([found.get(role, np.zeros(len(transfer), complex)) for role in ("F1", "V1", "V2")], axis=1)


def samples(lab: Laboratory, test: Test, motion: Motion | None) -> dict[str, Array]:
    """The columns of a recording (N,), in the units that its statement says, by their heads."""
    if test.kind == "static":
        return static_samples(lab, test)
    assert motion is not None
    rng = np.random.default_rng([lab.seed, _number(lab, test), 1])
    found = {}
    for role, amplitude in recorded(lab, test, motion).items():
        sensor = lab.sensors[role]
        if test.kind == "sine":
            time = np.arange(round(test.duration * lab.rate)) / lab.rate
            used = np.arange(1, min(_HARMONICS, len(amplitude)))
            used = used[np.abs(amplitude[used]) > 1e-12 * np.abs(amplitude[1])]
            turn = 2 * np.pi * test.frequency * time + test.phase
            values = sum(((amplitude[k] * np.exp(1j * k * turn)).real for k in used), np.zeros(time.size))
        else:
            spectrum = amplitude * motion.count / 2
            spectrum[0] = 0
            values = np.fft.irfft(spectrum, motion.count)
            values = np.tile(values, int(np.ceil(test.duration / motion.period)))
            values = values[: round(test.duration * GRID) : GRID // lab.rate]
        found[sensor.column] = _logged(lab, role, values, rng) * sensor.scale
    return found


def _logged(lab: Laboratory, role: str, values: Array, rng: np.random.Generator) -> Array:
    """Values of a channel [SI] after its amplifier and logger."""
    sensor, flaws = lab.sensors[role], lab.sensors[role].flaws
    peak = sensor.full_scale / 3.0
    time = np.arange(values.size) / lab.rate
    if "limit" in flaws:
        limit = float(flaws["limit"]) * np.abs(values).max()  # type: ignore[arg-type]
        values = limit * np.tanh(values / limit)
    if "hum" in flaws:
        values = values + float(flaws["hum"]) * peak * np.sin(2 * np.pi * 50.02 * time + rng.uniform(0, 6))  # type: ignore[arg-type]
    if "tone" in flaws:
        values = values + float(flaws["tone"]) * peak * np.sin(2 * np.pi * (3 * lab.rate + 17.31) * time)  # type: ignore[arg-type]
    size = sensor.noise * lab.noise + float(flaws.get("noise", 0.0)) * peak  # type: ignore[arg-type]
    values = values + size * rng.standard_normal(values.size)
    if "dropouts" in flaws:
        values = _dropped(values, float(flaws["dropouts"]), rng)  # type: ignore[arg-type]
    if lab.bits is not None:
        step = 2 * sensor.full_scale / 2**lab.bits
        values = np.clip(np.round(values / step) * step, -sensor.full_scale, sensor.full_scale)
    return values


def _dropped(values: Array, share: float, rng: np.random.Generator) -> Array:
    """Values of which a share stands still, in stretches of 5 to 40 samples."""
    values, left = values.copy(), share * values.size
    while left > 0:
        length, at = int(rng.integers(5, 40)), int(rng.integers(values.size - 40))
        values[at : at + length] = values[at]
        left -= length
    return values


def static_samples(lab: Laboratory, test: Test) -> dict[str, Array]:
    """Load and deflection of three triangular cycles up to 1.4 times the preload, at 50 Hz."""
    rng = np.random.default_rng([lab.seed, _number(lab, test), 2])
    rate = 50.0
    deflection, load = static_curve(lab, test, rate)
    found = {}
    for role, true in (("load", load), ("deflection", deflection)):
        sensor = lab.sensors[role]
        own = true + float(sensor.flaws.get("frame", 0.0)) * load  # type: ignore[arg-type]
        share = own / sensor.full_scale
        bend = 4 * sensor.linearity.true * share * (1 - np.abs(share)) * sensor.full_scale
        noise = sensor.noise * lab.noise * rng.standard_normal(own.size)
        found[sensor.column] = (sensor.gain.true * own + bend + noise) * sensor.scale
    return found


def static_curve(lab: Laboratory, test: Test, rate: float) -> tuple[Array, Array]:
    """Deflection [m] and load [N] of a static test (N,), exact at the samples."""
    specimen = lab.specimens[test.specimen]
    time = np.arange(round(test.duration * rate) + 1) / rate
    k, a = specimen.stiffness, specimen.bend
    load = 1.4 * test.preload
    most = load / k if a == 0 else (np.sqrt(k * k + 4 * a * load) - k) / (2 * a)
    x = most * (1 - np.abs(1 - np.mod(time / (test.duration / 3), 1.0) * 2))
    spring = k * x + a * x * x
    force = spring.copy()
    for share, relaxation in specimen.arms:
        # d' = (F - d)/tau with F linear between the samples
        r = 1 / (rate * relaxation)
        decay = np.exp(-r)
        first, second = (1 - decay) / r - decay, 1 - (1 - decay) / r
        held = lfilter([second, first], [1, -decay], spring)
        force = force + share * (spring - held)
    for share, largest in specimen.slip:
        tangent = specimen.tangent(test.preload)
        z, deflections = 0.0, np.zeros(x.size)
        for at, step in enumerate(np.diff(x), 1):
            sign = np.sign(step)
            z = sign * largest + (z - sign * largest) * np.exp(-abs(step) / largest)
            deflections[at] = z
        force = force + share * tangent * deflections
    return x, force


def _number(lab: Laboratory, test: Test) -> int:
    return [one.name for one in lab.tests].index(test.name)
