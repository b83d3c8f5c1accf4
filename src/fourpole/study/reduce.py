"""The reduction of recordings: one job per recording gives phasors, checks and preview.

The heavy part, `demodulated`, needs the recording, and runs wherever `fourpole.study.workers` sends it; its result is
kept in the cache. The checks that depend on the rig and on other statements are made from it in `points_of`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fourpole import quantities as q
from fourpole.campaign.channels import CLASSES as CHANNEL_CLASSES
from fourpole.campaign.channels import ChannelsFile
from fourpole.campaign.place import at_hand, inside
from fourpole.campaign.row import Test, problem_of
from fourpole.core import recordingchecks as checks
from fourpole.core.channelerrors import ChannelError, error_covariance
from fourpole.core.checks import Check, Code, Verdict, fault_of, reported
from fourpole.core.demodulation.corrections import Correction
from fourpole.core.demodulation.demodulate import Demodulation, demodulate, first_guess
from fourpole.core.demodulation.preview import Preview, raw_preview
from fourpole.core.demodulation.sinefit import fit_sines
from fourpole.core.demodulation.steady import steady_part
from fourpole.core.demodulation.tracks import Track, tracks_of
from fourpole.core.demodulation.wander import follow_wander, refine_reference
from fourpole.core.phasor import CHANNELS, SYMBOLS, Phasors
from fourpole.core.recording import DRIVE, Recording
from fourpole.core.recordingchecks import excess, force_bend, judged_excess
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind, Source
from fourpole.core.spectra.checks import check_closure, check_line, check_linearity, check_shared_noise
from fourpole.core.spectra.excited import Excited
from fourpole.core.spectra.nonlinear import nonlinear_share
from fourpole.core.spectra.random import random_amplitudes
from fourpole.core.spectra.sweep import sweep_amplitudes
from fourpole.errors import ConstantError, FileError, FourpoleError, Message, RecordingError, TableError, TooShortError
from fourpole.io.door import sha256_of
from fourpole.io.recordings import began_at
from fourpole.io.remote import permission
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.io.stream import ReadOnce, Stream, StreamSource, stream
from fourpole.study.load import load_recording
from fourpole.study.points import Demodulated, Points

if TYPE_CHECKING:
    from fourpole.campaign.folder import Campaign

#: Channels that each route needs.
ROUTE_NEEDS = {
    "joint": ("force_in", "motion_in"),
    "mobility": ("force_in", "motion_in"),
    "relative": CHANNELS,
    "transmissibility": ("motion_in", "motion_out"),
}

#: The parts of [channels] that the demodulation depends on.
_OF_DEMODULATION = ("time", "sample_rate", "reference", "drive", *CHANNELS)

#: The first part of a recording passes without demodulation if three values are below these limits: the residual over
#: the amplitude of each channel, the relative error of the stated frequency, and the force over the preload. The limits
#: of the checks that reject a test are much higher.
_PLAIN_NOISE, _PLAIN_OFF, _PLAIN_FORCE = 0.15, 0.03, 0.8
#: Smallest number of cycles for which the first part passes without demodulation, or shows a frequency.
_CYCLES_OF_PART = 4.0
#: Length of the first part [s], or its number of cycles if that is longer.
_PART, _MOST_CYCLES = 2.0, 20.0
#: The amplitudes of a recording that was rejected.
_UNKNOWN = Phasors(
    *(np.full(shape, np.nan, kind) for shape, kind in (
        (1, float), ((1, 3), complex), ((1, 6, 6), float), (1, float), (1, float),
    ))
)  # fmt: skip


@dataclass(frozen=True)
class Reduction:
    """The reduction of one recording, with all its inputs but the files; any executor can run it.

    Attributes
    ----------
    folder : Path
        The campaign folder; names of files are relative to it.
    test : Test
        The row of tests.csv.
    channels : ChannelsFile
        The channels as campaign.toml states them.
    rig : Rig or None
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
    rig: Rig | None
    needed: tuple[str, ...]
    responses: dict[str, str] = field(default_factory=dict)
    remote: str = ""

    @property
    def settings(self) -> list[object]:
        """What the demodulation depends on beside the file: neither the rig nor an uncertainty is part of it."""
        return [
            self.needed,
            self.test.file,
            self.test.value("frequency") or [self.test.kind, self.test.band],
            self.test.window,
            [self.channels.without_uncertainties(*_OF_DEMODULATION), self.responses],
        ]


#: The classes of which a job is made, for the worker process.
OF_WORK = (Reduction, Rig, Test, *CHANNEL_CLASSES)


def jobs_of(campaign: Campaign, tests: Sequence[Test], route: str) -> list[Reduction]:
    """The job of each test, for a route."""
    channels, responses, needed = campaign.stated.channels, response_hashes(campaign), ROUTE_NEEDS[route]
    rigs = {name: rig.rig() for name, rig in campaign.stated.all_rigs.items()}
    folder = campaign.folder.absolute()  # a worker of a cluster has another working folder
    remote = permission(test.file for test in tests)
    return [Reduction(folder, test, channels, rigs.get(test.rig), needed, responses, remote) for test in tests]


def demodulated(jobs: Sequence[Reduction]) -> list[Demodulated]:
    """The heavy part of jobs of one file, which is opened, hashed and read once: what it gives, whatever the rig."""
    with ExitStack() as stack:
        file = _File(stack, ReadOnce().stream if len(jobs) > 1 else stream)  # samples are held for further jobs only
        return [_demodulated(job, file) for job in jobs]


@dataclass
class _File:
    """The file of some jobs, once one of them has needed it: how it is read, its path, hash and time."""

    stack: ExitStack
    read: Callable[[StreamSource], Stream]
    path: Path | None = None
    sha256: str = ""
    began: float | None = None

    def opened(self, job: Reduction) -> Path:
        """The path of the file, for as long as the stack is open."""
        if self.path is None:
            path = self.stack.enter_context(at_hand(job.folder, job.test.file))
            self.sha256 = sha256_of(path, max_bytes=MAX_FILE_BYTES, label=job.test.file)
            self.path, self.began = path, began_at(path)
        return self.path


def _demodulated(job: Reduction, file: _File) -> Demodulated:
    """What a job gives; an error is a check that rejects it."""
    try:
        if job.test.problem:
            code = Code.EXCLUDED if job.test.excluded else Code.STATEMENT
            why = problem_of(job.test)
            return Demodulated(checks=(reported(code, Verdict.REJECTED, error=why),))
        done = demodulated_part(job, file.opened(job), read=file.read)
        return replace(done, sha256=file.sha256, began=file.began)
    except FourpoleError as error:
        codes: dict[type, Code] = {ConstantError: Code.CONSTANT, TooShortError: Code.TOO_SHORT}
        code = codes.get(type(error), Code.RECORDING)
        check, lasting = reported(code, Verdict.REJECTED, error=error.message), isinstance(error, RecordingError)
        # That a file cannot be read is no result of its content, which may be read again.
        sha256 = "" if isinstance(error, FileError) else file.sha256
    except Exception as error:  # noqa: BLE001 - a fault of ours in one test must not stop the others
        check, lasting, sha256 = fault_of(error, job.test.file), False, file.sha256
    return Demodulated(checks=(check,), sha256=sha256, lasting=lasting)


def points_of(job: Reduction, done: Demodulated) -> Points:
    """The rows of one recording, with the checks that depend on the statement of the campaign."""
    result = done.found
    phasors, columns = _UNKNOWN, dict[str, np.ndarray]()
    checks: tuple[tuple[Check, ...], ...] = (done.checks,)
    corrections: tuple[tuple[Correction, ...], ...] = ((),)
    shown: tuple[tuple[str, ...], Preview] | None = None
    if isinstance(result, Demodulation):
        found = excess(result.harmonics, float(result.phasors.omega), job.rig, job.test.added_mass)
        phasors, corrections = _with_bend(result.phasors, found).part(np.newaxis), (result.corrections,)
        shown = (result.channels, result.preview)
        cell = job.channels.force_in
        bent = judged_excess(found, (cell and cell.linearity) or 0.0)
        checks = ((*done.checks, *bent, *_checks_of_sine(job, result, done.mean_force)),)
    elif result is not None:
        phasors, corrections, columns = result.phasors, result.corrections, _columns_of(result)
        roles = tuple(np.array(CHANNELS)[np.isfinite(result.phasors.amplitudes).any(axis=0)].tolist())
        shown = (roles, result.preview) if result.preview is not None else None
        checks = tuple(_checks_of_lines(job, result, done))
    count = len(checks)
    return Points(
        tests=(job.test,) * count,
        phasors=phasors,
        checks=checks,
        corrections=corrections,
        previews=(shown, *(None,) * (count - 1)),
        began=np.full(count, np.nan if done.began is None else done.began + (job.test.window or (0.0,))[0]),
        sha256=(done.sha256,) * count,
        columns=columns,
    )


def _with_bend(phasors: Phasors, found: tuple[float, float, bool]) -> Phasors:
    """The amplitudes, with the error of F1 that the harmonics of a cell that is not linear show."""
    bend = force_bend(found)
    if not bend:
        return phasors
    error = ChannelError(Source(Kind.GAIN, "F1"), "1", 0, bend, np.ones(1, dtype=complex))
    return replace(phasors, covariance=phasors.covariance + error_covariance(error, phasors.amplitudes[None])[0])


def _columns_of(lines: Excited) -> dict[str, np.ndarray]:
    """What the averaged spectra show of each line beside its amplitudes, by column of lines.csv."""
    columns: dict[str, np.ndarray] = {q.WIDTH.head: lines.width, q.AVERAGES.head: lines.averages}
    columns |= zip((quantity.head for quantity in q.COHERENCES), lines.coherence.T, strict=True)
    columns |= zip(q.CLOSURE_PHASE.heads, lines.closure.T, strict=True)
    for quantity, values in zip(q.ESTIMATES, lines.estimates.T, strict=True):
        columns |= zip(quantity.parts, (values.real, values.imag), strict=True)
    return columns


def _checks_of_lines(job: Reduction, lines: Excited, done: Demodulated) -> Iterator[tuple[Check, ...]]:
    """The checks of each line; those of all lines together stand at the first, and at each line if they are not ok.

    On a doubtful line, noise would look like a wrong sign of F1.
    """
    rig, added = job.rig, job.test.added_mass
    whole = [*done.checks, *_checks_of_force(job.test, lines.force_peak, done.mean_force)]
    whole += [*check_linearity(lines), *check_closure(lines), *check_shared_noise(lines)]
    for line in range(lines.averages.size):
        check, phasors = check_line(lines, line), lines.phasors.part(line)
        of_line = [check]
        if check.verdict is not Verdict.REJECTED and rig is not None and not rig.blocked:
            of_line.append(checks.check_resonance(float(phasors.frequency), rig, added))
            if check.verdict is Verdict.OK:
                of_line.append(checks.check_consistency(phasors, rig, added))
        yield (*whole, *of_line)
        if not line:
            whole = [check for check in whole if check.verdict is not Verdict.OK]


def demodulated_part(
    job: Reduction, path: Path, part: float | None = None, read: Callable[[StreamSource], Stream] = stream
) -> Demodulated:
    """Amplitudes of all stated channels; a damaged channel that the route does not need is left out with a warning.

    With `part` [s], only the first part of this length is used.
    """
    recording, made = loaded(job, path, part, read)
    start, steady, many = None, None, job.test.band is not None
    if job.test.window is None and not many:
        with suppress(RecordingError):  # the demodulation raises the same error with its cause
            guess = first_guess(recording, job.test.value("frequency"))
            steady = steady_part(recording, guess)
            start = guess if steady is None else None
    if steady is not None:
        low, high = recording.span
        ends = {"before": steady[0] - low, "after": high - steady[1], "length": high - low}
        recording = recording.between(*steady)
        made.append(reported(Code.STEADY, Verdict.OK, **ends))
    recording, clipped = unclipped(recording, job.needed)
    made += clipped
    try:
        result, wandering = _amplitudes(job.test, recording, start)
    except RecordingError as error:
        spare = [role for role in recording.channels if (role == DRIVE if many else role not in job.needed)]
        if not spare:
            raise
        result, wandering = _amplitudes(job.test, recording.without(spare[0]), start)
        made.append(_left_out(spare[0], error.message))
    force = recording.channels.get("force_in")
    known = np.zeros(1) if force is None else force.samples
    if not np.isfinite(mean := float(known.mean())):
        known = known[np.isfinite(known)]
        mean = float(known.mean()) if known.size else 0.0
    return Demodulated(result, (*made, *wandering), mean)


def _amplitudes(test: Test, recording: Recording, start: float | None) -> tuple[Demodulation | Excited, list[Check]]:
    """Amplitudes at one frequency, from a first guess of it [Hz], or at many; and a check of the speed.

    Without a reference, a frequency that wanders much is tracked along the phase of V1.
    """
    if test.band is not None:
        amplitudes = sweep_amplitudes if test.kind == "sweep" else random_amplitudes
        lines = amplitudes(recording, test.band)
        lines = lines.with_distortion(nonlinear_share(recording, test.band, lines))
        return replace(lines, preview=_preview(recording)), []
    steady = demodulate(recording, near=test.value("frequency"), start=start)
    if recording.reference is not None:
        return refine_reference(recording, steady), []
    followed = follow_wander(recording, steady)
    if followed is None:
        return steady, []
    better, wander = followed
    return better, [reported(Code.SPEED, Verdict.WARNING, wander.speed, 0.0, shift=wander.shift)]


def _preview(recording: Recording) -> Preview | None:
    """The preview of a recording of many frequencies; None where its channels cannot be used together."""
    roles = [role for role in CHANNELS if role in recording.channels]
    try:
        tracks = tracks_of(recording, roles)
    except RecordingError:
        return None
    return raw_preview(tracks[0], len(roles)) if len(tracks) == 1 else None


def loaded(
    job: Reduction, path: Path, part: float | None = None, read: Callable[[StreamSource], Stream] = stream
) -> tuple[Recording, list[Check]]:
    """The recording with all stated channels, or with the needed channels only, and its checks."""
    roles = _stated_roles(job)
    spare = [role for role in roles if role not in job.needed]
    tries = [roles, *([[role for role in roles if role != spare[0]], list(job.needed)] if spare else [])]
    failed: list[Message] = []
    while True:
        try:
            kept = tries[len(failed)]
            recording, remarks = load_recording(job.folder, path, job.test, job.channels, kept, part=part, read=read)
            break
        except TableError as error:
            failed.append(error.message)
            if len(failed) == len(tries):
                raise
    # The second attempt is without the first spare channel, the third without any.
    lost = [(role, failed[1]) for role in spare[1:]] if len(failed) > 1 else []
    lost += [(spare[0], failed[0])] if failed else []
    timed = [reported(Code.TIME_BASE, Verdict.WARNING, error=remark) for remark in remarks]
    tilted = [checks.check_tilt(SYMBOLS[role], one.tilt) for role, one in recording.channels.items() if one.tilt]
    return recording, [*(_left_out(role, because) for role, because in lost), *timed, *tilted]


def _stated_roles(job: Reduction) -> list[str]:
    """Roles of the channels that [channels] states; TableError if the route needs another one."""
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
    return roles


def _left_out(role: str, because: Message | Check) -> Check:
    """The warning that a channel was left out."""
    return reported(Code.LEFT_OUT, Verdict.WARNING, np.nan, np.nan, SYMBOLS.get(role, role), because=because)


def unclipped(recording: Recording, needed: tuple[str, ...]) -> tuple[Recording, list[Check]]:
    """The recording without clipped channels that the route does not need, and the checks of clipped channels."""
    clipped = []
    for role, channel in list(recording.channels.items()):
        if role == DRIVE:  # an instrument need not be linear
            continue
        check = checks.check_clipping(SYMBOLS[role], channel)
        if check.verdict is Verdict.OK:
            continue
        if role in needed:
            clipped.append(check)
        else:
            recording = recording.without(role)
            clipped.append(_left_out(role, check))
    return recording, clipped


def _checks_of_sine(job: Reduction, result: Demodulation, mean_force: float) -> Iterator[Check]:
    """The checks of one demodulated test; a fault of a channel that the route does not need is a warning."""
    names = tuple(SYMBOLS[role] for role in CHANNELS)
    test, rig, frequency = job.test, job.rig, float(result.phasors.frequency)
    added = test.added_mass
    yield checks.check_frequency(frequency, test.value("frequency"))
    yield checks.check_gaps(result)
    yield from checks.check_spoilt(result, names)
    yield checks.check_halves(result, names)
    yield checks.check_mains(result)
    yield checks.check_distortion(result)
    spared = tuple(SYMBOLS[role] for role in CHANNELS if role not in job.needed)
    for check in (*checks.check_excitation(result, names), *checks.check_noise(result, names)):
        spare = check.verdict is Verdict.REJECTED and check.channel in spared
        yield replace(check, verdict=Verdict.WARNING) if spare else check
    yield from _checks_of_force(test, result.force_peak, mean_force)
    if rig is not None and not rig.blocked:
        yield checks.check_resonance(frequency, rig, added)
        yield checks.check_consistency(result.phasors, rig, added)


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
            hashes[name] = sha256_of(inside(campaign.folder, name), max_bytes=MAX_FILE_BYTES, label=name)
    return hashes


# --- the first part of a recording, by which a campaign is checked before its analysis --------------------------------


def check_part(job: Reduction) -> tuple[Check, ...]:
    """Checks of the first part of a recording that reject the test or leave out a channel.

    The part has at most 2 s or 20 cycles, whichever is longer. If no frequency is stated, the cycles are those of the
    frequency that the recording shows. An error that would reject the test is raised.
    """
    near, windowed = job.test.value("frequency"), job.test.window is not None
    with at_hand(job.folder, job.test.file) as path:
        if job.test.band is not None:
            return tuple(loaded(job, path, _PART)[1])
        recording, rows = loaded(job, path, max(0.5, 10.0 / near) if near else _PART)
        if not windowed and all(np.ptp(channel.samples) == 0.0 for channel in recording.channels.values()):
            return (reported(Code.CONSTANT, Verdict.WARNING, at_first=True),)
        recording, clipped = unclipped(recording, job.needed)
        shown = (*rows, *clipped)
        if not _is_plain(job, recording):
            cycles = _MOST_CYCLES / (near or _shown_frequency(job, path, recording))
            (shown,) = points_of(job, demodulated_part(job, path, max(_PART, cycles))).checks
    return tuple(_of_interest(shown, windowed=windowed))


def _of_interest(checks: Sequence[Check], *, windowed: bool) -> Iterator[Check]:
    """The rejections, then the channels that are left out.

    The drive may start after the first part, because the analysis cuts a lead-in: V1 does not move then.
    """
    moved = [check for check in checks if check.code is Code.EXCITATION and check.channel == SYMBOLS["motion_in"]]
    runs = windowed or all(check.verdict is Verdict.OK for check in moved)
    for check in checks:
        if check.verdict is Verdict.REJECTED:
            later = replace(check, verdict=Verdict.WARNING, values={**check.values, "at_first": True})
            yield check if runs else later
    yield from (check for check in checks if check.verdict is Verdict.WARNING and check.code is Code.LEFT_OUT)


def _shown_frequency(job: Reduction, path: Path, recording: Recording) -> float:
    """Frequency of the drive [Hz], from the first part; its length is doubled until it has enough cycles."""
    length = _PART
    while (frequency := first_guess(recording)) * length < _CYCLES_OF_PART and recording.duration > 0.9 * length:
        length *= 2.0
        recording, _ = loaded(job, path, length)
    return frequency


def _is_plain(job: Reduction, recording: Recording) -> bool:
    """Whether a sine fit at a first guess of the frequency shows that no check rejects the recording."""
    near, preload, rig = job.test.value("frequency"), job.test.value("preload"), job.rig
    if any(channel.chain or channel.crosstalk for channel in recording.channels.values()):
        return False  # the correction of amplitudes may raise an error
    try:
        frequency = first_guess(recording, near)
        tracks = tracks_of(recording, list(recording.channels))
    except RecordingError:
        return False
    off = abs(frequency / near - 1) if near else 0.0
    light = preload is not None and not job.test.fixed and recording.force_peak > _PLAIN_FORCE * preload
    if frequency * recording.duration < _CYCLES_OF_PART or off > _PLAIN_OFF or light:
        return False
    steady = rig is None or checks.check_resonance(frequency, rig, job.test.added_mass).verdict is Verdict.OK
    return steady and all(_is_sine(track, frequency) for track in tracks)


def _is_sine(track: Track, frequency: float) -> bool:
    """Whether each channel of a track is a sine with a small residual."""
    fit = fit_sines(track, 2 * np.pi * frequency, 1, np.empty(0))
    left = np.sqrt(2 * np.mean(fit.residual**2, axis=1))
    return bool(np.all(left < _PLAIN_NOISE * np.abs([harmonics[0] for harmonics in fit.amplitudes()])))
