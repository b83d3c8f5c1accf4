"""The ids of the cards that the report has of each test, by which figures lead to them."""

from __future__ import annotations

from fourpole.plot.sheet import texts
from fourpole.study.results import Results

#: Key in `Results.derived` of the results from which some tests were selected.
WHOLE = "whole"


def dynamic_cards(results: Results) -> list[str]:
    """The id of the card of each row of dynamic.csv; rows of a selection have the ids that the whole results give.

    Examples
    --------
    >>> import polars as pl
    >>> dynamic_cards(Results(dynamic=pl.DataFrame({"test": ["D1", "D2"]})))
    ['dynamic-1', 'dynamic-2']
    """
    rows = results.derived.get("rows")
    return [f"dynamic-{at + 1}" for at in (range(results.dynamic.height) if rows is None else rows)]


def static_cards(results: Results) -> dict[str, str]:
    """The id of the card of each static test by its name."""
    whole: Results = results.derived.get(WHOLE, results)
    return {test: f"static-{at}" for at, test in enumerate(dict.fromkeys(texts(whole.static, "test")), 1)}
