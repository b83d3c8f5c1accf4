"""Names of recordings: by a pattern as a user states it, "{specimen}_{pressure}bar_{frequency}Hz"; names of tests."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from fourpole import units
from fourpole.errors import CampaignError
from fourpole.guess.gather import FolderContents, FolderRecording
from fourpole.guess.names import CONDITIONS, KINDS_OF, UNITS, Token, without_ending
from fourpole.units import shown

#: Fields of texts, with the kind of token that each becomes; the names of conditions are further fields.
_TEXTS = {"specimen": "tyre", "tyre": "tyre", "kind": "kind", "test": "test", "repeat": "repeat"}
_VALUES = {one.key: KINDS_OF[one.key] for one in CONDITIONS}
#: Fields for a part of a name without a meaning.
_ANY = ("", "_")
#: Characters of the longest pattern and of the longest name that are read, and of the longest unit.
_LONGEST, _LONGEST_UNIT = 400, 12
_FIELD = re.compile(r"\{([^{}]*)\}")
_NUMBERS = (re.compile(r"[+-]?\d{1,9}(?:[.,]\d{1,9}|p\d{1,3})?"), re.compile(r"[+-]?\d{1,9}"))
_BAND = re.compile(r"(\d{1,6}(?:[.,]\d{1,6})?)(?:-|:|to|bis)(\d{1,6}(?:[.,]\d{1,6})?)")

#: File names that serve as names of tests.
_NAMES_LIKE = re.compile(r"\w[^,;\"'|]{0,59}")


@dataclass(frozen=True)
class _Part:
    """A part of a pattern: a text as it stands, or a field with its unit."""

    text: str = ""
    field: str | None = None
    unit: str = ""


@dataclass(frozen=True)
class NamePattern:
    """A pattern as stated, its parts, and the number of folders that it names."""

    stated: str
    parts: tuple[_Part, ...]
    folders: int

    def tokens(self, file: str) -> tuple[Token, ...] | None:
        """What the name of a recording, "folder/file#group", states by the pattern; None if it does not match."""
        text = unicodedata.normalize("NFC", _compared(file, self.stated, self.folders))[-_LONGEST:]
        found = _match(self.parts, text, 0, 0, set())
        return None if found is None else tuple(_token(part, value) for part, value in found if part.field not in _ANY)


def read_pattern(stated: str) -> NamePattern:
    """A pattern of names; CampaignError with the possible fields if one is not known, stands twice or has no unit.

    Examples
    --------
    >>> pattern = read_pattern("{specimen}_{pressure}bar_{frequency}Hz")
    >>> [(token.what, token.text, token.value) for token in pattern.tokens("2026/radial_1,7bar_10Hz.csv")]
    [('tyre', 'radial', nan), ('pressure', '1,7', 170000.0), ('frequency', '10', 10.0)]
    """
    where = f"--pattern {shown(stated, 100)}"
    if not stated or len(stated) > _LONGEST or _FIELD.sub("", stated).count("{") + _FIELD.sub("", stated).count("}"):
        raise CampaignError(f"{where}: must have 1 to {_LONGEST} characters, and a }} for each {{")
    pieces = _FIELD.split(unicodedata.normalize("NFC", stated))
    parts: list[_Part] = []
    for at, piece in enumerate(pieces):
        if at % 2:
            parts.append(_field(piece, pieces[at + 1], where))
        elif piece:
            parts.append(_Part(text=piece))
    named = [part.field.replace("tyre", "specimen") for part in parts if part.field and part.field not in _ANY]
    for name in named:
        if named.count(name) > 1:
            raise CampaignError(f"{where}: {{{name}}} stands twice: write {{}} for a part without a meaning")
    if not named:
        raise CampaignError(f"{where}: has no field; possible are {_possible()}")
    return NamePattern(stated, tuple(parts), stated.partition("#")[0].count("/"))


def _possible() -> str:
    return ", ".join(f"{{{name}}}" for name in (*_TEXTS, *_VALUES)) + ", and {} for a part without a meaning"


def _field(written: str, after: str, where: str) -> _Part:
    """A field, with the unit in its brackets or that of the text after it."""
    name, unit = units.column_unit(written)
    name = name.strip()
    if name in _TEXTS or name in _ANY:
        return _Part(field=name)
    if name not in _VALUES:
        raise CampaignError(f"{where}: there is no field {shown('{' + written + '}', 40)}; possible are {_possible()}")
    unit = unit or _unit_at(after, _VALUES[name])
    if not unit or not units.is_unit(unit, _VALUES[name]):
        example = next(one.shown for one in CONDITIONS if one.key == name)
        raise CampaignError(
            f"{where}: {{{name}}} has no unit of its kind: write {{{name}}}{example}, or {{{name} [{example}]}} where "
            "the names have none"
        )
    return _Part(field=name, unit=unit)


def _unit_at(text: str, kind: str) -> str:
    """The unit of a kind at the beginning of a text, as names write it, else the longest; empty if there is none."""
    bare = text.lstrip(" ")
    for expression, unit, what in UNITS:
        if KINDS_OF.get(what) == kind and re.match(expression, bare):
            return unit
    for size in range(min(len(bare), _LONGEST_UNIT), 0, -1):
        if not bare[size : size + 1].isalpha() and bare[size - 1].strip(" _-") and units.is_unit(bare[:size], kind):
            return bare[:size]
    return ""


def _compared(file: str, pattern: str, folders: int) -> str:
    """The part of a recording's name that a pattern describes: its last folders, file and group, without an ending."""
    path, _, group = file.partition("#")
    *above, name = path.split("/")
    if group and "#" not in pattern and not folders:
        return group
    kept = "/".join([*above[len(above) - folders :], without_ending(name)] if folders else [without_ending(name)])
    return f"{kept}#{group}" if "#" in pattern else kept


def _match(
    parts: Sequence[_Part], text: str, at: int, start: int, failed: set[tuple[int, int]]
) -> list[tuple[_Part, str]] | None:
    """The fields and their texts from a part and a place on; `failed` are the parts and places that do not match."""
    if at == len(parts):
        return [] if start == len(text) else None
    if (at, start) in failed:
        return None
    part = parts[at]
    for end in _ends(part, text, start):
        rest = _match(parts, text, at + 1, end, failed)
        if rest is not None:
            return rest if part.field is None else [(part, text[start:end]), *rest]
    failed.add((at, start))
    return None


def _ends(part: _Part, text: str, start: int) -> Iterator[int]:
    """Places at which a part that begins at a place may end."""
    if part.field is None:
        if text[start : start + len(part.text)].casefold() == part.text.casefold():
            yield start + len(part.text)
    elif part.field in _VALUES or part.field == "repeat":
        bands = (_BAND,) if part.field == "frequency" else ()
        yield from dict.fromkeys(found.end() for one in (*bands, *_NUMBERS) if (found := one.match(text, start)))
    else:
        border = text.find("/", start)
        yield from range(start + (part.field not in _ANY), (len(text) if border < 0 else border) + 1)


def _token(part: _Part, text: str) -> Token:
    """The token of a field."""
    name = part.field or ""
    if name in _TEXTS:
        value = float(text) if name == "repeat" and text.isdigit() else float("nan")
        return Token(_TEXTS[name], text.strip(), value)
    band = _BAND.fullmatch(text) if name == "frequency" else None
    if band is not None:
        low, high = (_si(one, part.unit, name) for one in band.groups())
        return Token("band", text, low, high=high)
    return Token(name, text, _si(text, part.unit, name))


def _si(text: str, unit: str, name: str) -> float:
    """SI value of a number as it stands in a name, with a point, a comma or a "p"."""
    return float(units.to_si([float(text.replace(",", ".").replace("p", "."))], unit, _VALUES[name])[0])


def named_by(patterns: Sequence[NamePattern], gathered: FolderContents) -> list[int]:
    """Give each recording the tokens of the first pattern that its name matches, else none; the indices of the latter.

    CampaignError if no name matches.
    """
    unmatched: list[int] = []
    for index, one in enumerate(gathered.recordings):
        tokens = next((found for each in patterns if (found := each.tokens(one.file)) is not None), None)
        if tokens is None:
            unmatched.append(index)
        gathered.recordings[index] = replace(one, name=tokens or ())
    if len(unmatched) == len(gathered.recordings):
        stated = " or ".join(shown(one.stated, 100) for one in patterns)
        first = shown(gathered.recordings[0].file, 100)
        raise CampaignError(f"--pattern {stated}: matches the name of no recording; the first one is {first}")
    return unmatched


def test_names(recordings: Sequence[FolderRecording], kinds: Sequence[str]) -> list[str]:
    """Names of the tests: those of their files or groups, with as many folders before them as make them differ.

    S1, D1, C1 ... if file names are long, unusual, or differ in letter case alone.
    """
    stated = [next((token.text for token in one.name if token.what == "test"), "") for one in recordings]
    if all(stated) and len(set(stated)) == len(stated):
        return stated
    parts = [_parts_of(one.file) for one in recordings]
    counts: Counter[str] = Counter()
    for own, one in zip(parts, recordings, strict=True):
        if one.window is not None:
            counts[one.file] += 1
            own[-1] += f"_{counts[one.file]}"
    for depth in range(1, max(map(len, parts)) + 1):
        names = [" ".join(own[-depth:]) for own in parts]
        if len({name.casefold() for name in names}) == len(names):
            break
    if len({name.casefold() for name in names}) == len(names) and all(map(_NAMES_LIKE.fullmatch, names)):
        return names
    counts.clear()
    numbered = []
    for kind in kinds:
        letter = {"static": "S", "calibration": "C"}.get(kind, "D")
        counts[letter] += 1
        numbered.append(f"{letter}{counts[letter]}")
    return numbered


def _parts_of(file: str) -> list[str]:
    """Folders, name without ending and group of a recording; a comma becomes a point, as in "2,1 bar"."""
    path, _, group = file.partition("#")
    *folders, name = path.split("/")
    parts = [*folders, without_ending(name), *([group.rpartition("/")[2]] if group else [])]
    return [re.sub(r"(?<=\d),(?=\d)", ".", part) for part in parts]
