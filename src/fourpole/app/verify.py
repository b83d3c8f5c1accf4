"""The command verify: whether a model file is as it was written, and what it holds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fourpole.answer import Answer, Part
from fourpole.app.console import UNREADABLE, say, warn
from fourpole.errors import FourpoleError
from fourpole.fitting.modelfile import MapEntry, ModelEntry, ModelFile
from fourpole.fitting.modelparts import EARLIER
from fourpole.fitting.verified import TableState, Verified, seal_later, verify
from fourpole.units import shown
from fourpole.words import first_of

_MOST_NAMED = 6
_TABLES = {
    TableState.SAME: "beside it and the same",
    TableState.MISSING: "not beside it, so not compared",
    TableState.UNKNOWN: "not known",
}


def run_verify(path: Path, copy: Path | None, *, as_json: bool) -> Answer:
    """Verify a model file and say what it holds; with `copy`, seal a file that has no seal first."""
    if copy is not None:
        seal_later(path, copy)
        say(f"written: {copy}")
        path = copy
    try:
        found = verify(path)
    except FourpoleError as error:
        if not as_json:
            raise
        said = str(error)
        return Answer((), lambda: {"file": str(path), "good": False, "error": said}, code=UNREADABLE)
    return Answer(_show(path, found), lambda: _document(path, found))


def _document(path: Path, found: Verified) -> dict[str, Any]:
    file, origin = found.file, found.file.provenance
    return {
        "file": str(path),
        "good": True,
        "kind": file.kind,
        "version": file.version,
        "written": found.written or None,
        "fourpole": origin.fourpole,
        "table": {"source": origin.source, "sha256": origin.sha256, "state": found.table.value},
        "settings": origin.settings,
        "notes": origin.notes,
        "entries": [
            {
                "tyre": one.tyre,
                "model": one.model,
                "causal": one.causal,
                "conditions": _conditions(one),
                "band [Hz]": _band(one),
            }
            for one in _entries(file)
        ],
    }


def _entries(file: ModelFile) -> list[ModelEntry | MapEntry]:
    return [*file.models, *file.maps]


def _conditions(one: ModelEntry | MapEntry) -> int:
    if isinstance(one, ModelEntry):
        return len(one.conditions)
    return len(one.axes[0].values) if one.axes else 1


def _band(one: ModelEntry | MapEntry) -> tuple[float, float] | None:
    """Lowest and highest frequency of an entry [Hz]."""
    if not isinstance(one, ModelEntry):
        return one.band
    bands = [each.band for each in one.conditions]
    return (min(low for low, _ in bands), max(high for _, high in bands)) if bands else None


def _show(path: Path, found: Verified) -> Iterator[Part]:
    origin = found.file.provenance
    when = f" on {found.written.replace('T', ' ').replace('Z', ' UTC')}" if found.written else ""
    yield f"{path}: as it was written{when}, by Fourpole {origin.fourpole}"
    for one in _entries(found.file):
        count, band = _conditions(one), _band(one)
        what = "map" if isinstance(one, MapEntry) else "model"
        many = f"{count} condition{'s' * (count != 1)}"
        over = f", over {first_of([axis.name for axis in one.axes], _MOST_NAMED)}" if isinstance(one, MapEntry) else ""
        where = f", {band[0]:.4g} to {band[1]:.4g} Hz" if band else ""
        yield f"{what:<9} {' '.join(filter(None, (one.tyre, one.model)))}: {many}{over}{where}"
    if found.table is TableState.CHANGED:
        yield f"table     {origin.source}: another one is beside it now"
        warn(f"{origin.source} has changed since the model was made: fit or map again for a model of it")
    elif origin.source:
        yield f"table     {origin.source}: {_TABLES[found.table]}"
    if origin.sha256:
        yield f"SHA-256   {origin.sha256} of that table"
    own = {name: value for name, value in origin.settings.items() if name != EARLIER}
    if own:
        yield f"settings  {_in_words(own)}"
    for tyre, settings in list(origin.earlier.items())[:_MOST_NAMED]:
        yield f"earlier   {shown(tyre)}: {_in_words(settings)}"
    for note in origin.notes:
        yield f"note      {note}"


def _in_words(settings: Any) -> str:
    """The first options and their values."""
    named = settings.items() if isinstance(settings, dict) else ()
    return first_of([f"{name} {value}" for name, value in named], _MOST_NAMED)
