"""The specimens with a mass, as specimens.csv of some results has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.core.condition import AXES, axis_of
from fourpole.core.specimen import Form, Specimen
from fourpole.quantities import Quantity
from fourpole.study.study import Study


@dataclass(frozen=True)
class FoundBody:
    """A row of specimens.csv that has a mass: `row` by the heads of its columns, in SI."""

    row: Mapping[str, Any]

    @property
    def tyre(self) -> str:
        """Name of the specimen."""
        return str(self.row[q.TYRE.head])

    @property
    def form(self) -> Form:
        """A belt or a rod."""
        return Form(self.row[q.FORM.head])

    @property
    def place(self) -> dict[str, float]:
        """The stated values of its condition by the columns of the axes."""
        return {one.column: value for one in AXES if (value := self.row.get(one.column)) is not None}

    def pair(self, quantity: Quantity) -> tuple[float, float]:
        """Value and standard uncertainty; a blank value is not-a-number, a blank uncertainty 0."""
        value, std = (self.row.get(head) for head in quantity.heads)
        return np.nan if value is None else float(value), float(std or 0.0)

    def is_at(self, tyre: str, place: Mapping[str, float]) -> bool:
        """Whether a specimen and its condition without the frequency are those of this row."""
        axes = (axis_of(column) for column in place if column in self.row)
        return tyre == self.tyre and all(
            axis.same(None if np.isnan(place[axis.column]) else place[axis.column], self.row[axis.column], blank=True)
            for axis in axes
        )

    def specimen(self, stiffness: complex) -> Specimen:
        """The specimen, the share of which is that of the row where K* is `stiffness` [N/m]."""
        (mass, _), (share, _) = self.pair(q.BELT_MASS), self.pair(q.BELT_SHARE)
        exponent, (spread, _) = float(self.row[q.BELT_EXPONENT.head] or 0.0), self.pair(q.BELT_SPREAD)
        share, spread = 1.0 if np.isnan(share) else share, 1.0 if np.isnan(spread) else spread
        return Specimen(self.form, mass, share, exponent, stiffness, spread)


def bodies_in(results: Study) -> list[FoundBody]:
    """The specimens with a mass that the joint route found, at each condition without its frequency."""
    rows = results.tables["specimens"].to_dicts() if "specimens" in results.tables else []
    return [FoundBody(row) for row in rows if row[q.FORM.head] != Form.MASSLESS.value]
