"""FMUs: a model at its operating points as a unit of FMI 2.0 or 3.0, for model exchange and co-simulation."""

from __future__ import annotations

import hashlib
import io
import json
import uuid
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import islice
from pathlib import Path

from fourpole.core.specimen import Specimen
from fourpole.errors import ModelError
from fourpole.export.fmi.description import (
    Model,
    NoBinaryError,
    binary_place,
    build_description,
    common_source,
    compiled,
    model_description,
    model_source,
)
from fourpole.export.fmi.variables import COUNT, Draw, Point, alike, drawn_systems, draws_in, is_belted
from fourpole.export.source import identifiers
from fourpole.export.systems import Points, System, belt_words, systems_of
from fourpole.fitting.accuracy import Accuracy
from fourpole.fitting.modelfile import ModelFile
from fourpole.fitting.placed import PlacedModel
from fourpole.io.write import write_bytes
from fourpole.models.realised import Realised, belt_modes, weight
from fourpole.version import VERSION

#: Largest number of operating points of an FMU.
_MOST = 100
#: Time of all files of an archive, so that the same model gives the same bytes.
_TIME = (1980, 1, 1, 0, 0, 0)


def write(
    source: ModelFile,
    path: Path,
    points: Points = (),
    specimen: str | None = None,
    belt: Specimen | None = None,
    *,
    version: int = 2,
) -> tuple[str, ...]:
    """Write an FMU of a version of FMI, 2 or 3, with the models of a file at operating points; returns notes."""
    systems, notes = systems_of(source, points, specimen, belt=belt)
    if len(systems) > _MOST:
        raise ModelError(f"{len(systems)} operating points are more than {_MOST} of an FMU: state --at, or --specimen")
    found = [_point(one) for one in systems]
    if not draws_in(found):
        notes = (*notes, "the FMU has no draws: systems of the model as uncertain as it is differ in their structure")
    content, more = fmu(*_described([one.placed for one in systems], systems[0].source), found, version)
    write_bytes(path, content)
    return (*notes, *more)


#: Write an FMU of FMI 3.0; see `write`.
write_fmi3 = partial(write, version=3)


def _point(one: System) -> Point:
    """The operating point of a system."""
    label, band = _plain(one.placed.label), one.placed.band
    discrepancy = one.placed.accuracy.discrepancy
    drawn = drawn_systems(one.placed.map, one.placed.point, one.realised)
    if not one.belted:
        return Point(label, one.realised, discrepancy=discrepancy, draws=_kept((each, None) for each in drawn))
    belt = belt_modes(one.realised, one.belt, band)
    draws = _kept(_with_belts(drawn, belt, one.belt, band))
    return Point(f"{label}, {belt_words(one.belt)}", one.realised, belt, weight(one.belt), discrepancy, draws)


def _with_belts(
    drawn: Iterable[Realised], like: Realised, belt: Specimen, band: tuple[float, float]
) -> Iterator[tuple[Realised, Realised]]:
    """Drawn systems, each with that of its belt, where this has the structure of the estimate's."""
    for each in drawn:
        try:
            yield each, alike(belt_modes(each, belt, band), like)
        except ModelError:
            continue


def _kept(draws: Iterable[Draw]) -> tuple[Draw, ...]:
    """As many draws as an FMU has, or none."""
    found = tuple(islice(draws, COUNT))
    return found if len(found) == COUNT else ()


def _described(placed: Sequence[PlacedModel], source: str) -> tuple[str, str]:
    """Name of what an FMU is of, and its description."""
    names = list(dict.fromkeys(_plain(one.specimen) for one in placed if one.specimen))
    bands = [one.band for one in placed]
    about = (
        f"Vertical force of {', '.join(names) or 'a specimen'}; model "
        f"{', '.join(dict.fromkeys(one.model.name for one in placed))} of {_plain(source)}; measured "
        f"{max(low for low, _ in bands):.6g} to {min(high for _, high in bands):.6g} Hz. "
    )
    for specimen in dict.fromkeys(one.specimen for one in placed):
        about += _plain(Accuracy.joined([one.accuracy for one in placed if one.specimen == specimen]).text) + " "
    about = about.rstrip()
    return names[0] if len(names) == 1 else "specimen", about


def fmu(name: str, about: str, points: Sequence[Point], version: int) -> tuple[bytes, list[str]]:
    """The content of an FMU of a version of FMI, 2 or 3, with models at operating points; and notes.

    The same models give the same bytes, with the same compiler.
    """
    belted = is_belted(points)
    common = common_source(version, belted=belted)
    content = [version, VERSION, common, model_source(points, ""), name, about]
    mark = json.dumps([content, [one.label for one in points]])
    token = f"{{{uuid.UUID(hashlib.sha256(mark.encode()).hexdigest()[:32])}}}"
    model = Model(identifiers([name], (), otherwise="specimen")[0], name, about, token, points)
    source = {**common, **model_source(points, token)}
    files = {"modelDescription.xml": model_description(model, version)}
    files |= {f"sources/{file}": text.encode() for file, text in source.items()}
    if version == 3:
        files["sources/buildDescription.xml"] = build_description(model)
    notes = []
    try:
        files[binary_place(model.identifier, version)] = compiled(source, version, belted=belted)
    except NoBinaryError as error:
        notes.append(f"the FMU has no binary, only sources, which the importing program must compile: {error}")
    return _zipped(files), notes


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
