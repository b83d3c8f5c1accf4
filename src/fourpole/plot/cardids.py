"""The ids of the cards that the report has of each test, by which figures lead to them."""

from __future__ import annotations

from collections import Counter

from fourpole.plot.part import part_of
from fourpole.plot.sheet import texts
from fourpole.study.study import Study

_KEY = "cards"
#: Number of rows of a test, lines of its spectrum, above which they share a card.
MANY = 12


def of_lines(results: Study, cards: list[str]) -> None:
    """Note the ids of the cards of results with some lines of their tests."""
    results.derived[_KEY] = cards


def dynamic_cards(results: Study) -> list[str]:
    """The id of the card of each row of dynamic.csv; rows of a part have the ids that the whole results give.

    A test with more rows than `MANY` has one card, that of its first row.

    Examples
    --------
    >>> import polars as pl
    >>> dynamic_cards(Study(dynamic=pl.DataFrame({"test": ["D1", "D2"]})))
    ['dynamic-1', 'dynamic-2']
    """
    if _KEY in results.derived:
        cards: list[str] = results.derived[_KEY]
        return cards
    part = part_of(results)
    whole = results if part is None else part.whole
    tests = texts(whole.dynamic, "test")
    counts = Counter(tests)
    first: dict[str, int] = {}
    for at, test in enumerate(tests):
        first.setdefault(test, at)
    rows = range(len(tests)) if part is None else part.rows.tolist()
    return [f"dynamic-{(first[tests[at]] if counts[tests[at]] > MANY else at) + 1}" for at in rows]


def static_cards(results: Study) -> dict[str, str]:
    """The id of the card of each static test by its name."""
    part = part_of(results)
    whole = results if part is None else part.whole
    return {test: f"static-{at}" for at, test in enumerate(dict.fromkeys(texts(whole.static, "test")), 1)}
