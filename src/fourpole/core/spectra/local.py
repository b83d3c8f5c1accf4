"""Ratios of F1, V1 and V2 from the spectra of a whole record: a sweep, whose transients are part of the fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.phasor import circular_covariance

#: Powers of the frequency by which a ratio, and the transient, change over a band.
_POWERS = 3
#: Fewest bands of which one has two neighbours to either side.
_NEIGHBOURS = 5
#: Fewest bins of a band: the fit of a ratio has six parameters.
BINS = 21
#: Width of a band over its frequency, where that is more bins.
_WIDTH = 0.01


@dataclass(frozen=True, eq=False)
class LocalRatios(ByValue):
    """Ratios at the middles of bands.

    Attributes
    ----------
    frequency, width : (L,) float array [Hz]
        Middle and width of each band.
    values : (L, R) complex array
        The ratios.
    covariance : (L, 2R, 2R) float array [1]
        Covariance of Re and Im, interleaved, of the logarithms of the ratios.
    noise : (L, R, R) complex array
        Covariance of the residuals of the ratios, each over the root mean square of its channel Y.
    matrix : (L, C, C) complex array
        Mean products of the spectra in the band.
    averages : (L,) float array [1]
        Number of bins less that of the parameters.
    """

    frequency: FloatArray
    width: FloatArray
    values: ComplexArray
    covariance: FloatArray
    noise: ComplexArray
    matrix: ComplexArray
    averages: FloatArray


@dataclass(frozen=True, eq=False)
class _Band:
    """The fit of one band: ratios (R,), covariance of their logarithms, that of the residuals, and mean products; the
    error of the logarithms by third and fourth order in the ratio (R, 2); transients (R,), and the same for them.
    """

    values: ComplexArray
    covariance: FloatArray
    noise: ComplexArray
    matrix: ComplexArray
    of_ratio: ComplexArray
    transient: ComplexArray
    of_transient: ComplexArray


def local_ratios(lines: ComplexArray, frequency: FloatArray, wanted: tuple[tuple[int, int, int], ...]) -> LocalRatios:
    r"""Ratios of the spectra of a whole record, each with an instrument, by local polynomials.

    In a band around :math:`f_0`, with :math:`\delta = f - f_0`,

    .. math:: Y(f) = (g_0 + g_1\delta + g_2\delta^2)\,X(f) + t_0 + t_1\delta + t_2\delta^2 + e(f)

    g is the ratio and t the transient: what the ends of the record leave, in a resonance too. The six parameters follow
    from the products with the instrument Z, :math:`(Z, Z\delta, Z\delta^2, 1, \delta, \delta^2)`, whose noise is in
    neither X nor Y: noise of X leaves no bias. The covariance is that of the residuals e, and of what ratio and
    transient have of third and fourth order in a band, from the neighbouring bands.

    Parameters
    ----------
    lines : (C, B) complex array
        Spectra of the channels at all bins.
    frequency : (B,) float array [Hz]
        Frequencies of the bins, evenly spaced.
    wanted : tuple of (int, int, int)
        Each ratio as the channels Y, X and Z.

    References
    ----------
    R. Pintelon and J. Schoukens, "System Identification: A Frequency Domain Approach", 2nd ed., 2012, ch. 7 (the local
    polynomial method); T. Soderstrom and P. Stoica, "System Identification", 1989, ch. 8 (instruments).
    """
    bands = _bands(frequency)
    found = [_of_band(lines[:, a:b], frequency[a:b], wanted) for a, b in bands]
    sizes = np.array([b - a for a, b in bands])
    values = np.stack([one.values for one in found])
    covariance = np.stack([one.covariance for one in found])
    bend = np.hypot(
        _remainder(values, np.stack([one.of_ratio for one in found])) / np.abs(values),
        _remainder(np.stack([one.transient for one in found]), np.stack([one.of_transient for one in found])),
    )
    for at in range(2 * bend.shape[1]):
        covariance[:, at, at] += 0.5 * bend[:, at // 2] ** 2
    return LocalRatios(
        np.array([0.5 * (frequency[a] + frequency[b - 1]) for a, b in bands]),
        sizes * float(frequency[1] - frequency[0]),
        values,
        covariance,
        np.stack([one.noise for one in found]),
        np.stack([one.matrix for one in found]),
        sizes - 2.0 * _POWERS,
    )


def _remainder(values: ComplexArray, weights: ComplexArray) -> FloatArray:
    r"""Size (L, R) of the error of a ratio by its third and fourth order in a band, from the values of its neighbours.

    With half of a band as the unit of :math:`\delta`, the coefficients are a 96th of
    :math:`g_{+2} - 2g_{+1} + 2g_{-1} - g_{-2}` and a 384th of :math:`g_{+2} - 4g_{+1} + 6g - 4g_{-1} + g_{-2}`.

    Parameters
    ----------
    values : (L, R) complex array
        Values at the middles of neighbouring bands.
    weights : (L, R, 2) complex array
        Error of the ratio by :math:`\delta^3` and :math:`\delta^4`.
    """
    if len(values) < _NEIGHBOURS:
        return np.zeros(values.shape)
    third = (values[4:] - 2.0 * values[3:-1] + 2.0 * values[1:-3] - values[:-4]) / 96.0
    fourth = (values[4:] - 4.0 * values[3:-1] + 6.0 * values[2:-2] - 4.0 * values[1:-3] + values[:-4]) / 384.0
    ends = ((2, 2), (0, 0))
    third, fourth = np.pad(third, ends, "edge"), np.pad(fourth, ends, "edge")
    return np.asarray(np.hypot(np.abs(third * weights[:, :, 0]), np.abs(fourth * weights[:, :, 1])))


def _bands(frequency: FloatArray) -> list[tuple[int, int]]:
    """First bin of each band, and the first behind it."""
    step, at, found = float(frequency[1] - frequency[0]), 0, []
    while at + BINS <= frequency.size:
        count = max(BINS, int(_WIDTH * frequency[at] / step) | 1)
        found.append((at, min(at + count, frequency.size)))
        at += count
    return found


def _of_band(lines: ComplexArray, frequency: FloatArray, wanted: tuple[tuple[int, int, int], ...]) -> _Band:
    """The fit of one band."""
    delta = np.linspace(-1.0, 1.0, frequency.size)
    powers = delta ** np.arange(_POWERS)[:, None]
    further = delta ** np.array([[_POWERS], [_POWERS + 1]])
    size = np.sqrt(np.mean(np.abs(lines) ** 2, axis=1))
    scaled = lines / np.maximum(size, 1e-300)[:, None]
    values, weights, left, of_ratio, transient = [], [], [], [], []
    for y, x, z in wanted:
        regressors = np.concatenate([scaled[x] * powers, powers])
        instruments = np.concatenate([scaled[z] * powers, powers])
        inverse = np.linalg.pinv(instruments.conj() @ regressors.T)
        solution = inverse @ (instruments.conj() @ scaled[y])
        values.append(solution[0] * size[y] / size[x])
        weights.append(inverse[0] @ instruments.conj() / solution[0])
        left.append(scaled[y] - solution @ regressors)
        of_ratio.append((further * scaled[x]) @ weights[-1] * solution[0])
        transient.append(solution[_POWERS] * size[y])
    shape = np.stack(weights)
    noise = np.stack(left) @ np.stack(left).conj().T / (frequency.size - 2 * _POWERS)
    covariance = circular_covariance((shape @ shape.conj().T) * noise)
    by_size = size[[y for y, _, _ in wanted]]
    return _Band(
        np.array(values),
        covariance,
        noise,
        lines @ lines.conj().T / frequency.size,
        np.array(of_ratio),
        np.array(transient),
        shape @ further.T / np.maximum(by_size, 1e-300)[:, None],
    )
