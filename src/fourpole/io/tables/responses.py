r"""Frequency responses that another system measured, as V1/F1 or K*.

At a driving point, motion over force or force over motion of one node and direction give V1/F1. From a force at another
node over the motion of the driven one, with the output blocked, the dynamic stiffness is K* itself (ISO 10846-2).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.errors import TableError, UnitError
from fourpole.io.child import read_apart
from fourpole.io.formats.guard import afford
from fourpole.io.formats.uff import Content, dof, label_of, opened, read_set
from fourpole.io.source import name_of
from fourpole.io.tables.columns import Statement, scale_of
from fourpole.io.tables.vocabulary import FORCE_PER_MOTION, MOTION_PER_FORCE
from fourpole.units import shown

_NAMES = {"stiffness": "dynamic stiffness", "damping": "impedance", "mass": "apparent mass"}
_MOTIONS = {8: "displacement", 11: "velocity", 12: "acceleration"}
_FORCES = (9, 13)
#: Largest difference of two frequencies of one line, as a share of the step.
_SAME = 1e-3
_RESPONSES, _COHERENCE = (4, 5), 6
#: Data type of an abscissa that is a frequency, and those that a program leaves unknown.
_FREQUENCY = (0, 18)
_MOST_BYTES, _MOST_RESPONSES = 500_000_000, 2000


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


@dataclass(frozen=True, eq=False)
class MeasuredResponse(ByValue):
    """A response in SI: V1/F1 [m/(N s)], K* [N/m] or V2/V1, by its `kind`, with its coherence if it has one."""

    frequency: FloatArray
    values: ComplexArray
    kind: str
    coherence: FloatArray | None
    said: list[str]
    remarks: list[str]


def read_response(path: Path, stated: Sequence[Statement], label: str) -> MeasuredResponse:
    """The frequency response of a UFF file that gives V1/F1 or K*; of several, the one that --column frf= names.

    Raises
    ------
    TableError
        If there is none, or no single one, or its unit is not known.
    """
    every = read_apart(responses, path, label, classes=(Response,), label=label)
    known = [one for one in every if not one.is_coherence]
    if not known:
        raise TableError(f"{label}: holds no frequency response; time signals are recordings for fourpole analyse")
    statement = next((one for one in stated if one.role == "frf"), None)
    one = _chosen(known, statement, label)
    kind, scale = _kind(one, statement, label)
    omega = 2 * np.pi * one.frequency
    values, remarks = scale * one.values, list[str]()
    across = kind == "transmissibility"
    driven = not across and _driven(one, kind, label, remarks)
    sign = -1.0 if (one.directions[0] < 0) != (one.directions[1] < 0) else 1.0
    found = sign * values
    if not across:
        found = as_mobility(sign * values, kind, omega)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = found if driven else np.asarray(1j * omega / found)
    if sign < 0:
        remarks.append(f"{one.name}: response and reference point in opposite directions: the sign was reversed")
    coherence = next((_on(one, other) for other in every if other.is_coherence and _same_place(one, other)), None)
    what = ", driving point" if driven else ", transfer, with the output blocked"
    said = [f"frequency response {shown(one.name)}: {_NAMES.get(kind, kind)}{'' if across else what}"]
    of = kind if across else "mobility" if driven else "stiffness"
    return MeasuredResponse(one.frequency, found, of, coherence, said, remarks)


def as_mobility(values: ComplexArray, kind: str, omega: FloatArray) -> ComplexArray:
    """V1/F1 [m/(N s)] from a ratio of motion and force of any kind [SI]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        if kind in MOTION_PER_FORCE:
            return np.asarray(values * (1j * omega) ** MOTION_PER_FORCE[kind])
        return np.asarray(1.0 / (values * (1j * omega) ** FORCE_PER_MOTION[kind]))


def _chosen(known: Sequence[Response], statement: Statement | None, label: str) -> Response:
    names = [one.name for one in known]
    listed = ", ".join(f"{at} {name}" for at, name in enumerate(names[:12], 1))
    if statement is None:
        if len(known) == 1:
            return known[0]
        raise TableError(f'{label}: has {len(known)} frequency responses ({listed}): state one by --column "frf=1"')
    found = [one for one in known if statement.name in (one.name, one.title)]
    if not found and statement.name.isdecimal() and 0 < int(statement.name) <= len(known):
        found = [known[int(statement.name) - 1]]
    if len(found) != 1:
        what = "no" if not found else f"{len(found)}"
        raise TableError(f"{label}: has {what} frequency responses {shown(statement.name)}; they are {listed}")
    return found[0]


def _kind(one: Response, statement: Statement | None, label: str) -> tuple[str, float]:
    """Kind of a response, and its SI value in the unit that is stated."""
    unit = statement.unit if statement is not None and statement.unit is not None else _unit(one)
    name = shown(one.name)
    if one.ordinate in _MOTIONS and one.ordinate == one.denominator and one.nodes[0] != one.nodes[1]:
        kinds = (_MOTIONS[one.ordinate],)
        known = one.unit and one.per and one.unit != one.per
        return "transmissibility", scale_of(one.unit, kinds)[1] / scale_of(one.per, kinds)[1] if known else 1.0
    if not unit:
        raise TableError(
            f'{label}: {name} states no unit: state it, as in --column "frf={one.name} [(m/s^2)/N]", or [m/N], [N/m]'
        )
    try:
        kind, scale = scale_of(unit, (*MOTION_PER_FORCE, *FORCE_PER_MOTION))
    except UnitError as error:
        raise TableError(f'{label}: {name}: {error}; state it, as in --column "frf={one.name} [(m/s^2)/N]"') from None
    types = (one.ordinate, one.denominator)
    stated = _MOTIONS.get(types[0]) if types[1] in _FORCES else None
    if stated and kind != {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}[stated]:
        raise TableError(f"{label}: {name} is {stated} over force by its types, but in {unit}; state the unit")
    return kind, scale


def _unit(one: Response) -> str:
    """The unit of a response, as one text: that of the ordinate over that of the denominator."""
    unit = re.sub(r"^\(1/(?P<per>[^()]+)\)\*\(?(?P<of>[^()]+)\)?$", r"(\g<of>)/(\g<per>)", one.unit.replace(" ", ""))
    return f"({unit})/({one.per})" if unit and one.per else unit


def _driven(one: Response, kind: str, label: str, remarks: list[str]) -> bool:
    """Whether a response is one of a driving point; False for a transfer stiffness, TableError for another transfer."""
    (response, reference), ways = one.nodes, one.directions
    if max(map(abs, ways)) > 3:
        raise TableError(f"{label}: {shown(one.name)} has a rotation; name a response along one direction")
    if response == reference and (0 in ways or abs(ways[0]) == abs(ways[1])):
        if 0 in ways:
            remarks.append(f"{one.name} states no direction: taken as that of one driving point")
        return True
    if abs(ways[0]) != abs(ways[1]):
        raise TableError(f"{label}: {shown(one.name)} is across two directions; name one of a single direction")
    if kind in FORCE_PER_MOTION:
        return False
    raise TableError(
        f"{label}: {shown(one.name)} is a motion at another node than the force: name one of the driving point, or a "
        "force behind the blocked specimen over the motion before it"
    )


def _same_place(one: Response, other: Response) -> bool:
    return (one.nodes, one.directions) == (other.nodes, other.directions) and other.values.size > 0


def _on(one: Response, other: Response) -> FloatArray:
    """The coherence at the frequencies of a response; not-a-number where there is none."""
    at = np.clip(np.searchsorted(other.frequency, one.frequency), 1, max(other.frequency.size - 1, 1))
    at = at - (np.abs(other.frequency[at - 1] - one.frequency) < np.abs(other.frequency[at] - one.frequency))
    step = np.gradient(one.frequency) if one.frequency.size > 1 else np.ones(1)
    near = np.abs(other.frequency[at] - one.frequency) <= _SAME * np.abs(step)
    return np.where(near, other.values.real[at], np.nan)


def responses(path: Path, label: str) -> list[Response]:
    """The frequency responses and coherences of a file, in its order; TableError if it is damaged."""
    name = name_of(path, label)
    with opened(path, label, _MOST_BYTES) as found:
        chosen = [at for at, one in enumerate(found.sets) if int(one.header["func_type"]) in (*_RESPONSES, _COHERENCE)]
        if len(chosen) > _MOST_RESPONSES:
            raise TableError(f"{name}: has {len(chosen)} frequency responses; export those of the driving point alone")
        afford(32 * sum(found.sets[at].count for at in chosen), _MOST_BYTES, name)
        return [_response(found, at, name) for at in chosen]


def _response(found: Content, at: int, name: str) -> Response:
    one = found.sets[at]
    head = one.header
    called = f"{dof(head, 'rsp')}/{dof(head, 'ref')}"
    read = read_set(found, one, called, name)
    values = np.atleast_1d(np.asarray(read["data"], dtype=complex))
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
