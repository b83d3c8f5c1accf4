"""A candidate of study.json in the words of the benchmark."""

from __future__ import annotations

from typing import Any

#: Starts of the source of a cause in study.json, with the cause; the channel is the word after it.
_OF_CHANNEL = {
    "gain drift": "gain drift",
    "gain step": "gain drift",
    "gain with one mass": "gain",
    "mounting gain": "gain",
    "mounting phase": "phase",
    "gain": "gain",
    "phase": "phase",
    "delay": "delay",
    "low-cut": "low-cut",
    "fixture": "fixture",
    "slope": "slope",
}
#: Names of other causes.
_OTHERS = {
    "tyre mass": ("moving mass", "rig"),
    "moving mass": ("moving mass", "rig"),
    "preload spring": ("preload spring", "rig"),
    "preload stiffness": ("preload spring", "rig"),
    "preload damping": ("preload damping", "rig"),
    "frame": ("frame", "rig"),
    "leaf friction": ("friction", "rig"),
    "input mass": ("input mass", "rig"),
    "added mass": ("added mass", "added mass"),
    "drift of": ("drift", "specimen"),
    "step of": ("drift", "specimen"),
    "scatter": ("scatter", "specimen"),
}
#: Checks of recordings that name a fault of a channel, when most of the tests have them.
CHECKS = {
    "clipping": "clipping",
    "linearity of F1": "clipping",
    "linearity of the rig": "clipping",
    "drop-outs": "drop-outs",
    "noise": "noise",
    "mains": "hum",
    "residual": "tone",
}


def cause_of(candidate: dict[str, Any]) -> tuple[str, str] | None:
    """A candidate of study.json as cause and channel or part; None for one that the benchmark has no word for."""
    text, part, name = candidate["text"], str(candidate["part"]), candidate["name"]
    if name == "recordings":  # a fault that most of them show
        channel = next((channel for channel in ("F1", "V1", "V2") if channel in text), "F1")
        return (CHECKS[part], channel) if part in CHECKS else None
    if "sign inverted" in text:
        return "sign", part.rsplit(maxsplit=1)[-1]
    if " read as " in text or "unit of V2" in text:
        return "unit", "F1" if "F1" in part else part.rsplit(maxsplit=1)[-1]
    if part.startswith("cross-talk"):
        return "cross-talk", part.rsplit(maxsplit=1)[-1]
    for start, cause in _OF_CHANNEL.items():
        if part.startswith(f"{start} ") and part.rsplit(maxsplit=1)[-1] in ("F1", "V1", "V2"):
            return cause, part.rsplit(maxsplit=1)[-1]
    for start, other in _OTHERS.items():
        if name.startswith(start) or part.startswith(start):
            return other
    return None
