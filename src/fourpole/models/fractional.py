r"""Fractional models: two springs and one or two powers of frequency, in place of many Maxwell arms.

A power of frequency has no state space of finite order. `rational` approximates it by Maxwell arms within a band.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, spring_and_arms
from fourpole.models.interface import Model, Parameter, columns, positive
from fourpole.models.maxwell import GeneralisedMaxwell
from fourpole.models.nonnegative import two_springs, whitened_conditions

_COMMON = (
    Parameter("K0", "N/m", 0.0, np.inf, 150e3, "stiffness at rest", log=True),
    Parameter("K_inf", "N/m", 0.0, np.inf, 400e3, "stiffness at once", log=True),
    Parameter("tau", "s", 0.0, np.inf, 1e-3, "relaxation time", log=True),
    Parameter("alpha", "1", 0.0, 1.0, 0.4, "order of the derivative"),
)
#: Frequencies per arm on which the error of an approximation is evaluated; largest number of its arms.
_POINTS_PER_ARM = 12
_MOST_ARMS = 60
#: An order alpha above this is nearly that of a single relaxation time, tau.
_NEARLY_ONE = 0.9
#: Grid of starts: orders alpha, orders beta, times per decade, decades beyond the band.
_ORDERS, _BETAS = np.linspace(0.1, 1.0, 10), np.array([0.9, 0.4])
_TIMES_PER_DECADE, _DECADES_BEYOND = 2, 3.0
#: Points of the grid whose times and orders differ by at most these numbers of steps count as one optimum.
_NEAR = (1, 1)
#: Least stiffness of a start as a fraction of |K*|, and least K_inf/K0 - 1.
_LEAST_SPRING, _LEAST_RISE = 1e-6, 1e-3


class FractionalZener(Model):
    r"""The fractional Zener model of four parameters.

    .. math:: K^* = K_0 + (K_\infty - K_0) \frac{(j\omega\tau)^\alpha}{1 + (j\omega\tau)^\alpha}

    References
    ----------
    R. L. Bagley, P. J. Torvik, "On the fractional calculus model of viscoelastic behavior", J. Rheol. 30, 1986.

    Examples
    --------
    >>> FractionalZener().stiffness([180e3, 300e3, 700 / 120e3, 1.0], [20 * np.pi]).round(2)
    array([194211.27+38773.6j])
    """

    name = "fractional"
    parameters: tuple[Parameter, ...] = _COMMON
    special_cases = ("zener",)
    for_maps: tuple[str, ...] = ("fractional",)
    #: Orders beta of the grid of starts, for a model that has this parameter.
    _betas: FloatArray | None = None

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        low, high, share, _, beta = self._parts(values, omega)
        return np.asarray(low + (high - low) * share**beta)

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives by K0, K_inf, tau, alpha and, where there is one, beta."""
        tau, alpha = columns(self.checked(values))[2:4]
        low, high, share, log, beta = self._parts(values, omega)
        power = share**beta
        slope = (high - low) * beta * power * (1 - share)
        by_beta = [(high - low) * power * np.log(share)] if self._betas is not None else []
        return np.stack([1 - power, power, slope * alpha / tau, slope * log, *by_beta], axis=-1)

    def _parts(
        self, values: ArrayLike, omega: ArrayLike
    ) -> tuple[FloatArray, FloatArray, ComplexArray, ComplexArray, FloatArray | int]:
        """K0, K_inf, (jw tau)^alpha/(1 + (jw tau)^alpha), log(jw tau), and beta: 1 for a model without it."""
        low, high, tau, alpha, *beta = columns(self.checked(values))
        with np.errstate(divide="ignore"):
            log = np.log(positive(omega) * tau) + 0.5j * np.pi
        power = np.exp(alpha * log)
        return low, high, np.asarray(power / (1 + power)), np.asarray(log), beta[0] if beta else 1

    def starts(self, data: StiffnessData, count: int) -> FloatArray:
        """The best K0 and K_inf on a grid of tau, alpha and, where there is one, beta."""
        return _grid_starts(data, self._betas, count)


class FractionalZener5(FractionalZener):
    r"""The fractional Zener model of five parameters: a second order, beta, makes the loss peak skew.

    .. math:: K^* = K_0 + (K_\infty - K_0) \left(\frac{(j\omega\tau)^\alpha}{1 + (j\omega\tau)^\alpha}\right)^\beta

    With alpha and beta in (0, 1] the model is causal and passive, and K* rises from K0 to K_inf.

    References
    ----------
    S. Havriliak, S. Negami, "A complex plane representation of dielectric and mechanical relaxation processes in
    some polymers", Polymer 8, 1967. Here K0 and K_inf are exchanged: the loss peak is skew at high frequencies.

    Examples
    --------
    >>> FractionalZener5().stiffness([180e3, 300e3, 700 / 120e3, 1.0, 1.0], [20 * np.pi]).round(2)
    array([194211.27+38773.6j])
    """

    name = "fractional5"
    parameters = (*_COMMON, Parameter("beta", "1", 0.0, 1.0, 1.0, "skewness of the loss peak"))
    special_cases = ("fractional",)
    for_maps = ()
    _betas = _BETAS


def rational(
    model: Model, values: ArrayLike, band: tuple[float, float], accuracy: float = 1e-3
) -> tuple[GeneralisedMaxwell, FloatArray, float]:
    """The Maxwell model with the fewest arms that approximates a model within a band, for a simulation in time.

    Parameters
    ----------
    model : Model
        A causal and passive model.
    values : (P,) float array
    band : (float, float) [Hz]
        Band of the approximation. The relaxation times go from a decade below it to a decade above it.
    accuracy : float [1]
        Largest relative error of K* within the band.

    Returns
    -------
    GeneralisedMaxwell
    (2 n + 1,) float array
        Parameters of the Maxwell model, all stiffnesses >= 0.
    float [1]
        The largest relative error on a grid of 12 points per arm.

    Raises
    ------
    ModelError
        If 60 arms have a larger error.

    Examples
    --------
    >>> maxwell, arms, error = rational(FractionalZener(), [150e3, 400e3, 1e-3, 0.4], (1.0, 100.0))
    >>> maxwell.arms < 12 and error < 1e-3
    True
    """
    low, high = 2 * np.pi * np.asarray(band, dtype=float)
    if not 0 < low < high:
        raise ModelError(f"the band must rise and be positive, not {band[0]:g} to {band[1]:g} Hz")
    own = _one_time(model, values, low / 10, high * 10)
    worst = np.inf
    for arms in range(2, _MOST_ARMS + 1):
        omega = np.geomspace(low, high, _POINTS_PER_ARM * arms)
        target = model.stiffness(values, omega)
        times = 1.0 / np.geomspace(low / 10, high * 10, arms)
        if own is not None:  # an order of nearly 1 needs an arm with exactly this relaxation time
            times[int(np.argmin(np.abs(np.log(times / own))))] = own
        try:
            springs = arms_at(omega, target, times)
        except RuntimeError:  # so many arms are nearly dependent, and the iteration does not end
            continue
        parameters = np.concatenate([springs, times])
        maxwell = GeneralisedMaxwell(arms)
        worst = float(np.max(np.abs(maxwell.stiffness(parameters, omega) / target - 1)))
        if worst <= accuracy:
            return maxwell, parameters, worst
    raise ModelError(
        f"{_MOST_ARMS} arms have an error of {worst:.2g} of K* from {band[0]:g} to {band[1]:g} Hz, not {accuracy:g}: "
        "state a narrower band or a larger error"
    )


def arms_at(omega: FloatArray, stiffness: ComplexArray, times: FloatArray) -> FloatArray:
    """Stiffnesses (T + 1,) >= 0 at rest and of arms with times (T,) [s] whose K* is nearest to K* (N,), relatively.

    RuntimeError if the search does not end, as for arms that are nearly dependent.
    """
    rows = np.concatenate([spring_and_arms(omega, times), stiffness[:, None]], axis=1) / np.abs(stiffness)[:, None]
    real = np.concatenate([rows.real, rows.imag])
    springs: FloatArray = scipy.optimize.nnls(real[:, :-1], real[:, -1])[0]
    return springs


def _one_time(model: Model, values: ArrayLike, low: float, high: float) -> float | None:
    """The relaxation time [s] of a model whose order is nearly 1, if 1/tau is between two frequencies [rad/s]."""
    known = dict(zip((one.symbol for one in model.parameters), model.checked(values).tolist(), strict=True))
    tau = known.get("tau", 0.0)
    return tau if known.get("alpha", 0.0) > _NEARLY_ONE and low * tau <= 1.0 <= high * tau else None


def _grid_starts(data: StiffnessData, betas: FloatArray | None, count: int) -> FloatArray:
    """Starts (count, B, P), the best first: optima of a grid of tau, alpha and beta with the best K0 and K_inf >= 0."""
    omega: FloatArray = np.empty(0)
    found = []
    for condition in whitened_conditions(data):
        if not np.array_equal(omega, condition.data.omega):
            omega = condition.data.omega
            times, share = _shares(omega, betas)
            terms = np.stack([1 - share, share], axis=-1)
        springs, misfit = two_springs(condition.rows(terms), condition.target)
        places = _optima(misfit, count)
        low, high = np.maximum(springs[*places.T], _LEAST_SPRING * np.mean(np.abs(condition.data.stiffness))).T
        start = [low, np.maximum(high, low * (1 + _LEAST_RISE)), times[places[:, 0]], _ORDERS[places[:, 1]]]
        found.append(np.stack(start if betas is None else [*start, betas[places[:, 2]]], axis=1))
    return np.stack(found, axis=1)


def _shares(omega: FloatArray, betas: FloatArray | None) -> tuple[FloatArray, ComplexArray]:
    """Times (T,) [s], and the factor (T, alphas, betas, N) [1] of K_inf - K0 in K* at each point of the grid."""
    low, high = omega.min() / 10**_DECADES_BEYOND, omega.max() * 10**_DECADES_BEYOND
    times: FloatArray = 1.0 / np.geomspace(low, high, int(np.log10(high / low) * _TIMES_PER_DECADE) + 1)
    power = (1j * omega * times[:, None, None]) ** _ORDERS[:, None]
    share: ComplexArray = (power / (1 + power))[:, :, None, :]
    return times, share if betas is None else np.asarray(share ** betas[:, None])


def _optima(misfit: FloatArray, count: int) -> np.ndarray:
    """Places (count, 3) on a grid of misfits: local minima first, then the least misfits far from those chosen."""
    best = misfit <= scipy.ndimage.minimum_filter(misfit, size=3, mode="nearest")
    best.flat[np.argmin(misfit)] = True
    ranked = np.where(best, misfit, misfit + misfit.max())
    at = np.indices(misfit.shape)
    places = []
    for _ in range(count):
        place = np.unravel_index(int(np.argmin(ranked)), misfit.shape)
        places.append(place)
        near = (np.abs(at[0] - place[0]) <= _NEAR[0]) & (np.abs(at[1] - place[1]) <= _NEAR[1])
        ranked = np.where(near, np.inf, ranked)
    return np.array(places)
