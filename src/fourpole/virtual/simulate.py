"""A whole campaign in software: folder, recordings, and the truth that an analysis should find."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import nan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import FileError
from fourpole.virtual.dynamic_rig import Bench, Cam, Motion, Zener, run, state_matrices
from fourpole.virtual.sensors import Sensor
from fourpole.virtual.static_rig import load_cycles
from fourpole.virtual.tyres import CROSS_PLY, RADIAL_PLY, VirtualTyre

__all__ = ["SimulatedCampaign", "simulate_campaign"]

FloatArray = NDArray[np.float64]

PRESSURES = (100e3, 135e3, 170e3, 205e3, 240e3)
PRELOADS = (1000.0, 2000.0)
FREQUENCIES = (10.0, 12.0, 14.0, 16.0, 17.0, 18.0, 19.0, 20.0, 22.0, 24.0)

SAMPLE_RATE = 1000.0  # Hz, dynamic tests
DURATION = 4.096  # s: no whole number of turns at the frequencies above, nor of mains cycles
STATIC_RATE = 50.0  # Hz

_MASS, _K3, _C3 = (15.0, 0.01), (12440.0, 20.0), (15.0, 0.5)  # kg, N/m, N s/m: as stated, and its std
_STD_GAIN, _STD_PHASE = 2e-4, np.deg2rad(0.01)
_SPEED_ERROR = 3e-3  # the cam runs this much faster or slower than the test sheet says, at most
_F1_GAIN, _V1_DELAY = 1.02, 0.2e-3  # declared in campaign.toml

_TRUTH_COLUMNS = (
    "test",
    "tyre",
    "pressure [Pa]",
    "preload [N]",
    "added mass [kg]",
    "frequency [Hz]",
    "K1 [N/m]",
    "K2 [N/m]",
    "C [N s/m]",
    "Re K* [N/m]",
    "Im K* [N/m]",
    "TR [1]",
    "moving mass [kg]",
    "preload stiffness [N/m]",
    "preload damping [N s/m]",
)

_RIG_TOML = """\
[rig]
moving_mass       = {{ value = 15.0, unit = "kg", {mass} }}
preload_stiffness = {{ value = 12.44, unit = "kN/m", {k3} }}
preload_damping   = {{ value = 15.0, unit = "N s/m", {c3} }}
"""

_ACCURACY = 'std_gain = "0.02 %", std_phase = "0.01 deg"'
_NOISY_CHANNELS = f"""\
[channels]
time       = {{ column = "t", unit = "s" }}
force_in   = {{ column = "F1", unit = "kN", gain = {_F1_GAIN}, range = "1 kN", {_ACCURACY} }}
motion_in  = {{ column = "V1", unit = "m/s", delay = "0.2 ms", range = "0.25 m/s", {_ACCURACY} }}
motion_out = {{ column = "V2", unit = "m/s", invert = true, range = "0.5 m/s", {_ACCURACY} }}
load       = {{ column = "F", unit = "N", range = "5 kN", std_gain = "0.02 %" }}
deflection = {{ column = "x", unit = "mm", range = "50 mm", std_gain = "0.02 %" }}
"""

_CLEAN_CHANNELS = """\
[channels]
time       = { column = "t", unit = "s" }
force_in   = { column = "F1", unit = "N", exact = true }
motion_in  = { column = "V1", unit = "m/s", exact = true }
motion_out = { column = "V2", unit = "m/s", exact = true }
load       = { column = "F", unit = "N", exact = true }
deflection = { column = "x", unit = "mm", exact = true }
"""


@dataclass(frozen=True)
class SimulatedCampaign:
    """What `simulate_campaign` wrote.

    Parameters
    ----------
    folder : Path
    tests : int
        Static and dynamic tests together.
    seed : int
    """

    folder: Path
    tests: int
    seed: int


@dataclass(frozen=True)
class _Test:
    """One row of tests.csv; a static test has no preload and no frequency."""

    name: str
    tyre: VirtualTyre
    pressure: float
    preload: float = nan
    frequency: float = nan
    added_mass: float = 0.0

    @property
    def static(self) -> bool:
        return self.name.startswith("S")


@dataclass(frozen=True)
class _Truth:
    """What the campaign's stated values only approximate: the rig, and the gain and phase of each channel."""

    bench: Bench
    gain_errors: dict[str, float]
    phase_errors: dict[str, float]


def simulate_campaign(
    folder: str | os.PathLike[str],
    *,
    seed: int = 1982,
    clean: bool = False,
    progress: Callable[[int, int], None] | None = None,
    tyres: Sequence[VirtualTyre] = (CROSS_PLY, RADIAL_PLY),
    pressures: Sequence[float] = PRESSURES,
    preloads: Sequence[float] = PRELOADS,
    frequencies: Sequence[float] = FREQUENCIES,
    added_masses: Sequence[float] = (0.0,),
) -> SimulatedCampaign:
    """Run both rigs on the virtual tyres and write a campaign folder, with the truth beside it.

    The folder gets campaign.toml, tests.csv, recordings/ and truth.csv. Each tyre has a static test at each
    pressure, and a dynamic one at each pressure, preload, added mass and frequency. Everything but the truth
    looks as a laboratory would leave it: the rig's values and the channels' gains and phases are off within
    what campaign.toml states, the cam's speed ripples and is not quite the stated one, and the channels have
    noise, drift, mains hum and a 16-bit converter.

    Parameters
    ----------
    folder : path
        Made if it does not exist; an earlier virtual campaign in it is replaced.
    seed : int
        The same seed gives the same files. A test's noise does not depend on which tests ran before it.
    clean : bool
        Perfect sensors, a perfect cam at the stated speed, the rig exactly as stated, all digits written.
    progress : callable (done, total)
        Called after each test.
    tyres, pressures, preloads, frequencies, added_masses : sequences of VirtualTyre, [Pa], [N], [Hz], [kg]
        The conditions. The preload holds with the added mass on. The laws of the built-in tyres are meant
        for 1.0 to 2.4 bar, 1000 to 2000 N and 10 to 24 Hz.

    Returns
    -------
    SimulatedCampaign

    Raises
    ------
    FileError
        If `folder` is a file, or holds something that is not a virtual campaign.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     made = simulate_campaign(place, pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 24.0])
    ...     made.tests, sorted(path.name for path in made.folder.iterdir())
    (6, ['campaign.toml', 'recordings', 'tests.csv', 'truth.csv'])
    """
    tests = _plan(tyres, pressures, preloads, frequencies, added_masses)
    truth = _draw_truth(np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,))), clean)
    target = _prepare(Path(folder), tests)
    rows: list[tuple[object, ...]] = []
    for done, test in enumerate(tests, start=1):
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1, *test.name.encode())))
        path = target / "recordings" / f"{test.name}.csv"
        if test.static:
            _write(_static_test(test, truth, rng, clean), path, None if clean else 4)
            rows += [_static_row(test, load, truth) for load in preloads]
        else:
            frequency = test.frequency * (1.0 if clean else 1.0 + rng.uniform(-_SPEED_ERROR, _SPEED_ERROR))
            _write(_dynamic_test(test, frequency, truth, rng, clean), path, None if clean else 6)
            rows.append(_dynamic_row(test, frequency, truth))
        if progress is not None:
            progress(done, len(tests))
    _finish(target, tests, rows, seed, clean)
    return SimulatedCampaign(folder=target, tests=len(tests), seed=seed)


def _plan(
    tyres: Sequence[VirtualTyre],
    pressures: Sequence[float],
    preloads: Sequence[float],
    frequencies: Sequence[float],
    added_masses: Sequence[float],
) -> list[_Test]:
    static = [(tyre, pressure) for tyre in tyres for pressure in pressures]
    dynamic = [
        (tyre, pressure, preload, frequency, added)
        for tyre, pressure in static
        for preload in preloads
        for added in added_masses
        for frequency in frequencies
    ]
    return [_Test(f"S{number}", *row) for number, row in enumerate(static, start=1)] + [
        _Test(f"D{number}", *row) for number, row in enumerate(dynamic, start=1)
    ]


def _prepare(folder: Path, tests: Sequence[_Test]) -> Path:
    """Make the folder ready, or refuse it: nothing that is not a virtual campaign is ever touched."""
    try:
        if folder.exists() and not folder.is_dir():
            raise FileError(
                f"{folder} is a file; name a new or empty folder for the virtual campaign, or delete the file"
            )
        if folder.is_dir() and any(folder.iterdir()) and not _is_virtual(folder):
            raise FileError(
                f"{folder} is not empty and holds no truth.csv of a virtual campaign, so it stays as it is; "
                "name a new or empty folder"
            )
        recordings = folder / "recordings"
        recordings.mkdir(parents=True, exist_ok=True)
        # from here on an interrupted run leaves a folder that says what it is, and nobody takes for complete
        (folder / "truth.csv").touch()
        (folder / "tests.csv").unlink(missing_ok=True)
        wanted = {f"{test.name}.csv" for test in tests}
        for path in recordings.iterdir():
            if re.fullmatch(r"\.?[SD]\d+\.csv(\.part)?", path.name) and path.name not in wanted:
                path.unlink()
    except FileError:
        raise
    except OSError as error:
        raise FileError(f"{folder} cannot be written: {error.strerror or error}; choose another folder") from error
    return folder


def _is_virtual(folder: Path) -> bool:
    """An earlier virtual campaign, finished or not."""
    truth = folder / "truth.csv"
    if not truth.is_file():
        return False
    with truth.open("rb") as file:
        beginning = file.read(64)
    return beginning == b"" or beginning.startswith(",".join(_TRUTH_COLUMNS[:3]).encode())


def _draw_truth(rng: np.random.Generator, clean: bool) -> _Truth:
    def near(stated: float, std: float) -> float:
        return stated if clean else stated + std * float(np.clip(rng.standard_normal(), -2.0, 2.0))

    bench = Bench(near(*_MASS), near(*_K3), near(*_C3))
    gains = {channel: near(0.0, _STD_GAIN) for channel in ("F1", "V1", "V2", "F", "x")}
    phases = {channel: near(0.0, _STD_PHASE) for channel in ("F1", "V1", "V2")}
    return _Truth(bench, gains, phases)


def _static_test(test: _Test, truth: _Truth, rng: np.random.Generator, clean: bool) -> list[tuple[str, FloatArray]]:
    cycles = load_cycles(test.tyre, test.pressure, sample_rate=STATIC_RATE)
    deflection, load = Sensor(scale=1e3), Sensor()
    if not clean:
        # the deflection transducer stands where it stands; the force cell was zeroed
        deflection = Sensor(
            scale=1e3,
            gain_error=truth.gain_errors["x"],
            offset=rng.uniform(2.0, 9.0),
            noise=0.004,
            full_scale=50.0,
            bits=16,
        )
        load = Sensor(
            gain_error=truth.gain_errors["F"],
            offset=rng.uniform(-0.5, 0.5),
            drift=0.3,
            drift_period=150.0,
            drift_phase=rng.uniform(0.0, 2.0 * np.pi),
            noise=0.8,
            full_scale=5000.0,
            bits=16,
        )
    step = 1.0 / STATIC_RATE
    return [
        ("t", cycles.time),
        ("x", deflection.record(cycles.deflection, start=0.0, step=step, times=cycles.time, rng=rng)),
        ("F", load.record(cycles.load, start=0.0, step=step, times=cycles.time, rng=rng)),
    ]


def _dynamic_test(
    test: _Test, frequency: float, truth: _Truth, rng: np.random.Generator, clean: bool
) -> list[tuple[str, FloatArray]]:
    motion = run(
        Cam(frequency) if clean else _worn_cam(frequency, rng),
        _element(test, frequency),
        _bench(test, truth),
        duration=DURATION,
        sample_rate=SAMPLE_RATE,
        oversampling=10 if clean else 5,
    )
    sensors = {"F1": Sensor(), "V1": Sensor(), "V2": Sensor()}
    if not clean:
        sensors = _laboratory_sensors(frequency, truth, rng)
    times = np.arange(round(DURATION * SAMPLE_RATE)) / SAMPLE_RATE
    return [("t", times)] + [
        (channel, _recorded(sensors[channel], signal, motion, times, rng))
        for channel, signal in (("F1", motion.force), ("V1", motion.v1), ("V2", motion.v2))
    ]


def _recorded(
    sensor: Sensor, signal: FloatArray, motion: Motion, times: FloatArray, rng: np.random.Generator
) -> FloatArray:
    start, step = float(motion.time[0]), (motion.time[-1] - motion.time[0]) / (motion.time.size - 1)
    return sensor.record(signal, start=start, step=float(step), times=times, rng=rng)


def _worn_cam(frequency: float, rng: np.random.Generator) -> Cam:
    """A cam at a random angle of its slow wander, with the same profile errors each time."""
    angle = rng.uniform(0.0, 2.0 * np.pi, 3)
    return Cam(
        frequency,
        profile=((2, 0.006, 0.7), (3, 0.002, 2.1)),
        ripple=((1, 1.5e-3, angle[0]), (2, 1.0e-3, angle[1])),
        wander=3.0e-5,
        wander_period=DURATION,
        wander_phase=angle[2],
    )


def _laboratory_sensors(frequency: float, truth: _Truth, rng: np.random.Generator) -> dict[str, Sensor]:
    """Each channel in the units of the file; a phase error is the lateness that gives it here."""
    late = {channel: -phase / (2.0 * np.pi * frequency) for channel, phase in truth.phase_errors.items()}
    gain = truth.gain_errors
    phase = rng.uniform(0.0, 2.0 * np.pi, 6)
    sign = rng.uniform(-1.0, 1.0, 3)
    return {
        "F1": Sensor(  # kN
            scale=1e-3 / _F1_GAIN,
            gain_error=gain["F1"],
            delay=late["F1"],
            offset=4e-3 * sign[0],
            drift=8e-4,
            drift_period=17.0,
            drift_phase=phase[0],
            hum=6e-4,
            hum_phase=phase[1],
            noise=2.0e-4,
            pink=1.0e-4,
            full_scale=1.0,
            bits=16,
        ),
        "V1": Sensor(  # m/s
            gain_error=gain["V1"],
            delay=_V1_DELAY + late["V1"],
            offset=1e-3 * sign[1],
            drift=1e-4,
            drift_period=13.0,
            drift_phase=phase[2],
            hum=2e-4,
            hum_phase=phase[3],
            noise=1.0e-4,
            pink=0.5e-4,
            full_scale=0.25,
            bits=16,
        ),
        "V2": Sensor(  # m/s
            gain_error=gain["V2"],
            delay=late["V2"],
            invert=True,
            offset=2e-3 * sign[2],
            drift=2e-4,
            drift_period=19.0,
            drift_phase=phase[4],
            hum=2e-4,
            hum_phase=phase[5],
            noise=1.5e-4,
            pink=0.7e-4,
            full_scale=0.5,
            bits=16,
        ),
    }


def _element(test: _Test, frequency: float) -> Zener:
    tyre, at = test.tyre, (test.pressure, test.preload)
    return Zener(float(tyre.static_stiffness(*at)), float(tyre.k2(frequency, *at)), float(tyre.c(frequency, *at)))


def _bench(test: _Test, truth: _Truth) -> Bench:
    bench = truth.bench
    return Bench(bench.mass + test.added_mass, bench.preload_stiffness, bench.preload_damping)


def _rig_columns(truth: _Truth) -> tuple[float, float, float]:
    return truth.bench.mass, truth.bench.preload_stiffness, truth.bench.preload_damping


def _static_row(test: _Test, preload: float, truth: _Truth) -> tuple[object, ...]:
    k1 = float(test.tyre.static_stiffness(test.pressure, preload))
    blank = (None,) * 5
    return (
        test.name,
        test.tyre.name,
        test.pressure,
        preload,
        None,
        None,
        k1,
        *blank,
        *_rig_columns(truth),
    )


def _dynamic_row(test: _Test, frequency: float, truth: _Truth) -> tuple[object, ...]:
    tyre = _element(test, frequency)
    spring, damper = _two_parts(tyre, frequency)
    return (
        test.name,
        test.tyre.name,
        test.pressure,
        test.preload,
        test.added_mass,
        frequency,
        tyre.k1,
        tyre.k2,
        tyre.c,
        spring,
        damper,
        _transmissibility(tyre, _bench(test, truth), frequency),
        *_rig_columns(truth),
    )


def _two_parts(tyre: Zener, frequency: float) -> tuple[float, float]:
    """Storage and loss stiffness [N/m] of the element, from the relaxation time of its arm."""
    x = 2.0 * np.pi * frequency * tyre.c / tyre.k2
    return tyre.k1 + tyre.k2 * x * x / (1.0 + x * x), tyre.k2 * x / (1.0 + x * x)


def _transmissibility(tyre: Zener, bench: Bench, frequency: float) -> float:
    """|V2/V1| [1]: the equations of motion solved for one frequency and a unit motion of the contact."""
    a, b = state_matrices(tyre, bench)
    s = 2j * np.pi * frequency
    return float(abs(np.linalg.solve(s * np.eye(3) - a, b @ np.array([1.0, s]))[0]))


def _finish(folder: Path, tests: Sequence[_Test], rows: Sequence[tuple[object, ...]], seed: int, clean: bool) -> None:
    import polars as pl

    truth = pl.DataFrame(rows, schema=list(_TRUTH_COLUMNS), orient="row", infer_schema_length=None)
    _replace(folder / "truth.csv", truth.write_csv())
    _replace(folder / "campaign.toml", _campaign_toml({test.tyre.name: test.tyre for test in tests}, seed, clean))
    table = pl.DataFrame(
        {
            "test": [test.name for test in tests],
            "file": [f"recordings/{test.name}.csv" for test in tests],
            "kind": ["static" if test.static else "dynamic" for test in tests],
            "tyre": [test.tyre.name for test in tests],
            "pressure [bar]": [_short(test.pressure / 1e5) for test in tests],
            "preload [N]": [None if test.static else _short(test.preload) for test in tests],
            "frequency [Hz]": [None if test.static else _short(test.frequency) for test in tests],
        }
    )
    if any(test.added_mass for test in tests):
        added = [None if test.static else _short(test.added_mass) for test in tests]
        table = table.with_columns(pl.Series("added_mass [kg]", added))
    _replace(folder / "tests.csv", table.write_csv())


def _campaign_toml(tyres: dict[str, VirtualTyre], seed: int, clean: bool) -> str:
    std = {"mass": "std = 0.01", "k3": "std = 0.02", "c3": "std = 0.5"}
    rig = _RIG_TOML.format(**(dict.fromkeys(std, "exact = true") if clean else std))
    parts = [
        f'title = "Cross-ply and radial-ply, virtual{", clean" if clean else ""} (seed {seed})"\n',
        rig,
        _CLEAN_CHANNELS if clean else _NOISY_CHANNELS,
    ]
    for name, tyre in tyres.items():
        key = name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)
        construction = json.dumps(tyre.construction, ensure_ascii=False)
        parts.append(f"[tyres.{key}]\nconstruction = {construction}\n")
    return "\n".join(parts)


def _short(number: float) -> str:
    """The fewest digits that say it: 1.7, 1000."""
    return f"{number:.12g}"


def _write(columns: Sequence[tuple[str, FloatArray]], path: Path, decimals: int | None) -> None:
    import polars as pl

    table = pl.DataFrame(dict(columns))
    if decimals is not None:  # the time has few digits of its own, and is not to be padded with zeros
        table = table.with_columns(pl.col("t").cast(pl.String))
    _replace(path, table.write_csv(float_precision=decimals))


def _replace(path: Path, text: str) -> None:
    """Write beside, then rename: a reader sees the old file or the new one, never half of one."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_bytes(text.encode())
        part.replace(path)
    except OSError as error:
        raise FileError(f"{path} cannot be written: {error.strerror or error}") from error
