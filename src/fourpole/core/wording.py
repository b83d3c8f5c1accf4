"""Long lists cut short, and remarks compared without their numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence

_NUMBER = r"[+-]?\d[\d.]*(?:e[+-]?\d+)?"
#: A number; the 1 of V1 is none.
_ALONE = re.compile(rf"(?<![A-Za-z]){_NUMBER}")
#: A number, the digits of a name, or a quoted text.
_OR_NAME = re.compile(rf"'[^']*'|{_NUMBER}")


def first_of(names: Sequence[str], most: int, between: str = ", ") -> str:
    """The first of some names, and how many more there are.

    Examples
    --------
    >>> first_of(["D1", "D2", "D3", "D4"], 2)
    'D1, D2 and 2 more'
    """
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{between.join(names[:most])}{more}"


def without_numbers(text: str, *, names: bool = False) -> str:
    """A text with 0 in place of each number; with `names`, also of the digits of a name and of each quoted text.

    Examples
    --------
    >>> without_numbers("V1 of D2 is -2.1e-3 % off"), without_numbers("V1 of D2 is 3 % off", names=True)
    ('V1 of D2 is 0 % off', 'V0 of D0 is 0 % off')
    """
    return (_OR_NAME if names else _ALONE).sub("0", text)
