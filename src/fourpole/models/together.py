r"""One fit to many conditions whose parameters follow common laws: shared values, or surfaces over the conditions.

A link function g of each parameter of each condition follows a linear law,

.. math:: g(\theta_{cp}) = \sum_k \Phi^{(p)}_{ck}\,\beta^{(p)}_k .

The matrix of a law is a column of ones for a parameter that all conditions share. It is a unit matrix for a parameter
that each condition has for itself, and it holds powers of the pressure for a surface. Errors that all tests share, such
as gains of sensors, are parameters of the fit with their stated uncertainty: averaging over tests does not reduce them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg, optimize

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, complex_columns, multiplication, real_columns, stacked
from fourpole.models.fit import Fit
from fourpole.models.interface import Model, Parameter

#: Largest modulus of a linked value: logit between two bounds, logarithm above one bound.
_MOST_LOGIT, _MOST_LOG = 12.0, 300.0
#: Relative tolerance of the least-squares search.
_TOLERANCE = 1e-12
#: Least value of 1 - leverage of a leave-one-out residual.
_LEAST_REMAINDER = 1e-9


def link(parameter: Parameter, values: ArrayLike) -> FloatArray:
    """The link g of a parameter: logit between two bounds, logarithm above a lower bound, or the value itself."""
    array = np.asarray(values, dtype=float)
    low, high = parameter.low, parameter.high
    with np.errstate(divide="ignore", invalid="ignore"):
        if np.isfinite(high) and np.isfinite(low):
            return np.clip(np.log((array - low) / (high - array)), -_MOST_LOGIT, _MOST_LOGIT)
        if np.isfinite(low):
            return np.clip(np.log(array - low), -_MOST_LOG, _MOST_LOG)
    return array


def unlink(parameter: Parameter, linked: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """The parameter of a linked value, and its derivative by the linked value."""
    array = np.asarray(linked, dtype=float)
    low, high = parameter.low, parameter.high
    if np.isfinite(high) and np.isfinite(low):
        share = 1.0 / (1.0 + np.exp(-np.clip(array, -_MOST_LOGIT, _MOST_LOGIT)))
        return low + (high - low) * share, (high - low) * share * (1 - share)
    if np.isfinite(low):
        size = np.exp(np.clip(array, -_MOST_LOG, _MOST_LOG))
        return low + size, size
    return array, np.ones_like(array)


def link_all(model: Model, values: FloatArray) -> FloatArray:
    """The links (..., P) of all parameters (..., P) of a model."""
    return np.stack([link(one, values[..., at]) for at, one in enumerate(model.parameters)], axis=-1)


def unlink_all(model: Model, linked: FloatArray) -> tuple[FloatArray, FloatArray]:
    """All parameters (..., P) of linked values (..., P), and their derivatives by the linked values."""
    both = [unlink(one, linked[..., at]) for at, one in enumerate(model.parameters)]
    return np.stack([one for one, _ in both], axis=-1), np.stack([slope for _, slope in both], axis=-1)


@dataclass(frozen=True)
class Scatter:
    """Relative standard deviations of conditions about their law.

    Attributes
    ----------
    condition : float [1]
        Scatter from set-up to set-up: one error of Re log K* and one of Im log K* for all frequencies of a condition,
        and one of K1.
    frequency : (2,) tuple of float [1]
        Error of the model at each frequency, along and across K*.
    """

    condition: float = 0.0
    frequency: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Together(ByValue):
    """The fit of a model to B conditions whose parameters follow laws.

    Attributes
    ----------
    model : Model
    designs : tuple of P (B, K) float arrays
        Matrix of the law of each parameter.
    values : (B, P) float array
        Parameters of each condition.
    coefficients : tuple of P float arrays
        Coefficients of the law of each linked parameter.
    inverse : (U + p, U + p) float array
        Covariance of all coefficients in turn, then of the shared errors.
    chi2, dof : float, int
    converged : bool
    rows : tuple of B (M_c, U + p) float arrays
        Derivatives of the whitened model by coefficients and shared errors.
    residuals : tuple of B (M_c,) float arrays [1]
        Whitened residuals.
    whiteners : tuple of B (2N, 2N) float arrays
    """

    model: Model
    designs: tuple[FloatArray, ...]
    values: FloatArray
    coefficients: tuple[FloatArray, ...]
    inverse: FloatArray
    chi2: float
    dof: int
    converged: bool
    rows: tuple[FloatArray, ...]
    residuals: tuple[FloatArray, ...]
    whiteners: tuple[FloatArray, ...]

    @property
    def covariance(self) -> FloatArray:
        """Covariance (U, U) of all coefficients in turn."""
        size = sum(one.size for one in self.coefficients)
        return self.inverse[:size, :size]

    def fits(self) -> list[Fit]:
        """One fit per condition, with the covariance of its parameters and an equal part of the degrees of freedom."""
        _, slopes = unlink_all(self.model, link_all(self.model, self.values))
        found = []
        for at, values in enumerate(self.values):
            laws = zip(slopes[at], self.designs, strict=True)
            by = linalg.block_diag(*(slope * design[at] for slope, design in laws))
            found.append(
                Fit(
                    model=self.model,
                    values=values,
                    covariance=by @ self.covariance @ by.T,
                    chi2=np.asarray(np.sum(self.residuals[at] ** 2)),
                    dof=round(self.dof / len(self.values)),
                    residuals=self.residuals[at],
                    on_bound=np.zeros(values.size, dtype=bool),
                    converged=np.asarray(self.converged),
                    steps=0,
                    agreed=np.asarray(1.0),
                )
            )
        return found

    def leave_one_out(self, at: int) -> tuple[FloatArray, FloatArray]:
        """Whitened residuals (M,) of a condition from a fit without it, and their covariance (M, M), to first order.

        With the residuals r of the whole fit and the leverage H of the condition they are (1 - H)^-1 r and (1 - H)^-1.
        """
        rows = self.rows[at]
        leverages, directions = np.linalg.eigh(rows @ self.inverse @ rows.T)
        # The leverage is 1 in directions that no other condition determines.
        covariance = (directions / np.clip(1.0 - leverages, _LEAST_REMAINDER, 1.0)) @ directions.T
        return covariance @ self.residuals[at], covariance


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
        Data of one condition each, without covariance between frequencies.
    start : (P,) or (B, P) float array
    designs : mapping of str to (B, K) float array, optional
        Matrix of the law of a parameter, by its symbol: a column of ones if all conditions share it. A parameter that
        is not named has a value of its own for each condition.
    shared : sequence of B (2N, p) float arrays [N/m], optional
        Changes of Re K* and Im K* of each frequency in turn when one of p shared errors is one standard uncertainty.
    scatter : Scatter, optional
        Scatter of the conditions, added to the uncertainty of the data.

    Returns
    -------
    Together

    Raises
    ------
    ModelError
        If a name is not a parameter, or there are fewer data than coefficients.

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
    return Together(
        model=model,
        designs=search.designs,
        values=search.parameters(done.x)[0],
        coefficients=tuple(np.split(done.x[:size], np.cumsum(search.sizes)[:-1])),
        inverse=inverse,
        chi2=float(2 * done.cost),
        dof=known - size,
        converged=bool(done.status > 0),
        rows=tuple(rows),
        residuals=tuple(search.residuals(done.x)),
        whiteners=tuple(search.whiteners),
    )


@dataclass(frozen=True, eq=False)
class _Search:
    """The least-squares problem; its unknowns u are all coefficients in turn, then the shared errors."""

    model: Model
    groups: Sequence[_Group]
    designs: tuple[FloatArray, ...]
    common: int

    @property
    def sizes(self) -> list[int]:
        """Number of coefficients of the law of each parameter."""
        return [one.shape[1] for one in self.designs]

    @property
    def coefficients(self) -> int:
        """Number of coefficients of all laws."""
        return sum(self.sizes)

    @property
    def whiteners(self) -> list[FloatArray]:
        """The whitener (2N, 2N) of each condition."""
        found = {at: row for one in self.groups for at, row in zip(one.places, one.whitener, strict=True)}
        return [found[at] for at in range(len(found))]

    def begin(self, values: FloatArray) -> FloatArray:
        """Unknowns whose laws are closest to parameters (B, P), with shared errors of zero."""
        linked = link_all(self.model, values).T
        found = [np.linalg.lstsq(design, one, rcond=None)[0] for design, one in zip(self.designs, linked, strict=True)]
        return np.concatenate([*found, np.zeros(self.common)])

    def linked(self, u: FloatArray) -> FloatArray:
        """Linked parameters (B, P)."""
        parts = np.split(u[: self.coefficients], np.cumsum(self.sizes)[:-1])
        return np.stack([design @ part for design, part in zip(self.designs, parts, strict=True)], axis=1)

    def parameters(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Parameters (B, P), and their derivatives by the linked parameters."""
        return unlink_all(self.model, self.linked(u))

    def residuals(self, u: FloatArray) -> list[FloatArray]:
        """Whitened residuals, data minus model, of each condition; the last is that of K1, if it is known."""
        values, _ = self.parameters(u)
        found: dict[int, FloatArray] = {}
        for one in self.groups:
            data, own = one.data, values[one.places]
            shown = self.model.on(data).stiffness(own, data.omega) * np.exp(one.shared @ u[self.coefficients :])
            off = real_columns((data.stiffness - shown)[..., None])[..., 0]
            rows = (one.whitener @ off[..., None])[..., 0]
            if one.has_k1:
                k1 = (data.k1 - self.model.static_stiffness(own)) / one.k1_std
                rows = np.concatenate([rows, k1[:, None]], axis=1)
            found.update(zip(one.places, rows, strict=True))
        return [found[at] for at in range(len(values))]

    def rows(self, u: FloatArray) -> list[FloatArray]:
        """Derivatives (M, U + p) of the whitened model of each condition by the unknowns."""
        values, slopes = self.parameters(u)
        found: dict[int, FloatArray] = {}
        for one in self.groups:
            own, slope = values[one.places], slopes[one.places]
            seen = np.exp(one.shared @ u[self.coefficients :])[..., None]
            model = self.model.on(one.data)
            by_value = real_columns(model.derivative(own, one.data.omega) * seen) * slope[:, None, :]
            by_shared = real_columns(model.stiffness(own, one.data.omega)[..., None] * seen * one.shared)
            rows = one.whitener @ np.concatenate([self._by_law(by_value, one.places), by_shared], axis=2)
            if one.has_k1:
                by_value = (self.model.static_derivative(own) * slope / one.k1_std[:, None])[:, None, :]
                k1 = np.zeros_like(rows[:, :1])  # K1 has no shared errors
                k1[..., : self.coefficients] = self._by_law(by_value, one.places)
                rows = np.concatenate([rows, k1], axis=1)
            found.update(zip(one.places, rows, strict=True))
        return [found[at] for at in range(len(values))]

    def _by_law(self, by_linked: FloatArray, places: Sequence[int]) -> FloatArray:
        """Derivatives (G, M, U) by the coefficients, from those (G, M, P) by the linked parameters."""
        laws = (design[list(places)][:, None, :] for design in self.designs)
        return np.concatenate([by_linked[:, :, p, None] * law for p, law in enumerate(laws)], axis=2)


@dataclass(frozen=True, eq=False)
class _Group:
    """Conditions with the same number of frequencies, and their places among all conditions.

    `shared` (G, N, p) [1] is the change of log K* when a shared error is one standard uncertainty.
    """

    places: list[int]
    data: StiffnessData
    shared: ComplexArray
    whitener: FloatArray
    k1_std: FloatArray

    @property
    def has_k1(self) -> bool:
        """Whether K1 of these conditions is known."""
        return bool(np.all(np.isfinite(self.k1_std)))


def _search_of(
    model: Model,
    conditions: Sequence[StiffnessData],
    designs: Mapping[str, ArrayLike],
    shared: Sequence[FloatArray] | None,
    scatter: Scatter,
) -> _Search:
    """The least-squares problem of `fit_together`, checked."""
    count = len(conditions)
    symbols = model.known(designs)
    if any(one.stiffness.ndim != 1 or one.full for one in conditions) or not conditions:
        raise ModelError("state one condition at a time, without covariance between frequencies")
    laws = [_law_of(symbol, designs.get(symbol, np.eye(count)), count) for symbol in symbols]
    common = shared if shared is not None else [np.zeros((2 * one.count, 0)) for one in conditions]
    groups = []
    for places, data in stacked(conditions):
        k1_std = np.hypot(data.k1_std, scatter.condition * data.k1) if model.rests else np.full(len(places), np.nan)
        whitener = np.stack([_whitener(conditions[at], scatter) for at in places])
        effect = np.stack([complex_columns(common[at]) for at in places]) / data.stiffness[..., None]
        groups.append(_Group(places, data, effect, whitener, k1_std))
    return _Search(model, groups, tuple(laws), common[0].shape[1])


def _law_of(symbol: str, given: ArrayLike, count: int) -> FloatArray:
    """The matrix of a law, one row per condition; ModelError if its shape is another."""
    law = np.asarray(given, dtype=float)
    if law.ndim != 2 or len(law) != count:
        raise ModelError(f"the law of {symbol} has the shape {law.shape}: {count} conditions need as many rows")
    return law


def _whitener(data: StiffnessData, scatter: Scatter) -> FloatArray:
    """The whitener (2N, 2N) of the uncertainty of the data and the scatter together."""
    by_log = multiplication(data.stiffness)  # derivatives of Re K* and Im K* by Re and Im of log K*
    each = by_log * np.asarray(scatter.frequency)
    own = data.covariance + each @ np.swapaxes(each, 1, 2)
    common = scatter.condition * by_log.reshape(-1, 2)
    return replace(data, covariance=linalg.block_diag(*own) + common @ common.T).whitener()
