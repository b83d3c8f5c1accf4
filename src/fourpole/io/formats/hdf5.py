"""HDF5: one group per recording, which holds one dataset per channel.

A file in the following layout states everything that is needed::

    /run1              a group, called `file#run1`; attributes rate, start and time count for all in it
    /run1/F1           (n,) numbers, with the attributes
                         unit   "N"
                         rate   2048.0          samples per second, or
                         time   "t"             the dataset of the same group with the time of each sample
                         start  0.0             seconds at the first sample, from the file's own zero
    /run1/t            (n,) numbers, its unit "s"

In other files any dataset with one row of numbers is a channel. Its attributes may be called `units`; `sample_rate`,
`sampling_rate`, `fs`, or `dt`, `increment` for the step; `t0`, `offset`. A dataset called `t` or `time` in the same
group and of the same length states its times. Datasets at the top of the file are in no group.

Nothing is read outside the file: links to other files, samples kept in other files and virtual datasets are refused,
and so are filters that are not part of HDF5 itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import RATES, STEPS, UNITS, afford, find, is_time, of_name, tidy, time_scale
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, remembered, track_format
from fourpole.io.signals import FileInfo, Request, SignalInfo
from fourpole.units import shown

_KIND = "an HDF5 file"
_LIBRARY = "h5py"
_STARTS = ("start", "t0", "offset", "start_offset")
_NOTES = ("note", "comment", "description", "title", "long_name")
_MOST_OBJECTS = 100_000
_DEEPEST = 32
_MOST_HOPS = 8
_FILTERS = frozenset({1, 2, 3, 4, 5, 6, 32000})
_LONGEST_TEXT = 4096


@dataclass(frozen=True)
class Leaf:
    """A dataset of a file, or a link that cannot be followed."""

    group: str
    name: str
    dataset: Any
    barred: str
    """The reason why it cannot be read; empty if it can."""
    inherited: dict[str, Any]
    """The attributes of its group."""

    @property
    def path(self) -> str:
        """The name of the dataset with those of its groups."""
        return f"{self.group}/{self.name}" if self.group else self.name


def leaves(h5py: Any, root: Any, name: str) -> list[Leaf]:
    """The datasets of a file, each of them once; no link out of the file is followed."""
    found: list[Leaf] = []
    seen = {h5py.h5o.get_info(root.id).addr}
    waiting: list[tuple[str, Any]] = [("", root)]
    count = 0
    while waiting:
        path, group = waiting.pop(0)
        inherited = attributes(h5py, group)
        for key in group:
            count += 1
            if count > _MOST_OBJECTS:
                raise TableError(f"{name}: has more than {_MOST_OBJECTS} objects; split it")
            thing, barred = _resolved(h5py, root, group, key)
            if barred:
                found.append(Leaf(path, key, None, barred, inherited))
            elif isinstance(thing, h5py.Dataset):
                found.append(Leaf(path, key, thing, _barred(h5py, thing), inherited))
            elif isinstance(thing, h5py.Group) and (address := h5py.h5o.get_info(thing.id).addr) not in seen:
                seen.add(address)
                below = f"{path}/{key}" if path else key
                if below.count("/") >= _DEEPEST:
                    raise TableError(f"{name}: has groups more than {_DEEPEST} deep; this is no recording")
                waiting.append((below, thing))
    return found


def leaf_of(h5py: Any, dataset: Any) -> Leaf:
    """The leaf of a dataset that a reference, not a name, leads to."""
    return Leaf("", "", dataset, _barred(h5py, dataset), {})


def _resolved(h5py: Any, root: Any, group: Any, key: str, hops: int = 0) -> tuple[Any, str]:
    """The object that a name leads to, and the reason why it is not opened (empty if it is)."""
    try:
        link = group.get(key, getlink=True)
        if isinstance(link, h5py.HardLink):
            return group[key], ""
        if not isinstance(link, h5py.SoftLink):
            return None, "leads to another file, which is not followed; copy the samples into this one"
        if hops >= _MOST_HOPS:
            return None, "is a link that leads nowhere"
        parts = [part for part in link.path.split("/") if part not in ("", ".")]
        at = root if link.path.startswith("/") else group
        for part in parts[:_DEEPEST]:
            at, barred = _resolved(h5py, root, at, part, hops + 1)
            if barred:
                return None, barred
    except (KeyError, OSError, RuntimeError, TypeError, ValueError, AttributeError):
        return None, "cannot be opened: it is damaged, or a link that leads nowhere"
    return at, ""


def is_elsewhere(h5py: Any, dataset: Any) -> bool:
    """Whether the samples of a dataset are stored in other files."""
    plan = dataset.id.get_create_plist()
    return bool(plan.get_layout() == h5py.h5d.VIRTUAL or plan.get_external_count() > 0)


def _barred(h5py: Any, dataset: Any) -> str:
    """The reason why a dataset is no channel, or must not be read; empty if there is none."""
    plan = dataset.id.get_create_plist()
    if is_elsewhere(h5py, dataset):
        return "has its samples in another file, which is not read; copy them into this one"
    strange = [plan.get_filter(at)[0] for at in range(plan.get_nfilters())]
    strange = [one for one in strange if one not in _FILTERS]
    if strange:
        return f"is compressed by the filter {strange[0]}, which is no part of HDF5; repack it with GZIP"
    try:
        kind, shape = dataset.dtype.kind, dataset.shape
    except (TypeError, ValueError, OSError, RuntimeError):
        return "is of a kind that is not known"
    if kind not in "fiu" or shape is None:
        return "holds no numbers" if kind != "c" else "holds complex numbers"
    return ""


def attributes(h5py: Any, thing: Any) -> dict[str, Any]:
    """Those known attributes of an object whose value is one short text or one number."""
    found: dict[str, Any] = {}
    for key in (*UNITS, *RATES, *STEPS, *_STARTS, *_NOTES, "time", "MATLAB_class", "MATLAB_empty"):
        if key in thing.attrs:
            value = _attribute(h5py, thing, key)
            if value is not None:
                found[key] = value
    return found


def _attribute(h5py: Any, thing: Any, key: str) -> str | float | None:
    handle = thing.attrs.get_id(key)
    if int(np.prod(handle.shape, dtype=object)) != 1 or handle.dtype.itemsize > _LONGEST_TEXT:
        return None
    text = h5py.check_string_dtype(handle.dtype) is not None
    if not text and handle.dtype.kind not in "fiu":
        return None
    value = np.asarray(thing.attrs[key]).ravel()[0]
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    return str(value) if text else float(value)


def samples(leaf: Leaf, max_bytes: int, name: str) -> NDArray[np.float64]:
    """The numbers of a dataset in its own shape, as floats."""
    _check(leaf, max_bytes, name)
    shape = tuple(leaf.dataset.shape)
    afford(8 * int(np.prod(shape, dtype=object)), max_bytes, name, shown(leaf.path))
    values = np.empty(shape)
    if leaf.dataset.size:
        leaf.dataset.read_direct(values)
    return values


def reader(leaf: Leaf, max_bytes: int, name: str, *, row: int | None = None, axis: int = 0) -> Part:
    """The function that reads a part of a dataset with one row, or of one `row` of a matrix along the other axis."""
    _check(leaf, max_bytes, name)
    dataset = leaf.dataset
    where: list[Any] = [0] * len(dataset.shape)
    along = int(np.argmax(dataset.shape)) if row is None else 1 - axis
    if row is not None:
        where[axis] = row

    def part(first: int, last: int) -> NDArray[np.float64]:
        values = np.empty(last - first)
        if last > first:
            where[along] = slice(first, last)
            dataset.read_direct(values, tuple(where))
        return values

    return part


def _check(leaf: Leaf, max_bytes: int, name: str) -> None:
    """TableError if a dataset must not be read, or holds none of its samples; FileError if a chunk is too large."""
    dataset = leaf.dataset
    if leaf.barred:
        raise TableError(f"{name}: channel {shown(leaf.path)} {leaf.barred}")
    what = f"channel {shown(leaf.path)}"
    if dataset.size and dataset.id.get_storage_size() == 0:
        raise TableError(f"{name}: {what} declares {dataset.size} samples and holds none")
    if dataset.chunks is not None:
        declared = int(np.prod(dataset.chunks, dtype=object)) * dataset.dtype.itemsize
        afford(2 * declared, max_bytes, name, f"a part of {what}")


def _is_row(leaf: Leaf) -> bool:
    if leaf.barred:
        return False
    shape = leaf.dataset.shape
    return len(shape) >= 1 and sum(length != 1 for length in shape) <= 1


def _count(leaf: Leaf) -> int:
    return int(np.prod(leaf.dataset.shape, dtype=object))


#: Rate [Hz] and start [s] of a channel, and the dataset of its times; None for what is not stated.
_Timing = tuple[float | None, float, Leaf | None]


def _number(stated: dict[str, Any], keys: Sequence[str]) -> float | None:
    values = (stated.get(key) for key in keys)
    return next((float(one) for one in values if isinstance(one, float) and np.isfinite(one)), None)


def _timing(leaf: Leaf, own: dict[str, Any], beside: dict[str, Leaf], name: str) -> _Timing:
    """The time base that the channel states, or else its group, or else the dataset of times in the same group."""
    start = next(filter(None, (_number(stated, _STARTS) for stated in (own, leaf.inherited))), 0.0)
    for stated in (own, leaf.inherited):
        if rate := _rate(stated):
            return rate, start, None
        if isinstance(stated.get("time"), str):
            time = beside.get(stated["time"].rpartition("/")[2])
            if time is not None and time is not leaf and _has_times_of(time, leaf):
                return None, 0.0, time
            if time is not leaf and stated is not leaf.inherited:
                what = f"names the time {shown(stated['time'])}, which is not beside it or not as long"
                raise TableError(f"{name}: channel {shown(leaf.path)} {what}; mend its attribute 'time'")
    times = (one for one in beside.values() if is_time(one.name) and _has_times_of(one, leaf))
    time = None if is_time(leaf.name) else next(times, None)
    return None, (start if time is None else 0.0), time


def _rate(stated: dict[str, Any]) -> float | None:
    """The rate that attributes state [Hz], or their step gives; None if it is not positive."""
    step = _number(stated, STEPS)
    rate = _number(stated, RATES) or (1.0 / step if step else 0.0)
    return rate if rate > 0 else None


def _has_times_of(time: Leaf, leaf: Leaf) -> bool:
    return _is_row(time) and _count(time) == _count(leaf)


def _unit(leaf: Leaf, own: dict[str, Any]) -> str | None:
    return of_name(leaf.name, next((own[key] for key in UNITS if isinstance(own.get(key), str)), None))


class _Content(Content):
    """The datasets of an open file."""

    def __init__(self, opened: OpenFile) -> None:
        super().__init__(opened)
        self._h5py = opened.guard.load(_LIBRARY)
        # The library gets the open file, not a path, so that it opens no other file.
        self._root = opened.closing.enter_context(self._h5py.File(opened.file, "r"))
        self._leaves = leaves(self._h5py, self._root, self._name)
        self._rows = [one for one in self._leaves if one.barred or _is_row(one)]
        self.places = [(one.group, one.name) for one in self._rows]
        self._times: dict[str, Part] = {}
        self._groups: dict[str, dict[str, Leaf]] = {}
        for leaf in self._leaves:
            self._groups.setdefault(leaf.group, {})[leaf.name] = leaf

    def info(self) -> FileInfo:
        signals = [self._info(one) for one in self._leaves if _is_row(one)]
        notes = [f"{key}: {tidy(value)}" for key, value in attributes(self._h5py, self._root).items()]
        notes += [f"{tidy(one.path)} {one.barred}" for one in self._leaves if one.barred][:20]
        wide = [tidy(one.path) for one in self._leaves if not one.barred and not _is_row(one)]
        if wide:
            notes.append(f"not channels, since they are no single row: {', '.join(wide[:12])}")
        return FileInfo("HDF5", tuple(signals), tuple(notes))

    def _info(self, leaf: Leaf) -> SignalInfo:
        own = attributes(self._h5py, leaf.dataset)
        rate, start, stamps = _timing(leaf, own, self._groups[leaf.group], self._name)
        count, ends = _count(leaf), None
        notes = [tidy(own[key]) for key in _NOTES if key in own]
        if stamps is not None and count:
            time = self._seconds(stamps)
            ends = float(time(0, 1)[0]), float(time(count - 1, count)[0])
            notes.append(f"time from {tidy(stamps.name)}")
        unit, note = _unit(leaf, own), "; ".join(filter(None, notes))
        return SignalInfo.timed(leaf.name, unit, leaf.group, count, rate=rate, start=start, ends=ends, note=note)

    def tracks(self, request: Request, *, whole: bool) -> list[Track]:
        if whole:  # before the datasets are looked at, which may declare what they do not hold
            asked = [self._rows[index] for index in find(self.places, request)]
            declared = sum(_count(one) for one in asked if not one.barred)
            afford(self.sample_bytes * declared, self._max_bytes, self._name)
        return super().tracks(request, whole=whole)

    def track(self, index: int) -> Track:
        leaf = self._rows[index]
        values = reader(leaf, self._max_bytes, self._name)
        own = attributes(self._h5py, leaf.dataset)
        rate, start, stamps = _timing(leaf, own, self._groups[leaf.group], self._name)
        time = None if stamps is None else self._seconds(stamps)
        return Track(leaf.name, _unit(leaf, own), _count(leaf), values, rate, start, time)

    def _seconds(self, time: Leaf) -> Part:
        """The function that reads a part of a dataset of times [s]; channels with the same times share it."""
        if time.path not in self._times:
            scale = time_scale(_unit(time, attributes(self._h5py, time.dataset)), time.path, self._name)
            values = reader(time, self._max_bytes, self._name)
            self._times[time.path] = remembered(lambda first, last: scale * values(first, last))
        return self._times[time.path]


FORMAT = track_format("hdf5", "HDF5", (".h5", ".hdf5", ".hdf", ".he5"), _KIND, _Content, by_library=True)
