"""HDF5: a group per recording with a dataset per channel, whose attributes are unit, rate and start."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fourpole.io.formats.guard import need
from fourpole.io.writers.plan import Add, Block, Group, Remarks, Writer, WrittenChannel, names_in_group

_KIND = "an HDF5 file"
_CHUNK = 1 << 16


@contextmanager
def _open(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
    h5py = need("h5py", path.name, _KIND)
    with h5py.File(path, "w") as root:
        if remarks.notes:
            root.attrs["comment"] = "; ".join(remarks.notes)
        made = [_datasets(root, group, groups, remarks) for group in groups]

        def add(number: int, block: Block) -> None:
            stamps = [block.stamps] if groups[number].stamped and block.stamps is not None else []
            for dataset, samples in zip(made[number], [*block.columns, *stamps], strict=True):
                dataset.resize((block.first + len(block),))
                dataset[block.first :] = samples

        yield add


def _datasets(root: Any, group: Group, groups: Sequence[Group], remarks: Remarks) -> list[Any]:
    """The datasets of a group; the last one has the times, if the file states them."""
    place = root.require_group(group.name) if group.name else root
    time, names = names_in_group(group, groups, place, remarks, lambda name: name.replace("/", "_").strip(".") or "_")
    made = []
    chunk = min(max(group.count, 1), _CHUNK)
    for name, channel in zip(names, group.channels, strict=True):
        dataset = _dataset(place, name, channel, chunk)
        if group.stamped:
            dataset.attrs["time"] = time
        elif group.rate is not None:
            dataset.attrs["rate"], dataset.attrs["start"] = group.rate, group.start
        made.append(dataset)
    return [*made, _dataset(place, time, WrittenChannel(time, "s"), chunk)] if group.stamped else made


def _dataset(place: Any, name: str, channel: WrittenChannel, chunk: int) -> Any:
    dataset = place.create_dataset(name, shape=(0,), maxshape=(None,), chunks=(chunk,), dtype="f8")
    if channel.unit:
        dataset.attrs["unit"] = channel.unit
    if channel.note:
        dataset.attrs["note"] = channel.note
    return dataset


WRITER = Writer("h5", "HDF5", (".h5", ".hdf5"), False, _open)
