r"""Identification of many tests at once: phasors, rig and K1 become K*, K2, C and TR with their covariances.

Every derivative here is analytic. A complex value carries its derivatives by all *real* inputs: Re and Im of the three
phasors, the rig's values, the added mass, K1 and the angular frequency. Covariances follow from them. The formulas
themselves are in `fourpole.core.routes`. K2 and C have the second-order part of `fourpole.core.curvature`, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray, parts
from fourpole.core.channelerrors import ChannelUncertainty, error_covariance
from fourpole.core.curvature import Curvature
from fourpole.core.phasor import Phasors
from fourpole.core.polar import loss_factor_of, modulus, ratio
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.routes import (
    ROUTES,
    arm_slopes,
    maxwell_arm,
    mobility_route,
    relative_route,
    transmissibility_route,
    why_no_arm,
)
from fourpole.core.sources import Kind, Source
from fourpole.core.specimen import Body, Inertia
from fourpole.core.unstated import NOTHING, Unstated, moved_by
from fourpole.errors import RigError

#: The outputs whose uncertainty is split into its sources, with their units, in the order of every budget.
OUTPUTS = {"Re K*": "N/m", "Im K*": "N/m", "loss factor": "1", "K2": "N/m", "C": "N s/m", "TR": "1"}


#: Places of the inputs after Re and Im of F1, V1, V2 and the rig's values.
_ADDED_AT = 6 + len(PARAMETERS)
_K1_AT = _ADDED_AT + 1
_OMEGA_AT = _K1_AT + 1
_BODY_AT = _OMEGA_AT + 1  # the mass of the specimen, and the logarithm of the share of its springs
_UNSTATED_AT = _BODY_AT + 2  # what the support adds to Re and Im of Zr, and the dry friction of the guide
#: Places of the dry friction, and of the masses that move with the contact and with the far side of a specimen.
FRICTION_AT: Final = _UNSTATED_AT + 2
MASSES: Final = slice(FRICTION_AT + 1, FRICTION_AT + 3)
_INPUTS = MASSES.stop
_ITS = "the specimen"
_INPUT_MASS_AT, _FRAME_AT = (6 + list(PARAMETERS).index(name) for name in ("input_mass", "frame_stiffness"))


class RigSolution(Protocol):
    """Result of the joint route besides K*; `fourpole.core.joint.Joint` has it with residuals and misfit."""

    @property
    def found(self) -> FloatArray:
        """Values of the rig, gains of the channels and added masses as found, each in its unit."""

    @property
    def found_std(self) -> FloatArray:
        """Standard uncertainties of `found`."""

    @property
    def converged(self) -> bool:
        """Whether the search for the most probable values converged."""


@dataclass(frozen=True, eq=False)
class Identification(ByValue):
    """Values and uncertainties of the tyre from the phasors of N tests.

    Every array has N rows, with not-a-number for a value that does not exist.

    Attributes
    ----------
    frequency : (N,) float array [Hz]
        Excitation frequency.
    mobility, mobility_covariance : (N,) complex [m/(N s)], (N, 2, 2) float
        V1/F1 = R + jI as measured, and the covariance of (R, I).
    stiffness, stiffness_covariance : (N,) complex [N/m], (N, 2, 2) float
        K* by the route, and the covariance of its (Re, Im).
    loss_factor, loss_factor_std : (N,) float [1]
        K''/K', and its standard uncertainty.
    k1, k1_std : (N,) float [N/m]
        Static stiffness used, and its standard uncertainty.
    k2, c : (N,) float [N/m], [N s/m]
        Spring and damper of the arm. Not-a-number if no passive values exist or K1 is unknown; `reasons` says why.
    arm_covariance : (N, 2, 2) float
        Covariance of (K2, C) to second order; see `fourpole.core.curvature`.
    tr_measured, tr_predicted, tr_std : (N,) float [1]
        abs(V2/V1) as measured; abs(V2/V1) from K* and the rig; standard uncertainty of the latter. Without a rig it is
        the uncertainty of the measured value.
    reasons : tuple of N str
        Reason why K2 and C are blank, with the likely cause; empty if they are not.
    route : str
        Name of the route.
    stiffness_shared : (N, 2, p) float [N/m]
        S, the change of (Re, Im) of K* per standard uncertainty of each of p errors that all tests share. The
        covariance of two tests of different conditions is S_i S_j^T. The rest of `stiffness_covariance` belongs to
        each condition alone, and to the test.
    condition : (N,) int
        Tests with the same number have one condition, and share the part of the uncertainty that is its own.
    condition_covariance : (N, 2, 2) float [N²/m²]
        Covariance of (Re, Im) of the mean K* of the test's condition, without the shared errors. It is the rest of
        `stiffness_covariance` if K* does not scatter from test to test.
    joint : RigSolution, optional
        Result of the joint route besides K*; None for the other routes.

    Examples
    --------
    >>> from fourpole import Phasors, Rig, identify
    >>> phasors = Phasors.from_polar(10.0, 1.0, abs(6.2114469e-5 - 1.0320808256e-3j), 1.5106868)
    >>> found = identify(phasors, Rig(moving_mass=15.0, preload_stiffness=12440.0))
    >>> found.stiffness.round(-2).tolist(), found.reasons
    ([(194200+38800j)], ('no static stiffness K1 is known, so K2 and C are left blank',))
    """

    frequency: FloatArray
    mobility: ComplexArray
    mobility_covariance: FloatArray
    stiffness: ComplexArray
    stiffness_covariance: FloatArray
    loss_factor: FloatArray
    loss_factor_std: FloatArray
    k1: FloatArray
    k1_std: FloatArray
    k2: FloatArray
    c: FloatArray
    arm_covariance: FloatArray
    tr_measured: FloatArray
    tr_predicted: FloatArray
    tr_std: FloatArray
    reasons: tuple[str, ...]
    route: str
    stiffness_shared: FloatArray
    condition: np.ndarray
    condition_covariance: FloatArray
    joint: RigSolution | None = None


def identify(
    phasors: Phasors,
    rig: Rig | None,
    k1: ArrayLike = np.nan,
    *,
    k1_std: ArrayLike = 0.0,
    route: str = "mobility",
    added_mass: ArrayLike = 0.0,
    added_mass_std: ArrayLike = 0.0,
    channels: ChannelUncertainty | None = None,
    mounting: Sequence[str] | None = None,
    bodies: Sequence[Body] | None = None,
    unstated: Unstated = NOTHING,
) -> Identification:
    r"""Identify K*, K2, C and TR of each test, with uncertainties to first order; those of K2 and C to second order.

    Parameters
    ----------
    phasors : Phasors
        One test or N.
    rig : Rig or None
        The rig. None is allowed only for the relative route, which then predicts no TR.
    k1, k1_std : (N,) float arrays [N/m]
        Static stiffness and its standard uncertainty. Not-a-number if unknown; K* does not need it.
    route : {"mobility", "relative", "transmissibility"}
        Formula for K*; see `fourpole.core.routes`.
    added_mass, added_mass_std : (N,) float arrays [kg]
        Mass fixed to the moving mass in each test, and its standard uncertainty.
    channels : ChannelUncertainty, optional
        Uncertainties of the channels; without it the channels count as exact.
    mounting : sequence of N str, optional
        Name of the mounting of V1's sensor in each test; without it all tests have one.

    bodies : sequence of N Body, optional
        What is known of the inertia of each specimen; without it the specimens count as massless. It counts where the
        rig is blocked; see `fourpole.core.specimen.Inertia.springs`.
    unstated : Unstated
        Standard uncertainties of the parts that nobody stated; by default there are none.

    Returns
    -------
    Identification
        One row per test.

    Raises
    ------
    ValueError
        If the route is unknown.
    RigError
        If the route needs a rig that is not given, or a motion that a blocked rig does not have.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (11)-(14). JCGM 102:2011, 6.2 and 6.4
    (propagation for several outputs and for complex quantities).

    Examples
    --------
    >>> phasors = Phasors.from_polar(10.0, 1.0, abs(6.2114469e-5 - 1.0320808256e-3j), 1.5106868)
    >>> found = identify(phasors, Rig(moving_mass=15.0, preload_stiffness=12440.0), k1=180e3)
    >>> found.k2.round(-2).tolist(), found.c.round(0).tolist()
    ([120000.0], [700.0])
    """
    answers = Answers(phasors, rig, k1, k1_std, route, added_mass, added_mass_std, channels, mounting, bodies, unstated)
    covariance = answers.covariance
    reasons = tuple(why_no_arm(*row) for row in zip(answers.stiffness, answers.k1, answers.k2, answers.c, strict=True))
    passive = np.array([not reason for reason in reasons], dtype=bool)
    with np.errstate(invalid="ignore"):
        bending = propagate(answers.jacobian[:, 6:], covariance)[:, 0, 0]
        arm_covariance = propagate(answers.jacobian[:, 3:5], covariance) + answers.curvature.covariance(bending)
        stiffness_covariance, shared = propagate(answers.jacobian[:, :2], covariance), _shared(answers)
        return Identification(
            frequency=np.asarray(phasors.frequency).reshape(passive.size),
            mobility=answers.mobility,
            mobility_covariance=propagate(answers.by_mobility, covariance),
            stiffness=answers.stiffness,
            stiffness_covariance=stiffness_covariance,
            loss_factor=answers.loss_factor,
            loss_factor_std=_std(answers.jacobian[:, 2], covariance),
            k1=answers.k1,
            k1_std=answers.k1_std,
            k2=np.where(passive, answers.k2, np.nan),
            c=np.where(passive, answers.c, np.nan),
            arm_covariance=np.where(passive[:, None, None], arm_covariance, np.nan),
            tr_measured=answers.tr_measured,
            tr_predicted=answers.tr_predicted,
            tr_std=_std(answers.jacobian[:, 5], covariance),
            reasons=reasons,
            route=route,
            stiffness_shared=shared,
            condition=np.arange(passive.size),
            condition_covariance=stiffness_covariance - shared @ np.swapaxes(shared, 1, 2),
        )


def _shared(answers: Answers) -> FloatArray:
    """Change of Re and Im of K* per standard uncertainty of each error that tests share, (N, 2, p) [N/m].

    The errors are those of the channels and of their mountings, of friction, of the rig's values, and of the masses.
    """
    by = answers.jacobian[:, :2]
    columns = []
    for error in answers.errors:
        along = parts(answers.amplitudes[:, error.channel] * error.turn * error.std)
        first = 2 * error.channel
        columns.append(np.einsum("nki,ni->nk", by[:, :, first : first + 2], along))
    places = (FRICTION_AT, *range(6, _K1_AT))  # the friction, the rig's values, the added mass
    own = [by[:, :, index] * np.sqrt(answers.covariance[:, None, index, index]) for index in places]
    columns += own[:-1]
    masses = np.unique(answers.added[answers.added != 0])
    columns += [np.where((answers.added == mass)[:, None], own[-1], 0.0) for mass in masses]
    of_body = answers.covariance[:, MASSES, MASSES]
    squares, vectors = np.linalg.eigh(of_body)
    moved = by[:, :, MASSES] @ (vectors * np.sqrt(np.maximum(squares, 0.0))[:, None])
    _, number = np.unique(of_body.reshape(-1, 4), axis=0, return_inverse=True)
    for each in np.unique(number) if of_body.any() else ():
        columns += list(np.moveaxis(np.where((number.ravel() == each)[:, None, None], moved, 0.0), 2, 0))
    return np.nan_to_num(np.stack(columns, axis=2))


def variance_by_source(
    phasors: Phasors, rig: Rig | None, k1: ArrayLike = np.nan, **stated: Any
) -> dict[Source, FloatArray]:
    """Variance of each of `OUTPUTS` by its source, for the same arguments as `identify`.

    Returns
    -------
    dict of Source to (N, 6) float array
        Sensor noise, frequency, each error of each channel, each of the rig's values, added mass, K1. Their sum is the
        square of the uncertainty that `identify` gives, because the inputs are independent. The second-order part of
        K2 and C is distributed in proportion; see `fourpole.core.curvature.Curvature`.
    """
    answers = Answers(phasors, rig, k1, **stated)
    count = answers.k1.size

    def alone(block: FloatArray, place: slice) -> FloatArray:
        covariance = np.zeros((count, _INPUTS, _INPUTS))
        covariance[:, place, place] = block
        return np.diagonal(propagate(answers.jacobian, covariance), 0, 1, 2)

    phasor = slice(0, 6)
    sources = {Source(Kind.NOISE): alone(phasors.covariance.reshape(count, 6, 6), phasor)}
    for error in answers.errors:
        part = alone(error_covariance(error, answers.amplitudes), phasor)
        sources[error.source] = sources.get(error.source, 0.0) + part
    values = [Source(Kind.RIG_VALUE, name) for name in PARAMETERS]
    values += [Source(Kind.ADDED_MASS), Source(Kind.K1), Source(Kind.FREQUENCY)]
    values += [Source(Kind.BELT_MASS, _ITS), Source(Kind.BELT_SHARE, _ITS)]
    values += [Source(Kind.UNSTATED, part) for part in ("frame", "frame", "friction")]
    for i, source in enumerate(values, start=6):
        part = alone(answers.covariance[:, i : i + 1, i : i + 1], slice(i, i + 1))
        sources[source] = sources.get(source, 0.0) + part
    sources[Source(Kind.BELT_MASS, _ITS)] += alone(answers.covariance[:, MASSES, MASSES], MASSES)
    return answers.curvature.distributed(sources)


def _check_route(route: str, rig: Rig | None) -> None:
    """Raise an error if there is no such route, or if the rig does not allow it."""
    if route not in ROUTES:
        raise ValueError(f"no route {route!r}: choose one of {', '.join(ROUTES)}")
    if rig is None and route != "relative":
        raise RigError(f"the {route} route needs the rig: state it, or use the relative route")
    if rig is not None and rig.blocked and route == "transmissibility":
        raise RigError("a blocked rig has no motion beyond the specimen: use the mobility route")


class Answers:
    """Values of N tests for the arguments of `identify`, with their derivatives by every real input.

    `jacobian` (N, 7, inputs) is in the order of `OUTPUTS`, followed by the error w of `curvature`; `covariance`
    (N, inputs, inputs) is that of the inputs.
    """

    def __init__(
        self,
        phasors: Phasors,
        rig: Rig | None,
        k1: ArrayLike = np.nan,
        k1_std: ArrayLike = 0.0,
        route: str = "mobility",
        added_mass: ArrayLike = 0.0,
        added_mass_std: ArrayLike = 0.0,
        channels: ChannelUncertainty | None = None,
        mounting: Sequence[str] | None = None,
        bodies: Sequence[Body] | None = None,
        unstated: Unstated = NOTHING,
    ) -> None:
        _check_route(route, rig)
        self._bodies, self._body_std = bodies, np.zeros((np.size(phasors.frequency), 2))
        count = np.size(phasors.frequency)
        self.rig = rig
        self.omega, self.amplitudes = phasors.omega.reshape(count), phasors.amplitudes.reshape(count, 3)
        self.k1, self.k1_std, self.added, added_std = (
            np.broadcast_to(np.asarray(x, dtype=float), count) for x in (k1, k1_std, added_mass, added_mass_std)
        )
        labels = [np.zeros(count, dtype=str) if mounting is None else np.asarray(mounting, dtype=str), self.added]
        groups = [np.unique(label, return_inverse=True)[1].ravel() for label in labels]
        self.errors = (channels or ChannelUncertainty()).errors(self.omega, groups)
        with np.errstate(divide="ignore", invalid="ignore"):
            self._identify(route)
        self.covariance = np.zeros((count, _INPUTS, _INPUTS))
        of_channels = sum(error_covariance(error, self.amplitudes) for error in self.errors)
        self.covariance[:, :6, :6] = phasors.covariance.reshape(count, 6, 6) + of_channels
        of_rig = np.tile(rig.uncertainties if rig is not None else np.zeros(len(PARAMETERS)), (count, 1))
        if self._on_frame:
            of_rig[:, _FRAME_AT - 6] = unstated.frame_std
        omega_std = 2 * np.pi * np.asarray(phasors.frequency_std).reshape(count)
        own = (of_rig, added_std, np.nan_to_num(self.k1_std), omega_std, self._body_std, unstated.std(rig, self.omega))
        self.covariance[:, range(6, MASSES.start), range(6, MASSES.start)] = np.column_stack(own) ** 2
        self.covariance[:, MASSES, MASSES] = 0.0 if rig is None or rig.blocked else unstated.masses

    @property
    def _on_frame(self) -> bool:
        """Whether the far side stands on a frame that counts as rigid."""
        return self.rig is not None and self.rig.blocked and np.isinf(self.rig.frame_stiffness)

    def _identify(self, route: str) -> None:
        """Set all values and derivatives."""
        jw = 1j * self.omega
        self.cell_force, self.v1, self.v2 = self.amplitudes.T
        self.by_cell_force, self.by_v1, self.by_v2 = (self._phasor(i) for i in range(3))
        input_mass = self.rig.input_mass if self.rig is not None else 0.0
        self.f1 = self.cell_force - jw * input_mass * self.v1
        self.by_f1 = self.by_cell_force - (jw * input_mass)[:, None] * self.by_v1
        self.by_f1[:, _INPUT_MASS_AT] -= jw * self.v1
        self.by_f1[:, _OMEGA_AT] -= 1j * input_mass * self.v1
        self.by_f1[:, MASSES.start] -= jw * self.v1

        self.mobility, by_mobility = ratio(self.v1, self.by_v1, self.cell_force, self.by_cell_force)
        self.by_mobility = parts(by_mobility, axis=-2)
        self.stiffness, by_stiffness = self._stiffness(route)
        if self._on_frame:  # by its compliance, which is zero
            by_stiffness[:, _FRAME_AT] += self.stiffness**2
        by_stiffness[:, _OMEGA_AT] += self.stiffness / self.omega  # the factor jw of every route's formula
        if self._bodies is not None and self.rig is not None and self.rig.blocked:
            by_stiffness = self._without_inertia(self._bodies, by_stiffness, at_ground=self.rig.at_ground)
        self.loss_factor, by_loss = loss_factor_of(self.stiffness, by_stiffness)
        by_difference = by_stiffness.copy()
        by_difference[:, _K1_AT] -= 1.0
        self.k2, self.c = maxwell_arm(self.stiffness, self.k1, self.omega)
        by_arm = arm_slopes(self.stiffness, self.k1, (self.k2, self.c), self.omega, by_difference)
        by_arm[:, 1, _OMEGA_AT] -= self.c / self.omega
        self.curvature = Curvature.of(self.stiffness, self.k1, self.omega)
        bending = self.curvature.by(by_difference)
        self.tr_measured, self.tr_predicted, by_tr = self._transmissibility(by_stiffness)
        rows = [parts(by_stiffness, axis=-2), by_loss[:, None], by_arm, by_tr[:, None], bending[:, None]]
        self.jacobian = np.concatenate(rows, axis=1)

    def _without_inertia(self, bodies: Sequence[Body], by_stiffness: ComplexArray, *, at_ground: bool) -> ComplexArray:
        """Make K* that of the springs, and give its derivatives."""
        inertia = Inertia.of(bodies, self.stiffness.real)
        self._body_std = np.stack([inertia.mass_std, inertia.shape_std], axis=1)
        self.stiffness, by = inertia.springs(self.stiffness, self.omega, at_ground=at_ground)
        by_stiffness = by_stiffness * by[:, :1]
        by_stiffness[:, _BODY_AT : _BODY_AT + 2] += by[:, 1:]
        by_stiffness[:, _OMEGA_AT] += 2 * inertia.mass / self.omega * by[:, 1]  # mass and frequency act as m w^2
        return by_stiffness

    def _phasor(self, index: int) -> ComplexArray:
        """Derivatives of the amplitude of F1, V1 or V2, by its index."""
        by = np.zeros((self.omega.size, _INPUTS), dtype=complex)
        by[:, 2 * index], by[:, 2 * index + 1] = 1.0, 1j
        return by

    def _rig(self) -> tuple[ComplexArray, ComplexArray]:
        """Mobility of the rig, 1/Zr [m/(N s)], and its derivatives."""
        assert self.rig is not None
        mobility = np.asarray(self.rig.mobility(self.omega, self.added))
        by = np.zeros((self.omega.size, _INPUTS), dtype=complex)
        gradient = self.rig.impedance_gradient(self.omega, self.added)
        by[:, 6:_K1_AT] = -(mobility**2)[:, None] * gradient
        by[:, _OMEGA_AT] = -(mobility**2) * self.rig.impedance_slope(self.omega, self.added)
        if not self.rig.blocked:
            columns = moved_by(self.omega, np.where(np.isfinite(self.v2), self.v2, self.f1 * mobility))
            by[:, [*range(_UNSTATED_AT, MASSES.start), MASSES.stop - 1]] = -(mobility**2)[:, None] * columns
        return mobility, by

    def balance(self) -> tuple[ComplexArray, FloatArray]:
        """F1 over the force Zr V2 that the rig needs (N,) [1], and derivatives (N, 2, inputs) of its Re and Im.

        Those by V2 and Zr are of a ratio of 1, as what is unstated adds to Zr V2.
        """
        mobility, by = self._rig()
        by = self.by_f1 * (mobility / self.v2)[:, None] - self.by_v2 / self.v2[:, None] + by / mobility[:, None]
        return self.f1 * mobility / self.v2, parts(by, axis=-2)

    def _stiffness(self, route: str) -> tuple[ComplexArray, ComplexArray]:
        """K* by a route [N/m], and its derivatives with the factor jw of the formula held constant."""
        jw = 1j * self.omega
        if route == "relative":
            value = relative_route(self.f1, self.v1, self.v2, self.omega)
            across, by_across = self.v1 - self.v2, self.by_v1 - self.by_v2
            return value, value[:, None] * (self.by_f1 / self.f1[:, None] - by_across / across[:, None])
        rig, by_rig = self._rig()
        if route == "mobility":
            mobility, by = ratio(self.v1, self.by_v1, self.f1, self.by_f1)
            value = mobility_route(mobility, rig, self.omega)
            return value, -(value**2 / jw)[:, None] * (by - by_rig)
        t, by_t = ratio(self.v2, self.by_v2, self.v1, self.by_v1)
        value = transmissibility_route(t, 1.0 / rig, self.omega)
        return value, value[:, None] * (by_t / (t * (1 - t))[:, None] - by_rig / rig[:, None])

    def _transmissibility(self, by_stiffness: ComplexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """abs(V2/V1) as measured, and as predicted by K* and the rig; derivatives of the prediction.

        Without a rig that moves, the prediction is not-a-number and the derivatives are those of the measured value.
        """
        measured, by_measured = ratio(self.v2, self.by_v2, self.v1, self.by_v1)
        if self.rig is None or self.rig.blocked:
            nothing = np.full(self.omega.size, np.nan)
            return np.abs(measured), nothing, modulus(measured, by_measured)
        rig, by_rig = self._rig()
        jw = 1j * self.omega
        joined = self.stiffness * rig
        by_joined = by_stiffness * rig[:, None] + self.stiffness[:, None] * by_rig
        predicted = joined / (joined + jw)
        by_predicted = (jw / (joined + jw) ** 2)[:, None] * by_joined
        by_predicted[:, _OMEGA_AT] -= 1j * joined / (joined + jw) ** 2
        return np.abs(measured), np.abs(predicted), modulus(predicted, by_predicted)


def propagate(jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    """J S J^T for J (N, outputs, inputs); an input without influence is ignored, even if it is not-a-number."""
    with np.errstate(invalid="ignore"):
        weighted = np.where(jacobian == 0, 0.0, jacobian)
        known = np.where(np.any(jacobian != 0, axis=1)[:, :, None], covariance, 0.0)
        known = np.where(np.any(jacobian != 0, axis=1)[:, None, :], known, 0.0)
        return weighted @ known @ np.swapaxes(weighted, -1, -2)


def _std(jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    """Standard uncertainty (N,) of an output with derivatives (N, inputs)."""
    return np.sqrt(np.maximum(propagate(jacobian[:, None, :], covariance)[:, 0, 0], 0.0))
