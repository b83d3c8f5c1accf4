"""Virtual tyres: a load-deflection law, with K2 and C as functions of frequency, pressure and preload.

A virtual tyre may also be any causal model, with a linear load-deflection law.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import FloatArray
from fourpole.models.chain import in_time
from fourpole.models.interface import Model, StateSpace
from fourpole.models.maxwell import GeneralisedMaxwell
from fourpole.virtual.bench import Belt, Rod, Zener

#: Centre and half width of the pressures from 1.0 to 2.4 bar that the laws cover [Pa].
_PRESSURE_MID, _PRESSURE_HALF = 170e3, 70e3
#: Centre and span of the two preloads [N].
_LOAD_MID, _LOAD_SPAN = 1500.0, 1000.0
#: Arms that approximate a model are valid from the cam's frequency over this factor to this factor times it.
_BEYOND = 5.0
#: Reference frequency, frequency at which K2 does not depend on the pressure, and half width of the band [Hz].
_F_MID, _F_FLAT, _F_HALF = 18.0, 17.5, 7.5


@dataclass(frozen=True)
class VirtualTyre:
    r"""A tyre whose true radial properties are known by design.

    These are **not** the data of the 1982 paper, whose numbers are lost. They are smooth laws with round coefficients,
    chosen so that the statements of the paper about its two tyres are true for these two.

    As in the paper's model, K2 and C are functions of the excitation frequency. Each dynamic test therefore has a Zener
    element with the constants of its frequency. C rises with frequency, which no passive tyre without inertia can do:
    all tests together are not of one linear tyre.

    With p the pressure, P the preload, f the frequency, :math:`q = (p - 170\,kPa)/70\,kPa`,
    :math:`l = (P - 1500\,N)/1000\,N` and :math:`g = ((p - 100\,kPa)/140\,kPa)^2`

    .. math::

        F &= (a_0 + a_p p)\,x + b\,x^2 \\
        K_2 &= k\,(f/18\,Hz)^{n}\,\bigl(1 + k_p\,q\,(f - 17.5\,Hz)/7.5\,Hz\bigr)\,(1 + k_l\,l) \\
        C &= c_{level}\,(f/18\,Hz)^{r}\,(1 + c_p\,q - c_q\,q^2)\,(1 - c_l\,g\,l)

    Parameters
    ----------
    name, construction : str
        Name in the tables, and a description of the tyre.
    a0, a_p, b : float [N/m], [N/(m Pa)], [N/m^2]
        The load-deflection law; `b` >= 0.
    hysteresis : float [1]
        Half the largest gap of the loading and unloading branches, relative to the peak load of the cycle.
    conditioning : float [1]
        Excess load of the first loading over a conditioned one, relative to the load.
    k, n, k_p, k_l : float [N/m], [1], [1], [1]
        The law of K2.
    c_level, r, c_p, c_q, c_l : float [N s/m], [1], [1], [1], [1]
        The law of C.
    inertia : Belt or Rod, optional
        Its own mass between its ends; by default it is massless.
    weight : float [kg], optional
        Its whole weight, which campaign.toml states; by default nobody weighed it.

    Notes
    -----
    The laws are valid for 10 to 24 Hz, 1.0 to 2.4 bar and 1000 to 2000 N.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982: the model and the trends of the curves.

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
    inertia: Belt | Rod | None = None
    weight: float | None = None

    def load(self, deflection: ArrayLike, pressure: ArrayLike) -> FloatArray:
        """Mean load F of both branches [N] at `deflection` [m] and `pressure` [Pa].

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

    def changed(self, stiffness: float, loss: float = 1.0) -> VirtualTyre:
        """The tyre with `stiffness` times its K1 and K* at each load, and then `loss` times its C [1].

        Its deflection under each load is 1/`stiffness` times what it was.

        Examples
        --------
        >>> float((RADIAL_PLY.changed(0.9).deflection(900.0, 170e3) / RADIAL_PLY.deflection(900.0, 170e3)).round(9))
        1.111111111
        """
        return replace(
            self,
            a0=stiffness * self.a0,
            a_p=stiffness * self.a_p,
            b=stiffness * stiffness * self.b,
            k=stiffness * self.k,
            c_level=stiffness * loss * self.c_level,
        )

    def element(self, frequency: float, pressure: float, preload: float) -> Zener:
        """The element on the dynamic rig, with the constants of the cam's `frequency` [Hz]."""
        at = (pressure, preload)
        return Zener(float(self.static_stiffness(*at)), float(self.k2(frequency, *at)), float(self.c(frequency, *at)))

    def _slope_at_zero(self, pressure: ArrayLike) -> FloatArray:
        """The stiffness at zero deflection [N/m]."""
        return np.asarray(self.a0 + self.a_p * np.asarray(pressure, dtype=float))


@dataclass(frozen=True)
class ModelTyre:
    """A tyre that is a causal model, the same at every preload, and stiffer in proportion to the pressure if wanted.

    Its load-deflection law is linear, with the model's static stiffness. The truth has no K2 and C for such a tyre,
    because the model does not contain them.

    Parameters
    ----------
    name : str
        Name in the tables.
    model : Model
        The model of K*.
    values : tuple of float
        Parameters of the model.
    construction : str
        A description of the tyre.
    hysteresis, conditioning : float [1]
        The same as for a `VirtualTyre`.
    stiffening : float [1/Pa]
        Relative rise of K* at all frequencies per pressure above 1.7 bar.
    inertia : Belt or Rod, optional
        Its own mass between its ends; by default it is massless.
    weight : float [kg], optional
        Its whole weight, which campaign.toml states; by default nobody weighed it.

    Raises
    ------
    ModelError
        If a value is out of its range.
    ValueError
        If its static stiffness is not positive, so that it carries no load.

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
    stiffening: float = 0.0
    inertia: Belt | Rod | None = None
    weight: float | None = None

    def __post_init__(self) -> None:
        if not self._at_rest > 0.0:
            raise ValueError(f"{self.name}: a {self.model.name} model without stiffness at rest carries no load")

    @property
    def _at_rest(self) -> float:
        """Static stiffness of the model [N/m]."""
        return float(self.model.static_stiffness(self.values))

    def _factor(self, pressure: ArrayLike) -> FloatArray:
        """K* at a pressure over that at 1.7 bar [1]."""
        if not self.stiffening:
            return np.ones(np.shape(pressure))  # a mount has no pressure
        return np.asarray(1.0 + self.stiffening * (np.asarray(pressure, dtype=float) - _PRESSURE_MID))

    def load(self, deflection: ArrayLike, pressure: ArrayLike) -> FloatArray:
        """Mean load F [N] at `deflection` [m]."""
        return np.asarray(self._at_rest * self._factor(pressure) * np.asarray(deflection, dtype=float))

    def deflection(self, load: ArrayLike, pressure: ArrayLike) -> FloatArray:
        """Deflection x [m] under `load` [N]."""
        return np.asarray(np.asarray(load, dtype=float) / (self._at_rest * self._factor(pressure)))

    def static_stiffness(self, pressure: ArrayLike, preload: ArrayLike) -> FloatArray:
        """K1 [N/m]."""
        return np.asarray(self._at_rest * self._factor(pressure) * np.ones(np.shape(preload)))

    def element(self, frequency: float, pressure: float, preload: float) -> StateSpace:  # noqa: ARG002
        """The model in the time domain; if it needs an approximation by arms, it holds for the cam's harmonics."""
        found = in_time(self.model, self.values, (frequency / _BEYOND, frequency * _BEYOND))
        factor = float(self._factor(pressure))
        return found if factor == 1.0 else replace(found, c=factor * found.c, d=factor * found.d)


#: The tyres that a virtual campaign may test.
Tyre = VirtualTyre | ModelTyre


def _q(pressure: ArrayLike) -> FloatArray:
    """Normalised pressure [1]: -1 at 1.0 bar, +1 at 2.4 bar."""
    return np.asarray((np.asarray(pressure, dtype=float) - _PRESSURE_MID) / _PRESSURE_HALF)


def _l(preload: ArrayLike) -> FloatArray:
    """Normalised preload [1]: -1/2 at 1000 N, +1/2 at 2000 N."""
    return np.asarray((np.asarray(preload, dtype=float) - _LOAD_MID) / _LOAD_SPAN)


#: The stiffer tyre with more damping and a curved load-deflection law; its C is largest at 1.7 bar.
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

#: Both as tyres of their size are, for a small car: with tread and plies, or a belt, of half their weight. They are
#: sharper at resonance, 1 to 2 Hz lower, than the massless ones.
BELTED = (replace(CROSS_PLY, inertia=Belt(2.5), weight=5.0), replace(RADIAL_PLY, inertia=Belt(3.0), weight=5.5))

#: A damped rubber mount of two relaxation times, one below and one above the band of the cam. It is passive: with
#: rising frequency its K2 rises and its C falls.
RUBBER_MOUNT = ModelTyre(
    name="rubber-mount",
    model=GeneralisedMaxwell(2),
    values=(120e3, 60e3, 120e3, 30e-3, 3e-3),
    construction="rubber mount (virtual)",
)

#: A car's tyre: a belt of 7 kg, whose first frequency is 80 Hz with the rim held, and a loss factor near 0.1.
CAR_TYRE = ModelTyre(
    name="car-tyre",
    model=GeneralisedMaxwell(2),
    values=(252e3, 40e3, 40e3, 30e-3, 4e-3),
    construction="car's radial-ply (virtual)",
    stiffening=2.5e-6,
    inertia=Belt(7.0),
)
