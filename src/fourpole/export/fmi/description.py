"""The descriptions of an FMU as XML: modelDescription.xml of FMI 2.0 and 3.0, and buildDescription.xml."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass

from fourpole.export.fmi.csource import compiled_files
from fourpole.export.fmi.variables import (
    FIRST_STATE,
    NOMINAL,
    UNITS,
    Point,
    Variable,
    is_belted,
    states_of_part,
    states_together,
    variables_of,
)
from fourpole.version import VERSION

_INPUTS = range(1, 5)
_FORCE = 5
_TWO = 2
#: What an FMU can do by version of FMI, and what it can besides in co-simulation.
_CAN = {
    2: (
        *("canNotUseMemoryManagementFunctions", "canGetAndSetFMUstate", "canSerializeFMUstate"),
        "providesDirectionalDerivative",
    ),
    3: ("canGetAndSetFMUState", "canSerializeFMUState", "providesDirectionalDerivatives"),
}
_CAN_STEP = {
    2: ("canHandleVariableCommunicationStepSize", "canInterpolateInputs"),
    3: ("canHandleVariableCommunicationStepSize",),
}
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
    root = ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{version}.0",
            "modelName": model.name,
            "guid" if version == _TWO else "instantiationToken": model.token,
            "description": model.about,
            "generationTool": f"Fourpole {VERSION}",
            "variableNamingConvention": "structured",
            **({"numberOfEventIndicators": "0"} if version == _TWO else {}),
        },
    )
    _interfaces(root, model, version)
    listed = _child(root, "UnitDefinitions")
    for name, exponents in UNITS.items():
        bases = {base: str(power) for base, power in zip(_BASES, exponents, strict=True) if power}
        _child(_child(listed, "Unit", name=name), "BaseUnit", **bases)
    categories = _child(root, "LogCategories")
    _child(categories, "Category", name="logStatusError", description="What was wrong in a call that ended in an error")
    _child(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize="0.001")
    _variables(_child(root, "ModelVariables"), model, version)
    _structure(_child(root, "ModelStructure"), model, version)
    return _bytes(root)


def build_description(model: Model) -> bytes:
    """The file buildDescription.xml of FMI 3.0."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = _child(root, "BuildConfiguration", modelIdentifier=model.identifier)
    sources = _child(configuration, "SourceFileSet", language="C99")
    for name in compiled_files(3, belted=is_belted(model.points)):
        _child(sources, "SourceFile", name=name)
    return _bytes(root)


def _interfaces(root: ET.Element, model: Model, version: int) -> None:
    """What the FMU can do in model exchange and in co-simulation; FMI 2.0 also has its sources there."""
    for kind in ("ModelExchange", "CoSimulation"):
        can = _CAN[version] + (_CAN_STEP[version] if kind == "CoSimulation" else ())
        interface = _child(root, kind, modelIdentifier=model.identifier, **dict.fromkeys(can, "true"))
        if version == _TWO:
            sources = _child(interface, "SourceFiles")
            for name in compiled_files(version, belted=is_belted(model.points)):
                _child(sources, "File", name=name)


def _variables(listed: ET.Element, model: Model, version: int) -> None:
    """A variable is an element of its type in FMI 3.0, and in FMI 2.0 one that holds its type, which counts from 1."""
    for place, variable in enumerate(variables_of(model.points)):
        common = {"name": variable.name, "valueReference": str(place), "causality": variable.causality}
        words = {"description": variable.about, "initial": variable.initial}
        common |= {"variability": variable.variability, **{key: text for key, text in words.items() if text}}
        value = _value(variable)
        if variable.derivative is not None:
            value["derivative"] = str(variable.derivative + (1 if version == _TWO else 0))
        if version == _TWO:
            scalar = _child(listed, "ScalarVariable", **common)
            _child(scalar, "Real" if variable.most is None else "Integer", **value)
        elif variable.most is not None:
            _child(listed, "Int32", **common, **value)
        else:
            _child(listed, "Float64", **common, **value)


def _structure(structure: ET.Element, model: Model, version: int) -> None:
    """What depends on what; FMI 2.0 names a variable by its index from 1, FMI 3.0 by its value reference."""
    dependencies = _dependencies(model.points)
    forces, states, rates = _places(model.points)
    reference, base = ("index", 1) if version == _TWO else ("valueReference", 0)
    for group, tag, places in (
        ("Outputs", "Output", forces),
        ("Derivatives", "ContinuousStateDerivative", rates),
        ("InitialUnknowns", "InitialUnknown", sorted([*forces, *states, *rates])),
    ):
        if not places:
            continue
        parent = _child(structure, group) if version == _TWO else structure
        for place in places:
            unknown = {reference: str(place + base)}
            if group != "InitialUnknowns":
                unknown["dependencies"] = " ".join(str(other + base) for other in dependencies[place])
            _child(parent, "Unknown" if version == _TWO else tag, **unknown)


def _value(one: Variable) -> dict[str, str]:
    """Unit, bounds, size and start of a variable."""
    if one.most is not None:
        return {"start": f"{one.start:.0f}", "min": f"{one.least:.0f}", "max": str(one.most)}
    found = {"unit": one.unit}
    if one.least == 0.0:
        found["min"] = "0"
    if one.unit == "m" and one.causality == "local":
        found["nominal"] = repr(NOMINAL)
    if one.start is not None:
        found["start"] = repr(one.start)
    return found


def _places(points: Sequence[Point]) -> tuple[list[int], list[int], list[int]]:
    """Places of the forces, of the states, and of their derivatives in the same order."""
    count, last = states_of_part(points), len(variables_of(points))
    firsts = [FIRST_STATE] + [last - 2 * count] * is_belted(points)
    forces = [_FORCE] + [last - 2 * count - 1] * is_belted(points)
    states = [first + at for first in firsts for at in range(count)]
    return forces, states, [one + count for one in states]


def _dependencies(points: Sequence[Point]) -> dict[int, list[int]]:
    """Places of what the forces and the derivatives of the states follow from, by their own place."""
    count, (forces, states, rates) = states_of_part(points), _places(points)
    found = {force: [*_INPUTS, *states] for force in forces}
    for at, (state, rate) in enumerate(zip(states, rates, strict=True)):
        own = at % count
        systems = [one.system if at < count else one.force_on_belt for one in points]
        together = {other for one in systems for group in states_together(one) if own in group for other in group}
        found[rate] = [1, 3, *(state - own + other for other in sorted(together))]
    return found


def _child(parent: ET.Element, tag: str, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, tag, attributes)


def _bytes(root: ET.Element) -> bytes:
    ET.indent(root)
    found: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return found + b"\n"
