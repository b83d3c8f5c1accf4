"""State space of models as JSON or as a MATLAB file: matrices A, B, C, D from deflection and its rate to force."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.export.matlab import with_head
from fourpole.export.source import MODEL_FILE, field_names
from fourpole.export.systems import System, systems_of
from fourpole.fitting.modelfile import ModelFile
from fourpole.io.write import write_bytes, write_text

_ABOUT = (
    "dz/dt = A z + B [x; v], F = C z + D [x; v]; K* = F/x with v = jw x, e^{+jwt}; deflection x and force F positive "
    "in compression; each state is a length [m] and equals x at rest"
)
_INPUTS, _OUTPUTS = ["deflection x [m]", "rate v of the deflection [m/s]"], ["force F [N]"]
Points = Sequence[Mapping[str, float]]


def write(source: ModelFile, path: Path, points: Points = (), specimen: str | None = None) -> tuple[str, ...]:
    """Write one JSON document with a system per specimen and operating point; returns notes."""
    systems, notes = systems_of(source, MODEL_FILE, points, specimen)
    document = {
        "format": "fourpole-state-space",
        "version": 1,
        "about": _ABOUT,
        "inputs": _INPUTS,
        "outputs": _OUTPUTS,
        "systems": [_entry(one) for one in systems],
    }
    write_text(path, json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    return notes


def write_matlab(source: ModelFile, path: Path, points: Points = (), specimen: str | None = None) -> tuple[str, ...]:
    """Write a MAT-file of level 5 with the struct array `systems`; returns notes."""
    from scipy.io import savemat

    systems, notes = systems_of(source, MODEL_FILE, points, specimen)
    entries = [_struct(one) for one in systems]
    array = np.empty((1, len(entries)), dtype=[(name, object) for name in entries[0]])
    for at, entry in enumerate(entries):
        array[0, at] = tuple(entry.values())
    buffer = io.BytesIO()
    content = {"systems": array, "about": _ABOUT, "inputs": "; ".join(_INPUTS), "outputs": "; ".join(_OUTPUTS)}
    savemat(buffer, content, long_field_names=True, do_compression=True)
    write_bytes(path, with_head(buffer.getvalue(), f"state space of models of {systems[0].source}"))
    return notes


def _entry(one: System) -> dict[str, Any]:
    """A system in types of JSON."""
    matrices = {name: value.tolist() for name, value in _matrices(one).items()}
    return {**_described(one), "state": one.placed.state, **matrices}


def _struct(one: System) -> dict[str, Any]:
    """A system in types of MATLAB; the fields of `state` have their unit in `state_units`."""
    fields = field_names(one.placed.state)
    state = {fields[name]: value for name, value in one.placed.state.items()}
    units = {fields[name]: name for name in one.placed.state}
    return {**_described(one), "state": state or "", "state_names": units or "", **_matrices(one)}


def _described(one: System) -> dict[str, Any]:
    return {
        "name": one.name,
        "about": one.about,
        "specimen": one.placed.specimen,
        "model": one.placed.model.name,
        "band_Hz": list(one.placed.band),
        "error": one.realised.error,
    }


def _matrices(one: System) -> dict[str, np.ndarray]:
    """A (n, n), B (n, 2), C (1, n) and D (1, 2)."""
    space = one.realised.space
    return {"A": space.a, "B": space.b, "C": space.c[None], "D": space.d[None]}
