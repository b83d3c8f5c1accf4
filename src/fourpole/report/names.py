"""Names of tests as they are shown: without their common beginning, or as the condition that tests have in common."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable

from fourpole.findings.facts import UNSTATED, Facts
from fourpole.report.digits import condition, counted

#: Names of up to this number of characters are shown whole.
_SHORT = 12
#: Separators at which a name may be cut: none inside a number, and no sign of one.
_CUT = re.compile(r"[_\s]|(?<!\d)\.|\.(?!\d)|(?<=[^\W\d_])-|(?<=\d)-(?!\d)")
_AXES = ("pressure", "load", "frequency")


def short_names(names: Iterable[str]) -> dict[str, str]:
    """Each name without the beginning that all of them share, cut at a separator; short names stay as they are.

    Examples
    --------
    >>> list(short_names(["Sommer_B_1.8bar_8Hz", "Sommer_B_1.2bar_10Hz"]).values())
    ['1.8bar_8Hz', '1.2bar_10Hz']
    >>> list(short_names(["D1", "D2"]).values())
    ['D1', 'D2']
    """
    whole = list(dict.fromkeys(names))
    if len(whole) < 2 or max(map(len, whole)) <= _SHORT:
        return {name: name for name in whole}
    least = min(map(len, whole)) - 1  # of each name something is left
    shared = next((at for at in range(least) if len({name[at] for name in whole}) > 1), least)
    cut = max((found.end() for found in _CUT.finditer(whole[0]) if found.end() <= shared), default=0)
    return {name: name[cut:] for name in whole}


def named_by_condition(facts: Facts, tests: Collection[str]) -> str:
    """Some tests by what they have in common and others have not: 'the 8 tests at 8 Hz', 'the static test of A'."""
    wanted, (static, dynamic) = set(tests), facts.rows
    every = [*static, *dynamic]
    chosen = [row for row in every if row["test"] in wanted]
    if len(wanted) == len({row["test"] for row in every}):
        return f"all {len(wanted)} tests" if len(wanted) > 1 else "the only test"
    resting = {row["test"] for row in static}
    kind = "static test" if wanted <= resting else "test"
    specimens = {row["tyre"] for row in chosen}
    of = f" of {specimens.pop()}" if len(specimens) == 1 < len(facts.tyres) else ""
    places = []
    for axis in _AXES:
        here = {facts.key(row, (axis,))[0] for row in chosen} - {UNSTATED}
        there = {facts.key(row, (axis,))[0] for row in every} - {UNSTATED}
        places.append(here.pop() if len(here) == 1 < len(there) else UNSTATED)
    at = condition(_AXES, tuple(places), facts.results.shown) if any(one != UNSTATED for one in places) else ""
    if not (of or at):
        return f"{len(wanted)} of {counted(len({row['test'] for row in every}), 'test')}"
    number = f"the {len(wanted)} {kind}s" if len(wanted) > 1 else f"the {kind}"
    return f"{number}{of}{f' at {at}' if at else ''}"
