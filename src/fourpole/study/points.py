"""`Points`, the table that flows through a study: a row for each excitation frequency of each recording.

Which quantities are asked of each test, and the verdict on each, follow from it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign
from fourpole.campaign.row import Test
from fourpole.core.arrays import BoolArray, ByValue, FloatArray, IntArray
from fourpole.core.checks import Asked, Check, Code, Verdict, worst_verdict
from fourpole.core.demodulation.corrections import Correction
from fourpole.core.demodulation.demodulate import Demodulation
from fourpole.core.demodulation.preview import Preview
from fourpole.core.phasor import Phasors
from fourpole.core.sources import Source
from fourpole.core.spectra.excited import Excited
from fourpole.fitting.rows import Key
from fourpole.words import remark_of


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
class StaticStiffness:
    """K1 for a dynamic test with the parts of its uncertainty, or what is lacking.

    `checks` are of its static tests and of their choice. `time` is the mean time of the static tests [s]; not-a-number
    if one of them is unknown.
    """

    value: float = float("nan")
    std: float = float("nan")
    lack: Check | None = None
    checks: tuple[Check, ...] = ()
    parts: Mapping[Source, float] = field(default_factory=dict)
    time: float = float("nan")


@dataclass(frozen=True, eq=False)
class Points(ByValue):
    """The dynamic tests of a campaign, N rows in the order of tests.csv; each stage of a study adds columns.

    Attributes
    ----------
    tests : tuple of N Test
        The row of tests.csv.
    phasors : Phasors
        Amplitudes of F1, V1, V2 with their covariance, N rows; not-a-number where the recording was rejected.
    checks : tuple of N tuples of Check
        All that was checked of the row, up to this stage.
    corrections : tuple of N tuples of Correction
        Effects of the measurement chain that were removed from the amplitudes.
    previews : tuple of N (tuple of str, Preview) or None
        Roles of the channels and a few cycles of their samples, in the first row of a recording.
    began : (N,) float array [s]
        Time at which the recording began, from 1970 on; not-a-number where its file does not state it.
    sha256 : tuple of N str
        Hash of the recording; empty where it was not read.
    condition : (N,) int array
        Number of the condition among all of the campaign; negative for a rigid block in place of the specimen.
    stiffness : tuple of N StaticStiffness
        K1 of the row, or the reason why there is none.
    strange : (N,) bool array
        Rows whose K* is not that of their condition: they must not share it with other tests.
    columns : dict of str to (N,) array
        What spectra show of each line beside its amplitudes, by column of lines.csv.
    """

    tests: tuple[Test, ...]
    phasors: Phasors
    checks: tuple[tuple[Check, ...], ...]
    corrections: tuple[tuple[Correction, ...], ...]
    previews: tuple[tuple[tuple[str, ...], Preview] | None, ...]
    began: FloatArray
    sha256: tuple[str, ...]
    condition: IntArray = field(default_factory=lambda: np.zeros(0, dtype=int))
    stiffness: tuple[StaticStiffness, ...] = ()
    strange: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    columns: dict[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def joined(cls, parts: Sequence[Points]) -> Points:
        """The points of several recordings, one after the other; a column that a recording lacks is not-a-number."""
        heads = dict.fromkeys(head for part in parts for head in part.columns)
        chained: dict[str, Any] = {
            name: tuple(chain.from_iterable(getattr(part, name) for part in parts))
            for name in ("tests", "checks", "corrections", "previews", "sha256")
        }
        return cls(
            phasors=Phasors.joined([part.phasors for part in parts]),
            began=np.concatenate([np.zeros(0), *(part.began for part in parts)]),
            columns={
                head: np.concatenate([part.columns.get(head, np.full(len(part.tests), np.nan)) for part in parts])
                for head in heads
            },
            **chained,
        )

    @property
    def keys(self) -> tuple[Key, ...]:
        """Test and point of each row; points count from 1."""
        seen: Counter[str] = Counter()
        keys = []
        for test in self.tests:
            seen[test.name] += 1
            keys.append((test.name, seen[test.name]))
        return tuple(keys)

    @property
    def sound(self) -> BoolArray:
        """Rows with amplitudes that no check rejects."""
        rejected = [worst_verdict(check.verdict for check in checks) is Verdict.REJECTED for checks in self.checks]
        return np.isfinite(self.phasors.frequency) & ~np.array(rejected, dtype=bool)

    def by_condition(self, rows: BoolArray) -> list[np.ndarray]:
        """Some of the rows in groups of one condition, in the order of their first row."""
        used = np.flatnonzero(rows & (self.condition >= 0))
        numbers = self.condition[used]
        return [used[numbers == number] for number in dict.fromkeys(numbers.tolist())]

    def with_checks(self, further: Iterable[tuple[int, Check]], *, last: bool = False) -> Points:
        """The table with further checks of rows, by the row's index, before or after those that it has."""
        added: list[list[Check]] = [[] for _ in self.tests]
        for index, check in further:
            added[index].append(check)
        pairs = zip(self.checks, added, strict=True)
        return replace(self, checks=tuple((*checks, *more) if last else (*more, *checks) for checks, more in pairs))


_COLUMNS = {Asked.STIFFNESS: q.VERDICT_K, Asked.ARM: q.VERDICT_ARM, Asked.TR: q.VERDICT_TR}


def asked_only(campaign: Campaign, points: Points) -> Points:
    """The points with the checks that bear on what is asked of each; a rigid block keeps all."""
    rows = zip(_asked(campaign, points), points.checks, strict=True)
    return replace(points, checks=tuple(_bearing(checks, asked) if asked else checks for asked, checks in rows))


def verdict_columns(campaign: Campaign, points: Points) -> dict[q.Quantity, list[str]]:
    """Verdict and remarks of each row, and the verdict on each quantity; blank if it is not asked.

    That no passive K2 and C exist is an answer on the specimen, and no fault of a test: it counts where K2 or C stands
    in the statement.
    """
    columns: dict[q.Quantity, list[str]] = {
        q.VERDICT: [],
        q.REMARKS: [],
        **{column: [] for column in _COLUMNS.values()},
    }
    stated = Asked.ARM in campaign.stated.analysis.quantities
    for asked, checks in zip(_asked(campaign, points), points.checks, strict=True):
        doubts = [check for check in checks if check.verdict is not Verdict.OK]
        columns[q.VERDICT].append(worst_verdict(check.verdict for check in doubts if stated or not _says_no_arm(check)))
        columns[q.REMARKS].append("; ".join(dict.fromkeys(filter(None, map(remark_of, checks)))))
        for quantity, column in _COLUMNS.items():
            verdicts = (check.verdict for check in doubts if check.code.quantity in (Asked.STIFFNESS, quantity))
            columns[column].append(worst_verdict(verdicts) if quantity in asked else "")
    return columns


def expects_k1(campaign: Campaign) -> bool:
    """Whether a test without K1 lacks it: other tests are static ones, or K2 or C is asked for."""
    return bool(campaign.of_kind("static")) or Asked.ARM in campaign.stated.analysis.quantities


def _asked(campaign: Campaign, points: Points) -> Iterator[frozenset[Asked]]:
    """What is asked of each row: as stated, else K*, K2 and C where a K1 is or should be, and TR where a mass moves."""
    moving = {name for name, rig in campaign.stated.all_rigs.items() if not rig.rig().blocked}
    expected, stated = expects_k1(campaign), campaign.stated.analysis.quantities
    for test, condition, stiffness in zip(points.tests, points.condition, points.stiffness, strict=True):
        arm = np.isfinite(stiffness.value) or (expected and stiffness.lack is not None)
        can = {Asked.STIFFNESS: True, Asked.ARM: arm, Asked.TR: test.rig in moving}
        default = frozenset(quantity for quantity, possible in can.items() if possible)
        wanted = stated - (frozenset() if can[Asked.TR] else {Asked.TR}) or default
        yield wanted if condition >= 0 else frozenset()


def _bearing(checks: Sequence[Check], quantities: Collection[Asked]) -> tuple[Check, ...]:
    """The checks that bear on some quantities; what bears on K* bears on all."""
    bearing = {Asked.STIFFNESS, *quantities}
    return tuple(check for check in checks if check.code.quantity in bearing)


def _says_no_arm(check: Check) -> bool:
    """Whether a check says that no passive K2 and C exist."""
    return check.code is Code.PASSIVE_ARM and check.verdict is Verdict.REJECTED
