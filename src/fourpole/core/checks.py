"""Checks: each compares a statistic of a test with a limit and gives a verdict; codes, numbers and names, no sentence.

`codes` has the names and templates of all checks, and `remarks` makes their sentences. `recordingchecks` and
`linearity` have the functions for one recording, called in `fourpole.study.reduce`. `fourpole.study.compare` makes the
checks between tests, with `scales` and `curves`, and `fourpole.study.verdicts` those of an identified point.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf, nan
from typing import Any

from fourpole.core.codes import Code
from fourpole.errors import Message, out_of_memory


class Verdict(StrEnum):
    """The verdict on a test, from best to worst."""

    OK = "ok"
    WARNING = "warning"
    REJECTED = "rejected"

    def __repr__(self) -> str:
        return repr(self.value)

    @property
    def rank(self) -> int:
        """0 for the best verdict."""
        return VERDICTS.index(self)

    @classmethod
    def read(cls, text: str) -> Verdict:
        """The verdict of this name; a rejection for another text."""
        return cls(text) if text in VERDICTS else cls.REJECTED


#: The verdicts, from best to worst.
VERDICTS = tuple(Verdict)


@dataclass(frozen=True)
class Check:
    """One check of one test.

    Attributes
    ----------
    code : Code
        The kind of check.
    verdict : Verdict
        The verdict on the test, or on the channel.
    statistic, limit : float
        The value found and its limit, in the same unit; not-a-number for a check without a number.
    channel : str
        F1, V1 or V2 for a check of one channel; else empty.
    values : mapping of str to object
        What the sentence names beside them: numbers in the units of `fourpole.core.remarks.UNITS`, names of tests,
        channels and files, enums, what an error says, other checks, or tuples of them.
    """

    code: Code
    verdict: Verdict
    statistic: float = nan
    limit: float = nan
    channel: str = ""
    values: Mapping[str, Any] = field(default_factory=dict, hash=False)

    @property
    def heading(self) -> str:
        """Name of the check, followed by its channel if it has one."""
        return f"{self.code.text} of {self.channel}" if self.channel else self.code.text


def worst_verdict(verdicts: Iterable[str]) -> Verdict:
    """The worst of several verdicts, of which an unknown one counts as a rejection; OK if there is no verdict.

    Examples
    --------
    >>> worst_verdict(["ok", "rejected", "warning"])
    'rejected'
    """
    return max(map(Verdict.read, verdicts), key=lambda verdict: verdict.rank, default=Verdict.OK)


def reported(
    code: Code, verdict: Verdict, statistic: float = nan, limit: float = nan, channel: str = "", /, **values: object
) -> Check:
    """A check with further values.

    Examples
    --------
    >>> reported(Code.MEMORY, Verdict.REJECTED, file="D1.csv").values
    {'file': 'D1.csv'}
    """
    return Check(code, verdict, statistic, limit, channel, values)


def judged(
    code: Code, statistic: float, warn: float, reject: float = inf, channel: str = "", /, **values: object
) -> Check:
    """A check of a statistic: rejected above `reject`, else a warning above `warn`, else ok and without values."""
    if statistic > reject:
        return Check(code, Verdict.REJECTED, statistic, reject, channel, values)
    if statistic > warn:
        return Check(code, Verdict.WARNING, statistic, warn, channel, values)
    return Check(code, Verdict.OK, statistic, warn, channel)


def fault_of(error: Exception, file: str) -> Check:
    """The rejection of a test because of an error that is none of Fourpole's own: a fault, or too little memory."""
    if out_of_memory(error):
        return reported(Code.MEMORY, Verdict.REJECTED, file=file)
    name = type(error).__name__
    return reported(Code.FAULT, Verdict.REJECTED, error=Message(name, "", f"{name}: {error}"))
