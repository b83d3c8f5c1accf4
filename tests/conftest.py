"""Fixtures of several rooms: the reference material, and small campaign folders to read and to damage."""

from __future__ import annotations

import atexit
import gc
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray
from tests.kept import user_folders
from tests.reference import claims
from tests.selection import EVERY, left_out, mark_pages, turn

from fourpole import Study, analyse
from fourpole.core.checks import Check, Verdict
from fourpole.io.kernel import filled_by, filling
from fourpole.virtual import CROSS_PLY, RADIAL_PLY, simulate_campaign

ROOT = Path(__file__).resolve().parents[1]
#: The user's folders, with the key, are of the tests alone, and of all processes that they start.
USER = Path(tempfile.mkdtemp(prefix="fourpole-tests-"))
os.environ |= user_folders(USER)
atexit.register(shutil.rmtree, USER, ignore_errors=True)
gc.disable()  # what is imported and collected stays; to look through all of it again and again takes seconds


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--first", action="store_true", help="of each test with several cases the first one only")


def pytest_report_header() -> str:
    return "sampled tests: all cases" if EVERY else f"sampled tests: the cases of FOURPOLE_TURN={turn()}"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    mark_pages(items)
    left = set(left_out(items, first=config.getoption("--first", default=False)))
    if left and not any("::" in argument for argument in config.args):  # what is named runs
        config.hook.pytest_deselected(items=list(left))
        items[:] = [item for item in items if item not in left]


def pytest_collection_finish(session: pytest.Session) -> None:
    gc.freeze()
    gc.enable()


def pytest_unconfigure(config: pytest.Config) -> None:
    gc.unfreeze()  # some libraries say at the end what is still there


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference material beside the repository; without it, the test is skipped."""
    folder = ROOT.parent / "shared"
    if not folder.is_dir():
        pytest.skip("there is no folder of reference material beside the repository")
    return folder


@pytest.fixture(autouse=True, scope="session")
def one_recording_at_a_time() -> Iterator[None]:
    """The processes of the tests use all cores: further worker processes would only wait for each other."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fourpole.study.workers._MOST", 1)
        yield


@pytest.fixture(autouse=True, scope="session")
def no_wait_for_the_disk() -> Iterator[None]:
    """What is written need not outlast a power cut; the commands that strace traces wait, as those of users do."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.fsync", lambda descriptor: None)
        yield


@pytest.fixture(autouse=True, scope="session")
def no_check_is_ok_beyond_its_limit() -> Iterator[None]:
    """Whatever a test makes of sound and of damaged campaigns: a check beyond its limit does not say ok."""
    make = Check.__init__

    def made(check: Check, *values: object, **named: object) -> None:
        make(check, *values, **named)  # type: ignore[arg-type]
        beyond = check.statistic < check.limit if check.code.limit_is_least else check.statistic > check.limit
        assert not (check.verdict is Verdict.OK and beyond), check

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Check, "__init__", made)
        yield


@pytest.fixture(scope="session")
def library() -> None:
    """The library in C must be built; a machine without a compiler skips the test, but not one of CI."""
    with filled_by("c"):
        if filling() == "numpy":
            (pytest.fail if os.environ.get("CI") == "true" else pytest.skip)("make kernel has built no library in C")


@pytest.fixture(scope="module", params=["c", "numpy"])
def filling_of(request: pytest.FixtureRequest) -> Iterator[None]:
    """The tests of a module run with the library in C, and with numpy."""
    if request.param == "c":
        request.getfixturevalue("library")
    with filled_by(request.param):
        yield


@pytest.fixture(scope="session")
def evaluate_claims() -> Callable[..., object]:
    """The function that judges the twelve claims of the paper, written for the tests alone."""
    return claims.evaluate_claims


class Folder:
    """A campaign folder of one's own, to look at and to change.

    Its recordings are demodulated once for all copies, by this thread: `cache` finds them by their content.
    """

    def __init__(self, path: Path, cache: Path | None = None) -> None:
        self.path, self.cache = path, cache

    def recording(self, test: str) -> Path:
        return self.path / "recordings" / f"{test}.csv"

    def lines(self, test: str) -> list[str]:
        return self.recording(test).read_text().splitlines()

    def write_lines(self, test: str, lines: list[str]) -> None:
        self.recording(test).write_text("\n".join(lines) + "\n")

    def cells(self, test: str, rows: slice, column: int, value: str) -> None:
        """Write a value into some cells of a recording; row 0 is the first below the header."""
        lines = self.lines(test)
        for row in range(*rows.indices(len(lines) - 1)):
            cells = lines[row + 1].split(",")
            cells[column] = value
            lines[row + 1] = ",".join(cells)
        self.write_lines(test, lines)

    def change(self, test: str, make: Callable[[pl.DataFrame], pl.DataFrame]) -> None:
        """Write what becomes of a recording."""
        make(pl.read_csv(self.recording(test))).write_csv(self.recording(test))

    def edit(self, name: str, old: str, new: str) -> None:
        """Exchange one passage of a text file, which must be there."""
        text = (self.path / name).read_text()
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {name}"
        (self.path / name).write_text(text.replace(old, new))

    def add_column(self, name: str, cells: Mapping[str, str], default: str = "") -> None:
        """A further column of tests.csv, its cells by test."""
        lines = (self.path / "tests.csv").read_text().splitlines()
        rows = [f"{line},{cells.get(line.partition(',')[0], default)}" for line in lines[1:]]
        (self.path / "tests.csv").write_text("\n".join([f"{lines[0]},{name}", *rows]) + "\n")

    def analyse(self, **settings: object) -> Study:
        of_results_alone = settings.keys() <= {"route", "monte_carlo", "seed"}
        return analyse(self.path, cache=settings.pop("cache", self.cache if of_results_alone else None), **settings)

    def truth(self) -> pl.DataFrame:
        return pl.read_csv(self.path / "truth.csv", infer_schema_length=None)


@dataclass(frozen=True)
class Wave:
    """A sine as a recording has it: its complex velocity or force, at any time and in any derivative."""

    amplitude: complex
    frequency: float

    def __call__(self, time: NDArray[np.float64], order: int = 0) -> NDArray[np.float64]:
        """Samples of the wave (0), of its derivative (1) or of its integral (-1)."""
        turning = 2j * np.pi * self.frequency
        return (self.amplitude * turning**order * np.exp(turning * time)).real


@dataclass
class Bench:
    """A campaign written from closed formulas: what an analysis must find is known without the virtual rig."""

    path: Path
    rig: str = (
        '[rig]\nmoving_mass = { value = 15, unit = "kg", exact = true }\n'
        'preload_stiffness = { value = 12.44, unit = "kN/m", exact = true }\n'
        'preload_damping = { value = 15, unit = "N s/m", exact = true }\n'
    )
    specimens: str = "[specimens.bush]\n"
    channels: dict[str, str] = field(
        default_factory=lambda: {
            "time": '{ column = "t", unit = "s" }',
            "force_in": '{ column = "F1", unit = "N", exact = true }',
            "motion_in": '{ column = "V1", unit = "m/s", exact = true }',
            "motion_out": '{ column = "V2", unit = "m/s", exact = true }',
        }
    )
    columns: tuple[str, ...] = ("preload [N]", "K1 [N/m]")
    k1: float = 110e3
    k2: float = 90e3
    c: float = 800.0
    k3: float = 12440.0
    c3: float = 15.0
    time: NDArray[np.float64] = field(default_factory=lambda: np.arange(3000) / 1000.0)
    rows: list[str] = field(default_factory=list)

    def stiffness(self, frequency: float) -> complex:
        """K* [N/m]: K1 beside the spring K2 in series with the damper C."""
        return self.k1 + 1.0 / (1.0 / self.k2 + 1.0 / (2j * np.pi * frequency * self.c))

    def waves(self, frequency: float, mass: float = 15.0, *, blocked: bool = False) -> tuple[Wave, Wave, Wave]:
        """F1, V1 and V2 under a cam of 1 mm."""
        jw = 2j * np.pi * frequency
        v1 = 1e-3 * jw
        beyond = 0.0 if blocked else 1.0 / (jw * mass + self.c3 + self.k3 / jw)
        f1 = v1 / (jw / self.stiffness(frequency) + beyond)
        return Wave(f1, frequency), Wave(v1, frequency), Wave(f1 * beyond, frequency)

    def transmissibility(self, frequency: float, mass: float = 15.0) -> float:
        _, v1, v2 = self.waves(frequency, mass)
        return abs(v2.amplitude / v1.amplitude)

    def record(self, name: str, columns: Mapping[str, NDArray[np.float64]]) -> str:
        """Write a recording, all digits of it, and say how tests.csv names it."""
        (self.path / "recordings").mkdir(exist_ok=True)
        pl.DataFrame(dict(columns)).write_csv(self.path / "recordings" / f"{name}.csv")
        return f"recordings/{name}.csv"

    def dynamic(self, name: str, cells: str = "1000,110000", **state: float | bool) -> None:
        """A dynamic test recorded plainly: t, F1, V1, V2."""
        frequency = float(state.pop("frequency", 14.0))
        f1, v1, v2 = (wave(self.time) for wave in self.waves(frequency, **state))
        self.row(name, self.record(name, {"t": self.time, "F1": f1, "V1": v1, "V2": v2}), cells)

    def static(
        self, name: str, cells: str, *, a: float = 100e3, b: float = 1e6, gap: float = 0.0, cycles: int = 3
    ) -> None:
        """A static test: F = a x + b x² ± `gap` over 0 to 30 mm and back, in N and mm."""
        u = np.concatenate([np.linspace(0.0, 1.0, 101), np.linspace(1.0, 0.0, 101)[1:-1]])
        side = np.concatenate([np.ones(101), -np.ones(99)])
        travel = 0.03 * np.append(np.tile(u, cycles), 0.0)
        load = a * travel + b * travel**2 + gap * np.append(np.tile(side * 4 * u * (1 - u), cycles), 0.0)
        self.channels.setdefault("load", '{ column = "F", unit = "N", exact = true }')
        self.channels.setdefault("deflection", '{ column = "x", unit = "mm", exact = true }')
        self.row(name, self.record(name, {"x": 1e3 * travel, "F": load}), cells, kind="static")

    def row(self, name: str, file: str, cells: str, kind: str = "dynamic") -> None:
        self.rows.append(f"{name},{file},{kind},bush,{cells}")

    def write(self) -> Path:
        channels = "\n".join(f"{role} = {said}" for role, said in self.channels.items())
        (self.path / "campaign.toml").write_text(
            f'[unstated]\nordinary = "zero"\n\n{self.rig}\n[channels]\n{channels}\n\n{self.specimens}'
        )
        head = ",".join(["test,file,kind,specimen", *self.columns])
        (self.path / "tests.csv").write_text("\n".join([head, *self.rows]) + "\n")
        return self.path

    def analyse(self, **settings: object) -> Study:
        return analyse(self.write(), **settings)

    def found(self, **settings: object) -> dict[str, object]:
        """The only row of dynamic.csv."""
        (row,) = self.analyse(**settings).dynamic.rows(named=True)
        return row


@pytest.fixture(scope="session")
def noisy_campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """S1 and D1 to D4 of the radial-ply: 10, 14, 18 and 24 Hz at 1000 N and 1.7 bar, as a laboratory leaves them."""
    return simulate_campaign(
        tmp_path_factory.mktemp("noisy"),
        tyres=[RADIAL_PLY],
        pressures=[170e3],
        preloads=[1000.0],
        frequencies=[10.0, 14.0, 18.0, 24.0],
    ).folder


@pytest.fixture(scope="session")
def clean_campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two tyres at two preloads and three frequencies, only the physics."""
    return simulate_campaign(
        tmp_path_factory.mktemp("clean"),
        clean=True,
        tyres=[CROSS_PLY, RADIAL_PLY],
        pressures=[170e3],
        preloads=[1000.0, 2000.0],
        frequencies=[10.0, 17.0, 24.0],
    ).folder


@pytest.fixture(scope="session")
def demodulated_recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The cache of all copies of the two campaigns."""
    return tmp_path_factory.mktemp("demodulated")


@pytest.fixture
def noisy(noisy_campaign: Path, demodulated_recordings: Path, tmp_path: Path) -> Folder:
    """A copy of the noisy campaign to change."""
    return Folder(shutil.copytree(noisy_campaign, tmp_path / "campaign"), demodulated_recordings)


@pytest.fixture
def clean(clean_campaign: Path, demodulated_recordings: Path, tmp_path: Path) -> Folder:
    """A copy of the clean campaign to change."""
    return Folder(shutil.copytree(clean_campaign, tmp_path / "campaign"), demodulated_recordings)


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    """An empty campaign to fill from closed formulas."""
    return Bench(tmp_path)
