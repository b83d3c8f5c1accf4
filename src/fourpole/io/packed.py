"""Values with arrays as bytes and back, without pickle: what a cache keeps and what a worker process answers.

The bytes have a mark, a checksum, a JSON text and the arrays one after the other. Only classes that the reader names
are made, so that bytes of unknown origin can make no other object.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

_MARK = b"FPP1"
#: Length of the mark, the checksum and the length of the JSON text [byte].
_HEAD = 12
#: Each array begins at a multiple of this number of bytes.
_STEP = 8
_KINDS = "biufc"
#: Classes whose values JSON holds as they are.
_ATOMS = frozenset({type(None), bool, int, float, str})
_PLAIN: tuple[Any, ...] = (int, float, str, list, tuple)


def pack(value: Any) -> bytes:
    """The bytes of a value made of numbers, texts, bytes, paths, lists, tuples, dicts, arrays, enums and dataclasses.

    A validated model of pydantic counts as a dataclass.

    Raises
    ------
    TypeError
        If a part of the value is of another kind.

    Examples
    --------
    >>> unpack(pack({"K1": (1.5, None), "load": np.array([1.5, 2.5])}))
    {'K1': (1.5, None), 'load': array([1.5, 2.5])}
    """
    arrays: list[Any] = []
    tree = _plain(value, arrays)
    places, parts, at = [], [], 0
    for array in arrays:
        raw = array.tobytes()
        places.append([array.dtype.str, list(array.shape), at])
        raw += bytes(-len(raw) % _STEP)
        parts.append(raw)
        at += len(raw)
    text = json.dumps([tree, places], separators=(",", ":")).encode()
    text += b" " * (-(_HEAD + len(text)) % _STEP)
    body = b"".join([len(text).to_bytes(4, "little"), text, *parts])
    return _MARK + zlib.crc32(body).to_bytes(4, "little") + body


def unpack(content: bytes | bytearray, classes: Iterable[type] = ()) -> Any:
    """The value of some bytes; arrays share their memory, and can be written if it is that of a bytearray.

    Parameters
    ----------
    content : bytes or bytearray
        What `pack` returned.
    classes : iterable of type
        The dataclasses and enums that may be made.

    Raises
    ------
    ValueError
        If the bytes are cut, changed, or hold another class.

    Examples
    --------
    >>> unpack(b"FPP1 and so on")
    Traceback (most recent call last):
    ...
    ValueError: the bytes are cut or damaged
    """
    body = memoryview(content)[8:]
    whole = content[:4] == _MARK and len(content) >= _HEAD
    if not whole or zlib.crc32(body) != int.from_bytes(content[4:8], "little"):
        raise ValueError("the bytes are cut or damaged")
    length = int.from_bytes(body[:4], "little")
    tree, places = json.loads(bytes(body[4 : 4 + length]))
    arrays = [
        np.ndarray(tuple(shape), np.dtype(kind), buffer=body, offset=4 + length + at) for kind, shape, at in places
    ]
    return _made(tree, arrays, {one.__name__: one for one in classes})


def _plain(value: Any, arrays: list[Any]) -> Any:
    """A value for JSON; each array is replaced by its place in `arrays`."""
    kind = type(value)
    if kind in _ATOMS:
        return value
    if isinstance(value, np.ndarray) and value.dtype.kind in _KINDS:
        return {"a": _placed(value, arrays)}
    if kind is tuple:
        return {"t": [_plain(one, arrays) for one in value]}
    if kind is list:
        return [_plain(one, arrays) for one in value]
    if isinstance(value, Enum):
        return {"e": [kind.__name__, value.name]}
    if isinstance(value, Mapping):
        return {"d": [[_plain(key, arrays), _plain(one, arrays)] for key, one in value.items()]}
    if isinstance(value, np.generic):
        return _plain(value.item(), arrays)
    return _object(value, arrays)


def _object(value: Any, arrays: list[Any]) -> Any:
    """An object for JSON: its kind and its content; a part that is the default of its class is left out."""
    if isinstance(value, Path):
        return {"p": str(value)}
    if isinstance(value, complex):
        return {"z": [value.real, value.imag]}
    if isinstance(value, bytes):
        return {"b": _placed(np.frombuffer(value, dtype=np.uint8), arrays)}
    for plain in _PLAIN:  # of which the value's class may be one
        if isinstance(value, plain):
            return _plain(plain(value), arrays)
    kind: Any = type(value)
    held = {name: part for name, default in _parts(kind) if (part := getattr(value, name)) is not default}
    return {"c": [kind.__name__, {name: _plain(part, arrays) for name, part in held.items()}]}


@cache
def _parts(kind: Any) -> list[tuple[str, Any]]:
    """The parts of a class with the default of each; TypeError for a class that is none of parts."""
    if is_dataclass(kind):
        return [(one.name, one.default) for one in fields(kind) if one.init]
    if hasattr(kind, "model_construct"):  # a model of pydantic, whose values have been validated
        return [(name, one.default) for name, one in kind.model_fields.items()]
    raise TypeError(f"a {kind.__name__} cannot be packed")


def _placed(array: Any, arrays: list[Any]) -> int:
    """Put an array among the others; returns its place."""
    arrays.append(array)
    return len(arrays) - 1


def _made(tree: Any, arrays: list[Any], known: Mapping[str, type]) -> Any:
    """The value of what JSON holds; ValueError for a class that is not known."""
    if isinstance(tree, list):
        return [_made(one, arrays, known) for one in tree]
    if not isinstance(tree, dict):
        return tree
    ((kind, held),) = tree.items()
    if kind in _SIMPLE:
        return _SIMPLE[kind](held, arrays)
    if kind == "t":
        return tuple(_made(one, arrays, known) for one in held)
    if kind == "d":
        return {_made(key, arrays, known): _made(one, arrays, known) for key, one in held}
    name, content = held
    if name not in known:
        raise ValueError(f"the bytes hold a {name}, which is not expected here")
    if kind == "e":
        return known[name][content]  # type: ignore[index]
    make = getattr(known[name], "model_construct", known[name])
    return make(**{key: one if type(one) in _ATOMS else _made(one, arrays, known) for key, one in content.items()})


#: Values that are made of what JSON holds and of the arrays alone.
_SIMPLE: dict[str, Callable[[Any, list[Any]], Any]] = {
    "a": lambda held, arrays: arrays[held],
    "b": lambda held, arrays: arrays[held].tobytes(),
    "p": lambda held, _: Path(held),
    "z": lambda held, _: complex(*held),
}
