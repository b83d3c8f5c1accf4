"""Tyres for a ride: the models of a file at operating points, with their errors and those that they have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.condition import AXES
from fourpole.errors import FourpoleError, ModelError
from fourpole.fitting.measured import Measured, read_measured
from fourpole.fitting.modelfile import ConditionFile, ModelEntry, ModelFile, read_model_file
from fourpole.fitting.query import maps_of, place_of
from fourpole.io.folders import model_in
from fourpole.models.discrepancy import with_error
from fourpole.models.operating import OperatingMap
from fourpole.quantities import ShownUnits
from fourpole.ride.uncertainty import Tyre
from fourpole.units import shown

#: Largest number of tyres that one file gives.
_MOST = 40
_NAMES = {axis.column: axis.name for axis in AXES}


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
    remarks : tuple of str
    """

    tyre: Tyre
    label: str
    specimen: str
    state: dict[str, float]
    band: tuple[float, float]
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

    Raises
    ------
    ModelError
        If a model is not causal, a point is not in the file or is outside the tests, or a map is given no point.
    FileError
        If the file cannot be read.
    """
    place = model_in(path)
    file, wanted = read_model_file(place), ShownUnits() if units is None else units
    if specimen is not None and specimen not in file.tyres:
        raise ModelError(f"{place.name}: is of {', '.join(map(shown, file.tyres))}, not of {shown(specimen)}")
    every = [specimen] if specimen is not None else file.tyres
    found = [
        _tyre_at(file, place, name, state, wanted, beyond=beyond)
        for name in every
        for state in (points or _conditions(file, name, place.name))
    ]
    if len(found) > _MOST:
        raise ModelError(f"{place.name}: has {len(found)} tyres and conditions: state --at for some of them, or --tyre")
    return _with_common_errors(found, file, place)


def _conditions(file: ModelFile, name: str, label: str) -> list[dict[str, float]]:
    """The conditions of a specimen in a file of fits; ModelError for a map over axes."""
    for entry in file.maps:
        if entry.tyre == name and entry.axes:
            over = ", ".join(_named(axis.column) for axis in entry.axes)
            first = "=..., ".join(_named(axis.column) for axis in entry.axes)
            raise ModelError(f'{label}: is a map over {over}: state the operating point, --at "{first}=..."')
    return [
        {one.column: one.value for one in each.state}
        for entry in file.models
        if entry.tyre == name
        for each in entry.conditions
    ] or [{}]


def _tyre_at(
    file: ModelFile, place: Path, name: str, state: Mapping[str, float], units: ShownUnits, *, beyond: bool
) -> RideTyre:
    """One specimen at one operating point, with the errors that the file has."""
    found = maps_of(file, name, state, units)
    lacking = [column for column in found.axes.names if column not in state]
    if lacking:
        raise ModelError(f'{place.name}: the map is over {_named(lacking[0])}: state --at "{_named(lacking[0])}=..."')
    point, _, remarks = place_of(file, found, dict(state), units, beyond=beyond)
    remarks = (*remarks, *_at_reference(file, name))
    own = {**found.axes.constant, **dict(zip(found.axes.names, point.tolist(), strict=True))}
    words = ", ".join(units.setting(column, value) for column, value in own.items())
    label = ", ".join(filter(None, (name, words))) or "the specimen"
    source = f"{place}: {name}" + ("" if found.axes.names else f": {words}")
    tyre = Tyre(
        model=found.model,
        values=found.parameters(point[None])[0],
        errors={source: found.errors(point)},
        discrepancy=_scatter(found),
        name=label,
    )
    return RideTyre(tyre, label, name, own, found.band, remarks)


def _at_reference(file: ModelFile, name: str) -> list[str]:
    """A remark for the model of a master curve, which a ride has at the reference temperature."""
    laws = [entry.temperature for entry in file.models if entry.tyre == name and entry.temperature is not None]
    return [
        f"K* {name and f'of {name} '}is that at {law.reference:.4g} °C, the reference of its master curve"
        for law in laws
    ]


def _scatter(found: OperatingMap) -> tuple[float, float]:
    """Relative scatter of K* about the map, along and across K* [1]."""
    along, across = found.scatter.frequency
    return float(np.hypot(found.scatter.condition, along)), float(np.hypot(found.scatter.condition, across))


def _named(column: str) -> str:
    return _NAMES.get(column) or column


def _with_common_errors(found: list[RideTyre], file: ModelFile, place: Path) -> list[RideTyre]:
    """The tyres of fits with the errors of sensors and rig as their own source, which they share.

    They are known where the file lies beside the results of which it was made.
    """
    fitted = [one for one in found if not any(entry.tyre == one.specimen for entry in file.maps)]
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
    for entry in file.models:
        for condition in entry.conditions if entry.tyre == one.specimen else ():
            state = {each.column: each.value for each in condition.state}
            of = [each for each in measured if each.tests == tuple(condition.tests)]
            if state == one.state and of and of[0].shared.size:
                shared = _by_shared_errors(entry, condition, one.tyre, of[0])
                rest = np.array(condition.covariance) - shared @ shared.T
                values, vectors = np.linalg.eigh(rest)
                own = vectors * np.sqrt(np.maximum(values, 0.0))
                errors = {next(iter(one.tyre.errors)): own, f"{place.parent}: sensors and rig": shared}
                tyre = Tyre(one.tyre.model, one.tyre.values, errors, one.tyre.discrepancy, one.tyre.name)
                return RideTyre(tyre, one.label, one.specimen, one.state, one.band, one.remarks)
    return one


def _by_shared_errors(entry: ModelEntry, condition: ConditionFile, tyre: Tyre, measured: Measured) -> FloatArray:
    """Changes (P, p) of fitted parameters by one standard uncertainty of each error that conditions share.

    A least-squares fit moves by C J' V^-1 S for a change S of its data, with the covariance C of its parameters.
    """
    omega = measured.own.omega
    k = tyre.stiffness(omega)
    data = with_error(measured.data, entry.discrepancy).at(k)
    if data.relative is None:
        return np.zeros((tyre.values.size, 0))
    whiten = data.whitener()
    slopes = data.whitened(whiten, tyre.model.derivative(tyre.values, omega))
    moved = data.whitened(whiten, data.relative * k[:, None])
    return np.asarray(np.array(condition.covariance) @ slopes.T @ moved)
