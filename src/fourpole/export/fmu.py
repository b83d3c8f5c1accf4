"""FMUs: a model at its operating points as a unit of FMI 2.0 or 3.0, for model exchange and co-simulation."""

from __future__ import annotations

import hashlib
import io
import json
import re
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from fourpole.errors import ModelError
from fourpole.export.fmi.compiler import NoBinaryError, binary_place, compiled
from fourpole.export.fmi.csource import common_source, model_source
from fourpole.export.fmi.description import Model, build_description, model_description
from fourpole.export.fmi.variables import Point
from fourpole.export.source import ascii_line
from fourpole.fitting.modelfile import ModelFile
from fourpole.fitting.placed import PlacedModel, placed_models
from fourpole.io.write import write_bytes
from fourpole.models.realised import realised
from fourpole.version import VERSION

#: Largest number of operating points of an FMU; longest name of its binary.
_MOST, _LONGEST = 100, 60
#: Time of all files of an archive, so that the same model gives the same bytes.
_TIME = (1980, 1, 1, 0, 0, 0)
Points = Sequence[Mapping[str, float]]


def write(source: ModelFile, path: Path, points: Points = (), specimen: str | None = None) -> tuple[str, ...]:
    """Write an FMU of FMI 2.0 with the models of a file at operating points; returns notes."""
    return _write(source, path, points, specimen, 2)


def write_fmi3(source: ModelFile, path: Path, points: Points = (), specimen: str | None = None) -> tuple[str, ...]:
    """Write an FMU of FMI 3.0; see `write`."""
    return _write(source, path, points, specimen, 3)


def _write(source: ModelFile, path: Path, points: Points, specimen: str | None, version: int) -> tuple[str, ...]:
    placed = placed_models(source, path.name, points, specimen=specimen)
    if len(placed) > _MOST:
        raise ModelError(f"{len(placed)} operating points are more than {_MOST} of an FMU: state --at, or --tyre")
    systems = [realised(one.model, one.values, one.band) for one in placed]
    labels = [_plain(one.label) for one in placed]
    found = [Point(label, system) for label, system in zip(labels, systems, strict=True)]
    model = _described(source, placed, found, version)
    content = {"modelDescription.xml": model_description(model, version)}
    files = {**common_source(version), **model_source(found, model.token)}
    content |= {f"sources/{name}": text.encode() for name, text in files.items()}
    if version == 3:
        content["sources/buildDescription.xml"] = build_description(model)
    notes = [remark for one in placed for remark in one.remarks]
    try:
        content[binary_place(model.identifier, version)] = compiled(files, version)
    except NoBinaryError as error:
        notes.append(f"the FMU has no binary, only sources, which the importing program must compile: {error}")
    write_bytes(path.with_suffix(path.suffix or ".fmu"), _zipped(content))
    return tuple(dict.fromkeys(notes))


def _described(source: ModelFile, placed: Sequence[PlacedModel], points: Sequence[Point], version: int) -> Model:
    names = list(dict.fromkeys(one.specimen for one in placed))
    name = names[0] if len(names) == 1 and names[0] else "specimen"
    bands = [one.band for one in placed]
    about = (
        f"Vertical force of {', '.join(map(_plain, filter(None, names))) or 'a specimen'}; model "
        f"{', '.join(dict.fromkeys(one.model.name for one in placed))} of {_plain(source.provenance.source)}, measured "
        f"{max(low for low, _ in bands):.6g} to {min(high for _, high in bands):.6g} Hz"
    )
    content = [version, VERSION, common_source(version), model_source(points, ""), about, [one.label for one in points]]
    token = uuid.UUID(hashlib.sha256(json.dumps(content).encode()).hexdigest()[:32])
    return Model(_identifier(name), _plain(name), about, f"{{{token}}}", points)


def _identifier(name: str) -> str:
    """A name of letters, digits and underscores, for the binary."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", ascii_line(name)).strip("_")[:_LONGEST] or "specimen"
    return plain if plain[0].isalpha() else f"specimen_{plain}"


def _plain(text: str) -> str:
    """A text without characters that XML does not allow."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)


def _zipped(content: Mapping[str, bytes]) -> bytes:
    """An archive whose bytes follow from its content alone."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            entry = zipfile.ZipInfo(name, _TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, data)
    return buffer.getvalue()
