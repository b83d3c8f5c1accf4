"""The operating map: a model whose parameters are smooth surfaces over pressure, preload and other axes.

All conditions are fitted at once, the surfaces' coefficients being all that is free. Which surface is right is said by
conditions left out one at a time; how far conditions scatter about it is found so that what is left out lies where its
interval says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.rig import Rig
from fourpole.core.routes import arm_slopes, maxwell_arm
from fourpole.errors import ModelError
from fourpole.models.data import NORMAL_95, StiffnessData, turning
from fourpole.models.interface import Model
from fourpole.models.surface import Axes, Terms, ValueSurface, bends, design, term_sets, value_surface
from fourpole.models.together import Scatter, Together, fit_together, unlink

__all__ = ["Answer", "LeftOut", "OperatingMap", "make_map", "misfit_of"]

#: Scatter of conditions with which surfaces are compared, and the least and most that is looked for.
_SCATTER, _LEAST, _MOST = 1e-2, 1e-6, 1.0
_ROUNDS = 12
#: A frequency within this share of the band's end is inside.
_EDGE = 1e-3
#: A surface must be better by this share than a simpler one.
_BETTER = 0.98


@dataclass(frozen=True)
class LeftOut:
    """Conditions left out one at a time.

    Attributes
    ----------
    error : float [1]
        Root mean square of K* measured less K* foretold, relative.
    inside : float [1]
        Share of K' and K'' of all tests inside their 95 % intervals.
    conditions : float [1]
        Share of the conditions whose worst of both, at the middle frequency, is inside.
    """

    error: float
    inside: float
    conditions: float


@dataclass(frozen=True, eq=False)
class Answer(ByValue):
    """Values of the operating map at Q points.

    Attributes
    ----------
    stiffness : (Q,) complex array [N/m]
    k1 : (Q,) float array [N/m]
    covariance : (Q, 3, 3) float array [N²/m²]
        Of Re K*, Im K* and K1.
    k2, c : (Q,) float arrays [N/m], [N s/m]
        Not-a-number where no passive arm has this K*.
    arm_covariance : (Q, 2, 2) float array
        Of K2 and C.
    """

    stiffness: ComplexArray
    k1: FloatArray
    covariance: FloatArray
    k2: FloatArray
    c: FloatArray
    arm_covariance: FloatArray

    @property
    def std(self) -> FloatArray:
        """Standard uncertainties (Q, 3) of Re K*, Im K* and K1 [N/m]."""
        return np.sqrt(np.diagonal(self.covariance, 0, 1, 2))

    @property
    def loss_factor(self) -> tuple[FloatArray, FloatArray]:
        """K''/K' (Q,) [1], and its standard uncertainty."""
        real, value = self.stiffness.real, self.stiffness.imag / self.stiffness.real
        by = np.stack([-value, np.ones_like(real)], axis=1) / real[:, None]
        return value, np.sqrt(np.einsum("qi,qij,qj->q", by, self.covariance[:, :2, :2], by))

    def transmissibility(self, rig: Rig, frequency: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """TR (Q,) on a rig at the frequencies asked (Q,) [Hz], and its standard uncertainty, the rig's own included."""
        omega = 2 * np.pi * np.asarray(frequency, dtype=float)
        if rig.blocked:
            return np.zeros(omega.shape), np.zeros(omega.shape)
        above = 1j * omega * rig.impedance(omega)
        whole = self.stiffness + above
        ratio = self.stiffness / whole
        by_stiffness = above / (self.stiffness * whole)  # of the logarithm, as the next
        by_rig = -(1j * omega / whole)[:, None] * rig.impedance_gradient(omega)[:, :-1]
        both = np.stack([by_stiffness.real, -by_stiffness.imag], axis=1)
        variance = np.einsum("qi,qij,qj->q", both, self.covariance[:, :2, :2], both)
        variance = variance + np.sum((by_rig.real * rig.uncertainties) ** 2, axis=1)
        size = np.abs(ratio)
        return size, size * np.sqrt(variance)


@dataclass(frozen=True, eq=False)
class OperatingMap(ByValue):
    """A model over its operating points.

    Attributes
    ----------
    model : Model
    axes : Axes
    terms : tuple of tuples of int
        Exponents of the scaled axes.
    coefficients : (P, K) float array
        Of each linked parameter; see `together.link`.
    covariance : (P K, P K) float array
    scatter : Scatter
    band : (float, float) [Hz]
        Where all conditions were measured.
    left_out : LeftOut
        Not-a-number where there are no more conditions than terms, so that none can be left out.
    static : ValueSurface or None
        K1 of the static tests, which no shape of K* over frequency may shift; without them K1 is the model's.
    """

    model: Model
    axes: Axes
    terms: Terms
    coefficients: FloatArray
    covariance: FloatArray
    scatter: Scatter
    band: tuple[float, float]
    left_out: LeftOut
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
        """Parameters (Q, P) of a basis (Q, K), and their slopes by the linked ones."""
        linked = basis @ self.coefficients.T
        both = [unlink(one, linked[:, at]) for at, one in enumerate(self.model.parameters)]
        return np.stack([one for one, _ in both], axis=1), np.stack([slope for _, slope in both], axis=1)

    def octaves_beyond(self, frequency: ArrayLike) -> FloatArray:
        """How far frequencies (Q,) [Hz] are outside the band; 0 inside."""
        asked, (low, high) = np.asarray(frequency, dtype=float), self.band
        far = np.maximum(np.maximum(np.log2(low / asked), np.log2(asked / high)), 0.0)
        return np.where(far < np.log2(1 + _EDGE), 0.0, far)

    def ask(self, points: ArrayLike, frequency: ArrayLike) -> Answer:
        """K* with K1, K2 and C and their covariance at points (Q, d) and frequencies (Q,) [Hz].

        Nothing is refused here: see `Axes.outside` and `band`.
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
        k2, c = maxwell_arm(stiffness, k1, omega)
        with np.errstate(divide="ignore", invalid="ignore"):
            by_arm = arm_slopes(stiffness, k1, (k2, c), omega, np.tile([1.0, 1j, -1.0], (k1.size, 1)))
        passive = (stiffness.real > k1) & (stiffness.imag > 0)
        by_arm = np.where(passive[:, None, None], by_arm, 0.0)  # no arm, no derivative
        arm = by_arm @ covariance @ np.swapaxes(by_arm, 1, 2)
        return Answer(
            stiffness=stiffness,
            k1=k1,
            covariance=covariance,
            k2=np.where(passive, k2, np.nan),
            c=np.where(passive, c, np.nan),
            arm_covariance=np.where(passive[:, None, None], arm, np.nan),
        )

    def _bent(self, points: ArrayLike, omega: FloatArray) -> FloatArray:
        """Covariance (Q, 2, 2) of K* for bends between two levels of an axis; see `surface.bends`."""
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
        """Covariance (Q, 3, 3) of what conditions and frequencies are off the surfaces."""
        turn = turning(stiffness)
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
    """Find the surfaces of a model's parameters over the axes.

    Parameters
    ----------
    model : Model
    conditions : sequence of B StiffnessData
        Of one condition each, with the covariance of each frequency by itself.
    axes : Axes
        Of the same conditions.
    start : (B, P) float array
        Parameters fitted to each condition.
    shared : sequence of B (2N, p) float arrays [N/m], optional
        What errors common to all conditions do; see `together.fit_together`.
    terms : sequence of Terms, optional
        Surfaces to choose from by the condition left out; by default `surface.term_sets`.

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
        error_ = _left_out(found, conditions).error
        if np.isfinite(error_) or len(one) >= len(conditions):
            tried.append((error_, one, found))
    if not tried:
        raise ModelError(f"no surface of the {model.name} model could be fitted: {reason}")
    least = min(error for error, _, _ in tried)
    simplest = next((each for each in tried if each[0] * _BETTER <= least), tried[0])
    return _calibrated(model, conditions, axes, simplest[2].values, shared, simplest[1], frequency)


def misfit_of(model: Model, conditions: Sequence[StiffnessData], values: ArrayLike) -> tuple[float, float]:
    """Misfit of a model over frequency, along and across K*: rms residual less noise, relative to abs(K*) [1], [1]."""
    sums, noise, spare = np.zeros(2), np.zeros(2), 0.0
    for data, own in zip(conditions, np.asarray(values, dtype=float), strict=True):
        left = data.stiffness / model.stiffness(own, data.omega) - 1
        turn = turning(np.conj(data.stiffness) / np.abs(data.stiffness) ** 2)
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
    laws = {one.symbol: basis for one in model.parameters}
    return fit_together(model, conditions, start, laws, shared=shared, scatter=scatter)


def _left_out(found: Together, conditions: Sequence[StiffnessData]) -> LeftOut:
    """Leave-one-out errors of the surfaces; not-a-number if the other conditions do not determine the one left out."""
    if not _judged(found):
        return LeftOut(float("nan"), float("nan"), float("nan"))
    errors, scores, middle = [], [], []
    for at, data in enumerate(conditions):
        off, spread = found.left_out(at)
        size = 2 * data.count
        back = np.linalg.inv(found.whiteners[at])
        off, spread = back @ off[:size], back @ spread[:size, :size] @ back.T
        errors.append(np.hypot(off[::2], off[1::2]) / np.abs(data.stiffness))
        score = np.abs(off) / np.sqrt(np.diag(spread))
        scores.append(score)
        centre = data.count // 2
        middle.append(float(score[2 * centre : 2 * centre + 2].max()))
    return LeftOut(
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
    """The map with the scatter of conditions that puts those left out where their intervals say."""
    basis = design(terms, axes.scaled(axes.points))
    low, high, size = _LEAST, _MOST, _SCATTER
    found = _fitted(model, conditions, start, basis, shared, Scatter(0.0, frequency))
    scatter = Scatter(0.0, frequency)
    if _judged(found) and _excess(found, conditions) > 1:
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
        left_out=_left_out(found, conditions),
        static=_static(conditions, axes),
    )


def _judged(found: Together) -> bool:
    """Whether there are more conditions than terms, so that one can be left out."""
    return len(found.values) > max(one.shape[1] for one in found.designs)


def _common_band(conditions: Sequence[StiffnessData]) -> tuple[float, float]:
    """Where all were measured [Hz]; ModelError where that is nowhere."""
    low = max(float(one.omega.min()) for one in conditions) / (2 * np.pi)
    high = min(float(one.omega.max()) for one in conditions) / (2 * np.pi)
    if low > high * (1 + 1e-9):
        raise ModelError(
            f"no frequency is common to all conditions: one begins at {low:.4g} Hz, another ends at {high:.4g} Hz; map "
            "those apart, or leave some out with --band"
        )
    return low, max(low, high)


def _static(conditions: Sequence[StiffnessData], axes: Axes) -> ValueSurface | None:
    """Surface of K1 over the axes; None unless K1 is known at every condition."""
    k1, std = (np.array([float(getattr(one, name)) for one in conditions]) for name in ("k1", "k1_std"))
    if not (np.all(np.isfinite(k1)) and np.all(np.isfinite(std)) and np.all(k1 > 0)):
        return None
    return value_surface(axes, k1, std)


def _excess(found: Together, conditions: Sequence[StiffnessData]) -> float:
    """Mean square of conditions left out over what was foretold of it, each condition's mean over frequency."""
    ratios = []
    for at, data in enumerate(conditions):
        off, spread = found.left_out(at)
        size = 2 * data.count
        back = np.linalg.inv(found.whiteners[at])
        relative = np.conj(data.stiffness) / np.abs(data.stiffness) ** 2 / data.count
        mean = np.zeros((2, size))
        mean[0, ::2], mean[0, 1::2] = relative.real, -relative.imag
        mean[1, ::2], mean[1, 1::2] = relative.imag, relative.real
        turn = mean @ back
        seen = turn @ off[:size]
        ratios.append(seen**2 / np.diag(turn @ spread[:size, :size] @ turn.T))
    return float(np.mean(ratios))
