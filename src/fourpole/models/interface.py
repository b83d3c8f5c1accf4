"""Interface of all models of a tyre: parameters as data, K*, its derivatives and, for some models, a state space."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData

__all__ = ["Model", "Parameter", "StateSpace"]


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model.

    Attributes
    ----------
    symbol : str
        In tables and files: K1, tau.
    unit : str
        SI.
    low, high : float
        Where it is physical, ends included.
    default : float
        A usual value, for a tyre.
    meaning : str
    log : bool
        Whether it is best searched by its logarithm: it is positive, and known by orders of magnitude only.
    """

    symbol: str
    unit: str
    low: float
    high: float
    default: float
    meaning: str
    log: bool = False


@dataclass(frozen=True, eq=False)
class StateSpace(ByValue):
    r"""Force F from deflection x and its rate v: :math:`\dot z = A z + B (x, v)`, :math:`F = C z + D (x, v)`.

    Attributes
    ----------
    a, b, c, d : (n, n), (n, 2), (n,), (2,) float arrays
        Real; n may be 0. Inputs [m] and [m/s], output [N].
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: FloatArray

    def stiffness(self, omega: ArrayLike) -> ComplexArray:
        """F/x at angular frequencies (...,) [rad/s], (...,) complex [N/m].

        Examples
        --------
        >>> damper = StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros(0), np.array([0.0, 700.0]))
        >>> damper.stiffness(10.0)
        np.complex128(7000j)
        """
        w = np.asarray(omega, dtype=float)
        drive = np.stack([np.ones(w.shape, dtype=complex), 1j * w], axis=-1)
        direct = drive @ self.d
        if not self.a.size:
            return np.asarray(direct, dtype=complex)[()]
        system = 1j * w[..., None, None] * np.eye(len(self.a)) - self.a
        states = np.linalg.solve(system, (drive @ self.b.T)[..., None])[..., 0]
        return np.asarray(direct + states @ self.c, dtype=complex)[()]


class Model(ABC):
    """A model of K*(omega); methods take the parameters' values, so that one call evaluates many sets.

    The attributes say all that fits, choices, commands and files need to know of a family; `families` lists them.

    Attributes
    ----------
    name : str
        As in `--model`; of a family with sizes it ends in the size, as maxwell:3.
    parameters : tuple of Parameter
        In the order of every array of values.
    usually_fixed : tuple of str
        Parameters that K* over frequency does not identify; a choice of models holds them at their known values.
    causal : bool
        Whether the force never comes before the deflection, so that the model can be stepped in time.
    rests : bool
        Whether K* tends to a finite stiffness at zero frequency, the first parameter unless `static_stiffness` says
        otherwise. Only such a model is held against K1 of a static test; one that flows is not.
    relaxing : bool
        Whether K* is a sum of non-negative relaxation terms, as that of every passive linear tyre without inertia.
    special_cases, special_case_of : tuple of str
        Families, by their names without size, that this one contains, and that contain it.
    candidate : bool
        Whether `auto` tries the family.
    sizes : range
        Sizes that the bare name of the family tries, as maxwell does, until larger ones do not help; or none.
    for_maps : tuple of str
        Names of its members that an automatic operating map tries.
    """

    name: str
    parameters: tuple[Parameter, ...]
    usually_fixed: tuple[str, ...] = ()
    causal: bool = True
    rests: bool = True
    relaxing: bool = True
    special_cases: tuple[str, ...] = ()
    special_case_of: tuple[str, ...] = ()
    candidate: bool = True
    sizes: range = range(0)
    for_maps: tuple[str, ...] = ()

    @abstractmethod
    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m], (..., N), of parameters (..., P) at angular frequencies (N,) or (..., N) [rad/s], > 0."""

    @abstractmethod
    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives (..., N, P) of K* by each parameter, in its unit."""

    def static_stiffness(self, values: ArrayLike) -> FloatArray:
        """K* at zero frequency (...,) [N/m]: the first parameter, or 0 of a model that flows, unless a model says."""
        first = self.checked(values)[..., 0]
        return np.asarray(first if self.rests else np.zeros_like(first))

    def static_derivative(self, values: ArrayLike) -> FloatArray:
        """Derivatives (..., P) of `static_stiffness` by each parameter."""
        found = np.zeros(self.checked(values).shape)
        found[..., 0] = float(self.rests)
        return found

    def starts(self, data: StiffnessData, count: int) -> FloatArray:  # noqa: ARG002
        """From 1 to `count` starts (n, B, P) of a fit to conditions (B, N), the best first; see `starts.starts_of`."""
        raise ModelError(f"no start is known for the {self.name} model: state one")

    def ordering(self, values: FloatArray) -> np.ndarray | None:  # noqa: ARG002
        """Indices (..., P) that sort the parameters of equivalent sets alike; None if no two sets are equivalent."""
        return None

    def state_space(self, values: ArrayLike) -> StateSpace:
        """The model in time, of one set of parameters (P,); ModelError where it has no finite causal form."""
        self.checked(values)
        raise ModelError(f"the {self.name} model cannot be stepped in time: it is not causal and finite")

    def energy_loss(self, values: ArrayLike, omega: ArrayLike, amplitude: ArrayLike) -> FloatArray:
        """Energy lost per cycle (..., N) [J] at a 0-to-peak deflection [m]: pi K'' X²."""
        return np.asarray(np.pi * self.stiffness(values, omega).imag * np.asarray(amplitude) ** 2)

    def checked(self, values: ArrayLike) -> FloatArray:
        """Parameters as an array (..., P); ModelError where one lies outside its bounds or their number is wrong."""
        array = np.asarray(values, dtype=float)
        if array.ndim == 0 or array.shape[-1] != len(self.parameters):
            symbols = ", ".join(parameter.symbol for parameter in self.parameters)
            raise ModelError(f"the {self.name} model has the parameters {symbols}: {array.shape} is no such set")
        for at, parameter in enumerate(self.parameters):
            part = array[..., at]
            if not np.all((part >= parameter.low) & (part <= parameter.high)):
                worst = float(part.flat[int(np.argmin((part >= parameter.low) & (part <= parameter.high)))])
                raise ModelError(
                    f"{parameter.symbol} = {worst:.6g} {parameter.unit} of the {self.name} model is outside "
                    f"{parameter.low:g} to {parameter.high:g}"
                )
        return array

    @property
    def symbols(self) -> list[str]:
        """Symbols of the parameters, in their order."""
        return [parameter.symbol for parameter in self.parameters]

    def known(self, names: Iterable[str]) -> list[str]:
        """The symbols of all parameters; ModelError where a name is none of them."""
        for name in names:
            if name not in self.symbols:
                raise ModelError(f"the {self.name} model has no parameter {name!r}: it has {', '.join(self.symbols)}")
        return self.symbols

    @property
    def defaults(self) -> FloatArray:
        """Usual values (P,)."""
        return np.array([parameter.default for parameter in self.parameters])


def columns(values: FloatArray) -> list[FloatArray]:
    """Each parameter as (..., 1), to broadcast against frequencies."""
    return [values[..., at, None] for at in range(values.shape[-1])]


def positive(omega: ArrayLike) -> FloatArray:
    """Angular frequencies as an array (..., N); ModelError where one is not positive."""
    array = np.atleast_1d(np.asarray(omega, dtype=float))
    if not np.all(array > 0):
        raise ModelError("the angular frequency must be positive everywhere [rad/s]")
    return array
