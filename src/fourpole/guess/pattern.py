"""A pattern of the names of recordings, as a user states it: "{specimen}_{pressure}bar_{frequency}Hz"."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fourpole import units
from fourpole.errors import CampaignError
from fourpole.guess.names import CONDITIONS, KINDS_OF, Token, without_ending
from fourpole.guess.words import UNITS
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
