r"""Identification of many tests at once: phasors, rig and K1 become K*, K2, C and TR with their covariances.

Every derivative here is analytic: a complex output of complex inputs carries its derivatives by all *real* inputs
(Re and Im of the three phasors, the rig's values, the added mass, K1), and covariances follow from them. The formulas
themselves stand in `fourpole.core.routes`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.channelerrors import ChannelUncertainty, error_covariance, parts
from fourpole.core.identification import Identification
from fourpole.core.phasor import Phasors
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
from fourpole.errors import RigError

__all__ = ["OUTPUTS", "identify", "variance_by_source"]

#: What uncertainty is accounted for, with units, in the order of every budget.
OUTPUTS = {"Re K*": "N/m", "Im K*": "N/m", "loss factor": "1", "K2": "N/m", "C": "N s/m", "TR": "1"}


_RIG_AT = slice(6, 6 + len(PARAMETERS))
_ADDED_AT = _RIG_AT.stop
_K1_AT = _ADDED_AT + 1
_OMEGA_AT = _K1_AT + 1
_INPUTS = _OMEGA_AT + 1
_INPUT_MASS_AT = 6 + list(PARAMETERS).index("input_mass")


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
) -> Identification:
    r"""Identify K*, K2, C and TR of each test, with uncertainties by linear propagation.

    Parameters
    ----------
    phasors : Phasors
        One test or N.
    rig : Rig or None
        The rig; None only for the relative route, which then predicts no TR.
    k1, k1_std : (N,) float arrays [N/m]
        Static stiffness and its standard uncertainty; not-a-number where unknown: K* is found all the same.
    route : {"mobility", "relative", "transmissibility"}
        How K* is found; see `fourpole.core.routes`.
    added_mass, added_mass_std : (N,) float arrays [kg]
        Mass fixed to the moving mass in each test.
    channels : ChannelUncertainty, optional
        Unknown parts of the channels' gains; without it they count as exact.

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
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (11)-(14); JCGM 102:2011 for the propagation.

    Examples
    --------
    >>> phasors = Phasors.from_polar(10.0, 1.0, abs(6.2114469e-5 - 1.0320808256e-3j), 1.5106868)
    >>> found = identify(phasors, Rig(moving_mass=15.0, preload_stiffness=12440.0), k1=180e3)
    >>> found.k2.round(-2), found.c.round(0)
    (array([120000.]), array([700.]))
    """
    answers = _answers(phasors, rig, k1, k1_std, route, added_mass, added_mass_std, channels)
    covariance = answers.covariance
    measured, predicted = answers.tr
    reasons = tuple(why_no_arm(*row) for row in zip(answers.stiffness, answers.k1, answers.k2, answers.c, strict=True))
    passive = np.array([not reason for reason in reasons], dtype=bool)
    with np.errstate(invalid="ignore"):
        arm_covariance = _propagate(answers.jacobian[:, 3:5], covariance)
        return Identification(
            frequency=np.asarray(phasors.frequency).reshape(passive.size),
            mobility=answers.mobility,
            mobility_covariance=_propagate(answers.by_mobility, covariance),
            stiffness=answers.stiffness,
            stiffness_covariance=_propagate(answers.jacobian[:, :2], covariance),
            loss_factor=answers.loss_factor,
            loss_factor_std=_std(answers.jacobian[:, 2], covariance),
            k1=answers.k1,
            k1_std=answers.k1_std,
            k2=np.where(passive, answers.k2, np.nan),
            c=np.where(passive, answers.c, np.nan),
            arm_covariance=np.where(passive[:, None, None], arm_covariance, np.nan),
            tr_measured=measured,
            tr_predicted=predicted,
            tr_std=_std(answers.jacobian[:, 5], covariance),
            reasons=reasons,
            route=route,
            stiffness_shared=_shared(answers, phasors, channels, added_mass),
            condition=np.arange(passive.size),
        )


def _shared(
    answers: _Answers, phasors: Phasors, channels: ChannelUncertainty | None, added_mass: ArrayLike
) -> FloatArray:
    """What one standard uncertainty of each error of the channels, rig value and added mass does to K*, (N, 2, p)."""
    count = answers.k1.size
    by = answers.jacobian[:, :2]
    amplitudes = phasors.amplitudes.reshape(count, 3)
    columns = []
    for error in channels.errors(phasors.omega.reshape(count)) if channels is not None else ():
        along = parts(amplitudes[:, error.channel] * error.turn * error.std)
        first = 2 * error.channel
        columns.append(np.einsum("nki,ni->nk", by[:, :, first : first + 2], along))
    at = np.arange(_RIG_AT.start, _RIG_AT.stop)
    columns += [by[:, :, i] * np.sqrt(answers.covariance[:, None, i, i]) for i in at]
    masses = np.broadcast_to(np.asarray(added_mass, dtype=float), count)
    own = by[:, :, _ADDED_AT] * np.sqrt(answers.covariance[:, None, _ADDED_AT, _ADDED_AT])
    columns += [np.where((masses == mass)[:, None], own, 0.0) for mass in np.unique(masses[masses != 0])]
    return np.nan_to_num(np.stack(columns, axis=2))


@dataclass(frozen=True)
class _Answers:
    """Values of N tests with their derivatives by all inputs; `jacobian` (N, 6, inputs) is in the order of OUTPUTS."""

    mobility: ComplexArray
    by_mobility: FloatArray
    stiffness: ComplexArray
    loss_factor: FloatArray
    k1: FloatArray
    k1_std: FloatArray
    k2: FloatArray
    c: FloatArray
    tr: tuple[FloatArray, FloatArray]
    jacobian: FloatArray
    covariance: FloatArray


def _answers(
    phasors: Phasors,
    rig: Rig | None,
    k1: ArrayLike,
    k1_std: ArrayLike,
    route: str,
    added_mass: ArrayLike,
    added_mass_std: ArrayLike,
    channels: ChannelUncertainty | None,
) -> _Answers:
    _check_route(route, rig)
    count = np.size(phasors.frequency)
    omega = phasors.omega.reshape(count)
    k1, k1_std, added, added_std = (
        np.broadcast_to(np.asarray(x, dtype=float), count) for x in (k1, k1_std, added_mass, added_mass_std)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        state = _Linear(phasors.amplitudes.reshape(count, 3), omega, rig, added)
        mobility, by_mobility = state.mobility()
        stiffness, by_stiffness = state.stiffness(route)
        loss, by_loss = _loss_factor(stiffness, by_stiffness)
        k2, c, by_arm = _arm(stiffness, by_stiffness, k1, omega)
        measured, predicted, by_tr = state.transmissibility(stiffness, by_stiffness)
    rows = [parts(by_stiffness, axis=-2), by_loss[:, None], by_arm, by_tr[:, None]]
    return _Answers(
        mobility=mobility,
        by_mobility=parts(by_mobility, axis=-2),
        stiffness=stiffness,
        loss_factor=loss,
        k1=k1,
        k1_std=k1_std,
        k2=k2,
        c=c,
        tr=(measured, predicted),
        jacobian=np.concatenate(rows, axis=1),
        covariance=_input_covariance(phasors, rig, k1_std, added_std, channels),
    )


def variance_by_source(
    phasors: Phasors,
    rig: Rig | None,
    k1: ArrayLike = np.nan,
    *,
    k1_std: ArrayLike = 0.0,
    route: str = "mobility",
    added_mass: ArrayLike = 0.0,
    added_mass_std: ArrayLike = 0.0,
    channels: ChannelUncertainty | None = None,
) -> dict[Source, FloatArray]:
    """Variance of each of `OUTPUTS` by its source, for the same arguments as `identify`.

    Returns
    -------
    dict of Source to (N, 6) float array
        Sensor noise, frequency, each error of each channel, each of the rig's values, added mass, K1; they add up
        to the squares of the uncertainties that `identify` gives, for its inputs are independent.
    """
    answers = _answers(phasors, rig, k1, k1_std, route, added_mass, added_mass_std, channels)
    count = answers.k1.size
    amplitudes = phasors.amplitudes.reshape(count, 3)
    channels = channels or ChannelUncertainty()

    def by(covariance: FloatArray) -> FloatArray:
        found = _propagate(answers.jacobian, covariance)
        return np.diagonal(found, 0, 1, 2)

    def alone(block: FloatArray, at: slice) -> FloatArray:
        covariance = np.zeros((count, _INPUTS, _INPUTS))
        covariance[:, at, at] = block
        return by(covariance)

    phasor = slice(0, 6)
    sources = {Source(Kind.NOISE): alone(phasors.covariance.reshape(count, 6, 6), phasor)}
    sources[Source(Kind.FREQUENCY)] = alone(answers.covariance[:, _OMEGA_AT:, _OMEGA_AT:], slice(_OMEGA_AT, None))
    for error in channels.errors(phasors.omega.reshape(count)):
        sources[error.source] = alone(error_covariance(error, amplitudes), phasor)
    values = [Source(Kind.RIG_VALUE, name) for name in PARAMETERS]
    for i, source in enumerate((*values, Source(Kind.ADDED_MASS), Source(Kind.K1)), start=6):
        sources[source] = alone(answers.covariance[:, i : i + 1, i : i + 1], slice(i, i + 1))
    return sources


def _check_route(route: str, rig: Rig | None) -> None:
    if route not in ROUTES:
        raise ValueError(f"no route {route!r}: choose one of {', '.join(ROUTES)}")
    if rig is None and route != "relative":
        raise RigError(f"the {route} route needs the rig: state it, or use the relative route")
    if rig is not None and rig.blocked and route == "transmissibility":
        raise RigError("a blocked rig has no motion beyond the specimen: use the mobility route")


class _Linear:
    """Values with their derivatives (N, inputs) by every real input; complex values, analytic in the phasors."""

    def __init__(self, amplitudes: ComplexArray, omega: FloatArray, rig: Rig | None, added: FloatArray) -> None:
        self.omega, self.rig, self.added = omega, rig, added
        self.cell_force, self.v1, self.v2 = amplitudes.T
        jw = 1j * omega
        self.by_cell_force, self.by_v1, self.by_v2 = (self._phasor(i) for i in range(3))
        input_mass = rig.input_mass if rig is not None else 0.0
        self.f1 = self.cell_force - jw * input_mass * self.v1
        self.by_f1 = self.by_cell_force - (jw * input_mass)[:, None] * self.by_v1
        self.by_f1[:, _INPUT_MASS_AT] -= jw * self.v1
        self.by_f1[:, _OMEGA_AT] -= 1j * input_mass * self.v1

    def _phasor(self, index: int) -> ComplexArray:
        by = np.zeros((self.omega.size, _INPUTS), dtype=complex)
        by[:, 2 * index], by[:, 2 * index + 1] = 1.0, 1j
        return by

    def _rig(self) -> tuple[ComplexArray, ComplexArray]:
        """1/Zr and its derivatives."""
        assert self.rig is not None
        mobility = np.asarray(self.rig.mobility(self.omega, self.added))
        by = np.zeros((self.omega.size, _INPUTS), dtype=complex)
        gradient = self.rig.impedance_gradient(self.omega, self.added)
        by[:, 6:_K1_AT] = -(mobility**2)[:, None] * gradient
        by[:, _OMEGA_AT] = -(mobility**2) * self.rig.impedance_slope(self.omega, self.added)
        return mobility, by

    def mobility(self) -> tuple[ComplexArray, ComplexArray]:
        """V1/F1 as the sensors give it."""
        return _ratio(self.v1, self.by_v1, self.cell_force, self.by_cell_force)

    def stiffness(self, route: str) -> tuple[ComplexArray, ComplexArray]:
        """K* by a route; every route's formula has the factor jw."""
        value, by = self._stiffness(route)
        by[:, _OMEGA_AT] += value / self.omega
        return value, by

    def _stiffness(self, route: str) -> tuple[ComplexArray, ComplexArray]:
        """K* by a route, jw outside the impedances held."""
        jw = 1j * self.omega
        if route == "relative":
            value = relative_route(self.f1, self.v1, self.v2, self.omega)
            across, by_across = self.v1 - self.v2, self.by_v1 - self.by_v2
            return value, value[:, None] * (self.by_f1 / self.f1[:, None] - by_across / across[:, None])
        rig, by_rig = self._rig()
        if route == "mobility":
            mobility, by = _ratio(self.v1, self.by_v1, self.f1, self.by_f1)
            value = mobility_route(mobility, rig, self.omega)
            return value, -(value**2 / jw)[:, None] * (by - by_rig)
        t, by_t = _ratio(self.v2, self.by_v2, self.v1, self.by_v1)
        value = transmissibility_route(t, 1.0 / rig, self.omega)
        return value, value[:, None] * (by_t / (t * (1 - t))[:, None] - by_rig / rig[:, None])

    def transmissibility(
        self, stiffness: ComplexArray, by_stiffness: ComplexArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """abs(V2/V1) as measured, and as K* and the rig give it; derivatives of the latter, or the former."""
        measured, by_measured = _ratio(self.v2, self.by_v2, self.v1, self.by_v1)
        if self.rig is None or self.rig.blocked:
            nothing = np.full(self.omega.size, np.nan)
            return np.abs(measured), nothing, _modulus(measured, by_measured)
        rig, by_rig = self._rig()
        jw = 1j * self.omega
        joined = stiffness * rig
        by_joined = by_stiffness * rig[:, None] + stiffness[:, None] * by_rig
        predicted = joined / (joined + jw)
        by_predicted = (jw / (joined + jw) ** 2)[:, None] * by_joined
        by_predicted[:, _OMEGA_AT] -= 1j * joined / (joined + jw) ** 2
        return np.abs(measured), np.abs(predicted), _modulus(predicted, by_predicted)


def _ratio(
    over: ComplexArray, by_over: ComplexArray, under: ComplexArray, by_under: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    value = over / under
    return value, (by_over - value[:, None] * by_under) / under[:, None]


def _modulus(value: ComplexArray, by_value: ComplexArray) -> FloatArray:
    """Derivatives of abs(value)."""
    return (np.conj(value)[:, None] * by_value).real / np.abs(value)[:, None]


def _loss_factor(stiffness: ComplexArray, by_stiffness: ComplexArray) -> tuple[FloatArray, FloatArray]:
    value = stiffness.imag / stiffness.real
    return value, (by_stiffness.imag - value[:, None] * by_stiffness.real) / stiffness.real[:, None]


def _arm(
    stiffness: ComplexArray, by_stiffness: ComplexArray, k1: FloatArray, omega: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """K2, C and their derivatives, shape (N, 2, inputs)."""
    k2, c = maxwell_arm(stiffness, k1, omega)
    by_arm = by_stiffness.copy()
    by_arm[:, _K1_AT] -= 1.0
    slopes = arm_slopes(stiffness, k1, (k2, c), omega, by_arm)
    slopes[:, 1, _OMEGA_AT] -= c / omega
    return k2, c, slopes


def _input_covariance(
    phasors: Phasors, rig: Rig | None, k1_std: FloatArray, added_std: FloatArray, channels: ChannelUncertainty | None
) -> FloatArray:
    count = k1_std.size
    covariance = np.zeros((count, _INPUTS, _INPUTS))
    covariance[:, :6, :6] = phasors.covariance.reshape(count, 6, 6)
    if channels is not None:
        covariance[:, :6, :6] += channels.covariance(phasors.amplitudes.reshape(count, 3), phasors.omega.reshape(count))
    at = np.arange(_INPUTS)
    if rig is not None:
        covariance[:, at[_RIG_AT], at[_RIG_AT]] = rig.uncertainties**2
    covariance[:, _ADDED_AT, _ADDED_AT] = added_std**2
    covariance[:, _K1_AT, _K1_AT] = np.nan_to_num(k1_std) ** 2
    covariance[:, _OMEGA_AT, _OMEGA_AT] = (2 * np.pi * np.asarray(phasors.frequency_std).reshape(count)) ** 2
    return covariance


def _propagate(jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    """J S J^T for J (N, outputs, inputs); inputs that do not matter do not count, even where they are unknown."""
    with np.errstate(invalid="ignore"):
        weighted = np.where(jacobian == 0, 0.0, jacobian)
        known = np.where(np.any(jacobian != 0, axis=1)[:, :, None], covariance, 0.0)
        known = np.where(np.any(jacobian != 0, axis=1)[:, None, :], known, 0.0)
        return weighted @ known @ np.swapaxes(weighted, -1, -2)


def _std(jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.sqrt(np.maximum(_propagate(jacobian[:, None, :], covariance)[:, 0, 0], 0.0))
