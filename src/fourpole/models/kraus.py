r"""Filled rubber: a fractional Zener model, and Kraus's law of the amplitude (the Payne effect) in parallel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fractional import FractionalZener
from fourpole.models.interface import Model, Parameter, columns, positive
from fourpole.models.nonnegative import WhitenedCondition, whitened_conditions

#: Angular frequency to which D and L refer [rad/s]: 10 Hz.
_REFERENCE = 2 * np.pi * 10.0
#: Grid of starts: exponents m, orders alpha, number of amplitudes x_c and of times tau, and decades beyond the band.
_EXPONENTS, _ORDERS, _AMPLITUDES, _TIMES, _DECADES_BEYOND = (0.35, 0.6, 1.0), (0.2, 0.4, 0.7, 1.0), 7, 9, 1.5
#: Starts of beta, and start of eta.
_GROWTHS, _LOSS = (0.02, 0.15), 0.05
#: Least stiffness of a start as a fraction of |K*|, and least K_inf/K0 - 1.
_LEAST_SPRING, _LEAST_RISE = 1e-4, 1e-2
_NETWORK = FractionalZener()
_SIZE = len(_NETWORK.parameters)
#: Largest variance inflation with which two variables count as told apart.
MOST_INFLATION = 10.0
#: Least standard deviation of ln x that the frequency does not explain [1].
LEAST_SPREAD = 0.05
#: Least and largest number of terms of the curve of ln x over ln f; frequencies within this ratio count as one.
_FEWEST, _MOST, _SAME = 6, 12, 1.01


class Kraus(Model):
    r"""The fractional Zener model of the rubber, and beside it Kraus's law of the filler over the 0-to-peak deflection.

    .. math::

        K^* &= K_0 + (K_\infty - K_0) \frac{(j\omega\tau)^\alpha}{1 + (j\omega\tau)^\alpha}
        + \left(\frac{\omega}{\omega_0}\right)^\beta
        \left(\frac{(1 + j\eta)\,D}{1 + y^{2m}} + 2j\,L\,\frac{y^m}{1 + y^{2m}}\right) , \\
        y &= x/x_c , \qquad \omega_0 = 2\pi \cdot 10\ \mathrm{Hz} .

    In Kraus's law the loss is the same at very small and at very large amplitudes. Measured losses are larger at small
    ones, hence eta. K* is the ratio of the fundamental waves of force and deflection at one amplitude x. The law
    states no waveform, so that the model cannot be simulated in time.

    Parameters
    ----------
    amplitude : float array, optional [m]
        0-to-peak amplitudes of the deflection, which broadcast with the frequencies; see `at_amplitude`.

    References
    ----------
    G. Kraus, "Mechanical losses in carbon-black-filled rubbers", J. Appl. Polym. Sci.: Appl. Polym. Symp. 39, 1984:
    storage and loss over the amplitude. J. D. Ulmer, "Strain dependence of dynamic mechanical properties of carbon
    black-filled rubber compounds", Rubber Chem. Technol. 69, 1996: the loss at small amplitudes. M. J. García Tárrago,
    L. Kari, J. Viñolas, N. Gil-Negrete, "Frequency and amplitude dependence of the axial and radial stiffness of
    carbon-black filled rubber bushings", Polymer Testing 26, 2007: a sum of an elastic, a fractional viscoelastic and
    an amplitude-dependent part describes a bushing at 0.1 to 0.5 mm and 5 to 155 Hz.

    Examples
    --------
    >>> filled = Kraus().at_amplitude([1e-5, 1e-3, 1e-1])
    >>> filled.stiffness([150e3, 150.1e3, 1e-3, 0.4, 100e3, 20e3, 1e-3, 0.6, 0.0, 0.0], [60.0]).round(-3).tolist()
    [(250000+3000j), (200000+20000j), (150000+3000j)]
    """

    name = "kraus"
    parameters = (
        *_NETWORK.parameters,
        Parameter("D", "N/m", 0.0, np.inf, 60e3, "fall of K' from small to large amplitudes, at 10 Hz", log=True),
        Parameter("L", "N/m", 0.0, np.inf, 15e3, "rise of K'' at the amplitude x_c, at 10 Hz", log=True),
        Parameter("x_c", "m", 0.0, np.inf, 1e-3, "amplitude at which half of the fall is done", log=True),
        Parameter("m", "1", 0.0, 2.0, 0.6, "exponent of the amplitude"),
        Parameter("beta", "1", 0.0, 1.0, 0.05, "exponent of the frequency, of D and L"),
        Parameter("eta", "1", 0.0, 1.0, 0.05, "loss factor of D"),
    )
    causal = False
    relaxing = False
    rests = False
    candidate = False
    special_cases = ("fractional",)
    by_amplitude = True

    def __init__(self, amplitude: ArrayLike | None = None) -> None:
        self._amplitude = None if amplitude is None else np.asarray(amplitude, dtype=float)

    def at_amplitude(self, amplitude: ArrayLike) -> Kraus:
        """The model at 0-to-peak amplitudes of the deflection [m]; ModelError unless they are positive."""
        array = np.asarray(amplitude, dtype=float)
        if not np.all(array > 0):
            raise ModelError("the amplitude of the deflection must be positive [m]")
        made = type(self)(array)
        made.parameters = self.parameters
        return made

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        array = self.checked(values)
        fall, rise, _ = self._law(array)
        d, loss, _, _, beta, eta = columns(array[..., _SIZE:])
        grown = (positive(omega) / _REFERENCE) ** beta
        return np.asarray(
            _NETWORK.stiffness(array[..., :_SIZE], omega) + grown * ((1 + 1j * eta) * d * fall + 1j * loss * rise)
        )

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives by the parameters in their order."""
        array = self.checked(values)
        fall, rise, log = self._law(array)
        d, loss, x_c, m, beta, eta = columns(array[..., _SIZE:])
        growth = np.log(positive(omega) / _REFERENCE)
        grown = np.exp(beta * growth)
        turn = 1 + 1j * eta
        # Derivative by 2 m log y: that of the fall u is -u (1 - u), that of the rise v is v (2 u - 1)/2.
        bent = grown * (-turn * d * fall * (1 - fall) + 0.5j * loss * rise * (2 * fall - 1))
        whole = grown * (turn * d * fall + 1j * loss * rise)
        by_law = [turn * fall * grown, 1j * rise * grown, -2 * m / x_c * bent, 2 * log * bent]
        by_law += [whole * growth, 1j * d * fall * grown]
        by_network = _NETWORK.derivative(array[..., :_SIZE], omega)
        shape = np.broadcast_shapes(by_network.shape[:-1], whole.shape)
        parts = [np.broadcast_to(by_network, (*shape, _SIZE))]
        return np.concatenate([*parts, np.stack([np.broadcast_to(one, shape) for one in by_law], axis=-1)], axis=-1)

    def _law(self, array: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Fall 1/(1 + y^2m) and rise 2 y^m/(1 + y^2m) of Kraus's law, and log y, at the amplitudes (..., N)."""
        if self._amplitude is None:
            raise ModelError("K* of the kraus model depends on the amplitude of the deflection: state one")
        _, _, x_c, m, _, _ = columns(array[..., _SIZE:])
        with np.errstate(divide="ignore"):
            log = np.log(self._amplitude / x_c)
        fall = 1.0 / (1.0 + np.exp(np.clip(2 * m * log, -600.0, 600.0)))
        return fall, 2.0 * np.sqrt(fall * (1.0 - fall)), log

    def static_stiffness(self, values: ArrayLike) -> FloatArray:
        """Not-a-number (...,): the law has no stiffness at rest, where the amplitude has no meaning."""
        return np.full(self.checked(values).shape[:-1], np.nan)

    def static_derivative(self, values: ArrayLike) -> FloatArray:
        """Derivatives (..., P) of `static_stiffness` by each parameter: 0."""
        return np.zeros(self.checked(values).shape)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:
        """The best stiffnesses >= 0 on a grid of tau, alpha, x_c and m, each with the betas of `_GROWTHS`."""
        amplitude = self._amplitude if data.amplitude is None else data.amplitude
        if amplitude is None:
            raise ModelError("the kraus model needs the amplitude of the deflection at each frequency")
        conditions = whitened_conditions(replace(data, amplitude=np.broadcast_to(amplitude, data.stiffness.shape)))
        return np.stack([_starts_of_one(one, count) for one in conditions], axis=1)


def _starts_of_one(condition: WhitenedCondition, count: int) -> FloatArray:
    """Starts (count, P) for one condition with amplitudes."""
    data, omega, amplitude = condition.data, condition.data.omega, condition.data.amplitude
    assert amplitude is not None
    grid = _grid(omega, amplitude)
    power = (1j * omega * grid[:, :1]) ** grid[:, 1:2]
    y = (amplitude / grid[:, 2:3]) ** grid[:, 3:4]
    share, fall = power / (1 + power), 1 / (1 + y**2)
    terms = np.stack([1 - share, share, (1 + _LOSS * 1j) * fall, 2j * y * fall], axis=-1)
    rows = data.whitened(condition.whiten, terms)
    target = data.whitened(condition.whiten, data.stiffness[:, None])[:, 0]
    turned = np.swapaxes(rows, 1, 2)
    normal = turned @ rows
    size = np.maximum(np.diagonal(normal, 0, 1, 2), 1e-300)
    normal = normal + 1e-9 * size[:, :, None] * np.eye(4)
    least = _LEAST_SPRING * np.mean(np.abs(data.stiffness))
    springs = np.maximum(np.linalg.solve(normal, (turned @ target)[..., None])[..., 0], least)
    springs[:, 1] = np.maximum(springs[:, 1], springs[:, 0] * (1 + _LEAST_RISE))
    misfit = np.sum(((rows @ springs[..., None])[..., 0] - target) ** 2, axis=1)
    best = np.argsort(misfit)[: -(-count // len(_GROWTHS))]
    values = np.concatenate([springs[:, :2], grid[:, :2], springs[:, 2:], grid[:, 2:]], axis=1)
    return np.array([[*values[at], beta, _LOSS] for at in best for beta in _GROWTHS])[:count]


def _grid(omega: FloatArray, amplitude: FloatArray) -> FloatArray:
    """Points (G, 4) of the grid of tau, alpha, x_c and m."""
    low, high = omega.min() / 10**_DECADES_BEYOND, omega.max() * 10**_DECADES_BEYOND
    times = 1.0 / np.geomspace(low, high, _TIMES)
    sizes = np.geomspace(amplitude.min() / 3, amplitude.max() * 3, _AMPLITUDES)
    mesh = np.meshgrid(times, _ORDERS, sizes, _EXPONENTS, indexing="ij")
    return np.stack([one.ravel() for one in mesh], axis=1)


@dataclass(frozen=True)
class Separation:
    """How far the tests of one condition tell amplitude from frequency.

    Attributes
    ----------
    correlation : float [1]
        Multiple correlation of the logarithm of the amplitude with a smooth curve over the logarithm of frequency.
    inflation : float [1]
        Variance inflation of the amplitude exponents: by this factor the variance of an exponent of the amplitude is
        larger than if amplitude and frequency had been varied independently. Infinite if the curve explains all.
    spread : float [1]
        Standard deviation of ln x that the curve does not explain.
    """

    correlation: float
    inflation: float
    spread: float

    @property
    def possible(self) -> bool:
        """Whether amplitude and frequency can be told apart."""
        return self.inflation <= MOST_INFLATION and self.spread >= LEAST_SPREAD


def separation(frequency: ArrayLike, amplitude: ArrayLike) -> Separation:
    r"""How far tests tell the amplitude from the frequency.

    K* near one point is :math:`\ln K^* = c(\ln f) + (p + jq) \ln x` with a smooth c. The variance of p and of q is
    :math:`1/(1 - R^2)` times that of independent variables, where R is the multiple correlation of ln x with c.

    Parameters
    ----------
    frequency, amplitude : (N,) float arrays [Hz], [m]
        Frequency and 0-to-peak amplitude of the deflection of each test, > 0.

    References
    ----------
    D. W. Marquardt, "Generalized inverses, ridge regression, biased linear estimation, and nonlinear estimation",
    Technometrics 12, 1970: variance inflation, which should not be above 10.

    Examples
    --------
    >>> bench = separation([1.0, 1.0, 3.0, 3.0, 9.0, 9.0], [1e-4, 1e-3] * 3)
    >>> bench.possible, round(bench.inflation, 3)
    (True, 1.0)
    >>> cam = separation([10.0, 14.0, 18.0, 22.0], [1e-3, 2e-3, 3e-3, 1.5e-3])
    >>> cam.possible, cam.inflation
    (False, inf)
    """
    logs, moved = np.log(np.asarray(frequency, dtype=float)), np.log(np.asarray(amplitude, dtype=float))
    moved = moved - moved.mean()
    distinct = 1 + int(np.sum(np.diff(np.sort(logs)) > np.log(_SAME)))
    terms = min(max(_FEWEST, distinct // 2), _MOST, distinct)
    span = float(np.ptp(logs)) or 1.0
    rows = legendre.legvander(2 * (logs - logs.min()) / span - 1, terms - 1)
    left = moved - rows @ np.linalg.lstsq(rows, moved, rcond=None)[0]
    whole, rest = float(moved @ moved), float(left @ left)
    alone = logs.size <= terms or rest <= 1e-24 * max(whole, 1.0)
    share = 0.0 if alone else min(rest / whole, 1.0)  # a rest beyond the whole is round-off
    return Separation(
        correlation=float(np.sqrt(1 - share)),
        inflation=1 / share if share else float("inf"),
        spread=0.0 if alone else float(np.sqrt(rest / logs.size)),
    )
