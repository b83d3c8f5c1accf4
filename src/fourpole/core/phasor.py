"""Phasors: the complex amplitudes of F1, V1 and V2 at the excitation frequency, with their covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from fourpole import quantities as q
from fourpole.core import stats
from fourpole.core.arrays import ByRows, ComplexArray, FloatArray
from fourpole.core.confidence import COVERAGE
from fourpole.core.digits import notebook_html

#: The three channels of a dynamic test, in the order of every amplitude and covariance.
CHANNELS = ("force_in", "motion_in", "motion_out")
#: Tests that a notebook shows.
_MOST_SHOWN = 12
#: Symbols of the channels in the paper.
SYMBOLS = {"force_in": "F1", "motion_in": "V1", "motion_out": "V2"}


def circular_covariance(gamma: ComplexArray) -> FloatArray:
    """Covariance (2N, 2N) of interleaved Re and Im of circular noise, from its complex covariance (N, N)."""
    result = np.empty((2 * len(gamma), 2 * len(gamma)))
    result[0::2, 0::2] = result[1::2, 1::2] = 0.5 * gamma.real
    result[1::2, 0::2] = 0.5 * gamma.imag
    result[0::2, 1::2] = -0.5 * gamma.imag
    return result


@dataclass(frozen=True, eq=False)
class Phasors(ByRows):
    r"""Complex amplitudes of F1, V1, V2 at one frequency per test; x(t) = Re(X e^{jwt}), 0-to-peak.

    Parameters
    ----------
    frequency : (...,) float array [Hz]
        Excitation frequency.
    amplitudes : (..., 3) complex array [N], [m/s], [m/s]
        F1, V1, V2; not-a-number for an absent channel. V1 and V2 are positive in the same direction, from the contact
        towards the foundation; F1 is positive where it pushes the tyre in that direction.
    covariance : (..., 6, 6) float array
        Covariance of Re F1, Im F1, Re V1, Im V1, Re V2, Im V2, in the squares of their units. It includes the noise,
        not the errors of the gains.
    frequency_std : (...,) float array [Hz]
        Standard uncertainty of the frequency; 0 for a frequency that was given.
    dof : (...,) float array [1]
        Degrees of freedom of the covariance.

    Examples
    --------
    >>> phasors = Phasors.from_polar(frequency=10.0, force_in=60.0, motion_in=0.0628, phase=1.51)
    >>> abs(phasors.mobility).round(6)
    np.float64(0.001047)
    """

    frequency: FloatArray
    amplitudes: ComplexArray
    covariance: FloatArray
    frequency_std: FloatArray
    dof: FloatArray

    @classmethod
    def from_polar(
        cls,
        frequency: ArrayLike,
        force_in: ArrayLike,
        motion_in: ArrayLike,
        phase: ArrayLike,
        motion_out: ArrayLike = np.nan,
        phase_out: ArrayLike = 0.0,
    ) -> Phasors:
        """Phasors from a reduced table, assumed to be exact.

        Parameters
        ----------
        frequency : (...,) float array [Hz]
            Excitation frequency.
        force_in, motion_in, motion_out : (...,) float arrays [N], [m/s], [m/s]
            Amplitudes of F1, V1 and, if known, V2.
        phase, phase_out : (...,) float arrays [rad]
            Phase by which F1 and V2 lead V1.

        Returns
        -------
        Phasors
            V1 is real, and the covariance is zero.

        Examples
        --------
        >>> Phasors.from_polar([10.0, 12.0], 50.0, 0.06, 0.5).amplitudes.shape
        (2, 3)
        """
        f1 = np.asarray(force_in) * np.exp(1j * np.asarray(phase))
        v2 = np.asarray(motion_out) * np.exp(1j * np.asarray(phase_out))
        frequency, f1, v1, v2 = np.broadcast_arrays(np.asarray(frequency, dtype=float), f1, motion_in, v2)
        amplitudes = np.stack([f1, v1, v2], axis=-1).astype(complex)
        zero = np.zeros(frequency.shape)
        return cls(frequency, amplitudes, np.zeros((*zero.shape, 6, 6)), zero, zero + np.inf)

    @classmethod
    def stack(cls, items: Sequence[Phasors]) -> Phasors:
        """Phasors of tests of the same shape, joined along a new first axis."""
        return cls(*(np.stack([getattr(item, f.name) for item in items]) for f in fields(cls)))

    @classmethod
    def joined(cls, items: Sequence[Phasors]) -> Phasors:
        """Phasors of rows of tests, one after the other."""
        none = np.zeros(0)
        empty = cls(none, np.zeros((0, 3), dtype=complex), np.zeros((0, 6, 6)), none, none)
        return cls(*(np.concatenate([getattr(item, f.name) for item in (empty, *items)]) for f in fields(cls)))

    @property
    def omega(self) -> FloatArray:
        """Angular frequency [rad/s]."""
        return 2 * np.pi * np.asarray(self.frequency)

    @property
    def force_in(self) -> ComplexArray:
        """F1 [N]."""
        return self.amplitudes[..., 0]

    @property
    def motion_in(self) -> ComplexArray:
        """V1 [m/s]."""
        return self.amplitudes[..., 1]

    @property
    def motion_out(self) -> ComplexArray:
        """V2 [m/s]; not-a-number if not measured."""
        return self.amplitudes[..., 2]

    @property
    def mobility(self) -> ComplexArray:
        """V1/F1 [m/(N s)]."""
        return self.motion_in / self.force_in

    @property
    def transmissibility(self) -> ComplexArray:
        """V2/V1 [1]."""
        return self.motion_out / self.motion_in

    @property
    def std(self) -> FloatArray:
        """Standard uncertainty (..., 6) of Re and Im of F1, V1, V2 from the noise, in their units."""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))

    def _repr_html_(self) -> str:
        """Amplitudes and phases of the first tests, for a notebook."""
        shape = np.shape(self.frequency)
        frequency, amplitudes = np.reshape(self.frequency, -1), np.reshape(self.amplitudes, (-1, 3))
        rows = []
        for f, (f1, v1, v2) in zip(frequency[:_MOST_SHOWN].tolist(), amplitudes[:_MOST_SHOWN].tolist(), strict=True):
            sizes = (f"{abs(f1):.5g}", f"{1e3 * abs(v1):.5g}", f"{1e3 * abs(v2):.5g}")
            angles = (f"{np.degrees(np.angle(x / v1)) if v1 else np.nan:.2f}" for x in (f1, v2))
            rows.append([f"{f:.6g}", *("" if text == "nan" else text for text in (*sizes, *angles))])
        heads = (q.FREQUENCY.head, "|F1| [N]", "|V1| [mm/s]", "|V2| [mm/s]", "F1 ahead of V1 [°]", "V2 ahead of V1 [°]")
        title = f"Phasors {'×'.join(map(str, shape)) or 'of one test'}, 0-to-peak"
        return notebook_html(title, (), heads, rows, total=frequency.size)

    def coverage_factor(self, level: float = COVERAGE) -> FloatArray:
        """Half-width of a two-sided interval in standard uncertainties, by Student's t.

        Parameters
        ----------
        level : float [1]
            Probability, between 0 and 1.

        Returns
        -------
        (...,) float array [1]
            t quantile at the degrees of freedom of each test.

        References
        ----------
        JCGM 100:2008, G.3.2.
        """
        return stats.t.ppf(0.5 * (1 + level), self.dof)
