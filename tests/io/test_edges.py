"""Numbers that decide how a file is read, and what one may hold: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest

from fourpole.errors import TableError
from fourpole.io import convert, documents, identity, layout, look, source, stream, stretches
from fourpole.io.formats import text as of_text
from fourpole.io.signals import Signal
from fourpole.io.tables import columns, forms, responses


def taken(function):
    """A function that gives whether another one takes a case without an error."""

    def decided(case):
        try:
            function(case)
        except TableError:
            return False
        return True

    return decided


def counts(off):
    """Whether a column counts the time, by the departure of one of its steps from the others."""
    steps = np.full(9, 0.01)
    steps[4] *= 1 + off
    return stream._counts_time(Signal("t", None, np.cumsum(steps), 0.0, None))


def encoding(share):
    """The encoding of a text in which this share of the characters are common Chinese ones."""
    shares = {source._CHINESE: share, source._JAPANESE: 0.0}
    with patch.object(source, "_common_share", lambda content, pattern: shares[pattern]):
        return source.encoding_without_mark(b"\xe4")


def jumps(gap):
    """Number of jumps of the time, by one step over the usual one."""
    steps = look._Steps()
    steps.feed(np.cumsum([1.0, 1.0, 1.0, gap, 1.0]))
    return steps.jumps


def line(share):
    """Whether a sinusoid is a line of a signal, by its share of the variance; the rest is of other frequencies."""
    time = np.arange(4096) / 4096
    others = sum(np.sin(2 * np.pi * hertz * time) for hertz in range(500, 1500, 50)) / np.sqrt(20)
    return look._line(np.sqrt(share) * np.sin(2 * np.pi * 100 * time) + np.sqrt(1 - share) * others, 4096.0) is not None


def table(rows, names):
    """Whether lines of which so many in a hundred are rows are a table."""
    scan = stretches._Scan(",", "utf-8", "a", b"\n", 0)
    scan._line = 101
    scan._runs = [SimpleNamespace(rows=rows, layout=SimpleNamespace(names=names))]
    return bool(scan.finished())


def settled(age):
    """Whether a file that changed this long ago [ns] can be known by its time stamp."""
    stat = SimpleNamespace(st_size=1, st_mtime_ns=10**12 - int(age), st_ino=1)
    with patch.multiple(
        identity, Path=lambda path: MagicMock(stat=lambda: stat), time=MagicMock(time_ns=lambda: 10**12)
    ):
        return identity.identity_of("a").settled


def rate(drift):
    """The rate of a thousand times, of which the last is off those of 1 kHz by this share of a step."""
    return convert._even(np.arange(1000) / (1000.0 * (1 + drift / 1000)))[0] == 1000.0


def alike(apart):
    """Take two columns that could both be the frequency, by their relative difference."""
    pair = [SimpleNamespace(unit="Hz", si=np.array([size]), role="frequency", column=MagicMock(head="f"), option="")
            for size in (1.0, 1 + apart)]  # fmt: skip
    columns.chosen(MagicMock(columns=[one.column for one in pair]), pair)


def differs(apart):
    """Number of remarks on a column of K'' that differs from the one that is used by this share."""
    one = SimpleNamespace(role="loss", unit="N/m", letter="", si=np.array([1 + apart]), column=MagicMock(head="K''"))
    form = SimpleNamespace(letter="K", columns={})
    return len(forms.contradictions(SimpleNamespace(lines=[2]), [one], form, np.array([1 + 1j])))


def coherent(apart):
    """Whether a coherence is of a line of a response, by the distance of their frequencies over the step."""
    other = SimpleNamespace(frequency=np.array([10.0, 11.0 + apart, 12.0]), values=np.ones(3, dtype=complex))
    one = SimpleNamespace(frequency=np.array([10.0, 11.0, 12.0]))
    return bool(np.isfinite(responses._on(one, other)[1]))


#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "rate that a file states, 0.01 %": (
        taken(lambda x: stream._at_rate(Signal("F1", "N", np.zeros(2), 0.0, 1 + x), 1.0, 0)),
        {0.99e-4: True, 1.01e-4: False},
    ),
    "steps of a column of times, 0.1 %": (counts, {0.98e-3: True, 1.02e-3: False}),
    "row of units, half of its cells": (
        lambda n: layout._is_units_row([*["N"] * n, *["abc"] * (20 - n)]), {10: False, 11: True},
    ),
    "characters of an encoding, 90 %": (encoding, {0.89: "cp1252", 0.91: "gb18030"}),
    "jump of the time, 1.5 steps": (jumps, {1.48: 0, 1.52: 1}),
    "line of a signal, half of its variance": (line, {0.49: False, 0.51: True}),
    "rows of a table, 2 %": (lambda n: table(n, ("t", "F1")), {1: False, 2: True}),
    "rows of a table of one column, half": (lambda n: table(n, ("t",)), {49: False, 50: True}),
    "file that is settled, 2 s": (settled, {1.98e9: False, 2.02e9: True}),
    "rate that is whole, a tenth of a step": (rate, {0.099: True, 0.101: False}),
    "rate that a text states, 1e-6 to 1e12 Hz": (
        lambda text: of_text._rate([f"sample rate: {text} Hz"]) is not None,
        {"0.99e-6": False, "1.01e-6": True, "0.99e12": True, "1.01e12": False},
    ),
    "columns that agree, 0.2 %": (taken(alike), {1.99e-3: True, 2.02e-3: False}),
    "column that differs, 2 %": (differs, {0.0198: 0, 0.0202: 1}),
    "frequencies of a coherence, 0.1 % of the step": (coherent, {0.99e-3: True, 1.01e-3: False}),
    "levels of a document, 64": (
        taken(lambda n: documents.json_of("[" * n + "]" * n, "a")), {64: True, 66: False},
    ),
    "number of a document, 1e150": (
        taken(lambda x: documents.json_of(f"[{x}]", "a")), {0.99e150: True, 1.01e150: False},
    ),
    "characters of a cell, 131 072": (
        taken(lambda n: list(documents.rows_of("a,b\n" + "c" * n, "a"))), {131_072: True, 131_073: False},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
