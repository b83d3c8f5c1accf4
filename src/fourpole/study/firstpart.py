"""The first part of a recording, by which a campaign is checked before its analysis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fourpole.campaign.place import at_hand
from fourpole.core.checks import Check, Code, Verdict, reported
from fourpole.core.demodulation.demodulate import first_guess
from fourpole.core.demodulation.sinefit import fit_sines
from fourpole.core.demodulation.tracks import Track, tracks_of
from fourpole.core.phasor import SYMBOLS
from fourpole.core.recording import Recording
from fourpole.core.recordingchecks import check_resonance
from fourpole.errors import RecordingError
from fourpole.study.reduce import Job, demodulated_part, loaded, points_of, unclipped

#: The first part of a recording passes without demodulation if three values are below these limits: the residual over
#: the amplitude of each channel, the relative error of the stated frequency, and the force over the preload. The limits
#: of the checks that reject a test are much higher.
_PLAIN_NOISE, _PLAIN_OFF, _PLAIN_FORCE = 0.15, 0.03, 0.8
#: Smallest number of cycles for which the first part passes without demodulation, or shows a frequency.
_CYCLES_OF_PART = 4.0
#: Length of the first part [s], or its number of cycles if that is longer.
_PART, _MOST_CYCLES = 2.0, 20.0


def check_part(job: Job) -> tuple[Check, ...]:
    """Checks of the first part of a recording that reject the test or leave out a channel.

    The part has at most 2 s or 20 cycles, whichever is longer. If no frequency is stated, the cycles are those of the
    frequency that the recording shows. An error that would reject the test is raised.
    """
    with at_hand(job.folder, job.test.file) as path:
        return _checks_of_part(job, path)


def _checks_of_part(job: Job, path: Path) -> tuple[Check, ...]:
    if job.test.band is not None:
        return tuple(loaded(job, path, _PART)[1])
    near = job.test.value("frequency")
    length = max(0.5, 10.0 / near) if near else _PART
    recording, rows = loaded(job, path, length)
    if job.test.window is None and all(np.ptp(channel.samples) == 0.0 for channel in recording.channels.values()):
        return (reported(Code.CONSTANT, Verdict.WARNING, at_first=True),)
    recording, clipped = unclipped(recording, job.needed)
    rows += clipped
    shown = tuple(rows)
    if not _is_plain(job, recording):
        cycles = _MOST_CYCLES / (near or _shown_frequency(job, path, recording))
        (shown,) = points_of(job, demodulated_part(job, path, max(_PART, cycles))).checks
    return tuple(_of_interest(shown, windowed=job.test.window is not None))


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


def _shown_frequency(job: Job, path: Path, recording: Recording) -> float:
    """Frequency of the drive [Hz], from the first part; its length is doubled until it has enough cycles."""
    length = _PART
    while (frequency := first_guess(recording)) * length < _CYCLES_OF_PART and recording.duration > 0.9 * length:
        length *= 2.0
        recording, _ = loaded(job, path, length)
    return frequency


def _is_plain(job: Job, recording: Recording) -> bool:
    """Whether a sine fit at a first guess of the frequency shows that no check rejects the recording."""
    near, preload, rig = job.test.value("frequency"), job.test.value("preload"), job.bench
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
    steady = rig is None or check_resonance(frequency, rig, job.test.added_mass).verdict is Verdict.OK
    return steady and all(_is_sine(track, frequency) for track in tracks)


def _is_sine(track: Track, frequency: float) -> bool:
    """Whether each channel of a track is a sine with a small residual."""
    fit = fit_sines(track, 2 * np.pi * frequency, 1, np.empty(0))
    left = np.sqrt(2 * np.mean(fit.residual**2, axis=1))
    return bool(np.all(left < _PLAIN_NOISE * np.abs([row[0] for row in fit.amplitudes()])))
