"""JSON, TOML and tables of CSV that others wrote, with bounded nesting, integers and cells."""

from __future__ import annotations

import csv
import io
import json
import re
import tomllib
from collections.abc import Iterator
from itertools import islice
from typing import Any

from fourpole.errors import TableError
from fourpole.units import shown

#: Deepest nesting of tables and lists; an integer has at most 64 bits.
_DEEPEST, _LARGEST = 64, 2**63
#: Most values, lists and tables of a JSON document: an empty list of three characters takes 64 bytes of memory.
_MOST_VALUES = 4_000_000
#: Half a character, as JSON can write it: \\ud800.
_HALF = re.compile("[\ud800-\udfff]")
#: More digits than Python reads as an integer; it reads hundreds of them too, but they are refused by their value.
_DIGITS = re.compile(r"(?<![0-9_])[0-9](?:_?[0-9]){4299}")
_TOO_LARGE = "an integer has more than 64 bits; write it with a decimal point"
#: Largest magnitude of a number with a decimal point: its square is still a number.
GREATEST = 1e150
#: Most parts of a dotted key: for each of them tomllib holds a key of all parts before it.
_MOST_PARTS = 16
#: Texts and comments of TOML; each quantifier keeps what it took, so that the time is linear.
_TEXTS = re.compile(
    r'"""(?:[^"\\]|\\.|"{1,2}+(?!"))*+(?:"{3,5}+|\Z)|'
    r"'''(?:[^']|'{1,2}+(?!'))*+(?:'{3,5}+|\Z)|"
    r'"(?:[^"\\\n]|\\.)*+"?|'
    r"'[^'\n]*+'?|"
    r"#[^\n]*+",
    re.DOTALL,
)
#: A number that stands bare behind the sign of a key, with a decimal comma or a unit.
_BARE = re.compile(r"=\s*([-+]?\d+(?:[.,]\d+)?)[ \t]*([A-Za-zµ°%][^,}\]#\n]*)?")
_LETTERS = re.compile(r"[\w-]*[^\W\d_a-zA-Z][\w-]*")
_AT_LINE = re.compile(r"at line (\d+)")
_LONG_KEY = re.compile(rf"(?<![\w.-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{_MOST_PARTS}}}")
#: Most characters of a cell, which is the limit that Python's own reader has unless a program changes it.
MOST_CHARACTERS = 131_072


def json_of(content: bytes | str, name: str) -> Any:
    """The value of a JSON text.

    Raises
    ------
    TableError
        If it is no JSON, has too many values, nests too deep, has an integer of more than 64 bits, a number that is not
        finite, or half a character.

    Examples
    --------
    >>> json_of('{"K1": [1.5, null]}', "a.json")
    {'K1': [1.5, None]}
    """
    text = content if isinstance(content, str) else content.decode("latin-1")
    if sum(map(text.count, ",[{")) > _MOST_VALUES:
        raise TableError(f"{name}: has more than {_MOST_VALUES} values; Fourpole writes no such file")
    try:
        found = json.loads(content, parse_constant=_no_constant)
    except RecursionError:
        raise TableError(f"{name}: nests more than {_DEEPEST} levels deep; Fourpole writes no such file") from None
    except json.JSONDecodeError as error:
        raise TableError(f"{name}: is not valid JSON ({error})") from None
    except ValueError as error:
        raise TableError(_of_digits(content, name) or f"{name}: is not valid JSON ({error})") from None
    _check_value(found, name)
    return found


def toml_of(text: str, name: str) -> dict[str, Any]:
    """The tables of a TOML text.

    Raises
    ------
    TableError
        If it is no TOML, nests too deep, or has an integer of more than 64 bits. A decimal comma, and a unit without
        quotation marks, are named with what to write.

    Examples
    --------
    >>> toml_of("channels.force_in.unit = 'N'", "a.toml")
    {'channels': {'force_in': {'unit': 'N'}}}
    """
    # A quoted key is one part of a dotted one, and a comment none.
    if _LONG_KEY.search(_TEXTS.sub(lambda found: "" if found[0].startswith("#") else "x", text)):
        raise TableError(f"{name}: a key has more than {_MOST_PARTS} parts; state it flat")
    try:
        found = tomllib.loads(text)
    except RecursionError:
        raise TableError(f"{name}: not valid TOML: nests more than {_DEEPEST} levels deep; state it flat") from None
    except ValueError as error:
        if why := _of_digits(text, name) or _of_bare(text, str(error), name):
            raise TableError(why) from None
        end = f"at line {text.count(chr(10)) + 1}, the end of the document"
        raise TableError(f"{name}: not valid TOML: {str(error).replace('at end of document', end)}") from None
    _check_value(found, name)
    return found


def rows_of(text: str, name: str) -> Iterator[tuple[int, list[str]]]:
    r"""The rows of a CSV table with at least one cell, each with the number of its last line.

    The delimiter is a comma, semicolon or tab, the one that the first line has most of.

    Raises
    ------
    TableError
        If a cell is too long, as after a quotation mark that is never closed.

    Examples
    --------
    >>> list(rows_of("test;kind\nD1;dynamic\n", "tests.csv"))
    [(1, ['test', 'kind']), (2, ['D1', 'dynamic'])]
    """
    text = text.lstrip("\ufeff")
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter_of(text), skipinitialspace=True)
    try:
        for cells in reader:
            if max(map(len, cells), default=0) > MOST_CHARACTERS:
                raise csv.Error  # another library may have raised the limit of Python's reader
            if cells:
                yield reader.line_num, cells
    except csv.Error:
        line = next(islice(io.StringIO(text, newline=""), reader.line_num - 1, None), "")
        lengths = map(len, line.split(delimiter_of(text)))
        column = next((f", column {place}" for place, length in enumerate(lengths, 1) if length > MOST_CHARACTERS), "")
        raise TableError(
            f"{name} row {reader.line_num}{column}: a cell has more than {MOST_CHARACTERS} characters: shorten it, or "
            "close its quotation mark"
        ) from None


def delimiter_of(text: str) -> str:
    """The delimiter of a CSV table: a comma, semicolon or tab."""
    head = text.split("\n", 1)[0]
    return max(",;\t", key=head.count)


def _no_constant(text: str) -> float:
    raise ValueError(f"{text} is no number of JSON")


def _of_digits(content: bytes | str, name: str) -> str:
    """Message on an integer of more digits than Python reads; empty if there is none."""
    text = content.decode(errors="replace") if isinstance(content, bytes) else content
    found = _DIGITS.search(text)
    return f"{name} line {text.count(chr(10), 0, found.start()) + 1}: {_TOO_LARGE}" if found else ""


def _of_bare(text: str, error: str, name: str) -> str:
    """Message on a decimal comma, or on a unit or a name that lacks its quotation marks, where TOML has an error."""
    place = _AT_LINE.search(error)
    line = text.split("\n")[int(place[1]) - 1] if place else ""
    key = line.partition("=")[0].strip()
    if not _TEXTS.sub("", key).isascii():
        quoted = _LETTERS.sub(r'"\g<0>"', key)
        where = f"{name} line {place[1] if place else 0}"
        return f"{where}: a name with an umlaut or accent stands in quotation marks: {quoted}"
    found = _BARE.search(line)
    if not found or not (found[2] or "," in found[1]):
        return ""
    written = f"{found[1]} {found[2] or ''}".strip()
    right = written.replace(",", ".")
    what = "has a decimal comma" if "," in found[1] else "has a unit, so it is a text in quotation marks"
    return f"{name} line {place[1] if place else 0}: {written} {what}: write " + (f'"{right}"' if found[2] else right)


def _check_value(value: Any, name: str) -> None:
    """TableError for nesting, an integer or a text beyond the bounds; level by level, without recursion."""
    level = [value]
    for _ in range(_DEEPEST + 1):
        if not level:
            return
        for one in level:
            if type(one) is int and not -_LARGEST <= one < _LARGEST:
                raise TableError(f"{name}{_place_of(one, value)}: {shown(one, 30)}: {_TOO_LARGE}")
            if type(one) is float and abs(one) > GREATEST:
                why = f"a number is beyond {GREATEST:g}; mend or remove it"
                raise TableError(f"{name}{_place_of(one, value)}: {one}: {why}")
            if type(one) is str and not one.isascii() and _HALF.search(one):
                why = "a text has half a character, which no file can hold; write it whole"
                raise TableError(f"{name}{_place_of(one, value)}: {why}")
        level = [
            inner
            for one in level
            if isinstance(one, dict | list)
            for inner in ((*one, *one.values()) if isinstance(one, dict) else one)
        ]
    raise TableError(f"{name}: nests more than {_DEEPEST} levels deep; state it flat")


def _place_of(sought: Any, value: Any) -> str:
    """The keys that lead to a value, as ": rig.moving_mass"; empty if it is itself a key."""
    level = [("", value)]
    for _ in range(_DEEPEST):
        level = [
            (f"{path}.{key}" if path else f": {shown(str(key))[1:-1]}", inner)
            for path, one in level
            if isinstance(one, dict | list)
            for key, inner in (one.items() if isinstance(one, dict) else enumerate(one, 1))
        ]
        for path, one in level:
            if one is sought:
                return path
    return ""
