"""The operating map: a model whose parameters are smooth surfaces over pressure, preload and other axes.

One fit to all conditions gives the coefficients of the surfaces. The surface with the least leave-one-out error is
chosen. The scatter of conditions about it is adjusted until leave-one-out residuals agree with their uncertainty.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.core.curvature import arm_covariance
from fourpole.core.rig import Rig
from fourpole.core.routes import maxwell_arm
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, multiplication
from fourpole.models.interface import Model
from fourpole.models.surface import Axes, Terms, ValueSurface, bends, design, term_sets, value_surface
from fourpole.models.together import Scatter, Together, fit_together, unlink_all

#: Relative scatter of conditions in the comparison of surfaces; least and largest scatter of the search.
_SCATTER, _LEAST, _MOST = 1e-2, 1e-6, 1.0
#: Maximum number of steps of the search for the scatter.
_ROUNDS = 12
#: A frequency is inside the band up to this fraction beyond its ends: drives that are stated as 10 Hz ran near it.
_EDGE = 1e-2
#: A larger surface is chosen only if its leave-one-out error is less than this fraction of that of a smaller one.
_BETTER = 0.98


@dataclass(frozen=True)
class LeaveOneOut:
    """Comparison of each condition with the map of the other conditions; not-a-number if no condition can be omitted.

    Attributes
    ----------
    error : float [1]
        Leave-one-out error: root mean square difference between measured and predicted K*, relative.
    inside : float [1]
        Fraction of all K' and K'' that are inside the predicted 95 % intervals.
    conditions : float [1]
        Fraction of the conditions whose K' and K'' at the middle frequency are both inside.
    """

    error: float = float("nan")
    inside: float = float("nan")
    conditions: float = float("nan")


@dataclass(frozen=True, eq=False)
class Answer(ByValue):
    """K* and the values derived from it, by the map, at Q points.

    Attributes
    ----------
    stiffness : (Q,) complex array [N/m]
    k1 : (Q,) float array [N/m]
    covariance : (Q, 3, 3) float array [N²/m²]
        Covariance of Re K*, Im K* and K1.
    k2, c : (Q,) float arrays [N/m], [N s/m]
        K2 and C; not-a-number where K* needs an arm that is not passive.
    arm_covariance : (Q, 2, 2) float array
        Covariance of K2 and C to second order.
    """

    stiffness: ComplexArray
    k1: FloatArray
    covariance: FloatArray
    k2: FloatArray
    c: FloatArray
    arm_covariance: FloatArray

    @classmethod
    def of(cls, stiffness: ComplexArray, k1: FloatArray, covariance: FloatArray, omega: FloatArray) -> Answer:
        """The answer at angular frequencies (Q,) [rad/s], with K2 and C from K* and K1."""
        k2, c = maxwell_arm(stiffness, k1, omega)
        difference = np.array([[1.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # Re and Im of K* - K1
        arm = arm_covariance(stiffness, k1, omega, difference @ covariance @ difference.T)
        passive = (stiffness.real > k1) & (stiffness.imag > 0)
        return cls(
            stiffness=stiffness,
            k1=k1,
            covariance=covariance,
            k2=np.where(passive, k2, np.nan),
            c=np.where(passive, c, np.nan),
            arm_covariance=np.where(passive[:, None, None], arm, np.nan),
        )

    @property
    def stiffness_covariance(self) -> FloatArray:
        """Covariance (Q, 2, 2) of Re K* and Im K* [N²/m²]."""
        return self.covariance[:, :2, :2]

    @property
    def k1_std(self) -> FloatArray:
        """Standard uncertainty (Q,) of K1 [N/m]."""
        return np.sqrt(self.covariance[:, 2, 2])

    @property
    def loss_factor(self) -> FloatArray:
        """Loss factor K''/K' (Q,) [1]."""
        return self.stiffness.imag / self.stiffness.real

    @property
    def loss_factor_std(self) -> FloatArray:
        """Standard uncertainty (Q,) of the loss factor [1]."""
        by = np.stack([-self.loss_factor, np.ones(self.k1.size)], axis=1) / self.stiffness.real[:, None]
        return np.sqrt(np.einsum("qi,qij,qj->q", by, self.stiffness_covariance, by))

    def transmissibility(self, rig: Rig, frequency: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """TR (Q,) [1] on a rig at the frequencies of the points (Q,) [Hz], and its standard uncertainty.

        The uncertainty includes that of the rig.
        """
        omega = 2 * np.pi * np.asarray(frequency, dtype=float)
        if rig.blocked:
            return np.zeros(omega.shape), np.zeros(omega.shape)
        above = 1j * omega * rig.impedance(omega)
        whole = self.stiffness + above
        ratio = self.stiffness / whole
        # Derivatives of log TR by K* and by the values of the rig.
        by_stiffness = above / (self.stiffness * whole)
        by_rig = -(1j * omega / whole)[:, None] * rig.impedance_gradient(omega)[:, :-1]
        both = np.stack([by_stiffness.real, -by_stiffness.imag], axis=1)
        variance = np.einsum("qi,qij,qj->q", both, self.stiffness_covariance, both)
        variance = variance + np.sum((by_rig.real * rig.uncertainties) ** 2, axis=1)
        size = np.abs(ratio)
        return size, size * np.sqrt(variance)


@dataclass(frozen=True, eq=False)
class OperatingMap(ByValue):
    """A model whose parameters are functions of the operating point.

    Attributes
    ----------
    model : Model
    axes : Axes
    terms : tuple of tuples of int
        Exponents of the scaled axes, term by term.
    coefficients : (P, K) float array
        Coefficients of each linked parameter; see `together.link`.
    covariance : (P K, P K) float array
        Covariance of all coefficients, parameter by parameter.
    scatter : Scatter
        Scatter of conditions and of frequencies about the surfaces.
    band : (float, float) [Hz]
        Frequencies at which all conditions were measured.
    leave_one_out : LeaveOneOut
    static : ValueSurface or None
        K1 from the static tests, independent of K*; None if K1 is the model's stiffness at zero frequency.
    """

    model: Model
    axes: Axes
    terms: Terms
    coefficients: FloatArray
    covariance: FloatArray
    scatter: Scatter
    band: tuple[float, float]
    leave_one_out: LeaveOneOut
    static: ValueSurface | None = None

    def parameters(self, points: ArrayLike) -> FloatArray:
        """Parameters (Q, P) at points (Q, d) of the axes."""
        return self._parameters(points)[0]

    def _parameters(self, points: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Parameters (Q, P), and their derivatives (Q, P, P K) by all coefficients."""
        basis = design(self.terms, self.axes.scaled(points))
        values, slopes = self._unlinked(basis)
        by = np.zeros((*values.shape, self.coefficients.size))
        for at in range(values.shape[1]):
            by[:, at, at * basis.shape[1] : (at + 1) * basis.shape[1]] = slopes[:, at, None] * basis
        return values, by

    def _unlinked(self, basis: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Parameters (Q, P) from basis functions (Q, K), and their derivatives by the linked parameters."""
        return unlink_all(self.model, basis @ self.coefficients.T)

    def octaves_beyond(self, frequency: ArrayLike) -> FloatArray:
        """Distance (Q,) of frequencies (Q,) [Hz] from the band, in octaves; 0 inside."""
        each, (low, high) = np.asarray(frequency, dtype=float), self.band
        far = np.maximum(np.maximum(np.log2(low / each), np.log2(each / high)), 0.0)
        return np.where(far < np.log2(1 + _EDGE), 0.0, far)

    def ask(self, points: ArrayLike, frequency: ArrayLike) -> Answer:
        """K*, K1, K2 and C with their covariance at points (Q, d) of the axes and frequencies (Q,) [Hz].

        Points outside the tested conditions are evaluated as well; see `Axes.outside` and `octaves_beyond`.
        """
        omega = 2 * np.pi * np.asarray(frequency, dtype=float)
        values, by_all = self._parameters(points)
        stiffness = self.model.stiffness(values, omega[:, None])[:, 0]
        by_value = self.model.derivative(values, omega[:, None])[:, 0]
        k1 = self.model.static_stiffness(values)
        rows = np.stack([by_value.real, by_value.imag, self.model.static_derivative(values)], axis=1) @ by_all
        covariance = rows @ self.covariance @ np.swapaxes(rows, 1, 2) + self._scattered(stiffness, k1)
        covariance[:, :2, :2] += self._bent(points, omega)
        if self.static is not None:
            k1, std = self.static.at(self.axes.scaled(points), self.axes.straight)
            covariance[:, 2, :] = covariance[:, :, 2] = 0.0
            covariance[:, 2, 2] = std**2
        return Answer.of(stiffness, k1, covariance, omega)

    def _bent(self, points: ArrayLike, omega: FloatArray) -> FloatArray:
        """Covariance (Q, 2, 2) of K* for a curvature that two levels of an axis cannot show; see `surface.bends`."""
        scaled = self.axes.scaled(points)
        whole = np.zeros((len(scaled), 2, 2))
        for share, *ends in bends(scaled, self.axes.straight):
            low, high = (
                self.model.stiffness(self._unlinked(design(self.terms, one))[0], omega[:, None])[:, 0] for one in ends
            )
            bend = np.stack([(high - low).real, (high - low).imag], axis=1) * share[:, None]
            whole += bend[:, :, None] * bend[:, None, :]
        return whole

    def _scattered(self, stiffness: ComplexArray, k1: FloatArray) -> FloatArray:
        """Covariance (Q, 3, 3) of Re K*, Im K* and K1 for the scatter about the surfaces."""
        turn = multiplication(stiffness)
        spread = np.array(self.scatter.frequency) ** 2 + self.scatter.condition**2
        whole = np.zeros((stiffness.size, 3, 3))
        whole[:, :2, :2] = (turn * spread) @ np.swapaxes(turn, 1, 2)
        whole[:, 2, 2] = (self.scatter.condition * k1) ** 2
        return whole


def make_map(
    model: Model,
    conditions: Sequence[StiffnessData],
    axes: Axes,
    start: ArrayLike,
    shared: Sequence[FloatArray] | None = None,
    terms: Sequence[Terms] | None = None,
) -> OperatingMap:
    """Make the operating map of a model: choose the surface and fit its coefficients.

    Parameters
    ----------
    model : Model
    conditions : sequence of B StiffnessData
        Data of one condition each, without covariance between frequencies.
    axes : Axes
        Axes of the same conditions.
    start : (B, P) float array
        Parameters of a fit to each condition.
    shared : sequence of B (2N, p) float arrays [N/m], optional
        Effect of the errors that all conditions share; see `together.fit_together`.
    terms : sequence of Terms, optional
        Surfaces to choose from; by default `surface.term_sets`.

    Raises
    ------
    ModelError
        If no surface can be fitted.
    """
    _common_band(conditions)
    scaled = axes.scaled(axes.points)
    frequency = misfit_of(model, conditions, start)
    trial = Scatter(_SCATTER, frequency)
    tried: list[tuple[float, Terms, Together]] = []
    reason = "no surface was given"
    for one in terms if terms is not None else term_sets(axes.levels, len(conditions)):
        try:
            found = _fitted(model, conditions, start, design(one, scaled), shared, trial)
        except (ModelError, np.linalg.LinAlgError) as error:
            reason = str(error)
            continue
        error_ = _leave_one_out(found, conditions).error
        if np.isfinite(error_) or len(one) >= len(conditions):
            tried.append((error_, one, found))
    if not tried:
        raise ModelError(f"no surface of the {model.name} model could be fitted: {reason}")
    least = min(error for error, _, _ in tried)
    simplest = next((each for each in tried if each[0] * _BETTER <= least), tried[0])
    return _calibrated(model, conditions, axes, simplest[2].values, shared, simplest[1], frequency)


def misfit_of(model: Model, conditions: Sequence[StiffnessData], values: ArrayLike) -> tuple[float, float]:
    """Relative standard deviation of the residuals beyond the noise, along and across K*: the error of the model."""
    sums, noise, spare = np.zeros(2), np.zeros(2), 0.0
    for data, own in zip(conditions, np.asarray(values, dtype=float), strict=True):
        left = data.stiffness / model.on(data).stiffness(own, data.omega) - 1
        turn = multiplication(np.conj(data.stiffness) / np.abs(data.stiffness) ** 2)
        sums += [np.sum(left.real**2), np.sum(left.imag**2)]
        noise += np.sum(np.diagonal(turn @ data.covariance @ np.swapaxes(turn, 1, 2), 0, 1, 2), axis=0)
        spare += data.count - len(model.parameters) / 2
    more = np.maximum(sums / max(spare, 1.0) - noise / sum(one.count for one in conditions), 0.0)
    return float(np.sqrt(more[0])), float(np.sqrt(more[1]))


def _fitted(
    model: Model,
    conditions: Sequence[StiffnessData],
    start: ArrayLike,
    basis: FloatArray,
    shared: Sequence[FloatArray] | None,
    scatter: Scatter,
) -> Together:
    """The fit whose parameters all have the same basis functions (B, K)."""
    laws = {one.symbol: basis for one in model.parameters}
    return fit_together(model, conditions, start, laws, shared=shared, scatter=scatter)


def _omitted(
    found: Together, conditions: Sequence[StiffnessData]
) -> Iterator[tuple[StiffnessData, FloatArray, FloatArray]]:
    """Each condition with its leave-one-out residuals (2N,) [N/m] and their covariance (2N, 2N) [N²/m²]."""
    for at, data in enumerate(conditions):
        off, covariance = found.leave_one_out(at)
        size = 2 * data.count
        back = np.linalg.inv(found.whiteners[at])
        yield data, back @ off[:size], back @ covariance[:size, :size] @ back.T


def _leave_one_out(found: Together, conditions: Sequence[StiffnessData]) -> LeaveOneOut:
    """The leave-one-out error of a fit."""
    if not _has_spare_conditions(found):
        return LeaveOneOut()
    errors, scores, middle = [], [], []
    for data, off, covariance in _omitted(found, conditions):
        errors.append(np.hypot(off[::2], off[1::2]) / np.abs(data.stiffness))
        score = np.abs(off) / np.sqrt(np.diag(covariance))
        scores.append(score)
        centre = data.count // 2
        middle.append(float(score[2 * centre : 2 * centre + 2].max()))
    return LeaveOneOut(
        error=float(np.sqrt(np.mean(np.concatenate(errors) ** 2))),
        inside=float(np.mean(np.concatenate(scores) < NORMAL_95)),
        conditions=float(np.mean(np.array(middle) < NORMAL_95)),
    )


def _calibrated(
    model: Model,
    conditions: Sequence[StiffnessData],
    axes: Axes,
    start: ArrayLike,
    shared: Sequence[FloatArray] | None,
    terms: Terms,
    frequency: tuple[float, float],
) -> OperatingMap:
    """The map with the scatter of conditions that agrees with the leave-one-out residuals."""
    basis = design(terms, axes.scaled(axes.points))
    low, high, size = _LEAST, _MOST, _SCATTER
    found = _fitted(model, conditions, start, basis, shared, Scatter(0.0, frequency))
    scatter = Scatter(0.0, frequency)
    if _has_spare_conditions(found) and _excess(found, conditions) > 1:
        for _ in range(_ROUNDS):
            scatter = Scatter(size, frequency)
            found = _fitted(model, conditions, found.values, basis, shared, scatter)
            excess = _excess(found, conditions)
            low, high = (size, high) if excess > 1 else (low, size)
            if abs(excess - 1) < 0.02 or high / low < 1.02:
                break
            guess = size * np.sqrt(excess)
            size = float(guess) if low < guess < high else float(np.sqrt(low * high))
    return OperatingMap(
        model=model,
        axes=axes,
        terms=terms,
        coefficients=np.stack(found.coefficients),
        covariance=found.covariance,
        scatter=scatter,
        band=_common_band(conditions),
        leave_one_out=_leave_one_out(found, conditions),
        static=_static(conditions, axes),
    )


def _has_spare_conditions(found: Together) -> bool:
    """Whether there are more conditions than terms, so that one condition can be omitted."""
    return len(found.values) > max(one.shape[1] for one in found.designs)


def _common_band(conditions: Sequence[StiffnessData]) -> tuple[float, float]:
    """Band in which all conditions were measured [Hz]; ModelError if there is none."""
    low = max(float(one.omega.min()) for one in conditions) / (2 * np.pi)
    high = min(float(one.omega.max()) for one in conditions) / (2 * np.pi)
    if low > high * (1 + 1e-9):
        raise ModelError(
            f"no frequency is common to all conditions: one begins at {low:.4g} Hz, another ends at {high:.4g} Hz; map "
            "those apart, or choose some with --band"
        )
    return low, max(low, high)


def _static(conditions: Sequence[StiffnessData], axes: Axes) -> ValueSurface | None:
    """K1 over the axes, from the static tests; None unless every condition has a K1."""
    k1, std = (np.array([float(getattr(one, name)) for one in conditions]) for name in ("k1", "k1_std"))
    if not (np.all(np.isfinite(k1)) and np.all(np.isfinite(std)) and np.all(k1 > 0)):
        return None
    return value_surface(axes, k1, std)


def _excess(found: Together, conditions: Sequence[StiffnessData]) -> float:
    """Mean ratio of the squared leave-one-out residuals to their variance, residuals averaged over frequency."""
    ratios = []
    for data, off, covariance in _omitted(found, conditions):
        relative = np.conj(data.stiffness) / np.abs(data.stiffness) ** 2 / data.count
        mean = np.hstack(list(multiplication(relative)))  # the mean of log K*, Re and Im, from (2N,) residuals
        ratios.append((mean @ off) ** 2 / np.diag(mean @ covariance @ mean.T))
    return float(np.mean(ratios))
