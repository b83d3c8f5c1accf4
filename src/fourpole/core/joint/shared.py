"""What all tests of a rig have in common: the rig's values, the channels' gains and phases, the weighed masses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.channelerrors import ChannelError
from fourpole.core.rig import PARAMETERS, Rig

__all__ = ["Quantity", "Shared"]


@dataclass(frozen=True)
class Quantity:
    """One shared value: its name, unit, and what is stated of it.

    Attributes
    ----------
    name : str
        As in rig.csv: moving_mass, gain F1, phase V2, added mass 10 kg.
    unit : str
        SI.
    kind : {"rig", "channel", "mass", "extra"}
        What it is; extra is an unstated part that the tests want.
    index : int
        Of the rig's values, of `core.channelerrors.ChannelUncertainty.errors`, or of the distinct masses.
    stated, std : float
        Most probable value and standard uncertainty before the tests, in the unit.
    """

    name: str
    unit: str
    kind: str
    index: int
    stated: float
    std: float

    @property
    def is_gain(self) -> bool:
        """Whether it is a factor, 1 where nothing is wrong."""
        return self.kind == "channel" and self.stated == 1.0

    @property
    def part(self) -> str:
        """Of an extra value, which of `model.PARTS` it is."""
        return self.name.removeprefix("unstated ")


@dataclass(frozen=True)
class Shared:
    """The shared values that are not exactly known; a vector z counts them in their stated uncertainties.

    Parameters
    ----------
    rig : Rig
        As stated.
    quantities : tuple of Quantity
        Those with an uncertainty, in the order of z.
    masses : (k,) float array [kg]
        The distinct masses that `Quantity.index` counts.
    """

    rig: Rig
    quantities: tuple[Quantity, ...]
    masses: FloatArray

    @classmethod
    def stated(cls, rig: Rig, errors: Sequence[ChannelError], masses: FloatArray, masses_std: FloatArray) -> Shared:
        """What is stated of a rig, the errors of its channels, and the distinct masses."""
        listed = [
            Quantity(name, unit, "rig", at, getattr(rig, name), float(std))
            for at, ((name, unit), std) in enumerate(zip(PARAMETERS.items(), rig.uncertainties, strict=True))
            if np.isfinite(getattr(rig, name))
        ]
        for at, error in enumerate(errors):
            centre = 1.0 if error.name.startswith("gain") else 0.0
            listed.append(Quantity(error.name, error.unit, "channel", at, centre, error.std))
        for at, (mass, std) in enumerate(zip(masses, masses_std, strict=True)):
            listed.append(Quantity(f"added mass {mass:g} kg", "kg", "mass", at, float(mass), float(std)))
        return cls(rig, tuple(quantity for quantity in listed if quantity.std > 0), masses)

    def __len__(self) -> int:
        return len(self.quantities)

    @cached_property
    def std(self) -> FloatArray:
        """Stated standard uncertainties, each in its unit."""
        return np.array([quantity.std for quantity in self.quantities])

    def _offsets(self, z: FloatArray, kind: str, count: int) -> FloatArray:
        """How far the values of a kind are from the stated ones."""
        offsets = np.zeros(count)
        for value, quantity in zip(z * self.std, self.quantities, strict=True):
            if quantity.kind == kind:
                offsets[quantity.index] = value
        return offsets

    def rig_at(self, z: FloatArray) -> Rig:
        """The rig with the values that z stands for."""
        names = list(PARAMETERS)
        moved = self._offsets(z, "rig", len(names))
        return self.rig.shifted(**{name: getattr(self.rig, name) + moved[at] for at, name in enumerate(names)})

    def channels_at(self, z: FloatArray, count: int) -> FloatArray:
        """The errors of the channels, each in its unit."""
        return self._offsets(z, "channel", count)

    def masses_at(self, z: FloatArray) -> FloatArray:
        """The distinct masses [kg]."""
        return self.masses + self._offsets(z, "mass", self.masses.size)

    def extra_at(self, z: FloatArray) -> dict[str, float]:
        """Sizes of the unstated parts, by name."""
        sizes = zip(z * self.std, self.quantities, strict=True)
        return {quantity.part: float(v) for v, quantity in sizes if quantity.kind == "extra"}

    def found(self, z: FloatArray) -> FloatArray:
        """Values at z, each in its unit."""
        moved = z * self.std
        gain = np.array([quantity.is_gain for quantity in self.quantities], dtype=bool)
        stated = np.array([quantity.stated for quantity in self.quantities])
        return np.where(gain, np.exp(np.where(gain, moved, 0.0)), stated + moved)
