r"""Weighted least squares with nested unknowns: of each family, of each specimen that has families, and of all rows.

.. math:: y_i = x_i^\top \alpha_f + b_i \beta_s + z_i^\top \gamma

The unknowns of a family are eliminated first, then that of its specimen, so that the cost is linear in the number of
rows, and no matrix is larger than the unknowns of one family or of all rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray

#: Directions with less than this fraction of the largest weight are not determined; their unknowns are zero.
_UNDETERMINED = 1e-12


@dataclass(frozen=True, eq=False)
class Nested(ByValue):
    """Rows of a linear model with nested unknowns.

    Attributes
    ----------
    own : (N, P) float array
        Columns of the family; zero where a family has fewer unknowns.
    bend : (N,) float array
        Column of the specimen.
    common : (N, M) complex array
        Columns of all rows.
    family : (N,) int array
        Number of the family, from 0.
    specimen : (F,) int array
        Number of the specimen of each family, from 0.
    """

    own: FloatArray
    bend: FloatArray
    common: ComplexArray
    family: np.ndarray
    specimen: np.ndarray

    @cached_property
    def _order(self) -> tuple[np.ndarray, np.ndarray]:
        """Order of the rows by family, and the first row of each family in that order; each family has rows."""
        order = np.argsort(self.family, kind="stable")
        return order, np.searchsorted(self.family[order], np.arange(self.specimen.size))

    def of_families(self, values: np.ndarray) -> np.ndarray:
        """Sums of values (N, ...) over the rows of each family (F, ...)."""
        order, first = self._order
        return np.asarray(np.add.reduceat(values[order], first, axis=0))

    def of_specimens(self, values: np.ndarray) -> np.ndarray:
        """Sums of values (F, ...) over the families of each specimen (S, ...)."""
        order = np.argsort(self.specimen, kind="stable")
        first = np.searchsorted(self.specimen[order], np.arange(int(self.specimen.max()) + 1))
        return np.asarray(np.add.reduceat(values[order], first, axis=0))


@dataclass(frozen=True, eq=False)
class NestedFit(ByValue):
    """Weighted least-squares solution.

    Attributes
    ----------
    alpha, beta, gamma : (F, P), (S,), (M,) complex arrays
        Unknowns of the families, of the specimens and of all rows.
    inverse : (F, P, P) float array
        Inverse of the normal matrix of each family.
    by_bend, by_common : (F, P) float array, (F, P, M) complex array
        Change of `alpha` per unit of `beta` and of `gamma`, with opposite sign.
    of_bend, of_common : (S,) float array, (M, M) complex array
        Inverses of the normal matrices of `beta`, without the families, and of `gamma`, without both.
    bend_by_common : (S, M) complex array
        Change of `beta` per unit of `gamma`, with opposite sign.
    """

    alpha: ComplexArray
    beta: ComplexArray
    gamma: ComplexArray
    inverse: FloatArray
    by_bend: FloatArray
    by_common: ComplexArray
    of_bend: FloatArray
    of_common: ComplexArray
    bend_by_common: ComplexArray

    def predicted(self, rows: Nested) -> ComplexArray:
        """Values (N,) of the model."""
        alpha, beta = self.alpha[rows.family], self.beta[rows.specimen[rows.family]]
        return np.asarray(np.sum(rows.own * alpha, axis=1) + rows.bend * beta + rows.common @ self.gamma)

    def levers(self, rows: Nested) -> FloatArray:
        """Variance (N,) of `predicted` for data of unit variance over their weight."""
        family = rows.family
        specimen = rows.specimen[family]
        bend = rows.bend - np.sum(rows.own * self.by_bend[family], axis=1)
        common = rows.common - np.einsum("ip,ipm->im", rows.own, self.by_common[family])
        common = common - bend[:, None] * self.bend_by_common[specimen]
        of_family = np.einsum("ip,ipq,iq->i", rows.own, self.inverse[family], rows.own)
        of_all = np.sum((common @ self.of_common) * common.conj(), axis=1).real
        return np.asarray(of_family + bend**2 * self.of_bend[specimen] + of_all)


def nested_fit(rows: Nested, values: ComplexArray, weights: FloatArray, prior: FloatArray) -> NestedFit:
    """The unknowns with the least weighted sum of squares; `prior` (M,) is added to the normal matrix of `gamma`.

    Examples
    --------
    >>> rows = Nested(
    ...     np.ones((4, 1)), np.array([0.0, 1, 0, 1]), np.zeros((4, 1)), np.array([0, 0, 1, 1]), np.zeros(2, int)
    ... )
    >>> found = nested_fit(rows, np.array([1.0, 2, 5, 6]), np.ones(4), np.ones(1))
    >>> found.alpha[:, 0].round(9).real.tolist(), found.beta.round(9).real.tolist()
    ([1.0, 5.0], [1.0])
    """
    weighted = weights[:, None] * rows.own
    inverse = np.linalg.pinv(
        rows.of_families(weighted[:, :, None] * rows.own[:, None, :]), rcond=_UNDETERMINED, hermitian=True
    )
    bend = rows.of_families(weighted * rows.bend[:, None])
    common = rows.of_families(weighted[:, :, None] * rows.common[:, None, :])
    by_value = np.einsum("fpq,fq->fp", inverse, rows.of_families(weighted * values[:, None]))
    by_bend, by_common = np.einsum("fpq,fq->fp", inverse, bend), inverse @ common

    here = weights * rows.bend
    whole = rows.of_families(here * rows.bend)
    left = rows.of_specimens(whole - np.sum(bend * by_bend, axis=1))
    known = left > _UNDETERMINED * rows.of_specimens(whole)
    of_bend = np.divide(1.0, left, out=np.zeros(left.size), where=known)
    across = rows.of_families(here[:, None] * rows.common) - np.einsum("fp,fpm->fm", bend, by_common)
    across = rows.of_specimens(across)
    right = rows.of_specimens(rows.of_families(here * values) - np.sum(bend * by_value, axis=1))

    turned = rows.common.conj().T
    normal = turned @ (weights[:, None] * rows.common) + np.diag(prior)
    normal = normal - np.einsum("fpm,fpn->mn", common.conj(), by_common)
    normal = normal - across.conj().T @ (of_bend[:, None] * across)
    target = turned @ (weights * values) - np.einsum("fpm,fp->m", common.conj(), by_value)
    target = target - across.conj().T @ (of_bend * right)
    of_common = np.linalg.pinv(normal, rcond=_UNDETERMINED, hermitian=True)
    gamma = of_common @ target
    beta = of_bend * (right - across @ gamma)
    alpha = by_value - by_bend * beta[rows.specimen][:, None] - by_common @ gamma
    bend_by_common = of_bend[:, None] * across
    return NestedFit(alpha, beta, gamma, inverse, by_bend, by_common, of_bend, of_common, bend_by_common)
