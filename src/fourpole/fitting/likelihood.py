"""What tests have in common: covariance.parquet, errors of K*; likelihood.parquet, the tests as they were recorded.

likelihood.parquet and its part of study.json hold the tests of a rig as the joint route weighed them, and its solution.
With them a fit holds its model against the recorded amplitudes, with the gains and the rig's values as parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.joint import Joint
from fourpole.core.joint.around import Likelihood
from fourpole.core.joint.belts import references_of, with_references
from fourpole.core.joint.conditions import JointConditions
from fourpole.core.joint.model import Observed
from fourpole.core.joint.shared import Shared, SharedParameter
from fourpole.core.joint.solve import Problem
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.sources import Kind, Source
from fourpole.errors import FourpoleError, TableError
from fourpole.fitting.rows import Key, keys_of
from fourpole.io.published import Published

MOST_BYTES = 2_000_000_000
COVARIANCE = "covariance.parquet"
#: Columns of covariance.parquet.
COVARIANCE_COLUMNS = tuple(
    one.head for one in (q.TEST, q.RIG, q.CONDITION, q.OWN_COVARIANCE, q.SHARED_STORAGE, q.SHARED_LOSS)
)
FILE = "likelihood.parquet"
_MOST_SHARED = 100_000
_NUMBERS = (q.FREQUENCY, q.ADDED_MASS, q.K1, q.RUN_PLACE, q.OFF_CURVE, q.SPREAD)
_COUNTS = (q.CONDITION, q.FAMILY, q.SPECIMEN, q.PART_OF_RUN)
_PARTS = (*q.F1.parts, *q.V1.parts, *q.V2.parts)
#: Columns of likelihood.parquet after test and point.
LIKELIHOOD_COLUMNS = (
    q.RIG.head, *(one.head for one in (*_COUNTS, *_NUMBERS)), *_PARTS, q.STORAGE.head, q.LOSS.head, q.WEIGHTS.head,
    q.TURNS.head,
)  # fmt: skip


def joined(
    keys: Sequence[Key], covariance: pl.DataFrame
) -> tuple[FloatArray, FloatArray, np.ndarray, list[tuple[str, int]]]:
    """Own covariance (N, 2, 2), effect of the shared errors (N, 2, p), and number of its K* (N,), for each key.

    Also the rig of each key, and the number of its K* among those of the rig.
    """
    own_name, re_name, im_name = (one.head for one in (q.OWN_COVARIANCE, q.SHARED_STORAGE, q.SHARED_LOSS))
    place = {key: at for at, key in enumerate(keys_of(covariance))}
    part = covariance[[place[key] for key in keys]]
    own = np.array(part[own_name].to_list(), dtype=float).reshape(-1, 2, 2)
    rigs = part["rig"].to_list()
    lengths = {rig: max(map(len, part.filter(pl.col("rig") == rig)[re_name].to_list())) for rig in dict.fromkeys(rigs)}
    starts = dict(zip(lengths, np.cumsum([0, *lengths.values()])[:-1].tolist(), strict=True))
    shared = np.zeros((len(rigs), 2, sum(lengths.values())))
    columns = (part[re_name].to_list(), part[im_name].to_list())
    for at, rig in enumerate(rigs):
        for side, values in enumerate(columns):
            shared[at, side, starts[rig] : starts[rig] + len(values[at])] = values[at]
    numbers: dict[tuple[str, int], int] = {}
    places = list(zip(rigs, part["condition"].to_list(), strict=True))
    condition = np.array([numbers.setdefault(one, len(numbers)) for one in places])
    return own, shared, condition, places


def covariance_of(content: bytes) -> pl.DataFrame:
    """The table of covariance.parquet from its bytes; TableError if another program wrote it."""
    try:
        frame = pl.read_parquet(content)
    except pl.exceptions.PolarsError as error:
        raise TableError(f"{COVARIANCE}: cannot be read ({error}): run fourpole analyse again") from None
    if [name for name in frame.columns if name != q.POINT.head] != list(COVARIANCE_COLUMNS):
        raise TableError(f"{COVARIANCE}: is not one that fourpole wrote: run fourpole analyse again")
    return frame


def likelihood_of(joint: Joint) -> Likelihood:
    """The tests of a joint solution, with the errors of channels that the solution has, and gain and delay of V1."""
    problem, shared = joint.problem, joint.problem.shared
    wanted = {one.source for one in shared.parameters if one.source.of_channel}
    wanted |= {Source(Kind.GAIN, "V1"), Source(Kind.DELAY, "V1")}
    kept = [at for at, source in enumerate(problem.errors) if source in wanted]
    place = {at: number for number, at in enumerate(kept)}
    parameters = tuple(
        replace(one, index=place[one.index]) if one.source.of_channel else one for one in shared.parameters
    )
    observed = problem.observed
    problem = replace(
        problem,
        observed=replace(
            observed,
            turns=observed.turns[:, kept],
            disturbed=observed.disturbed[:, kept],
            frequency_std=np.zeros(observed.omega.size),
        ),
        shared=replace(shared, parameters=parameters),
        errors=tuple(problem.errors[at] for at in kept),
        scatter=0.0,
        apart=problem.spread if np.any(problem.spread) else None,
    )  # fmt: skip
    return Likelihood(problem, joint.solution.z, joint.solution.stiffness)


def likelihood_columns(found: Likelihood) -> dict[str, np.ndarray]:
    """Columns of likelihood.parquet without test and rig, in the order of the problem."""
    problem = found.problem
    observed, conditions = problem.observed, problem.conditions
    tyre = conditions.label >= 0
    family = np.where(tyre, np.append(conditions.family, -1)[conditions.label], -1)
    stiffness = np.where(tyre, np.append(found.stiffness, np.nan)[conditions.label], np.nan)
    k1 = np.where(tyre, np.append(conditions.k1, np.nan)[conditions.label], np.nan)
    numbers = (
        observed.omega / (2 * np.pi), observed.added(problem.shared.masses), k1, observed.place, observed.deflection,
        problem.spread,
    )  # fmt: skip
    counts = (conditions.label, family, observed.specimen, observed.part_of_run)
    amplitudes = np.stack([observed.amplitudes.real, observed.amplitudes.imag], axis=2).reshape(-1, 6)
    whole = observed.turns_of_all
    turns = np.stack([whole.real, whole.imag], axis=3).reshape(len(tyre), -1)
    columns = dict(zip((one.head for one in (*_COUNTS, *_NUMBERS)), (*counts, *numbers), strict=True))
    columns |= zip(_PARTS, amplitudes.T, strict=True)
    columns |= {q.STORAGE.head: stiffness.real, q.LOSS.head: stiffness.imag}
    return columns | {q.WEIGHTS.head: observed.whiten.reshape(-1, 36), q.TURNS.head: turns}


def likelihood_record(found: Likelihood) -> dict[str, Any]:
    """The part of study.json for one rig: the values that its tests share, as numbers that JSON keeps exactly."""
    shared = found.problem.shared
    rig, observed = {name: getattr(shared.rig, name) for name in PARAMETERS}, found.problem.observed
    pairs = [[one.real, one.imag] for one in references_of(observed).tolist()]
    belts = {"belts": {"rod": bool(observed.rod.any()), "K*": pairs}} if shared.has_belts else {}
    return {
        **belts,
        "rig": {name: value for name, value in rig.items() if np.isfinite(value)},
        "masses": shared.masses.tolist(),
        "specimens": list(found.problem.names),
        "errors": [source.text for source in found.problem.errors],
        "shared": [
            {"value": one.source.text, "unit": one.unit, "index": one.index, "stated": one.stated, "u": one.std, "z": z}
            for one, z in zip(shared.parameters, found.z.tolist(), strict=True)
        ],
    }


def read_likelihoods(results: Published) -> dict[str, Likelihood]:
    """The likelihood of each rig from likelihood.parquet and the record of study.json; empty if there is none.

    Raises
    ------
    TableError
        If the file cannot be read, or is of another analysis than the record.
    """
    record = results.record.get("likelihood")
    if not record or not results.has(FILE):
        return {}
    content = results.read(FILE, max_bytes=MOST_BYTES)
    try:
        frame = pl.read_parquet(content)
        return {rig: likelihood_in(frame.filter(pl.col(q.RIG.head) == rig), one) for rig, one in record.items()}
    except (
        pl.exceptions.PolarsError,
        FourpoleError,
        ValueError,
        TypeError,
        LookupError,
        AttributeError,
        OverflowError,
    ) as error:
        raise TableError(f"{FILE}: cannot be read ({error}): run fourpole analyse again") from None


def likelihood_in(frame: pl.DataFrame, record: Mapping[str, Any]) -> Likelihood:
    """The likelihood of one rig from its rows and its record."""
    frame = frame.sort(q.CONDITION.head, maintain_order=True)
    label, family, specimen, part_of_run = (frame[one.head].to_numpy() for one in _COUNTS)
    frequency, mass, k1, place, deflection, spread = (_numbers(frame, one.head) for one in _NUMBERS)
    masses = np.array(record["masses"], dtype=float)
    errors = tuple(Source.read(str(text)) for text in record["errors"])
    parameters = tuple(
        SharedParameter(
            Source.read(str(one["value"])), str(one["unit"]), int(one["index"]), float(one["stated"]), float(one["u"])
        )
        for one in record["shared"]
    )
    for one in parameters:
        if not 0 <= one.index < (len(errors) if one.source.of_channel else _MOST_SHARED):
            raise ValueError(f"{one.source.text} has the index {one.index}")
    turns = _complex(_lists(frame, q.TURNS.head, 6 * len(errors))).reshape(-1, 3, len(errors))
    channels = np.argmax(np.any(turns, axis=0), axis=0).astype(np.int8)  # each error disturbs one channel
    observed = Observed(
        omega=2 * np.pi * frequency,
        frequency_std=np.zeros(frequency.size),
        amplitudes=_complex(np.stack([_numbers(frame, head) for head in _PARTS], axis=1)),
        whiten=_lists(frame, q.WEIGHTS.head, 36).reshape(-1, 6, 6),
        mass_at=np.where(mass == 0, -1, np.searchsorted(masses, mass)),
        rigid=label < 0,
        turns=turns[:, channels, np.arange(len(errors))],
        disturbed=np.broadcast_to(channels, (len(turns), len(errors))),
        specimen=specimen,
        place=place,
        part_of_run=part_of_run,
        deflection=deflection,
        family=specimen,
        reference=np.ones(label.size, dtype=complex),
        rod=np.zeros(label.size, dtype=bool),
    )
    conditions = JointConditions(label, family, frequency, k1)
    if belts := record.get("belts"):
        references = np.array([complex(*pair) for pair in belts["K*"]])
        observed = with_references(observed, conditions, references, rod=bool(belts["rod"]))
    problem = Problem(
        observed, conditions, Shared(Rig(**record["rig"]), parameters, masses), errors,
        tuple(map(str, record["specimens"])), apart=spread if np.any(spread) else None,
    )  # fmt: skip
    stiffness = (_numbers(frame, q.STORAGE.head) + 1j * _numbers(frame, q.LOSS.head))[conditions.starts]
    return Likelihood(problem, np.array([float(one["z"]) for one in record["shared"]]), stiffness)


def _numbers(frame: pl.DataFrame, head: str) -> FloatArray:
    """A column as numbers; not-a-number where there is none."""
    return np.asarray(frame[head].cast(pl.Float64).fill_null(np.nan).to_numpy(), dtype=float)


def _lists(frame: pl.DataFrame, head: str, length: int) -> FloatArray:
    """A column of lists as an array (N, length)."""
    rows: Sequence[Any] = frame[head].to_list()
    return np.array(rows, dtype=float).reshape(len(rows), length)


def _complex(values: FloatArray) -> ComplexArray:
    """Complex values of columns with Re and Im in turn."""
    return np.asarray(values[:, 0::2] + 1j * values[:, 1::2])
