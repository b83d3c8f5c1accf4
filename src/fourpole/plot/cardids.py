"""The ids of the cards that the report has of each test, by which figures lead to them."""

from __future__ import annotations

from fourpole.plot.part import part_of
from fourpole.plot.sheet import texts
from fourpole.study.results import Results


def dynamic_cards(results: Results) -> list[str]:
    """The id of the card of each row of dynamic.csv; rows of a part have the ids that the whole results give.

    Examples
    --------
    >>> import polars as pl
    >>> dynamic_cards(Results(dynamic=pl.DataFrame({"test": ["D1", "D2"]})))
    ['dynamic-1', 'dynamic-2']
    """
    part = part_of(results)
    return [f"dynamic-{at + 1}" for at in (range(results.dynamic.height) if part is None else part.rows.tolist())]


def static_cards(results: Results) -> dict[str, str]:
    """The id of the card of each static test by its name."""
    part = part_of(results)
    whole = results if part is None else part.whole
    return {test: f"static-{at}" for at, test in enumerate(dict.fromkeys(texts(whole.static, "test")), 1)}
