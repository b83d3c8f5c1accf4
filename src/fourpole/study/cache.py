"""The cache of reduced recordings: an interrupted analysis continues from it.

A file of the cache is found by the content of the recording and all settings of its reduction.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.core.checks import Check
from fourpole.core.codes import Code
from fourpole.core.demodulation.corrections import Correction
from fourpole.core.demodulation.preview import Preview
from fourpole.core.phasor import Phasors
from fourpole.errors import FileError
from fourpole.io.write import write_text
from fourpole.study.outcome import Point

#: This number is raised whenever demodulation or its checks change, so that older files of the cache are not used.
_VERSION = 9


def cache_name(depends_on: list[object], sha256: str) -> str:
    """Name of the cache file for a recording with this hash, reduced with these settings."""
    content = json.dumps([_VERSION, sha256, *depends_on], sort_keys=True, default=repr)
    return hashlib.sha256(content.encode()).hexdigest()[:40] + ".json"


def remember(place: Path, points: Sequence[Point]) -> None:
    """Write the points of a recording to the cache; a recording without phasors is not written.

    A cache that cannot be written, as on a full disk, changes no result.
    """
    if all(point.phasors is not None and point.preview is not None for point in points):
        with suppress(FileError):
            write_text(place, json.dumps([_kept(point) for point in points]))


def _kept(point: Point) -> dict[str, Any]:
    shown = {name: np.asarray(value, dtype=np.float32).tolist() for name, value in vars(point.preview).items()}
    return {
        "phasors": {name: _plain(value) for name, value in vars(point.phasors).items()},
        "checks": [vars(row) | {"code": row.code.name} for row in point.checks],
        "corrections": [asdict(row) for row in point.corrections],
        "channels": point.channels,
        "preview": shown,
    }


def _plain(value: Any) -> Any:
    array = np.asarray(value)
    if np.iscomplexobj(array):
        return {"re": array.real.tolist(), "im": array.imag.tolist()}
    return array.tolist()


def recall(place: Path) -> tuple[Point, ...] | None:
    """The points in a cache file; None where the file is missing or cannot be read."""
    try:
        return tuple(_recalled(**point) for point in json.loads(place.read_text(encoding="utf-8"))) or None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _recalled(
    phasors: dict[str, Any], checks: Any, corrections: Any, channels: Sequence[str], preview: dict[str, Any]
) -> Point:
    pair = phasors.pop("amplitudes")
    amplitudes = np.array(pair["re"]) + 1j * np.array(pair["im"])
    return Point(
        phasors=Phasors(amplitudes=amplitudes, **{name: np.asarray(value) for name, value in phasors.items()}),
        checks=tuple(Check(**row | {"code": Code[row["code"]]}) for row in checks),
        corrections=tuple(Correction(**row) for row in corrections),
        channels=tuple(channels),
        preview=Preview(**{name: np.asarray(value, dtype=float) for name, value in preview.items()}),
    )
