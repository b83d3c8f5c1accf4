"""`State`: a joint problem with its solution and its misfit, between the rounds of its reconciliation."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.joint.misfit import Candidate
from fourpole.core.joint.solve import Problem, Solution, solve_either
from fourpole.core.sources import Source

#: The statement of the rig counts as wrong if all noise is more than this many times that of the recordings.
NOISE_IN_DOUBT = 2.0


@dataclass(frozen=True)
class Misfit:
    """Agreement of the stated rig and channels with the tests.

    Attributes
    ----------
    chi2, dof : float [1]
        Chi-square that no tyre can explain, and its degrees of freedom, with the statement unchanged. It includes
        F1/V2 - Zr of all tests, and the departure of the shared values from the statement.
    fits : bool
        False if the tests contradict a stated value, if a part of the rig is missing, or if the misfit is far larger
        than noise could be.
    rig_error : float [1]
        Model discrepancy of the rig: relative error of Zr, of its largest part, in each test; 0 if the rig fits.
    inflation : float [1]
        Factor of all noise over the noise that each recording gives; 1 if the recordings' noise explains the residuals.
    scatter : float [1]
        Relative scatter of K* between tests of one condition in addition to the noise; 0 if the noise explains it.
    unsteady : float [1]
        Relative error of the frequency of each test, from a drive without a steady speed; 0 for none.
    conflicts : tuple of int
        Indices of the shared values that the tests contradict; the uncertainty of their statement was enlarged.
    added : tuple of Source
        Unstated parts of the rig and errors of channels that were added; their sizes are among the shared values.
    drifts : tuple of Source
        Drifts of the specimens that were added to the shared values.
    candidates : tuple of Candidate
        Causes that would explain a misfit, the best first; empty if there is no misfit.
    tied : int
        Number of the first candidates that explain the misfit equally well.
    """

    chi2: float = 0.0
    dof: float = 0.0
    fits: bool = True
    rig_error: float = 0.0
    inflation: float = 1.0
    scatter: float = 0.0
    unsteady: float = 0.0
    conflicts: tuple[int, ...] = ()
    added: tuple[Source, ...] = ()
    drifts: tuple[Source, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    tied: int = 0


@dataclass(eq=False)
class State(ByValue):
    """The problem, its solution and the misfit after some rounds.

    `start` is the first K* of each condition; `negligible` is false if enlarged noise hides an error of Zr.
    """

    problem: Problem
    solution: Solution
    start: ComplexArray
    outlier: FloatArray
    misfit: Misfit = field(default_factory=Misfit)
    negligible: bool = True
    finished: bool = True

    @property
    def fits(self) -> bool:
        """Whether rig and channels as stated agree with the tests."""
        as_stated = not (self.misfit.conflicts or self.misfit.added or self.misfit.rig_error)
        return self.finished and as_stated and (self.negligible or self.misfit.inflation <= NOISE_IN_DOUBT)

    def solve(self, problem: Problem, **misfit: Any) -> None:
        """Solve a changed problem from the present solution; `misfit` has the fields of the misfit that changed."""
        self.misfit = replace(self.misfit, **misfit)
        self.problem, self.solution = solve_either(problem, self.solution.stiffness, self.solution.z)
