"""The uncertainty of a ride: errors of the model are carried to each measure, and cancel in differences if shared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.interface import Model
from fourpole.models.springs import KelvinVoigt
from fourpole.ride.response import Ride


@dataclass(frozen=True, eq=False)
class Tyre(ByValue):
    """A model at its operating point, with the errors of its parameters.

    Attributes
    ----------
    model : Model
        A causal model.
    values : (P,) float array
        Its parameters.
    errors : mapping of str to (P, E) float array
        Changes of the parameters by one standard uncertainty of each of E independent errors, by their source. Tyres
        with the same source have the same errors.
    discrepancy : (float, float) [1]
        Relative standard uncertainties of K* that the parameters do not have, in modulus and in phase: errors that are
        the same at all frequencies.
    name : str
        The tyre and its operating point in words.
    origin : str
        What the tyre is from, such as its file: tyres of the same name and origin have the same discrepancy.

    Raises
    ------
    ModelError
        If the model is not causal.
    """

    model: Model
    values: FloatArray
    errors: Mapping[str, FloatArray] = field(default_factory=dict)
    discrepancy: tuple[float, float] = (0.0, 0.0)
    name: str = "the tyre"
    origin: str = ""

    def __post_init__(self) -> None:
        """Refuse a model that is not causal."""
        if not self.model.causal:
            raise ModelError(
                f"the {self.model.name} model of {self.name} is not causal: its force begins before its deflection, "
                "and no vehicle drives on it; fit a causal one, as with fourpole fit --model prony or map --model zener"
            )
        self.model.checked(self.values)

    @property
    def source_of_discrepancy(self) -> str:
        """The source of the errors that the parameters do not have."""
        return f"{self.origin}: discrepancy of {self.name}"

    def stiffness(self, omega: FloatArray) -> ComplexArray:
        """K* (N,) [N/m] at angular frequencies (N,) [rad/s]."""
        return self.model.stiffness(self.values, omega)

    def changes(self, omega: FloatArray) -> dict[str, ComplexArray]:
        """Changes (E, N) of K* by one standard uncertainty of each error, by their source."""
        by = self.model.derivative(self.values, omega)
        found: dict[str, ComplexArray] = {
            source: (by @ effect).T for source, effect in self.errors.items() if effect.size
        }
        if any(self.discrepancy):
            k, (along, across) = self.stiffness(omega), self.discrepancy
            found[self.source_of_discrepancy] = np.stack([along * k, 1j * across * k])
        return found


def constant_damper(tyre: Tyre, frequency: float) -> Tyre:
    """A spring and a constant damper, without errors, that have the K* of a tyre at one frequency [Hz].

    Examples
    --------
    >>> from fourpole.models import Zener
    >>> found = constant_damper(Tyre(Zener(), np.array([180e3, 120e3, 700.0])), 10.0)
    >>> found.values.round(1)
    array([194211.3,    617.1])
    """
    omega = 2 * np.pi * frequency
    (k,) = tyre.stiffness(np.array([omega])).tolist()
    return Tyre(KelvinVoigt(), np.array([k.real, max(k.imag, 0.0) / omega]), name=f"{tyre.name}, constant damper")


#: Changes (E, M) of M measures by one standard uncertainty of each error, by their source.
Effects = Mapping[str, FloatArray]


def effects(found: Ride, tyre: Tyre) -> dict[str, FloatArray]:
    """Changes (E, M) of the measures of a ride by one standard uncertainty of each error of its tyre, by source."""
    omega = 2 * np.pi * found.frequency
    return {source: np.real(one @ found.by_stiffness.T) for source, one in tyre.changes(omega).items()}


def standard(of: Effects, count: int) -> FloatArray:
    """Standard uncertainties (M,) of `count` measures.

    Examples
    --------
    >>> standard({"a": np.array([[3.0, 0.0]]), "b": np.array([[4.0, 1.0]])}, 2)
    array([5., 1.])
    """
    return np.sqrt(sum((np.sum(one**2, axis=0) for one in of.values()), np.zeros(count)))


def spectrum_std(found: Ride, tyre: Tyre) -> FloatArray:
    """Standard uncertainty (N,) [m²/s³] of the spectrum of the acceleration."""
    rows = tyre.changes(2 * np.pi * found.frequency).values()
    squares = (np.sum(np.real(one * found.spectrum_by) ** 2, axis=0) for one in rows)
    return np.sqrt(sum(squares, np.zeros(found.frequency.size)))


def relative_difference(
    first: tuple[FloatArray, Effects], second: tuple[FloatArray, Effects]
) -> tuple[FloatArray, FloatArray]:
    """Relative differences (M,) [1] of the second ride from the first, and their standard uncertainties.

    Each ride is its values (M,) and their effects. Errors of the same source act on both. A measure that is zero in the
    first ride has no relative difference: not-a-number.

    Examples
    --------
    >>> one, two = np.array([1.0]), np.array([1.1])
    >>> apart, std = relative_difference((one, {"gain": np.array([[0.1]])}), (two, {"gain": np.array([[0.11]])}))
    >>> apart.round(6), std.round(6)
    (array([0.1]), array([0.]))
    """
    (a, of_a), (b, of_b) = first, second
    a, none = np.where(a == 0, np.nan, a), np.zeros(a.size)
    joint = {one: (of_b.get(one, none) - of_a.get(one, none) * (b / a)) / a for one in {**of_a, **of_b}}
    return b / a - 1.0, standard({source: np.atleast_2d(one) for source, one in joint.items()}, a.size)
