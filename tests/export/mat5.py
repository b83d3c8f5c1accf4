"""A small reader of MAT-files of level 5, from the published layout, that owes nothing to what wrote them."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np

_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_TEXTS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16"}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _CHAR, _DOUBLE = 1, 2, 4, 6
_COMPLEX = 0x0800


def read_mat5(content: bytes) -> tuple[str, dict[str, Any]]:
    """The text of the head, and the variables: structs as dicts, cells as lists, numbers as arrays."""
    head, version, order = content[:116].decode("ascii"), content[124:126], content[126:128]
    assert (version, order) == (b"\x00\x01", b"IM"), "no little-endian file of level 5"
    found, at = {}, 128
    while at < len(content):
        kind, body, at = _element(content, at)
        if kind == _COMPRESSED:
            kind, body, _ = _element(zlib.decompress(body), 0)
        assert kind == _MATRIX
        name, value = _matrix(body)
        found[name] = value
    return head, found


def _element(content: bytes, at: int) -> tuple[int, bytes, int]:
    """Type and bytes of an element, and where the next begins."""
    kind, size = struct.unpack_from("<II", content, at)
    if kind >> 16:  # a small one, in its own tag
        return kind & 0xFFFF, content[at + 4 : at + 4 + (kind >> 16)], at + 8
    end = at + 8 + size
    return kind, content[at + 8 : end], end if kind == _COMPRESSED else end + -size % 8


def _numbers(kind: int, body: bytes) -> np.ndarray:
    return np.frombuffer(body, dtype=f"<{_NUMBERS[kind]}")


def _matrix(body: bytes) -> tuple[str, Any]:
    if not body:
        return "", np.empty((0, 0))
    parts, at = [], 0
    for _ in range(3):
        kind, part, at = _element(body, at)
        parts.append(_numbers(kind, part))
    flags, shape, name = int(parts[0][0]), tuple(parts[1]), parts[2].tobytes().decode("ascii")
    return name, _value(flags, shape, body, at)


def _value(flags: int, shape: tuple[int, ...], body: bytes, at: int) -> Any:
    count = int(np.prod(shape))
    if flags & 0xFF == _STRUCT:
        kind, part, at = _element(body, at)
        width = int(_numbers(kind, part)[0])
        _, names, at = _element(body, at)
        fields = [names[i : i + width].split(b"\0")[0].decode("ascii") for i in range(0, len(names), width)]
        values = {}
        for field in fields:
            _, part, at = _element(body, at)
            values[field] = _matrix(part)[1]
        return values
    if flags & 0xFF == _CELL:
        cell = []
        for _ in range(count):
            _, part, at = _element(body, at)
            cell.append(_matrix(part)[1])
        return cell
    kind, part, at = _element(body, at)
    if flags & 0xFF == _CHAR:
        return part.decode(_TEXTS[kind])
    values = _numbers(kind, part).astype(float)
    assert flags & 0xFF == _DOUBLE
    if flags & _COMPLEX:
        kind, part, at = _element(body, at)
        whole = np.empty(values.size, complex)
        whole.real, whole.imag = values, _numbers(kind, part)
        values = whole
    return values.reshape(shape, order="F")
