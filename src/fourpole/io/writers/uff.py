"""UFF 58b: a time response per channel in double precision.

The header states time step and start with six digits. If these digits are not exact, each sample has its own time.

References
----------
Structural Dynamics Research Laboratory, University of Cincinnati, "Universal file formats", data set 58.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np

from fourpole.errors import UnitError
from fourpole.io.formats.uff import rate_of_step
from fourpole.io.writers.plan import Add, Block, Group, Remarks, Writer, WrittenChannel, check_timed, distinct
from fourpole.units import channel_scale

_TIME_RESPONSE, _DOUBLE, _TIME = 1, 4, 17
_KINDS = {"displacement": 8, "velocity": 11, "acceleration": 12, "force": 13}
_LONGEST_NAME, _LONGEST_UNIT = 80, 20
_COPIED = 1 << 24


def _is_even(group: Group) -> bool:
    """Whether a reader gets rate and start back from the six digits of the header."""
    if group.rate is None:
        return False
    step = float(f"{1.0 / group.rate:.5e}")
    return rate_of_step(step) == group.rate and float(f"{group.start:.5e}") == group.start


@contextmanager
def _open(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
    check_timed(groups, path, "UFF 58")
    for group in groups:
        if _is_even(group):
            remarks.by_rate(group)
    channels = [channel for group in groups for channel in group.channels]
    names = _names(groups, remarks)
    for channel in channels:
        if channel.unit and len(channel.unit.encode()) > _LONGEST_UNIT:
            remarks.lost.append(f"the unit of {channel.name} is cut to {_LONGEST_UNIT} characters")
    if len(remarks.notes) > 4:
        remarks.lost.append(f"of {len(remarks.notes)} notes of the file the first 4 are kept")
    with ExitStack() as stack:  # a file for each channel, since the format has one channel after the other
        spools: list[list[BinaryIO]] = [
            [
                stack.enter_context(path.with_name(f"{path.name}.{at}.{one}").open("w+b"))
                for one in range(len(group.channels))
            ]
            for at, group in enumerate(groups)
        ]
        counts = [0] * len(groups)

        def add(number: int, block: Block) -> None:
            times = None if _is_even(groups[number]) else block.times(groups[number])
            for spool, samples in zip(spools[number], block.columns, strict=True):
                values = samples if times is None else np.stack([times, samples], axis=1)
                spool.write(values.astype("<f8").tobytes())
            counts[number] += len(block)

        yield add
        number = 0
        with path.open("wb") as file:
            for at, group in enumerate(groups):
                for channel, spool in zip(group.channels, spools[at], strict=True):
                    file.write(_header(names[number], number + 1, channel, group, counts[at], remarks.notes))
                    spool.seek(0)
                    while part := spool.read(_COPIED):
                        file.write(part)
                    file.write(b"\n    -1\n")
                    number += 1


def _names(groups: Sequence[Group], remarks: Remarks) -> list[str]:
    """Names of all functions; a name that several groups have is preceded by its group."""
    both = [(group.name, channel.name) for group in groups for channel in group.channels]
    often = Counter(name for _, name in both)
    wanted = [f"{group}/{name}" if often[name] > 1 and group else name for group, name in both]
    found = distinct([_line(name, _LONGEST_NAME) for name in wanted])
    remarks.renamed([name for _, name in both], found)
    return found


def _line(text: str, longest: int) -> str:
    """A text cut to `longest` bytes; NONE if it is empty."""
    return text.encode()[:longest].decode(errors="ignore").strip() or "NONE"


def _ordinate(unit: str | None) -> int:
    try:
        return _KINDS[channel_scale(unit or "", tuple(_KINDS))[0]]
    except UnitError:
        return 0


def _fixed(text: str, width: int) -> str:
    """A text filled with blanks to `width` bytes."""
    return text + " " * (width - len(text.encode()))


def _axis(kind: int, label: str, unit: str) -> str:
    return f"{kind:10}{0:5}{0:5}{0:5} {label:20} {_fixed(unit, _LONGEST_UNIT)}"


def _header(name: str, number: int, channel: WrittenChannel, group: Group, count: int, notes: Sequence[str]) -> bytes:
    even = _is_even(group)
    step, start = (1.0 / (group.rate or 1.0), group.start) if even else (0.0, 0.0)
    texts = [name, *(_line(note, _LONGEST_NAME) for note in (*notes, "", "", "", "")[:4])]
    size = 8 * count * (1 if even else 2)
    unit = _line(channel.unit or "", _LONGEST_UNIT)
    lines = [
        "    -1",
        f"{58:6}b{1:6}{2:6}{11:12}{size:12}{0:6}{0:6}{0:12}{0:12}",
        *(_fixed(text, _LONGEST_NAME) for text in texts),
        f"{_TIME_RESPONSE:5}{number:10}{0:5}{0:10} {'NONE':>10}{number:10}{0:4} {'NONE':>10}{0:10}{0:4}",
        f"{_DOUBLE:10}{count:10}{int(even):10}{start:13.5e}{step:13.5e}{0.0:13.5e}",
        _axis(_TIME, "Time", "s"),
        _axis(_ordinate(channel.unit), "NONE", unit),
        _axis(0, "NONE", "NONE"),
        _axis(0, "NONE", "NONE"),
    ]
    return "".join(f"{line}\n" for line in lines).encode()


WRITER = Writer("uff", "UFF 58b", (".uff", ".unv", ".ufb"), False, _open)
