"""Modelica source: a package with a block for each model, from deflection and its rate to force, by a template.

A block is a spring and a damper parallel to branches and to pairs of branches; see `Realised`. The blocks use the
language alone, not the Modelica Standard Library. Their connectors fit its inputs and outputs.
"""

from __future__ import annotations

from pathlib import Path

from fourpole.core.specimen import Specimen
from fourpole.export.source import filled, identifiers
from fourpole.export.systems import Points, systems_of
from fourpole.fitting.modelfile import ModelFile
from fourpole.io.write import write_text

#: Keywords of Modelica, names of its functions that the blocks use, and names of the package.
# fmt: off
_RESERVED = frozenset((
    "algorithm", "and", "annotation", "assert", "block", "break", "class", "connect", "connector", "constant",
    "constrainedby", "der", "discrete", "each", "else", "elseif", "elsewhen", "encapsulated", "end", "enumeration",
    "equation", "expandable", "extends", "external", "false", "final", "flow", "for", "function", "if", "import",
    "impure", "in", "initial", "inner", "input", "loop", "model", "not", "operator", "or", "outer", "output", "package",
    "parameter", "partial", "protected", "public", "pure", "record", "redeclare", "replaceable", "return", "stream",
    "then", "true", "type", "when", "while", "within", "Real", "Integer", "Boolean", "String", "time", "fill", "zeros",
    "RealInput", "RealOutput", "Modelica",
))
# fmt: on


def write(
    source: ModelFile, path: Path, points: Points = (), specimen: str | None = None, belt: Specimen | None = None
) -> tuple[str, ...]:
    """Write the package, whose name is that of the file; returns notes."""
    systems, notes = systems_of(source, points, specimen, belt=belt, reserved=_RESERVED)
    (package,) = identifiers([path.stem], {*_RESERVED, *(one.name for one in systems)})
    write_text(path, filled("modelica.mo", package=package, systems=systems, string=_string))
    return notes


def _string(text: str) -> str:
    """A text as a string of Modelica in one line."""
    plain = "".join(sign if sign.isprintable() else "?" for sign in " ".join(text.split()))
    escaped = plain.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
