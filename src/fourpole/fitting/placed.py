"""Models of a file at operating points: of fits the tested conditions, of a map any point inside the tested ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.condition import AXES
from fourpole.core.specimen import Form, Specimen
from fourpole.errors import ModelError, UnitError
from fourpole.fitting.accuracy import Accuracy, accuracy_of
from fourpole.fitting.modelfile import ModelFile
from fourpole.fitting.query import inertia_of, maps_of, place_of
from fourpole.models.interface import Model
from fourpole.models.operating import OperatingMap
from fourpole.models.realised import MASSLESS
from fourpole.quantities import ShownUnits
from fourpole.units import quantity, shown

_NAMES = {axis.column: axis.name for axis in AXES}
_KINDS = {axis.name: (axis.column, kind) for axis, kind in zip(AXES, ("pressure", "force", "temperature"), strict=True)}


@dataclass(frozen=True, eq=False)
class PlacedModel(ByValue):
    """A model of a file at one operating point.

    Attributes
    ----------
    specimen, label : str
        Name of the specimen; its name and the operating point in words.
    state : dict of str to float
        The operating point, by column.
    map : OperatingMap
        The map of the specimen, or its fit at one condition as a map of one point.
    point : (d,) float array
        The operating point on the axes of the map.
    values : (P,) float array
        Values of the model's parameters; those of a fit are as its file has them.
    accuracy : Accuracy
        That of the map, or of the fit.
    remarks : tuple of str
        What holds for the point alone: its distance from the tests, the temperature of a master curve.
    belt : Specimen
        The belt between the springs of K*; massless where there is none.
    """

    specimen: str
    label: str
    state: dict[str, float]
    map: OperatingMap
    point: FloatArray
    values: FloatArray
    accuracy: Accuracy
    remarks: tuple[str, ...] = ()
    belt: Specimen = MASSLESS

    @property
    def model(self) -> Model:
        """The model, which has no values of its own."""
        return self.map.model

    @property
    def band(self) -> tuple[float, float]:
        """Frequencies at which K* was measured [Hz]."""
        return self.map.band


def placed_models(
    file: ModelFile,
    name: str,
    points: Sequence[Mapping[str, float]] = (),
    *,
    specimen: str | None = None,
    beyond: bool | None = None,
    units: ShownUnits | None = None,
    belt: Specimen | None = None,
) -> list[PlacedModel]:
    """The models of a file, each at its operating points.

    Parameters
    ----------
    file : ModelFile
    name : str
        Name of the file in messages.
    points : sequence of mappings of str to float
        Operating points, by column; without them all conditions of a file of fits, which a map does not have.
    specimen : str, optional
        Only this one of the file.
    beyond : bool, optional
        Whether to go outside the tested conditions; None where a command has no option for it.
    units : ShownUnits, optional
        Units of labels and messages.
    belt : Specimen, optional
        The belt of the specimens, in place of that in the file.

    Raises
    ------
    ModelError
        If a point is not in the file or is outside the tests, a map is given no point, or there is no such specimen.
    """
    return [
        placed_at(file, name, one, state, units, beyond=beyond, belt=belt)
        for one in specimens(file, name, specimen)
        for state in (points or conditions_of(file, one, name))
    ]


def specimens(file: ModelFile, name: str, specimen: str | None) -> list[str]:
    """The one specimen, or all of a file; ModelError if the file has no such one."""
    if specimen is None:
        return file.tyres
    if specimen not in file.tyres:
        raise ModelError(f"{name}: is of {', '.join(map(shown, file.tyres))}, not of {shown(specimen)}")
    return [specimen]


def conditions_of(file: ModelFile, specimen: str, name: str) -> list[dict[str, float]]:
    """The conditions of a specimen in a file of fits; ModelError for a map over axes."""
    mapped, fits = file.map_entry(specimen), file.model_entry(specimen)
    if mapped is not None and mapped.axes:
        axes = [named(axis.column) for axis in mapped.axes]
        raise ModelError(
            f'{name}: is a map over {", ".join(axes)}: state the operating point, --at "{"=..., ".join(axes)}=..."'
        )
    return [one.coordinates for one in fits.conditions] if fits is not None and fits.conditions else [{}]


def placed_at(
    file: ModelFile,
    name: str,
    specimen: str,
    state: Mapping[str, float],
    units: ShownUnits | None = None,
    *,
    beyond: bool | None = None,
    belt: Specimen | None = None,
) -> PlacedModel:
    """The model of one specimen at one operating point; see `placed_models`."""
    units = ShownUnits() if units is None else units
    found = maps_of(file, specimen, state, units)
    lacking = [column for column in found.axes.names if column not in state]
    if lacking:
        raise ModelError(f'{name}: the map is over {named(lacking[0])}: state --at "{named(lacking[0])}=..."')
    point, _, remarks = place_of(file, found, dict(state), units, beyond=beyond)
    own = {**found.axes.constant, **dict(zip(found.axes.names, point.tolist(), strict=True))}
    words = ", ".join(units.setting(column, value) for column, value in own.items())
    label = ", ".join(filter(None, (specimen, words))) or "the specimen"
    fitted = file.condition_at(specimen, own)  # None for a map or a pressure between tests
    values = found.parameters(point[None])[0] if fitted is None else np.array(fitted.values)
    if belt is None:
        inertia = inertia_of(file, specimen, fitted)
        belt = MASSLESS if inertia is None else inertia.specimen
    if belt.form is Form.ROD:
        remarks = (
            *remarks,
            f"{label}: its own mass of {belt.mass:.4g} kg is not in the model: add half of it at each end",
        )
        belt = MASSLESS
    entry = file.map_entry(specimen) or file.model_entry(specimen)
    assert entry is not None
    remarks = (*remarks, *_at_reference(file, specimen))
    return PlacedModel(specimen, label, own, found, point, values, accuracy_of(entry, fitted), remarks, belt)


def _at_reference(file: ModelFile, name: str) -> list[str]:
    """A remark for the model of a master curve, which is at the reference temperature."""
    entry = file.model_entry(name)
    if entry is None or entry.temperature is None:
        return []
    at = f"{entry.temperature.reference:.4g} °C"
    return [f"K* {name and f'of {name} '}is that at {at}, the reference of its master curve"]


def named(column: str) -> str:
    """The name of an axis in options, or the column of an axis that the campaign names."""
    return _NAMES.get(column) or column


def operating_point(text: str) -> dict[str, float]:
    """An operating point in SI, by column, from a text such as "pressure=1.7 bar, preload=1000 N".

    Raises
    ------
    UnitError
        If the text is no operating point.

    Examples
    --------
    >>> operating_point("pressure=1.7 bar, camber [deg]=2")
    {'pressure [Pa]': 170000.0, 'camber [deg]': 2.0}
    """
    found = {}
    for part in text.split(","):
        name, mark, value = (one.strip() for one in part.partition("="))
        if not mark or not name:
            raise UnitError(f"--at: {shown(text)} is no operating point, as in 'pressure=1.7 bar, preload=3 kN'")
        try:
            if name in _KINDS:
                column, kind = _KINDS[name]
                found[column] = quantity(value, kind)
            else:
                found[name] = float(value)
        except UnitError as error:
            raise UnitError(f"--at {name}: {error}") from None
        except ValueError:
            raise UnitError(
                f"--at: {shown(part.strip())}: an axis is {', '.join(_KINDS)} with a unit, or a column and a number, "
                "as 'camber [deg]=2'"
            ) from None
    return found
