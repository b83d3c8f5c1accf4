"""Signatures, by which what one user's Fourpole kept in a folder is told from what anyone else put there.

A signature is an HMAC-SHA256 with the key of the user (RFC 2104). Unlike the seal of a model file, nobody else can make
one. It covers what the content is for, so that one signed content does not pass for another.
"""

from __future__ import annotations

import hmac
import json

from fourpole.io.userfolders import user_key

#: Length of a signature [byte].
LENGTH = 32


def signature(content: bytes, *purpose: str) -> bytes:
    """The signature of a content for a purpose: its kind, its name or its place."""
    return hmac.digest(user_key(), json.dumps(purpose).encode() + b"\0" + content, "sha256")


def is_signed(content: bytes, signed: bytes, *purpose: str) -> bool:
    """Whether `signed` is the signature that this user gives a content for a purpose.

    Examples
    --------
    >>> is_signed(b"D1", signature(b"D1", "index"), "index"), is_signed(b"D1", signature(b"D1", "index"), "entry")
    (True, False)
    """
    return hmac.compare_digest(signature(content, *purpose), signed)
