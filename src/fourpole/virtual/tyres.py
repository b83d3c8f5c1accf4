"""Tyres in software: a load-deflection law, and K2 and C as functions of frequency, pressure and preload.

Or any model that is causal, with a straight law.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fourpole.models.chain import in_time
from fourpole.models.interface import Model, StateSpace
from fourpole.virtual.dynamic_rig import Zener

__all__ = ["CROSS_PLY", "RADIAL_PLY", "ModelTyre", "Tyre", "VirtualTyre"]

FloatArray = NDArray[np.float64]

_PRESSURE_MID, _PRESSURE_HALF = (
    170e3,
    70e3,
)  # Pa: centre and half width of the 1.0 to 2.4 bar that the laws cover
_LOAD_MID, _LOAD_SPAN = 1500.0, 1000.0  # N: centre and span of the two preloads
#: A model's arms hold from this share of the cam's frequency to as many times it.
_BEYOND = 5.0
_F_MID, _F_FLAT, _F_HALF = 18.0, 17.5, 7.5  # Hz: reference, where K2 ignores the pressure, half width


@dataclass(frozen=True)
class VirtualTyre:
    r"""A tyre whose true radial properties are known, because they were designed.

    These are **not** the data of the 1982 paper, of which no numbers survive: they are smooth laws with
    round coefficients, chosen so that what the paper says of its two tyres is true of these two.

    As in the paper's model, K2 and C are functions of the frequency at which the rig runs. Each dynamic test
    is therefore run on a Zener element with constants taken at its drive frequency: a C that rises with
    frequency lies outside any single relaxation model, so no one element can serve all frequencies.

    With p the pressure, P the preload, f the frequency, :math:`q = (p - 170\,kPa)/70\,kPa`,
    :math:`l = (P - 1500\,N)/1000\,N` and :math:`g = ((p - 100\,kPa)/140\,kPa)^2`

    .. math::

        F &= (a_0 + a_p p)\,x + b\,x^2 \\
        K_2 &= k\,(f/18\,Hz)^{n}\,\bigl(1 + k_p\,q\,(f - 17.5\,Hz)/7.5\,Hz\bigr)\,(1 + k_l\,l) \\
        C &= c_{level}\,(f/18\,Hz)^{r}\,(1 + c_p\,q - c_q\,q^2)\,(1 - c_l\,g\,l)

    Parameters
    ----------
    name, construction : str
        Name in the tables, and what the tyre is, in words.
    a0, a_p, b : float [N/m], [N/(m Pa)], [N/m^2]
        The load-deflection law; `b` >= 0.
    hysteresis : float [1]
        Half the widest gap of the loading and unloading branches over the peak load of the cycle.
    conditioning : float [1]
        How much more the first loading takes than a conditioned one, over the load.
    k, n, k_p, k_l : float [N/m], [1], [1], [1]
        The law of K2.
    c_level, r, c_p, c_q, c_l : float [N s/m], [1], [1], [1], [1]
        The law of C.

    Notes
    -----
    Meant for 10 to 24 Hz, 1.0 to 2.4 bar and 1000 to 2000 N; beyond, the laws go on but mean nothing.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982: the model and what the curves show.

    Examples
    --------
    >>> float(RADIAL_PLY.static_stiffness(170e3, 1000.0).round(0))
    109950.0
    >>> bool(CROSS_PLY.c(18.0, 170e3, 1000.0) > RADIAL_PLY.c(18.0, 170e3, 1000.0))
    True
    """

    name: str
    construction: str
    a0: float
    a_p: float
    b: float
    hysteresis: float
    conditioning: float
    k: float
    n: float
    k_p: float
    k_l: float
    c_level: float
    r: float
    c_p: float
    c_q: float
    c_l: float

    def load(self, deflection: ArrayLike, pressure: ArrayLike) -> FloatArray:
        """Mean load F [N] at `deflection` [m] and `pressure` [Pa]: halfway between the branches.

        Examples
        --------
        >>> float(RADIAL_PLY.load(0.01, 170e3).round(1))
        1086.0
        """
        x = np.asarray(deflection, dtype=float)
        return np.asarray((self._slope_at_zero(pressure) + self.b * x) * x)

    def deflection(self, load: ArrayLike, pressure: ArrayLike) -> FloatArray:
        """Deflection x [m] under `load` [N] at `pressure` [Pa]: the inverse of `load`.

        Examples
        --------
        >>> float(RADIAL_PLY.deflection(1086.0, 170e3).round(6))
        0.01
        """
        return np.asarray(
            2.0 * np.asarray(load) / (self._slope_at_zero(pressure) + self.static_stiffness(pressure, load))
        )

    def static_stiffness(self, pressure: ArrayLike, preload: ArrayLike) -> FloatArray:
        """K1 [N/m]: tangent of the mean load-deflection curve at `preload` [N] and `pressure` [Pa].

        Examples
        --------
        >>> float(CROSS_PLY.static_stiffness(100e3, 2000.0).round(0))
        168950.0
        """
        a = self._slope_at_zero(pressure)
        return np.asarray(np.sqrt(a * a + 4.0 * self.b * np.asarray(preload, dtype=float)))

    def k2(self, frequency: ArrayLike, pressure: ArrayLike, preload: ArrayLike) -> FloatArray:
        """K2 [N/m] at `frequency` [Hz], `pressure` [Pa] and `preload` [N].

        Examples
        --------
        >>> float(RADIAL_PLY.k2(18.0, 170e3, 1500.0).round(0))
        110000.0
        """
        f = np.asarray(frequency, dtype=float)
        by_pressure = 1.0 + self.k_p * _q(pressure) * (f - _F_FLAT) / _F_HALF
        return np.asarray(self.k * (f / _F_MID) ** self.n * by_pressure * (1.0 + self.k_l * _l(preload)))

    def c(self, frequency: ArrayLike, pressure: ArrayLike, preload: ArrayLike) -> FloatArray:
        """C [N s/m] at `frequency` [Hz], `pressure` [Pa] and `preload` [N].

        Examples
        --------
        >>> float(CROSS_PLY.c(18.0, 170e3, 1500.0).round(0))
        1400.0
        """
        f = np.asarray(frequency, dtype=float)
        q = _q(pressure)
        g = (0.5 * (q + 1.0)) ** 2
        by_pressure = 1.0 + self.c_p * q - self.c_q * q * q
        return np.asarray(self.c_level * (f / _F_MID) ** self.r * by_pressure * (1.0 - self.c_l * g * _l(preload)))

    def element(self, frequency: float, pressure: float, preload: float) -> Zener:
        """What stands on the dynamic rig, with constants taken at the `frequency` [Hz] of the cam."""
        at = (pressure, preload)
        return Zener(float(self.static_stiffness(*at)), float(self.k2(frequency, *at)), float(self.c(frequency, *at)))

    def _slope_at_zero(self, pressure: ArrayLike) -> FloatArray:
        """The stiffness at zero deflection [N/m]."""
        return np.asarray(self.a0 + self.a_p * np.asarray(pressure, dtype=float))


@dataclass(frozen=True)
class ModelTyre:
    """A tyre that is a causal model, the same at every pressure and preload.

    Its load-deflection law is the straight line of its static stiffness; K2 and C it has only as its K* has them, so
    that the truth leaves them blank.

    Parameters
    ----------
    name : str
    model : Model
    values : tuple of float
        Its parameters.
    construction : str
    hysteresis, conditioning : float [1]
        As of a `VirtualTyre`.

    Raises
    ------
    ModelError
        If a value is out of its range.
    ValueError
        If it has no stiffness at rest, so that it carries no load.

    Examples
    --------
    >>> from fourpole.models.springs import KelvinVoigt
    >>> mount = ModelTyre("mount", KelvinVoigt(), (180e3, 300.0))
    >>> mount.element(10.0, 170e3, 1000.0).d.tolist(), float(mount.deflection(1800.0, 170e3))
    ([180000.0, 300.0], 0.01)
    """

    name: str
    model: Model
    values: tuple[float, ...]
    construction: str = "a model (virtual)"
    hysteresis: float = 0.02
    conditioning: float = 0.03

    def __post_init__(self) -> None:
        if not self._at_rest > 0.0:
            raise ValueError(f"{self.name}: a {self.model.name} model without stiffness at rest carries no load")

    @property
    def _at_rest(self) -> float:
        return float(self.model.static_stiffness(self.values))

    def load(self, deflection: ArrayLike, pressure: ArrayLike) -> FloatArray:  # noqa: ARG002
        """Mean load F [N] at `deflection` [m]."""
        return np.asarray(self._at_rest * np.asarray(deflection, dtype=float))

    def deflection(self, load: ArrayLike, pressure: ArrayLike) -> FloatArray:  # noqa: ARG002
        """Deflection x [m] under `load` [N]."""
        return np.asarray(np.asarray(load, dtype=float) / self._at_rest)

    def static_stiffness(self, pressure: ArrayLike, preload: ArrayLike) -> FloatArray:
        """K1 [N/m]."""
        return np.full(np.broadcast_shapes(np.shape(pressure), np.shape(preload)), self._at_rest)

    def element(self, frequency: float, pressure: float, preload: float) -> StateSpace:  # noqa: ARG002
        """What stands on the dynamic rig: the model in time; arms, if it takes them, hold over the cam's harmonics."""
        return in_time(self.model, self.values, (frequency / _BEYOND, frequency * _BEYOND))


#: What a virtual campaign may test.
Tyre = VirtualTyre | ModelTyre


def _q(pressure: ArrayLike) -> FloatArray:
    """Pressure on the scale where 1.0 bar is -1 and 2.4 bar is +1."""
    return np.asarray((np.asarray(pressure, dtype=float) - _PRESSURE_MID) / _PRESSURE_HALF)


def _l(preload: ArrayLike) -> FloatArray:
    """Preload on the scale where 1000 N is -1/2 and 2000 N is +1/2."""
    return np.asarray((np.asarray(preload, dtype=float) - _LOAD_MID) / _LOAD_SPAN)


#: The stiffer, more damped tyre with the curved load-deflection law; its C is largest at 1.7 bar.
CROSS_PLY = VirtualTyre(
    name="cross-ply",
    construction="cross-ply (virtual)",
    a0=100e3,
    a_p=0.12,
    b=2.0e6,
    hysteresis=0.035,
    conditioning=0.05,
    k=180e3,
    n=0.8,
    k_p=0.15,
    k_l=0.04,
    c_level=1400.0,
    r=0.05,
    c_p=0.0,
    c_q=0.18,
    c_l=0.10,
)

#: The softer tyre with the nearly straight load-deflection law; its C rises with pressure and frequency.
RADIAL_PLY = VirtualTyre(
    name="radial-ply",
    construction="radial-ply (virtual)",
    a0=90e3,
    a_p=0.10,
    b=0.16e6,
    hysteresis=0.02,
    conditioning=0.03,
    k=110e3,
    n=0.8,
    k_p=0.15,
    k_l=0.02,
    c_level=850.0,
    r=0.25,
    c_p=0.10,
    c_q=0.0,
    c_l=0.10,
)
