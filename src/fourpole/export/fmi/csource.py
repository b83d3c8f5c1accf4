"""The C source of an FMU: the files of `fmi/c`, and the numbers of the model."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from importlib.resources import files

from fourpole.export.fmi.variables import Point, Variable, states_in, variables_of

#: Files that are compiled and headers, by version of FMI; the headers of FMI are those of the standard, unchanged.
COMPILED = {2: ("branches.c", "instance.c", "fmi2.c", "model.c"), 3: ("branches.c", "instance.c", "fmi3.c", "model.c")}
_HEADERS = {
    2: ("fmi2FunctionTypes.h", "fmi2Functions.h", "fmi2TypesPlatform.h"),
    3: ("fmi3FunctionTypes.h", "fmi3Functions.h", "fmi3PlatformTypes.h"),
}
_OWN_HEADERS = ("branches.h", "instance.h")


def common_source(version: int) -> dict[str, str]:
    """The files that all models have in common, by name."""
    names = (*COMPILED[version][:-1], *_OWN_HEADERS, *_HEADERS[version])
    place = files("fourpole.export.fmi") / "c"
    return {name: (place / name).read_text(encoding="utf-8") for name in names}


def model_source(points: Sequence[Point], token: str) -> dict[str, str]:
    """The files with the numbers of a model, by name."""
    variables = variables_of(points)
    parameters = parameters_of(variables)
    sizes = {"POINTS": len(points), "STATES": states_in(points), "PARAMETERS": len(parameters)}
    header = ["/* Sizes of this model, and its token. */", "#ifndef MODEL_H", "#define MODEL_H", ""]
    header += [f"#define TOKEN {json.dumps(token)}", *(f"#define {name} {value}" for name, value in sizes.items())]
    counts = [(len(one.system.springs), len(one.system.pair_springs)) for one in points]
    firsts = [sum(2 + 2 * n + 4 * m for n, m in counts[:at]) for at in range(len(counts))]
    numbers = [
        "/* The numbers of this model in SI units, in the order of the value references. */",
        '#include "branches.h"',
        "",
        _array("int", "model_branches[POINTS]", (str(n) for n, _ in counts)),
        _array("int", "model_pairs[POINTS]", (str(m) for _, m in counts)),
        _array("int", "model_first[POINTS]", map(str, firsts)),
        _array("double", "model_defaults[ROOM(PARAMETERS)]", (repr(one.start) for one in parameters)),
        _array("double", "model_least[ROOM(PARAMETERS)]", (repr(one.least) for one in parameters)),
        _array("char *const", "model_names[VARIABLES]", (json.dumps(one.name) for one in variables)),
    ]
    return {"model.h": "\n".join([*header, "", "#endif", ""]), "model.c": "\n".join([*numbers, ""])}


def parameters_of(variables: Sequence[Variable]) -> list[Variable]:
    """The parameters of the operating points, without the point and the preload."""
    return [one for one in variables if one.name.startswith("points[")]


def _array(kind: str, name: str, values: Iterable[str]) -> str:
    return f"const {kind} {name} = {{\n" + "".join(f"    {one},\n" for one in values) + "};"
