"""The encoding of a text, and how messages call a file."""

from __future__ import annotations

import codecs
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

from fourpole.errors import TableError
from fourpole.units import shown

AnyPath = str | os.PathLike[str]
"""The path of a file or folder, as users give it."""
_UTF16 = {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}
#: Common characters of GB 2312: signs and level 1; four bytes are a sign beyond it.
_CHINESE = re.compile(rb"[\xa1-\xa9\xb0-\xd7][\xa1-\xfe]|[\x81-\x84][0-9][\x81-\xfe][0-9]")
#: Common characters of Shift-JIS: signs, kana, kanji of level 1, and runs of kana of half width.
_JAPANESE = re.compile(rb"[\x81-\x84\x88-\x97][\x40-\x7e\x80-\xfc]|\x98[\x40-\x72]|[\xa6-\xdf]{3,}(?![\xe0-\xfc])")
_ASCII = re.compile(rb"[\x00-\x7f]+")
#: Least share of the characters beyond ASCII that are common ones.
_NEARLY_ALL = 0.9
#: Bytes that are decoded at a time.
_AT_ONCE = 1 << 20
_UTF32 = (b"\xff\xfe\x00\x00", b"\x00\x00\xfe\xff")


def name_of(path: AnyPath, label: str | None) -> str:
    """The file's name in messages: the label of the caller, or else the last part of the path."""
    return shown(Path(path).name if label is None else label, 200)[1:-1]


def encoding_of(start: bytes, name: str) -> tuple[str, int]:
    """The encoding of a text, from its first bytes, and the length of its byte order mark [byte]."""
    if start.startswith(_UTF32):
        raise TableError(f"{name}: is text in UTF-32; save it as UTF-8")
    if start.startswith(codecs.BOM_UTF8):
        return "utf-8", len(codecs.BOM_UTF8)
    if start[:2] in _UTF16:
        return _UTF16[start[:2]], 2
    if b"\x00" in start:
        raise TableError(f"{name}: is binary, not text; export it as CSV, in UTF-8")
    try:
        codecs.getincrementaldecoder("utf-8")().decode(start)  # incremental, since the last character may be cut
    except UnicodeDecodeError:
        return encoding_without_mark(start), 0
    return "utf-8", 0


def decode(content: bytes, name: str) -> tuple[str, str]:
    """A decoded text and its encoding: UTF-8, UTF-16 with its mark, or else that of `encoding_without_mark`."""
    encoding, mark = encoding_of(content, name)
    odd = encoding.startswith("utf-16") and len(content) % 2 == 1 and content.endswith(b"\n")
    try:
        text = content[mark : len(content) - odd].decode(encoding)
    except UnicodeDecodeError as error:
        if mark:
            where = f"byte {error.start + mark + 1}"
            raise TableError(f"{name}: is marked as {encoding} but is not ({where}); save it as UTF-8") from None
        encoding = encoding_without_mark(content)
        text = content.decode(encoding, errors="replace")
    if "\x00" in text:
        raise TableError(f"{name}: is binary, not text; export it as CSV, in UTF-8")
    return text, encoding


@contextmanager
def as_utf8(file: BinaryIO, encoding: str, name: str) -> Iterator[BinaryIO]:
    """A temporary file with a text in UTF-16 as UTF-8, which is as long as the context."""
    decoder = codecs.getincrementaldecoder(encoding)()
    with tempfile.TemporaryFile() as plain:
        file.seek(2)
        while True:
            content = file.read(_AT_ONCE)
            try:
                text = decoder.decode(content)  # half a character at the end is left out
            except UnicodeDecodeError:
                raise TableError(f"{name}: is marked as {encoding} but is not; save it as UTF-8") from None
            if "\x00" in text:
                raise TableError(f"{name}: is binary, not text; export it as CSV, in UTF-8")
            plain.write(text.encode())
            if not content:
                break
        plain.seek(0)
        yield cast("BinaryIO", plain)


def encoding_without_mark(content: bytes) -> str:
    """The encoding of a text that is not UTF-8: GB 18030, Shift-JIS (cp932), cp1252 or Latin-1.

    A text is Chinese or Japanese if nearly all of its characters beyond ASCII are among the common ones of that
    encoding: those of GB 2312 level 1 and its signs, kana and the kanji of JIS level 1. Words in Western letters never
    are: a letter with an accent stands alone between letters of ASCII.

    Examples
    --------
    >>> encoding_without_mark("时间(s),力(N)".encode("gb18030")), encoding_without_mark("時間,荷重".encode("cp932"))
    ('gb18030', 'cp932')
    >>> encoding_without_mark("Zeit;Prüfkraft;Dämpfung;Weg [µm];°C".encode("cp1252"))
    'cp1252'
    """
    shares = {"gb18030": _common_share(content, _CHINESE), "cp932": _common_share(content, _JAPANESE)}
    best = max(shares, key=lambda one: shares[one])
    if shares[best] > _NEARLY_ALL:
        return best
    try:
        content.decode("cp1252")
    except UnicodeDecodeError:
        return "latin-1"
    return "cp1252"


def _common_share(content: bytes, common: re.Pattern[bytes]) -> float:
    """Share of the bytes beyond ASCII, and of those of ASCII that belong to them, that are common characters."""
    found = common.findall(content)
    beyond = len(_ASCII.sub(b"", content)) + len(b"".join(found)) - len(_ASCII.sub(b"", b"".join(found)))
    return sum(map(len, found)) / beyond if beyond else 0.0


def reason(error: Exception) -> str:
    """The reason of an OSError or ValueError, without number and path."""
    return getattr(error, "strerror", None) or str(error).replace("embedded null byte", "its name has a NUL")
