"""The inertia of specimens: as specimens.csv has it, in a model file, or as an option states it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import polars as pl
from pydantic import Field

from fourpole import quantities as q
from fourpole.core.condition import AXES
from fourpole.core.specimen import TYRE, Form, Specimen
from fourpole.errors import UnitError
from fourpole.fitting.modelparts import Strict
from fourpole.fitting.rows import FoundBody, as_frame
from fourpole.io.published import Published

#: Table of a results folder with the inertia of each specimen at each condition.
SPECIMENS = "specimens.csv"
_FORM, _MASS, _SHARE, _SPREAD = q.FORM.head, q.BELT_MASS.head, q.BELT_SHARE.head, q.BELT_SPREAD.head
#: Share of a car's tyre, where none is stated [1].
USUAL_SHARE = TYRE


class InertiaFile(Strict):
    """The mass of a specimen between its ends: a belt between two springs of one law, or a mass spread along it."""

    form: Literal["belt", "rod"]
    mass: float = Field(gt=0, le=1e6, description="Mass of the belt, or of the rod [kg].")
    share: float | None = Field(
        gt=0, le=1e6, description="Stiffness of the spring at the contact over that at the rim [1]; null: of a rod."
    )
    spread: float | None = Field(
        default=None, ge=0, le=1, description="Of a rod: 0 for a mass in its middle, 1 if it is spread evenly [1]."
    )

    @property
    def specimen(self) -> Specimen:
        """The specimen with this inertia."""
        return Specimen(
            Form(self.form), self.mass, self.share or 1.0, spread=1.0 if self.spread is None else self.spread
        )


def inertia_of(body: FoundBody) -> InertiaFile:
    """The mass of a specimen as a model file has it."""
    belt = body.form is Form.BELT
    shape = {"share": body.row[_SHARE] if belt else None, "spread": None if belt else body.row.get(_SPREAD)}
    return InertiaFile.model_validate({"form": body.form.value, "mass": body.row[_MASS], **shape})


def bodies_of(results: Published) -> list[FoundBody]:
    """The same, from the files of results."""
    if not results.has(SPECIMENS):
        return []
    frame = as_frame(SPECIMENS, results.read(SPECIMENS))
    numbers = [one for one in (_MASS, _SHARE, _SPREAD, *(axis.column for axis in AXES)) if one in frame.columns]
    found = frame.with_columns(pl.col(one).cast(pl.Float64, strict=False) for one in numbers)
    return [FoundBody(row) for row in found.filter(pl.col(_MASS) > 0).to_dicts()]


def mean_inertia(found: Sequence[InertiaFile | None]) -> InertiaFile | None:
    """The inertia between conditions: the mean mass, and the geometric mean of the shares."""
    known = [one for one in found if one is not None]
    if not known:
        return None
    shares = [one.share for one in known if one.share is not None]
    share = float(np.exp(np.mean(np.log(shares)))) if shares else None
    spreads = [one.spread for one in known if one.spread is not None]
    spread = float(np.mean(spreads)) if spreads else None
    return InertiaFile(form=known[0].form, mass=float(np.mean([one.mass for one in known])), share=share, spread=spread)


def belt_stated(mass: float | None, share: float | None) -> Specimen | None:
    """The belt that options state [kg], [1]; None where they state none, massless for a mass of 0.

    Examples
    --------
    >>> belt_stated(7.0, None).share
    0.2
    """
    if mass is None:
        if share is not None:
            raise UnitError("--belt-share is that of a belt: state its mass too, as --belt-mass '7 kg'")
        return None
    if share is not None and not 0 < share < np.inf:
        raise UnitError("--belt-share: must be positive, as 0.2")
    return Specimen(Form.BELT, mass, USUAL_SHARE if share is None else share) if mass else Specimen()
