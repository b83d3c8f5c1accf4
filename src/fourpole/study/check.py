"""A campaign checked by the reduction's own functions, on the first part of each recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from fourpole import units
from fourpole.campaign.folder import Campaign
from fourpole.campaign.place import group_of, inside
from fourpole.campaign.row import Test, problem_of
from fourpole.core.checks import VERDICTS, Verdict
from fourpole.errors import CampaignError, FileError, FourpoleError, TableError
from fourpole.io.child import read_apart
from fourpole.io.door import sha256_of
from fourpole.io.look import rate_of
from fourpole.io.recordings import survey
from fourpole.io.remote import is_elsewhere
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.io.stream import StreamSource, stream, times_of
from fourpole.study.identify import no_rig, possible_route
from fourpole.study.load import source_of
from fourpole.study.points import expects_k1
from fourpole.study.record import assumptions_of
from fourpole.study.reduce import ROUTE_NEEDS, Reduction, jobs_of
from fourpole.study.static import StaticRow, evaluate_statics, stiffness_for
from fourpole.study.workers import check_part_of, pool_of
from fourpole.words import kind_of, remark_of, why_no_k1

#: Largest file [bytes] whose content is compared with that of other files of its size.
_MOST_HASHED = 500_000_000
#: Number of samples from which the start and the sample rate of a recording are found.
_ROWS = 1 << 10
#: Time of the check of one recording [s].
_SECONDS = 0.01


@dataclass(frozen=True)
class CampaignProblem:
    """A fault of a test that the check of a campaign found.

    Attributes
    ----------
    test : str
        Name of the test.
    row : int
        Line of tests.csv.
    file : str
        The file as tests.csv names it.
    about : str
        "tests.csv", "file", "channels", "recording", "static test", "window", "K1", "duplicate", or a check's name.
    verdict : Verdict
        Rejected where the analysis could not use the test, a warning where it would lack something.
    message : str
        The fault, and its remedy.
    kind : str
        What faults have in common that differ in numbers and names only.
    """

    test: str
    row: int
    file: str
    about: str
    verdict: Verdict
    message: str
    kind: str = ""


@dataclass(frozen=True)
class Checked:
    """The result of the check of a campaign; `notes` on the route and on assumptions, as `analyse` gives them."""

    campaign: Campaign
    route: str
    problems: tuple[CampaignProblem, ...]
    notes: tuple[str, ...] = ()

    @property
    def counts(self) -> dict[str, int]:
        """Number of tests by their worst verdict."""
        rejected = {problem.test for problem in self.problems if problem.verdict is Verdict.REJECTED}
        warned = {problem.test for problem in self.problems} - rejected
        every = len(self.campaign.tests)
        counts = (every - len(rejected) - len(warned), len(warned), len(rejected))
        return dict(zip(map(str, VERDICTS), counts, strict=True))


def check_campaign(
    campaign: Campaign,
    *,
    route: str = "joint",
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Checked:
    """Check a campaign before its analysis: files, channels, units, times and lengths, K1, duplicates.

    Nothing is written.

    Parameters
    ----------
    campaign : Campaign
        The campaign that `read_campaign` returns.
    route : {"joint", "mobility", "relative", "transmissibility"}
        The route of the later analysis; it decides which channels are needed.
    workers : int, optional
        Number of processes that read the recordings, or 1 for this one; by default as many as pay.
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
    'there is no such file; check its name; correct or repeat the static test, or state K1 [N/m] in tests.csv'
    """
    if route not in ROUTE_NEEDS:
        raise CampaignError(f"no route {route!r}: choose one of {', '.join(ROUTE_NEEDS)}")
    used, notes = _route(campaign, route)
    look, jobs = _Inspection(campaign), jobs_of(campaign, campaign.tests, used)
    with pool_of(workers, len(jobs), len(jobs) * _SECONDS) as pool:
        look.guarded = pool is not None
        tested = map(look.test, jobs) if pool is None else pool.map(look.test, jobs)
        for done, _ in enumerate(tested, 1):
            if progress is not None:
                progress(done, len(jobs))
    look.duplicates()
    look.stiffness(look.statics())
    order = {test.name: place for place, test in enumerate(campaign.tests)}
    problems = sorted(look.problems, key=lambda problem: (order[problem.test], problem.verdict is not Verdict.REJECTED))
    return Checked(campaign, used, tuple(problems), (*notes, *assumptions_of(campaign)))


def _route(campaign: Campaign, route: str) -> tuple[str, list[str]]:
    """The route that the campaign allows, and notes with the reasons."""
    used, note = possible_route(campaign, route)
    notes = [note] if note else []
    if campaign.of_kind("dynamic") and not campaign.stated.all_rigs and used != "relative":
        notes.append(no_rig(campaign, used))
        used = "relative" if used == "joint" else used
    return used, notes


#: The classes of what a worker process is told of a file.
OF_WORK = (StreamSource,)


def end_of(path: Path, source: StreamSource) -> tuple[float, float] | None:
    """Last time and time step of a recording [s], from its first samples and its number of samples; None if unknown."""
    (first,) = next(stream(source).chunks)
    info = survey(path, max_bytes=MAX_FILE_BYTES, label=source.label)
    count = max(signal.count for signal in info.signals if source.group in ("", signal.group))
    time, rate = times_of(first), rate_of(first)
    return None if time is None or rate is None else (float(time[0]) + (count - 1) / rate, 1 / rate)


@dataclass
class _Inspection:
    """The problems of a campaign, found test by test; `guarded` if each thread has a process that reads files."""

    campaign: Campaign
    guarded: bool = False
    problems: dict[CampaignProblem, None] = field(default_factory=dict)  # a set that keeps their order
    paths: dict[str, Path] = field(default_factory=dict)

    def test(self, job: Reduction) -> None:
        """Check one test by itself: its row, its file, and the first part of a dynamic recording."""
        test, about = job.test, "file"
        if test.problem:
            self._say(test, "tests.csv", Verdict.REJECTED, test.problem, problem_of(test).site)
            return
        try:
            path = None if is_elsewhere(test.file) else inside(self.campaign.folder, test.file)
            if path is not None and path.is_file():
                self.paths[test.name] = path
            if test.kind == "static":
                return
            for row in check_part_of(job, guarded=self.guarded):
                self._say(test, row.heading, row.verdict, remark_of(row), kind_of(row))
            if test.window is not None and path is not None:
                self._window(test, path)
        except FourpoleError as error:
            about = {FileError: "file", TableError: "channels"}.get(type(error), "recording")
            self._say(test, about, Verdict.REJECTED, str(error), f"{error.code} {error.site}")
        except MemoryError:
            self._say(test, about, Verdict.REJECTED, "does not fit into memory: cut it with window [s]")

    def statics(self) -> list[StaticRow]:
        """The rows of the static tests, evaluated as in the analysis."""
        rows = evaluate_statics(self.campaign)
        for row in rows:
            rejected = any(check.verdict is Verdict.REJECTED for check in row.checks)
            if rejected and not row.test.problem:
                about, text = "static test" if row.sha256 else "file", "; ".join(map(remark_of, row.checks))
                self._say(row.test, about, Verdict.REJECTED, text, kind_of(*row.checks))
        return rows

    def _say(self, test: Test, about: str, verdict: Verdict, message: str, kind: str = "") -> None:
        text = message.removeprefix(f"{test.table} row {test.row}: ")
        for label in (units.shown(test.file, 200)[1:-1], test.file):
            text = text.removeprefix(f"{label}: ").removeprefix(f"{label} ")
        problem = CampaignProblem(test.name, test.row, test.file, about, verdict, text, kind or text)
        self.problems[problem] = None

    def _window(self, test: Test, path: Path) -> None:
        """Check whether a window ends after the recording, by the first samples and the number of samples."""
        channels = self.campaign.stated.channels
        assert channels.motion_in is not None
        assert test.window is not None
        source = source_of(path, test, channels, [channels.motion_in])
        end = read_apart(end_of, path, replace(source, rows=_ROWS), label=test.file)
        if end is None:
            return
        (low, high), (stop, step) = test.window, end
        if high > stop + step:
            message = f"window {low:g}..{high:g} s goes beyond the recording, which ends at {stop:g} s; shorten it"
            self._say(test, "window", Verdict.WARNING, message)

    # --- the campaign as a whole ---------------------------------------------------------------------------------

    def duplicates(self) -> None:
        """Find two tests of one recording, or of two files with the same content."""
        sizes = Counter(path.stat().st_size for path in {*self.paths.values()})
        seen: dict[object, Test] = {}
        hashed: set[Path] = set()
        for test in self.campaign.tests:
            path = self.paths.get(test.name)
            if path is None:
                continue
            first, size = seen.setdefault((path, group_of(path, test.file), test.window), test), path.stat().st_size
            if first is not test:
                message = (
                    f"is the recording of test {units.shown(first.name)} (row {first.row}) too: name "
                    f"another file, group or window [s]"
                )
                self._say(test, "duplicate", Verdict.WARNING, message)
            if path in hashed or sizes[size] < 2 or size > _MOST_HASHED:
                continue
            hashed.add(path)
            first = seen.setdefault(sha256_of(path, max_bytes=MAX_FILE_BYTES, label=test.file), test)
            if first is not test:
                message = (
                    f"has the same content as {units.shown(first.file)} of test "
                    f"{units.shown(first.name)} (row {first.row}): is it a copy?"
                )
                self._say(test, "duplicate", Verdict.WARNING, message)

    def stiffness(self, statics: Sequence[StaticRow]) -> None:
        """Check whether each dynamic test has a K1."""
        bad = {problem.test for problem in self.problems if problem.verdict is Verdict.REJECTED}
        for test in self.campaign.tests:
            if test.kind != "dynamic" or test.name in bad:
                continue
            k1 = stiffness_for(test, statics, self.campaign.stated.sameness)
            if k1.lack is not None and expects_k1(self.campaign):
                text = "K2 and C would be left blank: {why}: {remedy}".format(**why_no_k1(k1.lack.values))
                self._say(test, "K1", Verdict.WARNING, text, kind_of(k1.lack))
            for check in k1.checks:
                if check.verdict is Verdict.WARNING:
                    self._say(test, "K1", Verdict.WARNING, remark_of(check), kind_of(check))
