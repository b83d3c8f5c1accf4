"""How near K* of a model or a map is to K* as measured, as numbers and in sentences that each export carries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourpole.fitting.modelfile import ConditionFile, MapEntry, ModelEntry, map_of, map_of_condition
from fourpole.fitting.modelparts import VerdictFile
from fourpole.models.families import by_amplitude
from fourpole.models.ladder import Rung
from fourpole.models.operating import OperatingMap

#: Model discrepancy [1] from which on a query and the report name it, and from which on an export warns of it.
POOR, WARNED = 0.01, 0.03
#: What the verdict on K* says, by the kind of specimen that can have it.
_SAID = {
    Rung.RELAXING: "A massless, relaxing specimen can have K* as measured.",
    Rung.MASS: "A relaxing specimen with a mass at its driven end can have K* as measured; the mass was taken off.",
    Rung.RESONANT: "A specimen with a resonance can have K* as measured.",
    Rung.NONE: "No specimen, relaxing or with a mass or resonances, can have K* as measured.",
}


@dataclass(frozen=True)
class Accuracy:
    """How near K* of a model is to K* as measured.

    Attributes
    ----------
    of : str
        What has this K*: the specimen, or its springs where its inertia is known.
    band : (float, float) [Hz]
        Frequencies at which K* was measured.
    discrepancy : float [1]
        Model discrepancy; of a map the scatter of the tests about it. 0 if the model fits within u(K*).
    u : float [1]
        Largest standard uncertainty of Re K* and Im K* of the model in the band over the modulus of K*; it has the
        discrepancy in it.
    verdict : Rung or None
        The kind of specimen that can have K* as measured; None if the verdict is unknown, as of maps.
    known : bool
        Whether the tests state u(K*).
    mapped : bool
        Whether it is that of a map.

    Examples
    --------
    >>> Accuracy("mount", (8.0, 24.0), 0.3, 0.31, Rung.NONE).misfit
    'the model is off by 30 % of |K*| (model discrepancy)'
    """

    of: str
    band: tuple[float, float]
    discrepancy: float
    u: float
    verdict: Rung | None = None
    known: bool = True
    mapped: bool = False

    @property
    def misfit(self) -> str:
        """By how much the model is off, as the end of a sentence."""
        if self.discrepancy > 0:
            what = "scatter of the tests about the map" if self.mapped else "model discrepancy"
            return f"the model is off by {_percent(self.discrepancy)} of |K*| ({what})"
        return "the model fits within u(K*)" if self.known else "the model fits"

    @property
    def sentences(self) -> tuple[str, ...]:
        """What the model is of, its misfit and uncertainty; the verdict on K* as measured if there is one."""
        low, high = self.band
        uncertainty = f"u(K*) of the model is up to {_percent(self.u)} of |K*|"
        first = f"K* of {self.of}, {low:.6g} to {high:.6g} Hz: {self.misfit}; {uncertainty}."
        stated = () if self.known else ("The tests state no u(K*).",)
        return (first, *stated, *(() if self.verdict is None else (_SAID[self.verdict],)))

    @property
    def text(self) -> str:
        """The sentences in one line."""
        return " ".join(self.sentences)

    @classmethod
    def joined(cls, several: Sequence[Accuracy]) -> Accuracy:
        """The worst of several, over the bands of all."""
        verdicts = [one.verdict for one in several if one.verdict is not None]
        return cls(
            of=" and ".join(dict.fromkeys(one.of for one in several)),
            band=(min(one.band[0] for one in several), max(one.band[1] for one in several)),
            discrepancy=max(one.discrepancy for one in several),
            u=max(one.u for one in several),
            verdict=max(verdicts, key=list(Rung).index, default=None),
            known=all(one.known for one in several),
            mapped=any(one.mapped for one in several),
        )


def accuracy_of(entry: ModelEntry | MapEntry, condition: ConditionFile | None = None) -> Accuracy:
    """The accuracy of a model at one of its conditions, or the worst of all; that of a map."""
    if isinstance(entry, MapEntry):
        found = map_of(entry)
        scatter = float(np.hypot(max(found.scatter.condition), max(found.scatter.frequency)))
        return Accuracy(_of(entry, entry), found.band, scatter, _relative_u(found, entry.amplitude), mapped=True)
    conditions = entry.conditions if condition is None else [condition]
    return Accuracy.joined(
        [
            Accuracy(
                of=_of(entry, one),
                band=one.band,
                discrepancy=entry.discrepancy,
                u=_relative_u(map_of_condition(entry, one), one.amplitude),
                verdict=None if one.verdict is None else _rung(one.verdict),
                known=one.verdict is not None or by_amplitude(entry.model),
            )
            for one in conditions
        ]
    )


def _of(entry: ModelEntry | MapEntry, holder: ConditionFile | MapEntry) -> str:
    name = entry.tyre or "the specimen"
    return name if holder.inertia is None else f"the springs of {name}"


def _rung(verdict: VerdictFile) -> Rung:
    kind = Rung.RELAXING if verdict.possible else Rung.NONE
    return next((one for one in Rung if one == verdict.holds), kind)


def _relative_u(found: OperatingMap, amplitude: Sequence[float] | None) -> float:
    """The largest u(K*) over its modulus at the tested conditions, at the ends and in the middle of the band."""
    if amplitude:
        found = replace(found, model=found.model.at_amplitude(amplitude[len(amplitude) // 2]))
    low, high = found.band
    frequency, points = np.array([low, np.sqrt(low * high), high]), found.axes.points
    answer = found.ask(np.repeat(points, 3, axis=0), np.tile(frequency, len(points)))
    variances = np.diagonal(answer.stiffness_covariance, axis1=1, axis2=2).max(axis=1)
    return float(np.max(np.sqrt(variances) / np.abs(answer.stiffness)))


def _percent(share: float) -> str:
    return f"{float(f'{100 * share:.2g}'):g} %"
