"""JSON and TOML that others wrote, with bounded nesting and bounded integers."""

from __future__ import annotations

import json
import tomllib
from typing import Any

from fourpole.errors import TableError

#: Deepest nesting of tables and lists; an integer has at most 64 bits.
_DEEPEST, _LARGEST = 64, 2**63


def json_of(content: bytes | str, name: str) -> Any:
    """The value of a JSON text.

    Raises
    ------
    TableError
        If it is no JSON, nests too deep, or has an integer of more than 64 bits or a number that is not finite.

    Examples
    --------
    >>> json_of('{"K1": [1.5, null]}', "a.json")
    {'K1': [1.5, None]}
    """
    try:
        found = json.loads(content, parse_constant=_no_constant)
    except RecursionError:
        raise TableError(f"{name}: nests more than {_DEEPEST} levels deep; Fourpole writes no such file") from None
    except ValueError as error:
        raise TableError(f"{name}: is not valid JSON ({error})") from None
    _check_value(found, name)
    return found


def toml_of(text: str, name: str) -> dict[str, Any]:
    """The tables of a TOML text.

    Raises
    ------
    TableError
        If it is no TOML, nests too deep, or has an integer of more than 64 bits.
    """
    try:
        found = tomllib.loads(text)
    except RecursionError:
        raise TableError(f"{name}: not valid TOML: nests more than {_DEEPEST} levels deep; state it flat") from None
    except ValueError as error:
        raise TableError(f"{name}: not valid TOML: {error}") from None
    _check_value(found, name)
    return found


def _no_constant(text: str) -> float:
    raise ValueError(f"{text} is no number of JSON")


def _check_value(value: Any, name: str) -> None:
    """TableError for nesting or an integer beyond the bounds; level by level, without recursion."""
    level = [value]
    for _ in range(_DEEPEST + 1):
        if not level:
            return
        for one in level:
            if type(one) is int and not -_LARGEST <= one < _LARGEST:
                raise TableError(f"{name}: an integer has more than 64 bits; write it with a decimal point")
        level = [
            inner
            for one in level
            if isinstance(one, dict | list)
            for inner in (one.values() if isinstance(one, dict) else one)
        ]
    raise TableError(f"{name}: nests more than {_DEEPEST} levels deep; state it flat")
