"""What all parts of a model file are made of: strict records, values with their units, covariances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, StrictBool, model_serializer

from fourpole.core import stats
from fourpole.core.confidence import COVERAGE
from fourpole.errors import ModelError
from fourpole.models.interface import Link
from fourpole.models.surface import ValueSurface
from fourpole.version import VERSION
from fourpole.words import first_of

#: Relative tolerance for an asymmetric covariance, or one with a negative eigenvalue.
_ROUND_OFF = 1e-6
#: Largest modulus of a parameter in SI units, or of a coefficient: a relaxation time may be very long.
LARGEST = 1e120
#: Longest list of one condition.
LONGEST = 100_000
#: Tests with values outside that a sentence names.
_MOST_NAMED = 6
#: Key of the settings that has those of tyres of an earlier run.
EARLIER = "earlier"
#: A relative error.
Share = Annotated[float, Field(ge=0, le=1e3)]
#: Keys of version 1 of the format whose attributes have other names.
_KEYS = {
    "discrepancy": "granted", "leave_one_out": "left_out", "cross_validation": "left_out", "not_converged": "lost"
}  # fmt: skip


class Strict(BaseModel):
    """Base of all records: no other keys, no number that is not finite."""

    model_config = ConfigDict(
        extra="forbid",
        allow_inf_nan=False,
        frozen=True,
        defer_build=True,  # most commands read no model file
        populate_by_name=True,
        alias_generator=lambda name: _KEYS.get(name, name),
    )


class Grown(Strict):
    """Base of records that version 1 has given further keys, which are written only where they hold something."""

    later: ClassVar[tuple[str, ...]] = ()

    @model_serializer(mode="wrap")
    def _written(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        found: dict[str, Any] = write(self)
        lacking = [key for key in self.later if found.get(key) is None or found[key] is False or found[key] == []]
        return {key: one for key, one in found.items() if key not in lacking}


class VerdictFile(Grown):
    """The smallest kind of passive linear specimen that can have K* as it was measured."""

    later: ClassVar = ("holds", "mass", "resonances")
    possible: bool
    holds: str | None = Field(
        default=None, max_length=20, description="mass, resonant or none; left out for a relaxing one."
    )
    mass: float | None = Field(
        default=None, description="Mass at the driven end that was taken off K* before the fit [kg]."
    )
    resonances: list[float] = Field(default=[], max_length=10, description="Frequencies of its resonances [Hz].")
    chance: float = Field(description="Probability of a larger chi-square by noise alone [1].")
    misfit: float = Field(description="Relative error of K* at each frequency that would make it possible [1].")
    impossible: list[float] = Field(max_length=LONGEST, description="Frequencies at which K* is not possible [Hz].")


class Provenance(Strict):
    """Program, table and settings from which the document was made."""

    fourpole: str
    source: str
    sha256: str
    settings: dict[str, Any] = Field(default_factory=dict)
    notes: list[str] = Field(default_factory=list)

    @classmethod
    def of(cls, source: str, sha256: str, settings: Mapping[str, Any] | None, notes: Sequence[str]) -> Provenance:
        """That of a document which this program makes."""
        return cls(fourpole=VERSION, source=source, sha256=sha256, settings=dict(settings or {}), notes=list(notes))

    @property
    def earlier(self) -> dict[str, Any]:
        """The settings of tyres that an earlier run of the command fitted, by tyre."""
        found = self.settings.get(EARLIER)
        return found if isinstance(found, dict) else {}

    def settings_of(self, tyre: str) -> dict[str, Any]:
        """The settings with which a tyre was fitted."""
        found = self.earlier.get(tyre, self.settings)
        return found if isinstance(found, dict) else {}


class PutBackFile(Strict):
    """How many of the data that a model was made from lie in the 95 % interval that a query gives for them."""

    inside: int = Field(ge=0, description="Values of K', K'' and K1 inside their interval of prediction.")
    values: int = Field(gt=0, description="All values of K', K'' and K1 that were put back.")
    outside: list[str] = Field(
        default=[], max_length=LONGEST, description="Tests with values outside, the worst first."
    )

    @property
    def least(self) -> int:
        """The number inside that right intervals reach in 95 % of such sets of data; see `stats.binomial_least`."""
        return stats.binomial_least(self.values, COVERAGE)

    @property
    def low(self) -> bool:
        """Whether too few are inside."""
        return self.inside < self.least

    @property
    def sentence(self) -> str:
        """The share; where it is low, what that means and what to do."""
        share = f"{self.inside} of {self.values} data (K', K'', K1), {100 * self.inside / self.values:.0f} %,"
        said = f"Put back: {share} lie within the 95 % interval that a query gives for their own test"
        if not self.low:
            return f"{said}."
        worst = f" Worst: {first_of(self.outside, _MOST_NAMED)}." if self.outside else ""
        return (
            f"{said}; right intervals hold at least {self.least} (95 % confidence).{worst} The intervals are too "
            "narrow for these data. Check these tests; if they are right, state a larger u(K*) with --std, or try "
            "another --model."
        )


class Named(Strict):
    """Base of values and axes with the name and SI unit of a column."""

    name: str
    unit: str

    @property
    def column(self) -> str:
        """The column: "pressure [Pa]"."""
        return f"{self.name} [{self.unit}]"


class NamedValue(Named):
    """A value with its name and SI unit."""

    value: float

    @classmethod
    def of(cls, state: Mapping[str, float]) -> list[NamedValue]:
        """The values of a state, by column."""
        split = [(*split_column(column), value) for column, value in state.items()]
        return [cls(name=name, unit=unit, value=value) for name, unit, value in split]


def finite_or_none(value: float) -> float | None:
    """The number, or None if it is not finite, because JSON has no such number."""
    return value if np.isfinite(value) else None


def split_column(column: str) -> tuple[str, str]:
    """Name and unit of a column: "pressure [Pa]"; the unit is 1 where there is none."""
    name, mark, unit = column.rpartition(" [")
    return (name, unit.removesuffix("]")) if mark else (column, "1")


class AxisFile(Grown, Named):
    """An axis of a map, with the value of each tested condition."""

    later: ClassVar = ("logarithmic",)
    values: list[float] = Field(max_length=LONGEST)
    logarithmic: StrictBool = Field(default=False, description="Whether the axis is scaled by its logarithm.")


class SurfaceFile(Strict):
    """K1, or its logarithm, as a polynomial of the scaled axes, from the static tests; the link is that of the map."""

    terms: list[list[int]] = Field(max_length=500)
    coefficients: list[float] = Field(max_length=500)
    covariance: list[list[float]] = Field(max_length=500)
    scatter: Share = Field(description="Relative scatter of conditions [1].")
    std: Share = Field(description="Relative standard uncertainty that all static tests share [1].")

    @classmethod
    def of(cls, found: ValueSurface) -> SurfaceFile:
        """The record of a surface."""
        return cls(**{name: np.asarray(getattr(found, name)).tolist() for name in cls.model_fields})

    def surface(self, link: Link) -> ValueSurface:
        """The surface of this record."""
        terms, size = tuple(tuple(one) for one in self.terms), len(self.terms)
        covariance = np.array(self.covariance, dtype=float).reshape(size, size)
        return ValueSurface(terms, np.array(self.coefficients, dtype=float), covariance, self.scatter, self.std, link)


class ToleranceFile(Strict):
    """An axis that the campaign names itself, with the difference within which two of its values are the same."""

    column: str
    relative: float = Field(default=0.0, ge=0, description="Fraction of the larger value [1].")
    absolute: float = Field(default=0.0, ge=0, description="In the unit of the column, added to the relative one.")


class OffsetFile(Strict):
    """The error of a tested condition about the surfaces of a map: that of the specimen as it was mounted."""

    value: tuple[float, float] = Field(description="Error of Re log K* and of Im log K* [1].")
    covariance: list[list[float]] = Field(
        max_length=LONGEST, description="Covariance of the linked parameters and of the two errors."
    )


def check_offsets(where: str, offsets: Sequence[OffsetFile], conditions: int, parameters: int) -> None:
    """ModelError unless there are none, or one of each condition."""
    if len(offsets) not in (0, conditions):
        raise ModelError(f"{where}: {len(offsets)} offsets for {conditions} tested conditions")
    for one in offsets:
        if max(map(abs, one.value)) > LARGEST:
            raise ModelError(f"{where}: an offset is beyond all measure: it was changed")
        check_covariance(f"{where}, offsets", one.covariance, parameters + 2)


def check_covariance(where: str, rows: list[list[float]], size: int) -> None:
    """ModelError unless the rows are a covariance of this size."""
    if len(rows) != size or any(len(row) != size for row in rows):
        raise ModelError(f"{where}: the covariance is not {size} by {size}")
    matrix = np.array(rows, dtype=float).reshape(size, size)
    if size and np.abs(matrix).max() > LARGEST**2:
        raise ModelError(f"{where}: the covariance is none: a number in it is beyond all measure")
    std = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    scale = np.where(std > 0, std, 1.0)
    correlation = matrix / np.outer(scale, scale)
    sound = np.all(np.diag(matrix) >= 0) and np.allclose(correlation, correlation.T, atol=_ROUND_OFF)
    if not sound or (size and np.linalg.eigvalsh(correlation)[0] < -_ROUND_OFF * size):
        raise ModelError(f"{where}: the covariance is none: it is not symmetric or has a negative direction")
