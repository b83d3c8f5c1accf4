"""An FMU: its descriptions as XML, its C source, the numbers of the model, and the binary for this platform."""

from __future__ import annotations

import json
import platform
import re
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

from fourpole.export.fmi.variables import (
    FIRST_STATE,
    NOMINAL,
    UNITS,
    Point,
    Variable,
    draws_in,
    is_belted,
    states_of_part,
    states_together,
    variables_of,
)
from fourpole.io.processes import output_of, program_path
from fourpole.version import VERSION

#: Files that are compiled and headers, by version of FMI; the headers of FMI are those of the standard, unchanged.
COMPILED = {2: ("branches.c", "instance.c", "fmi2.c", "model.c"), 3: ("branches.c", "instance.c", "fmi3.c", "model.c")}
_HEADERS = {
    2: ("fmi2FunctionTypes.h", "fmi2Functions.h", "fmi2TypesPlatform.h"),
    3: ("fmi3FunctionTypes.h", "fmi3Functions.h", "fmi3PlatformTypes.h"),
}
_OWN_HEADERS = ("branches.h", "instance.h")
#: Lines for models with a belt; the group has those that stand in their place without one.
_OF_BELT = re.compile(r"^#ifdef BELT\n(?:(?!^#e).*\n)*(?:#else\n((?:(?!^#e).*\n)*))?#endif\n", re.M)
#: Commands that are tried, in this order.
COMPILERS = ("gcc", "cc", "clang")
#: Time that the compiler may take [s].
_LONGEST = 120.0
#: Variables by which a user says where the compiler finds its headers and libraries.
_OF_COMPILER = ("C_INCLUDE_PATH", "CPATH", "DEVELOPER_DIR", "GCC_EXEC_PREFIX", "LIBRARY_PATH", "SDKROOT")
_ENDINGS = {"win32": ".dll", "darwin": ".dylib"}
_SYSTEMS = {"win32": ("win", "windows"), "darwin": ("darwin", "darwin")}
_MACHINES = {"amd64": "x86_64", "arm64": "aarch64", "i386": "x86", "i686": "x86"}


class NoBinaryError(Exception):
    """There is no binary; the message says why and what to do."""


def common_source(version: int, *, belted: bool = False) -> dict[str, str]:
    """The files that all models have in common, by name; without a belt they have no word of it."""
    names = (*compiled_files(version, belted=belted)[:-1], *_OWN_HEADERS, *_HEADERS[version])
    place = files("fourpole.export.fmi") / "c"
    found = {name: (place / name).read_text(encoding="utf-8") for name in names}
    return found if belted else {name: _OF_BELT.sub(r"\1", text) for name, text in found.items()}


def compiled_files(version: int, *, belted: bool = False) -> tuple[str, ...]:
    """The files that are compiled, that of the numbers last."""
    return ("belt.c",) * belted + COMPILED[version]


def model_source(points: Sequence[Point], token: str) -> dict[str, str]:
    """The files with the numbers of a model, by name."""
    variables = variables_of(points)
    parameters = parameters_of(variables)
    last = variables.index(parameters[-1]) + 1
    systems = [one.system for one in points] + [one.force_on_belt for one in points] * is_belted(points)
    draws = [_drawn(points, at) for at in range(draws_in(points))]
    sizes = {"POINTS": len(systems), "STATES": states_of_part(points), "PARAMETERS": len(parameters)}
    sizes["DRAWS"] = len(draws)
    header = ["/* Sizes of this model, and its token. */", "#ifndef MODEL_H", "#define MODEL_H", ""]
    header += [f"#define TOKEN {json.dumps(token)}", *(f"#define {name} {value}" for name, value in sizes.items())]
    header += ["#define BELT"] * is_belted(points)
    counts = [(len(one.springs), len(one.pair_springs)) for one in systems]
    firsts = [sum(2 + 2 * n + 4 * m for n, m in counts[:at]) for at in range(len(counts))]
    numbers = [
        "/* The numbers of this model in SI units, in the order of the value references. */",
        '#include "branches.h"',
        "",
        _array("int", "model_branches[POINTS]", (str(n) for n, _ in counts)),
        _array("int", "model_pairs[POINTS]", (str(m) for _, m in counts)),
        _array("int", "model_first[POINTS]", map(str, firsts)),
        _array("double", "model_defaults[ROOM(PARAMETERS)]", (repr(one.start) for one in parameters)),
        _array(
            "double", "model_draws[ROOM(DRAWS * PARAMETERS)]", (repr(one) for row in draws or [[0.0]] for one in row)
        ),
        _array("double", "model_least[ROOM(PARAMETERS)]", (repr(one.least) for one in parameters)),
        _array("char *const", "model_names[VARIABLES]", (json.dumps(one.name) for one in variables[:last])),
    ]
    if is_belted(points):
        weights = [one.weight for one in points] * 2
        numbers += ["", "extern const double model_weights[POINTS];"]
        numbers += [_array("double", "model_weights[POINTS]", map(repr, weights))]
    return {"model.h": "\n".join([*header, "", "#endif", ""]), "model.c": "\n".join([*numbers, ""])}


def parameters_of(variables: Sequence[Variable]) -> list[Variable]:
    """The parameters of the operating points, without the point and the preload."""
    return [one for one in variables if one.name.startswith(("points[", "belts["))]


def _drawn(points: Sequence[Point], at: int) -> list[float]:
    """The numbers of one draw, in the order of the parameters."""
    there = [replace(one, system=one.draws[at][0], belt=one.draws[at][1]) for one in points]
    return [float(one.start or 0.0) for one in parameters_of(variables_of(there))]


def _array(kind: str, name: str, values: Iterable[str]) -> str:
    return f"const {kind} {name} = {{\n" + "".join(f"    {one},\n" for one in values) + "};"


def binary_place(identifier: str, version: int) -> str:
    """Path of the binary of this platform inside an FMU."""
    short, long = _SYSTEMS.get(sys.platform, ("linux", "linux"))
    if version == 2:
        folder = f"{short}{64 if sys.maxsize > 2**32 else 32}"
    else:
        machine = platform.machine().lower()
        folder = f"{_MACHINES.get(machine, machine)}-{long}"
    return f"binaries/{folder}/{identifier}{_ENDINGS.get(sys.platform, '.so')}"


def compiled(source: Mapping[str, str], version: int, *, belted: bool = False) -> bytes:
    """The shared library of the files of a source; `NoBinaryError` if there is no compiler or it fails."""
    compiler = next((found for name in COMPILERS if (found := program_path(name))), None)
    if compiler is None:
        raise NoBinaryError(f"no C compiler was found ({', '.join(COMPILERS)}): install one, as gcc, and export again")
    flags = ["-std=c99", "-O2", "-shared", "-fvisibility=hidden", *([] if sys.platform == "win32" else ["-fPIC"])]
    with tempfile.TemporaryDirectory() as folder:
        for name, text in source.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        command = [compiler, *flags, "-o", "binary", *compiled_files(version, belted=belted)]
        try:
            code, _, said = output_of(command, seconds=_LONGEST, folder=folder, also=_OF_COMPILER)
        except OSError as error:
            raise NoBinaryError(f"{compiler} could not be run ({error})") from None
        if code or not Path(folder, "binary").is_file():
            first = next(iter(said.decode(errors="replace").strip().splitlines()), f"exit code {code}")
            raise NoBinaryError(f"{compiler} failed: {first}")
        return Path(folder, "binary").read_bytes()


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
