"""Where a fit begins: closed forms, small grids and non-negative spectra, so that nobody need guess."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from scipy import ndimage, optimize

from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.core.routes import maxwell_arm
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fractional import FractionalZener, FractionalZener5
from fourpole.models.interface import Model
from fourpole.models.maxwell import GeneralisedMaxwell, Zener
from fourpole.models.springs import KelvinVoigt, Spring, Structural
from fourpole.models.table import Gehman, GehmanLaw
from fourpole.models.tyre_shell import Shell

__all__ = ["start_of", "starts_of"]

#: The grid of a fractional tyre: orders, leans, times per decade, decades beyond the band.
_ORDERS, _LEANS = np.linspace(0.1, 1.0, 10), np.array([0.9, 0.4])
_TIMES_PER_DECADE, _DECADES_BEYOND = 2, 3.0
#: Points of the grid as close as this, in times and in orders, lead to the same optimum.
_NEAR = (1, 1)
#: The grid of a spectrum: times per decade, decades beyond the band.
_FINE, _BEYOND = 8, 1.0
#: An arm without neighbours is alone over so many logarithms of time.
_ALONE = 2.0
#: Powers of an arm's weight by which times are shared out, the best first.
_SHARES = (0.5, 0.25, 1.0)
#: Ends of times that are spread evenly, as multiples of the band's.
_SPREADS = (1.6, 0.3, 3.0)
#: What an arm without stiffness gets, as a share of the misfit: a logarithm cannot leave zero.
_IDLE = 0.03
#: The first starts of a Maxwell model are looked at before one is chosen.
_LOOKED_AT = 3
_SMALL = 1e-6
#: Other starts lie within this factor of the first, on either side.
_APART = 4.0
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def start_of(model: Model, data: StiffnessData) -> FloatArray:
    """Parameters (..., P) close to those that fit K* of conditions (...,).

    Raises
    ------
    ModelError
        If no start is known for the model.

    Examples
    --------
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> truth = Zener().stiffness([180e3, 120e3, 700.0], omega)
    >>> start_of(Zener(), StiffnessData.of(omega, truth, 100.0)).round(3)
    array([180000., 120000.,    700.])
    """
    return np.asarray(starts_of(model, data, 1)[0])


def starts_of(model: Model, data: StiffnessData, count: int) -> FloatArray:
    """Several starts (count, ..., P), that of `start_of` first: a guard against local minima; always the same ones.

    Parameters
    ----------
    model : Model
    data : StiffnessData
        Of conditions (...,).
    count : int
        >= 1.

    Raises
    ------
    ModelError
        If no start is known for the model.

    Examples
    --------
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> truth = Zener().stiffness([180e3, 120e3, 700.0], omega)
    >>> starts_of(Zener(), StiffnessData.of(omega, truth, 100.0), 4).shape
    (4, 3)
    """
    lead, frequencies = data.stiffness.shape[:-1], data.stiffness.shape[-1]
    k = data.stiffness.reshape(-1, frequencies)
    omega = np.broadcast_to(data.omega, data.stiffness.shape).reshape(-1, frequencies)
    if isinstance(model, GeneralisedMaxwell):
        found = np.stack([_maxwell(one, model.arms, count) for one in _conditions(data)], axis=1)
    elif isinstance(model, FractionalZener | FractionalZener5):
        leans = _LEANS if isinstance(model, FractionalZener5) else None
        found = np.stack(_fractional(_conditions(data), leans, count), axis=1)
    elif isinstance(model, Zener):
        found = _zener(k, omega)[None]
        if count > 1:
            others = np.stack([_relaxing(one, count - 1) for one in _conditions(data)], axis=1)
            found = np.concatenate([found, others])
    elif isinstance(model, GehmanLaw):
        found = _laws(k, omega, data.k1.reshape(-1), model.order)[None]
    elif isinstance(model, Shell):
        found = _shell(model, k, omega)[None]
    else:
        found = _simple(model, k, omega)[None]
    inside = _inside(model, _filled(found, count))
    return inside.reshape(count, *lead, len(model.parameters))


def _inside(model: Model, found: FloatArray) -> FloatArray:
    """Starts within the bounds; a parameter that is moved by its logarithm is not zero."""
    low = np.array([parameter.low for parameter in model.parameters])
    high = np.array([parameter.high for parameter in model.parameters])
    logs = np.array([parameter.log for parameter in model.parameters])
    usual = np.abs(model.defaults)
    inside = np.clip(np.where(np.isfinite(found), found, usual), low, high)
    return np.where(logs & (inside <= 0), _SMALL * usual, inside)


def _filled(found: FloatArray, count: int) -> FloatArray:
    """Where there are fewer starts than wanted: the first, each parameter moved by a factor of its own."""
    more = np.arange(1, count - len(found) + 1)
    shares = (more[:, None] * _GOLDEN ** np.arange(1, found.shape[-1] + 1)) % 1.0
    return np.concatenate([found[:count], found[0] * _APART ** (2 * shares - 1)[:, None, :]])


def _simple(model: Model, k: ComplexArray, omega: FloatArray) -> FloatArray:
    """Models that are linear, or nearly: means over the band."""
    if isinstance(model, Spring):
        return np.mean(k.real, axis=1)[:, None]
    if isinstance(model, KelvinVoigt):
        return np.stack([np.mean(k.real, 1), np.mean(k.imag * omega, 1) / np.mean(omega**2, 1)], axis=1)
    if isinstance(model, Structural):
        return np.stack([np.mean(k.real, 1), np.mean(k.imag, 1) / np.mean(k.real, 1)], axis=1)
    if isinstance(model, Gehman):
        return np.mean((k - model.stiffness([0.0], omega)).real, axis=1)[:, None]
    raise ModelError(f"no start is known for the {model.name} model: state one")


def _laws(k: ComplexArray, omega: FloatArray, k1: FloatArray, order: int) -> FloatArray:
    """Polynomials through log K2 and log C of each frequency, K1 being known, or somewhat below the least K'."""
    least = 0.9 * np.min(k.real, axis=1)
    rest = np.where(np.isfinite(k1) & (k1 > 0), np.minimum(np.nan_to_num(k1), 1.1 * least), least)[:, None]
    k2, c = maxwell_arm(k, rest, omega)
    found = []
    for row, static, spring, damper in zip(omega, rest[:, 0], k2, c, strict=True):
        good = np.isfinite(spring) & np.isfinite(damper) & (spring > 0) & (damper > 0)
        logs = np.log(row[good] / (20 * np.pi))
        flat = np.array([abs(static), static / row.mean()])
        both = [np.log(spring[good]), np.log(damper[good])]
        laws = np.zeros((2, order + 1))
        for at, values in enumerate(both):
            degree = min(order, max(values.size - 1, 0))
            laws[at, : degree + 1] = np.polyfit(logs, values, degree)[::-1] if values.size else np.log(flat[at])
        found.append([static, *np.exp(np.clip(laws[:, 0], -100, 100)), *laws[0, 1:], *laws[1, 1:]])
    return np.array(found)


def _shell(model: Shell, k: ComplexArray, omega: FloatArray) -> FloatArray:
    """The usual shell, on springs that give the mean K', with the time that gives the mean loss."""
    at = [parameter.symbol for parameter in model.parameters]
    found = np.repeat(model.defaults[None], len(k), axis=0)
    wanted = np.mean(k.real, axis=1)
    for _ in range(4):  # the stiffness grows with less than the springs' 3/4th power
        found[:, at.index("k")] *= (wanted / model.static_stiffness(found)) ** 1.3
    found[:, at.index("tau")] = np.mean(k.imag / k.real / omega, axis=1)
    return found


def _zener(k: ComplexArray, omega: FloatArray) -> FloatArray:
    """K* (1 + jw tau) = K1 + jw tau (K1 + K2) is linear in K1, tau (K1 + K2) and tau: least squares of each row."""
    scale, middle = np.mean(np.abs(k), axis=1)[:, None], np.mean(omega, axis=1)[:, None]
    w, y = omega / middle, k / scale
    terms = np.stack([np.ones_like(y), 1j * w, -1j * w * y], axis=-1) / (1 + w[..., None])
    rows = np.concatenate([terms.real, terms.imag], axis=1)
    right = np.concatenate([y.real / (1 + w), y.imag / (1 + w)], axis=1)
    turned = np.swapaxes(rows, 1, 2)
    ridge = 1e-12 * np.eye(3)
    first, second, tau = np.linalg.solve(turned @ rows + ridge, (turned @ right[..., None]))[..., 0].T
    tau = np.maximum(tau, _SMALL)
    k1 = np.maximum(first, 0.01) * scale[:, 0]
    k2 = np.maximum(second / tau * scale[:, 0] - k1, 0.01 * scale[:, 0])
    return np.stack([k1, k2, tau / middle[:, 0] * k2], axis=1)


@dataclass(frozen=True)
class _Condition:
    """K* of one condition, and what brings it to standard units."""

    omega: FloatArray
    stiffness: ComplexArray
    whiten: FloatArray
    k1: float
    k1_std: float

    def rows(self, terms: ComplexArray) -> FloatArray:
        """Terms (..., N, k) in standard units; the first is the stiffness at rest, and a known K1 is one more row."""
        flat = (*terms.shape[:-2], 2 * self.omega.size, terms.shape[-1])
        if self.whiten.ndim == 2:
            whole = self.whiten @ np.stack([terms.real, terms.imag], axis=-2).reshape(flat)
        else:
            by_real, by_imag = self.whiten[:, :, None, 0], self.whiten[:, :, None, 1]
            whole = by_real * terms.real[..., None, :] + by_imag * terms.imag[..., None, :]
        at_rest = np.zeros((*terms.shape[:-2], 1, terms.shape[-1]))
        at_rest[..., 0] = 1.0 / self.k1_std
        return np.concatenate([whole.reshape(flat), at_rest], axis=-2)

    @property
    def wanted(self) -> FloatArray:
        """K*, and K1, in standard units."""
        seen = self.rows(self.stiffness[:, None])[:, 0]
        seen[-1] = self.k1 / self.k1_std
        return np.asarray(seen)

    def relaxing(self, times: FloatArray) -> FloatArray:
        """A spring, and an arm of each relaxation time, per unit, in standard units (2N + 1, T + 1)."""
        relaxed = 1.0 - 1.0 / (1.0 + 1j * self.omega[:, None] * times)
        return self.rows(np.concatenate([np.ones((self.omega.size, 1)), relaxed], axis=1))


def _conditions(data: StiffnessData) -> list[_Condition]:
    lead, count = data.stiffness.shape[:-1], data.stiffness.shape[-1]
    omega = np.broadcast_to(data.omega, data.stiffness.shape).reshape(-1, count)
    tail = (2 * count, 2 * count) if data.full else (count, 2, 2)
    whiten = np.broadcast_to(data.whitener(), (*lead, *tail)).reshape(-1, *tail)
    known = np.isfinite(data.k1) & np.isfinite(data.k1_std)
    k1, std = np.where(known, data.k1, 0.0).ravel(), np.where(known, data.k1_std, np.inf).ravel()
    flat = data.stiffness.reshape(-1, count)
    return [_Condition(omega[i], flat[i], whiten[i], float(k1[i]), float(std[i])) for i in range(len(flat))]


def _relaxing(seen: _Condition, count: int) -> FloatArray:
    """Zener tyres (count, 3) that relax at frequencies spread over the band and a little beyond."""
    ends = np.log(1.0 / seen.omega.max() / 3.0), np.log(3.0 / seen.omega.min())
    times = np.exp(ends[0] + (ends[1] - ends[0]) * (np.arange(count) + 0.5) / count)
    relaxed = 1.0 - 1.0 / (1.0 + 1j * seen.omega[:, None] * times[:, None, None])
    terms = np.concatenate([np.ones_like(relaxed), relaxed], axis=-1)
    springs, _ = _two_springs(seen.rows(terms), seen.wanted)
    springs = np.maximum(springs, 0.01 * np.mean(np.abs(seen.stiffness)))
    return np.stack([springs[:, 0], springs[:, 1], times * springs[:, 1]], axis=1)


def _two_springs(rows: FloatArray, wanted: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The best two weights >= 0 (..., 2) of rows (..., M, 2), and their squared misfit."""
    turned = np.swapaxes(rows, -1, -2)
    normal, right = turned @ rows, turned @ wanted
    size = np.maximum(np.diagonal(normal, 0, -2, -1), 1e-300)
    normal = normal + 1e-12 * size[..., None] * np.eye(2)
    both = np.linalg.solve(normal, right[..., None])[..., 0]
    alone = np.maximum(right / size, 0.0) * np.where(both[..., ::-1] < 0, 1.0, 0.0)
    found = np.where(np.any(both < 0, axis=-1)[..., None], alone, both)
    return found, np.sum(((rows @ found[..., None])[..., 0] - wanted) ** 2, axis=-1)


def _fractional(conditions: list[_Condition], leans: FloatArray | None, count: int) -> list[FloatArray]:
    """The best K0, K_inf >= 0 on a grid of times, orders and leans: its optima (count, P), the best first."""
    omega: FloatArray = np.empty(0)
    found = []
    for seen in conditions:
        if not np.array_equal(omega, seen.omega):
            omega = seen.omega
            times, share = _shares(omega, leans)
            terms = np.stack([1 - share, share], axis=-1)
        springs, misfit = _two_springs(seen.rows(terms), seen.wanted)
        places = _optima(misfit, count)
        low, high = np.maximum(springs[*places.T], _SMALL * np.mean(np.abs(seen.stiffness))).T
        start = [low, np.maximum(high, low * (1 + 1e-3)), times[places[:, 0]], _ORDERS[places[:, 1]]]
        found.append(np.stack(start if leans is None else [*start, leans[places[:, 2]]], axis=1))
    return found


def _shares(omega: FloatArray, leans: FloatArray | None) -> tuple[FloatArray, ComplexArray]:
    """Times (T,), and the share (T, O, L, N) of K_inf - K0 at each time, order and lean."""
    low, high = omega.min() / 10**_DECADES_BEYOND, omega.max() * 10**_DECADES_BEYOND
    times: FloatArray = 1.0 / np.geomspace(low, high, int(np.log10(high / low) * _TIMES_PER_DECADE) + 1)
    power = (1j * omega * times[:, None, None]) ** _ORDERS[:, None]
    share: ComplexArray = (power / (1 + power))[:, :, None, :]
    return times, share if leans is None else np.asarray(share ** leans[:, None])


def _optima(misfit: FloatArray, count: int) -> np.ndarray:
    """Places (count, 3) on a grid (T, O, L): local optima first, then the best of what is far from those chosen."""
    best = misfit <= ndimage.minimum_filter(misfit, size=3, mode="nearest")
    best.flat[np.argmin(misfit)] = True
    ranked = np.where(best, misfit, misfit + misfit.max())
    at = np.indices(misfit.shape)
    places = []
    for _ in range(count):
        place = np.unravel_index(int(np.argmin(ranked)), misfit.shape)
        places.append(place)
        near = (np.abs(at[0] - place[0]) <= _NEAR[0]) & (np.abs(at[1] - place[1]) <= _NEAR[1])
        ranked = np.where(near, np.inf, ranked)
    return np.array(places)


def _maxwell(seen: _Condition, arms: int, count: int) -> FloatArray:
    """Non-negative springs on several layouts of the relaxation times (count or fewer, P), the best first."""
    layouts = islice(_layouts(seen, arms), max(count, _LOOKED_AT))
    tried = [_springs_at(seen, np.exp(np.sort(logs)[::-1])) for logs in layouts]  # the slowest first
    first = sorted(tried[:_LOOKED_AT], key=lambda one: one[1])
    return np.array([start for start, _ in [*first, *tried[_LOOKED_AT:]]])[:count]


def _layouts(seen: _Condition, arms: int) -> Iterator[FloatArray]:
    """Logarithms of relaxation times, the layouts that serve best first."""
    spectrum = _spectrum(seen)
    yield spectrum.merged(arms)
    for power, beyond in zip(_SHARES, _SPREADS, strict=True):
        yield spectrum.shared(arms, power)
        yield _spread(seen, arms, beyond)


def _springs_at(seen: _Condition, times: FloatArray) -> tuple[FloatArray, float]:
    """K_inf and springs >= 0 at the times, as parameters (P,), and their misfit; none is quite without stiffness."""
    found, misfit, size = _non_negative(seen.relaxing(times), seen.wanted)
    idle = _IDLE * (misfit + 1.0) / size / np.sqrt(times.size)
    return np.concatenate([np.maximum(found, idle), times]), misfit


def _non_negative(rows: FloatArray, wanted: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Non-negative least squares: weights (k,), misfit, and the size of each column."""
    size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    found, misfit = optimize.nnls(rows / size, wanted, maxiter=20 * rows.shape[1])
    return found / size, float(misfit), size


def _spread(seen: _Condition, arms: int, beyond: float) -> FloatArray:
    """Logarithms of times that are evenly spread over the band and somewhat beyond; a single one lies within it."""
    if arms == 1:
        low, high = -np.log(seen.omega.max()), -np.log(seen.omega.min())
        return np.array([low + (high - low) * beyond / (1.0 + beyond)])
    low, high = np.sort([-np.log(seen.omega.max() * beyond), -np.log(seen.omega.min() / beyond)])
    return np.linspace(low, high, arms)


@dataclass(frozen=True)
class _Spectrum:
    """The best non-negative spectrum on a fine grid.

    Its arms are at `logs` of time, with stiffnesses `springs`. On the `grid`, `bends` is how far a unit of stiffness
    moves K*, in standard units, as its time is smeared, by the square of the smear in logarithms. `even` is the
    condition, for a tyre that hardly relaxes.
    """

    logs: FloatArray
    springs: FloatArray
    grid: FloatArray
    bends: FloatArray
    even: _Condition

    def weights(self, logs: FloatArray, springs: FloatArray) -> FloatArray:
        """How much the data feel where an arm is."""
        return springs * np.interp(logs, self.grid, self.bends)

    def shared(self, arms: int, power: float) -> FloatArray:
        """Logarithms of times with an equal share of the weights' power between them."""
        if self.logs.size < 2:
            return _spread(self.even, arms, 1.0 + power)
        share = self.weights(self.logs, self.springs) ** power
        middle = (np.cumsum(share) - 0.5 * share) / np.sum(share)
        return np.interp((np.arange(arms) + 0.5) / arms, middle, self.logs)

    def merged(self, arms: int) -> FloatArray:
        """Logarithms of times: neighbours made one where that costs least, or the heaviest made two."""
        if self.logs.size == 0:
            return _spread(self.even, arms, _SPREADS[0])
        logs, springs = self.logs, self.springs
        while logs.size > arms:
            both = springs[1:] + springs[:-1]
            middle = (springs[1:] * logs[1:] + springs[:-1] * logs[:-1]) / both
            cost = self.weights(middle, springs[1:] * springs[:-1] / both) * np.diff(logs) ** 2
            at = int(np.argmin(cost))
            logs = np.concatenate([logs[:at], [middle[at]], logs[at + 2 :]])
            springs = np.concatenate([springs[:at], [both[at]], springs[at + 2 :]])
        while logs.size < arms:
            gaps = np.diff(logs, prepend=logs[0] - _ALONE, append=logs[-1] + _ALONE)
            room = np.minimum(gaps[1:], gaps[:-1])
            at = int(np.argmax(self.weights(logs, springs) * room**2))
            halves = logs[at] + 0.25 * room[at] * np.array([-1.0, 1.0])
            logs = np.concatenate([logs[:at], halves, logs[at + 1 :]])
            springs = np.concatenate([springs[:at], np.full(2, 0.5 * springs[at]), springs[at + 1 :]])
        return logs


def _spectrum(seen: _Condition) -> _Spectrum:
    decades = np.log10(seen.omega.max() / seen.omega.min()) + 2 * _BEYOND
    low = -np.log(seen.omega.max()) - _BEYOND * np.log(10.0)
    grid = np.linspace(low, low + decades * np.log(10.0), int(np.ceil(decades * _FINE)) + 1)
    rows = seen.relaxing(np.exp(grid))
    springs = _non_negative(rows, seen.wanted)[0][1:]
    bends = np.linalg.norm(np.diff(rows[:, 1:], 2, axis=1), axis=0) / (grid[1] - grid[0]) ** 2
    used: BoolArray = springs > 0
    return _Spectrum(grid[used], springs[used], grid, np.concatenate([bends[:1], bends, bends[-1:]]), seen)
