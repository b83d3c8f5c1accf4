"""A model file of some tyres put into one of the same results that has others."""

from __future__ import annotations

from fourpole.errors import ModelError
from fourpole.fitting.modelfile import ModelFile
from fourpole.fitting.modelparts import EARLIER


def renewed(former: ModelFile, made: ModelFile) -> ModelFile:
    """The entries of `made`, and those that `former` has of other tyres, each whole.

    The settings of the tyres that are kept stand under the key `EARLIER`.

    Raises
    ------
    ModelError
        If the two are not of one table of K*, or one is of fits and one of maps.
    """
    if former.kind != made.kind:
        raise ModelError(f"it is of kind {former.kind}")
    if not made.provenance.sha256 or former.provenance.sha256 != made.provenance.sha256:
        raise ModelError("it is of other results")
    kept = [tyre for tyre in former.tyres if tyre not in made.tyres]
    if not kept:
        return made
    was, now = former.provenance, made.provenance
    earlier = {tyre: {key: one for key, one in was.settings_of(tyre).items() if key != EARLIER} for tyre in kept}
    columns = {one.column for one in made.axes}
    content = {
        "models": list(({one.tyre: one for one in former.models} | {one.tyre: one for one in made.models}).values()),
        "maps": list(({one.tyre: one for one in former.maps} | {one.tyre: one for one in made.maps}).values()),
        "axes": [*made.axes, *(one for one in former.axes if one.column not in columns)],
        "provenance": now.model_copy(
            update={
                "settings": {**now.settings, EARLIER: earlier},
                "notes": list(dict.fromkeys([*now.notes, *was.notes])),
            }
        ),
    }
    return made.model_copy(update=content)
