"""MATLAB 5: vectors by their names with the times as `t`, the units in `names` and `units`; a struct per group."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.errors import TableError
from fourpole.io.writers.plan import Block, FloatArray, Group, Told, Writer, distinct, time_name

__all__ = ["WRITER"]

_LONGEST = 31  # characters of a name that every version of the format has
_MOST = 1_500_000_000  # bytes: the format holds no more than 2 GB of a variable
_RESERVED = ("names", "units", "notes")


class _Sink:
    """Keeps all samples: the format states lengths before them."""

    def __init__(self, groups: Sequence[Group]) -> None:
        self.groups = groups
        self.parts: list[list[list[FloatArray]]] = [[[] for _ in range(len(one.tracks) + 1)] for one in groups]

    def add(self, at: int, block: Block, /) -> None:
        times = block.times(self.groups[at])
        columns = [times if times is not None else np.empty(0), *block.columns]
        for kept, samples in zip(self.parts[at], columns, strict=True):
            kept.append(samples)


@contextmanager
def _open(path: Path, groups: Sequence[Group], told: Told) -> Iterator[_Sink]:
    from scipy.io import savemat

    needed = 8 * sum(group.count * (len(group.tracks) + 1) for group in groups)
    if needed > _MOST:
        raise TableError(
            f"{path.name}: a MATLAB file of {needed / 1e9:.3g} GB cannot be written; write .h5, which MATLAB reads too "
            "(h5read), or fewer channels"
        )
    named = [_names([track.name for track in group.tracks], time_name(group.tracks), told) for group in groups]
    sink = _Sink(groups)
    yield sink
    tables = [_table(group, names, parts) for group, names, parts in zip(groups, named, sink.parts, strict=True)]
    if len(groups) == 1:
        content = tables[0]
    else:
        places = distinct([_identifier(group.name or "recording") for group in groups], _RESERVED, _LONGEST)
        content = dict(zip(places, tables, strict=True))
    if told.notes:
        content["notes"] = np.array(told.notes, dtype=object)
    with path.open("wb") as file:
        savemat(file, content, oned_as="column", long_field_names=True)


def _names(before: list[str], time: str, told: Told) -> list[str]:
    after = distinct([_identifier(name) for name in before], [*_RESERVED, time], _LONGEST)
    told.renamed(before, after)
    return after


def _identifier(name: str) -> str:
    """A name as MATLAB has it: letters, digits and underscores, a letter first."""
    plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")
    return plain if re.match(r"[A-Za-z]", plain) else f"x{plain}"


def _table(group: Group, names: Sequence[str], parts: Sequence[list[FloatArray]]) -> dict[str, Any]:
    table: dict[str, Any] = {}
    units = [("s" if at == 0 else group.tracks[at - 1].unit) for at in range(len(names) + 1)]
    called = [time_name(group.tracks), *names]
    for at, (name, kept) in enumerate(zip(called, parts, strict=True)):
        if at or group.timed:
            table[name] = np.concatenate(kept or [np.empty(0)])
    stated = [(name, unit) for name, unit in zip(called, units, strict=True) if unit and name in table]
    if stated:
        table["names"] = np.array([name for name, _ in stated], dtype=object)
        table["units"] = np.array([unit for _, unit in stated], dtype=object)
    return table


WRITER = Writer("mat", "MATLAB 5", (".mat",), False, _open)
