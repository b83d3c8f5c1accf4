"""Words, in several languages, by which people name recordings, conditions and specimens: `words/vocabulary.toml`."""

from __future__ import annotations

import re
from collections.abc import Mapping

from fourpole.words import vocabulary

_NAMES = vocabulary()["names"]


def words(text: str) -> frozenset[str]:
    """The words of a text as a set."""
    return frozenset(text.split())


def _patterns(patterns: Mapping[str, str]) -> tuple[tuple[str, re.Pattern[str]], ...]:
    """Names with their compiled patterns, in the given order."""
    return tuple((what, re.compile(pattern)) for what, pattern in patterns.items())


#: Endings of file names that identify a format; any other text behind a dot is part of the name.
ENDINGS = words(_NAMES["endings"])
#: Conditions that the letters before a number may identify; of several, the value of the number selects one.
KEYS: dict[str, tuple[str, ...]] = {word: (what,) for what, text in _NAMES["keys"].items() for word in text.split()}
KEYS["f"] = KEYS["n"] = ("frequency", "preload")
#: Letters before a number that neither states a condition nor is a word: a number of a specimen, or of a recording.
MARKS = ("serial", "number", "count")
#: Units behind a number in a name: pattern of the text, unit, and condition that a number with this unit states.
UNITS: tuple[tuple[str, str, str], ...] = tuple((pattern, unit, what) for pattern, unit, what in _NAMES["units"])
#: Words that identify the kind of a test; the first kind that has a word counts.
KIND_WORDS = {kind: words(text) for kind, text in _NAMES["kinds"].items()}
#: Words in names of recordings that are no part of a specimen's name.
PASSED_OVER = words(_NAMES["passed_over"])
#: Words that rather name a place, a direction, a state or a condition of a specimen than a specimen.
STATES = words(_NAMES["states"])
#: Constructions, each by a part of a tyre's name that identifies it.
CONSTRUCTIONS: tuple[tuple[str, str], ...] = tuple((part, name) for part, name in _NAMES["constructions"])
#: Meanings of the key of a line "key: value" in a header, by patterns; the first matching pattern has priority.
IN_HEADERS = _patterns(_NAMES["headers"])
