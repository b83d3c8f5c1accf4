r"""One fit of many conditions whose parameters follow common laws: shared, or surfaces over pressure and preload.

Each parameter of each condition is a link of a linear law,

.. math:: g(\theta_{cp}) = \sum_k \Phi^{(p)}_{ck}\,\beta^{(p)}_k,

with a column of ones for a parameter that all conditions share, a unit matrix for one that each has by itself, and
powers of the pressure for a smooth surface. What the tests have in common in their errors (gains of sensors) is fitted
along with it, with its stated uncertainty, so that nothing is averaged away that cannot be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, stacked
from fourpole.models.fit import Fit
from fourpole.models.interface import Model, Parameter

__all__ = ["Scatter", "Together", "fit_together", "link", "unlink"]

#: A linked value is kept within this of the middle, where it has bounds on both sides; logarithms within 300.
_MOST_LOGIT, _MOST_LOG = 12.0, 300.0
_TOLERANCE = 1e-12
#: Least value of 1 - leverage in a leave-one-out residual.
_ALONE = 1e-9


def link(parameter: Parameter, values: ArrayLike) -> FloatArray:
    """A parameter where it has no bounds: its logarithm, its logit between two bounds, or itself."""
    array = np.asarray(values, dtype=float)
    low, high = parameter.low, parameter.high
    with np.errstate(divide="ignore", invalid="ignore"):
        if np.isfinite(high) and np.isfinite(low):
            return np.clip(np.log((array - low) / (high - array)), -_MOST_LOGIT, _MOST_LOGIT)
        if np.isfinite(low):
            return np.clip(np.log(array - low), -_MOST_LOG, _MOST_LOG)
    return array


def unlink(parameter: Parameter, linked: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """The parameter, and its derivative by its linked value."""
    array = np.asarray(linked, dtype=float)
    low, high = parameter.low, parameter.high
    if np.isfinite(high) and np.isfinite(low):
        share = 1.0 / (1.0 + np.exp(-np.clip(array, -_MOST_LOGIT, _MOST_LOGIT)))
        return low + (high - low) * share, (high - low) * share * (1 - share)
    if np.isfinite(low):
        size = np.exp(np.clip(array, -_MOST_LOG, _MOST_LOG))
        return low + size, size
    return array, np.ones_like(array)


@dataclass(frozen=True)
class Scatter:
    """How far conditions may be off their law, relative, as standard deviations.

    Attributes
    ----------
    condition : float [1]
        Of log K*, Re and Im, one error of each at all frequencies of a condition, and of K1: set-up to set-up.
    frequency : (2,) tuple of float [1]
        Along and across K*, at each frequency by itself: what the model cannot follow.
    """

    condition: float = 0.0
    frequency: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Together(ByValue):
    """A model fitted to B conditions whose parameters follow laws.

    Attributes
    ----------
    model : Model
    designs : tuple of P (B, K) float arrays
        The laws.
    values : (B, P) float array
        Parameters of each condition by the laws.
    coefficients : tuple of P float arrays
        Of each law, of the linked parameter.
    covariance : (U, U) float array
        Of all coefficients in turn.
    chi2, dof : float, int
    converged : bool
    rows : tuple of B (M_c, U + p) float arrays
        Derivatives of the whitened model by coefficients and shared errors.
    residuals : tuple of B (M_c,) float arrays [1]
        Whitened.
    whiteners : tuple of B (2N, 2N) float arrays
    """

    model: Model
    designs: tuple[FloatArray, ...]
    values: FloatArray
    coefficients: tuple[FloatArray, ...]
    covariance: FloatArray
    chi2: float
    dof: int
    converged: bool
    rows: tuple[FloatArray, ...]
    residuals: tuple[FloatArray, ...]
    whiteners: tuple[FloatArray, ...]

    def fits(self) -> list[Fit]:
        """Each condition by itself: its parameters with their covariance; degrees of freedom are shared out evenly."""
        linked = [link(one, self.values[:, at]) for at, one in enumerate(self.model.parameters)]
        slopes = np.stack([unlink(one, at)[1] for one, at in zip(self.model.parameters, linked, strict=True)], axis=1)
        spare = self.dof / len(self.values)
        found = []
        for at, values in enumerate(self.values):
            by = np.zeros((values.size, self.covariance.shape[0]))
            first = 0
            for place, design in enumerate(self.designs):
                by[place, first : first + design.shape[1]] = slopes[at, place] * design[at]
                first += design.shape[1]
            found.append(
                Fit(
                    model=self.model,
                    values=values,
                    covariance=by @ self.covariance @ by.T,
                    chi2=np.asarray(np.sum(self.residuals[at] ** 2)),
                    dof=round(spare),
                    residuals=self.residuals[at],
                    on_bound=np.zeros(values.size, dtype=bool),
                    converged=np.asarray(self.converged),
                    steps=0,
                    agreed=np.asarray(1.0),
                )
            )
        return found

    @cached_property
    def _inverse(self) -> FloatArray:
        """Inverse of the normal matrix of coefficients and shared errors."""
        whole = np.concatenate(self.rows)
        prior = np.zeros(whole.shape[1])
        prior[self.covariance.shape[0] :] = 1.0
        return np.asarray(np.linalg.pinv(whole.T @ whole + np.diag(prior), hermitian=True))

    def left_out(self, at: int) -> tuple[FloatArray, FloatArray]:
        """Whitened residuals (M,) of a condition from a fit without it, and their covariance (M, M), to first order.

        The leverage H of the condition's own rows gives (1 - H)^-1 r and (1 - H)^-1.
        """
        rows = self.rows[at]
        leverage = rows @ self._inverse @ rows.T
        shares, directions = np.linalg.eigh(leverage)
        # The leverage is 1 in a direction that only this condition determines; the limit avoids a division by zero.
        spread = (directions / np.clip(1.0 - shares, _ALONE, 1.0)) @ directions.T
        return spread @ self.residuals[at], spread


def fit_together(
    model: Model,
    conditions: Sequence[StiffnessData],
    start: ArrayLike,
    designs: Mapping[str, ArrayLike] | None = None,
    *,
    shared: Sequence[FloatArray] | None = None,
    scatter: Scatter | None = None,
) -> Together:
    """Fit a model to all conditions at once.

    Parameters
    ----------
    model : Model
    conditions : sequence of B StiffnessData
        Of one condition each, with the covariance of each frequency by itself.
    start : (P,) or (B, P) float array
    designs : mapping of str to (B, K) float array, optional
        Law of each parameter by its symbol, a column of ones for one that all share. A parameter that is not named is
        each condition's own.
    shared : sequence of B (2N, p) float arrays [N/m], optional
        What one standard uncertainty of each of p common errors does to Re and Im of each frequency in turn.
    scatter : Scatter, optional
        In addition to the data's uncertainty.

    Returns
    -------
    Together

    Raises
    ------
    ModelError
        If a name is not known or there are fewer data than coefficients.

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> truth = [[180e3, 120e3, 700.0], [180e3, 150e3, 900.0]]
    >>> data = [StiffnessData.of(omega, Zener().stiffness(one, omega), 100.0) for one in truth]
    >>> found = fit_together(Zener(), data, truth[0], {"K1": np.ones((2, 1))})
    >>> found.values.round(3)
    array([[180000., 120000.,    700.],
           [180000., 150000.,    900.]])
    """
    search = _search_of(model, conditions, designs or {}, shared, scatter or Scatter())
    begin = search.begin(np.broadcast_to(model.checked(start), (len(conditions), len(model.parameters))))
    size = search.coefficients
    known = sum(len(one) for one in search.residuals(begin)) - (begin.size - size)
    if known < size:
        raise ModelError(
            f"{len(conditions)} conditions give {known} numbers, too few for {size} coefficients of the {model.name} "
            "model: take a simpler law or a smaller model"
        )
    done = optimize.least_squares(
        lambda u: np.concatenate([*search.residuals(u), -u[size:]]),
        begin,
        jac=lambda u: np.concatenate([*(-rows for rows in search.rows(u)), -np.eye(u.size)[size:]]),
        method="lm",
        x_scale="jac",
        xtol=_TOLERANCE,
        ftol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=400,
    )
    rows = search.rows(done.x)
    whole = np.concatenate(rows)
    normal = whole.T @ whole
    normal[np.arange(size, done.x.size), np.arange(size, done.x.size)] += 1.0
    scale = 1.0 / np.sqrt(np.where(np.diag(normal) > 0, np.diag(normal), 1.0))
    inverse = np.linalg.pinv(normal * np.outer(scale, scale), rcond=1e-13, hermitian=True) * np.outer(scale, scale)
    linked = search.linked(done.x)
    return Together(
        model=model,
        designs=search.designs,
        values=np.stack([unlink(one, linked[:, at])[0] for at, one in enumerate(model.parameters)], axis=1),
        coefficients=tuple(np.split(done.x[:size], np.cumsum(search.sizes)[:-1])),
        covariance=inverse[:size, :size],
        chi2=float(2 * done.cost),
        dof=known - size,
        converged=bool(done.status > 0),
        rows=tuple(rows),
        residuals=tuple(search.residuals(done.x)),
        whiteners=tuple(search.whiteners),
    )


@dataclass(frozen=True)
class _Search:
    """The least-squares problem of the solver: its unknowns are the coefficients in turn, then the shared errors."""

    model: Model
    groups: Sequence[_Group]
    designs: tuple[FloatArray, ...]
    common: int

    @property
    def sizes(self) -> list[int]:
        """Coefficients of each parameter's law."""
        return [one.shape[1] for one in self.designs]

    @property
    def coefficients(self) -> int:
        return sum(self.sizes)

    @property
    def whiteners(self) -> list[FloatArray]:
        """Whitening matrix of each condition."""
        found = {at: row for one in self.groups for at, row in zip(one.places, one.whitener, strict=True)}
        return [found[at] for at in range(len(found))]

    def begin(self, values: FloatArray) -> FloatArray:
        """Coefficients closest to some parameters; no shared error."""
        linked = [link(one, values[:, at]) for at, one in enumerate(self.model.parameters)]
        found = [np.linalg.lstsq(design, one, rcond=None)[0] for design, one in zip(self.designs, linked, strict=True)]
        return np.concatenate([*found, np.zeros(self.common)])

    def linked(self, u: FloatArray) -> FloatArray:
        """Linked parameters (B, P)."""
        parts = np.split(u[: self.coefficients], np.cumsum(self.sizes)[:-1])
        return np.stack([design @ part for design, part in zip(self.designs, parts, strict=True)], axis=1)

    def _parameters(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        both = [unlink(one, at) for one, at in zip(self.model.parameters, self.linked(u).T, strict=True)]
        return np.stack([one for one, _ in both], axis=1), np.stack([slope for _, slope in both], axis=1)

    def residuals(self, u: FloatArray) -> list[FloatArray]:
        """Whitened data less model of each condition; K1 last, where it is known."""
        values, _ = self._parameters(u)
        found: dict[int, FloatArray] = {}
        for one in self.groups:
            data, own = one.data, values[one.places]
            off = _pairs((data.stiffness - self.model.stiffness(own, data.omega))[..., None])[..., 0]
            rows = (one.whitener @ (off - one.shared @ u[self.coefficients :])[..., None])[..., 0]
            if one.has_k1:
                rest = (data.k1 - self.model.static_stiffness(own)) / one.k1_std
                rows = np.concatenate([rows, rest[:, None]], axis=1)
            found.update(zip(one.places, rows, strict=True))
        return [found[at] for at in range(len(values))]

    def rows(self, u: FloatArray) -> list[FloatArray]:
        """Derivatives of the whitened model of each condition."""
        values, slopes = self._parameters(u)
        found: dict[int, FloatArray] = {}
        for one in self.groups:
            own, slope = values[one.places], slopes[one.places]
            by_value = _pairs(self.model.derivative(own, one.data.omega)) * slope[:, None, :]
            rows = one.whitener @ np.concatenate([self._by_law(by_value, one.places), one.shared], axis=2)
            if one.has_k1:
                by_rest = (self.model.static_derivative(own) * slope / one.k1_std[:, None])[:, None, :]
                last = self._by_law(by_rest, one.places)
                nothing = np.zeros((len(last), 1, one.shared.shape[2]))
                rows = np.concatenate([rows, np.concatenate([last, nothing], axis=2)], axis=1)
            found.update(zip(one.places, rows, strict=True))
        return [found[at] for at in range(len(values))]

    def _by_law(self, by_linked: FloatArray, places: Sequence[int]) -> FloatArray:
        """Derivatives by the coefficients, of those (G, M, P) by linked parameters."""
        laws = (design[list(places)][:, None, :] for design in self.designs)
        return np.concatenate([by_linked[:, :, p, None] * law for p, law in enumerate(laws)], axis=2)


@dataclass(frozen=True)
class _Group:
    """Conditions with as many frequencies, worked on at once, and where they stand among all."""

    places: list[int]
    data: StiffnessData
    shared: FloatArray
    whitener: FloatArray
    k1_std: FloatArray

    @property
    def has_k1(self) -> bool:
        """Whether they have their static stiffness."""
        return bool(np.all(np.isfinite(self.k1_std)))


def _search_of(
    model: Model,
    conditions: Sequence[StiffnessData],
    designs: Mapping[str, ArrayLike],
    shared: Sequence[FloatArray] | None,
    scatter: Scatter,
) -> _Search:
    count = len(conditions)
    symbols = model.known(designs)
    if any(one.stiffness.ndim != 1 or one.full for one in conditions) or not conditions:
        raise ModelError("give one condition at a time, with the covariance of each frequency by itself")
    laws = [_law_of(symbol, designs.get(symbol, np.eye(count)), count) for symbol in symbols]
    common = shared if shared is not None else [np.zeros((2 * one.count, 0)) for one in conditions]
    groups = []
    for places, data in stacked(conditions):
        k1_std = np.hypot(data.k1_std, scatter.condition * data.k1) if model.rests else np.full(len(places), np.nan)
        whitener = np.stack([_whitener(conditions[at], scatter) for at in places])
        groups.append(_Group(places, data, np.stack([common[at] for at in places]), whitener, k1_std))
    return _Search(model, groups, tuple(laws), common[0].shape[1])


def _law_of(symbol: str, given: ArrayLike, count: int) -> FloatArray:
    """A parameter's law as an array of one row per condition."""
    law = np.asarray(given, dtype=float)
    if law.ndim != 2 or len(law) != count:
        raise ModelError(f"the law of {symbol} has the shape {law.shape}: {count} conditions need as many rows")
    return law


def _whitener(data: StiffnessData, scatter: Scatter) -> FloatArray:
    """Whitening matrix of the data's own uncertainty and the scatter together."""
    whole = np.zeros((2 * data.count, 2 * data.count))
    turns = _pairs(np.stack([data.stiffness, 1j * data.stiffness], axis=1))  # by Re and Im of log K*
    for at in range(data.count):
        rows = slice(2 * at, 2 * at + 2)
        turn = turns[rows] * np.asarray(scatter.frequency)
        floor = 1e-7 * np.abs(data.stiffness[at])
        whole[rows, rows] = data.covariance[at] + turn @ turn.T + floor**2 * np.eye(2)
    together = scatter.condition * turns
    return np.asarray(np.linalg.inv(np.linalg.cholesky(whole + together @ together.T)))


def _pairs(values: np.ndarray) -> FloatArray:
    """Re and Im of each row in turn: (..., N, k) to (..., 2N, k)."""
    both = np.stack([values.real, values.imag], axis=-2)
    return np.asarray(both.reshape(*values.shape[:-2], 2 * values.shape[-2], values.shape[-1]))
