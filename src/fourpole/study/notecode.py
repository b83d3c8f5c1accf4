"""Codes of the notes on a joint solution, as study.json has them."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["NoteCode"]


class NoteCode(StrEnum):
    """What the user must know of a joint solution."""

    NOT_CONVERGED = "not converged"
    MISFIT = "misfit"
    NOISE = "noise"
    UNSTEADY = "unsteady drive"
    SCATTER = "scatter"
    OUTLIERS = "outliers"
    UNSHARED_MASSES = "masses without a common condition"
    ONE_TEST = "one test"
