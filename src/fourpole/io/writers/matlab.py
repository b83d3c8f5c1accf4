"""MATLAB 5: vectors by their names, with the times as `t` and the units in `names` and `units`; a struct per group."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.errors import TableError
from fourpole.io.writers.plan import Add, Block, FloatArray, Group, Remarks, Writer, distinct, time_name

#: Largest number of characters of a name that every version of MATLAB accepts.
_LONGEST = 31
#: Largest size of all samples [byte]: a variable of this format holds at most 2 GB.
_MOST = 1_500_000_000
_RESERVED = ("names", "units", "notes")


@contextmanager
def _open(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
    from scipy.io import savemat

    needed = 8 * sum(group.count * (len(group.channels) + 1) for group in groups)
    if needed > _MOST:
        raise TableError(
            f"{path.name}: a MATLAB file of {needed / 1e9:.3g} GB cannot be written; write .h5, which MATLAB reads too "
            "(h5read), or fewer channels"
        )
    named = [
        _names([channel.name for channel in group.channels], time_name(group.channels), remarks) for group in groups
    ]
    # All samples are held until the end: the format states lengths before the samples.
    held: list[list[list[FloatArray]]] = [[[] for _ in range(len(one.channels) + one.timed)] for one in groups]

    def add(number: int, block: Block) -> None:
        for parts, samples in zip(held[number], block.table(groups[number]), strict=True):
            parts.append(samples)

    yield add
    tables = [_table(group, names, parts) for group, names, parts in zip(groups, named, held, strict=True)]
    if len(groups) == 1:
        content = tables[0]
    else:
        places = distinct([_identifier(group.name or "recording") for group in groups], _RESERVED, _LONGEST)
        content = dict(zip(places, tables, strict=True))
    if remarks.notes:
        content["notes"] = np.array(remarks.notes, dtype=object)
    with path.open("wb") as file:
        savemat(file, content, oned_as="column", long_field_names=True)


def _names(before: list[str], time: str, remarks: Remarks) -> list[str]:
    after = distinct([_identifier(name) for name in before], [*_RESERVED, time], _LONGEST)
    remarks.renamed(before, after)
    return after


def _identifier(name: str) -> str:
    """A name that MATLAB accepts: letters, digits and underscores, with a letter first."""
    plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")
    return plain if re.match(r"[A-Za-z]", plain) else f"x{plain}"


def _table(group: Group, names: Sequence[str], parts: Sequence[list[FloatArray]]) -> dict[str, Any]:
    units = [channel.unit for channel in group.channels]
    if group.timed:
        names, units = [time_name(group.channels), *names], ["s", *units]
    table: dict[str, Any] = {
        name: np.concatenate(kept or [np.empty(0)]) for name, kept in zip(names, parts, strict=True)
    }
    stated = [(name, unit) for name, unit in zip(names, units, strict=True) if unit]
    if stated:
        table["names"] = np.array([name for name, _ in stated], dtype=object)
        table["units"] = np.array([unit for _, unit in stated], dtype=object)
    return table


WRITER = Writer("mat", "MATLAB 5", (".mat",), False, _open)
