r"""Normal equations of parameters that follow linear laws over conditions, without a matrix over all conditions.

A condition c has a local vector of L numbers: its linked parameters, then the shared errors. Each linked parameter p is
either :math:`\sum_k \Phi^{(p)}_{ck}\,\beta^{(p)}_k`, or one unknown of this condition alone, which is eliminated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray, IntArray

#: Ridge of the normal equations, scaled to a diagonal of 1, in a search; least relative eigenvalue of a covariance.
_RIDGE, _LEAST_EIGENVALUE = 1e-13, 1e-13


@dataclass(frozen=True, eq=False)
class Laws(ByValue):
    """The laws of all parameters.

    Attributes
    ----------
    designs : tuple of P (B, K) float arrays or None
        Matrix of the law of each linked parameter; None for a parameter that each condition has for itself.
    shared : int
        Number of shared errors p.
    count : int
        Number of conditions B.
    expected, precision : (U,) float arrays, optional
        Mean and inverse variance of a prior of the coefficients; by default there is none.
    error_precision : (p,) float array, optional
        Inverse variance of the shared errors, whose mean is 0; by default 1.
    """

    designs: tuple[FloatArray | None, ...]
    shared: int
    count: int
    expected: FloatArray | None = None
    precision: FloatArray | None = None
    error_precision: FloatArray | None = None

    @cached_property
    def prior(self) -> tuple[FloatArray, FloatArray]:
        """Mean and inverse variance (U + p,) of the priors."""
        none = np.zeros(self.coefficients)
        mean, precision = (none if one is None else one for one in (self.expected, self.precision))
        errors = np.ones(self.shared) if self.error_precision is None else self.error_precision
        return np.append(mean, np.zeros(self.shared)), np.append(precision, errors)

    def prior_chi2(self, unknowns: FloatArray) -> float:
        """Chi-square of unknowns (U + p,) against their priors."""
        mean, precision = self.prior
        return float(precision @ (unknowns - mean) ** 2)

    @cached_property
    def own(self) -> list[int]:
        """Places, in the local vector, of the parameters that each condition has for itself."""
        return [at for at, one in enumerate(self.designs) if one is None]

    @cached_property
    def ruled(self) -> list[int]:
        """Places, in the local vector, of the parameters that follow laws."""
        return [at for at, one in enumerate(self.designs) if one is not None]

    @cached_property
    def matrices(self) -> list[FloatArray]:
        """Matrices of the laws."""
        return [one for one in self.designs if one is not None]

    @cached_property
    def sizes(self) -> list[int]:
        """Number of coefficients of each law."""
        return [one.shape[1] for one in self.matrices]

    @cached_property
    def parts(self) -> list[slice]:
        """Places of the coefficients of each law among all unknowns of the laws and shared errors."""
        ends = np.cumsum([0, *self.sizes]).tolist()
        return [slice(low, high) for low, high in pairwise(ends)]

    @property
    def coefficients(self) -> int:
        """Number of coefficients U of all laws."""
        return sum(self.sizes)

    def gathered(self, right: FloatArray) -> FloatArray:
        """The sum (U + p,) over the conditions of local vectors (B, g) of the laws and shared errors."""
        laws = [matrix.T @ right[:, at] for at, matrix in enumerate(self.matrices)]
        return np.concatenate([*laws, np.sum(right[:, len(self.ruled) :], axis=0)])

    def normal(self, gram: FloatArray) -> FloatArray:
        """The sum (U + p, U + p) over the conditions of local matrices (B, g, g) of the laws and shared errors."""
        size, laws = self.coefficients, len(self.ruled)
        found = np.empty((size + self.shared, size + self.shared))
        found[size:, size:] = np.sum(gram[:, laws:, laws:], axis=0)
        for p, (matrix, part) in enumerate(zip(self.matrices, self.parts, strict=True)):
            found[part, size:] = matrix.T @ gram[:, p, laws:]
            found[size:, part] = found[part, size:].T
            for q in range(p, laws):
                found[part, self.parts[q]] = matrix.T @ (gram[:, p, q, None] * self.matrices[q])
                found[self.parts[q], part] = found[part, self.parts[q]].T
        return found

    def spread(self, whole: FloatArray) -> FloatArray:
        """Local vectors (B, g) of unknowns (U + p,)."""
        laws = [matrix @ whole[part] for matrix, part in zip(self.matrices, self.parts, strict=True)]
        rest = np.broadcast_to(whole[self.coefficients :], (self.count, self.shared))
        return np.concatenate([*(one[:, None] for one in laws), rest], axis=1)

    def covariances(self, whole: FloatArray) -> FloatArray:
        """Local covariances (B, g, g) of a covariance (U + p, U + p) of the unknowns."""
        size, laws = self.coefficients, len(self.ruled)
        found = np.empty((self.count, laws + self.shared, laws + self.shared))
        found[:, laws:, laws:] = whole[size:, size:]
        for p, (matrix, part) in enumerate(zip(self.matrices, self.parts, strict=True)):
            found[:, p, laws:] = matrix @ whole[part, size:]
            found[:, laws:, p] = found[:, p, laws:]
            for q in range(p, laws):
                found[:, p, q] = np.sum((matrix @ whole[part, self.parts[q]]) * self.matrices[q], axis=1)
                found[:, q, p] = found[:, p, q]
        return found

    def diagonal(self, squares: FloatArray) -> FloatArray:
        """The diagonal (U + p,) of `normal`, from those (B, g) of the local matrices."""
        laws = [np.sum(matrix**2 * squares[:, at, None], axis=0) for at, matrix in enumerate(self.matrices)]
        return np.concatenate([*laws, np.sum(squares[:, len(self.ruled) :], axis=0)])


@dataclass(frozen=True, eq=False)
class Normal(ByValue):
    """The normal equations of a linearised fit.

    Attributes
    ----------
    laws : Laws
    gram : (B, L, L) float array
        F^T V^-1 F of each condition.
    right : (B, L) float array
        F^T V^-1 r of each condition.
    unknowns : (U + p,) float array
        Coefficients and shared errors about which the fit is linearised.
    """

    laws: Laws
    gram: FloatArray
    right: FloatArray
    unknowns: FloatArray

    def step(self, damping: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """Changes (U + p,) of the coefficients and shared errors, and of all local vectors (B, L)."""
        normal, right, back = self._reduced(damping)
        found = _scaled_solve(normal, right)
        return found, self._local(found, back)

    def solved(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Covariance (U + p, U + p) with a small ridge, which is fast, and the changes of `step`."""
        normal, right, back = self._reduced(0.0)
        whole = _scaled_solve(normal, np.eye(len(normal)))
        found = whole @ right
        return whole, found, self._local(found, back)

    def covariance(self) -> FloatArray:
        """Covariance (U + p, U + p) of the coefficients, law by law, and of the shared errors."""
        return inverse(self._reduced(0.0)[0])

    def local_covariance(self, whole: FloatArray) -> FloatArray:
        """Covariances (B, L, L) of the local vectors, from that of the coefficients and shared errors."""
        few, own = self._few, np.array(self.laws.own, dtype=int)
        found = np.empty(self.gram.shape)
        found[:, few[:, None], few] = part = self.laws.covariances(whole)
        if own.size:
            block = inverse(self.gram[:, own[:, None], own])
            slope = block @ self.gram[:, own[:, None], few]
            found[:, own[:, None], own] = block + slope @ part @ np.swapaxes(slope, 1, 2)
            found[:, own[:, None], few] = -slope @ part
            found[:, few[:, None], own] = -part @ np.swapaxes(slope, 1, 2)
        return found

    def reduction(self, step: FloatArray, local: FloatArray) -> float:
        """Reduction of chi-square that the linearised model predicts for a step."""
        mean, precision = self.laws.prior
        slope = float(np.sum(self.right * local) - step @ (precision * (self.unknowns - mean)))
        bend = float(np.einsum("bi,bij,bj->", local, self.gram, local) + precision @ step**2)
        return 2 * slope - bend

    @cached_property
    def _few(self) -> IntArray:
        """Places, in the local vector, of what follows laws, and of the shared errors."""
        laws = self.laws
        return np.array([*laws.ruled, *range(len(laws.designs), len(laws.designs) + laws.shared)], dtype=int)

    def _reduced(self, damping: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The equations of laws and shared errors, and (B, o, g + 1) from which the unknowns of conditions follow."""
        few, own, laws = self._few, np.array(self.laws.own, dtype=int), self.laws
        gram, right = self.gram[:, few[:, None], few], self.right[:, few]
        diagonal = laws.diagonal(np.diagonal(gram, 0, 1, 2)) if damping else 0.0
        back = np.zeros((laws.count, 0, few.size + 1))
        if own.size:
            block = self.gram[:, own[:, None], own]
            at = np.arange(own.size)
            block[:, at, at] *= 1 + damping
            across = self.gram[:, own[:, None], few]
            back = inverse(block) @ np.concatenate([across, self.right[:, own, None]], axis=2)
            taken = np.swapaxes(across, 1, 2) @ back
            gram, right = gram - taken[..., :-1], right - taken[..., -1]
        normal, gathered = laws.normal(gram), laws.gathered(right)
        mean, precision = laws.prior
        normal[np.diag_indices_from(normal)] += precision + damping * (diagonal + precision)
        return normal, gathered - precision * (self.unknowns - mean), back

    def _local(self, found: FloatArray, back: FloatArray) -> FloatArray:
        """All local vectors (B, L) of a step of laws and shared errors."""
        local = np.empty(self.right.shape)
        local[:, self._few] = part = self.laws.spread(found)
        if self.laws.own:
            local[:, self.laws.own] = back[..., -1] - (back[..., :-1] @ part[..., None])[..., 0]
        return local


def root_of(covariance: FloatArray) -> FloatArray:
    """L (n, n) with L L^T equal to a covariance, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def inverse(matrices: FloatArray) -> FloatArray:
    """Pseudo-inverses (..., n, n) of symmetric matrices, after scaling to a diagonal of 1."""
    diagonal = np.diagonal(matrices, 0, -2, -1)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    both = scale[..., :, None] * scale[..., None, :]
    return np.asarray(np.linalg.pinv(matrices * both, rcond=_LEAST_EIGENVALUE, hermitian=True) * both)


def _scaled_solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """The solution of symmetric equations, with a small ridge after scaling to a diagonal of 1."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += _RIDGE
    each = scale if right.ndim == 1 else scale[:, None]
    return np.asarray(np.linalg.solve(scaled, right * each) * each)
