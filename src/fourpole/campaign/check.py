"""A campaign looked through without analysing it: what would be rejected, where it stands, and what to do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fourpole import units
from fourpole.campaign.folder import Campaign, Test, inside
from fourpole.campaign.guess.signals import rate_of, samples_of
from fourpole.campaign.identified import possible_route
from fourpole.campaign.load import group_of
from fourpole.campaign.reduce import ROUTE_NEEDS
from fourpole.campaign.static import StaticRow, stiffness_for
from fourpole.core.phasor import CHANNELS
from fourpole.errors import CampaignError, FourpoleError, TableError
from fourpole.io.formats.guard import find
from fourpole.io.layout import find_column
from fourpole.io.recordings import survey
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Request, SignalInfo
from fourpole.io.source import sha256_of
from fourpole.io.stream import agreed

__all__ = ["Checked", "Problem", "check_campaign"]

_MOST_HASHED = 500_000_000  # bytes of a file that is compared with others of its size
_FEWEST_CYCLES = 3.0
_RESOLVED = 0.45  # of the sample rate
_SAME_RATE = 1e-4


@dataclass(frozen=True)
class Problem:
    """What is wrong with a test.

    Attributes
    ----------
    test : str
    row : int
        Line of tests.csv.
    file : str
        As tests.csv names it.
    about : str
        "tests.csv", "file", "channels", "time", "window", "frequency", "K1" or "duplicate".
    verdict : str
        "rejected" where the analysis could not use the test, "warning" where it would lack something.
    message : str
        What was found, and what to do.
    """

    test: str
    row: int
    file: str
    about: str
    verdict: str
    message: str


@dataclass(frozen=True)
class Checked:
    """What a look through a campaign found; `notes` concern the campaign as a whole."""

    campaign: Campaign
    route: str
    problems: tuple[Problem, ...]
    notes: tuple[str, ...] = ()

    @property
    def counts(self) -> dict[str, int]:
        """Tests by their worst verdict."""
        rejected = {problem.test for problem in self.problems if problem.verdict == "rejected"}
        warned = {problem.test for problem in self.problems} - rejected
        every = len(self.campaign.tests)
        return {"ok": every - len(rejected) - len(warned), "warning": len(warned), "rejected": len(rejected)}


def check_campaign(
    campaign: Campaign, *, route: str = "joint", progress: Callable[[int, int], None] | None = None
) -> Checked:
    """Look through a campaign: files, channels, units, times and lengths, K1, duplicates. Nothing is written.

    Parameters
    ----------
    campaign : Campaign
        As `read_campaign` gives it.
    route : {"joint", "mobility", "relative", "transmissibility"}
        The route that it is to be analysed by; it says which channels are needed.
    progress : callable (done, total)
        Called after each test.

    Returns
    -------
    Checked

    Raises
    ------
    CampaignError
        If there is no such route.

    Examples
    --------
    >>> import tempfile
    >>> from fourpole.campaign import read_campaign
    >>> from fourpole.virtual import simulate_campaign
    >>> with tempfile.TemporaryDirectory() as place:
    ...     made = simulate_campaign(place, pressures=[170e3], preloads=[1000.0], frequencies=[14.0], clean=True)
    ...     _ = (made.folder / "recordings" / "S1.csv").unlink()
    ...     checked = check_campaign(read_campaign(made.folder))
    >>> checked.counts
    {'ok': 2, 'warning': 1, 'rejected': 1}
    >>> checked.problems[0].message
    'there is no such file; check its name'
    """
    if route not in ROUTE_NEEDS:
        raise CampaignError(f"no route {route!r}: choose one of {', '.join(ROUTE_NEEDS)}")
    used, notes = _route(campaign, route)
    look = _Look(campaign, used)
    for done, test in enumerate(campaign.tests, 1):
        look.test(test)
        if progress is not None:
            progress(done, len(campaign.tests))
    look.duplicates()
    look.stiffness()
    order = {test.name: at for at, test in enumerate(campaign.tests)}
    problems = sorted(look.problems, key=lambda problem: (order[problem.test], problem.verdict != "rejected"))
    return Checked(campaign, used, tuple(problems), tuple(notes))


def _route(campaign: Campaign, route: str) -> tuple[str, list[str]]:
    """The route that the campaign allows, and what is to be said of it."""
    used, note = possible_route(campaign, route)
    notes = [note] if note else []
    if campaign.of_kind("dynamic") and not campaign.stated.all_rigs and used != "relative":
        remedy = "state moving_mass and preload_stiffness, or use --route relative"
        notes.append(f"campaign.toml: [rig] is missing, the {used} route needs it: {remedy}")
        used = "relative" if used == "joint" else used
    return used, notes


@dataclass
class _Look:
    """What is seen on the way through the tests."""

    campaign: Campaign
    route: str
    problems: list[Problem] = field(default_factory=list)
    infos: dict[Path, FileInfo | FourpoleError] = field(default_factory=dict)
    paths: dict[str, Path] = field(default_factory=dict)

    def test(self, test: Test) -> None:
        """Everything that one test can tell by itself."""
        if test.problem:
            self._say(test, "tests.csv", "rejected", test.problem)
            return
        about = "file"
        try:
            path = inside(self.campaign.folder, test.file)
            info = self._info(path, test)
            self.paths[test.name] = path
            about = "channels"
            signals = self._channels(test, path, info)
            about = "time"
            self._times(test, path, info, signals)
        except FourpoleError as error:
            self._say(test, about, "rejected", str(error))
        except MemoryError:
            self._say(test, about, "rejected", "does not fit into memory: cut it with window [s]")

    def _say(self, test: Test, about: str, verdict: str, message: str) -> None:
        label = units.shown(test.file, 200)[1:-1]
        text = message.removeprefix(f"tests.csv row {test.row}: ")
        for start in (f"{label}: ", f"{test.file}: "):
            text = text.removeprefix(start)
        self.problems.append(Problem(test.name, test.row, test.file, about, verdict, text))

    def _info(self, path: Path, test: Test) -> FileInfo:
        """What a file holds, looked up once."""
        if path not in self.infos:
            try:
                self.infos[path] = survey(path, max_bytes=MAX_FILE_BYTES, label=test.file)
            except FourpoleError as error:
                self.infos[path] = error
        found = self.infos[path]
        if isinstance(found, FourpoleError):
            raise found
        return found

    # --- channels ------------------------------------------------------------------------------------------------

    def _channels(self, test: Test, path: Path, info: FileInfo) -> list[SignalInfo]:
        """The channels that the test needs, with units that agree; one that can be spared only warns."""
        channels = self.campaign.stated.channels
        needed: Sequence[str] = ("load", "deflection") if test.kind == "static" else ROUTE_NEEDS[self.route]
        lacking = [role for role in needed if channels.named(role) is None]
        if lacking:
            raise TableError(
                f"the {self.route} route needs {lacking[0]}, which [channels] in campaign.toml does not state"
            )
        spare = [] if test.kind == "static" else [role for role in CHANNELS if role not in needed]
        found = []
        for role in (*needed, *spare):
            if channels.named(role) is None:
                continue
            try:
                found.append(self._channel(test, path, info, role))
            except TableError as error:
                if role in needed:
                    raise
                self._say(test, "channels", "warning", f"{role} would be left out: {error}")
        return found

    def _channel(self, test: Test, path: Path, info: FileInfo, role: str) -> SignalInfo:
        channels = self.campaign.stated.channels
        channel = channels.named(role)
        assert channel is not None
        signal = _found(info, channel.column, group_of(path, test), test.file)
        if channel.unit is not None:
            agreed(channel.column, signal.unit, channel.unit, channels.conversion(role, signal.unit).kind)
        return signal

    # --- time ----------------------------------------------------------------------------------------------------

    def _times(self, test: Test, path: Path, info: FileInfo, signals: list[SignalInfo]) -> None:
        """Rate and length against window and frequency."""
        if test.kind == "static" and test.window is None:
            return
        start, rate, duration = self._timing(test, path, info, signals)
        stop = start + duration
        if test.window is not None:
            low, high = test.window
            if (min(high, stop) - max(low, start)) * rate < 2:
                raise TableError(
                    f"window {low:g}..{high:g} s holds no samples: the recording runs {start:g} to {stop:g} s; "
                    "correct window [s] in tests.csv"
                )
            if high > stop + 1 / rate:
                message = f"window {low:g}..{high:g} s goes beyond the recording, which ends at {stop:g} s; shorten it"
                self._say(test, "window", "warning", message)
            start, stop = max(low, start), min(high, stop)
        frequency = test.value("frequency")
        if test.kind != "static" and frequency is not None:
            self._frequency(test, frequency, rate, stop - start)

    def _frequency(self, test: Test, frequency: float, rate: float, duration: float) -> None:
        if frequency >= _RESOLVED * rate:
            message = (
                f"an excitation at {frequency:.6g} Hz is not resolved by {rate:.6g} samples per second; sample faster"
            )
            self._say(test, "frequency", "rejected", message)
        cycles = frequency * (duration + 1 / rate)
        if cycles < _FEWEST_CYCLES * (1 - 1e-6):
            message = (
                f"holds {cycles:.2g} cycles of {frequency:.4g} Hz, at least {_FEWEST_CYCLES:g} are "
                f"needed: record longer"
            )
            self._say(test, "frequency", "rejected", message)

    def _timing(self, test: Test, path: Path, info: FileInfo, signals: list[SignalInfo]) -> tuple[float, float, float]:
        """Start [s], rate [Hz], length [s]: stated in campaign.toml, known to the file, or in its column of times."""
        channels = self.campaign.stated.channels
        count, own = min(signal.count for signal in signals), signals[0].rate
        if channels.rate is not None:
            if own is not None and abs(own - channels.rate) > _SAME_RATE * channels.rate:
                raise TableError(
                    f"{units.shown(signals[0].name)} was sampled at {own:.8g} Hz by the file, at "
                    f"{channels.rate:.8g} Hz "
                    "by campaign.toml: correct or leave out sample_rate in campaign.toml"
                )
            return 0.0, channels.rate, max(count - 1, 0) / channels.rate
        text = info.format.startswith("text")
        clock = channels.time.column if channels.time is not None else None
        if clock is None or not text:
            rates = [signal.rate for signal in signals if signal.rate]
            if len(rates) == len(signals):  # they need not be the same
                length = min(max(one.count - 1, 0) / rate for one, rate in zip(signals, rates, strict=True))
                return max(signal.start or 0.0 for signal in signals), min(rates), length
            if clock is None:
                raise TableError(
                    "does not say when its samples were taken: state sample_rate, or the column time, in [channels] of "
                    "campaign.toml"
                )
        return self._clocked(test, path, info, clock, count)

    def _clocked(self, test: Test, path: Path, info: FileInfo, clock: str, count: int) -> tuple[float, float, float]:
        """The same by a column of times, of a long table by its start."""
        channels = self.campaign.stated.channels
        assert channels.time is not None
        group = group_of(path, test)
        signal = _found(info, clock, group, test.file)
        unit = agreed(clock, signal.unit, channels.time.unit, "time")
        time = samples_of(path, [clock], group=group, label=test.file)[clock].samples * units.unit_scale(unit, "time")
        rate = rate_of(time)
        if rate is None:
            raise TableError(f"time, column {units.shown(clock)}, does not rise: another column may be meant")
        first = float(time[np.isfinite(time)][0])
        whole = len(time) >= count
        return first, rate, float(time[np.isfinite(time)][-1]) - first if whole else (count - 1) / rate

    # --- the campaign as a whole ---------------------------------------------------------------------------------

    def duplicates(self) -> None:
        """Two tests of one recording, or of two files with the same content."""
        seen: dict[tuple[object, ...], Test] = {}
        for test in self.campaign.tests:
            path = self.paths.get(test.name)
            if path is None:
                continue
            key = (path, group_of(path, test), test.window)
            first = seen.setdefault(key, test)
            if first is not test:
                message = (
                    f"is the recording of test {units.shown(first.name)} (row {first.row}) too: name "
                    f"another file, group or window [s]"
                )
                self._say(test, "duplicate", "warning", message)
        self._same_content()

    def _same_content(self) -> None:
        by_size: dict[int, list[tuple[Test, Path]]] = {}
        for test in self.campaign.tests:
            path = self.paths.get(test.name)
            if path is not None and path not in {other for _, other in by_size.get(path.stat().st_size, [])}:
                by_size.setdefault(path.stat().st_size, []).append((test, path))
        for size, several in by_size.items():
            if len(several) < 2 or size > _MOST_HASHED:
                continue
            seen: dict[str, Test] = {}
            for test, path in several:
                first = seen.setdefault(sha256_of(path, max_bytes=MAX_FILE_BYTES, label=test.file), test)
                if first is not test:
                    message = (
                        f"has the same content as {units.shown(first.file)} of test "
                        f"{units.shown(first.name)} (row {first.row}): is it a copy?"
                    )
                    self._say(test, "duplicate", "warning", message)

    def stiffness(self) -> None:
        """Whether each dynamic test finds a K1: its own, or a static test of its tyre, pressure and preload."""
        bad = {problem.test for problem in self.problems if problem.verdict == "rejected"}
        statics = [test for test in self.campaign.tests if test.kind == "static" and test.name not in bad]
        for test in self.campaign.tests:
            if test.kind != "dynamic" or test.name in bad:
                continue
            preload = test.value("preload")
            rows = [StaticRow(static, float("nan") if preload is None else preload) for static in statics]
            found = stiffness_for(test, rows, self.campaign.stated.sameness)
            if found.reason:
                self._say(test, "K1", "warning", f"K2 and C would be left blank: {found.reason}")
            elif found.warning:
                self._say(test, "K1", "warning", found.warning)


def _found(info: FileInfo, column: str, group: str, label: str) -> SignalInfo:
    """The channel of a name as the reading of the file would find it."""
    if info.format.startswith("text"):
        if group:
            raise TableError(f"{label}: is a table of text, which has no groups: leave out '#{group}'")
        return info.signals[find_column([signal.name for signal in info.signals], column, label)]
    places = [(signal.group, signal.name) for signal in info.signals]
    return info.signals[find(places, Request(Path(label), (column,), group, label, MAX_FILE_BYTES))[0]]
