"""Reduced recordings, kept by the content of the file and all settings, so that a run that was stopped goes on."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.core.checks import Check
from fourpole.core.demodulation.corrections import Correction
from fourpole.core.demodulation.demodulate import Demodulation
from fourpole.core.demodulation.preview import Preview
from fourpole.core.phasor import Phasors
from fourpole.io.write import write_text

__all__ = ["cache_name", "recall", "remember"]

#: Raised whenever demodulation or its checks change, so that what older versions kept is not used.
_VERSION = 5


def cache_name(depends_on: list[object], sha256: str) -> str:
    """Name of the file that keeps the result of a recording with this hash under these settings."""
    content = json.dumps([_VERSION, sha256, *depends_on], sort_keys=True, default=repr)
    return hashlib.sha256(content.encode()).hexdigest()[:40] + ".json"


def remember(place: Path, result: Demodulation, rows: tuple[Check, ...]) -> None:
    """Keep a result."""
    phasors = {name: _plain(value) for name, value in vars(result.phasors).items()}
    shown = {name: np.asarray(value, dtype=np.float32).tolist() for name, value in vars(result.preview).items()}
    apart = ("phasors", "preview", "corrections")
    found = {name: _plain(value) for name, value in vars(result).items() if name not in apart}
    content = {
        "phasors": phasors,
        "found": found,
        "preview": shown,
        "corrections": [asdict(row) for row in result.corrections],
        "checks": [asdict(row) for row in rows],
    }
    write_text(place, json.dumps(content))


def _plain(value: Any) -> Any:
    array = np.asarray(value)
    if np.iscomplexobj(array):
        return {"re": array.real.tolist(), "im": array.imag.tolist()}
    return array.tolist()


def recall(place: Path) -> tuple[Demodulation, tuple[Check, ...]] | None:
    """A kept result, or None where there is none that can be read."""
    try:
        content = json.loads(place.read_text(encoding="utf-8"))
        rows = tuple(Check(**row) for row in content["checks"])
        raw = content["phasors"]
        pair = raw.pop("amplitudes")
        amplitudes = np.array(pair["re"]) + 1j * np.array(pair["im"])
        phasors = Phasors(amplitudes=amplitudes, **{name: np.asarray(value) for name, value in raw.items()})
        found = content["found"]
        low, high = found["band"]
        kept = Demodulation(
            phasors=phasors,
            cycles=float(found["cycles"]),
            band=(float(low), float(high)),
            distortion=np.asarray(found["distortion"], dtype=float),
            noise_ratio=np.asarray(found["noise_ratio"], dtype=float),
            force_peak=float(found["force_peak"]),
            lines=np.asarray(found["lines"], dtype=float),
            missing=float(found["missing"]),
            channels=tuple(found["channels"]),
            preview=Preview(**{name: np.asarray(value, dtype=float) for name, value in content["preview"].items()}),
            corrections=tuple(Correction(**row) for row in content["corrections"]),
        )
        return kept, rows
    except (OSError, ValueError, KeyError, TypeError):
        return None
