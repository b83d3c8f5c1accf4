"""The reduction of recordings: one job per recording gives phasors, checks and preview.

The heavy part, `demodulated`, needs the recording, and runs wherever `fourpole.study.workers` sends it; its result is
kept in the cache. The checks that depend on the rig and on other statements are made from it in `reduced_of`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fourpole import quantities as q
from fourpole.campaign.channels import CLASSES as CHANNEL_CLASSES
from fourpole.campaign.channels import ChannelsFile
from fourpole.campaign.folder import Campaign
from fourpole.campaign.place import at_hand, inside
from fourpole.campaign.row import Test, problem_of
from fourpole.campaign.schema import RigFile, Stated
from fourpole.core import recordingchecks as checks
from fourpole.core.checks import Check, Code, Verdict, fault_of, reported
from fourpole.core.demodulation.corrections import Correction
from fourpole.core.demodulation.demodulate import Demodulation, demodulate, first_guess
from fourpole.core.demodulation.preview import Preview, raw_preview
from fourpole.core.demodulation.steady import steady_part
from fourpole.core.demodulation.tracks import tracks_of
from fourpole.core.demodulation.wander import follow_wander, refine_reference
from fourpole.core.linearity import linearity_checks
from fourpole.core.phasor import CHANNELS, SYMBOLS, Phasors
from fourpole.core.recording import DRIVE, Recording
from fourpole.core.rig import Rig
from fourpole.core.spectra.excited import Excited
from fourpole.core.spectra.pooled import Sensors, check_pooled, check_shared_noise
from fourpole.core.spectra.random import random_amplitudes
from fourpole.core.spectra.sweep import sweep_amplitudes
from fourpole.core.spectra.verdicts import check_closure, check_line
from fourpole.errors import ConstantError, FileError, FourpoleError, Message, RecordingError, TableError, TooShortError
from fourpole.io.door import sha256_of
from fourpole.io.remote import permission
from fourpole.study.load import MOST_BYTES, load_recording, recorded_at
from fourpole.study.points import Demodulated, Points

#: Channels that each route needs.
ROUTE_NEEDS = {
    "joint": ("force_in", "motion_in"),
    "mobility": ("force_in", "motion_in"),
    "relative": CHANNELS,
    "transmissibility": ("motion_in", "motion_out"),
}

#: The parts of [channels] that the demodulation depends on.
_OF_DEMODULATION = ("time", "sample_rate", "reference", "drive", *CHANNELS)

#: The amplitudes of a recording that was rejected.
_UNKNOWN = Phasors(
    *(np.full(shape, np.nan, kind) for shape, kind in (
        (1, float), ((1, 3), complex), ((1, 6, 6), float), (1, float), (1, float),
    ))
)  # fmt: skip


@dataclass(frozen=True)
class Job:
    """The reduction of one recording, with all its inputs but the files; any executor can run it.

    Attributes
    ----------
    folder : Path
        The campaign folder; names of files are relative to it.
    test : Test
        The row of tests.csv.
    channels : ChannelsFile
        The channels as campaign.toml states them.
    rig : RigFile or None
        The rig of the test; None where it is not stated.
    needed : tuple of str
        Roles of the channels that the route needs.
    responses : dict of str to str
        Hash of each table of a calibrated response, by its name in the campaign.
    remote : str
        Prefixes of URLs that the user who sends the job allows to read.
    """

    folder: Path
    test: Test
    channels: ChannelsFile
    rig: RigFile | None
    needed: tuple[str, ...]
    responses: dict[str, str] = field(default_factory=dict)
    remote: str = ""

    @property
    def bench(self) -> Rig | None:
        """The rig as stated; None where it is not."""
        return self.rig.rig() if self.rig is not None else None

    @property
    def settings(self) -> list[object]:
        """What the demodulation depends on of tests.csv and the route; the rig is no part of it."""
        return [
            self.needed,
            self.test.file,
            self.test.value("frequency") or [self.test.kind, self.test.band],
            self.test.window,
        ]

    @property
    def processing(self) -> list[object]:
        """What the demodulation depends on of campaign.toml; no uncertainty is part of it."""
        return [self.channels.without_uncertainties(*_OF_DEMODULATION), self.responses]


#: The classes of which a job is made, for the worker process.
OF_WORK = (Job, Test, *CHANNEL_CLASSES, RigFile, Stated)


def jobs_of(campaign: Campaign, tests: Sequence[Test], route: str) -> list[Job]:
    """The job of each test, for a route."""
    channels, rigs, responses = campaign.stated.channels, campaign.stated.all_rigs, response_hashes(campaign)
    needed = ROUTE_NEEDS[route]
    folder = campaign.folder.absolute()  # a worker of a cluster has another working folder
    remote = permission(test.file for test in tests)
    return [Job(folder, test, channels, rigs.get(test.rig), needed, responses, remote) for test in tests]


def demodulated(job: Job) -> Demodulated:
    """The heavy part of a job: all that the recording gives, whatever the rig; an error is a check that rejects it."""
    sha256 = ""
    try:
        if job.test.problem:
            code = Code.EXCLUDED if job.test.excluded else Code.STATEMENT
            why = problem_of(job.test)
            return Demodulated(checks=(reported(code, Verdict.REJECTED, error=why),))
        with at_hand(job.folder, job.test.file) as path:
            sha256 = sha256_of(path, max_bytes=MOST_BYTES, label=job.test.file)
            return replace(demodulated_part(job, path), sha256=sha256, began=recorded_at(path))
    except FourpoleError as error:
        codes: dict[type, Code] = {ConstantError: Code.CONSTANT, TooShortError: Code.TOO_SHORT}
        code = codes.get(type(error), Code.RECORDING)
        check, lasting = reported(code, Verdict.REJECTED, error=error.message), isinstance(error, RecordingError)
        sha256 = "" if isinstance(error, FileError) else sha256  # no result of the content, which may be read again
    except Exception as error:  # noqa: BLE001 - a fault of ours in one test must not stop the others
        check, lasting = fault_of(error, job.test.file), False
    return Demodulated(checks=(check,), sha256=sha256, lasting=lasting)


def points_of(job: Job, done: Demodulated) -> Points:
    """The rows of one recording, with the checks that depend on the statement of the campaign."""
    found, rig = done.found, job.bench
    phasors, columns = _UNKNOWN, dict[str, np.ndarray]()
    checks: tuple[tuple[Check, ...], ...] = (done.checks,)
    corrections: tuple[tuple[Correction, ...], ...] = ((),)
    shown: tuple[tuple[str, ...], Preview] | None = None
    if isinstance(found, Demodulation):
        phasors, corrections, shown = (
            found.phasors.part(np.newaxis),
            (found.corrections,),
            (found.channels, found.preview),
        )
        checks = ((*done.checks, *_checks_of(job, found, done.mean_force, rig)),)
    elif found is not None:
        phasors, corrections, columns = found.phasors, found.corrections, _columns_of(found)
        shown = (CHANNELS[: len(found.preview.signals)], found.preview) if found.preview is not None else None
        checks = tuple(_checks_of_lines(job, done, found, rig))
    count = len(checks)
    return Points(
        tests=(job.test,) * count,
        phasors=phasors,
        checks=checks,
        corrections=corrections,
        previews=(shown, *(None,) * (count - 1)),
        began=np.full(count, np.nan if done.began is None else done.began),
        sha256=(done.sha256,) * count,
        columns=columns,
    )


def _columns_of(found: Excited) -> dict[str, np.ndarray]:
    """What the averaged spectra show of each line beside its amplitudes, by column of lines.csv."""
    columns: dict[str, np.ndarray] = {q.WIDTH.head: found.width, q.AVERAGES.head: found.averages}
    columns |= zip((one.head for one in q.COHERENCES), found.coherence.T, strict=True)
    columns |= zip(q.CLOSURE_PHASE.heads, found.closure.T, strict=True)
    for quantity, values in zip(q.ESTIMATES, found.estimates.T, strict=True):
        columns |= zip(quantity.parts, (values.real, values.imag), strict=True)
    return columns


def _checks_of_lines(job: Job, done: Demodulated, found: Excited, rig: Rig | None) -> Iterator[tuple[Check, ...]]:
    """The checks of each line; those of all lines together stand at the first, and at each line if they are not ok."""
    whole = [*done.checks, *_checks_of_force(job.test, found.force_peak, done.mean_force)]
    whole += [*check_closure(found), *check_shared_noise(found)]
    if rig is not None:
        whole += check_pooled(found, rig, job.test.added_mass, _sensors(job.channels))
    for line in range(found.averages.size):
        yield (*whole, *_checks_of_line(job, found, line, rig))
        if not line:
            whole = [check for check in whole if check.verdict is not Verdict.OK]


def _checks_of_line(job: Job, found: Excited, at: int, rig: Rig | None) -> Iterator[Check]:
    """The checks of one line; on a doubtful line, noise would look like a wrong sign of F1."""
    line, phasors = check_line(found, at), found.phasors.part(at)
    added = job.test.added_mass
    yield line
    if line.verdict is not Verdict.REJECTED and rig is not None and not rig.blocked:
        yield checks.check_resonance(float(phasors.frequency), rig, added)
        if line.verdict is Verdict.OK:
            yield checks.check_consistency(phasors, rig, added)


def _sensors(channels: ChannelsFile) -> Sensors:
    """Standard uncertainties of the channels F1 and V2, as stated."""
    both = [channels.named(role) for role in ("force_in", "motion_out")]
    stated = [one for one in both if one is not None]
    gains, phases, delays = ([getattr(one, name) for one in stated] for name in ("gain_std", "phase_std", "std_delay"))
    return Sensors(*(tuple([*values, 0.0, 0.0][:2]) for values in (gains, phases, delays)))


def demodulated_part(job: Job, path: Path, part: float | None = None) -> Demodulated:
    """Amplitudes of all stated channels; a damaged channel that the route does not need is left out with a warning.

    With `part` [s], only the first part of this length is used.
    """
    recording, rows = loaded(job, path, part)
    if job.test.band is not None:
        recording, clipped = unclipped(recording, job.needed)
        lines, left = _amplitudes(job.test, recording)
        return Demodulated(lines, (*rows, *clipped, *left), _mean_force(recording))
    near = job.test.value("frequency")
    start = None
    if job.test.window is None:
        recording, start, cut = _trimmed(recording, near)
        rows += cut
    recording, clipped = unclipped(recording, job.needed)
    rows += clipped
    try:
        found, wandering = _followed(recording, near, start)
    except RecordingError as error:
        present = [role for role in recording.channels if role not in job.needed]
        if not present:
            raise
        found, wandering = _followed(recording.without(present[0]), near, start)
        rows.append(_left_out(present[0], error.message))
    return Demodulated(found, (*rows, *wandering), _mean_force(recording))


def _amplitudes(test: Test, recording: Recording) -> tuple[Excited, list[Check]]:
    """Amplitudes at many frequencies; a drive that cannot be used is left out."""
    assert test.band is not None
    amplitudes = sweep_amplitudes if test.kind == "sweep" else random_amplitudes
    shown = _preview(recording)
    try:
        return replace(amplitudes(recording, test.band), preview=shown), []
    except RecordingError as error:
        if DRIVE not in recording.channels:
            raise
        found = amplitudes(recording.without(DRIVE), test.band)
        return replace(found, preview=shown), [_left_out(DRIVE, error.message)]


def _preview(recording: Recording) -> Preview | None:
    """The preview of a recording of many frequencies; None where its channels cannot be used together."""
    roles = [role for role in CHANNELS if role in recording.channels]
    try:
        tracks = tracks_of(recording, roles)
    except RecordingError:
        return None  # the amplitudes raise the same error
    return raw_preview(tracks[0], len(roles)) if len(tracks) == 1 else None


def _mean_force(recording: Recording) -> float:
    """Mean of F1 [N]; 0 where no force is recorded."""
    force = recording.channels.get("force_in")
    return float(np.nanmean(force.samples)) if force is not None and np.isfinite(force.samples).any() else 0.0


def loaded(job: Job, path: Path, part: float | None = None) -> tuple[Recording, list[Check]]:
    """The recording with all stated channels, or with the needed channels only, and its checks."""
    driven = (DRIVE,) if job.test.band is not None else ()
    roles = [role for role in (*driven, *CHANNELS) if job.channels.line(role) is not None]
    lacking = [role for role in job.needed if role not in roles]
    if lacking:
        route = next(route for route, needed in ROUTE_NEEDS.items() if needed == job.needed)
        fixed = '; if the far side is fixed, state [rig] with output = "blocked", and use --route mobility'
        raise TableError(
            f"the {route} route needs {lacking[0]}, which [channels] in campaign.toml does not state"
            + (fixed if route == "relative" and lacking == ["motion_out"] else "")
        )
    spare = [role for role in roles if role not in job.needed]
    tries = [roles, *([[role for role in roles if role != spare[0]], list(job.needed)] if spare else [])]
    failed: list[Message] = []
    while True:
        try:
            kept = tries[len(failed)]
            recording, remarks = load_recording(job.folder, path, job.test, job.channels, kept, part=part)
            break
        except TableError as error:
            failed.append(error.message)
            if len(failed) == len(tries):
                raise
    left = [_left_out(role, failed[1]) for role in spare[1:] if len(failed) > 1]
    left += [_left_out(spare[0], failed[0])] if failed else []
    return recording, left + [reported(Code.TIME_BASE, Verdict.WARNING, error=remark) for remark in remarks]


def _trimmed(recording: Recording, near: float | None) -> tuple[Recording, float | None, list[Check]]:
    """The steady part of a recording, the first guess of its frequency [Hz], and a check that states what was cut."""
    try:
        frequency = first_guess(recording, near)
        part = steady_part(recording, frequency)
    except RecordingError:
        return recording, None, []  # the demodulation raises the same error with its cause
    if part is None:
        return recording, frequency, []
    low, high = recording.span
    ends = {"before": part[0] - low, "after": high - part[1], "length": high - low}
    return recording.between(*part), None, [reported(Code.STEADY, Verdict.OK, **ends)]


def _followed(recording: Recording, near: float | None, start: float | None = None) -> tuple[Demodulation, list[Check]]:
    """Amplitudes from a first guess of the frequency [Hz], and a check of the speed.

    Without a reference, a frequency that wanders much is tracked along the phase of V1.
    """
    found = demodulate(recording, near=near, start=start)
    if recording.reference is not None:
        return refine_reference(recording, found), []
    followed = follow_wander(recording, found)
    if followed is None:
        return found, []
    better, wander = followed
    return better, [reported(Code.SPEED, Verdict.WARNING, wander.speed, 0.0, shift=wander.shift)]


def _left_out(role: str, because: Message | Check) -> Check:
    """The warning that a channel was left out."""
    return reported(Code.LEFT_OUT, Verdict.WARNING, np.nan, np.nan, SYMBOLS.get(role, role), because=because)


def unclipped(recording: Recording, needed: tuple[str, ...]) -> tuple[Recording, list[Check]]:
    """The recording without clipped channels that the route does not need, and the checks of clipped channels."""
    rows = []
    for role, channel in list(recording.channels.items()):
        if role == DRIVE:  # an instrument need not be linear
            continue
        row = checks.check_clipping(SYMBOLS[role], channel)
        if row.verdict is Verdict.OK:
            continue
        if role in needed:
            rows.append(row)
        else:
            recording = recording.without(role)
            rows.append(_left_out(role, row))
    return recording, rows


def _checks_of(job: Job, found: Demodulation, mean_force: float, rig: Rig | None) -> Iterator[Check]:
    """The checks of one demodulated test; a fault of a channel that the route does not need is a warning."""
    names = tuple(SYMBOLS[role] for role in CHANNELS)
    test, frequency = job.test, float(found.phasors.frequency)
    added = test.added_mass
    yield from linearity_checks(found.harmonics, frequency, rig, added)
    yield checks.check_frequency(frequency, test.value("frequency"))
    yield checks.check_gaps(found)
    yield from checks.check_spoilt(found, names)
    yield checks.check_halves(found, names)
    yield checks.check_mains(found)
    yield checks.check_distortion(found)
    spared = tuple(SYMBOLS[role] for role in CHANNELS if role not in job.needed)
    for row in (*checks.check_excitation(found, names), *checks.check_noise(found, names)):
        spare = row.verdict is Verdict.REJECTED and row.channel in spared
        yield replace(row, verdict=Verdict.WARNING) if spare else row
    yield from _checks_of_force(test, found.force_peak, mean_force)
    if rig is not None and not rig.blocked:
        yield checks.check_resonance(frequency, rig, added)
        yield checks.check_consistency(found.phasors, rig, added)


def _checks_of_force(test: Test, peak: float, mean: float) -> Iterator[Check]:
    """Compare the peak and the mean of F1 [N] with the preload."""
    if np.isfinite(peak):
        yield checks.check_lift_off(peak, test.value("preload"), fixed=test.fixed)
        yield checks.check_mean_force(mean, test.value("preload"))


def response_hashes(campaign: Campaign) -> dict[str, str]:
    """Hash of each table of a calibrated response that can be read, by its name in the campaign."""
    channels = (campaign.stated.channels.named(role) for role in CHANNELS)
    hashes = {}
    for name in {channel.response for channel in channels if channel is not None and channel.response is not None}:
        with suppress(FourpoleError):
            hashes[name] = sha256_of(inside(campaign.folder, name), max_bytes=MOST_BYTES, label=name)
    return hashes
