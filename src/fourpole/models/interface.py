"""The interface of a tyre model: its parameters, K* with its derivatives and, for some models, a state space."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData

#: Link of stiffness and damping in a map: their logarithm, or the value itself.
Link = Literal["log", "identity"]
#: Largest modulus of a linked value: logit between two bounds, logarithm above one bound.
_MOST_LOGIT, _MOST_LOG = 12.0, 300.0


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model.

    Attributes
    ----------
    symbol : str
        Symbol in tables and files, such as K1 or tau.
    unit : str
        SI unit.
    low, high : float
        Physical bounds, both included.
    default : float
        A usual value for a tyre.
    meaning : str
    log : bool
        Whether a fit searches its logarithm: for a positive parameter whose order of magnitude is uncertain.
    straight : bool
        Whether the link of a parameter with one bound is the value itself; see `Model.with_link`.
    """

    symbol: str
    unit: str
    low: float
    high: float
    default: float
    meaning: str
    log: bool = False
    straight: bool = False

    def link(self, values: ArrayLike) -> FloatArray:
        """The link g of the parameter, free of bounds, so that laws over conditions can be linear.

        It is a logit between two bounds, a logarithm above a lower bound, or the value itself, by which a parameter
        reaches its lower bound and stays there.
        """
        array = np.asarray(values, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            if np.isfinite(self.high) and np.isfinite(self.low):
                return np.clip(np.log((array - self.low) / (self.high - array)), -_MOST_LOGIT, _MOST_LOGIT)
            if np.isfinite(self.low) and not self.straight:
                return np.clip(np.log(array - self.low), -_MOST_LOG, _MOST_LOG)
        return array

    def unlink(self, linked: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """The parameter of a linked value, and its derivative by the linked value."""
        array = np.asarray(linked, dtype=float)
        if np.isfinite(self.high) and np.isfinite(self.low):
            share, span = 1.0 / (1.0 + np.exp(-np.clip(array, -_MOST_LOGIT, _MOST_LOGIT))), self.high - self.low
            return self.low + span * share, span * share * (1 - share)
        if np.isfinite(self.low) and not self.straight:
            size = np.exp(np.clip(array, -_MOST_LOG, _MOST_LOG))
            return self.low + size, size
        return np.maximum(array, self.low), np.where(array > self.low, 1.0, 0.0)


@dataclass(frozen=True, eq=False)
class StateSpace(ByValue):
    r"""Force F from deflection x and its rate v: :math:`\dot z = A z + B (x, v)`, :math:`F = C z + D (x, v)`.

    Attributes
    ----------
    a, b, c, d : (n, n), (n, 2), (n,), (2,) float arrays
        Real matrices for inputs in [m] and [m/s] and an output in [N]; n may be 0.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: FloatArray

    def stiffness(self, omega: ArrayLike) -> ComplexArray:
        """K* = F/x (...,) [N/m] at angular frequencies (...,) [rad/s].

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


@dataclass(frozen=True, eq=False)
class Arms(ByValue):
    """A Prony series: a spring parallel to arms of a spring and a damper in series.

    Attributes
    ----------
    rest : float [N/m]
        Stiffness at rest K_inf.
    springs, times : (n,) float arrays [N/m], [s]
        Stiffness K_i and relaxation time tau_i of each arm.
    """

    rest: float
    springs: FloatArray
    times: FloatArray

    @property
    def instantaneous(self) -> float:
        """Stiffness of a sudden deflection [N/m]: that of all springs together."""
        return float(self.rest + np.sum(self.springs))

    @property
    def space(self) -> StateSpace:
        """State space with one state per arm, the deflection of its damper; an arm with tau = 0 or K = 0 has none."""
        moves = (self.times > 0) & (self.springs > 0)
        springs, rates = self.springs[moves], 1.0 / self.times[moves]
        inputs = np.stack([rates, np.zeros_like(rates)], axis=1)
        return StateSpace(-np.diag(rates), inputs, -springs, np.array([self.rest + springs.sum(), 0.0]))


class Model(ABC):
    """A model of K*(omega). A model has no values of its own: each method takes them, one set or many at once.

    Fits, choices, commands and files take the properties of a family from these attributes; `families` lists them.

    Attributes
    ----------
    name : str
        Name for `--model`. If the family has sizes, the name ends in the size: maxwell:3.
    parameters : tuple of Parameter
        In the order of the last axis of `values`.
    usually_fixed : tuple of str
        Symbols of parameters that K* over frequency does not identify. A choice of models keeps them at known values.
    causal : bool
        Whether the force depends on past deflections only, so that the model can be simulated in time.
    rests : bool
        Whether K* tends to a positive stiffness at zero frequency: the first parameter, unless the class overrides
        `static_stiffness`. Only the fit of such a model uses K1 of a static test.
    relaxing : bool
        Whether K* is a sum of non-negative relaxation terms, like that of every passive linear tyre without inertia.
    has_inertia : bool
        Whether K* has that of a mass, so that none is taken off the data before a fit.
    special_cases, special_case_of : tuple of str
        Families that are special cases of this family, and families that have this family as a special case. Names
        are without size.
    candidate : bool
        Whether `auto` tries the family.
    sizes : range
        Sizes that are tried for the bare name of the family, from the smallest until larger ones do not help.
    for_maps : tuple of str
        Names of the models of this family that an automatic operating map tries; all of them are causal.
    linear : bool
        Whether K* is a sum of fixed terms with non-negative factors, the parameters that are not usually fixed. Such a
        fit is solved by non-negative least squares, and parameters at zero are not counted in its degrees of freedom.
    least_decades : float
        `auto` tries the family only if the band of the data spans at least so many decades.
    by_amplitude : bool
        Whether K* also depends on the amplitude of the deflection, which `at_amplitude` states.
    """

    name: str
    parameters: tuple[Parameter, ...]
    usually_fixed: tuple[str, ...] = ()
    causal: bool = True
    rests: bool = True
    relaxing: bool = True
    has_inertia: bool = False
    special_cases: tuple[str, ...] = ()
    special_case_of: tuple[str, ...] = ()
    candidate: bool = True
    sizes: range = range(0)
    for_maps: tuple[str, ...] = ()
    linear: bool = False
    least_decades: float = 0.0
    by_amplitude: bool = False

    @abstractmethod
    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m], (..., N), of parameters (..., P) at angular frequencies (N,) or (..., N) [rad/s], > 0."""

    @abstractmethod
    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives (..., N, P) of K* by each parameter, in its unit."""

    def static_stiffness(self, values: ArrayLike) -> FloatArray:
        """K* at zero frequency (...,) [N/m]: the first parameter, or 0 if the model flows at rest."""
        first = self.checked(values)[..., 0]
        return np.asarray(first if self.rests else np.zeros_like(first))

    def static_derivative(self, values: ArrayLike) -> FloatArray:
        """Derivatives (..., P) of `static_stiffness` by each parameter."""
        found = np.zeros(self.checked(values).shape)
        found[..., 0] = float(self.rests)
        return found

    def starts(self, data: StiffnessData, count: int) -> FloatArray:  # noqa: ARG002
        """From 1 to `count` start values (n, B, P) of a fit to conditions (B, N), the best first."""
        raise ModelError(f"the {self.name} model has no start values: state them")

    def ordering(self, values: FloatArray) -> np.ndarray | None:  # noqa: ARG002
        """Places (..., P) that sort the parameters, or None; needed where an exchange of two leaves K* the same."""
        return None

    def state_space(self, values: ArrayLike) -> StateSpace:
        """State space for one set of parameters (P,); ModelError if the model has none of finite order."""
        self.checked(values)
        raise ModelError(f"the {self.name} model has no state space of finite order and cannot be simulated in time")

    def prony(self, values: ArrayLike) -> Arms:
        """K* of one set of parameters (P,) as a Prony series; ModelError if it is none."""
        self.checked(values)
        raise ModelError(f"the {self.name} model is no Prony series: fit prony or maxwell")

    def with_link(self, link: Link) -> Model:
        """The model with this link of stiffness and damping; those of times, exponents and shares stay as they are.

        Examples
        --------
        >>> from fourpole.models.maxwell import Zener
        >>> Zener().with_link("identity").link(np.array([180e3, 120e3, 700.0])).tolist()
        [180000.0, 120000.0, 700.0]
        """
        made, straight = copy(self), link == "identity"
        made.parameters = tuple(replace(one, straight=straight and one.unit.startswith("N")) for one in self.parameters)
        return made

    def placed(self, conditions: Sequence[StiffnessData]) -> Model:  # noqa: ARG002
        """The model with what it takes from the band of the data, such as fixed relaxation times."""
        return self

    def at_amplitude(self, amplitude: ArrayLike) -> Model:  # noqa: ARG002
        """The model at 0-to-peak amplitudes of the deflection [m], which broadcast with the frequencies."""
        return self

    def on(self, data: StiffnessData) -> Model:
        """The model at the amplitudes of the data, if they have any."""
        return self if data.amplitude is None else self.at_amplitude(data.amplitude)

    def with_parameters(self, count: int) -> Model:  # noqa: ARG002
        """The model with this number of parameters, for a model whose number of parameters follows from the data."""
        return self

    def energy_loss(self, values: ArrayLike, omega: ArrayLike, amplitude: ArrayLike) -> FloatArray:
        """Energy loss per cycle (..., N) [J] at the 0-to-peak deflection X [m]: pi K''(X) X²."""
        there = self.at_amplitude(amplitude)
        return np.asarray(np.pi * there.stiffness(values, omega).imag * np.asarray(amplitude) ** 2)

    def checked(self, values: ArrayLike) -> FloatArray:
        """Values of the parameters as an array (..., P); ModelError if one is out of bounds or the number is wrong."""
        array = np.asarray(values, dtype=float)
        if array.ndim == 0 or array.shape[-1] != len(self.parameters):
            symbols = ", ".join(self.symbols)
            raise ModelError(f"the {self.name} model has the parameters {symbols}: {array.shape} is no such set")
        low, high = self.bounds
        inside = (array >= low) & (array <= high)
        if not inside.all():
            *_, at = place = tuple(np.argwhere(~inside)[0])
            parameter = self.parameters[at]
            raise ModelError(
                f"{parameter.symbol} = {array[place]:.6g} {parameter.unit} of the {self.name} model is outside "
                f"{parameter.low:g} to {parameter.high:g}"
            )
        return array

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Least and greatest values (P,) of the parameters."""
        return np.array([one.low for one in self.parameters]), np.array([one.high for one in self.parameters])

    def link(self, values: FloatArray) -> FloatArray:
        """The links (..., P) of all parameters (..., P)."""
        return np.stack([one.link(values[..., at]) for at, one in enumerate(self.parameters)], axis=-1)

    def unlink(self, linked: FloatArray) -> tuple[FloatArray, FloatArray]:
        """All parameters (..., P) of linked values (..., P), and their derivatives by the linked values."""
        both = [one.unlink(linked[..., at]) for at, one in enumerate(self.parameters)]
        return np.stack([one for one, _ in both], axis=-1), np.stack([slope for _, slope in both], axis=-1)

    @property
    def symbols(self) -> list[str]:
        """Symbols of the parameters, in their order."""
        return [parameter.symbol for parameter in self.parameters]

    def known(self, names: Iterable[str]) -> list[str]:
        """Symbols of all parameters; ModelError if a name is not one of them."""
        for name in names:
            if name not in self.symbols:
                raise ModelError(f"the {self.name} model has no parameter {name!r}: it has {', '.join(self.symbols)}")
        return self.symbols

    @property
    def defaults(self) -> FloatArray:
        """Default values of the parameters (P,)."""
        return np.array([parameter.default for parameter in self.parameters])


def columns(values: FloatArray) -> list[FloatArray]:
    """Each parameter as an array (..., 1) that broadcasts with frequencies."""
    return [values[..., at, None] for at in range(values.shape[-1])]


def positive(omega: ArrayLike) -> FloatArray:
    """Angular frequencies as an array (..., N) [rad/s]; ModelError unless all are positive."""
    array = np.atleast_1d(np.asarray(omega, dtype=float))
    if not np.all(array > 0):
        raise ModelError("the angular frequency must be positive everywhere [rad/s]")
    return array
