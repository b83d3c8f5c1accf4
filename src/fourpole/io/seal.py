r"""The seal of a model file: SHA-256 over its canonical form, of each part and of the whole.

The canonical form is that of RFC 8785 (JSON Canonicalization Scheme): no white space, keys in the order of their UTF-16
code units, numbers in the shortest form that gives the same double, as ECMAScript writes them. So the indentation, the
order of keys, and `1e5` for `100000.0` do not matter, and each other change does.

The seal shows accident and casual change. It is no signature: who changes a file and computes the seal again is not
seen.

References
----------
A. Rundgren, B. Jordan, S. Erdtman, "JSON Canonicalization Scheme (JCS)", RFC 8785, 2020.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from json.encoder import encode_basestring
from typing import Any

KEY, METHOD = "seal", "SHA-256 of the canonical form of RFC 8785"
#: Parts that are sealed value by value; each other value has one mark.
_OPENED = ("models", "maps", "conditions", "rig", "provenance")
#: Hexadecimal digits of the mark of a part; the whole has all 64.
_DIGITS = 16
#: Least exponents of ten from which on ECMAScript writes a number with an exponent, and below which it does.
_LARGE, _SMALL = 21, -6


def canonical(value: Any) -> str:
    r"""The canonical form of a JSON value.

    Parameters
    ----------
    value : None, bool, int, float, str, list or dict
        Numbers are taken as doubles.

    Raises
    ------
    ValueError
        If a number is not finite.
    TypeError
        If a value is of another type.

    References
    ----------
    RFC 8785, section 3.2.

    Examples
    --------
    >>> canonical({"numbers": [333333333.33333329, 1e30, 4.50, 2e-3, 1e-27, -0.0], "a": [True, None, "\u20ac\n"]})
    '{"a":[true,null,"€\\n"],"numbers":[333333333.3333333,1e+30,4.5,0.002,1e-27,0]}'
    """
    if isinstance(value, str):
        return encode_basestring(value)
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    if isinstance(value, int | float):
        return _number(value)
    if isinstance(value, list):
        return f"[{','.join([_number(one) if type(one) is float else canonical(one) for one in value])}]"
    if isinstance(value, dict):
        return _object({key: canonical(part) for key, part in value.items()})
    raise TypeError(f"a {type(value).__name__} has no form in JSON")


def _object(texts: Mapping[str, str]) -> str:
    """The canonical form of an object, from those of its values."""
    keys = sorted(texts, key=None if "".join(texts).isascii() else lambda key: key.encode("utf-16-be"))
    return f"{{{','.join([f'{encode_basestring(key)}:{texts[key]}' for key in keys])}}}"


def _number(value: float) -> str:
    """A number as ECMAScript writes it; Python differs in where the exponent begins, and in "1.0"."""
    try:
        text = repr(float(value))
    except OverflowError:
        raise ValueError("a number is beyond all measure") from None
    mantissa, mark, exponent = text.partition("e")
    if not mark:
        if text[-1] in "nf":
            raise ValueError(f"{text} is no number of JSON")
        return "0" if text == "-0.0" else text.removesuffix(".0")
    power = int(exponent)
    if power >= _LARGE or power < _SMALL:
        return f"{mantissa}e{power:+d}"
    sign, digits = "-" * mantissa.startswith("-"), mantissa.lstrip("-").replace(".", "")
    return sign + (digits.ljust(power + 1, "0") if power > 0 else f"0.{'0' * (-power - 1)}{digits}")


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _parts(part: Mapping[str, Any]) -> tuple[dict[str, str], dict[str, Any]]:
    """Canonical form and mark of each value of an object."""
    both = {key: _part(key, one) for key, one in part.items()}
    return {key: text for key, (text, _) in both.items()}, {key: mark for key, (_, mark) in both.items()}


def _part(key: str, part: Any) -> tuple[str, Any]:
    """Canonical form of a value, and its mark; that of an opened part has the shape of the part."""
    if key in _OPENED and isinstance(part, dict):
        texts, marks = _parts(part)
        return _object(texts), marks
    if key in _OPENED and isinstance(part, list) and all(isinstance(one, dict) for one in part):
        entries = [_parts(one) for one in part]
        return f"[{','.join(_object(texts) for texts, _ in entries)}]", [marks for _, marks in entries]
    text = canonical(part)
    return text, _hash(text)[:_DIGITS]


def sealed(document: Mapping[str, Any], written: str = "") -> dict[str, Any]:
    """The document with its seal, which replaces a former one; `written` is the time of writing."""
    content = {key: part for key, part in document.items() if key != KEY}
    texts, marks = _parts(content)
    seal = {"method": METHOD, **({"written": written} if written else {}), "parts": marks}
    return {**content, KEY: {**seal, "whole": _hash(_object({**texts, KEY: canonical(seal)}))}}


def alterations(document: Mapping[str, Any]) -> list[str]:
    """What was changed in a sealed document since it was sealed, as sentences; empty if nothing was.

    Raises
    ------
    ValueError
        If the document has no canonical form.
    """
    seal = document.get(KEY)
    if not isinstance(seal, dict) or not isinstance(seal.get("parts"), dict):
        return ["its seal was removed or has lost its parts"]
    texts, marks = _parts({key: part for key, part in document.items() if key != KEY})
    found = list(_differences(seal["parts"], marks, ""))
    rest = canonical({key: part for key, part in seal.items() if key != "whole"})
    if not found and _hash(_object({**texts, KEY: rest})) != seal.get("whole"):
        found = ["the seal itself was changed"]
    return found


def _differences(stated: Any, found: Any, where: str) -> Iterator[str]:
    """Sentences on the differences of two sets of marks."""
    if stated == found:
        return
    if isinstance(stated, dict) and isinstance(found, dict):
        for key in sorted({*stated, *found}):
            name = f"{where}.{key}" if where else key
            if key not in found:
                yield f"{name} was removed"
            elif key not in stated:
                yield f"{name} was added"
            else:
                yield from _differences(stated[key], found[key], name)
    elif isinstance(stated, list) and isinstance(found, list):
        yield from _of_lists(stated, found, where)
    else:
        yield f"{where} was changed"


def _of_lists(stated: list[Any], found: list[Any], where: str) -> Iterator[str]:
    """Sentences on the differences of two lists of marks: entries that are gone, are new, or have other places."""
    before, after = ([json.dumps(one, sort_keys=True) for one in part] for part in (stated, found))
    gone, new = _lacking(before, after), _lacking(after, before)
    if len(stated) == len(found) and gone == new:
        if any(before[at] != after[at] for at in range(len(before)) if at not in gone):
            yield f"{where}: the order was changed"
        for at in gone:
            yield from _differences(stated[at], found[at], f"{where}[{at}]")
        return
    if len(stated) != len(found):
        yield f"{where}: {len(stated)} were sealed, {len(found)} are there"
    yield from (f"{where}[{at}] was removed" for at in gone)
    yield from (f"{where}[{at}] was added, or changed and moved" for at in new)
    if not gone and not new:
        yield f"{where}: an entry is there twice, or no longer there twice"


def _lacking(marks: list[str], others: list[str]) -> list[int]:
    """Indices of the marks that are not among others."""
    known = set(others)
    return [index for index, mark in enumerate(marks) if mark not in known]
