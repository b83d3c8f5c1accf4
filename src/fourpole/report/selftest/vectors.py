"""The reference vectors: read from the package, and held against what its functions find."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any

from fourpole.errors import FileError, FourpoleError
from fourpole.io.source import reason
from fourpole.report.selftest.compared import Compared, failed, number
from fourpole.report.selftest.materials import MATERIALS
from fourpole.report.selftest.mechanics import MECHANICS

_CALCULATED = {**MECHANICS, **MATERIALS}


def reference() -> Traversable:
    """The folder of the reference data in the package."""
    return resources.files("fourpole.report.selftest").joinpath("reference")


def read_reference(*name: str) -> str:
    """The text of a file of the reference data; FileError if the installation has lost it."""
    try:
        return reference().joinpath(*name).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise FileError(
            f"{'/'.join(name)} of the reference data cannot be read ({reason(error)}): install Fourpole again"
        ) from None


def cases() -> list[dict[str, Any]]:
    """All cases of vectors.json: check, function, inputs, and values with 50 digits and their tolerances."""
    try:
        return list(json.loads(read_reference("vectors.json"))["cases"])
    except (ValueError, KeyError, TypeError):
        raise FileError("vectors.json of the reference data is damaged: install Fourpole again") from None


def compared_cases(known: list[dict[str, Any]]) -> Iterator[Compared]:
    """Each value of some cases beside what the package finds; a fault of a function is a value that does not pass."""
    for one in known:
        yield from _compared(one)


def _compared(one: Mapping[str, Any]) -> Iterator[Compared]:
    function = f"{one['function']} ({one['about']})" if "about" in one else one["function"]
    inputs = {**one["inputs"], **one.get("series", {})}
    if "channels" in one:
        inputs["channels"] = one["channels"]
    try:
        found = _CALCULATED[one["function"]](inputs)
    except (FourpoleError, ArithmeticError, LookupError, TypeError, ValueError, AttributeError) as error:
        yield failed(one["check"], function, one["values"][0]["value"], f"{type(error).__name__}: {error}")
        return
    for row in one["values"]:
        value = float(found.get(row["value"], float("nan")))
        yield number(one["check"], function, row["value"], row["unit"], row["expected"], value, float(row["tolerance"]))
