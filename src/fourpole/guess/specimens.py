"""The specimens of the tests of a folder: stated, or the words and the numbers by which their names differ.

A word or number that splits tests of otherwise equal conditions names their specimens. What could as well be a repeat,
a date, an operator or a state is a doubt, and so are two tests that still are at one condition of one specimen.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from fourpole.core.arrays import IntArray
from fourpole.guess.names import (
    CONSTRUCTIONS,
    KEYS,
    KINDS_OF,
    PASSED_OVER,
    STATES,
    Entry,
    RecordingConditions,
    Token,
    axis_named,
    plain,
)
from fourpole.units import shown

#: Characters of the longest name of a specimen.
_LONGEST = 60
#: Longest word of a state that may be letters of a name: X1 is a name.
_SHORT = 3
#: Names of a few words or numbers in a doubt.
_MOST_LISTED = 5
#: Share of the tests that a mark must have, and largest number of its values per such test: beyond it counts them.
_PRESENT, _COUNTS = 0.8, 0.5
#: Conditions that make tests comparable where they are equal.
_CONDITIONS = ("pressure", "preload", "frequency", "temperature", "added_mass", "amplitude")

#: A test, as what its file states and what was found of it.
_Test = tuple[Entry, RecordingConditions]
#: Place of a mark in the names: its key, and its rank among the marks of that key.
_Slot = tuple[str, int]


def name_specimens(tests: Sequence[_Test]) -> None:
    """Fill in the specimen of each test: as stated, else by the words and the numbers of the names that differ."""
    if not tests:
        return
    _name_by_words(tests)
    _name_by_marks(tests)
    if not any(conditions.tyre for _, conditions in tests):
        for _, conditions in tests:
            conditions.assume_tyre("tyre", "no name of a specimen was found: all tests are taken as of one")
    _doubt_words(tests)
    for _, conditions in tests:
        if not conditions.tyre:
            conditions.assume_tyre("unnamed", "its specimen is not named")


def doubt_equal(tests: Sequence[_Test], names: Sequence[str]) -> None:
    """Add a doubt on tests of one kind at one condition of one specimen that are not numbered as repeats."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for index, (key, (_, conditions)) in enumerate(zip(_conditions(tests), tests, strict=True)):
        groups.setdefault((*key, plain(conditions.tyre), conditions.repeat), []).append(index)
    for members in groups.values():
        first, second = (shown(names[at], 40) for at in (members[0], members[-1]))
        kind, tyre = tests[members[0]][0].kind, shown(tests[members[0]][1].tyre, 40)
        for at in members if len(members) > 1 else ():
            tests[at][1].doubt(
                "tyre",
                f"{len(members)} {kind} tests are at one condition of {tyre}, as {first} and {second}: are they of "
                "several specimens, or repeats?",
            )


def _conditions(tests: Sequence[_Test]) -> list[tuple[object, ...]]:
    """Kind and condition of each test, as equal tuples for tests at the same condition."""
    columns: list[IntArray] = []
    for what in _CONDITIONS:
        values = [conditions.values.get(what) for _, conditions in tests]
        if what == "frequency":
            values = [_frequency(entry, stated) for (entry, _), stated in zip(tests, values, strict=True)]
        columns.append(axis_named(what).groups(values))
    return [(entry.kind, *(int(column[at]) for column in columns)) for at, (entry, _) in enumerate(tests)]


def _frequency(entry: Entry, stated: float | None) -> float | None:
    """The frequency of a test of one sine: that of its recording, else the stated one; None for other tests."""
    if entry.kind not in ("dynamic", "calibration"):
        return None
    return entry.frequency if np.isfinite(entry.frequency) else stated


def _sets(keys: Iterable[object], values: Iterable[str]) -> list[set[str]]:
    """The different values of each key."""
    sets: dict[object, set[str]] = {}
    for key, value in zip(keys, values, strict=True):
        sets.setdefault(key, set()).add(value)
    return list(sets.values())


def _splits(tests: Sequence[_Test], values: Sequence[str]) -> bool:
    """Whether values differ between tests of one specimen, as named so far, at one condition."""
    keys = [
        (*key, plain(conditions.tyre), conditions.repeat)
        for key, (_, conditions) in zip(_conditions(tests), tests, strict=True)
    ]
    return any(len(several - {""}) > 1 for several in _sets(keys, values))


# --- numbers -----------------------------------------------------------------------------------------------------


def _name_by_marks(tests: Sequence[_Test]) -> None:
    """Add numbers to the names of the specimens: serial numbers first, then numbers without a meaning, then dates."""
    slots = _slots(tests)
    for key in ("serial", "number", "date", "count"):
        for slot, values in slots.items():
            if slot[0] == key:
                _consider(key, values, tests)


def _slots(tests: Sequence[_Test]) -> dict[_Slot, list[str]]:
    """Texts of the marks of all tests by their place; empty for a test without it."""
    found: dict[_Slot, list[str]] = {}
    for index, (entry, _) in enumerate(tests):
        rank: Counter[str] = Counter()
        for token in (*entry.name, *entry.header, *entry.folder):
            key = _mark(token)
            if key:
                found.setdefault((key, rank[key]), [""] * len(tests))[index] = token.text.strip()
                rank[key] += 1
    return found


def _mark(token: Token) -> str:
    """Kind of a mark; empty for a token that is none."""
    if token.what == "mark":
        return token.key
    return "number" if token.what == "number" and not token.keys and token.value.is_integer() else ""


def _consider(key: str, values: list[str], tests: Sequence[_Test]) -> None:
    """Add the numbers of one place to the names of the specimens, if they are numbers of specimens."""
    used = [value for value in values if value]
    each = sorted(set(used), key=lambda text: (len(text), text))
    if len(each) < 2 or len(used) < _PRESENT * len(tests) or len(each) > _COUNTS * len(used) or _known(values, tests):
        return
    splits, named = _splits(tests, values), any(conditions.tyre for _, conditions in tests)
    if key == "number" and splits and named and _consecutive(each):
        _number_repeats(tests, values, _listed(each))
    elif (doubt := _doubt_on(key, each, splits=splits, named=named)) is not None:
        _add(tests, values, doubt)


def _doubt_on(key: str, each: Sequence[str], *, splits: bool, named: bool) -> str | None:
    """The doubt with which numbers are taken as those of specimens, empty for none; None if they are not taken.

    `splits` says that they differ between tests of one specimen at one condition, `named` that specimens have names.
    """
    listed, alone = _listed(each), "are never at the same condition: are they those of the specimens?"
    taken = f"the numbers {listed} of their names are taken as those of the specimens"
    if key in ("date", "count"):
        what = "dates" if key == "date" else "numbers"
        same = f"the {what} {listed} hold the same conditions and are taken as specimens: are they repeats?"
        return same if splits and not named else None
    if key == "serial":
        return "" if splits else f"the serial numbers {listed} {alone}"
    if _consecutive(each):
        return None if named else f"{taken}: or are they repeats?"
    short = min(len(plain(text)) for text in each) < 3
    if splits:
        return taken if short else ""
    return None if named or short else f"the numbers {listed} {alone}"


def _known(values: Sequence[str], tests: Sequence[_Test]) -> bool:
    """Whether each specimen, as named so far, has one number of its own."""
    numbers = _sets((plain(conditions.tyre) for _, conditions in tests), values)
    return all(len(several) == 1 for several in numbers) and len(numbers) > 1


def _consecutive(texts: Sequence[str]) -> bool:
    """Whether numbers are 1, 2, 3 ..., as repeats are, and may have zeros or letters before them."""
    numbers = sorted(int(digits[-1]) for text in texts if (digits := re.findall(r"[0-9]{1,9}", text)))
    return len(numbers) == len(texts) and numbers[0] in (0, 1) and np.all(np.diff(numbers) == 1).item() is True


def _number_repeats(tests: Sequence[_Test], values: Sequence[str], listed: str) -> None:
    """Take the numbers as those of repeats."""
    doubt = f"the numbers {listed} of their names are taken as repeats: or are they specimens?"
    for (_, conditions), value in zip(tests, values, strict=True):
        if value and not conditions.repeat:
            conditions.repeat = value
            conditions.doubt("tyre", doubt)


def _add(tests: Sequence[_Test], values: Sequence[str], doubt: str) -> None:
    """Add the numbers of one place to the names of the specimens."""
    for (_, conditions), value in zip(tests, values, strict=True):
        if value:
            number = f"#{value}" if value.isdigit() and not conditions.tyre else value
            conditions.tyre = f"{conditions.tyre} {number}".strip()
            if doubt:
                conditions.doubt("tyre", doubt)


def _listed(texts: Sequence[str]) -> str:
    more = " ..." if len(texts) > _MOST_LISTED else ""
    return ", ".join(shown(text, 30)[1:-1] for text in texts[:_MOST_LISTED]) + more


# --- words -------------------------------------------------------------------------------------------------------


def _name_by_words(tests: Sequence[_Test]) -> None:
    """Name the tyres as stated, or by words if more names made of words are repeated than tyres are stated."""
    stated = [entry.stated("tyre") or entry.stated("construction") for entry, _ in tests]
    others = _other_words([entry for entry, _ in tests])
    words = _distinguishing([_words(entry, others) for entry, _ in tests], [entry.kind for entry, _ in tests])
    often = Counter(tuple(map(plain, own)) for own in words if own)
    by_words = sum(count > 1 for count in often.values()) > len(set(map(plain, stated)))
    spelling: dict[str, str] = {}
    for (entry, conditions), own, tyre in zip(tests, words, stated, strict=True):
        joined = " ".join(own)[:_LONGEST].strip()
        name = joined if not tyre or (by_words and joined) else tyre
        conditions.tyre = spelling.setdefault(plain(name), name)
        conditions.construction = entry.stated("construction")


def _other_words(entries: Sequence[Entry]) -> set[str]:
    """Words that are not of a tyre: those that are passed over, but for the letters of both sides, l and r.

    So are Chinese and Japanese words that stand directly before the values of one condition, the same in all names.
    """
    tokens = [token for entry in entries for token in entry.name]
    before = [token for token in tokens if token.what in KINDS_OF and token.joined]
    words = _sets((token.what for token in before), (plain(token.joined) for token in before))
    sides = {plain(token.text) for token in tokens if token.what == "word"} & {"l", "r"}
    alike = {next(iter(several)) for several in words if len(several) == 1}
    return alike | (PASSED_OVER - (sides if len(sides) == 2 else set()))


def _doubt_words(tests: Sequence[_Test]) -> None:
    """Add a doubt on specimens that are named by words which may be of a state, an operator or a condition."""
    names = {plain(conditions.tyre): conditions.tyre for _, conditions in tests if conditions.tyre}
    doubted = any(about == "tyre" for _, conditions in tests for about, _ in conditions.doubts)
    if len(names) < 2 or doubted or any(entry.stated("tyre") for entry, _ in tests):
        return
    if why := _doubt_on_words(list(names.values()), tests):
        for _, conditions in tests:
            conditions.doubt("tyre", why)


def _doubt_on_words(names: Sequence[str], tests: Sequence[_Test]) -> str:
    """Why the words that name the specimens may be of something else; empty if there is no doubt."""
    words = [word for name in names for word in name.split()]
    often, listed = Counter(map(plain, words)), _listed(names)
    if len(names) >= 4 and len(words) > len(names) and max(often.values()) > 1:
        return f"{len(names)} specimens by the words that vary ({listed}): if some are not of a specimen, take them out"
    if states := [word for word in words if often[plain(word)] < len(names) and _of_state(word)]:
        some = _listed(list(dict.fromkeys(states)))
        return f"taken as specimens: {listed}; {some} may be a place, a direction, a state or a condition of one"
    if all(re.fullmatch(r"[A-Z]{2,3}", name) for name in names):
        return f"taken as specimens: {listed}; or are they initials of persons?"
    if not any(map(_telling, names)) and not _overlap(tests):
        return f"taken as specimens: {listed}, the words by which names differ; no two are at the same condition"
    return ""


def _of_state(word: str) -> bool:
    """Whether a word is that of a state, or of a condition with its number, as in "camber2"."""
    bare = plain(word)
    stem = bare.rstrip("0123456789")
    return bare in STATES or (len(stem) > _SHORT and stem in STATES)


def _telling(name: str) -> bool:
    """Whether a name is known to be that of a specimen: by its construction, or by a word such as "specimen"."""
    bare = plain(name)
    kinds = any(word in bare for word, _ in CONSTRUCTIONS)
    return kinds or any(bare.startswith(word) for word, what in KEYS.items() if what == ("specimen",))


def _overlap(tests: Sequence[_Test]) -> bool:
    """Whether two specimens were tested at one condition."""
    tyres = _sets(_conditions(tests), (plain(conditions.tyre) for _, conditions in tests))
    return any(len(several) > 1 for several in tyres)


def _words(entry: Entry, others: set[str]) -> list[str]:
    """Words of a name that may be of the tyre, each in one spelling; without the `others`."""
    words = [token.text for token in entry.name if token.what == "word"]
    return list(dict.fromkeys(word for word in words if plain(word) and plain(word) not in others))


def _distinguishing(words: list[list[str]], kinds: list[str]) -> list[list[str]]:
    """The words of each name that differ between tests; words of all tests are kept if a name has no others."""
    sets = [{plain(word) for word in own} for own in words]
    by_kind = _by_kind(sets, kinds)
    everywhere = set.intersection(*sets) if sets else set()
    dropped = everywhere | _labels(list(by_kind.values())) | _names_of_kinds(by_kind)
    chosen = _shared_by_kinds([[word for word in own if plain(word) not in dropped] for own in words], kinds)
    kept = everywhere if not all(chosen) else set()
    return [
        [word for word in own if plain(word) in kept or word in some] for own, some in zip(words, chosen, strict=True)
    ]


def _by_kind(sets: Sequence[set[str]], kinds: Sequence[str]) -> dict[str, list[set[str]]]:
    """The words of each test, by the kind of test."""
    return {kind: [own for own, one in zip(sets, kinds, strict=True) if one == kind] for kind in dict.fromkeys(kinds)}


def _names_of_kinds(by_kind: Mapping[str, Sequence[set[str]]]) -> set[str]:
    """Words that all tests of one kind have, and no test of another kind."""
    found: set[str] = set()
    for kind, owns in by_kind.items():
        others = [own for other, more in by_kind.items() if other != kind for own in more]
        found |= set.intersection(*owns).difference(*others)
    return found


def _labels(by_kind: Sequence[Sequence[set[str]]]) -> set[str]:
    """Words that label single recordings: D1, D2, D3, or a word of its own in each name beside others."""
    tests = [own for owns in by_kind for own in owns]
    count = Counter(word for own in tests for word in own)
    once = {word for word, often in count.items() if often == 1}
    if len(tests) > 6 and len(once) >= 0.3 * len(tests):
        return once
    return _numbered(count, once).union(*(_one_in_each(owns, once) for owns in by_kind))


def _one_in_each(tests: Sequence[set[str]], once: set[str]) -> set[str]:
    """Words that stand once, if each of several tests has such a word beside others; else none."""
    if len(tests) > 1 and all(own & once and own - once for own in tests):
        return once & set().union(*tests)
    return set()


def _numbered(words: Iterable[str], once: set[str]) -> set[str]:
    """Words with the same letters before different numbers, at least three of them, if each stands once."""
    stems: dict[str, set[str]] = {}
    for word in words:
        if word[-1].isdigit():
            stems.setdefault(word.rstrip("0123456789"), set()).add(word)
    return set().union(*(found for found in stems.values() if len(found) >= 3 and found <= once))


def _shared_by_kinds(chosen: list[list[str]], kinds: list[str]) -> list[list[str]]:
    """The names without words that only one kind of test has; a name without other words keeps them."""
    by_kind = _by_kind([set(map(plain, own)) for own in chosen], kinds)
    shared = set.intersection(*(set().union(*owns) for owns in by_kind.values())) if by_kind else set()
    return [[word for word in own if plain(word) in shared] or own for own in chosen]
