"""Conditions of the tests: what varies over the folder, told from dates, serial numbers and words that say nothing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fourpole.guess.names import KINDS_OF, Token, plain
from fourpole.guess.words import PASSED_OVER

__all__ = ["Entry", "Told", "tell"]

_SAME = 0.02
_LONGEST_TYRE = 60


@dataclass(frozen=True)
class Entry:
    """What is known of a recording before the folder is looked at as a whole; the nearest tokens come first."""

    kind: str
    frequency: float
    name: tuple[Token, ...]
    header: tuple[Token, ...] = ()
    folder: tuple[Token, ...] = ()


@dataclass
class Told:
    """Conditions of one recording in SI, its tyre, and what is doubtful: (about, text)."""

    values: dict[str, float] = field(default_factory=dict)
    tyre: str = ""
    construction: str = ""
    repeat: str = ""
    doubts: list[tuple[str, str]] = field(default_factory=list)


def tell(entries: Sequence[Entry]) -> list[Told]:
    """The conditions of each recording."""
    settled = _settled(entries)
    told = [_values(entry) for entry in settled]
    repeats = [_repeat(entry) for entry in settled]
    if len(set(repeats)) > 1 and len({one for one in repeats if one}) < sum(bool(one) for one in repeats):
        for one, repeat in zip(told, repeats, strict=True):
            one.repeat = repeat
    _name_tyres(settled, told)
    return told


def _repeat(entry: Entry) -> str:
    found = [token for token in (*entry.name, *entry.header) if token.what == "repeat"]
    return " ".join(f"{token.value:g}" for token in found)


def _values(entry: Entry) -> Told:
    """The first that states each condition: the name, the header, then the folder's notes; others must agree."""
    told = Told()
    for where, tokens in (("its name", entry.name), ("its header", entry.header), ("notes", entry.folder)):
        for token in tokens:
            if token.what not in KINDS_OF:
                continue
            before = told.values.get(token.what)
            if before is None:
                told.values[token.what] = token.value
                if token.doubt:
                    told.doubts.append((token.what, token.doubt))
            elif abs(before - token.value) > _SAME * max(abs(before), abs(token.value)):
                text = f"{_written(token.what, before)} is taken, {where} also says {token.text!r}"
                told.doubts.append((token.what, text))
    return told


def _written(what: str, value: float) -> str:
    scale, unit = _WRITTEN.get(what, (1.0, ""))
    return f"{value / scale:g} {unit}".strip()


_WRITTEN = {
    "pressure": (1e5, "bar"),
    "preload": (1.0, "N"),
    "frequency": (1.0, "Hz"),
    "temperature": (1.0, "°C"),
    "added_mass": (1.0, "kg"),
    "amplitude": (1e-3, "mm"),
}


# --- numbers without units ---------------------------------------------------------------------------------------


def _settled(entries: Sequence[Entry]) -> list[Entry]:
    """Numbers without units become conditions where their slot tells which."""
    meaning: dict[tuple[object, ...], tuple[str, float, str]] = {}
    places = [_places(entry) for entry in entries]
    slots: dict[tuple[object, ...], dict[int, Token]] = {}
    for index, at in enumerate(places):
        for place, token in at.items():
            slots.setdefault(place, {})[index] = token
    for place, tokens in slots.items():
        found = _meaning(tokens, entries)
        if found is not None:
            meaning[place] = found
    known = _raw_values(meaning, slots)
    for place, tokens in slots.items():  # a number of static tests that dynamic ones have as theirs
        if place not in meaning and not next(iter(tokens.values())).keys:
            values = {token.value for token in tokens.values()}
            fitting = [found for found, theirs in known if values <= theirs]
            if fitting:
                meaning[place] = fitting[0]
    return [_with(entry, at, meaning) for entry, at in zip(entries, places, strict=True)]


def _places(entry: Entry) -> dict[tuple[object, ...], Token]:
    """Each number of a name by its key, or by its place among the numbers without one."""
    found: dict[tuple[object, ...], Token] = {}
    for where, tokens in (("name", entry.name), ("header", entry.header), ("folder", entry.folder)):
        bare = [token for token in tokens if token.what == "number" and not token.keys]
        for at, token in enumerate(bare):
            found[where, entry.kind == "static", len(bare), at] = token
        for token in tokens:
            if token.what == "number" and token.keys:
                found.setdefault((where, entry.kind == "static", token.key), token)
    return found


def _raw_values(
    meaning: dict[tuple[object, ...], tuple[str, float, str]], slots: dict[tuple[object, ...], dict[int, Token]]
) -> list[tuple[tuple[str, float, str], set[float]]]:
    return [
        (found, {token.value for token in slots[place].values()})
        for place, found in meaning.items()
        if found[0] == "pressure"
    ]


def _meaning(tokens: dict[int, Token], entries: Sequence[Entry]) -> tuple[str, float, str] | None:
    """Condition, SI value of one, and doubt with a place for the number as written; None where nothing tells."""
    values = np.array([token.value for token in tokens.values()])
    keys = next(iter(tokens.values())).keys
    turning = _of_frequency(tokens, entries)
    if turning and (not keys or "frequency" in keys):
        return "frequency", turning, ""
    if keys == ("frequency",) or (not keys and _counts(values)):
        return None
    possible = [what for what in keys if what != "frequency"] if keys else ["pressure", "preload"]
    for what in possible:
        scale = _SCALES[what](values, bool(keys)) if what in _SCALES else None
        if scale is not None:
            return what, scale[0], scale[1]
    return None


def _of_frequency(tokens: dict[int, Token], entries: Sequence[Entry]) -> float:
    """1 for Hz or 1/60 for rpm, where numbers follow the frequencies of the recordings; else 0."""
    pairs = [
        (token.value, entries[index].frequency)
        for index, token in tokens.items()
        if entries[index].kind != "static" and np.isfinite(entries[index].frequency)
    ]
    if not pairs:
        return 0.0
    for scale in (1.0, 1 / 60):
        close = [abs(value * scale - seen) <= _SAME * seen for value, seen in pairs]
        if np.mean(close) >= 0.8:
            return scale
    return 0.0


def _counts(values: np.ndarray) -> bool:  # type: ignore[type-arg]
    """Whether numbers only count the recordings: whole, and each its own."""
    whole = np.all(values == np.round(values))
    return bool(whole and values.size >= 4 and np.unique(values).size == values.size)


def _pressure(values: np.ndarray, keyed: bool) -> tuple[float, str] | None:  # type: ignore[type-arg]
    low, high = values.min(), values.max()
    if low < 0.3:
        return None
    if high <= 10 and (keyed or np.any(values != np.round(values))):
        return 1e5, "taken as bar"
    if keyed and low >= 10 and high < 100:
        return 1e4, "taken as tenths of a bar (if it is psi, correct it)"
    if low >= 100 and high <= 999 and (keyed or high <= 450):
        return 1e3, "taken as kPa"
    return None


def _load(values: np.ndarray, keyed: bool) -> tuple[float, str] | None:  # type: ignore[type-arg]
    if (values.min() >= 50 and keyed) or (values.min() >= 300 and values.max() <= 50_000):
        return 1.0, "taken as N"
    if keyed and np.any(values != np.round(values)) and values.max() < 50:
        return 1e3, "taken as kN"
    return None


def _temperature(values: np.ndarray, keyed: bool) -> tuple[float, str] | None:  # type: ignore[type-arg]
    return (1.0, "taken as °C") if keyed and values.min() >= 10 and values.max() <= 90 else None


def _mass(values: np.ndarray, keyed: bool) -> tuple[float, str] | None:  # type: ignore[type-arg]
    return (1.0, "taken as kg") if keyed and values.max() <= 100 else None


def _amplitude(values: np.ndarray, keyed: bool) -> tuple[float, str] | None:  # type: ignore[type-arg]
    return (1e-3, "taken as mm") if keyed and np.any(values != np.round(values)) and values.max() < 50 else None


_SCALES = {
    "pressure": _pressure,
    "preload": _load,
    "temperature": _temperature,
    "added_mass": _mass,
    "amplitude": _amplitude,
}


def _with(
    entry: Entry, at: dict[tuple[object, ...], Token], meaning: dict[tuple[object, ...], tuple[str, float, str]]
) -> Entry:
    """An entry whose numbers are conditions where that is known; other letters with a number are words again."""
    changed: dict[int, Token] = {}
    for place, token in at.items():
        found = meaning.get(place)
        if found is not None:
            what, scale, doubt = found
            value = token.value * scale
            text = f"{token.text.strip()!r} {doubt}: {_written(what, value)}" if doubt else ""
            changed[id(token)] = replace(token, what=what, value=value, doubt=text)
        elif token.keys and token.key:
            changed[id(token)] = replace(token, what="word")
    parts = (
        tuple(changed.get(id(token), token) for token in tokens) for tokens in (entry.name, entry.header, entry.folder)
    )
    name, header, folder = parts
    return replace(entry, name=name, header=header, folder=folder)


# --- the tyre ----------------------------------------------------------------------------------------------------


def _name_tyres(entries: Sequence[Entry], told: Sequence[Told]) -> None:
    """Fill in the tyre of each recording: as stated, else by the words of its name that tell."""
    tested = [index for index, entry in enumerate(entries) if entry.kind != "calibration"]
    stated = {index: _said(entries[index], "tyre") or _said(entries[index], "construction") for index in tested}
    words = _telling([_words(entries[index]) for index in tested], [entries[index].kind for index in tested])
    often = Counter(tuple(map(plain, one)) for one in words if one)
    by_words = sum(count > 1 for count in often.values()) > len({plain(one) for one in stated.values()})
    display: dict[str, str] = {}
    for index, own in zip(tested, words, strict=True):
        joined = " ".join(own)[:_LONGEST_TYRE].strip()
        name = stated[index] if stated[index] and not (by_words and joined) else joined
        told[index].tyre = display.setdefault(plain(name), name)
        told[index].construction = _said(entries[index], "construction")
    if tested and not any(told[index].tyre for index in tested):
        _name_by_numbers(entries, told, tested)
    if tested and not any(told[index].tyre for index in tested):
        for index in tested:
            told[index].tyre = "tyre"
            told[index].doubts.append(("tyre", "no name of a tyre was found: all tests are taken as of one tyre"))
    _doubt_joined(told, tested)
    for index in tested:
        if not told[index].tyre:
            told[index].doubts.append(("tyre", "its tyre is not named"))
            told[index].tyre = "unnamed"


def _doubt_joined(told: Sequence[Told], tested: list[int]) -> None:
    """Names of several words that vary by themselves may hold more than a tyre: an operator, hot and cold."""
    names = {plain(told[index].tyre): told[index].tyre for index in tested}
    often = Counter(plain(word) for name in names.values() for word in name.split())
    if (
        len(names) >= 4
        and any(count > 1 for count in often.values())
        and max(len(n.split()) for n in names.values()) > 1
    ):
        listed = ", ".join(list(names.values())[:4])
        for index in tested:
            text = (
                f"{len(names)} tyres by the words that vary ({listed} ...): if some of them are not of a "
                f"tyre, take them out"
            )
            told[index].doubts.append(("tyre", text))


def _name_by_numbers(entries: Sequence[Entry], told: Sequence[Told], tested: list[int]) -> None:
    """Few numbers that come again and again, and are nothing else, may count the tyres."""
    left = {
        i: [t for t in entries[i].name if t.what == "number" and not t.keys and t.value.is_integer()] for i in tested
    }
    if not all(left.values()):
        return
    numbers = {index: tokens[0].text for index, tokens in left.items()}
    if 1 < len(set(numbers.values())) <= len(tested) / 4:
        listed = ", ".join(sorted(set(numbers.values()))[:6])
        for index in tested:
            told[index].tyre = f"#{numbers[index]}"
            told[index].doubts.append(("tyre", f"the numbers {listed} of their names are taken as those of the tyres"))


def _said(entry: Entry, what: str) -> str:
    return next((token.text.strip() for token in (*entry.header, *entry.folder) if token.what == what), "")


def _words(entry: Entry) -> list[str]:
    """Words of a name that may tell the tyre, one spelling each."""
    words = [token.text for token in entry.name if token.what == "word"]
    return list(dict.fromkeys(word for word in words if plain(word) and plain(word) not in PASSED_OVER))


def _telling(words: list[list[str]], kinds: list[str]) -> list[list[str]]:
    """Of each recording the words that tell it from others; those that all have only where nothing else is left."""
    sets = [{plain(word) for word in own} for own in words]
    of = {kind: [own for own, one in zip(sets, kinds, strict=True) if one == kind] for kind in set(kinds)}
    everywhere = set.intersection(*sets) if sets else set()
    dropped = set(everywhere)
    for kind, owns in of.items():
        others = set().union(*(own for other, more in of.items() if other != kind for own in more))
        dropped |= set.intersection(*owns) - others
    count = Counter(word for own in sets for word in own)
    dropped |= _counters(count)
    alone = {word for word, often in count.items() if often == 1}
    for owns in of.values():  # each its own word beside others: a label
        if len(owns) > 1 and all(own & alone and own - alone for own in owns):
            dropped |= set().union(*owns) & alone
    if len(words) > 6 and len(alone) >= 0.3 * len(words):
        dropped |= alone
    chosen = [[word for word in own if plain(word) not in dropped] for own in words]
    chosen = _only_of_kind(chosen, kinds)
    if all(chosen):
        return chosen
    return [
        [word for word in own if plain(word) in everywhere or word in some]
        for own, some in zip(words, chosen, strict=True)
    ]


def _counters(count: Counter[str]) -> set[str]:
    """Words that only count the recordings: D1, D2, D3, each once."""
    stems: dict[str, list[str]] = {}
    for word in count:
        if word[-1].isdigit():
            stems.setdefault(word.rstrip("0123456789"), []).append(word)
    return {word for words in stems.values() if len(words) >= 3 and all(count[w] == 1 for w in words) for word in words}


def _only_of_kind(chosen: list[list[str]], kinds: list[str]) -> list[list[str]]:
    """Without words that only one kind of test has, where what is left still names a tyre of the other."""
    of = {
        kind: {plain(w) for own, k in zip(chosen, kinds, strict=True) if k == kind for w in own} for kind in set(kinds)
    }
    shared = set.intersection(*of.values()) if of else set()
    if len(of) < 2 or not shared:
        return chosen
    kept = []
    for own in chosen:
        left = [word for word in own if plain(word) in shared]
        kept.append(left or own)
    return kept
