"""The models of a file as linear systems, each with a name of its own that a program takes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from fourpole.core.arrays import ByValue
from fourpole.errors import ModelError
from fourpole.export.source import identifiers
from fourpole.fitting.modelfile import ModelFile
from fourpole.fitting.placed import PlacedModel, placed_models
from fourpole.models.realised import Realised, realised

#: A system with a smaller relative error of K* is that of the model but for round-off.
_ROUND_OFF = 1e-9


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
    file: ModelFile,
    name: str,
    points: Sequence[Mapping[str, float]] = (),
    specimen: str | None = None,
    *,
    reserved: Collection[str] = (),
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
    for one in placed_models(file, name, points, specimen=specimen):
        try:
            found.append((one, realised(one.model, one.values, one.band)))
        except ModelError as error:
            refused.append(str(error))
    if not found:
        raise ModelError(refused[0] if refused else f"{name}: has no model")
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
