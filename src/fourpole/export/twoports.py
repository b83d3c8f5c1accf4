"""UFF 58: the four poles of specimens as dynamic stiffnesses between two nodes, for substructuring."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import Any

from fourpole.core.allpoles import POLES
from fourpole.export.source import ascii_line
from fourpole.export.uff import DISPLACEMENT, FORCE, response, write_functions
from fourpole.study.twoports import TwoPort
from fourpole.version import VERSION


def write_two_ports(found: Sequence[TwoPort], title: str, path: Path) -> None:
    """Write k11, k12, k21 and k22 of each specimen and condition; node 1 is the contact, node 2 the wheel.

    Each is the force on the specimen at its response node over the displacement of its reference node, both in +Z, in
    N/m, while the other node is held.

    Raises
    ------
    FileError
        If pyuff is not installed, or the file cannot be written.
    """
    made = datetime.now(UTC).replace(microsecond=0)
    write_functions(path, list(chain.from_iterable(map(_functions, found))), title, f"fourpole {VERSION}", made)


def _functions(two_port: TwoPort) -> list[dict[str, Any]]:
    poles, functions = two_port.poles, []
    reciprocal = "k12 = k21" if two_port.form is not None else "k12 and k21 differ: not reciprocal"
    for at, pole in enumerate(POLES):
        row, column = divmod(at, 2)
        std = poles.std[:, at].max(axis=0)
        functions.append(
            {
                "id2": ascii_line(two_port.name)[:80],
                "id3": reciprocal,
                "id5": f"e^(+jwt); standard uncertainty up to {std[0]:.3g} (Re), {std[1]:.3g} (Im) N/m",
                **response(
                    f"Dynamic stiffness {pole}, force on the specimen over displacement",
                    (row + 1, column + 1),
                    poles.frequency,
                    poles.stiffness[:, row, column],
                    (FORCE, f"Force on node {row + 1}", "N"),
                    (DISPLACEMENT, f"Motion of node {column + 1}", "m"),
                ),
            }
        )
    return functions
