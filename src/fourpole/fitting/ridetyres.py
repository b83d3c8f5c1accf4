"""Tyres for a ride: the models of a file at operating points, with their errors and those that they have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.specimen import Specimen
from fourpole.errors import FourpoleError, ModelError
from fourpole.fitting.measured import Measured, read_measured
from fourpole.fitting.modelfile import ConditionFile, ModelEntry, ModelFile, read_model_file
from fourpole.fitting.placed import PlacedModel, placed_models
from fourpole.io.folders import model_in, resolved
from fourpole.models.discrepancy import with_error
from fourpole.models.fit import moved_by
from fourpole.models.laws import root_of
from fourpole.quantities import ShownUnits
from fourpole.ride.compare import Tyre

#: Largest number of tyres that one file gives.
_MOST = 40


@dataclass(frozen=True, eq=False)
class RideTyre:
    """A tyre for a ride.

    Attributes
    ----------
    tyre : Tyre
    label : str
        Specimen and operating point in words.
    specimen : str
    state : dict of str to float
        The operating point, by column.
    band : (float, float) [Hz]
        Frequencies at which K* was measured.
    place : path
        The file.
    remarks : tuple of str
    """

    tyre: Tyre
    label: str
    specimen: str
    state: dict[str, float]
    band: tuple[float, float]
    place: Path
    remarks: tuple[str, ...] = ()

    @property
    def preload(self) -> float | None:
        """Static load on the tyre at the operating point [N]; None if it is not stated."""
        return self.state.get(q.PRELOAD.head)


def tyres_for_ride(
    path: str | Path,
    points: Sequence[Mapping[str, float]] = (),
    *,
    specimen: str | None = None,
    beyond: bool = False,
    units: ShownUnits | None = None,
    belt: Specimen | None = None,
) -> list[RideTyre]:
    """The tyres of a model file, each at its operating points.

    Parameters
    ----------
    path : path
        A model file or a map, or the folder of results or of a campaign that has one.
    points : sequence of mappings of str to float
        Operating points, by column; without them all conditions of a file of fits, which a map does not have.
    specimen : str, optional
        Only this one of the file.
    beyond : bool
        Whether to go outside the tested conditions.
    units : ShownUnits, optional
        Units of labels and messages.
    belt : Specimen, optional
        The belt of the tyres, in place of that in the file.

    Raises
    ------
    ModelError
        If a model is not causal, a point is not in the file or is outside the tests, or a map is given no point.
    FileError
        If the file cannot be read.
    """
    place = resolved(model_in(path))
    file, wanted = read_model_file(place), ShownUnits() if units is None else units
    placed = placed_models(file, place.name, points, specimen=specimen, beyond=beyond, units=wanted, belt=belt)
    found = [_tyre(place, one, wanted) for one in placed]
    if len(found) > _MOST:
        raise ModelError(
            f"{place.name}: has {len(found)} tyres and conditions: state --at for some of them, or --specimen"
        )
    return _with_common_errors(found, file, place)


def _tyre(place: Path, one: PlacedModel, units: ShownUnits) -> RideTyre:
    """A model at an operating point with the errors that the file has."""
    words = ", ".join(units.setting(column, value) for column, value in one.state.items())
    source = f"{place}: {one.specimen}" + ("" if one.map.axes.names else f": {words}")
    tyre = Tyre(
        model=one.model,
        values=one.values,
        errors={source: one.map.errors(one.point)},
        discrepancy=one.map.spread(),
        name=one.label,
        origin=str(place),
        belt=one.belt,
    )
    return RideTyre(tyre, one.label, one.specimen, one.state, one.band, place, one.remarks)


def _with_common_errors(found: list[RideTyre], file: ModelFile, place: Path) -> list[RideTyre]:
    """The tyres of fits with the errors of sensors and rig as their own source, which they share.

    They are known where the file lies beside the results of which it was made.
    """
    fitted = [one for one in found if file.map_entry(one.specimen) is None]
    if len(fitted) < 2:
        return found
    try:
        measured = read_measured(place.parent)
    except FourpoleError:
        return found
    if measured.sha256 != file.provenance.sha256:
        return found
    return [_split(one, file, measured.of(one.specimen), place) for one in found]


def _split(one: RideTyre, file: ModelFile, measured: Sequence[Measured], place: Path) -> RideTyre:
    """A tyre with the errors that it shares with others apart from its own; as it is, where they are not known."""
    entry, condition = file.model_entry(one.specimen), file.condition_at(one.specimen, one.state)
    tests = () if condition is None else tuple(condition.tests)
    of = next((each for each in measured if each.tests == tests), None)
    if entry is None or condition is None or of is None or not of.shared.size:
        return one
    shared = _by_shared_errors(entry, condition, one.tyre, of)
    own = root_of(np.array(condition.covariance) - shared @ shared.T)
    errors = {next(iter(one.tyre.errors)): own, f"{place.parent}: sensors and rig": shared}
    return replace(one, tyre=replace(one.tyre, errors=errors))


def _by_shared_errors(entry: ModelEntry, condition: ConditionFile, tyre: Tyre, measured: Measured) -> FloatArray:
    """Changes (P, p) of fitted parameters by one standard uncertainty of each error that conditions share."""
    k = tyre.stiffness(measured.own.omega)
    data = with_error(measured.data, entry.discrepancy).at(k)
    if data.relative is None:
        return np.zeros((tyre.values.size, 0))
    return moved_by(tyre.model, tyre.values, np.array(condition.covariance), data, data.relative * k[:, None])
