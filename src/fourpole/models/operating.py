"""The operating map: a model whose parameters are smooth surfaces over pressure, preload and other axes.

One fit to all conditions gives the coefficients of the surfaces. The surface with the least leave-one-out error is
chosen. The scatter of conditions about it is adjusted until leave-one-out residuals agree with their uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core import stats
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import CHANCE
from fourpole.core.curvature import arm_covariance
from fourpole.core.rig import Rig
from fourpole.core.routes import maxwell_arm
from fourpole.core.specimen import Specimen
from fourpole.errors import ModelError
from fourpole.models.belted import MASSLESS
from fourpole.models.data import StiffnessData, multiplication
from fourpole.models.interface import Model
from fourpole.models.laws import Laws
from fourpole.models.linearised import Conditions, Scatter, Weights
from fourpole.models.restricted import scatter_of
from fourpole.models.surface import Axes, Terms, ValueSurface, bends, design, term_sets, value_surface
from fourpole.models.together import LeaveOneOut, Together, assembled, misfit_without_each, search

#: Relative scatter of conditions in the comparison of surfaces.
_SCATTER = 1e-2
#: Scatter of the first fit, and its number of terms, as a fraction of the number of conditions.
_FIRST_SCATTER, _FIRST = Scatter(_SCATTER, (_SCATTER, _SCATTER), _SCATTER), 1.0 / 3.0
#: Standard deviations of the weak prior of coefficients: of a level about the median of the starts, and of a change
#: over half the span of an axis, in units of the link, in which 1 is a factor of 2.7.
_LEVEL, _CHANGE = 10.0, 2.0
#: Starts are limited to this distance from their median, in units of the link.
_NEAR = 3.0
#: Largest number of terms; maximum number of fits with a scatter.
_MOST_TERMS, _ROUNDS = 64, 8
#: Variances of the scatter are final when they change by less than this fraction, or this standard deviation.
_CLOSE, _SMALL = 0.01, 1e-7
#: Chi-square that fits may leave: those about which surfaces are compared, and those of the map.
_ROUGHLY, _CLOSE_FIT = 0.1, 1e-6
#: A frequency is inside the band up to this fraction beyond its ends: drives that are stated as 10 Hz ran near it.
_EDGE = 1e-2
#: A larger surface is chosen only if its leave-one-out chi-square is less than that of a smaller one by this.
_BETTER = 2.0
#: A surface whose leave-one-out error exceeds the least one by more than this factor is not chosen.
_MOST_ERROR = 1.25
#: Surfaces with more than this multiple of the least chi-square are not compared again.
_FAR = 1.05


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

    def transmissibility(
        self, rig: Rig, frequency: ArrayLike, specimen: Specimen = MASSLESS
    ) -> tuple[FloatArray, FloatArray]:
        """TR (Q,) [1] on a rig at the frequencies of the points (Q,) [Hz], and its standard uncertainty.

        K* is that of the springs of `specimen`. The uncertainty includes that of the rig.
        """
        omega = 2 * np.pi * np.asarray(frequency, dtype=float)
        if rig.blocked:
            return np.zeros(omega.shape), np.zeros(omega.shape)
        ends = specimen.ends(self.stiffness, omega)
        above = 1j * omega * rig.impedance(omega) - omega**2 * ends.wheel
        whole = ends.spring + above
        ratio = ends.spring / whole
        # Derivatives of log TR by K* and by the values of the rig.
        by_stiffness = (ends.by[:, 0, 0] * above + omega**2 * ends.by[:, 0, 2]) / (self.stiffness * whole)
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
        Coefficients of each linked parameter; see `Model.link`.
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
        return self.model.unlink(basis @ self.coefficients.T)

    def errors(self, point: ArrayLike) -> FloatArray:
        """Changes (P, E) of the parameters at a point (d,) by one standard uncertainty of each of E independent errors.

        The errors are those of the coefficients, and of the curvature between two levels of an axis. They are the same
        errors at all points of the map. Their variance is that of the parameters, without scatter about the surfaces.
        """
        place = np.asarray(point, dtype=float).reshape(1, -1)
        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        columns = [self._parameters(place)[1][0] @ root]
        for share, *ends in bends(self.axes.scaled(place), self.axes.straight):
            low, high = (self._unlinked(design(self.terms, one))[0][0] for one in ends)
            columns.append((share[0] * (high - low))[:, None])
        return np.concatenate(columns, axis=1)

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
        Parameters of a fit to each condition, or to some: not-a-number for the others.
    shared : sequence of B (2N, p) float arrays [N/m], optional
        Effect of the errors that all conditions share; see `together.fit_together`.
    terms : sequence of Terms, optional
        Surfaces to choose from; by default `surface.term_sets`.

    Raises
    ------
    ModelError
        If no surface can be fitted.
    """
    band = _common_band(conditions)
    candidates = list(terms) if terms is not None else term_sets(axes.levels, len(conditions))
    spare = any(len(one) < len(conditions) for one in candidates)
    try:
        every = Conditions.of(model, conditions, shared, common=spare)
        most = min(_MOST_TERMS, every.known // len(model.parameters), len(conditions) - int(spare))
        kept = [one for one in candidates if len(one) <= most] or list(candidates[:1])
        scaled = axes.scaled(axes.points)
        linked, middle = _started(model, np.asarray(start, dtype=float), scaled)
        chosen, found = _Choice(every, {one: design(one, scaled) for one in kept}, linked, middle, spare).made()
    except (ModelError, np.linalg.LinAlgError) as error:
        raise ModelError(f"no surface of the {model.name} model could be fitted: {error}") from None
    return OperatingMap(
        model=model,
        axes=axes,
        terms=chosen,
        coefficients=np.stack(found.coefficients),
        covariance=found.covariance,
        scatter=found.scatter.summed,
        band=band,
        leave_one_out=LeaveOneOut.of(found) if len(chosen) < len(conditions) else LeaveOneOut(),
        static=_static(conditions, axes),
    )


@dataclass(frozen=True, eq=False)
class _Choice:
    """The search for the terms of a map and for the scatter of its conditions.

    Attributes
    ----------
    conditions : Conditions
    bases : dict of Terms to (B, K) float array
        Basis functions of each candidate.
    linked : (B, P) float array
        Linked parameters of a fit to each condition, none far from the median.
    middle : (P,) float array
        Their medians.
    spare : bool
        Whether there are more conditions than terms, so that they show their scatter. The uncertainty of K1 is then one
        error of all conditions.
    """

    conditions: Conditions
    bases: dict[Terms, FloatArray]
    linked: FloatArray
    middle: FloatArray
    spare: bool

    def made(self) -> tuple[Terms, Together]:
        """The terms with the least leave-one-out error, and their fit with the scatter that it shows.

        The candidates are compared about one fit, by linear algebra. The fit of the best is the next one about which
        they are compared, until the best stays.
        """
        axes = len(next(iter(self.bases))[0])
        most = min((axes + 1) * (axes + 2) / 2, self.conditions.count * _FIRST)
        few = [one for one in self.bases if len(one) <= most] or [next(iter(self.bases))]
        terms = max(few, key=len)
        found = self.fitted(terms, self.linked, _FIRST_SCATTER, None, close=_ROUGHLY)
        seen, left = {terms}, tuple(self.bases)
        while len(left) > 1:
            trial = self._scatter(found, roughly=True)
            best, left = self._best(left, found, trial)
            if best == terms:
                break
            terms, found = best, self.fitted(best, found.linked, trial, found.errors, close=_ROUGHLY)
            if best in seen:
                break
            seen.add(best)
        return terms, self._calibrated(terms, found)

    def _laws(self, terms: Terms) -> Laws:
        """The laws, which are the same for all parameters, with a weak prior of their coefficients."""
        basis, few = self.bases[terms], self.conditions
        constant = np.array([not any(one) for one in terms])
        expected = np.where(constant, self.middle[:, None], 0.0).ravel()
        precision = np.tile(np.where(constant, _LEVEL, _CHANGE) ** -2.0, len(self.middle))
        return Laws((basis,) * len(self.middle), few.shared, few.count, expected, precision)

    def fitted(
        self, terms: Terms, linked: FloatArray, scatter: Scatter, errors: FloatArray | None, close: float = _CLOSE_FIT
    ) -> Together:
        return search(self.conditions, self._laws(terms), linked, scatter, errors, close=close)

    def _scatter(self, found: Together, *, roughly: bool = False) -> Scatter:
        """The scatter that a fit shows."""
        if not found.dof:
            return Scatter()
        return scatter_of(found, (self.spare, True, True, self.spare, True, True), roughly=roughly)

    def _best(self, candidates: Sequence[Terms], found: Together, scatter: Scatter) -> tuple[Terms, tuple[Terms, ...]]:
        """The terms with hardly more than the least leave-one-out chi-square about a fit, and those not far from it."""
        weights = [Weights.of(one, scatter.variances) for one in found.rows]
        rows = [one.about_zero(found.linked) for one in found.rows]
        normal = assembled(rows, weights, found.laws, found.unknowns)
        misfits = {}
        for one in candidates:
            laws = self._laws(one)
            zero = np.append(np.zeros(laws.coefficients), found.errors)
            misfits[one] = misfit_without_each(rows, weights, replace(normal, laws=laws, unknowns=zero))
        error = min(each for _, each in misfits.values())
        good = {one: misfit for one, (misfit, each) in misfits.items() if each <= _MOST_ERROR * error}
        least = min(good.values())
        best = next(one for one, misfit in good.items() if misfit <= least + _BETTER)
        return best, tuple(one for one, (misfit, _) in misfits.items() if misfit <= _FAR * least)

    def _calibrated(self, terms: Terms, found: Together) -> Together:
        """The fit with the scatter that it shows.

        If the model does not fit, its error may be the same in all conditions. It must not pass for shared errors, so
        that it becomes an unknown beside these.
        """
        found = self.with_scatter(terms, found)
        moved = float(found.errors @ found.errors)
        surprising = bool(moved > stats.chi2.isf(CHANCE, max(found.errors.size, 1)))
        if not found.dof or not (surprising or any(found.scatter.frequency)):
            return found
        wider = replace(self, conditions=self.conditions.with_errors_of_model())
        last = found.errors.size - int(wider.conditions.common)
        errors = np.insert(found.errors, last, np.zeros(2 * wider.conditions.nodes.size))
        begin = replace(found.scatter, common=found.scatter.frequency)
        return wider.with_scatter(terms, wider.fitted(terms, found.linked, begin, errors))

    def with_scatter(self, terms: Terms, found: Together) -> Together:
        """The fit with the scatter that it shows."""
        for _ in range(_ROUNDS):
            before, scatter = found.scatter.variances, self._scatter(found)
            found = self.fitted(terms, found.linked, scatter, found.errors)
            if np.all(np.abs(scatter.variances - before) <= _CLOSE * before + _SMALL**2):
                break
        return found


def _started(model: Model, start: FloatArray, scaled: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Linked parameters (B, P) of all conditions from those of which a fit is known, and their medians (P,)."""
    known = np.flatnonzero(np.all(np.isfinite(start), axis=1))
    linked = model.link(start[known])
    middle = np.median(linked, axis=0)
    linked = np.clip(linked, middle - _NEAR, middle + _NEAR)
    if len(known) == len(start):
        return linked, middle
    basis = np.insert(scaled, 0, 1.0, axis=1)
    return basis @ np.linalg.lstsq(basis[known], linked, rcond=None)[0], middle


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
