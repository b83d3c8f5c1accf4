"""Checks of the lines of a recording under random excitation."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fourpole.core import stats
from fourpole.core.checks import Check, Code, Verdict, judged, reported
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.spectra.excited import Excited

#: Uncertainty of a ratio above which a line is doubtful, and above which the ratio has no mean.
_DOUBTFUL, _LOST = 0.1, 0.3
#: Misfit of the closure phase that is worth a warning.
_MUCH = 4.0


def check_line(found: Excited, at: int) -> Check:
    """Check the uncertainties of F1/V1 and V2/V1 of a line."""
    worst = float(np.nanmax(found.relative[at]))
    hertz = float(found.phasors.frequency[at])
    if np.broadcast_to(found.foreign, found.averages.shape)[at]:
        return reported(Code.BESIDE, Verdict.REJECTED, hertz=hertz)
    return judged(Code.LINE, worst, _DOUBTFUL, _LOST, hertz=hertz, percent=100 * worst)


def check_closure(found: Excited) -> Iterator[Check]:
    """Check the closure phase of all lines: its squares over their variances have the mean 1 if noises are independent.

    The limit has the chance of a false alarm that all searches have, and is at least four: uncertainties are enlarged
    by what is below it.
    """
    if np.isfinite(found.misfit) and not found.driven:
        count = int(np.isfinite(found.closure[:, 0]).sum())
        limit = float(stats.chi2.isf(SEARCH_CHANCE, count)) / count
        yield judged(Code.CLOSURE, found.misfit, max(limit, _MUCH), times=np.sqrt(found.misfit), length=found.length)
