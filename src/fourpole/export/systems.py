"""The models of a file as linear systems, each with a name of its own: their matrices as JSON, and Modelica source.

The source is a package with a block for each model, from deflection and its rate to force, by a template. A block is a
spring and a damper parallel to branches and to pairs of branches; see `Realised`. The blocks use the language alone,
not the Modelica Standard Library. Their connectors fit its inputs and outputs.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.core.arrays import ByValue
from fourpole.core.specimen import Form, Specimen
from fourpole.errors import ModelError
from fourpole.export.source import MODEL_FILE, filled, identifiers
from fourpole.fitting.modelfile import ModelFile
from fourpole.fitting.placed import PlacedModel, placed_models
from fourpole.io.write import write_text
from fourpole.models.realised import Realised, both_ends, realised

#: A system with a smaller relative error of K* is that of the model but for round-off.
_ROUND_OFF = 1e-9
_ABOUT = (
    "dz/dt = A z + B [x; v], F = C z + D [x; v]; K* = F/x with v = jw x, e^{+jwt}; deflection x and force F positive "
    "in compression; each state is a length [m] and equals x at rest"
)
_INPUTS, _OUTPUTS = ["deflection x [m]", "rate v of the deflection [m/s]"], ["force F [N]"]
#: The same of systems with a belt, which have two ends.
_ABOUT_ENDS = (
    "dz/dt = A z + B u, F = C z + D u; [F1; -F2]/[x1; x2] is the dynamic stiffness of both ends with v = jw x, "
    "e^{+jwt}; displacements and forces positive from the contact towards the wheel, F1 into the contact, F2 on the "
    "wheel; the belt is in the system, and no part of the mass of the wheel"
)
_INPUTS_ENDS = [
    *("displacement x1 of the contact [m]", "its rate v1 [m/s]"),
    *("displacement x2 of the wheel [m]", "its rate v2 [m/s]"),
]
_OUTPUTS_ENDS = ["force F1 into the contact [N]", "force F2 on the wheel [N]"]
Points = Sequence[Mapping[str, float]]


@dataclass(frozen=True, eq=False)
class System(ByValue):
    """A model at one operating point as a linear system.

    Attributes
    ----------
    name : str
        Name of letters, digits and underscores that no other system of the file has.
    placed : PlacedModel
    realised : Realised
    source : str
        Name and version of what the model was made of.
    """

    name: str
    placed: PlacedModel
    realised: Realised
    source: str

    @property
    def about(self) -> str:
        """Specimen, operating point, model, source and band in one line."""
        low, high = self.placed.band
        model, error = self.placed.model.name, self.realised.error
        approximated = f", approximated within {error:.1g} of |K*|" if error > _ROUND_OFF else ""
        belt = f", with {belt_words(self.belt)}" if self.belted else ""
        return f"{self.placed.label}; model {model} of {self.source}, {low:.4g} to {high:.4g} Hz{approximated}{belt}"

    @property
    def belt(self) -> Specimen:
        """The belt; massless where there is none."""
        return self.placed.belt

    @property
    def belted(self) -> bool:
        """Whether there is a belt."""
        return self.belt.form is Form.BELT


def belt_words(belt: Specimen) -> str:
    """A belt in words."""
    return f"a belt of {belt.mass:.4g} kg, share {abs(belt.share):.4g}"


def belt_note(belts: Iterable[Specimen]) -> list[str]:
    """A note on belts that a file has."""
    masses = [one.mass for one in belts if one.form is Form.BELT]
    if not masses:
        return []
    span = " to ".join(f"{one:.4g}" for one in dict.fromkeys((min(masses), max(masses))))
    return [f"the belt of {span} kg is in the file: take it off the unsprung mass of the vehicle"]


def systems_of(
    file: ModelFile,
    points: Points = (),
    specimen: str | None = None,
    *,
    belt: Specimen | None = None,
    reserved: Collection[str] = (),
) -> tuple[list[System], tuple[str, ...]]:
    """The systems of a file, and notes on models that are left out and on approximations.

    `belt` stands in place of that of the file; `reserved` are words that no name may be.

    Raises
    ------
    ModelError
        If no model of the file is a linear system, a point is outside the tests, or a map is given no point.
    """
    found: list[tuple[PlacedModel, Realised]] = []
    refused: list[str] = []
    for one in placed_models(file, MODEL_FILE, points, specimen=specimen, belt=belt):
        try:
            found.append((one, realised(one.model, one.values, one.band)))
        except ModelError as error:
            refused.append(str(error))
    if not found:
        raise ModelError(refused[0] if refused else f"{MODEL_FILE}: has no model")
    names = identifiers([one.label for one, _ in found], reserved)
    source = f"{file.provenance.source}, by fourpole {file.provenance.fourpole}"
    systems = [System(text, one, system, source) for text, (one, system) in zip(names, found, strict=True)]
    notes = [f"left out: {text}" for text in refused]
    notes += [remark for one, _ in found for remark in one.remarks]
    return systems, (*dict.fromkeys(notes), *_approximated(systems), *belt_note(one.belt for one in systems))


def _approximated(systems: Sequence[System]) -> list[str]:
    """A note on the largest error of systems that approximate their model."""
    worst = max(systems, key=lambda one: one.realised.error)
    if worst.realised.error <= _ROUND_OFF:
        return []
    low, high = worst.placed.band
    note = (
        f"the file has an approximation of the {worst.placed.model.name} model: from {low:.4g} to {high:.4g} Hz, its "
        f"K* differs by up to {worst.realised.error:.1g} of |K*|; outside, by more"
    )
    return [note]


def write(
    source: ModelFile, path: Path, points: Points = (), specimen: str | None = None, belt: Specimen | None = None
) -> tuple[str, ...]:
    """Write one JSON document with a system per specimen and operating point; returns notes."""
    systems, notes = systems_of(source, points, specimen, belt=belt)
    ends = any(one.belted for one in systems)
    about, inputs, outputs = (_ABOUT_ENDS, _INPUTS_ENDS, _OUTPUTS_ENDS) if ends else (_ABOUT, _INPUTS, _OUTPUTS)
    document = {
        "format": "fourpole-state-space",
        "version": 1,
        "about": about,
        "inputs": inputs,
        "outputs": outputs,
        "systems": [_fields(system, ends=ends) for system in systems],
    }
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False, default=np.ndarray.tolist)
    write_text(path, f"{text}\n")
    return notes


def _fields(system: System, *, ends: bool) -> dict[str, Any]:
    """What a file has of a system: words, its operating point, and A (n, n), B (n, 2), C (1, n), D (1, 2).

    With `ends` they are those of both ends: B (n, 4), C (2, n), D (2, 4), and the belt stands beside them.
    """
    space = system.realised.space
    matrices: dict[str, Any] = {"A": space.a, "B": space.b, "C": space.c[None], "D": space.d[None]}
    if ends:
        both = both_ends(space, system.belt)
        matrices = {"belt_mass_kg": system.belt.mass, "belt_share": abs(system.belt.share)}
        matrices |= {"A": both.a, "B": both.b, "C": both.c, "D": both.d}
    return {
        "name": system.name,
        "about": system.about,
        "specimen": system.placed.specimen,
        "model": system.placed.model.name,
        "band_Hz": list(system.placed.band),
        "error": system.realised.error,
        "discrepancy": system.placed.accuracy.discrepancy,
        "accuracy": system.placed.accuracy.text,
        "state": system.placed.state,
        **matrices,
    }


#: Keywords of Modelica, names of its functions that the blocks use, and names of the package.
# fmt: off
_MODELICA_WORDS = frozenset((
    "algorithm", "and", "annotation", "assert", "block", "break", "class", "connect", "connector", "constant",
    "constrainedby", "der", "discrete", "each", "else", "elseif", "elsewhen", "encapsulated", "end", "enumeration",
    "equation", "expandable", "extends", "external", "false", "final", "flow", "for", "function", "if", "import",
    "impure", "in", "initial", "inner", "input", "loop", "model", "not", "operator", "or", "outer", "output", "package",
    "parameter", "partial", "protected", "public", "pure", "record", "redeclare", "replaceable", "return", "stream",
    "then", "true", "type", "when", "while", "within", "Real", "Integer", "Boolean", "String", "time", "fill", "zeros",
    "RealInput", "RealOutput", "Modelica",
))
# fmt: on


def write_modelica(
    source: ModelFile, path: Path, points: Points = (), specimen: str | None = None, belt: Specimen | None = None
) -> tuple[str, ...]:
    """Write the package, whose name is that of the file; returns notes."""
    systems, notes = systems_of(source, points, specimen, belt=belt, reserved=_MODELICA_WORDS)
    (package,) = identifiers([path.stem], {*_MODELICA_WORDS, *(one.name for one in systems)})
    write_text(path, filled("modelica.mo", package=package, systems=systems, string=_string))
    return notes


def _string(text: str) -> str:
    """A text as a string of Modelica in one line."""
    plain = "".join(sign if sign.isprintable() else "?" for sign in " ".join(text.split()))
    escaped = plain.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
