"""Checks of the lines of a recording with many: each by itself, and noise that channels share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from fourpole.core import stats
from fourpole.core.checks import Check, Code, Verdict, judged, reported
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.spectra.excited import Excited

#: Uncertainty of a ratio above which a line is doubtful, and above which the ratio has no mean.
_DOUBTFUL, _LOST = 0.1, 0.3
#: Misfit of the closure phase that is worth a warning.
_MUCH = 4.0
#: Pairs of channels in the order of the closure phase.
_NAMES = (("F1", "V1"), ("V1", "V2"), ("V2", "F1"))
#: Error of a cross spectrum by shared noise that is worth a warning [1].
_SMALL = 3e-3
#: Part of F1 that is not linear and is worth a warning [1]. A cubic spring or a dry friction that makes up 6 % of K*,
#: the limit for sines, has 5 %; a quarter of that is seen of a hysteresis.
NONLINEAR = 0.0125


def check_line(lines: Excited, index: int) -> Check:
    """Check the uncertainties of F1/V1 and V2/V1 of a line."""
    worst = float(np.nanmax(lines.relative[index]))
    hertz = float(lines.phasors.frequency[index])
    if np.broadcast_to(lines.foreign, lines.averages.shape)[index]:
        return reported(Code.BESIDE, Verdict.REJECTED, hertz=hertz)
    return judged(Code.LINE, worst, _DOUBTFUL, _LOST, hertz=hertz, percent=100 * worst, **_form(lines))


def _form(lines: Excited) -> dict[str, Any]:
    """The form of a check of noise where the specimen is not linear, so that distortion counts as noise."""
    return {"form": "nonlinear"} if lines.nonlinear > NONLINEAR else {}


def check_linearity(lines: Excited) -> Iterator[Check]:
    """Check the part of F1 that is not linear in the motion; none where it was not looked for."""
    if np.isfinite(lines.nonlinear):
        decibel = 20.0 * float(np.log10(max(lines.nonlinear, NONLINEAR)))
        yield judged(Code.LINEARITY, lines.nonlinear, NONLINEAR, form="lines", decibel=decibel)


def check_closure(lines: Excited) -> Iterator[Check]:
    """Check the closure phase of all lines: its squares over their variances have the mean 1 if noises are independent.

    The limit has the chance of a false alarm that all searches have, and is at least four: uncertainties are enlarged
    by what is below it.
    """
    if np.isfinite(lines.misfit) and not lines.driven:
        count = int(np.isfinite(lines.closure[:, 0]).sum())
        limit = float(stats.chi2.isf(SEARCH_CHANCE, count)) / count
        said = {"times": np.sqrt(lines.misfit), "length": lines.length, **_form(lines)}
        yield judged(Code.CLOSURE, lines.misfit, max(limit, _MUCH), **said)


def check_shared_noise(lines: Excited) -> list[Check]:
    """Check the error of a cross spectrum by noise that two channels share; 0 where it is no more than chance.

    Chance is judged by the chi-square of two degrees of freedom of the correlation over all lines. An error below 0.3 %
    is no warning: leakage is of this size, and is in the uncertainty.
    """
    if lines.driven or not np.isfinite(lines.closure).all():
        return []
    limit = float(stats.chi2.isf(SEARCH_CHANCE / len(_NAMES), 2))
    worst = int(np.argmax(lines.shared[:, 2]))
    size, std, statistic, error = lines.shared[worst].tolist()
    found = error if statistic > limit else 0.0
    said = {"pair": _NAMES[worst], "size": size, "std": std, "percent": 100 * error, **_form(lines)}
    return [judged(Code.SHARED, found, _SMALL, **said)]
