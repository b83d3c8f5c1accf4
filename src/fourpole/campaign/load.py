"""The file of one test becomes SI channels, by what campaign.toml says of its columns."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fourpole import units
from fourpole.campaign.folder import Test
from fourpole.campaign.schema import ChannelsFile, Conversion
from fourpole.core.arrays import FloatArray
from fourpole.core.checks import clipped_share
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.recording import Channel, Recording, uniform_time
from fourpole.errors import FileError, TableError, UnitError
from fourpole.io.columns import Columns
from fourpole.io.recordings import read_recording

__all__ = ["inside", "load_curve", "load_recording"]

MOST_BYTES = 4_000_000_000


def inside(folder: Path, test: Test) -> Path:
    """Where the file of a test lies, which must be inside the campaign folder, links followed."""
    name = units.shown(test.file, 200)
    try:
        path = (folder / test.file).resolve()
        if "#" in test.file and not path.exists():
            path = (folder / test.file.rpartition("#")[0]).resolve()
        within = path.is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError) as error:
        raise FileError(f"file {name} cannot be looked up: {getattr(error, 'strerror', None) or error}") from None
    if not within:
        raise FileError(f"file {name} lies outside the campaign folder: copy it into the folder and name it from there")
    return path


def group_of(path: Path, test: Test) -> str:
    """The group that `file#group` names; empty where the file itself is named."""
    file, mark, group = test.file.rpartition("#")
    return group if mark and Path(file).name == path.name else ""


def load_recording(path: Path, test: Test, channels: ChannelsFile, roles: Sequence[str]) -> tuple[Recording, list[str]]:
    """The channels `roles` of a dynamic test, with remarks on its time base."""
    stated = {role: channels.named(role) for role in roles}
    names = [channel.column for channel in stated.values() if channel is not None]
    clock = _clock(channels)
    table = read_recording(path, names, clock=clock, group=group_of(path, test), max_bytes=MOST_BYTES, label=test.file)

    remarks: list[str] = []
    keep = slice(None)
    if clock is not None:
        time = _times(table, channels, clock)
        keep = _within(time, test.window)
        step, remark = uniform_time(time[keep])
        rate = 1.0 / step
        remarks += [remark] if remark else []
    else:
        rate = channels.rate or 1.0
        keep = _within(_times(table, channels, None), test.window)
    recorded = {
        role: _channel(table, channel.column, channel.unit, channels.conversion(role), keep)
        for role, channel in stated.items()
        if channel is not None
    }
    return Recording(rate, recorded, test.file), remarks


def load_curve(path: Path, test: Test, channels: ChannelsFile) -> LoadCurve:
    """The load-deflection curve of a static test."""
    load, deflection = channels.load, channels.deflection
    assert load is not None
    assert deflection is not None
    clock = _clock(channels) if test.window is not None else None
    table = read_recording(
        path,
        [load.column, deflection.column],
        clock=clock,
        group=group_of(path, test),
        max_bytes=MOST_BYTES,
        label=test.file,
    )
    keep = _within(_times(table, channels, clock), test.window) if test.window is not None else slice(None)
    force = _channel(table, load.column, load.unit, channels.conversion("load"), keep)
    travel = _channel(table, deflection.column, deflection.unit, channels.conversion("deflection"), keep)
    for name, channel in (("load", force), ("deflection", travel)):
        if channel.limits is not None and clipped_share(channel) > 0:
            raise TableError(f"{name} reaches the end of its stated range: repeat the test with a larger range")
    return LoadCurve(travel.samples, force.samples)


def _clock(channels: ChannelsFile) -> str | None:
    """Column of the time, if one is stated and not a sample rate."""
    return None if channels.rate is not None or channels.time is None else channels.time.column


def _times(table: Columns, channels: ChannelsFile, clock: str | None) -> FloatArray:
    """Time of each row [s], by its column or by the sample rate."""
    if clock is not None and channels.time is not None:
        return table[clock] * units.unit_scale(_agreed(table, clock, channels.time.unit, "time"), "time")
    if channels.rate is None:
        raise TableError("window [s] needs a time: state [channels] time or sample_rate in campaign.toml")
    return np.arange(len(table)) / channels.rate


def _within(time: FloatArray, window: tuple[float, float] | None) -> slice:
    if window is None:
        return slice(None)
    first, last = np.searchsorted(time, window)
    if last - first < 2:
        raise TableError(
            f"window {window[0]:g}..{window[1]:g} s holds no samples: the recording runs {time[0]:g} to {time[-1]:g} s"
        )
    return slice(int(first), int(last))


def _channel(table: Columns, column: str, unit: str | None, conversion: Conversion, keep: slice) -> Channel:
    if unit is not None:
        _agreed(table, column, unit, conversion.kind)
    samples = conversion.slope * (table[column][keep] - conversion.offset)
    return Channel(samples, conversion.kind, conversion.delay, conversion.limits)


def _agreed(table: Columns, column: str, unit: str, kind: str) -> str:
    """The campaign's unit, held against the file's own where both are of that kind and differ."""
    written = table.units.get(column)
    if written is None or written == unit:
        return unit
    try:
        differs = units.channel_scale(written, (kind, "voltage")) != units.channel_scale(unit, (kind, "voltage"))
    except UnitError:
        differs = units.is_unit(written)
    if differs:
        raise TableError(
            f"column {units.shown(column)} is in {units.shown(written)} by the file, "
            f"in {units.shown(unit)} by campaign.toml: correct the unit in campaign.toml"
        )
    return unit
