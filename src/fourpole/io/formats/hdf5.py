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
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import RATES, STEPS, UNITS, is_time, of_name, tidy
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, refused, times_by, track_format
from fourpole.io.signals import Words
from fourpole.units import shown

_STARTS = ("start", "t0", "offset", "start_offset")
_NOTES = ("note", "comment", "description", "title", "long_name")
_KNOWN = (*UNITS, *RATES, *STEPS, *_STARTS, *_NOTES, "time", "MATLAB_class", "MATLAB_empty")
_MOST_OBJECTS = 100_000
#: Why a dataset of texts or of structures is no channel, though it may be read.
NO_NUMBERS = "holds no numbers"
_FILTERS = frozenset({1, 2, 3, 4, 5, 6, 32000})


@dataclass(frozen=True)
class Leaf:
    """A dataset of a file, or a link that cannot be followed; it is called by its name and those of its groups."""

    group: str
    name: str
    dataset: Any
    barred: str
    """The reason why it cannot be read; empty if it can."""
    inherited: dict[str, Any]
    """The attributes of its group."""

    @property
    def is_row(self) -> bool:
        """Whether it has one row of numbers."""
        shape = () if self.barred else self.dataset.shape
        return len(shape) > 0 and sum(length != 1 for length in shape) <= 1

    @property
    def closed(self) -> Track:
        """What is said to those who name it, if it cannot be read."""
        return Track(self.name, None, 0, lambda *_: np.empty(0), group=self.group, barred=self.barred)


def leaves(h5py: Any, root: Any, name: str) -> list[Leaf]:
    """The datasets of a file, each of them once; no link out of the file is followed."""
    found: list[Leaf] = []
    seen = set()
    waiting: list[tuple[str, Any]] = [("", root)]
    for path, group in waiting:
        address = h5py.h5o.get_info(group.id).addr
        if address in seen:
            continue
        seen.add(address)
        inherited = attributes(group)
        for key in group:
            thing, barred = None, "cannot be opened: it is damaged, or a link that leads nowhere"
            if isinstance(group.get(key, getlink=True), h5py.ExternalLink):
                barred = "leads to another file, which is not followed; copy the samples into this one"
            else:
                with suppress(KeyError, OSError, RuntimeError, TypeError, ValueError):
                    thing = group[key]
            if isinstance(thing, h5py.Group):
                waiting.append((f"{path}/{key}".lstrip("/"), thing))
            elif thing is None or isinstance(thing, h5py.Dataset):
                found.append(Leaf(path, key, thing, barred if thing is None else why_barred(h5py, thing), inherited))
        if len(found) + len(waiting) > _MOST_OBJECTS:
            raise TableError(f"{name}: has more than {_MOST_OBJECTS} objects; split it")
    return found


def why_barred(h5py: Any, dataset: Any) -> str:
    """The reason why a dataset is no channel, or must not be read; empty if there is none."""
    plan = dataset.id.get_create_plist()
    if plan.get_layout() == h5py.h5d.VIRTUAL or plan.get_external_count() > 0:
        return "has its samples in another file, which is not read; copy them into this one"
    strange = {plan.get_filter(at)[0] for at in range(plan.get_nfilters())} - _FILTERS
    if strange:
        return f"is compressed by the filter {min(strange)}, which is no part of HDF5; repack it with GZIP"
    try:
        kind, shape = dataset.dtype.kind, dataset.shape
    except (TypeError, ValueError, OSError, RuntimeError):
        return "is of a kind that is not known"
    if kind not in "fiu" or shape is None:
        return NO_NUMBERS if kind != "c" else "holds complex numbers"
    if dataset.size and not dataset.id.get_storage_size():
        return f"declares {dataset.size} samples and holds none"
    return ""


def attributes(thing: Any) -> dict[str, Any]:
    """Those known attributes of an object whose value is one text or one number."""
    found: dict[str, Any] = {}
    for key in _KNOWN:
        with suppress(KeyError, OSError, RuntimeError, TypeError, ValueError):
            values = np.asarray(thing.attrs[key]).ravel()
            value = values[0].decode("utf-8", "replace") if isinstance(values[0], bytes) else values[0]
            if values.size == 1:
                found[key] = value if isinstance(value, str) else float(value)
    return found


def _row(dataset: Any) -> Part:
    """The function that reads a part of a dataset with one row."""
    along = int(np.argmax(dataset.shape))

    def part(first: int, last: int) -> NDArray[np.float64]:
        where = [slice(first, last) if at == along else 0 for at in range(len(dataset.shape))]
        return np.asarray(dataset[tuple(where)], dtype=np.float64) if last > first else np.empty(0)

    return part


def _number(stated: dict[str, Any], keys: Sequence[str]) -> float | None:
    values = (stated.get(key) for key in keys)
    return next((one for one in values if isinstance(one, float) and np.isfinite(one)), None)


def _timing(leaf: Leaf, own: dict[str, Any], beside: dict[str, Leaf]) -> tuple[float | None, float, Leaf | None, str]:
    """Rate [Hz], start [s], and the dataset of the times, which the channel states, its group, or a name beside it.

    The last value says why a stated time is none.
    """
    start = next(filter(None, (_number(one, _STARTS) for one in (own, leaf.inherited))), 0.0)
    for stated in (own, leaf.inherited):
        step = _number(stated, STEPS)
        rate = _number(stated, RATES) or (1.0 / step if step else 0.0)
        if rate > 0:
            return rate, start, None, ""
        if isinstance(stated.get("time"), str):
            time = beside.get(stated["time"].rpartition("/")[2])
            if time is not None and time is not leaf and _has_times_of(time, leaf):
                return None, 0.0, time, ""
            if time is not leaf and stated is own:
                what = f"names the time {shown(stated['time'])}, which is not beside it or not as long"
                return None, 0.0, None, f"{what}; mend its attribute 'time'"
    times = (one for one in beside.values() if is_time(one.name) and _has_times_of(one, leaf))
    time = None if is_time(leaf.name) else next(times, None)
    return None, (start if time is None else 0.0), time, ""


def _has_times_of(time: Leaf, leaf: Leaf) -> bool:
    return time.is_row and time.dataset.size == leaf.dataset.size


def _track(leaf: Leaf, own: dict[str, Any]) -> Track:
    """A dataset as a channel without its times."""
    unit = of_name(leaf.name, next((own[key] for key in UNITS if isinstance(own.get(key), str)), None))
    note = "; ".join(tidy(own[key]) for key in _NOTES if key in own)
    count = int(leaf.dataset.size)
    return Track(leaf.name, unit, count, _row(leaf.dataset), group=leaf.group, note=note)


def _content(opened: OpenFile) -> Content:
    """The channels of an open file."""
    h5py = opened.load("h5py")
    # The library gets the open file, not a path, so that it opens no other file.
    root = opened.closing.enter_context(h5py.File(opened.file, "r"))
    every = leaves(h5py, root, opened.name)
    groups: dict[str, dict[str, Leaf]] = {}
    for leaf in every:
        groups.setdefault(leaf.group, {})[leaf.name] = leaf
    clocks: dict[tuple[str, str], Part] = {}
    tracks = []
    for leaf in every:
        if not leaf.is_row:
            continue
        own = attributes(leaf.dataset)
        rate, start, clock, barred = _timing(leaf, own, groups[leaf.group])
        one = replace(_track(leaf, own), rate=rate, start=start, barred=barred)
        if clock is not None:
            key = (clock.group, clock.name)
            clocks.setdefault(key, times_by(_track(clock, attributes(clock.dataset)), opened.name))
            note = "; ".join(filter(None, (one.note, f"time from {tidy(clock.name)}")))
            one = replace(one, time=clocks[key], note=note)
        tracks.append(one)
    closed = [one.closed for one in every if one.barred]
    notes = [f"{key}: {tidy(value)}" for key, value in attributes(root).items()] + refused(closed)
    wide = [tidy(f"{one.group}/{one.name}".lstrip("/")) for one in every if not one.barred and not one.is_row]
    if wide:
        notes.append(f"not channels, since they are no single row: {', '.join(wide[:12])}")

    def words() -> list[Words]:
        known = [one for one in every if one.barred == NO_NUMBERS]
        texts = [one for one in known if h5py.check_string_dtype(one.dataset.dtype)]
        short = [one for one in texts if len(one.dataset.shape) == 1 and one.dataset.size <= _MOST_OBJECTS]
        return [(one.group, one.name, list(one.dataset.asstr()[()])) for one in short]

    return Content("HDF5", tracks, notes, closed=closed, words=words)


FORMAT = track_format("hdf5", "HDF5", (".h5", ".hdf5", ".hdf", ".he5"), "an HDF5 file", _content)
