"""The outcome of a reduction: phasors, checks and a preview for each excitation frequency of a recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fourpole.core.arrays import FloatArray
from fourpole.core.checks import Check
from fourpole.core.demodulation.corrections import Correction, response_std
from fourpole.core.demodulation.demodulate import Demodulation
from fourpole.core.demodulation.preview import Preview
from fourpole.core.phasor import Phasors
from fourpole.core.spectra.excited import Excited, Line

if TYPE_CHECKING:
    from fourpole.fitting.rows import Key


#: Name of the time at which a recording began among the values of its test [s], from 1970 on.
BEGAN = "began"


@dataclass(frozen=True)
class Point:
    """One excitation frequency of a recording, by whichever method its amplitudes were found.

    Attributes
    ----------
    phasors : Phasors or None
        Amplitudes of F1, V1, V2 with their covariance; None where the recording was rejected before.
    checks : tuple of Check
        Verdicts on the recording.
    corrections : tuple of Correction
        Effects of the measurement chain that were removed from the amplitudes.
    channels : tuple of str
        Roles of the channels, in the order of `preview`.
    preview : Preview or None
        A few cycles of the recording, for figures.
    line : Line or None
        What the averaged spectra show beside the amplitudes; None for a test at one frequency.
    """

    phasors: Phasors | None
    checks: tuple[Check, ...]
    corrections: tuple[Correction, ...] = ()
    channels: tuple[str, ...] = ()
    preview: Preview | None = None
    line: Line | None = None

    @property
    def response_std(self) -> FloatArray:
        """Standard uncertainties (3, 2) of the calibrated responses of F1, V1, V2: relative gain [1], phase [rad]."""
        return response_std(self.corrections)


@dataclass(frozen=True)
class Demodulated:
    """What one recording gives by itself, before the rig and other statements are looked at.

    Attributes
    ----------
    found : Demodulation, Excited or None
        Amplitudes and figures of quality, of one frequency or of many; None where the recording was rejected.
    checks : tuple of Check
        The reason for a rejection, or the checks made while the recording was loaded.
    mean_force : float [N]
        Mean of F1; 0 where no force is recorded.
    sha256 : str
        Hash of the file; empty where it was not read.
    began : float or None [s]
        Time at which the recording began, from 1970 on; None where its file does not state it.
    lasting : bool
        Whether the same content gives the same result again, so that it can be kept.
    """

    found: Demodulation | Excited | None = None
    checks: tuple[Check, ...] = ()
    mean_force: float = 0.0
    sha256: str = ""
    began: float | None = None
    lasting: bool = True


@dataclass(frozen=True)
class Reduced:
    """The result of one recording.

    Attributes
    ----------
    points : tuple of Point
        At least one point.
    sha256 : str
        Hash of the file; empty where it was not read.
    began : float or None [s]
        Time at which the recording began, from 1970 on; None where its file does not state it.
    """

    points: tuple[Point, ...]
    sha256: str = ""
    began: float | None = None


def point_keys(tests: Iterable[str]) -> list[Key]:
    """Test and point of each row, from the name of the test in each row; points count from 1.

    Examples
    --------
    >>> point_keys(["D1", "D2", "D2"])
    [('D1', 1), ('D2', 1), ('D2', 2)]
    """
    seen: Counter[str] = Counter()
    keys = []
    for name in tests:
        seen[name] += 1
        keys.append((name, seen[name]))
    return keys
