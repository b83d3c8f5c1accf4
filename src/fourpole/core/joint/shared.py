"""What all tests of a rig have in common: the rig's values, the channels' gains and phases, the weighed masses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.identify import ChannelUncertainty
from fourpole.core.phasor import CHANNELS, SYMBOLS
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
    kind : {"rig", "gain", "phase", "mass", "extra"}
        What it is; extra is an unstated part that the tests want.
    index : int
        Of the rig's values, of the channel, or of the distinct masses.
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
    def stated(cls, rig: Rig, channels: ChannelUncertainty, masses: FloatArray, masses_std: FloatArray) -> Shared:
        """What is stated of a rig, its channels, and the distinct masses."""
        listed = [
            Quantity(name, unit, "rig", at, getattr(rig, name), float(std))
            for at, ((name, unit), std) in enumerate(zip(PARAMETERS.items(), rig.uncertainties, strict=True))
            if np.isfinite(getattr(rig, name))
        ]
        for at, role in enumerate(CHANNELS):
            listed.append(Quantity(f"gain {SYMBOLS[role]}", "1", "gain", at, 1.0, float(channels.gain[at])))
            listed.append(Quantity(f"phase {SYMBOLS[role]}", "rad", "phase", at, 0.0, float(channels.phase[at])))
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

    def gains_at(self, z: FloatArray) -> ComplexArray:
        """Complex gains of F1, V1, V2, measured over true: exp(a + j phi)."""
        return np.exp(self._offsets(z, "gain", 3) + 1j * self._offsets(z, "phase", 3))

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
        gain = np.array([quantity.kind == "gain" for quantity in self.quantities], dtype=bool)
        stated = np.array([quantity.stated for quantity in self.quantities])
        return np.where(gain, np.exp(np.where(gain, moved, 0.0)), stated + moved)
