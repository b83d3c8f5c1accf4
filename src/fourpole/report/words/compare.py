"""Which of two tyres has more of a quantity, by how much and where."""

from __future__ import annotations

from collections.abc import Mapping
from math import log

import numpy as np

from fourpole.report.words.evidence import Effect, between, mean_effect
from fourpole.report.words.facts import Measured, common
from fourpole.report.words.phrases import Key, Quantity, condition, percent, some
from fourpole.report.words.trends import combinations

__all__ = ["comparison", "differences"]

_MOST_NAMED = 6
Values = Mapping[Key, Measured]


def differences(first: Values, second: Values) -> dict[Key, Effect]:
    """How far the second is above the first, at each condition in common."""
    return {key: between(first[key].pair, second[key].pair) for key in common(first, second)}


def comparison(quantity: Quantity, names: tuple[str, str], values: tuple[Values, Values]) -> str | None:
    """One sentence that compares two tyres; None where they have no condition in common."""
    keys = common(*values)
    if not keys:
        return None
    more = float(np.mean([log(values[1][key].value / values[0][key].value) for key in keys])) > 0.0
    upper, lower = (1, 0) if more else (0, 1)
    found = differences(values[lower], values[upper])
    mean = mean_effect(list(found.values()))
    signs = {key: effect.sign for key, effect in found.items()}
    standing = any(effect.claimed(len(found)) for effect in found.values())
    where = _where(quantity, keys, each=all(sign == 1 for sign in signs.values()))
    if not standing and not mean.claimed():
        return (
            f"{quantity.of(names[0])} and {names[1]} shows no difference beyond the uncertainty {where}: "
            f"that of {names[upper]} is {percent(mean.value)} higher{' on average' if len(keys) > 1 else ''}, "
            f"no more than twice the standard uncertainty of {percent(mean.std)}."
        )
    if -1 in signs.values() or not mean.claimed():
        return _mixed(quantity, (names[upper], names[lower]), found)
    return (
        f"{names[upper]} {quantity.more}: its {quantity.symbol} is above that of {names[lower]} {where}"
        f"{_by(quantity, found, mean)}{_exceptions(quantity, signs)}."
    )


def _where(quantity: Quantity, keys: list[Key], *, each: bool) -> str:
    if len(keys) == 1:
        return f"at {condition(quantity.axes, keys[0])}, the only condition in common"
    return f"at {'each of ' if each else ''}the {combinations(quantity.axes, keys)} in common"


def _by(quantity: Quantity, found: Mapping[Key, Effect], mean: Effect) -> str:
    if len(found) == 1:
        return f", by {percent(mean.value)} (standard uncertainty {percent(mean.std)})"
    low, high = (pick(found, key=lambda key: (found[key].value, key)) for pick in (min, max))
    return (
        f", by {percent(mean.value)} on average, from {percent(found[low].value)} "
        f"({condition(quantity.axes, low)}) to {percent(found[high].value)} ({condition(quantity.axes, high)})"
    )


def _exceptions(quantity: Quantity, signs: Mapping[Key, int]) -> str:
    silent = [key for key, sign in signs.items() if sign == 0]
    if not silent or len(silent) == len(signs):
        return ""
    return f"; no difference beyond the uncertainty at {_listed(quantity, silent, len(signs))}"


def _mixed(quantity: Quantity, names: tuple[str, str], found: Mapping[Key, Effect]) -> str:
    parts = []
    for name, sign in zip((*names, ""), (1, -1, 0), strict=True):
        keys = [key for key, effect in found.items() if effect.sign == sign]
        if keys and sign:
            most = percent(max(abs(found[key].value) for key in keys))
            much = f"by {'up to ' if len(keys) > 1 else ''}{most} at {_listed(quantity, keys, len(found))}"
            parts.append(f"{name} has the higher {quantity.symbol}, {much}")
        elif keys:
            parts.append(f"there is no difference beyond the uncertainty at {_listed(quantity, keys, len(found))}")
    return f"{'; '.join(parts)}."


def _listed(quantity: Quantity, keys: list[Key], of: int) -> str:
    """'3 of 10 conditions in common (1.00 bar, 1000 N; ...)'."""
    named = some([f"({condition(quantity.axes, key)})" for key in keys], _MOST_NAMED)
    return f"{len(keys)} of {of} conditions in common{f': {named}' if len(keys) <= _MOST_NAMED else ''}"
