"""Conditions of the tests of a folder: what their names, headers and notes state, compared over all tests.

Numbers without a unit become conditions where their place in all names shows which. The words that differ between
tests name the tyres. Dates, serial numbers and words that all tests share are not used.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fourpole.core.condition import AXES, FREQUENCY, axis_of
from fourpole.guess.names import CONDITIONS, KINDS_OF, Token, plain
from fourpole.guess.words import PASSED_OVER

#: Characters of the longest name of a tyre.
_LONGEST_TYRE = 60
#: The tolerances of the rule of one condition, and that of a frequency, by the name of the condition.
_AXES = {axis.name: axis for axis in (*AXES, FREQUENCY)}
#: Unit in which a condition is written in a doubt, and the SI value of one such unit.
_SHOWN = {one.key: (one.shown, one.scale) for one in CONDITIONS}


@dataclass(frozen=True)
class Entry:
    """Kind, frequency and tokens of one recording; tokens of nearer folders come before those of farther ones.

    Attributes
    ----------
    kind : str
        "static", "dynamic" or "calibration".
    frequency : float [Hz]
        Frequency of the recording; not-a-number where it shows none.
    name, header, folder : tuple of Token
        Tokens of its name, of its header, and of the notes of its folder.
    """

    kind: str
    frequency: float
    name: tuple[Token, ...]
    header: tuple[Token, ...] = ()
    folder: tuple[Token, ...] = ()

    @property
    def parts(self) -> tuple[tuple[str, tuple[Token, ...]], ...]:
        """The tokens by place: name, header, folder. A token of an earlier place has priority."""
        return ("name", self.name), ("header", self.header), ("folder", self.folder)

    def stated(self, what: str) -> str:
        """Text of the first token of a kind in header or notes; empty if there is none."""
        return next((token.text.strip() for token in (*self.header, *self.folder) if token.what == what), "")


@dataclass
class RecordingConditions:
    """Conditions of one recording in SI, its tyre, and its doubts as (subject, text)."""

    values: dict[str, float] = field(default_factory=dict)
    tyre: str = ""
    construction: str = ""
    repeat: str = ""
    doubts: list[tuple[str, str]] = field(default_factory=list)

    def doubt(self, about: str, text: str) -> None:
        """Add a doubt on a subject."""
        self.doubts.append((about, text))

    def assume_tyre(self, name: str, text: str) -> None:
        """Set the name of the tyre, and add the doubt on it."""
        self.tyre = name
        self.doubt("tyre", text)


def read_conditions(entries: Sequence[Entry]) -> list[RecordingConditions]:
    """The conditions of each recording, in the order of the entries."""
    entries = _interpreted(entries)
    conditions = [_values(entry) for entry in entries]
    repeats = [_repeat(entry) for entry in entries]
    counted = [repeat for repeat in repeats if repeat]
    if len(set(repeats)) > 1 and len(set(counted)) < len(counted):
        for one, repeat in zip(conditions, repeats, strict=True):
            one.repeat = repeat
    _name_tyres([pair for pair in zip(entries, conditions, strict=True) if pair[0].kind != "calibration"])
    return conditions


def _repeat(entry: Entry) -> str:
    """The number of the repeat as text; empty if none is stated."""
    return " ".join(f"{token.value:g}" for token in (*entry.name, *entry.header) if token.what == "repeat")


def _values(entry: Entry) -> RecordingConditions:
    """The conditions of one recording; its name has priority over its header, and the header over the notes."""
    conditions = RecordingConditions()
    places = {"name": "its name", "header": "its header", "folder": "notes"}
    for place, tokens in entry.parts:
        for token in tokens:
            what = token.what
            if what not in KINDS_OF:
                continue
            if what not in conditions.values:
                conditions.values[what] = token.value
                if token.doubt:
                    conditions.doubt(what, token.doubt)
            elif not (_AXES.get(what) or axis_of(what)).same(conditions.values[what], token.value):
                taken = _written(what, conditions.values[what])
                conditions.doubt(what, f"{taken} is taken, {places[place]} also says {token.text!r}")
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


#: Meanings of numbers without a unit; the first that fits counts.
_MEANINGS = (
    _Meaning("pressure", 1e5, "taken as bar", 0.3, 10.0, keyed=True),
    _Meaning("pressure", 1e5, "taken as bar", 0.3, 10.0, fractional=True),
    _Meaning("pressure", 1e4, "taken as tenths of a bar (if it is psi, correct it)", 10.0, 99.9, keyed=True),
    _Meaning("pressure", 1e3, "taken as kPa", 100.0, 999.0, keyed=True),
    _Meaning("pressure", 1e3, "taken as kPa", 100.0, 450.0),
    _Meaning("preload", 1.0, "taken as N", 50.0, keyed=True),
    _Meaning("preload", 1.0, "taken as N", 300.0, 50_000.0),
    _Meaning("preload", 1e3, "taken as kN", high=49.9, keyed=True, fractional=True),
    _Meaning("temperature", 1.0, "taken as °C", 10.0, 90.0, keyed=True),
    _Meaning("added_mass", 1.0, "taken as kg", high=100.0, keyed=True),
    _Meaning("amplitude", 1e-3, "taken as mm", high=49.9, keyed=True, fractional=True),
)


def _interpreted(entries: Sequence[Entry]) -> list[Entry]:
    """The entries with numbers without units as conditions, where the numbers of one slot show which."""
    placed = [_slots(entry) for entry in entries]
    slots: dict[_Slot, dict[int, Token]] = {}
    for index, own in enumerate(placed):
        for slot, token in own.items():
            slots.setdefault(slot, {})[index] = token
    found = {slot: _meaning(tokens, entries) for slot, tokens in slots.items()}
    meanings = {slot: meaning for slot, meaning in found.items() if meaning is not None}
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
    found: dict[_Slot, _Meaning] = {}
    for slot, tokens in slots.items():
        if slot not in meanings and not next(iter(tokens.values())).keys:
            alike = [one for one in pressures if values[slot] <= values[one]]
            if alike:
                found[slot] = meanings[alike[0]]
    return found


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
    keys = next(iter(tokens.values())).keys
    hertz = _hertz(tokens, entries)
    if hertz and (not keys or "frequency" in keys):
        return _Meaning("frequency", hertz)
    if keys == ("frequency",) or (not keys and _counts(values)):
        return None
    possible = keys or ("pressure", "preload")
    fitting = (one for what in possible for one in _MEANINGS if one.what == what and one.fits(values, keyed=bool(keys)))
    return next(fitting, None)


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


def _counts(values: np.ndarray) -> bool:  # type: ignore[type-arg]
    """Whether numbers only count the recordings: all are whole, and none stands twice."""
    return _whole(values) and values.size >= 4 and np.unique(values).size == values.size


def _with(entry: Entry, numbers: dict[_Slot, Token], meanings: Mapping[_Slot, _Meaning]) -> Entry:
    """The entry with conditions in place of numbers of known meaning; other numbers with a key become words."""
    changed: dict[int, Token] = {}
    for slot, token in numbers.items():
        meaning = meanings.get(slot)
        if meaning is not None:
            value = token.value * meaning.scale
            taken = f"{token.text.strip()!r} {meaning.doubt}: {_written(meaning.what, value)}" if meaning.doubt else ""
            changed[id(token)] = replace(token, what=meaning.what, value=value, doubt=taken)
        elif token.keys and token.key:
            changed[id(token)] = replace(token, what="word")
    name, header, folder = (tuple(changed.get(id(token), token) for token in tokens) for _, tokens in entry.parts)
    return replace(entry, name=name, header=header, folder=folder)


# --- the tyre ----------------------------------------------------------------------------------------------------


def _name_tyres(tests: Sequence[tuple[Entry, RecordingConditions]]) -> None:
    """Fill in the tyre of each test: as header or notes state it, else by the words of the names that differ."""
    _name_by_words(tests)
    if not any(conditions.tyre for _, conditions in tests):
        _name_by_numbers(tests)
    if not any(conditions.tyre for _, conditions in tests):
        for _, conditions in tests:
            conditions.assume_tyre("tyre", "no name of a tyre was found: all tests are taken as of one tyre")
    _doubt_joined([conditions for _, conditions in tests])
    for _, conditions in tests:
        if not conditions.tyre:
            conditions.assume_tyre("unnamed", "its tyre is not named")


def _name_by_words(tests: Sequence[tuple[Entry, RecordingConditions]]) -> None:
    """Name the tyres as stated, or by words if more names made of words are repeated than tyres are stated."""
    stated = [entry.stated("tyre") or entry.stated("construction") for entry, _ in tests]
    words = _distinguishing([_words(entry) for entry, _ in tests], [entry.kind for entry, _ in tests])
    often = Counter(tuple(map(plain, own)) for own in words if own)
    by_words = sum(count > 1 for count in often.values()) > len(set(map(plain, stated)))
    spelling: dict[str, str] = {}
    for (entry, conditions), own, tyre in zip(tests, words, stated, strict=True):
        joined = " ".join(own)[:_LONGEST_TYRE].strip()
        name = joined if not tyre or (by_words and joined) else tyre
        conditions.tyre = spelling.setdefault(plain(name), name)
        conditions.construction = entry.stated("construction")


def _name_by_numbers(tests: Sequence[tuple[Entry, RecordingConditions]]) -> None:
    """Name the tyres by a number without a meaning, if few numbers stand in many names."""
    left = [[t for t in entry.name if t.what == "number" and not t.keys and t.value.is_integer()] for entry, _ in tests]
    if not all(left):
        return
    numbers = [tokens[0].text for tokens in left]
    if 1 < len(set(numbers)) <= len(tests) / 4:
        listed = ", ".join(sorted(set(numbers))[:6])
        for (_, conditions), number in zip(tests, numbers, strict=True):
            conditions.assume_tyre(f"#{number}", f"the numbers {listed} of their names are taken as those of the tyres")


def _doubt_joined(tested: Sequence[RecordingConditions]) -> None:
    """Add a doubt on names of several words if a word is in several names: it may be an operator, or a state."""
    names = {plain(conditions.tyre): conditions.tyre for conditions in tested}
    often = Counter(plain(word) for name in names.values() for word in name.split())
    several = any(len(name.split()) > 1 for name in names.values())
    if len(names) >= 4 and several and max(often.values(), default=0) > 1:
        listed = ", ".join(list(names.values())[:4])
        for conditions in tested:
            conditions.doubt(
                "tyre",
                f"{len(names)} tyres by the words that vary ({listed} ...): if some of them are not of a tyre, take "
                "them out",
            )


def _words(entry: Entry) -> list[str]:
    """Words of a name that may be of the tyre, each in one spelling."""
    words = [token.text for token in entry.name if token.what == "word"]
    return list(dict.fromkeys(word for word in words if plain(word) and plain(word) not in PASSED_OVER))


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
