"""Shared parameters of all tests of a rig: the rig's values, gains and phases, weighed masses, drifts of specimens."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray, IntArray
from fourpole.core.channelerrors import ChannelError
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.sources import Kind, Role, Source

#: Change of log K* per unit of each kind of drift, and of each block: of the modulus, and of the angle.
DRIFTS = {Kind.DRIFT: 1.0, Kind.ANGLE_DRIFT: 1j}
BLOCKS = {Kind.BLOCK: 1.0, Kind.ANGLE_BLOCK: 1j}
STEPS = {Kind.STEP: 1.0, Kind.ANGLE_STEP: 1j}
#: Parts of the run of a specimen, or of a rig, between which K* or a gain may step.
PARTS_OF_RUN = 8

#: Change of what each value of a belt acts on, per unit, and its place in `core.specimen.Ends.by`.
BELTS = {Kind.BELT_MASS: (1.0, 1), Kind.BELT_SHARE: (1.0, 2), Kind.BELT_ANGLE: (1j, 2), Kind.BELT_EXPONENT: (1.0, 3),
         Kind.BELT_SPREAD: (1.0, 3)}  # fmt: skip
#: Those of each condition without its frequency; the others are of a specimen.
OF_FAMILY = (Kind.BELT_SHARE, Kind.BELT_ANGLE)
_INPUT_MASSES = (Source(Kind.RIG_VALUE, "input_mass"), Source(Kind.UNSTATED, "input"))
#: Places and indices of the values of a role that no value has.
_NONE = np.zeros((2, 0), dtype=int)
_Key = TypeVar("_Key")


@dataclass(frozen=True)
class SharedParameter:
    """One value that all tests of a rig share, as stated.

    Attributes
    ----------
    source : Source
        The uncertain value.
    unit : str
        SI unit.
    index : int
        Index of the value, by the role of the source: in `core.rig.PARAMETERS`, in the list of errors from
        `core.channelerrors.ChannelUncertainty.errors`, in the distinct masses, in the specimens, or in the blocks: the
        number of the specimen times the count of distinct masses, and that of the mass. Of a step it is the number of
        the specimen times `PARTS_OF_RUN`, and that of the part of its run before the step.
    stated, std : float
        Stated value and standard uncertainty, in the unit.
    """

    source: Source
    unit: str
    index: int
    stated: float
    std: float

    @property
    def key(self) -> tuple[Source, int]:
        """What distinguishes it from all other values: mountings of one sensor have one source."""
        return self.source, self.index

    @property
    def is_gain(self) -> bool:
        """Whether the value is a gain, which is 1 for a channel without error."""
        return self.source.kind is Kind.GAIN


@dataclass(frozen=True, eq=False)
class Shared(ByValue):
    """The uncertain shared values; a vector z has their departures from the statement, in stated uncertainties.

    Parameters
    ----------
    rig : Rig
        The rig as stated.
    parameters : tuple of SharedParameter
        The values with an uncertainty, in the order of z.
    masses : (k,) float array [kg]
        The distinct added masses, in the order of `SharedParameter.index`.
    """

    rig: Rig
    parameters: tuple[SharedParameter, ...]
    masses: FloatArray

    @classmethod
    def stated(cls, rig: Rig, errors: Sequence[ChannelError], masses: FloatArray, masses_std: FloatArray) -> Shared:
        """The shared values of a rig, of the errors of its channels, and of the distinct masses, as stated."""
        listed = [
            SharedParameter(Source(Kind.RIG_VALUE, name), unit, index, getattr(rig, name), float(std))
            for index, ((name, unit), std) in enumerate(zip(PARAMETERS.items(), rig.uncertainties, strict=True))
            if np.isfinite(getattr(rig, name))
        ]
        for index, error in enumerate(errors):
            centre = 1.0 if error.source.kind is Kind.GAIN else 0.0
            listed.append(SharedParameter(error.source, error.unit, index, centre, error.std))
        for index, (mass, std) in enumerate(zip(masses, masses_std, strict=True)):
            source = Source(Kind.ADDED_MASS, mass=float(mass))
            listed.append(SharedParameter(source, "kg", index, float(mass), float(std)))
        return cls(rig, tuple(parameter for parameter in listed if parameter.std > 0), masses)

    def __len__(self) -> int:
        return len(self.parameters)

    @cached_property
    def stated_values(self) -> FloatArray:
        """Stated values (p,), each in its unit."""
        return np.array([parameter.stated for parameter in self.parameters])

    @cached_property
    def std(self) -> FloatArray:
        """Stated standard uncertainties (p,), each in its unit."""
        return np.array([parameter.std for parameter in self.parameters])

    @cached_property
    def _of_roles(self) -> dict[Role, IntArray]:
        return {role: np.array(pairs).T for role, pairs in self._gathered(lambda source: source.role).items()}

    @cached_property
    def _of_kinds(self) -> dict[Kind, list[tuple[int, int]]]:
        return self._gathered(lambda source: source.kind)

    def _gathered(self, key: Callable[[Source], _Key]) -> dict[_Key, list[tuple[int, int]]]:
        """Place in z and index of each value, by a key of its source."""
        pairs: dict[_Key, list[tuple[int, int]]] = {}
        for place, parameter in enumerate(self.parameters):
            pairs.setdefault(key(parameter.source), []).append((place, parameter.index))
        return pairs

    def of_role(self, role: Role) -> list[tuple[int, int]]:
        """Place in z and index of each value of a role."""
        return [(place, index) for place, index in self._of_roles.get(role, _NONE).T.tolist()]

    def of_kind(self, kind: Kind) -> list[tuple[int, int]]:
        """Place in z and index of each value of a kind."""
        return self._of_kinds.get(kind, [])

    @cached_property
    def of_input_mass(self) -> tuple[int, ...]:
        """Places in z of the mass between force cell and contact, stated or not."""
        return tuple(row for row, parameter in enumerate(self.parameters) if parameter.source in _INPUT_MASSES)

    @cached_property
    def index(self) -> IntArray:
        """`SharedParameter.index` (p,) of the values."""
        return np.array([parameter.index for parameter in self.parameters], dtype=int)

    @cached_property
    def of_channel(self) -> BoolArray:
        """Whether each value (p,) is an error of a channel."""
        return np.array([parameter.source.of_channel for parameter in self.parameters], dtype=bool)

    def offsets(self, z: FloatArray, role: Role, count: int) -> FloatArray:
        """Departures (count,) of the values of a role from their statement, each in its unit."""
        place, index = self._of_roles.get(role, _NONE)
        return np.asarray(np.bincount(index, (z * self.std)[place], count), dtype=float)

    def of_channels(self, z: FloatArray, count: int) -> FloatArray:
        """Errors (count,) of the channels at z, each in its unit."""
        return self.offsets(z, Role.CHANNEL, count) + self.offsets(z, Role.MOUNTING, count)

    def rig_at(self, z: FloatArray) -> Rig:
        """The rig with the values at z."""
        names = list(PARAMETERS)
        moved = self.offsets(z, Role.RIG, len(names))
        return self.rig.shifted(**{name: getattr(self.rig, name) + moved[index] for index, name in enumerate(names)})

    def masses_at(self, z: FloatArray) -> FloatArray:
        """The distinct masses at z [kg]."""
        return self.masses + self.offsets(z, Role.MASS, self.masses.size)

    def by_amplitude_at(self, z: FloatArray) -> float:
        """Change of the logarithm of the modulus of K* per unit of the logarithm of the deflection's amplitude at z."""
        return float(sum(z[place] * self.std[place] for place, _ in self.of_kind(Kind.AMPLITUDE)))

    def of_specimens_at(self, z: FloatArray, units: Mapping[Kind, complex], count: int) -> ComplexArray:
        """Change of log K* at z (count,) [1] + j [rad], by drifts of the specimens or by blocks as `units` are."""
        change, values = np.zeros(count, dtype=complex), z * self.std
        for kind, unit in units.items():
            self._add(change, kind, unit, values)
        return change

    def _add(self, into: np.ndarray, kind: Kind, unit: complex, values: FloatArray) -> None:
        """Add values (p,) of a kind times their unit, each at its index; a chunk of the tests need not have all."""
        for place, index in self.of_kind(kind):
            if index < into.size:
                into[index] += unit * values[place]

    @cached_property
    def has_belts(self) -> bool:
        """Whether a specimen has a mass of its own."""
        return any(parameter.source.kind in BELTS for parameter in self.parameters)

    def belts_at(self, z: FloatArray, counts: tuple[int, int]) -> tuple[FloatArray, ComplexArray, FloatArray]:
        """Mass [kg] of each specimen, log share [1] of each family, exponent or spread [1] of each specimen at z.

        `counts` are the numbers of specimens and of families; what has no value is 0.
        """
        mass, share, exponent = np.zeros(counts[0]), np.zeros(counts[1], dtype=complex), np.zeros(counts[0])
        of_kind = {Kind.BELT_MASS: mass, Kind.BELT_SHARE: share, Kind.BELT_ANGLE: share, Kind.BELT_EXPONENT: exponent,
                   Kind.BELT_SPREAD: exponent}  # fmt: skip
        values = self.stated_values + z * self.std
        for kind, into in of_kind.items():
            self._add(into, kind, BELTS[kind][0], values)
        return mass, share, exponent

    def extra_at(self, z: FloatArray) -> dict[tuple[str, int], float]:
        """Sizes of the unstated parts at z, by name and index, in the units of `core.sources.PARTS`."""
        sizes: dict[tuple[str, int], float] = {}
        values = self.stated_values + z * self.std
        for place, index in self.of_kind(Kind.UNSTATED):
            part = self.parameters[place].source.of, index
            sizes[part] = sizes.get(part, 0.0) + float(values[place])
        return sizes

    def found(self, z: FloatArray) -> FloatArray:
        """Values at z (p,), each in its unit."""
        moved = z * self.std
        gain = np.array([parameter.is_gain for parameter in self.parameters], dtype=bool)
        return np.where(gain, np.exp(np.where(gain, moved, 0.0)), self.stated_values + moved)
