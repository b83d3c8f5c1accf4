"""One recording read by itself, without an analysis; and what it holds beside its fundamental."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fourpole import units
from fourpole.campaign.channels import CLASSES as CHANNEL_CLASSES
from fourpole.campaign.channels import ChannelsFile
from fourpole.campaign.folder import Campaign
from fourpole.campaign.place import check_text
from fourpole.campaign.row import Test
from fourpole.campaign.schema import parse_campaign
from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.chain import Calibrated, Delay, Geophone, HighPass, LowPass
from fourpole.core.phasor import CHANNELS
from fourpole.core.recording import Channel, CrossTalk, Recording
from fourpole.core.reference import Reference
from fourpole.errors import CampaignError, FileError
from fourpole.io.child import read_apart
from fourpole.io.folders import resolved
from fourpole.study.load import load_recording

#: Largest number of samples of a channel that are looked at, from its middle.
_MOST = 1 << 18
#: Largest number of lines that are shown; of more, the largest of neighbours is.
_LINES = 1000


def read_recording(file: str | Path, channels: Mapping[str, str | Mapping[str, Any]] | Campaign) -> Recording:
    r"""Read the file of one dynamic test, in any format that Fourpole reads, as channels in SI units.

    Parameters
    ----------
    file : path
        The recording; ``file#group`` names one group of a file that holds several. A relative path is looked up in
        the campaign's folder too.
    channels : dict of str to str, or Campaign
        The column of each role: ``motion_in`` and, if measured, ``force_in``, ``motion_out`` and ``reference``; also
        ``time`` or ``sample_rate`` if the file states no times. A column is its name with its unit, ``"F1 [N]"``; the
        unit is not needed if the file states it. A column can also be a table with the keys of ``[channels]`` in
        campaign.toml. A Campaign supplies its ``[channels]``, and the window and frequency of the row of tests.csv
        that names the file.

    Returns
    -------
    Recording
        The channels stated, gain, offset and inversion applied.

    Raises
    ------
    CampaignError
        If `channels` cannot be understood, or lacks ``motion_in``.
    FileError
        If there is no such file.
    TableError
        If the file cannot be read or lacks a column.
    RecordingError
        If the samples have no uniform times.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.NamedTemporaryFile("w", suffix=".csv", delete=False) as file:
    ...     _ = file.write("t [s],F1 [N],V1 [mm/s]\n")
    ...     for i in range(100):
    ...         _ = file.write(f"{i / 50},{10 * (-1) ** i},{i}\n")
    >>> recording = read_recording(file.name, {"time": "t", "force_in": "F1", "motion_in": "V1"})
    >>> recording.duration, recording.channels["motion_in"].samples[:3].tolist()
    (2.0, [0.0, 0.001, 0.002])
    >>> Path(file.name).unlink()
    """
    if isinstance(channels, Campaign):
        stated, test = channels.stated.channels, _row(channels, str(file))
        folder = channels.folder
    else:
        columns = {role: _column(role, text) for role, text in channels.items()}
        stated = parse_campaign({"channels": columns}, "read_recording").channels
        folder, test = Path(), Test(Path(file).name, 0, str(file), "dynamic")
    if stated.motion_in is None:
        raise CampaignError('read_recording: motion_in is missing: name its column, as in {"motion_in": "V1 [m/s]"}')
    path = _path(folder, str(file))
    roles = [role for role in CHANNELS if stated.named(role) is not None]
    recording: Recording = read_apart(
        recording_of, path, folder.absolute(), test, stated, roles, classes=_CLASSES, label=test.file
    )
    return recording


#: The classes of what a worker process is told of a recording, and of which the recording is made.
OF_WORK = (Test, *CHANNEL_CLASSES)
_CLASSES = (Recording, Channel, CrossTalk, Reference, Delay, HighPass, LowPass, Geophone, Calibrated)


def recording_of(path: Path, folder: Path, test: Test, channels: ChannelsFile, roles: list[str]) -> Recording:
    """The recording of a file, as a worker process reads it."""
    return load_recording(folder, path, test, channels, roles)[0]


def _column(role: str, text: str | Mapping[str, Any]) -> Any:
    """The channel of a role, in the form of campaign.toml."""
    if not isinstance(text, str) or role == "sample_rate":
        return text
    column, unit = units.column_unit(text)
    return {"column": column} | ({} if unit is None else {"unit": unit})


def _row(campaign: Campaign, file: str) -> Test:
    """The row of tests.csv that names the file, or a row without further values."""
    given = resolved(campaign.folder / file)
    for test in campaign.tests:
        if test.kind != "static" and (test.file == file or _resolved(campaign.folder, test.file) == given):
            return test
    return Test(Path(file).name, 0, file, "dynamic")


def _resolved(folder: Path, file: str) -> Path | None:
    """The path of a file of a campaign with its links resolved; None if its text names none."""
    with suppress(FileError):
        check_text(folder, file)
        return resolved(folder / file)
    return None


def _path(folder: Path, file: str) -> Path:
    """Path of the file: as given or relative to the folder; a "#group" at its end is removed. FileError if none is."""
    for name in (file, file.rpartition("#")[0]):
        for path in (Path(name), folder / name):
            if name and path.is_file():
                return path
    raise FileError(f"{units.shown(file, 200)[1:-1]}: there is no such file")


# --- hum, harmonics and noise, over frequency -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ResidualSpectrum(ByValue):
    """The residual of one channel.

    Attributes
    ----------
    frequency : (n,) float array [Hz]
    amplitude : (n,) float array [the channel's SI unit]
        Amplitude of a sine that would show this line, 0 to peak.
    """

    frequency: FloatArray
    amplitude: FloatArray


def residual_spectrum(recording: Recording, frequency: float, role: str) -> ResidualSpectrum:
    """Spectrum of a channel less its mean and its fundamental.

    The fundamental is the least-squares fit of a sine at the frequency; the window is Hann's, so that a line has its
    amplitude at its peak within 15 %.

    Parameters
    ----------
    recording : Recording
    frequency : float [Hz]
        Frequency of the fundamental.
    role : str
        The channel: force_in, motion_in or motion_out.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> hum = 0.01 * np.cos(2 * np.pi * 50 * t)
    >>> recording = Recording.from_arrays(t, force_in=hum, motion_in=np.cos(62.8 * t) + hum)
    >>> spectrum = residual_spectrum(recording, 62.8 / (2 * np.pi), "motion_in")
    >>> peak = int(np.argmax(spectrum.amplitude))
    >>> round(float(spectrum.frequency[peak])), round(float(spectrum.amplitude[peak]), 4)
    (50, 0.01)
    """
    samples, rate = recording.channels[role].samples, recording.base(role)[0]
    begin = max(0, (samples.size - _MOST) // 2)
    middle = samples[begin : begin + _MOST]
    samples = np.where(np.isfinite(middle), middle, np.nanmean(middle))
    t = np.arange(samples.size) / rate
    waves = np.stack([np.cos(2 * np.pi * frequency * t), np.sin(2 * np.pi * frequency * t), np.ones_like(t)], axis=1)
    residual = samples - waves @ np.linalg.lstsq(waves, samples, rcond=None)[0]
    window = np.hanning(samples.size)
    amplitude = 2 * np.abs(np.fft.rfft(residual * window)) / window.sum()
    lines, step = np.fft.rfftfreq(samples.size, 1 / rate), -(-amplitude.size // _LINES)
    starts = range(0, lines.size, step)
    highest = [begin + int(np.argmax(amplitude[begin : begin + step])) for begin in starts]
    return ResidualSpectrum(lines[highest], amplitude[highest])
