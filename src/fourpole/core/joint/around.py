r"""The likelihood of K* about the K* of a model, from the phasors of all tests of a rig.

Errors that tests share, such as a gain, move K* by per cents where the noise moves it by hundredths of a per cent. A
linearisation at the measured K* is then off by the square of the shared errors, which is far above the noise. Here some
conditions have the K* of a model, and the shared values that suit it best are found; about these the likelihood of
log K* is normal:

.. math:: \log \hat K_c = \log K_c + e_c - B_c\,\delta z,

where e_c is the step to the best K* for known shared values, B_c its slope by the shared values z, and
:math:`\delta z` their distance from the values that suit the tests best when no K* is known.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray, parts
from fourpole.core.joint.solve import Problem, Step, moved, no_worse, sweep

#: Largest number of Gauss-Newton steps, and of halvings of a step that raises the objective.
_STEPS, _HALVINGS = 12, 6
#: Number of results that are kept as starts.
_MOST_KEPT = 64
#: Longest step of a shared value, in stated standard uncertainties.
_LONGEST = 3.0
#: The search ends at a step below this share of every standard uncertainty of the shared values.
_SMALL = 1e-3
#: The search is lost if the most probable K* is further than this from that of the solution, in standard uncertainties.
_LOST = 3.0


@dataclass(frozen=True, eq=False)
class Around(ByValue):
    """The likelihood of K* of some conditions about given values.

    Attributes
    ----------
    z : (p,) float array
        Shared values that suit the given K* best, in stated standard uncertainties from the statement.
    change : (n, 2) float array
        Re and Im of the most probable K* over the given one, less 1, of each given condition.
    own : (n, 2, 2) float array
        Covariance of `change` for known shared values.
    shared : (n, 2, p) float array
        Changes when one of p independent errors, that all conditions share, is one standard uncertainty.
    """

    z: FloatArray
    change: FloatArray
    own: FloatArray
    shared: FloatArray

    @property
    def relative(self) -> ComplexArray:
        """`shared` as complex numbers (n, p)."""
        return np.asarray(self.shared[:, 0] + 1j * self.shared[:, 1])

    @property
    def std(self) -> FloatArray:
        """Standard uncertainty (n,) of K*, relative."""
        return np.sqrt(np.trace(self.own, axis1=1, axis2=2) + np.sum(np.abs(self.relative) ** 2, axis=1))

    def part(self, rows: slice) -> Around:
        """The likelihood of some of the given conditions."""
        return replace(self, change=self.change[rows], own=self.own[rows], shared=self.shared[rows])


@dataclass(frozen=True, eq=False)
class Likelihood(ByValue):
    """All tests of a rig as the joint route weighed them, with its solution.

    Attributes
    ----------
    problem : Problem
    z : (p,) float array
        Shared values of the solution, in stated standard uncertainties from the statement.
    stiffness : (c,) complex array [N/m]
        K* of each condition.
    """

    problem: Problem
    z: FloatArray
    stiffness: ComplexArray
    _last: dict[bytes, tuple[FloatArray, ComplexArray, FloatArray]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def around(self, given: np.ndarray, value: ComplexArray) -> Around:
        """The likelihood of K* of some conditions, linear about given values; K* of the others is free.

        Where no search of the shared values leads from there to K* of the tests, as from a model that is far from them,
        the likelihood is linear about K* of the solution.

        Parameters
        ----------
        given : (n,) int array
            Conditions whose K* is given.
        value : (n,) complex array [N/m]
            Their K*.
        """
        problem = self.problem
        z, stiffness, slope = self._start(given)
        stiffness = stiffness.copy()
        stiffness[given] = value
        step = sweep(problem, z, stiffness, slope)
        for _ in range(_STEPS):
            dz = _best_shared(step, given)
            dz = dz * min(1.0, _LONGEST / float(np.abs(dz).max(initial=_LONGEST)))
            small = np.all(np.abs(dz) <= _SMALL * np.sqrt(np.diag(step.covariance)))
            moved_on = _stepped(problem, z, stiffness, step, given, dz)
            if moved_on is None:
                break
            z, stiffness, step = moved_on
            if small:
                break
        found = _around(z, step.own_step - step.slope @ step.dz, step, given)
        if np.any(np.abs(value * (1 + found.change @ [1, 1j]) / self.stiffness[given] - 1) > _LOST * found.std):
            off = self.stiffness / np.where(np.isin(np.arange(stiffness.size), given), stiffness, self.stiffness) - 1
            step = sweep(problem, self.z, self.stiffness, sweep(problem, self.z, self.stiffness).slope)
            return _around(self.z, parts(off, axis=1), step, given)
        if len(self._last) > _MOST_KEPT:
            self._last.clear()
        self._last[given.tobytes()] = (z, stiffness, step.slope)
        return found

    def _start(self, given: np.ndarray) -> tuple[FloatArray, ComplexArray, FloatArray]:
        """Shared values, K* and its slopes to begin with: those found last for the same conditions."""
        kept = self._last.get(given.tobytes())
        return kept or (self.z, self.stiffness, sweep(self.problem, self.z, self.stiffness).slope)


def _around(z: FloatArray, change: FloatArray, step: Step, given: np.ndarray) -> Around:
    """The likelihood about the point of a step, whose most probable K* is off by `change` (c, 2)."""
    root = np.linalg.inv(step.triangle) if step.triangle.size else step.triangle
    return Around(z, change[given], step.own[given], -(step.slope @ root)[given])


def _stepped(
    problem: Problem, z: FloatArray, stiffness: ComplexArray, step: Step, given: np.ndarray, dz: FloatArray
) -> tuple[FloatArray, ComplexArray, Step] | None:
    """The shared values and K* after a step, halved until the objective does not rise; None if it always rises."""
    for share in 0.5 ** np.arange(_HALVINGS):
        there_stiffness = _moved(stiffness, step, given, share * dz)
        there = sweep(problem, z + share * dz, there_stiffness, step.slope)
        if no_worse(there, step):
            return z + share * dz, there_stiffness, there
    return None


def _best_shared(step: Step, given: np.ndarray) -> FloatArray:
    """Change (p,) of the shared values to the best ones, while K* of the given conditions stays."""
    weigh = np.linalg.inv(step.own_root[given])
    rows = (weigh @ step.slope[given]).reshape(-1, step.dz.size)
    target = (weigh @ step.own_step[given][..., None]).ravel()
    whole = np.vstack([step.triangle, rows])
    return np.asarray(np.linalg.lstsq(whole, np.append(step.triangle @ step.dz, target), rcond=None)[0])


def _moved(stiffness: ComplexArray, step: Step, given: np.ndarray, dz: FloatArray) -> ComplexArray:
    """K* of all conditions for a change of the shared values; that of the given conditions stays."""
    result = moved(stiffness, step.own_step - step.slope @ dz)
    result[given] = stiffness[given]
    return result
