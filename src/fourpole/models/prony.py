"""Prony series: a spring parallel to arms whose relaxation times are fixed, so many per decade of the band."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Parameter
from fourpole.models.maxwell import RelaxingArms
from fourpole.models.nonnegative import least_squares
from fourpole.models.spectrum import each_whitened

#: Relaxation times per decade where none are stated, and largest number. K'' of a flat spectrum ripples by 5.5 % with
#: one time per decade, by 0.08 % with two, by 0.001 % with three.
USUAL, _MOST_PER_DECADE = 3, 12
#: Least and largest number of arms.
_FEWEST, _MOST_ARMS = 3, 300
#: Decades by which the times may extend beyond each end of the band; the best of all pairs is taken.
_BEYOND = (0.0, 0.25, 0.5)


class Prony(RelaxingArms):
    r"""A spring parallel to n arms of spring and damper in series, at fixed relaxation times.

    .. math:: K^* = K_\infty + \sum_i K_i \frac{j\omega\tau_i}{1 + j\omega\tau_i}, \qquad K_\infty, K_i \ge 0

    The model is causal and passive. It is linear in its free parameters K_inf, K_1 ... K_n, so that a fit has one
    optimum, found by non-negative least squares. The times tau_1 ... tau_n are evenly spaced in their logarithm and
    fixed; they fall with their number.

    Parameters
    ----------
    per_decade : int
        Relaxation times per decade of the band, from 1 to 12.
    times : sequence of float, optional [s]
        The relaxation times, falling; without them those of 1 ms to 100 ms, until `placed` chooses others.

    References
    ----------
    C. L. Lawson, R. J. Hanson, "Solving least squares problems", 1974, ch. 23; N. W. Tschoegl, "The phenomenological
    theory of linear viscoelastic behavior", 1989, ch. 4.

    Examples
    --------
    >>> Prony(1, [0.1, 0.01]).stiffness([180e3, 60e3, 60e3, 0.1, 0.01], [20 * np.pi]).round(2)
    array([255500.32+36342.02j])
    """

    special_cases = ("spring",)
    linear = True
    #: In a narrower band the models with few parameters are compared; a spectrum has no end that the data show there.
    least_decades = 4.0

    def __init__(self, per_decade: int = USUAL, times: ArrayLike = ()) -> None:
        if not 1 <= per_decade <= _MOST_PER_DECADE:
            raise ModelError(
                f"a Prony series has 1 to {_MOST_PER_DECADE} relaxation times per decade, not {per_decade}"
            )
        self.per_decade = per_decade
        self.times = np.asarray(times, dtype=float)
        self._is_placed = self.times.size > 0
        if not self._is_placed:
            self.times = np.logspace(-1.0, -3.0, 2 * per_decade + 1)
        self.arms = arms = self.times.size
        if arms > _MOST_ARMS:
            raise ModelError(f"a Prony series has at most {_MOST_ARMS} arms, not {arms}: state fewer per decade")
        self.name = f"prony:{per_decade}"
        ends, numbers = (0.0, np.inf), range(1, arms + 1)
        fixed = zip(numbers, self.times.tolist(), strict=True)
        self.parameters = (
            Parameter("K_inf", "N/m", *ends, 180e3, "stiffness at rest"),
            *(Parameter(f"K_{i}", "N/m", *ends, 60e3, f"spring of arm {i}") for i in numbers),
            *(Parameter(f"tau_{i}", "s", *ends, time, f"relaxation time of arm {i}, fixed") for i, time in fixed),
        )
        self.usually_fixed = tuple(f"tau_{i}" for i in numbers)

    def placed(self, conditions: Sequence[StiffnessData]) -> Prony:
        """The model with relaxation times over the band of all conditions.

        A static test of finite duration extends the band. The number of times is that of the band and its decades.
        Each end of the times lies 0, 1/4 or 1/2 decade beyond the band; of these nine choices the one with the least
        chi-square is taken.
        """
        if self._is_placed:
            return self
        low = min(one.lowest for one in conditions)
        high = max(float(one.omega.max()) for one in conditions)
        decades = float(np.log10(high) - np.log10(low))
        count = max(int(decades * self.per_decade + 1e-6) + 1, _FEWEST)
        if count > _MOST_ARMS:
            raise ModelError(
                f"{count} relaxation times over {decades:.3g} decades are more than {_MOST_ARMS}: state fewer per "
                f"decade, as prony:{max(int(_MOST_ARMS / decades), 1)}"
            )
        rows = [one for each in conditions for one in each_whitened(each)]
        best: tuple[float, FloatArray] | None = None
        for below, above in product(_BEYOND, repeat=2):
            times = np.logspace(above - np.log10(low), -below - np.log10(high), count)
            chi2 = sum(least_squares(one.arms(times), one.target)[1] for one in rows)
            if best is None or chi2 < best[0] * (1 - 1e-9):
                best = chi2, times
        assert best is not None
        return Prony(self.per_decade, best[1])

    def with_parameters(self, count: int) -> Prony:
        """The model with this number of parameters, for values that include the relaxation times."""
        if count % 2 == 0:
            raise ModelError(f"a Prony series has an odd number of parameters, not {count}")
        return self if count == len(self.parameters) else Prony(self.per_decade, 10.0 ** -np.arange(count // 2))

    def starts(self, data: StiffnessData, count: int) -> FloatArray:  # noqa: ARG002
        """One start: the fit itself finds the optimum."""
        return np.broadcast_to(self.defaults, (1, len(data.stiffness), len(self.parameters)))
