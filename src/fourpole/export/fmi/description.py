"""The descriptions of an FMU as XML: modelDescription.xml of FMI 2.0 and 3.0, and buildDescription.xml."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass

from fourpole.export.fmi.csource import COMPILED
from fourpole.export.fmi.variables import NOMINAL, UNITS, Point, Variable, states_in, variables_of
from fourpole.version import VERSION

_INPUTS = range(1, 5)
_FORCE, _POINT, _FIRST_STATE = 5, 6, 8
_BASES = ("kg", "m", "s", "rad")


@dataclass(frozen=True)
class Model:
    """What the descriptions are of: name of the binary, words, and operating points."""

    identifier: str
    name: str
    about: str
    token: str
    points: Sequence[Point]


def model_description(model: Model, version: int) -> bytes:
    """The file modelDescription.xml of a version of FMI, 2 or 3."""
    return _bytes(_fmi2(model) if version == 2 else _fmi3(model))


def build_description(model: Model) -> bytes:
    """The file buildDescription.xml of FMI 3.0."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = _child(root, "BuildConfiguration", modelIdentifier=model.identifier)
    sources = _child(configuration, "SourceFileSet", language="C99")
    for name in COMPILED[3]:
        _child(sources, "SourceFile", name=name)
    return _bytes(root)


def _fmi2(model: Model) -> ET.Element:
    root = _root(model, "2.0", "guid", numberOfEventIndicators="0")
    for kind in ("ModelExchange", "CoSimulation"):
        can = {"canNotUseMemoryManagementFunctions": "true", "canGetAndSetFMUstate": "true"}
        can |= {"canSerializeFMUstate": "true", "providesDirectionalDerivative": "true"}
        if kind == "CoSimulation":
            can |= {"canHandleVariableCommunicationStepSize": "true", "canInterpolateInputs": "true"}
        files = _child(_child(root, kind, modelIdentifier=model.identifier, **can), "SourceFiles")
        for name in COMPILED[2]:
            _child(files, "File", name=name)
    _units(root)
    _log_categories(root)
    _child(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize="0.001")
    variables = variables_of(model.points)
    listed = _child(root, "ModelVariables")
    for at, one in enumerate(variables):
        common = {"name": one.name, "valueReference": str(at), "causality": one.causality}
        scalar = _child(listed, "ScalarVariable", **common, variability=one.variability, **_optional(one))
        if at == _POINT:
            _child(scalar, "Integer", start="1", min="1", max=str(len(model.points)))
        else:
            derivative = {} if one.derivative is None else {"derivative": str(one.derivative + 1)}
            _child(scalar, "Real", **_value(one), **derivative)
    structure = _child(root, "ModelStructure")
    states = states_in(model.points)
    dependencies = _dependencies(model.points)
    outputs = _child(structure, "Outputs")
    _child(outputs, "Unknown", index=str(_FORCE + 1), dependencies=_joined(dependencies[_FORCE], 1))
    rates = [at for at, one in enumerate(variables) if one.derivative is not None]
    if rates:
        derivatives = _child(structure, "Derivatives")
        for at in rates:
            _child(derivatives, "Unknown", index=str(at + 1), dependencies=_joined(dependencies[at], 1))
    initial = _child(structure, "InitialUnknowns")
    for at in [_FORCE, *range(_FIRST_STATE, _FIRST_STATE + 2 * states)]:
        _child(initial, "Unknown", index=str(at + 1))
    return root


def _fmi3(model: Model) -> ET.Element:
    root = _root(model, "3.0", "instantiationToken")
    for kind in ("ModelExchange", "CoSimulation"):
        can = {"canGetAndSetFMUState": "true", "canSerializeFMUState": "true", "providesDirectionalDerivatives": "true"}
        if kind == "CoSimulation":
            can |= {"canHandleVariableCommunicationStepSize": "true"}
        _child(root, kind, modelIdentifier=model.identifier, **can)
    _units(root)
    _log_categories(root)
    _child(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize="0.001")
    variables = variables_of(model.points)
    listed = _child(root, "ModelVariables")
    for at, one in enumerate(variables):
        common = {"name": one.name, "valueReference": str(at), "causality": one.causality}
        common |= {"variability": one.variability, **_optional(one)}
        if at == _POINT:
            _child(listed, "Int32", **common, min="1", max=str(len(model.points)), start="1")
        else:
            derivative = {} if one.derivative is None else {"derivative": str(one.derivative)}
            _child(listed, "Float64", **common, **_value(one), **derivative)
    structure = _child(root, "ModelStructure")
    dependencies = _dependencies(model.points)
    _child(structure, "Output", valueReference=str(_FORCE), dependencies=_joined(dependencies[_FORCE]))
    states = states_in(model.points)
    for at in range(_FIRST_STATE + states, _FIRST_STATE + 2 * states):
        _child(structure, "ContinuousStateDerivative", valueReference=str(at), dependencies=_joined(dependencies[at]))
    for at in [_FORCE, *range(_FIRST_STATE, _FIRST_STATE + 2 * states)]:
        _child(structure, "InitialUnknown", valueReference=str(at))
    return root


def _root(model: Model, version: str, token: str, **more: str) -> ET.Element:
    return ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": model.name,
            token: model.token,
            "description": model.about,
            "generationTool": f"Fourpole {VERSION}",
            "variableNamingConvention": "structured",
            **more,
        },
    )


def _units(root: ET.Element) -> None:
    listed = _child(root, "UnitDefinitions")
    for name, exponents in UNITS.items():
        bases = {base: str(power) for base, power in zip(_BASES, exponents, strict=True) if power}
        _child(_child(listed, "Unit", name=name), "BaseUnit", **bases)


def _log_categories(root: ET.Element) -> None:
    listed = _child(root, "LogCategories")
    _child(listed, "Category", name="logStatusError", description="What was wrong in a call that ended in an error")


def _optional(one: Variable) -> dict[str, str]:
    found = {"description": one.about, "initial": one.initial}
    return {name: text for name, text in found.items() if text}


def _value(one: Variable) -> dict[str, str]:
    """Unit, bounds, size and start of a variable."""
    found = {"unit": one.unit}
    if one.least == 0.0:
        found["min"] = "0"
    if one.unit == "m" and one.causality == "local":
        found["nominal"] = repr(NOMINAL)
    if one.start is not None:
        found["start"] = repr(one.start)
    return found


def _dependencies(points: Sequence[Point]) -> dict[int, list[int]]:
    """Places of what the force and the derivatives of the states follow from, by their own place."""
    states = states_in(points)
    found = {_FORCE: [*_INPUTS, *range(_FIRST_STATE, _FIRST_STATE + states)]}
    for at in range(states):
        together = {other for point in points for group in point.states if at in group for other in group}
        found[_FIRST_STATE + states + at] = [1, 3, *(_FIRST_STATE + other for other in sorted(together))]
    return found


def _joined(places: Sequence[int], base: int = 0) -> str:
    return " ".join(str(at + base) for at in places)


def _child(parent: ET.Element, tag: str, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, tag, attributes)


def _bytes(root: ET.Element) -> bytes:
    ET.indent(root)
    found: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return found + b"\n"
