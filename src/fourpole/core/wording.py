"""Long lists cut short."""

from __future__ import annotations

from collections.abc import Sequence


def first_of(names: Sequence[str], most: int, between: str = ", ") -> str:
    """The first of some names, and how many more there are.

    Examples
    --------
    >>> first_of(["D1", "D2", "D3", "D4"], 2)
    'D1, D2 and 2 more'
    """
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{between.join(names[:most])}{more}"
