"""Frequency responses and coherences of UFF 58: values, units and degrees of freedom as the file states them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.errors import TableError
from fourpole.io.formats.guard import afford
from fourpole.io.formats.uff import Content, copied, label_of, opened
from fourpole.io.source import name_of
from fourpole.units import shown

_RESPONSE, _COHERENCE = 4, 6
#: Data type of an abscissa that is a frequency, and those that a program leaves unknown.
_FREQUENCY = (0, 18)
_MOST_BYTES, _MOST_RESPONSES = 500_000_000, 2000
_SIGNS = {1: "X", 2: "Y", 3: "Z", 4: "RX", 5: "RY", 6: "RZ"}


@dataclass(frozen=True, eq=False)
class Response(ByValue):
    """A frequency response or a coherence.

    Attributes
    ----------
    name : str
        Response and reference, as in "12+Z/12+Z".
    title : str
        First line of its header.
    is_coherence : bool
    ordinate, denominator : int
        Data types: 8 displacement, 9 and 13 force, 11 velocity, 12 acceleration; others are not known.
    unit, per : str
        Unit of the ordinate and of its denominator, empty if not stated; `unit` may hold both.
    nodes : (int, int)
        Nodes of response and reference.
    directions : (int, int)
        1 to 3 for X, Y and Z, negative for the opposite; 0 if not stated.
    frequency : (N,) float array [Hz]
    values : (N,) complex array [unit]
    """

    name: str
    title: str
    is_coherence: bool
    ordinate: int
    denominator: int
    unit: str
    per: str
    nodes: tuple[int, int]
    directions: tuple[int, int]
    frequency: FloatArray
    values: ComplexArray


def responses(path: Path, label: str) -> list[Response]:
    """The frequency responses and coherences of a file, in its order; TableError if it is damaged."""
    name = name_of(path, label)
    with opened(path, label, _MOST_BYTES) as found:
        chosen = [at for at, one in enumerate(found.sets) if int(one.header["func_type"]) in (_RESPONSE, _COHERENCE)]
        if len(chosen) > _MOST_RESPONSES:
            raise TableError(f"{name}: has {len(chosen)} frequency responses; export those of the driving point alone")
        afford(32 * sum(found.sets[at].count for at in chosen), _MOST_BYTES, name)
        return [_response(found, at, name) for at in chosen]


def _response(found: Content, at: int, name: str) -> Response:
    one = found.sets[at]
    head = one.header
    with copied([found.content[one.start : one.stop], b"\n"]) as path:
        read = found.pyuff.UFF(path).read_sets()
    called = f"{_dof(head, 'rsp')}/{_dof(head, 'ref')}"
    values = np.atleast_1d(np.asarray(read.get("data", ()) if isinstance(read, dict) else (), dtype=complex))
    if values.size < one.count:
        raise TableError(f"{name}: is cut short: {shown(called)} has not its {one.count} values; export it again")
    if int(head.get("abscissa_spec_data_type", 0)) not in _FREQUENCY:
        raise TableError(f"{name}: {shown(called)} is no function of a frequency; export its frequency response")
    if one.even:
        frequency = float(head["abscissa_min"]) + one.step * np.arange(one.count)
    else:
        frequency = np.asarray(read["x"][: one.count], dtype=float)
    return Response(
        name=called,
        title=label_of(head, "id1"),
        is_coherence=int(head["func_type"]) == _COHERENCE,
        ordinate=int(head.get("ordinate_spec_data_type", 0)),
        denominator=int(head.get("orddenom_spec_data_type", 0)),
        unit=label_of(head, "ordinate_axis_units_lab"),
        per=label_of(head, "orddenom_axis_units_lab"),
        nodes=(int(head.get("rsp_node", 0)), int(head.get("ref_node", 0))),
        directions=(int(head.get("rsp_dir", 0)), int(head.get("ref_dir", 0))),
        frequency=frequency,
        values=values[: one.count],
    )


def _dof(head: Mapping[str, Any], which: str) -> str:
    direction = int(head.get(f"{which}_dir", 0))
    sign = "" if direction == 0 else ("+" if direction > 0 else "-") + _SIGNS.get(abs(direction), "?")
    return f"{head.get(f'{which}_node', 0)}{sign}"
