"""The folder of a virtual campaign: campaign.toml, tests.csv, truth.csv with its rows, and the recordings."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from math import isnan
from pathlib import Path

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.rig import PARAMETERS
from fourpole.errors import FileError
from fourpole.models.interface import StateSpace
from fourpole.virtual.bench import Bench, Element, Zener, equations, far_end
from fourpole.virtual.cam import Cam
from fourpole.virtual.dynamic_rig import run
from fourpole.virtual.phasor_rig import CHANNELS
from fourpole.virtual.plan import SERIES, Planned, with_inertia
from fourpole.virtual.recordings import F1_GAIN, V1_DELAY, Statement, Truth

#: Length of the noise-free record from which the first harmonics are taken where there is friction [s].
_DESCRIBED = 1.0

_OF_A_TEST = (q.PRESSURE, q.PRELOAD, q.ADDED_MASS, q.FREQUENCY, q.K1, q.K2, q.C, q.STORAGE, q.LOSS, q.TR)
_OF_THE_RIG = ("moving mass [kg]", "preload stiffness [N/m]", "preload damping [N s/m]")
TRUTH_COLUMNS = ("test", "tyre", *(one.head for one in _OF_A_TEST), *_OF_THE_RIG)
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
#: Further columns for a campaign with specimens that have a mass of their own.
INERTIA_COLUMNS = (q.BELT_MASS.head, "belt share [1]", q.BELT_FREE.head)
_NOISY_CHANNELS = """\
[channels]
time       = {{ column = "t", unit = "s" }}
force_in   = {{ column = "F1", unit = "kN", gain = {gain}, range = "1 kN", {accuracy} }}
motion_in  = {{ column = "V1", unit = "m/s", delay = "{delay} ms", range = "0.25 m/s", {accuracy} }}
motion_out = {{ column = "V2", unit = "m/s", invert = true, range = "0.5 m/s", {accuracy} }}
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


def prepare(folder: Path, tests: Sequence[Planned]) -> Path:
    """Make the folder ready; FileError if it holds anything but a virtual campaign, which stays unchanged."""
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
        # An interrupted run leaves truth.csv, which marks a virtual campaign, without tests.csv, which completes it.
        (folder / "truth.csv").touch()
        (folder / "tests.csv").unlink(missing_ok=True)
        wanted = {f"{test.name}.csv" for test in tests}
        for path in recordings.iterdir():
            if re.fullmatch(rf"\.?([SDC]\d+|{SERIES}_[^ ]+)\.csv(\.part)?", path.name) and path.name not in wanted:
                path.unlink()
    except FileError:
        raise
    except OSError as error:
        raise FileError(f"{folder} cannot be written: {error.strerror or error}; choose another folder") from error
    return folder


def _is_virtual(folder: Path) -> bool:
    """Whether a folder is a virtual campaign, complete or not."""
    truth = folder / "truth.csv"
    if not truth.is_file():
        return False
    with truth.open("rb") as file:
        beginning = file.read(64)
    return beginning == b"" or beginning.startswith(",".join(TRUTH_COLUMNS[:3]).encode())


def finish(
    folder: Path,
    tests: Sequence[Planned],
    rows: Sequence[tuple[object, ...]],
    statement: Statement,
    seed: int,
    report: Mapping[str, str],
) -> None:
    """Write truth.csv, campaign.toml and, last, tests.csv, which make the recordings a campaign."""
    import polars as pl

    laden = INERTIA_COLUMNS if with_inertia(tests) else ()
    columns = (*TRUTH_COLUMNS, *MORE_COLUMNS)[: len(rows[0]) - len(laden)]
    columns = (*columns, *laden)
    truth = pl.DataFrame(rows, schema=list(columns), orient="row", infer_schema_length=None)
    _replace(folder / "truth.csv", truth.write_csv())
    _replace(folder / "campaign.toml", _campaign_toml(tests, statement, seed, report))
    table = pl.DataFrame(
        {
            "test": [test.name for test in tests],
            "file": [f"recordings/{test.name}.csv" for test in tests],
            "kind": [test.kind for test in tests],
            "tyre": [test.tyre and test.tyre.name for test in tests],
            q.PRESSURE.stated_head: [_cell(test.pressure / 1e5) for test in tests],
            q.PRELOAD.head: [_cell(test.preload) for test in tests],
            q.FREQUENCY.head: [_cell(test.frequency) for test in tests],
        },
        schema_overrides=dict.fromkeys(("tyre", q.PRESSURE.stated_head, q.PRELOAD.head, q.FREQUENCY.head), pl.String),
    )
    if any(test.added_mass for test in tests):
        added = [None if test.kind == "static" else _short(test.added_mass) for test in tests]
        table = table.with_columns(pl.Series(q.ADDED_MASS.stated_head, added))
    _replace(folder / "tests.csv", table.write_csv())


def _campaign_toml(tests: Sequence[Planned], statement: Statement, seed: int, report: Mapping[str, str]) -> str:
    """The text of campaign.toml; a specimen without inflation stands under [specimens]."""
    clean = statement.clean
    tested = {test.tyre.name: (test.tyre, isnan(test.pressure)) for test in tests if test.tyre is not None}
    *others, last = tested
    title = f"{', '.join(others)} and {last}" if others else last
    title = f"{title[:1].upper()}{title[1:]}, virtual{', clean' if clean else ''} (seed {seed})"
    gain, phase = 100.0 * statement.std_gain, float(np.rad2deg(statement.std_phase))
    noisy = _NOISY_CHANNELS.format(
        gain=F1_GAIN,
        delay=_short(1e3 * V1_DELAY),
        accuracy=f'std_gain = "{_short(gain)} %", std_phase = "{_short(phase)} deg"',
    )
    parts = [
        f"title = {_quoted(title)}\n",
        *(["[report]\n" + "".join(f"{name} = {_quoted(text)}\n" for name, text in report.items())] if report else []),
        '[unstated]\nordinary = "zero"\n',  # this rig draws no other errors than those that are stated
        "[rig]\n" + "".join(_rig_line(name, *values, clean) for name, values in statement.rig.items()),
        _CLEAN_CHANNELS if clean else noisy,
    ]
    for name, (tyre, mount) in tested.items():
        key = name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _quoted(name)
        group = "specimens" if mount else "tyres"
        weight = "" if tyre.weight is None else f'specimen_mass = "{_short(tyre.weight)} kg"\n'
        parts.append(f"[{group}.{key}]\nconstruction = {_quoted(tyre.construction)}\n{weight}")
    return "\n".join(parts)


def _quoted(text: str) -> str:
    """A text as a TOML string."""
    return json.dumps(text, ensure_ascii=False)


def _rig_line(name: str, value: float, std: float, clean: bool) -> str:
    """The line of campaign.toml for a value of the rig in SI units."""
    unit, size = ("kN/m", 1e3) if name.endswith("stiffness") else (PARAMETERS[name], 1.0)
    accuracy = "exact = true" if clean else f"std = {_short(std / size)}"
    return f'{name:<17} = {{ value = {float(_short(value / size))!r}, unit = "{unit}", {accuracy} }}\n'


def _short(number: float) -> str:
    """A number with the fewest digits, as in 1.7 or 1000."""
    return f"{number:.12g}"


def _cell(number: float) -> str | None:
    """A number with the fewest digits; None for not-a-number."""
    return None if isnan(number) else _short(number)


def write_recording(columns: Sequence[tuple[str, FloatArray]], path: Path, decimals: int | None) -> None:
    """Write named columns with a number of decimals; with all digits if `decimals` is None."""
    import polars as pl

    table = pl.DataFrame(dict(columns))
    if decimals is not None:  # the time has few digits and needs no trailing zeros
        table = table.with_columns(pl.col("t").cast(pl.String))
    _replace(path, table.write_csv(float_precision=decimals))


def _replace(path: Path, text: str) -> None:
    """Write a temporary file, then rename it, so that a reader never finds an incomplete file."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_bytes(text.encode())
        part.replace(path)
    except OSError as error:
        raise FileError(f"{path} cannot be written: {error.strerror or error}") from error


def truth_rows(
    test: Planned, truth: Truth, *, preloads: Sequence[float], frequency: float, more: bool, inertia: bool
) -> list[tuple[object, ...]]:
    """Rows of truth.csv: one per test, or one per preload for a static test; `more` and `inertia` add columns."""
    bench = truth.bench
    shared: tuple[object, ...] = (bench.mass, bench.preload_stiffness, bench.preload_damping)
    if more:
        parts = (bench.tyre_mass, bench.frame_stiffness, bench.preload_loss_factor, bench.input_mass)
        errors = (errors[channel] for errors in (truth.gain_errors, truth.phase_errors) for channel in CHANNELS)
        shared = (*shared, *parts, bench.leaf_friction, *errors)
    shared = (*shared, *(_inertia(test, frequency) if inertia else ()))
    if test.kind == "static":
        tyre, pressure = test.mounted, test.pressure
        rows = ((load, None, None, float(tyre.static_stiffness(pressure, load)), *(None,) * 5) for load in preloads)
        return [(test.name, tyre.name, pressure, *values, *shared) for values in rows]
    if test.kind == "calibration":
        return [(test.name, None, None, None, test.added_mass, frequency, *(None,) * 5, 1.0, *shared)]
    return [(*_dynamic_row(test, truth, frequency), *shared)]


def _inertia(test: Planned, frequency: float) -> tuple[object, ...]:
    """The values of `INERTIA_COLUMNS` in a dynamic test; None for other tests."""
    if test.kind != "dynamic" or (inertia := test.mounted.inertia) is None:
        return (None,) * len(INERTIA_COLUMNS)
    return (inertia.mass, *inertia.described(equations(test.springs(frequency)), 2.0 * np.pi * frequency))


def _dynamic_row(test: Planned, truth: Truth, frequency: float) -> tuple[object, ...]:
    """The row of a dynamic test up to TR, in the order of `TRUTH_COLUMNS`."""
    springs, k1 = test.springs(frequency), float(test.mounted.static_stiffness(test.pressure, test.preload))
    arm: tuple[float | None, float | None] = (None, None)
    if isinstance(springs, Zener):
        arm = (springs.k2, springs.c)
    ratio = _transmissibility(test.element(frequency), truth.bench_of(test), Cam(frequency, test.eccentricity))
    stated = (test.name, test.mounted.name, test.pressure, test.preload, test.added_mass, frequency)
    return (*stated, k1, *arm, *_two_parts(springs, frequency), ratio)


def _two_parts(tyre: Zener | StateSpace, frequency: float) -> tuple[float, float]:
    """Storage and loss stiffness of a tyre [N/m]."""
    if isinstance(tyre, StateSpace):
        stiffness = complex(tyre.stiffness(2.0 * np.pi * frequency))
        return stiffness.real, stiffness.imag
    x = 2.0 * np.pi * frequency * tyre.c / tyre.k2
    return tyre.k1 + tyre.k2 * x * x / (1.0 + x * x), tyre.k2 * x / (1.0 + x * x)


def _transmissibility(tyre: Element, bench: Bench, cam: Cam) -> float:
    """|V2/V1| [1]; with friction, that of its first harmonic."""
    if not bench.leaf_friction:
        return abs(far_end(tyre, bench.damped_at(cam.frequency), cam.frequency))
    motion = run(cam, tyre, bench, duration=_DESCRIBED)
    turn = np.exp(2j * np.pi * cam.frequency * motion.time)
    columns = [part for order in range(1, 8) for part in (np.real(turn**order), -np.imag(turn**order))]
    found, *_ = np.linalg.lstsq(np.stack(columns, axis=1), np.stack([motion.x1, motion.x2], axis=1), rcond=None)
    x1, x2 = found[0] + 1j * found[1]
    return float(abs(x2 / x1))
