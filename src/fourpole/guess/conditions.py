"""Conditions of the tests of a folder: what their names, headers and notes state, compared over all tests.

Numbers without a unit become conditions where their place in all names shows which; what is left names the specimens,
see `fourpole.guess.specimens`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fourpole.core.condition import FREQUENCY
from fourpole.guess.names import (
    CONDITIONS,
    CONSTRUCTIONS,
    KINDS_OF,
    PASSED_OVER,
    Entry,
    RecordingConditions,
    Token,
    axis_named,
    plain,
)
from fourpole.guess.specimens import doubt_equal, name_specimens
from fourpole.words import vocabulary

#: Unit in which a condition is written in a doubt, and the SI value of one such unit.
_SHOWN = {one.key: (one.shown, one.scale) for one in CONDITIONS}


def read_conditions(entries: Sequence[Entry], names: Sequence[str]) -> list[RecordingConditions]:
    """The conditions of each recording, in the order of the entries; `names` are those of the tests, for doubts."""
    entries = _interpreted(entries)
    conditions = [_values(entry) for entry in entries]
    repeats = [
        " ".join(f"{token.value:g}" for token in (*entry.name, *entry.header) if token.what == "repeat")
        for entry in entries
    ]
    counted = [repeat for repeat in repeats if repeat]
    if len(set(repeats)) > 1 and len(set(counted)) < len(counted):
        for condition, repeat in zip(conditions, repeats, strict=True):
            condition.repeat = repeat
    tests = [index for index, entry in enumerate(entries) if entry.kind != "calibration"]
    pairs = [(entries[index], conditions[index]) for index in tests]
    name_specimens(pairs)
    doubt_equal(pairs, [names[index] for index in tests])
    return conditions


def _values(entry: Entry) -> RecordingConditions:
    """The conditions of one recording; its name has priority over its header, and the header over the notes.

    In one place, a value with its unit has priority over a number whose meaning was guessed.
    """
    conditions = RecordingConditions()
    places = {"name": "its name", "header": "its header", "folder": "notes"}
    for place, tokens in entry.parts:
        for token in sorted(tokens, key=lambda one: bool(one.doubt)):
            what = token.what
            if what not in KINDS_OF:
                continue
            if what not in conditions.values:
                conditions.values[what] = token.value
                if token.doubt:
                    conditions.doubt(what, token.doubt)
            elif not token.doubt and not axis_named(what).same(conditions.values[what], token.value):
                taken = _written(what, conditions.values[what])
                conditions.doubt(what, f"{taken} is taken, {places[place]} also says {token.text!r}")
    for token in entry.signals:
        if token.what not in conditions.values:
            conditions.values[token.what] = token.value
            conditions.doubt(token.what, token.doubt)
    conditions.band = next(((one.value, one.high) for one in entry.name if one.what == "band"), None)
    return conditions


def _written(what: str, value: float) -> str:
    """A condition as text, in its shown unit."""
    unit, scale = _SHOWN.get(what, ("", 1.0))
    return f"{value / scale:g} {unit}".strip()


# --- numbers without units ---------------------------------------------------------------------------------------

#: Place of a number in a name: part, kind of test, and its key or its rank among the numbers without a key.
_Slot = tuple[object, ...]


@dataclass(frozen=True)
class _Meaning:
    """The condition that the numbers of a slot are, and the SI value of 1.

    `low` and `high` limit the numbers as written. `keyed`: only with letters before them that may say the condition.
    `fractional`: only if not all of them are whole.
    """

    what: str
    scale: float
    doubt: str = ""
    low: float = -np.inf
    high: float = np.inf
    keyed: bool = False
    fractional: bool = False

    def fits(self, values: np.ndarray, *, keyed: bool) -> bool:  # type: ignore[type-arg]
        """Whether numbers may have this meaning."""
        enough = (keyed or not self.keyed) and not (self.fractional and _whole(values))
        return bool(enough and values.min() >= self.low and values.max() <= self.high)


#: Numbers without a unit below this one may also be those of tyres.
_SMALL = 100.0
#: Meanings of numbers without a unit; the first that fits counts.
_MEANINGS = tuple(_Meaning(**one) for one in vocabulary()["names"]["meanings"])


def _interpreted(entries: Sequence[Entry]) -> list[Entry]:
    """The entries with numbers without units as conditions, where the numbers of one slot show which."""
    placed = [_slots(entry) for entry in entries]
    slots: dict[_Slot, dict[int, Token]] = {}
    for index, own in enumerate(placed):
        for slot, token in own.items():
            slots.setdefault(slot, {})[index] = token
    meanings = {slot: meaning for slot in slots if (meaning := _meaning(slots[slot], entries)) is not None}
    meanings |= _further_pressures(slots, meanings)
    return [_with(entry, tokens, meanings) for entry, tokens in zip(entries, placed, strict=True)]


def _further_pressures(
    slots: Mapping[_Slot, dict[int, Token]], meanings: Mapping[_Slot, _Meaning]
) -> dict[_Slot, _Meaning]:
    """Meanings of numbers without a key whose values are all among the pressures of another slot.

    Example: a number in the names of static tests has the same values as the pressure of the dynamic tests.
    """
    values = {slot: {token.value for token in tokens.values()} for slot, tokens in slots.items()}
    pressures = [slot for slot, meaning in meanings.items() if meaning.what == "pressure"]
    further: dict[_Slot, _Meaning] = {}
    for slot, tokens in slots.items():
        if slot not in meanings and not next(iter(tokens.values())).keys:
            alike = [meanings[pressure] for pressure in pressures if values[slot] <= values[pressure]]
            further.update({slot: alike[0]} if alike else {})
    return further


def _slots(entry: Entry) -> dict[_Slot, Token]:
    """Each number of an entry by its key, or by its rank among the numbers without one."""
    found: dict[_Slot, Token] = {}
    static = entry.kind == "static"
    for place, tokens in entry.parts:
        numbers = [token for token in tokens if token.what == "number"]
        bare = [token for token in numbers if not token.keys]
        found |= {(place, static, len(bare), at): token for at, token in enumerate(bare)}
        for token in numbers:
            if token.keys:
                found.setdefault((place, static, token.key), token)
    return found


def _meaning(tokens: dict[int, Token], entries: Sequence[Entry]) -> _Meaning | None:
    """The meaning of the numbers of one slot; None if it cannot be found."""
    values = np.array([token.value for token in tokens.values()])
    token = next(iter(tokens.values()))
    keys = token.keys
    hertz = _hertz(tokens, entries)
    if hertz and (not keys or "frequency" in keys):
        return _Meaning("frequency", hertz)
    counts = _whole(values) and values.size >= 4 and np.unique(values).size == values.size  # the recordings alone
    if keys == ("frequency",) or ((not keys or len(token.key) == 1) and counts):
        return None
    possible = _possible(keys, tokens, entries, values)
    fitting = (m for what in possible for m in _MEANINGS if m.what == what and m.fits(values, keyed=bool(keys)))
    return next(fitting, None)


def _possible(
    keys: tuple[str, ...],
    tokens: Mapping[int, Token],
    entries: Sequence[Entry],
    values: np.ndarray,  # type: ignore[type-arg]
) -> Sequence[str]:
    """The conditions that the numbers of one slot may be: those of its key, else those that tests need."""
    wanted = keys or [what for what in ("pressure", "preload") if _wanted(what, tokens, entries)]
    if not keys or (keys == ("temperature",) and _nameless(tokens, entries)):
        return [what for what in wanted if _apart(what, values)]
    return wanted


def _apart(what: str, values: np.ndarray) -> bool:  # type: ignore[type-arg]
    """Whether the different numbers would be different values of a condition; numbers such as 4711, 4712 are not."""
    return not any(axis_named(what).same(a, b) for a, b in pairwise(np.unique(values).tolist()))


def _nameless(tokens: Mapping[int, Token], entries: Sequence[Entry]) -> bool:
    """Whether the names have no word besides the numbers, so that T12 and T13 are rather tyres than temperatures."""
    words = [token.text for index in tokens for token in entries[index].name if token.what == "word"]
    return all(plain(word) in PASSED_OVER for word in words)


def _wanted(what: str, tokens: Mapping[int, Token], entries: Sequence[Entry]) -> bool:
    """Whether some of the tests need a value of a condition that their names do not state with its unit."""
    moving = any(entry.kind != "static" for entry in entries)
    return any(
        not (what == "preload" and moving and entries[index].kind == "static")
        and not any(token.what == what for token in entries[index].name)
        for index in tokens
    )


def _hertz(tokens: dict[int, Token], entries: Sequence[Entry]) -> float:
    """1 for numbers in Hz, 1/60 for rpm, if most of them are the frequencies of the recordings; else 0."""
    pairs = [
        (token.value, entries[index].frequency)
        for index, token in tokens.items()
        if entries[index].kind != "static" and np.isfinite(entries[index].frequency)
    ]
    for scale in (1.0, 1 / 60):
        if pairs and np.mean([FREQUENCY.same(value * scale, shows) for value, shows in pairs]) >= 0.8:
            return scale
    return 0.0


def _whole(values: np.ndarray) -> bool:  # type: ignore[type-arg]
    """Whether all numbers are whole."""
    return bool(np.all(values == np.round(values)))


def _with(entry: Entry, numbers: dict[_Slot, Token], meanings: Mapping[_Slot, _Meaning]) -> Entry:
    """The entry with conditions in place of numbers of known meaning; other numbers with a key become words."""
    changed: dict[int, Token] = {}
    for slot, token in numbers.items():
        meaning = meanings.get(slot)
        if meaning is not None:
            value = token.value * meaning.scale
            taken = f"{token.text.strip()!r} {meaning.doubt}: {_written(meaning.what, value)}" if meaning.doubt else ""
            if taken and len(token.key) < 2 and token.value < _SMALL:
                taken += " (or is it the number of a specimen?)"
            changed[id(token)] = replace(token, what=meaning.what, value=value, doubt=taken)
        elif token.keys and token.key:
            changed[id(token)] = replace(token, what="word")
    name, header, folder = (tuple(changed.get(id(token), token) for token in tokens) for _, tokens in entry.parts)
    return replace(entry, name=name, header=header, folder=folder)


def constructions_of(conditions: Sequence[RecordingConditions]) -> dict[str, str]:
    """The construction of each tyre, as stated or by the name of the tyre; empty if it is not known."""
    found: dict[str, str] = {}
    for one in conditions:
        if one.tyre:
            name = re.sub(r"[\W_]", "", one.tyre.casefold())
            named = next((construction for word, construction in CONSTRUCTIONS if word in name), "")
            found[one.tyre] = found.get(one.tyre) or one.construction or named
    return found
