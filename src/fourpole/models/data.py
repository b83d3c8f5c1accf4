"""The data that a model is fitted to: K* over frequency with its covariance, and the static stiffness K1."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.errors import ModelError

#: Relative uncertainty that is added to every K*: the resolution of single precision.
_FLOOR = 1e-7
#: Largest number of times that a fit takes the shared errors at its K*, and begins again.
_SCALINGS = 8
#: Second-order effect of shared errors that is negligible, in standard uncertainties.
_NEGLIGIBLE = 0.1
#: Distance of K* of a model, in standard uncertainties from the shared errors, beyond which they do not explain it.
_REACH = 5.0
#: Decades of a band that no machine has at one temperature: the data are a master curve, over reduced frequency.
MASTER_DECADES = 6.0
#: A decade in natural logarithms.
DECADE = np.log(10.0)
#: Largest entry of a covariance that is accepted [N²/m²].
_LARGEST = 1e60
#: Lowest frequency of which a static ramp says something, over the lowest in its weighted sum.
_SLOWEST = 10.0

#: What is fitted to data.
_Found = TypeVar("_Found")


@dataclass(frozen=True, eq=False)
class StiffnessData(ByValue):
    """K* of one or many conditions at as many frequencies.

    Parameters
    ----------
    omega : (N,) or (..., N) float array [rad/s]
        Angular frequencies, > 0: either common to all conditions, or one row for each condition.
    stiffness : (..., N) complex array [N/m]
    covariance : (..., N, 2, 2) or (..., 2N, 2N) float array [N²/m²]
        Covariance of Re K* and Im K*: a 2 x 2 matrix for each frequency, or one matrix over all frequencies in the
        order Re, Im of the first, Re, Im of the second, and so on.
    k1, k1_std : (...,) float arrays [N/m]
        Static stiffness and its standard uncertainty; not-a-number where K1 is not known.
    relative : (..., N, p) complex array, optional [1]
        Changes of K* over K* when one of p errors that all frequencies share is one standard uncertainty. Their part of
        the covariance is proportional to K*; see `at`.
    reference : (..., N) complex array, optional [N/m]
        K* of that part of the covariance; by default K* itself.
    recorded : (...,) array of callables, optional
        For each condition a function of K* (N,) [N/m] of a model that returns the data as the recordings have them
        near that K*; see `models.problem.Recorded`. Without it, shared errors act in proportion to K*.
    amplitude : (N,) or (..., N) float array, optional [m]
        0-to-peak amplitude of the deflection, for models whose K* depends on it.
    static_omega, static_weights : (..., J) float and complex arrays, optional [rad/s], [1]
        Angular frequencies and weights for which K1 is the real part of the weighted sum of K*, as in a static test of
        finite duration; see `models.ramp`. Without them K1 is K* at zero frequency.

    Examples
    --------
    >>> data = StiffnessData.of([60.0, 90.0], [2e5 + 4e4j, 2.1e5 + 5e4j], 1e3)
    >>> data.covariance.shape
    (2, 2, 2)
    """

    omega: FloatArray
    stiffness: ComplexArray
    covariance: FloatArray
    k1: FloatArray
    k1_std: FloatArray
    relative: ComplexArray | None = None
    reference: ComplexArray | None = None
    recorded: np.ndarray | None = None
    amplitude: FloatArray | None = None
    static_omega: FloatArray | None = None
    static_weights: ComplexArray | None = None

    @classmethod
    def of(
        cls,
        omega: ArrayLike,
        stiffness: ArrayLike,
        std: ArrayLike | None = None,
        *,
        covariance: ArrayLike | None = None,
        shared: ArrayLike | None = None,
        k1: ArrayLike = np.nan,
        k1_std: ArrayLike = np.nan,
    ) -> StiffnessData:
        """The data of one or more conditions, checked.

        Parameters
        ----------
        omega, stiffness, k1, k1_std
            The attributes of the same names.
        std : float array [N/m]
            Standard uncertainty of Re K* and of Im K*; broadcasts with K*.
        covariance : float array [N²/m²]
            Covariance, in place of `std`.
        shared : (..., 2N, p) float array [N/m], optional
            Changes of Re K* and Im K* of each frequency in turn when one of p errors that all frequencies share, such
            as the gain of a sensor, is one standard uncertainty. Their covariance is added.

        Raises
        ------
        ModelError
            If shapes do not fit, a number is missing, or `covariance` is not a covariance matrix.
        """
        w, k = np.atleast_1d(np.asarray(omega, dtype=float)), np.asarray(stiffness, dtype=complex)
        if k.ndim == 0 or w.shape not in (k.shape, k.shape[-1:]):
            raise ModelError(f"K* has the shape {k.shape}, the frequencies {w.shape}")
        if not (np.all(np.isfinite(k)) and np.all(w > 0)):
            raise ModelError(
                "K* must be known at every frequency, and frequencies must be positive: remove the other rows"
            )
        if (std is None) == (covariance is None):
            raise ModelError("state std or covariance of K*, one of the two")
        if covariance is None:
            spread = np.broadcast_to(np.asarray(std, dtype=float), k.shape)
            whole: FloatArray = spread[..., None, None] ** 2 * np.eye(2)
        else:
            whole = np.asarray(covariance, dtype=float)
        _check_covariance(whole, k.shape)
        known = [np.broadcast_to(np.asarray(x, dtype=float), k.shape[:-1]) for x in (k1, k1_std)]
        found = cls(w, k, whole, known[0], known[1])
        return found if shared is None else found.with_errors(np.asarray(shared, dtype=float))

    def with_errors(self, shared: FloatArray) -> StiffnessData:
        """The same data with the errors (..., 2N, p) that all frequencies share; see `of`."""
        relative = complex_columns(shared) / self.stiffness[..., None]
        return replace(self, covariance=with_shared(self.covariance, shared, self.stiffness.shape), relative=relative)

    @property
    def count(self) -> int:
        """Number of frequencies N."""
        return self.stiffness.shape[-1]

    @property
    def full(self) -> bool:
        """Whether the covariance has entries between different frequencies."""
        return self.covariance.ndim == self.stiffness.ndim + 1

    @cached_property
    def has_k1(self) -> bool:
        """Whether at least one condition has a known static stiffness."""
        return bool(np.any(np.isfinite(self.k1) & np.isfinite(self.k1_std)))

    @property
    def numbers(self) -> int:
        """Number of data of each condition: two for each frequency, and K1 if it is known."""
        return 2 * self.count + int(self.has_k1)

    @property
    def ramp(self) -> dict[str, Any]:
        """The frequencies and weights of a static test of finite duration, by the names of the attributes, if any."""
        if self.static_omega is None or self.static_weights is None:
            return {}
        return {"static_omega": self.static_omega, "static_weights": self.static_weights}

    @property
    def lowest(self) -> float:
        """Lowest angular frequency [rad/s] of the data, that of a static test of finite duration included."""
        band = float(self.omega.min())
        return band if self.static_omega is None else min(band, _SLOWEST * float(self.static_omega.min()))

    def static_share(self, times: FloatArray) -> FloatArray:
        """Share (T,) [1] of arms with relaxation times (T,) [s] in K1 of one condition; 0 at zero frequency."""
        if self.static_omega is None or self.static_weights is None:
            return np.zeros(times.shape)
        return np.asarray(np.sum((self.static_weights[:, None] * relaxation(self.static_omega, times)).real, axis=0))

    @property
    def _nominal(self) -> ComplexArray:
        """K* (..., N) [N/m] to which the part of the covariance by shared errors belongs."""
        return self.stiffness if self.reference is None else self.reference

    @property
    def shared_variance(self) -> FloatArray:
        """Variance (..., N) of K* over its squared modulus by the shared errors [1]; 0 without them."""
        return np.zeros(self.stiffness.shape) if self.relative is None else np.sum(np.abs(self.relative) ** 2, axis=-1)

    def flat(self) -> StiffnessData:
        """The same data with all conditions along one axis (B, N), and their covariance as it is."""
        count = self.count
        tail = self.covariance.shape[-2:] if self.full else (count, 2, 2)
        return StiffnessData(
            self.omega.reshape(-1, count) if self.omega.ndim > 1 else self.omega,
            self.stiffness.reshape(-1, count),
            np.broadcast_to(self.covariance, (*self.stiffness.shape[:-1], *tail)).reshape(-1, *tail),
            self.k1.reshape(-1),
            self.k1_std.reshape(-1),
            amplitude=flat_rows(self.amplitude),
            **{
                name: np.broadcast_to(one, (*self.k1.shape, one.shape[-1])).reshape(-1, one.shape[-1])
                for name, one in self.ramp.items()
            },
        )

    def conditions(self, rows: np.ndarray | int) -> StiffnessData:
        """One or some of the conditions (B, N), each once or several times; the covariance stays that of all."""
        found = {name: getattr(self, name)[rows] for name in ("stiffness", "k1", "k1_std", *self.ramp)}
        common = {name: getattr(self, name) for name in ("omega", "amplitude")}
        found |= {name: one if one is None or one.ndim < 2 else one[rows] for name, one in common.items()}
        return replace(self, **found)

    def at(self, stiffness: ComplexArray) -> StiffnessData:
        r"""The same data with the shared errors of K* = `stiffness`, that of a model.

        A gain off by :math:`\epsilon` changes K* by :math:`\epsilon K^*`. With the noisy measured K* in this product a
        least-squares fit is lower than the data: it takes smaller data for more certain ones.

        Parameters
        ----------
        stiffness : (..., N) complex array [N/m]
            K* of the model at the frequencies of the data.

        Returns
        -------
        StiffnessData
            The data themselves, if they have no shared errors. From recordings, K* too is that near the model.

        References
        ----------
        R. W. Peelle, "Peelle's pertinent puzzle", Oak Ridge National Laboratory, 1987; G. D'Agostini, "On the use of
        the covariance matrix to fit correlated data", Nucl. Instrum. Methods A 346, 1994.

        Examples
        --------
        >>> data = StiffnessData.of([60.0], [1e5 + 0j], 0.0, shared=[[1e3], [0.0]])
        >>> data.at(np.array([2e5 + 0j])).covariance.tolist()
        [[4000000.0, 0.0], [0.0, 0.0]]
        """
        now = np.asarray(stiffness)
        stale = self._stale(now)
        if self.relative is None or not stale.any():
            return self
        if self.recorded is not None:
            return self._as_recorded(self.recorded, now, stale)
        held, there = (real_columns(self.relative * k[..., None]) for k in (self._nominal, now))
        more = there @ np.swapaxes(there, -1, -2) - held @ np.swapaxes(held, -1, -2)
        return replace(self, covariance=self.covariance + more, reference=now)

    def settled(
        self,
        found: _Found,
        stiffness: Callable[[_Found], ComplexArray],
        again: Callable[[StiffnessData, _Found], _Found],
    ) -> tuple[StiffnessData, _Found]:
        """The data with the shared errors at K* of a fit to them, and this fit: each is taken anew until they agree."""
        data = self
        for _ in range(_SCALINGS):
            there = data.at(stiffness(found))
            if there is data:
                break
            data, found = there, again(there, found)
        return data, found

    def eased(self) -> StiffnessData:
        """The same data with the second order of the shared errors as noise.

        A first model, at which the shared errors are then taken, need not be nearer to the data.
        """
        if self.relative is None:
            return self
        size = np.abs(self.stiffness)
        if self.recorded is not None:  # near a resonance of the rig K* itself may be far too small
            size = np.maximum(size, np.median(size, axis=-1, keepdims=True))
        return self.with_noise((size * self.shared_variance) ** 2)

    def with_noise(self, variance: FloatArray) -> StiffnessData:
        """The same data with a further variance (..., N) [N²/m²] of Re K* and of Im K* of each frequency by itself."""
        if self.full:
            more = np.repeat(variance, 2, axis=-1)[..., None] * np.eye(2 * self.count)
        else:
            more = variance[..., None, None] * np.eye(2)
        return replace(self, covariance=self.covariance + more)

    def _stale(self, now: ComplexArray) -> BoolArray:
        """Whether the shared errors of each condition (...,) have to be taken anew at K* = `now`.

        They have not if their second order is below the noise. Recordings are not taken near a K* that no shared error
        can explain: the data say little about it.
        """
        if self.relative is None:
            return np.zeros(now.shape[:-1], dtype=bool)
        before = self._nominal
        moved = np.abs(np.divide(now, before, out=np.full(now.shape, 2.0 + 0j), where=before != 0) - 1)
        whitened = self.whitened(self.whitener(), (now * moved**2)[..., None])[..., 0]
        stale = np.any(np.abs(whitened) > _NEGLIGIBLE, axis=-1) | (self.reference is None)
        if self.recorded is not None and self.reference is not None:
            reach = _REACH * np.sqrt(self.shared_variance).max(axis=-1)
            stale &= moved.max(axis=-1) < reach + _FLOOR
        return np.asarray(stale)

    def _as_recorded(self, recorded: np.ndarray, stiffness: ComplexArray, stale: BoolArray) -> StiffnessData:
        """The data with those of some conditions near K* of a model, as recorded."""
        assert self.relative is not None
        places = list(zip(*np.nonzero(np.atleast_1d(stale)), strict=True)) if stale.ndim else [()]
        found = {place: recorded[place](stiffness[place]) for place in places}
        width = max(self.relative.shape[-1], *(one.relative.shape[-1] for one in found.values()))
        made: dict[str, Any] = {
            "stiffness": self.stiffness.copy(),
            "covariance": self.covariance.copy(),
            "relative": np.zeros((*self.stiffness.shape, width), dtype=complex),
            "reference": self._nominal.copy(),
        }
        made["relative"][..., : self.relative.shape[-1]] = self.relative
        for place, one in found.items():
            made["relative"][place] = 0.0
            made["relative"][place][..., : one.relative.shape[-1]] = one.relative
            for name in ("stiffness", "covariance", "reference"):
                made[name][place] = getattr(one, name)
        return replace(self, **made)

    def whitener(self) -> FloatArray:
        """Matrices W (..., N, 2, 2) or (..., 2N, 2N) with W S W^T = 1, where S is the covariance.

        ModelError if S is not positive definite, as one is whose uncertainties are many times K*.
        """
        size = np.abs(self.stiffness) * _FLOOR
        if self.full:
            try:
                return np.asarray(np.linalg.inv(np.linalg.cholesky(self.with_noise(size**2).covariance)))
            except np.linalg.LinAlgError:
                raise ModelError(
                    "the covariance of K* is not positive definite: are the stated uncertainties of the channels right?"
                ) from None
        # The closed form of the inverse Cholesky factor is many times as fast for many 2 x 2 matrices.
        first = np.sqrt(self.covariance[..., 0, 0] + size**2)
        share = self.covariance[..., 1, 0] / first
        second = np.sqrt(self.covariance[..., 1, 1] + size**2 - share**2)
        inverse = np.zeros(self.covariance.shape)
        inverse[..., 0, 0], inverse[..., 1, 1] = 1.0 / first, 1.0 / second
        inverse[..., 1, 0] = -share / (first * second)
        return inverse

    def whitened(self, whiten: FloatArray, values: ComplexArray) -> FloatArray:
        """Complex values (..., N, k) [N/m] in standard uncertainties (..., 2N, k) [1], by a whitener of these data."""
        if self.full:
            return np.asarray(whiten @ real_columns(values))
        found = np.empty((*values.shape[:-1], 2, values.shape[-1]))
        for row in (0, 1):  # without correlation the second product is skipped
            found[..., row, :] = whiten[..., row, row, None] * (values.imag if row else values.real)
            across = whiten[..., row, 1 - row, None]
            if across.any():
                found[..., row, :] += across * (values.real if row else values.imag)
        return found.reshape(*values.shape[:-2], 2 * self.count, values.shape[-1])

    def part(self, rows: np.ndarray) -> StiffnessData:
        """The data at some of the frequencies."""
        if self.full:
            both = np.stack([2 * rows, 2 * rows + 1], axis=-1).ravel()
            covariance = self.covariance[..., both[:, None], both]
        else:
            covariance = self.covariance[..., rows, :, :]
        relative = None if self.relative is None else self.relative[..., rows, :]
        held = {name: getattr(self, name) for name in ("omega", "stiffness", "reference", "amplitude")}
        some: dict[str, Any] = {name: None if one is None else one[..., rows] for name, one in held.items()}
        return replace(self, **some, covariance=covariance, relative=relative, recorded=None)


def flat_rows(values: FloatArray | None) -> FloatArray | None:
    """Values (..., N) as rows (B, N); values (N,), which all conditions have, and None as they are."""
    return values if values is None or values.ndim < 2 else values.reshape(-1, values.shape[-1])


def relaxation(omega: FloatArray, times: FloatArray) -> ComplexArray:
    """Response jw tau/(1 + jw tau) (..., N, T) [1] of arms of unit stiffness with relaxation times (..., T) [s]."""
    return np.asarray(1.0 - 1.0 / (1.0 + 1j * omega[..., None] * times))


def spring_and_arms(omega: FloatArray, times: FloatArray) -> ComplexArray:
    """K* (..., N, T + 1) [1] of a unit spring, then of arms of unit stiffness with relaxation times (..., T) [s]."""
    arms = relaxation(omega, times)
    return np.concatenate([np.ones_like(arms[..., :1]), arms], axis=-1)


def multiplication(values: ComplexArray) -> FloatArray:
    """Real matrices (..., 2, 2) that multiply (Re, Im) of a complex number by the complex values (...,)."""
    rows = [np.stack([values.real, -values.imag], -1), np.stack([values.imag, values.real], -1)]
    return np.stack(rows, -2)


def stacked(conditions: Sequence[StiffnessData], *, apart: bool = False) -> Iterator[tuple[list[int], StiffnessData]]:
    """Groups of conditions as one array (B, N) each, with the places of their members in `conditions`.

    The members of a group have the same number of frequencies and of shared errors, and the same form of covariance.
    All or none of them have K1. If they are `apart`, each condition is a group.
    """
    names = [one.name for one in fields(StiffnessData)]
    kinds: dict[tuple[Any, ...], list[int]] = {}
    for at, one in enumerate(conditions):
        shared = None if one.relative is None else one.relative.shape[-1]
        held = (getattr(one, name) is not None for name in names)
        kinds.setdefault((at if apart else -1, one.count, one.full, one.has_k1, shared, *held), []).append(at)
    for places in kinds.values():
        parts = [conditions[at] for at in places]
        there = [name for name in names if getattr(parts[0], name) is not None]
        yield places, StiffnessData(**{name: np.stack([getattr(one, name) for one in parts]) for name in there})


def complex_columns(columns: FloatArray) -> ComplexArray:
    """Complex values (..., N, p) of columns (..., 2N, p), Re and Im of each frequency in turn."""
    return np.asarray(columns[..., 0::2, :] + 1j * columns[..., 1::2, :])


def real_columns(values: ComplexArray) -> FloatArray:
    """Columns (..., 2N, p), Re and Im of each frequency in turn, of complex values (..., N, p)."""
    turned = np.ascontiguousarray(np.swapaxes(values, -1, -2), dtype=complex)
    return np.asarray(np.swapaxes(turned.view(float), -1, -2))


def with_shared(whole: FloatArray, shared: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """The covariance over all frequencies (..., 2N, 2N), with that of the shared errors added."""
    size = 2 * shape[-1]
    if shared.ndim < 2 or shared.shape[-2] != size:
        raise ModelError(f"the shared errors have the shape {shared.shape}, not (..., {size}, p)")
    common = shared @ np.swapaxes(shared, -1, -2)
    if whole.shape[-2:] == (size, size) and whole.ndim == len(shape) + 1:
        return np.asarray(whole + common, dtype=float)
    joined = np.broadcast_to(common, (*shape[:-1], size, size)).copy()
    for at in range(shape[-1]):
        joined[..., 2 * at : 2 * at + 2, 2 * at : 2 * at + 2] += whole[..., at, :, :]
    return joined


def _check_covariance(whole: FloatArray, shape: tuple[int, ...]) -> None:
    """ModelError unless `whole` is a covariance of K* with this shape."""
    count = shape[-1]
    if whole.shape not in ((*shape, 2, 2), (*shape[:-1], 2 * count, 2 * count)):
        raise ModelError(f"the covariance has the shape {whole.shape}, K* {shape}")
    if not np.all(np.isfinite(whole)) or np.any(np.abs(whole) > _LARGEST):
        raise ModelError("the covariance of K* has missing or too large numbers: check its columns")
    std = np.sqrt(np.abs(np.diagonal(whole, 0, -1, -2)))
    scale = std[..., :, None] * std[..., None, :]
    if np.any(np.abs(whole - np.swapaxes(whole, -1, -2)) > 1e-6 * scale):
        raise ModelError("the covariance of K* is not symmetric: check its order, Re and Im of each frequency in turn")
    least = np.linalg.eigvalsh(whole)[..., 0]
    if np.any(least < -1e-9 * np.abs(whole).max(axis=(-1, -2))):
        raise ModelError("the covariance of K* has a negative eigenvalue: check its correlations")
