"""The C source of an FMU: the files of `fmi/c`, the numbers of the model, and the binary for this platform."""

from __future__ import annotations

import json
import platform
import re
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

from fourpole.export.fmi.variables import Point, Variable, draws_in, is_belted, states_of_part, variables_of
from fourpole.io.processes import output_of, program_path

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
