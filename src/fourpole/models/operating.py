"""The operating map: a model whose parameters are smooth surfaces over pressure, preload and other axes.

One fit to all conditions gives the coefficients of the surfaces. Surfaces, their link and models are compared by the
leave-one-out log predictive density: that which K* of each condition, as measured, has under the map of the others.
The scatter of conditions about the surfaces is that of the restricted likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.curvature import arm_covariance
from fourpole.core.rig import Rig
from fourpole.core.routes import maxwell_arm
from fourpole.core.specimen import Specimen
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, multiplication
from fourpole.models.interface import Link, Model
from fourpole.models.laws import root_of
from fourpole.models.linearised import Conditions, Scatter
from fourpole.models.realised import MASSLESS
from fourpole.models.surface import Axes, Terms, ValueSurface, bends, design, term_sets, value_surface
from fourpole.models.surface_choice import MOST_TERMS, Plan, SurfaceChoice, place_of_simplest, started
from fourpole.models.together import LeaveOneOut, Together


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


#: What an interval is for: the mean surface, the next mounting of such a specimen, or the specimen as it was tested.
Purpose = Literal["mean", "next", "specimen"]
#: Links of stiffness and damping that are compared.
LINKS: tuple[Link, ...] = ("log", "identity")
#: A frequency is inside the band up to this fraction beyond its ends: drives that are stated as 10 Hz ran near it.
_EDGE = 1e-2


@dataclass(frozen=True, eq=False)
class Offsets(ByValue):
    """The errors of the tested conditions about the surfaces: those of the specimen as it was mounted there.

    Attributes
    ----------
    values : (B, 2) float array
        Errors of Re log K* and of Im log K*, expected by the data and the scatter of the conditions.
    covariance : (B, P + 2, P + 2) float array
        Covariance of the linked parameters and of the two errors of each condition.
    """

    values: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, eq=False)
class OperatingMap(ByValue):
    """A model whose parameters are functions of the operating point.

    Attributes
    ----------
    model : Model
        The model with its link.
    axes : Axes
    terms : tuple of tuples of int
        Exponents of the scaled axes, term by term.
    coefficients : (P, K) float array
        Coefficients of each linked parameter; see `Model.link`. Those of terms that a parameter does not have are zero.
    covariance : (P K, P K) float array
        Covariance of all coefficients, parameter by parameter.
    scatter : Scatter
        Scatter of conditions and of frequencies about the surfaces.
    band : (float, float) [Hz]
        Frequencies at which all conditions were measured.
    leave_one_out : LeaveOneOut
    static : ValueSurface or None
        K1 from the static tests, independent of K*; None if K1 is the model's stiffness at zero frequency.
    offsets : Offsets or None
        Errors of the tested conditions; None where they are not known, as of a map that an older version wrote.
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
    offsets: Offsets | None = None

    @property
    def link(self) -> Link:
        """Whether the surfaces are those of stiffness and damping themselves, or of their logarithm."""
        return "identity" if any(one.straight for one in self.model.parameters) else "log"

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
        columns = [self._parameters(place)[1][0] @ root_of(self.covariance)]
        for share, *ends in bends(self.axes.scaled(place), self.axes.straight):
            low, high = (self._unlinked(design(self.terms, one))[0][0] for one in ends)
            columns.append((share[0] * (high - low))[:, None])
        return np.concatenate(columns, axis=1)

    def spread(self, purpose: Purpose = "next") -> tuple[float, float]:
        """Relative standard deviations of K* about the surfaces, along and across K* [1].

        The misfit of the model at a frequency counts for each purpose, the scatter of conditions for the next one.
        """
        scattered = np.array(self.scatter.condition) * (purpose == "next")
        along, across = np.hypot(self.scatter.frequency, scattered).tolist()
        return along, across

    def octaves_beyond(self, frequency: ArrayLike) -> FloatArray:
        """Distance (Q,) of frequencies (Q,) [Hz] from the band, in octaves; 0 inside."""
        each, (low, high) = np.asarray(frequency, dtype=float), self.band
        far = np.maximum(np.maximum(np.log2(low / each), np.log2(each / high)), 0.0)
        return np.where(far < np.log2(1 + _EDGE), 0.0, far)

    def ask(self, points: ArrayLike, frequency: ArrayLike, purpose: Purpose = "next") -> Answer:
        """K*, K1, K2 and C with their covariance at points (Q, d) of the axes and frequencies (Q,) [Hz].

        The covariance is that of the surface itself for the purpose `mean`, of K* of a new mounting of such a specimen
        for `next`, and of the specimen as it was tested for `specimen`, at the tested conditions only. Points outside
        the tested conditions are evaluated as well; see `Axes.outside` and `octaves_beyond`.
        """
        omega = 2 * np.pi * np.asarray(frequency, dtype=float)
        if purpose == "specimen":
            values, by_all, own, errors = self._tested(points)
        else:
            values, by_all = self._parameters(points)
            own, errors = self.covariance, np.zeros(len(values), dtype=complex)
        factor = np.exp(errors)
        stiffness = self.model.stiffness(values, omega[:, None])[:, 0] * factor
        by_value = self.model.derivative(values, omega[:, None])[:, 0] * factor[:, None]
        k1 = self.model.static_stiffness(values)
        rows = np.stack([by_value.real, by_value.imag, self.model.static_derivative(values)], axis=1) @ by_all
        if purpose == "specimen":
            rows[:, :2, -2:] = multiplication(stiffness)
        covariance = rows @ own @ np.swapaxes(rows, 1, 2) + self._scattered(stiffness, k1, purpose)
        covariance[:, :2, :2] += self._bent(points, omega)
        if self.static is not None:
            scaled = self.axes.scaled(points)
            k1, std = self.static.at(scaled, self.axes.straight, scattered=purpose != "mean")
            covariance[:, 2, :] = covariance[:, :, 2] = 0.0
            covariance[:, 2, 2] = std**2
        return Answer.of(stiffness, k1, covariance, omega)

    def _tested(self, points: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray, ComplexArray]:
        """Parameters (Q, P) at tested conditions, their derivatives by P linked parameters and 2 errors, the covariance
        of these (Q, P + 2, P + 2), and the errors of log K* (Q,).
        """
        if self.offsets is None:
            raise ModelError(
                "the map has no errors of the tested conditions: make it again, or ask for the mean surface"
            )
        found = [self.axes.tested(one) for one in np.atleast_2d(np.asarray(points, dtype=float))]
        places = [one for one in found if one is not None]
        if len(places) < len(found):
            raise ModelError(
                "the specimen is known at its tested conditions only: state one, or ask for the next mounting"
            )
        values, slopes = self._unlinked(design(self.terms, self.axes.scaled(points)))
        size, (real, imag) = values.shape[1], self.offsets.values[places].T
        by = np.zeros((len(values), size, size + 2))
        by[:, range(size), range(size)] = slopes
        return values, by, self.offsets.covariance[places], real + 1j * imag

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

    def _scattered(self, stiffness: ComplexArray, k1: FloatArray, purpose: Purpose) -> FloatArray:
        """Covariance (Q, 3, 3) of Re K*, Im K* and K1 for the scatter about the surfaces."""
        turn, spread = multiplication(stiffness), self.spread(purpose)
        whole = np.zeros((stiffness.size, 3, 3))
        whole[:, :2, :2] = (turn * np.square(spread)) @ np.swapaxes(turn, 1, 2)
        whole[:, 2, 2] = (self.scatter.condition[0] * k1) ** 2 * (purpose != "mean")
        return whole


def make_map(
    model: Model,
    conditions: Sequence[StiffnessData],
    axes: Axes,
    start: ArrayLike,
    shared: Sequence[FloatArray] | None = None,
    terms: Sequence[Terms] | None = None,
    links: Sequence[Link] = LINKS,
) -> OperatingMap:
    """Make the operating map of a model: choose the surface and its link, and fit the coefficients.

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
    links : sequence of Link, optional
        Links to choose from; the first one where there are too few conditions for a choice.

    Raises
    ------
    ModelError
        If no surface can be fitted.
    """
    band = _common_band(conditions)
    candidates = list(terms) if terms is not None else term_sets(axes.levels, len(conditions))
    spare = any(len(one) < len(conditions) for one in candidates)
    scaled, made, why = axes.scaled(axes.points), [], ""
    for link in links if spare else links[:1]:
        linked_model = model.with_link(link)
        try:
            every = Conditions.of(linked_model, conditions, shared, common=spare)
            most = min(MOST_TERMS, every.known // len(model.parameters), len(conditions) - int(spare))
            kept = [one for one in candidates if len(one) <= most] or list(candidates[:1])
            bases = {one: design(one, scaled) for one in kept}
            begin = started(linked_model, np.asarray(start, dtype=float), scaled)
            made.append((link, SurfaceChoice(every, bases, *begin, spare).made()))
        except (ModelError, np.linalg.LinAlgError) as error:
            why = why or str(error)
    inside = [one for one in made if not one[1].on_floor]  # where a parameter stays at its floor, data do not hold it
    made = inside or made
    try:
        link, best = made[
            place_of_simplest([one.density for _, one in made], [len(sum(one.plan, ())) for _, one in made])
        ]
        found = best.choice.calibrated(best.plan, best.found)
    except (ValueError, ModelError, np.linalg.LinAlgError) as error:
        raise ModelError(f"no surface of the {model.name} model could be fitted: {why or error}") from None
    return _map_of(best.plan, found, axes, band, _static(conditions, axes, link))


def simplest(maps: Sequence[OperatingMap]) -> OperatingMap:
    """The map with the fewest coefficients of those with hardly less than the greatest log predictive density."""
    sizes = [int(np.count_nonzero(np.diag(one.covariance))) for one in maps]
    return maps[place_of_simplest([one.leave_one_out.density for one in maps], sizes)]


def _map_of(
    plan: Plan, found: Together, axes: Axes, band: tuple[float, float], static: ValueSurface | None
) -> OperatingMap:
    """The map of a fit; terms that a parameter does not have get coefficients of zero without uncertainty."""
    terms = tuple(dict.fromkeys(one for own in plan for one in own))
    terms = tuple(sorted(terms, key=lambda one: (sum(one), one[::-1])))
    used = [at * len(terms) + terms.index(one) for at, own in enumerate(plan) for one in own]
    size = len(plan) * len(terms)
    coefficients, covariance = np.zeros(size), np.zeros((size, size))
    coefficients[used] = np.concatenate(found.coefficients)
    covariance[np.ix_(used, used)] = found.covariance
    return OperatingMap(
        model=found.model,
        axes=axes,
        terms=terms,
        coefficients=coefficients.reshape(len(plan), -1),
        covariance=covariance,
        scatter=found.scatter.summed,
        band=band,
        leave_one_out=LeaveOneOut.of(found) if len(terms) < len(axes.points) else LeaveOneOut(),
        static=static,
        offsets=Offsets(*found.offsets()),
    )


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


def _static(conditions: Sequence[StiffnessData], axes: Axes, link: Link) -> ValueSurface | None:
    """K1 over the axes, from the static tests; None unless every condition has a K1."""
    k1, std = (np.array([float(getattr(one, name)) for one in conditions]) for name in ("k1", "k1_std"))
    if not (np.all(np.isfinite(k1)) and np.all(np.isfinite(std)) and np.all(k1 > 0)):
        return None
    return value_surface(axes, k1, std, link)
