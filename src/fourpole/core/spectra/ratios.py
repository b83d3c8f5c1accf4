"""Ratios of F1, V1 and V2 from averaged cross spectra, free of the bias by noise, and the noise that channels share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray

#: A ratio of cross spectra: the logarithm is a sum of those of G_ab, each with a power.
Terms = Sequence[tuple[int, int, float]]

#: Fewest lines of which one has two neighbours.
_NEIGHBOURS = 3
#: Fewest lines that tell whether channels share noise.
_FEWEST_LINES = 8
#: Places of F1, V1 and V2 in a matrix of all three.
_F, _ONE, _TWO = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Ratios(ByValue):
    """Logarithms of complex ratios with their covariance.

    Attributes
    ----------
    values : (L, R) complex array
        The ratios.
    covariance : (L, 2R, 2R) float array [1]
        Covariance of Re and Im, interleaved, of the logarithms of the ratios.
    """

    values: ComplexArray
    covariance: FloatArray


def ratios(matrix: ComplexArray, averages: FloatArray, wanted: Sequence[Terms]) -> Ratios:
    r"""Products and quotients of averaged cross spectra, with their covariance to first order.

    .. math::
        \operatorname{cov}(G_{ab}, G_{cd}^*) = \frac{G_{ac}\,G_{bd}^*}{n}, \qquad
        \operatorname{cov}(G_{ab}, G_{cd}) = \frac{G_{ad}\,G_{cb}}{n}

    Parameters
    ----------
    matrix : (L, C, C) complex array
        Cross spectra :math:`G_{ab} = E[X_a X_b^*]`.
    averages : (L,) float array [1]
        Number n of independent averages.
    wanted : sequence of terms
        Each ratio as terms (a, b, power): the product of :math:`G_{ab}^{power}`, on the principal branch.

    References
    ----------
    D. R. Brillinger, "Time Series: Data Analysis and Theory", 1981, theorem 4.3 and section 7.4.

    Examples
    --------
    >>> amplitudes = np.array([[3.0, 2.0j, 1.0]])
    >>> exact = ratios(amplitudes[:, :, None] * amplitudes[:, None, :].conj(), np.array([100.0]), OF_V2)
    >>> complex(exact.values[0, 0].round(12)), float(abs(exact.covariance).max().round(12))
    (-1.5j, 0.0)
    """
    values = np.ones((matrix.shape[0], len(wanted)), dtype=complex)
    for i, terms in enumerate(wanted):
        for a, b, power in terms:
            values[:, i] *= matrix[:, a, b] ** power
    size = len(wanted)
    covariance = np.empty((matrix.shape[0], 2 * size, 2 * size))
    for i, first in enumerate(wanted):
        for k, second in enumerate(wanted):
            straight = _summed(matrix, first, second, conjugate=True) / averages
            turned = _summed(matrix, first, second, conjugate=False) / averages
            covariance[:, 2 * i, 2 * k] = 0.5 * (straight + turned).real
            covariance[:, 2 * i + 1, 2 * k + 1] = 0.5 * (straight - turned).real
            covariance[:, 2 * i, 2 * k + 1] = 0.5 * (turned - straight).imag
            covariance[:, 2 * i + 1, 2 * k] = 0.5 * (turned + straight).imag
    return Ratios(values, covariance)


def _summed(matrix: ComplexArray, first: Terms, second: Terms, *, conjugate: bool) -> ComplexArray:
    """N times the covariance (L,) of two logarithms, the second conjugate or not."""
    total = np.zeros(matrix.shape[0], dtype=complex)
    for a, b, power in first:
        for c, d, other in second:
            if conjugate:
                moment = matrix[:, a, c] * matrix[:, d, b] / (matrix[:, a, b] * matrix[:, c, d].conj())
            else:
                moment = matrix[:, a, d] * matrix[:, c, b] / (matrix[:, a, b] * matrix[:, c, d])
            total += power * other * moment
    return total


def with_bias(estimate: Ratios, coherence: FloatArray, share: float) -> Ratios:
    r"""The ratios with the bias that noise may leave where no channel is an instrument.

    H1 and H2 differ by the coherence, :math:`\ln(H_2/H_1) = -\ln\gamma^2`. The truth lies anywhere between them, whose
    standard uncertainty is :math:`-\ln\gamma^2/\sqrt{12}` from the middle and twice as much from an end.

    Parameters
    ----------
    estimate : Ratios
        One ratio at each line.
    coherence : (L,) float array [1]
        Coherence of its channels.
    share : float [1]
        1 for a ratio in the middle of H1 and H2, 2 for one of them.
    """
    covariance = estimate.covariance.copy()
    covariance[:, 0, 0] += (share * np.log(np.maximum(coherence, 1e-300))) ** 2 / 12.0
    return Ratios(estimate.values, covariance)


def with_bend(estimate: Ratios, weight: ComplexArray, broad: BoolArray | bool = True) -> Ratios:
    r"""The ratios with the error that their change over the width of a line makes, as at a sharp resonance.

    A line is a mean over frequency with the weight S. Its departure from the ratio g in the middle is

    .. math::
        \tfrac12 g''\sigma^2 + g'\frac{S'}{S}\sigma^2 \approx
        \frac{g_+ - 2g + g_-}{24} + \frac{(g_+ - g_-)\ln(S_+/S_-)}{48}

    where + and - are the neighbouring lines. The variance over frequency is a twelfth of the squared distance of the
    lines, in a band as for Hann windows two bins apart. Without a change of g, noise enlarges the uncertainty by 1 %.

    Parameters
    ----------
    estimate : Ratios
        Ratios (L, R) at lines in the order of their frequency.
    weight : (L, R) complex array
        The cross spectrum by which each ratio is weighted, its denominator.
    broad : (L,) bool array or bool
        False for a line that is a sine, and no mean over frequency.
    """
    if len(weight) < _NEIGHBOURS:
        return estimate
    below, here, above = estimate.values[:-2], estimate.values[1:-1], estimate.values[2:]
    with np.errstate(divide="ignore", invalid="ignore"):
        bend = ((above - 2.0 * here + below) / 24.0 + (above - below) * np.log(weight[2:] / weight[:-2]) / 48.0) / here
    bend = np.nan_to_num(np.concatenate([bend[:1], bend, bend[-1:]]), posinf=0.0, neginf=0.0)
    bend = np.where(np.broadcast_to(broad, len(bend))[:, None], bend, 0.0)
    covariance = estimate.covariance.copy()
    for i in range(bend.shape[1]):
        covariance[:, 2 * i, 2 * i] += bend[:, i].real ** 2
        covariance[:, 2 * i + 1, 2 * i + 1] += bend[:, i].imag ** 2
    return Ratios(estimate.values, covariance)


def with_instrument(place: int) -> tuple[Terms, ...]:
    """F1/V1 and V2/V1 with one instrument, at a place in the matrix."""
    return ((_F, place, 1), (_ONE, place, -1)), ((_TWO, place, 1), (_ONE, place, -1))


#: F1/V1 with the instrument V2, and V2/V1 with the instrument F1.
OF_V2: tuple[Terms, ...] = (((_F, _TWO, 1), (_ONE, _TWO, -1)), ((_TWO, _F, 1), (_ONE, _F, -1)))
#: F1/V1 as the geometric mean of H1 and H2: its phase is that of G_F1.
OF_V1: tuple[Terms, ...] = (((_F, _ONE, 0.5), (_ONE, _F, -0.5), (_F, _F, 0.5), (_ONE, _ONE, -0.5)),)
#: The closure phase: the product of the cross spectra around F1, V1, V2, which is real if noises are independent.
CLOSURE: tuple[Terms, ...] = (((_F, _ONE, 1), (_ONE, _TWO, 1), (_TWO, _F, 1)),)


def correlations_of(matrix: ComplexArray, closure: FloatArray) -> FloatArray:
    r"""Correlation of the noises of each pair of channels, from the closure phases of all lines.

    Noise that two channels share adds :math:`c\sqrt{N_aN_b}` to :math:`G_{ab}`, which turns the closure phase by

    .. math:: \mathrm{Im}\bigl(c \sqrt{N_aN_b}/G_{ab}\bigr), \qquad
        N_a = G_{aa} - |G_{ab}||G_{ca}|/|G_{bc}|

    c is taken as the same over the band. What it has in phase with the signal at a line is not seen there.

    Parameters
    ----------
    matrix : (L, 3, 3) complex array
        Cross spectra of F1, V1 and V2.
    closure : (L, 2) float array [rad]
        Closure phases and their standard uncertainties.

    Returns
    -------
    (3, 4) float array [1]
        For F1 and V1, V1 and V2, V2 and F1: modulus of c, its standard uncertainty, the chi-square of two degrees of
        freedom that c explains, and the relative error of the cross spectrum, in the median of the lines.
    """
    moduli = np.abs(matrix)
    noise = [
        np.maximum(matrix[:, a, a].real - moduli[:, a, b] * moduli[:, a, c] / np.maximum(moduli[:, b, c], 1e-300), 0.0)
        for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    ]
    known = np.isfinite(closure).all(axis=1) & (closure[:, 1] > 0)
    rows = []
    for a, b in ((_F, _ONE), (_ONE, _TWO), (_TWO, _F)):
        turned = np.sqrt(noise[a] * noise[b]) / np.where(matrix[:, a, b] == 0, 1.0, matrix[:, a, b])
        design = np.stack([turned.imag, turned.real], axis=1)[known] / closure[known, 1, None]
        normal = design.T @ design
        if known.sum() < _FEWEST_LINES or not np.linalg.cond(normal) < 1e12:
            rows.append((0.0, np.inf, 0.0, 0.0))
            continue
        by = design.T @ (closure[known, 0] / closure[known, 1])
        parts, inverse = np.linalg.solve(normal, by), np.linalg.inv(normal)
        size = float(np.linalg.norm(parts))
        along = parts / max(size, 1e-300)
        error = size * float(np.median(np.abs(turned[known])))
        rows.append((size, float(np.sqrt(along @ inverse @ along)), float(by @ parts), error))
    return np.array(rows)
