"""Noise that channels share, from the closure phases of all lines."""

from __future__ import annotations

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray

#: Pairs of channels in the order of the closure phase, and the fewest lines.
_PAIRS, _FEWEST = ((0, 1), (1, 2), (2, 0)), 8


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
    size = np.abs(matrix)
    noise = [
        np.maximum(matrix[:, a, a].real - size[:, a, b] * size[:, a, c] / np.maximum(size[:, b, c], 1e-300), 0.0)
        for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    ]
    known = np.isfinite(closure).all(axis=1) & (closure[:, 1] > 0)
    rows = []
    for a, b in _PAIRS:
        turned = np.sqrt(noise[a] * noise[b]) / np.where(matrix[:, a, b] == 0, 1.0, matrix[:, a, b])
        design = np.stack([turned.imag, turned.real], axis=1)[known] / closure[known, 1, None]
        normal = design.T @ design
        if known.sum() < _FEWEST or not np.linalg.cond(normal) < 1e12:
            rows.append((0.0, np.inf, 0.0, 0.0))
            continue
        by = design.T @ (closure[known, 0] / closure[known, 1])
        found, inverse = np.linalg.solve(normal, by), np.linalg.inv(normal)
        along = found / max(float(np.linalg.norm(found)), 1e-300)
        c = float(np.linalg.norm(found))
        error = c * float(np.median(np.abs(turned[known])))
        rows.append((c, float(np.sqrt(along @ inverse @ along)), float(by @ found), error))
    return np.array(rows)
