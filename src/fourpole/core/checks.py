"""Checks: each compares a statistic of a test with a limit and gives a verdict, with a sentence and a remedy.

`codes` holds the names and sentences of all checks. `recordingchecks` and `linearity` have the functions for one
recording, called in `fourpole.study.reduce`. `fourpole.study.compare` makes the checks between tests, with `scales` and
`curves`, and `fourpole.study.cells` those of a row of dynamic.csv.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf, nan

import numpy as np

from fourpole.core.codes import Code
from fourpole.core.confidence import COVERAGE

#: The verdicts, from best to worst.
VERDICTS = ("ok", "warning", "rejected")


@dataclass(frozen=True)
class Check:
    """One check of one test.

    Attributes
    ----------
    code : Code
        The kind of check.
    statistic, limit : float
        The value found and its limit, in the same unit; not-a-number for a check without a number.
    verdict : {"ok", "warning", "rejected"}
        The verdict on the test, or on the channel.
    channel : str
        F1, V1 or V2 for a check of one channel; else empty.
    remark, remedy : str
        The whole sentence, and the remedy alone; empty for most checks whose verdict is ok.
    """

    code: Code
    statistic: float
    limit: float
    verdict: str
    channel: str = ""
    remark: str = ""
    remedy: str = ""

    @property
    def cause(self) -> str:
        """The sentence without its remedy."""
        return self.remark.removesuffix(self.remedy)

    @property
    def heading(self) -> str:
        """Name of the check, followed by its channel if it has one."""
        return f"{self.code.text} of {self.channel}" if self.channel else self.code.text


def worst_verdict(verdicts: Iterable[str]) -> str:
    """The worst of several verdicts, of which an unknown one counts as a rejection; "ok" if there is no verdict.

    Examples
    --------
    >>> worst_verdict(["ok", "rejected", "warning"])
    'rejected'
    """
    return max((one if one in VERDICTS else VERDICTS[-1] for one in verdicts), key=VERDICTS.index, default="ok")


def reported(
    code: Code, verdict: str, statistic: float = nan, limit: float = nan, channel: str = "", **values: object
) -> Check:
    """A check with its sentence, in which `values` fill the blanks.

    Examples
    --------
    >>> reported(Code.MEMORY, "rejected", file="D1.csv").remark
    'D1.csv does not fit into memory: cut it with window [s]'
    """
    known = {"statistic": statistic, "limit": limit, "channel": channel, "short": code.short(verdict), **values}
    cause, remedy = (part.format(**known) for part in code.says(verdict))
    return Check(code, statistic, limit, verdict, channel, cause + remedy, remedy)


def interval_words(low: float, high: float, unit: str) -> str:
    """An interval of probability `COVERAGE` by Monte Carlo, as `Code.PASSIVE_ARM` and `Code.UNCERTAINTY` state it."""
    if not np.isfinite(low):
        return " without a limit"
    upper = f"and {high:.3g} {unit}" if np.isfinite(high) else "and no upper limit"
    return f" between {low:.3g} {unit} {upper} ({100 * COVERAGE:g} % by Monte Carlo)"


def cut_words(before: float, after: float) -> str:
    """The parts [s] cut off both ends of a recording, as `Code.STEADY` states them."""
    start = [f"the first {before:.3g} s (lead-in, run-up)"] if before > 0 else []
    return " and ".join([*start, *([f"the last {after:.3g} s (run-down)"] if after > 0 else [])])


def judged(
    code: Code, statistic: float, warn: float, reject: float = inf, channel: str = "", **values: object
) -> Check:
    """A check of a statistic: rejected above `reject`, else a warning above `warn`, else ok and without a sentence."""
    if statistic > reject:
        return reported(code, "rejected", statistic, reject, channel, **values)
    if statistic > warn:
        return reported(code, "warning", statistic, warn, channel, **values)
    return Check(code, statistic, warn, "ok", channel)
