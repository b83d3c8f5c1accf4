"""HDF5 in the layout that `fourpole.io.formats.hdf5` describes: a dataset per channel, with unit, rate and start."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fourpole.io.formats.guard import need
from fourpole.io.writers.plan import Block, FloatArray, Group, Told, Track, Writer, distinct, time_name

__all__ = ["WRITER"]

_KIND = "an HDF5 file"
_CHUNK = 1 << 16


class _Sink:
    def __init__(self, sets: Sequence[list[Any]], groups: Sequence[Group]) -> None:
        self._sets, self._groups = sets, groups

    def add(self, at: int, block: Block, /) -> None:
        columns: list[FloatArray] = list(block.columns)
        if self._groups[at].stamped and block.stamps is not None:
            columns.append(block.stamps)
        for dataset, samples in zip(self._sets[at], columns, strict=True):
            dataset.resize((block.first + len(block),))
            dataset[block.first :] = samples


@contextmanager
def _open(path: Path, groups: Sequence[Group], told: Told) -> Iterator[_Sink]:
    h5py = need("h5py", path.name, _KIND)
    with h5py.File(path, "w") as root:
        if told.notes:
            root.attrs["comment"] = "; ".join(told.notes)
        yield _Sink([_datasets(root, group, groups, told) for group in groups], groups)


def _datasets(root: Any, group: Group, groups: Sequence[Group], told: Told) -> list[Any]:
    """The datasets of a group, that of its times last where it has one."""
    place = root.require_group(group.name) if group.name else root
    before = [track.name for track in group.tracks]
    others = [track for one in groups if one.name == group.name for track in one.tracks]
    time = distinct([time_name(others)], place)[0]
    names = distinct([name.replace("/", "_").strip(".") or "_" for name in before], place)
    told.renamed(before, names)
    made = []
    chunk = min(max(group.count, 1), _CHUNK)
    for name, track in zip(names, group.tracks, strict=True):
        dataset = _dataset(place, name, track, chunk)
        if group.stamped:
            dataset.attrs["time"] = time
        elif group.rate is not None:
            dataset.attrs["rate"], dataset.attrs["start"] = group.rate, group.start
        made.append(dataset)
    return [*made, _dataset(place, time, Track(time, "s"), chunk)] if group.stamped else made


def _dataset(place: Any, name: str, track: Track, chunk: int) -> Any:
    dataset = place.create_dataset(name, shape=(0,), maxshape=(None,), chunks=(chunk,), dtype="f8")
    if track.unit:
        dataset.attrs["unit"] = track.unit
    if track.note:
        dataset.attrs["note"] = track.note
    return dataset


WRITER = Writer("h5", "HDF5", (".h5", ".hdf5"), False, _open)
