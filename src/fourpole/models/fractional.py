r"""Fractional tyres: two springs and one or two powers of frequency do what many Maxwell arms do.

A power of frequency has no finite form in time; over a stated band a Maxwell model of stated accuracy takes its place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage, optimize

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Model, Parameter, columns, positive
from fourpole.models.maxwell import GeneralisedMaxwell
from fourpole.models.spectrum import two_springs, whitened_conditions

__all__ = ["FractionalZener", "FractionalZener5", "rational"]

_COMMON = (
    Parameter("K0", "N/m", 0.0, np.inf, 150e3, "stiffness at rest", log=True),
    Parameter("K_inf", "N/m", 0.0, np.inf, 400e3, "stiffness at once", log=True),
    Parameter("tau", "s", 0.0, np.inf, 1e-3, "relaxation time", log=True),
    Parameter("alpha", "1", 0.0, 1.0, 0.4, "order of the derivative"),
)
_POINTS_PER_ARM = 12
_MOST_ARMS = 60
#: Orders above this have all but one relaxation time.
_NEARLY_ONE = 0.9
#: The grid of starts: orders, leans, times per decade, decades beyond the band.
_ORDERS, _LEANS = np.linspace(0.1, 1.0, 10), np.array([0.9, 0.4])
_TIMES_PER_DECADE, _DECADES_BEYOND = 2, 3.0
#: Points of the grid as close as this, in times and in orders, lead to the same optimum.
_NEAR = (1, 1)
#: Least springs of a start, as a share of |K*|, and of their difference.
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
    parameters = _COMMON
    special_cases = ("zener",)
    for_maps = ("fractional",)

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        low, high, tau, alpha = columns(self.checked(values))
        share, _ = _share(positive(omega), tau, alpha)
        return np.asarray(low + (high - low) * share)

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives of K* by K0, K_inf, tau and alpha."""
        low, high, tau, alpha = columns(self.checked(values))
        share, log = _share(positive(omega), tau, alpha)
        slope = (high - low) * share * (1 - share)
        return np.stack([1 - share, share, slope * alpha / tau, slope * log], axis=-1)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:
        """The best springs on a grid of times and orders."""
        return _grid_starts(data, None, count)


class FractionalZener5(Model):
    r"""The fractional Zener model of five parameters: a second order lets the loss peak lean.

    .. math:: K^* = K_0 + (K_\infty - K_0) \left(\frac{(j\omega\tau)^\alpha}{1 + (j\omega\tau)^\alpha}\right)^\beta

    With alpha and beta in (0, 1] it is causal and passive, and rises from K0 to K_inf.

    References
    ----------
    S. Havriliak, S. Negami, "A complex plane representation of dielectric and mechanical relaxation processes in
    some polymers", Polymer 8, 1967; here the two ends are exchanged, so that the lean is at the upper end.

    Examples
    --------
    >>> FractionalZener5().stiffness([180e3, 300e3, 700 / 120e3, 1.0, 1.0], [20 * np.pi]).round(2)
    array([194211.27+38773.6j])
    """

    name = "fractional5"
    parameters = (*_COMMON, Parameter("beta", "1", 0.0, 1.0, 1.0, "lean of the loss peak"))
    special_cases = ("fractional",)

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        low, high, tau, alpha, beta = columns(self.checked(values))
        share, _ = _share(positive(omega), tau, alpha)
        return np.asarray(low + (high - low) * share**beta)

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives of K* by K0, K_inf, tau, alpha and beta."""
        low, high, tau, alpha, beta = columns(self.checked(values))
        share, log = _share(positive(omega), tau, alpha)
        power = share**beta
        slope = (high - low) * beta * power * (1 - share)
        by_beta = (high - low) * power * np.log(share)
        return np.stack([1 - power, power, slope * alpha / tau, slope * log, by_beta], axis=-1)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:
        """The best springs on a grid of times, orders and leans."""
        return _grid_starts(data, _LEANS, count)


def _share(omega: FloatArray, tau: FloatArray, alpha: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """(jw tau)^alpha over 1 more than itself, and the logarithm of jw tau."""
    with np.errstate(divide="ignore"):
        log = np.log(omega * tau) + 0.5j * np.pi
    power = np.exp(alpha * log)
    return np.asarray(power / (1 + power)), np.asarray(log)


def rational(
    model: Model, values: ArrayLike, band: tuple[float, float], accuracy: float = 1e-3
) -> tuple[GeneralisedMaxwell, FloatArray, float]:
    """The Maxwell model of fewest arms that is a model over a band, for its simulation in time.

    Parameters
    ----------
    model : Model
        Causal and passive.
    values : (P,) float array
    band : (float, float) [Hz]
        Where it shall hold; relaxation times are spread over it and a decade beyond either end.
    accuracy : float [1]
        Largest relative error of K* in the band.

    Returns
    -------
    GeneralisedMaxwell
    (2 n + 1,) float array
        Its parameters, all stiffnesses >= 0.
    float [1]
        The largest relative error on a grid of 12 points per arm.

    Raises
    ------
    ModelError
        If 60 arms do not reach the accuracy.

    Examples
    --------
    >>> maxwell, arms, error = rational(FractionalZener(), [150e3, 400e3, 1e-3, 0.4], (1.0, 100.0))
    >>> maxwell.arms < 12 and error < 1e-3
    True
    """
    low, high = 2 * np.pi * np.asarray(band, dtype=float)
    if not 0 < low < high:
        raise ModelError(f"the band must rise from above zero, not {band[0]:g} to {band[1]:g} Hz")
    own = _one_time(model, values, low / 10, high * 10)
    worst = np.inf
    for arms in range(2, _MOST_ARMS + 1):
        omega = np.geomspace(low, high, _POINTS_PER_ARM * arms)
        target = model.stiffness(values, omega)
        times = 1.0 / np.geomspace(low / 10, high * 10, arms)
        if own is not None:  # of order 1 there is one relaxation time, and nothing else is it
            times[int(np.argmin(np.abs(np.log(times / own))))] = own
        relaxed = 1.0 / (1.0 + 1j * omega[:, None] * times)
        columns_ = np.concatenate([np.ones((omega.size, 1)), 1 - relaxed], axis=1) / np.abs(target)[:, None]
        wanted = target / np.abs(target)
        found, _ = optimize.nnls(
            np.concatenate([columns_.real, columns_.imag]), np.concatenate([wanted.real, wanted.imag])
        )
        parameters = np.concatenate([found, times])
        maxwell = GeneralisedMaxwell(arms)
        worst = float(np.max(np.abs(maxwell.stiffness(parameters, omega) / target - 1)))
        if worst <= accuracy:
            return maxwell, parameters, worst
    raise ModelError(
        f"{_MOST_ARMS} arms reach {worst:.2g} of K* over {band[0]:g} to {band[1]:g} Hz, {accuracy:g} was asked: "
        "take a narrower band or a larger error"
    )


def _one_time(model: Model, values: ArrayLike, low: float, high: float) -> float | None:
    """The relaxation time of a model whose order is all but 1, where it lies between two frequencies [rad/s]."""
    known = dict(zip((one.symbol for one in model.parameters), model.checked(values).tolist(), strict=True))
    tau = known.get("tau", 0.0)
    return tau if known.get("alpha", 0.0) > _NEARLY_ONE and low * tau <= 1.0 <= high * tau else None


def _grid_starts(data: StiffnessData, leans: FloatArray | None, count: int) -> FloatArray:
    """The best K0, K_inf >= 0 on a grid of times, orders and leans: its optima (count, B, P), the best first."""
    omega: FloatArray = np.empty(0)
    found = []
    for seen in whitened_conditions(data):
        if not np.array_equal(omega, seen.omega):
            omega = seen.omega
            times, share = _shares(omega, leans)
            terms = np.stack([1 - share, share], axis=-1)
        springs, misfit = two_springs(seen.rows(terms), seen.wanted)
        places = _optima(misfit, count)
        low, high = np.maximum(springs[*places.T], _LEAST_SPRING * np.mean(np.abs(seen.stiffness))).T
        start = [low, np.maximum(high, low * (1 + _LEAST_RISE)), times[places[:, 0]], _ORDERS[places[:, 1]]]
        found.append(np.stack(start if leans is None else [*start, leans[places[:, 2]]], axis=1))
    return np.stack(found, axis=1)


def _shares(omega: FloatArray, leans: FloatArray | None) -> tuple[FloatArray, ComplexArray]:
    """Times (T,), and the share (T, O, L, N) of K_inf - K0 at each time, order and lean."""
    low, high = omega.min() / 10**_DECADES_BEYOND, omega.max() * 10**_DECADES_BEYOND
    times: FloatArray = 1.0 / np.geomspace(low, high, int(np.log10(high / low) * _TIMES_PER_DECADE) + 1)
    power = (1j * omega * times[:, None, None]) ** _ORDERS[:, None]
    share: ComplexArray = (power / (1 + power))[:, :, None, :]
    return times, share if leans is None else np.asarray(share ** leans[:, None])


def _optima(misfit: FloatArray, count: int) -> np.ndarray:
    """Places (count, 3) on a grid (T, O, L): local optima first, then the best of what is far from those chosen."""
    best = misfit <= ndimage.minimum_filter(misfit, size=3, mode="nearest")
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
