"""Structural damping, and Gehman's model: K1 parallel to an arm whose K2 and C depend on frequency."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.routes import maxwell_arm
from fourpole.core.tyre import zener_stiffness
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Model, Parameter, columns, positive

#: Angular frequency [rad/s] to which K2 and C of `GehmanLaw` refer, 10 Hz; largest order; bound of the exponents.
_REFERENCE, _MOST_ORDER, _STEEPEST = 20.0 * np.pi, 4, 50.0
#: Relative tolerance of the ends of the band of a table.
_EDGE = 1e-9


class Structural(Model):
    r"""A spring with structural (hysteretic) damping: :math:`K^* = K (1 + j\eta)` at every frequency.

    It is not causal, because its force precedes its deflection; so it cannot be simulated in time.

    References
    ----------
    S. H. Crandall, "The role of damping in vibration theory", J. Sound Vib. 11, 1970.

    Examples
    --------
    >>> Structural().stiffness([180e3, 0.1], [60.0]).tolist()
    [(180000+18000j)]
    """

    name = "structural"
    parameters = (
        Parameter("K", "N/m", 0.0, np.inf, 180e3, "spring", log=True),
        Parameter("eta", "1", 0.0, np.inf, 0.1, "loss factor"),
    )
    causal = False
    relaxing = False

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        k, eta = columns(self.checked(values))
        return np.asarray(k * (1 + 1j * eta) + 0 * positive(omega))

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives by K and eta."""
        k, eta = columns(self.checked(values))
        nothing = 0 * positive(omega)
        return np.stack([1 + 1j * eta + nothing, 1j * k + nothing], axis=-1)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:  # noqa: ARG002
        """K: the mean of K'; eta: the mean of K'' over that of K'."""
        k = data.stiffness
        return np.stack([np.mean(k.real, 1), np.mean(k.imag, 1) / np.mean(k.real, 1)], axis=1)[None]


class Gehman(Model):
    r"""K1 parallel to an arm whose K2 and C are tables over frequency, interpolated by shape-preserving cubics.

    .. math:: K^* = K_1 + \frac{j\omega C(\omega) K_2(\omega)}{K_2(\omega) + j\omega C(\omega)}

    It has no values outside the frequencies of the table. It is not causal.

    Parameters
    ----------
    frequency : (n,) float array [Hz]
        Frequencies, rising; n >= 2.
    k2, c : (n,) float arrays [N/m], [N s/m]
        K2 and C, positive.

    Raises
    ------
    ModelError
        If there are fewer than two rows, the frequencies do not rise, or a number is not positive.

    References
    ----------
    S. D. Gehman, "Dynamic properties of elastomers", Rubber Chem. Technol. 30, 1957; F. N. Fritsch, R. E. Carlson,
    "Monotone piecewise cubic interpolation", SIAM J. Numer. Anal. 17, 1980.

    Examples
    --------
    >>> tyre = Gehman([10.0, 20.0], [120e3, 130e3], [700.0, 500.0])
    >>> tyre.stiffness([180e3], [20 * np.pi]).round(2)
    array([194211.27+38773.6j])
    """

    name = "table"
    parameters = (Parameter("K1", "N/m", 0.0, np.inf, 180e3, "static stiffness", log=True),)
    causal = False
    relaxing = False

    def __init__(self, frequency: ArrayLike, k2: ArrayLike, c: ArrayLike) -> None:
        rows = [np.asarray(one, dtype=float) for one in (frequency, k2, c)]
        if len({one.shape for one in rows}) > 1 or rows[0].ndim != 1 or rows[0].size < 2:
            raise ModelError("a table of K2 and C needs two rows or more, with one K2 and one C for each frequency")
        if np.any(np.diff(rows[0]) <= 0) or not all(np.all(one > 0) for one in rows):
            raise ModelError("the frequencies of a table must rise, and they, K2 and C must be positive")
        self.frequency, self.k2, self.c = rows
        self._k2 = scipy.interpolate.PchipInterpolator(self.frequency, self.k2)
        self._c = scipy.interpolate.PchipInterpolator(self.frequency, self.c)

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency of the table [Hz]."""
        return float(self.frequency[0]), float(self.frequency[-1])

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]; ModelError if a frequency is outside the band."""
        (k1,) = columns(self.checked(values))
        w = positive(omega)
        frequency = w / (2 * np.pi)
        low, high = self.band
        outside = (frequency < low * (1 - _EDGE)) | (frequency > high * (1 + _EDGE))
        if outside.any():
            raise ModelError(
                f"the table goes from {low:g} to {high:g} Hz, without {float(frequency[np.argmax(outside)]):.6g} Hz: "
                "measure there, or use a model that is defined at all frequencies"
            )
        inside = np.clip(frequency, low, high)
        return np.asarray(k1 + zener_stiffness(0.0, self._k2(inside), self._c(inside), w))

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivative by K1."""
        return np.ones_like(self.stiffness(values, omega))[..., None]

    def starts(self, data: StiffnessData, count: int) -> FloatArray:  # noqa: ARG002
        """K1: the mean of K' minus that of the arm."""
        return np.mean((data.stiffness - self.stiffness([0.0], data.omega)).real, axis=1)[None, :, None]


class GehmanLaw(Model):
    r"""K1 parallel to an arm whose K2 and C are smooth functions of the frequency, with parameters to be fitted.

    .. math::

        K_2 = K_{2,10} \exp(n_1 L + n_2 L^2 + \ldots), \quad C = C_{10} \exp(r_1 L + r_2 L^2 + \ldots), \quad
        L = \ln(f / 10\,\mathrm{Hz})

    It describes K2(f) and C(f) within a band. It is not causal.

    Parameters
    ----------
    order : int
        Order of both polynomials, from 1 to 4.

    References
    ----------
    S. D. Gehman, "Dynamic properties of elastomers", Rubber Chem. Technol. 30, 1957: K2 and C that depend on frequency.

    Examples
    --------
    >>> GehmanLaw(1).stiffness([180e3, 120e3, 700.0, 0.0, 0.0], [20 * np.pi]).round(2)
    array([194211.27+38773.6j])
    """

    causal = False
    relaxing = False

    def __init__(self, order: int) -> None:
        if not 1 <= order <= _MOST_ORDER:
            raise ModelError(f"a Gehman law has an order from 1 to {_MOST_ORDER}, not {order}")
        self.order = order
        self.name = f"gehman:{order}"
        exponents = [
            Parameter(f"{letter}_{i}", "1", -_STEEPEST, _STEEPEST, 0.0, f"exponent {i} of {of} over ln(f/10 Hz)")
            for letter, of in (("n", "K2"), ("r", "C"))
            for i in range(1, order + 1)
        ]
        self.parameters = (
            Parameter("K1", "N/m", 0.0, np.inf, 180e3, "static stiffness", log=True),
            Parameter("K2", "N/m", 0.0, np.inf, 120e3, "spring of the arm at 10 Hz", log=True),
            Parameter("C", "N s/m", 0.0, np.inf, 700.0, "damper of the arm at 10 Hz", log=True),
            *exponents,
        )

    def _parts(self, values: ArrayLike, omega: ArrayLike) -> tuple[FloatArray, FloatArray, ComplexArray, FloatArray]:
        """K1 (..., 1), K2 (..., N), jwC (..., N), and powers of ln(f/10 Hz) (..., N, order)."""
        checked = self.checked(values)
        w = positive(omega)
        powers = np.log(w / _REFERENCE)[..., None] ** np.arange(1, self.order + 1)
        springs, dampers = checked[..., None, 3 : 3 + self.order], checked[..., None, 3 + self.order :]
        k2 = checked[..., 1, None] * np.exp(np.sum(springs * powers, axis=-1))
        damper = 1j * w * checked[..., 2, None] * np.exp(np.sum(dampers * powers, axis=-1))
        return checked[..., 0, None], k2, damper, powers

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        k1, k2, damper, _ = self._parts(values, omega)
        return np.asarray(k1 + k2 * damper / (k2 + damper))

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives by K1, K2, C, the exponents of K2 and those of C."""
        checked = self.checked(values)
        _, k2, damper, powers = self._parts(checked, omega)
        share = damper / (k2 + damper)
        by_log_k2, by_log_c = k2 * share**2, damper * (1 - share) ** 2
        firsts = [np.ones_like(share), by_log_k2 / checked[..., 1, None], by_log_c / checked[..., 2, None]]
        rest = [by_log_k2[..., None] * powers, by_log_c[..., None] * powers]
        return np.concatenate([np.stack(firsts, axis=-1), *rest], axis=-1)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:  # noqa: ARG002
        """Polynomials through K2 and C of each frequency."""
        return _laws(data.stiffness, data.omega, data.k1, self.order)[None]


def _laws(k: ComplexArray, omega: FloatArray, k1: FloatArray, order: int) -> FloatArray:
    """Parameters (B, P): polynomials through log K2 and log C of each frequency.

    K1 is the known one, at most 0.99 of the least K'; if it is not known, 0.9 of the least K'.
    """
    least = 0.9 * np.min(k.real, axis=1)
    rest = np.where(np.isfinite(k1) & (k1 > 0), np.minimum(np.nan_to_num(k1), 1.1 * least), least)[:, None]
    k2, c = maxwell_arm(k, rest, omega)
    found = []
    for row, static, spring, damper in zip(omega, rest[:, 0], k2, c, strict=True):
        good = np.isfinite(spring) & np.isfinite(damper) & (spring > 0) & (damper > 0)
        logs = np.log(row[good] / _REFERENCE)
        flat = np.array([abs(static), static / row.mean()])
        both = [np.log(spring[good]), np.log(damper[good])]
        laws = np.zeros((2, order + 1))
        for at, values in enumerate(both):
            degree = min(order, max(values.size - 1, 0))
            laws[at, : degree + 1] = np.polyfit(logs, values, degree)[::-1] if values.size else np.log(flat[at])
        found.append([static, *np.exp(np.clip(laws[:, 0], -100, 100)), *laws[0, 1:], *laws[1, 1:]])
    return np.array(found)
