"""Which tests are of the same condition: one tyre, at pressures, loads and temperatures that differ by next to nothing.

States are taken in rising order, and each joins the first that it is like: the order of the tests does not matter, and
no family is wider than what counts as the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fourpole.campaign.static import SAME_PRESSURE

__all__ = ["LIMITS", "alike", "families"]

#: Relative and absolute difference within which a value is the same.
LIMITS = {"pressure": (SAME_PRESSURE, 0.0), "preload": (0.01, 0.0), "temperature": (0.0, 5.0)}
#: Of any other value.
_OTHER = (0.01, 0.0)


def families(names: Sequence[str], states: Sequence[tuple[str, tuple[float | None, ...]]]) -> np.ndarray:
    """Number of the family of each state: a tyre, and a value of each name.

    Examples
    --------
    >>> families(["pressure"], [("a", (1.7e5,)), ("a", (1.702e5,)), ("a", (2.0e5,)), ("b", (1.7e5,))]).tolist()
    [0, 0, 1, 2]
    """
    rising = sorted(set(states), key=lambda state: (state[0], [(x is None, x or 0.0) for x in state[1]]))
    leaders: dict[str, list[tuple[tuple[float | None, ...], int]]] = {}
    number: dict[tuple[str, tuple[float | None, ...]], int] = {}
    for tyre, state in rising:
        led = leaders.setdefault(tyre, [])
        same = next((at for leader, at in led if alike(names, state, leader)), None)
        if same is None:
            same = sum(map(len, leaders.values()))
            led.append((state, same))
        number[tyre, state] = same
    return np.array([number[state] for state in states], dtype=int)


def alike(names: Sequence[str], one: Sequence[float | None], other: Sequence[float | None]) -> bool:
    """Whether two states are the same; a value that is unknown is like another that is."""
    for name, a, b in zip(names, one, other, strict=True):
        relative, absolute = LIMITS.get(name, _OTHER)
        if (a is None) != (b is None):
            return False
        if a is not None and b is not None and abs(a - b) > relative * max(abs(a), abs(b)) + absolute:
            return False
    return True
