"""Which of many alike or long tests a run takes: a part that changes with the sources, and all of them on request.

Of a test with `@pytest.mark.sampled(n)`, whose cases differ in their data only, a run takes every n-th case; one that
has no cases and takes long is run every n-th time, and so are the examples of PAGES. The turn says which; it follows
from the sources, so that one state of them always gives the same tests and the next state others. FOURPOLE_TURN=3
repeats a turn, FOURPOLE_EVERY=1 takes all, as `make every` does. Tests that are named by :: always run.
"""

from __future__ import annotations

import hashlib
import os
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
#: Beginnings of names of tests whose cases differ in the library that they call.
LIBRARIES = tuple(f"tests/{place}" for place in ("export/test_kinds", "io/formats", "io/writers", "study/test_formats"))
#: Pages whose examples take long, each with the n of its mark.
PAGES = {
    "docs/how-sure-are-you.md": 4,
    **dict.fromkeys(("docs/fmu.md", "docs/which-model.md"), 3),
    **dict.fromkeys(
        (f"docs/{name}.md" for name in ("compare", "model-file", "paper-1982", "two-pressures", "twoport")), 2
    ),
}
#: Whether all cases are asked for.
EVERY = os.environ.get("FOURPOLE_EVERY") == "1"


@cache
def turn() -> int:
    """The number that chooses: FOURPOLE_TURN, or one that changes with the sources."""
    if stated := os.environ.get("FOURPOLE_TURN"):
        return int(stated)
    files = sorted((ROOT / "src").rglob("*.py"))
    return int(hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:4], 16)


def share(number: int, parts: int) -> bool:
    """Whether a case, by its number, is in this run's part of `parts`."""
    return EVERY or number % parts == turn() % parts


def mark_pages(items: Iterable[pytest.Item]) -> None:
    """Mark the examples of PAGES as sampled."""
    for item in items:
        if parts := PAGES.get(item.nodeid.partition("::")[0]):
            item.add_marker(pytest.mark.sampled(parts))


def left_out(items: Iterable[pytest.Item], *, first: bool) -> Iterator[pytest.Item]:
    """Cases that a run leaves out: those of other turns.

    With `first` these are also all tests that are by turns, and all but the first case of every fifth other test; the
    tests of LIBRARIES are chosen as without.
    """
    seen: Counter[str] = Counter()
    for item in items:
        name = item.nodeid.partition("[")[0]
        number = seen[name]
        seen[name] += 1
        mark = item.get_closest_marker("sampled")
        place = number + zlib.crc32(name.encode())  # so that tests without cases do not all have one turn
        if first and not name.startswith(LIBRARIES):
            out = mark or number or not share(place, 5)
        else:
            out = mark and not share(place, *mark.args)
        if out:
            yield item
