r"""Conditions of a map, linearised: relative residuals of K*, their derivatives, and their weights.

About a point of the search, with K* = M of the model and the shared errors, the residuals of a condition are

.. math:: K^*_n / M_n - 1 = F_n \, \delta + \varepsilon_n + e + o_n ,

where the changes delta are those of the linked parameters and of the shared errors, epsilon is the error of the model
at a frequency, e the scatter of the condition, and o the uncertainty of the data. Shared errors and scatters are
proportional to K* of the model and never to the noisy measured K*, with which a fit would be too low.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray, IntArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, complex_columns, multiplication, real_columns, stacked
from fourpole.models.interface import Model

#: Least relative standard deviation of K* at a frequency: the resolution of single precision.
_FLOOR = 1e-7
#: Part of the stated uncertainty of K1 that each condition has for itself, if the conditions have it in common.
_OWN_STATIC = 0.1
#: Prior of the relative scatter of conditions: its median, and the standard deviation of its logarithm; least value.
PRIOR, PRIOR_WIDTH, LEAST_CONDITION = 0.01, float(np.log(3.0)), 1e-4
#: Largest number of frequencies between which the common error of the model is linear, and its least variance.
_NODES, LEAST_COMMON = 5, 1e-10


@dataclass(frozen=True)
class Scatter:
    """Relative standard deviations of conditions about their law.

    Attributes
    ----------
    condition : (2,) tuple of float [1]
        Scatter from mounting to mounting, along and across K*: one error of Re log K* and one of Im log K* for all
        frequencies of a condition.
    frequency : (2,) tuple of float [1]
        Error of the model at each frequency, along and across K*.
    static : float [1]
        Scatter of the measured K1 about that of the model.
    common : (2,) tuple of float [1]
        Error of the model, along and across K*, that is a smooth function of frequency and the same in all conditions.
    """

    condition: tuple[float, float] = (0.0, 0.0)
    frequency: tuple[float, float] = (0.0, 0.0)
    static: float = 0.0
    common: tuple[float, float] = (0.0, 0.0)

    @property
    def variances(self) -> FloatArray:
        """Variances (7,): of conditions and frequencies along and across K*, of K1, of the common error both ways."""
        return np.array([*self.condition, *self.frequency, self.static, *self.common]) ** 2

    @classmethod
    def of(cls, variances: FloatArray) -> Scatter:
        """The scatter with these variances."""
        each = np.sqrt(variances).tolist()
        return cls((each[0], each[1]), (each[2], each[3]), each[4], (each[5], each[6]))

    @property
    def log_prior(self) -> float:
        """Logarithm of the prior of the scatter of conditions that is not zero, less a constant."""
        some = np.array([one for one in self.condition if one > 0])
        return -0.5 * float(np.sum((np.log(np.maximum(some, LEAST_CONDITION) / PRIOR) / PRIOR_WIDTH) ** 2))

    @property
    def summed(self) -> Scatter:
        """The scatter with one error of the model at each frequency, common or not."""
        along, across = np.hypot(self.frequency, self.common).tolist()
        return Scatter(self.condition, (along, across), self.static)


@dataclass(frozen=True, eq=False)
class Block(ByValue):
    """Conditions with the same number of frequencies.

    Attributes
    ----------
    places : (G,) int array
        Places of the conditions among all.
    data : StiffnessData
        Data (G, N).
    shared : (G, N, p) complex array [1]
        Change of log K* when a shared error is one standard uncertainty.
    static : (G,) float array [1], or None
        Relative standard uncertainty of K1; None if K1 is not used.
    """

    places: IntArray
    data: StiffnessData
    shared: ComplexArray
    static: FloatArray | None


@dataclass(frozen=True, eq=False)
class Rows(ByValue):
    """The linearised conditions of a block, M = 2N or, with K1, 2N + 1 rows each.

    Attributes
    ----------
    places : (G,) int array
    columns : (G, M, L) float array [1]
        Derivatives of log K*, Re and Im of each frequency in turn, and of log K1.
    off : (G, M) float array [1]
        Relative residuals, data minus model.
    own : (G, N, 2, 2) float array [1]
        Relative covariance of the data.
    static : (G,) float array [1], or None
        Relative variance of K1.
    scale : (G, N) complex array [N/m]
        K* of the model, to which residuals of K* are relative; those of K1 are relative to the measured K1.
    """

    places: IntArray
    columns: FloatArray
    off: FloatArray
    own: FloatArray
    static: FloatArray | None
    scale: ComplexArray

    def about_zero(self, linked: FloatArray) -> Rows:
        """The same linear equations for linked parameters, in place of their changes from linked parameters (B, P)."""
        moved = self.columns[..., : linked.shape[1]] @ linked[self.places][..., None]
        return replace(self, off=self.off + moved[..., 0])

    def whitened(self, variances: FloatArray) -> FloatArray:
        """Residuals (G, M) in standard uncertainties, without the scatter of a condition."""
        whole = self.own + np.diag(variances[2:4])
        each = self.off[:, : 2 * whole.shape[1]].reshape(*whole.shape[:2], 2, 1)
        found = np.linalg.solve(np.linalg.cholesky(whole), each).reshape(len(whole), -1)
        if self.static is None:
            return found
        return np.concatenate([found, self.off[:, -1:] / np.sqrt(self.static + variances[4])[:, None]], axis=1)


@dataclass(frozen=True, eq=False)
class Conditions(ByValue):
    """All conditions of a fit.

    Attributes
    ----------
    model : Model
    blocks : tuple of Block
    count : int
        Number of conditions B.
    shared : int
        Number of shared errors p.
    common : bool
        Whether the uncertainty of K1 is one error of all conditions; it is then the last of the shared errors.
    nodes : (Q,) float array
        Logarithms of angular frequencies between which the common error of the model is linear. Its values there, first
        along and then across K*, are shared errors before that of K1; empty if there is no such error.
    """

    model: Model
    blocks: tuple[Block, ...]
    count: int
    shared: int
    common: bool
    nodes: FloatArray = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(
        cls, model: Model, data: Sequence[StiffnessData], shared: Sequence[FloatArray] | None, *, common: bool
    ) -> Conditions:
        """Conditions from data of one each, and the effects (2N, p) [N/m] of the shared errors on each; checked."""
        if any(one.stiffness.ndim != 1 or one.full for one in data) or not data:
            raise ModelError("state one condition at a time, without covariance between frequencies")
        effects = shared if shared is not None else [np.zeros((2 * one.count, 0)) for one in data]
        blocks = []
        for places, together in stacked(data):
            effect = np.stack([complex_columns(effects[at]) for at in places]) / together.stiffness[..., None]
            known = model.rests and together.has_k1
            blocks.append(Block(np.array(places), together, effect, together.k1_std / together.k1 if known else None))
        common = common and any(one.static is not None for one in blocks)
        return cls(model, tuple(blocks), len(data), effects[0].shape[1] + int(common), common)

    @property
    def errors_of_model(self) -> tuple[slice, slice]:
        """Places of the values of the common error of the model among the shared errors, along and across K*."""
        end, size = self.shared - int(self.common), self.nodes.size
        return slice(end - 2 * size, end - size), slice(end - size, end)

    def with_errors_of_model(self) -> Conditions:
        """The same conditions with a common error of the model."""
        logs = np.unique(np.concatenate([np.log(one.data.omega).ravel() for one in self.blocks]))
        nodes = np.linspace(logs[0], logs[-1], min(_NODES, logs.size))
        blocks = []
        for one in self.blocks:
            each = np.stack([np.interp(np.log(one.data.omega), nodes, unit) for unit in np.eye(nodes.size)], axis=-1)
            blocks.append(replace(one, shared=np.concatenate([one.shared, each, 1j * each], axis=2)))
        return replace(self, blocks=tuple(blocks), shared=self.shared + 2 * nodes.size, nodes=nodes)

    def precision(self, variances: FloatArray) -> FloatArray:
        """Inverse variances (p,) of the shared errors."""
        found = np.ones(self.shared)
        for part, variance in zip(self.errors_of_model, variances[5:], strict=True):
            found[part] = 1.0 / max(variance, LEAST_COMMON)
        return found

    @property
    def known(self) -> int:
        """Number of data."""
        return sum(len(one.places) * (2 * one.data.count + int(one.static is not None)) for one in self.blocks)

    def linearised(self, linked: FloatArray, errors: FloatArray) -> list[Rows]:
        """The conditions about linked parameters (B, P) and shared errors (p,), block by block."""
        values, slopes = self.model.unlink(linked)
        errors = np.broadcast_to(errors, (self.count, self.shared))
        return [self._rows(one, values[one.places], slopes[one.places], errors[one.places]) for one in self.blocks]

    def _rows(self, block: Block, values: FloatArray, slopes: FloatArray, errors: FloatArray) -> Rows:
        stiffness, shown, k1 = self._shown(block, values, errors)
        by_value = self.model.on(block.data).derivative(values, block.data.omega)
        by_linked = by_value * (slopes[:, None, :] / stiffness[..., None])
        last = np.zeros((*stiffness.shape, int(self.common)))
        columns = real_columns(np.concatenate([by_linked, block.shared, last], axis=2))
        turn = multiplication(1.0 / shown)
        own = turn @ block.data.covariance @ np.swapaxes(turn, 2, 3) + _FLOOR**2 * np.eye(2)
        static = None
        if block.static is not None:
            row = np.zeros_like(columns[:, :1])
            row[:, 0, : values.shape[1]] = self.model.static_derivative(values) * slopes / block.data.k1[:, None]
            if self.common:
                row[:, 0, -1] = block.static * k1 / block.data.k1
            columns = np.concatenate([columns, row], axis=1)
            static = (block.static * (_OWN_STATIC if self.common else 1.0)) ** 2
        return Rows(block.places, columns, _off(block, shown, k1, shown), own, static, shown)

    def residuals(self, linked: FloatArray, errors: FloatArray, about: Sequence[Rows]) -> list[FloatArray]:
        """Residuals (G, M) of each block at another point, relative to K* of the rows `about`.

        The shared errors are (p,), or (B, p) if each condition has others.
        """
        values, _ = self.model.unlink(linked)
        errors = np.broadcast_to(errors, (self.count, self.shared))
        found = []
        for block, rows in zip(self.blocks, about, strict=True):
            _, shown, k1 = self._shown(block, values[block.places], errors[block.places])
            found.append(_off(block, shown, k1, rows.scale))
        return found

    def _shown(
        self, block: Block, values: FloatArray, errors: FloatArray
    ) -> tuple[ComplexArray, ComplexArray, FloatArray]:
        """K* of the model, and K* and K1 with the shared errors."""
        stiffness = self.model.on(block.data).stiffness(values, block.data.omega)
        shown = stiffness * np.exp((block.shared @ errors[:, : block.shared.shape[2], None])[..., 0])
        k1 = self.model.static_stiffness(values)
        if self.common and block.static is not None:
            k1 = k1 * np.exp(block.static * errors[:, -1])
        return stiffness, shown, k1


def _off(block: Block, shown: ComplexArray, k1: FloatArray, scale: ComplexArray) -> FloatArray:
    """Relative residuals (G, M) of a block."""
    off = real_columns(((block.data.stiffness - shown) / scale)[..., None])[..., 0]
    if block.static is None:
        return off
    return np.concatenate([off, (1.0 - k1 / block.data.k1)[:, None]], axis=1)


@dataclass(frozen=True, eq=False)
class Weights(ByValue):
    """The inverse V^-1 of the covariance of the rows of each condition of a block.

    The scatter of a condition adds two unknowns, one of Re log K* and one of Im log K*. They are eliminated, so that
    no matrix over the frequencies is needed.

    Attributes
    ----------
    blocks : (G, N, 2, 2) float array
        Inverse of the covariance without the scatter of the condition.
    inner : (G, 2, 2) float array
        (1/s² + sum of `blocks`)^-1 for scatters s; 0 without scatter.
    static : (G,) float array, or None
        Inverse variance of K1.
    logdet : (G,) float array
        Logarithm of the determinant of V.
    """

    blocks: FloatArray
    inner: FloatArray
    static: FloatArray | None
    logdet: FloatArray

    @classmethod
    def of(cls, rows: Rows, variances: FloatArray) -> Weights:
        """The weights of rows with the variances of a scatter."""
        condition, whole = np.diag(variances[:2]), rows.own + np.diag(variances[2:4])
        blocks = np.linalg.inv(whole)
        spread = np.eye(2) + np.sum(blocks, axis=1) @ condition
        logdet = np.sum(np.linalg.slogdet(whole)[1], axis=1) + np.linalg.slogdet(spread)[1]
        weight = None
        if rows.static is not None:
            weight = 1.0 / (rows.static + variances[4])
            logdet = logdet - np.log(weight)
        return cls(blocks, condition @ np.linalg.inv(spread), weight, logdet)

    def times(self, columns: FloatArray) -> FloatArray:
        """V^-1 times columns (G, M, k)."""
        groups, count = self.blocks.shape[:2]
        each = self.blocks @ columns[:, : 2 * count].reshape(groups, count, 2, -1)
        each = each - self.blocks @ self.offsets(columns)[:, None]
        found = each.reshape(groups, 2 * count, -1)
        if self.static is None:
            return found
        return np.concatenate([found, self.static[:, None, None] * columns[:, -1:]], axis=1)

    def chi2(self, off: FloatArray) -> FloatArray:
        """r^T V^-1 r (G,) of each condition, for residuals r (G, M)."""
        return np.asarray(np.sum(off * self.times(off[..., None])[..., 0], axis=1))

    def log_density(self, off: FloatArray, scale: ComplexArray) -> FloatArray:
        """Log density (G,) of K* whose residuals (G, M) are relative to `scale` (G, N), less one number of all laws."""
        return np.asarray(-0.5 * (self.chi2(off) + self.logdet) - 2.0 * np.sum(np.log(np.abs(scale)), axis=1))

    def offsets(self, columns: FloatArray) -> FloatArray:
        """The expected errors (G, 2, k) of the conditions, Re and Im of log K*, for residuals (G, M, k)."""
        groups, count = self.blocks.shape[:2]
        each = self.blocks @ columns[:, : 2 * count].reshape(groups, count, 2, -1)
        return np.asarray(self.inner @ np.sum(each, axis=1))

    @property
    def diagonal(self) -> FloatArray:
        """Diagonal (G, 2N) of V^-1, of the rows of K*."""
        lost = self.blocks @ self.inner[:, None] @ self.blocks
        return np.asarray(np.diagonal(self.blocks - lost, 0, 2, 3).reshape(len(lost), -1))
