"""What the tests of a rig cannot see: components that move K* or TR before they show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.core.joint.asking import groups_of, widened
from fourpole.core.joint.joint import Joint
from fourpole.core.joint.outputs import Outputs
from fourpole.core.joint.shared import SharedParameter
from fourpole.core.sources import Role, Source

#: A component shows at this many standard uncertainties; it matters if it then moves a result by more than so many u.
_SHOWS, _MATTERS = 4.0, 2.0
#: The results that are looked at, with their places in `core.identify.OUTPUTS`.
_RESULTS = {"K'": 0, "K''": 1, "TR": 5}


@dataclass(frozen=True)
class Unseen:
    """A component that the tests hardly see.

    Attributes
    ----------
    source : Source
        The component.
    unit : str
        SI unit of `size`.
    size : float
        The size at which it would show at `_SHOWS` standard uncertainties, at most the largest that is possible.
    result : str
        The result that it moves most: K', K'' or TR.
    shift : float [1]
        Change of that result by a component of this size, in the result's standard uncertainty.
    never : bool
        Whether it does not show even at its largest possible size, which is `size` then.
    """

    source: Source
    unit: str
    size: float
    result: str
    shift: float
    never: bool = False


def unseen(joint: Joint, values: Outputs) -> tuple[Unseen, ...]:
    r"""The components that move a result by more than 2 u at the size that shows at 4 standard uncertainties.

    With A the derivatives of the tests by a component, after K* and all other values are fitted out, it shows at
    :math:`4/|A|`. Below that size its derivatives are taken for a change of the fitted values, and so of the results.

    Parameters
    ----------
    joint : Joint
    values : Outputs
        Its outputs.

    Returns
    -------
    tuple of Unseen
        The largest shift first, one for each source.
    """
    problem, solution = joint.problem, joint.solution
    tests = np.flatnonzero(np.isfinite(values.value[:, :2]).all(axis=1))
    parameters = [(row, group.largest * row.std) for group in groups_of(problem, joint.stated) if not group.is_mode
                  for row in group.parameters if row.source.role is not Role.SPECIMEN]  # fmt: skip
    if not tests.size or not joint.stated.parameters:  # where all is exact, nothing can be unseen
        return ()
    extra = [row for row, _ in parameters]
    p = len(problem.shared)
    wide, triangle, slope = widened(problem, solution, extra)
    alone = np.linalg.norm(triangle[p : p + len(extra), p : p + len(extra)], axis=0)
    moved = np.linalg.solve(triangle[:p, :p], triangle[:p, p : p + len(extra)]) if p else np.zeros((0, len(extra)))
    by_k = slope[joint.condition[tests], :, p:]
    rows = list(_RESULTS.values())
    shift = values.by_own[tests][:, rows] @ by_k + values.by_shared[tests][:, rows] @ moved
    zr = np.concatenate([part.impedance_by_shared for _, _, part in wide.linearised(_padded(solution.z, extra),
                                                                                    solution.stiffness)])  # fmt: skip
    shift[:, 2] -= _by_impedance(joint, values, tests, zr[np.argsort(joint.order)][tests][:, p:])
    u = np.sqrt(np.diagonal(values.covariance_of(slice(0, 6), np.zeros(len(values.value))), 0, 1, 2))[tests][:, rows]
    with np.errstate(divide="ignore", invalid="ignore"):
        largest = np.array([most / row.std for row, most in parameters])
        units = np.minimum(_SHOWS / alone, largest)
        times = np.nan_to_num(np.abs(shift) * units / u[:, :, None], posinf=0.0)
    return _listed(extra, units, times.max(axis=0), units == largest)


def _padded(z: FloatArray, extra: list[SharedParameter]) -> FloatArray:
    return np.append(z, np.zeros(len(extra)))


def _by_impedance(joint: Joint, values: Outputs, tests: np.ndarray, zr: ComplexArray) -> FloatArray:
    """Change (n, e) of the true TR of some tests by changes `zr` (n, e) of Zr [N s/m]."""
    parts = [part for _, _, part in joint.problem.linearised(joint.solution.z, joint.solution.stiffness)]
    by_zr = np.concatenate([-1j * part.observed.omega * part.ratio / part.ends.spring for part in parts])
    by_zr = by_zr[np.argsort(joint.order)][tests]
    return np.asarray(values.value[tests, 5][:, None] * (by_zr[:, None] * zr).real)


def _listed(extra: list[SharedParameter], units: FloatArray, times: FloatArray, never: BoolArray) -> tuple[Unseen, ...]:
    """The components that matter, by their largest shift of a result (3, e) [u]; of equal sources the largest one."""
    listed: dict[Source, Unseen] = {}
    for index in np.argsort(-times.max(axis=0)).tolist():
        row, worst = extra[index], int(np.argmax(times[:, index]))
        if times[worst, index] > _MATTERS:
            result = list(_RESULTS)[worst]
            size, shift = float(units[index] * row.std), float(times[worst, index])
            listed.setdefault(row.source, Unseen(row.source, row.unit, size, result, shift, bool(never[index])))
    return tuple(listed.values())
