"""The models of a file as linear systems, each with a name of its own, and their matrices as JSON or for MATLAB."""

from __future__ import annotations

import io
import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.core.arrays import ByValue
from fourpole.errors import ModelError
from fourpole.export.matlab import with_head
from fourpole.export.source import MODEL_FILE, field_names, identifiers
from fourpole.fitting.modelfile import ModelFile
from fourpole.fitting.placed import PlacedModel, placed_models
from fourpole.io.write import write_bytes, write_text
from fourpole.models.realised import Realised, realised

#: A system with a smaller relative error of K* is that of the model but for round-off.
_ROUND_OFF = 1e-9
_ABOUT = (
    "dz/dt = A z + B [x; v], F = C z + D [x; v]; K* = F/x with v = jw x, e^{+jwt}; deflection x and force F positive "
    "in compression; each state is a length [m] and equals x at rest"
)
_INPUTS, _OUTPUTS = ["deflection x [m]", "rate v of the deflection [m/s]"], ["force F [N]"]
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
        return f"{self.placed.label}; model {model} of {self.source}, {low:.4g} to {high:.4g} Hz{approximated}"


def systems_of(
    file: ModelFile, points: Points = (), specimen: str | None = None, *, reserved: Collection[str] = ()
) -> tuple[list[System], tuple[str, ...]]:
    """The systems of a file, and notes on models that are left out and on approximations.

    `reserved` are words that no name may be.

    Raises
    ------
    ModelError
        If no model of the file is a linear system, a point is outside the tests, or a map is given no point.
    """
    found: list[tuple[PlacedModel, Realised]] = []
    refused: list[str] = []
    for one in placed_models(file, MODEL_FILE, points, specimen=specimen):
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
    return systems, (*dict.fromkeys(notes), *_approximated(systems))


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


def write_json(source: ModelFile, path: Path, points: Points = (), specimen: str | None = None) -> tuple[str, ...]:
    """Write one JSON document with a system per specimen and operating point; returns notes."""
    systems, notes = systems_of(source, points, specimen)
    document = {
        "format": "fourpole-state-space",
        "version": 1,
        "about": _ABOUT,
        "inputs": _INPUTS,
        "outputs": _OUTPUTS,
        "systems": [_fields(system, state=system.placed.state) for system in systems],
    }
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False, default=np.ndarray.tolist)
    write_text(path, f"{text}\n")
    return notes


def write_matlab(source: ModelFile, path: Path, points: Points = (), specimen: str | None = None) -> tuple[str, ...]:
    """Write a MAT-file of level 5 with the struct array `systems`; returns notes.

    The fields of `state` have their unit in `state_names`.
    """
    from scipy.io import savemat

    systems, notes = systems_of(source, points, specimen)
    entries = []
    for system in systems:
        fields = field_names(system.placed.state)
        state = {fields[name]: value for name, value in system.placed.state.items()}
        names = {field: name for name, field in fields.items()}
        entries.append(_fields(system, state=state or "", state_names=names or ""))
    array = np.empty((1, len(entries)), dtype=[(name, object) for name in entries[0]])
    array[0, :] = [tuple(entry.values()) for entry in entries]
    buffer = io.BytesIO()
    content = {"systems": array, "about": _ABOUT, "inputs": "; ".join(_INPUTS), "outputs": "; ".join(_OUTPUTS)}
    savemat(buffer, content, long_field_names=True, do_compression=True)
    write_bytes(path, with_head(buffer.getvalue(), f"state space of models of {systems[0].source}"))
    return notes


def _fields(system: System, **state: Any) -> dict[str, Any]:
    """What a file has of a system: words, its operating point, and A (n, n), B (n, 2), C (1, n), D (1, 2)."""
    space = system.realised.space
    return {
        "name": system.name,
        "about": system.about,
        "specimen": system.placed.specimen,
        "model": system.placed.model.name,
        "band_Hz": list(system.placed.band),
        "error": system.realised.error,
        **state,
        "A": space.a,
        "B": space.b,
        "C": space.c[None],
        "D": space.d[None],
    }
