"""The library in C of `fourpole.core.kernel`: it stands beside its source, and has a hash of it in its name.

`make kernel` builds it, and a wheel may bring it. Without it, numpy does the same. The variable FOURPOLE_KERNEL wants
one of them: "c" or "numpy". `fourpole --version` asks here, so that nothing is imported at the top that takes long.
"""

from __future__ import annotations

import ctypes
import os
import sys
from binascii import crc32
from contextlib import contextmanager

from fourpole.version import VERSION

TYPE_CHECKING = False  # as type checkers know it
if TYPE_CHECKING:
    from collections.abc import Iterator

VARIABLE = "FOURPOLE_KERNEL"
_SOURCE = os.path.join(os.path.dirname(os.path.dirname(__file__)), "core", "kernel.c")  # noqa: PTH118, PTH120 - pathlib is slow


def place() -> str:
    """The path of the library, by its source and the kind of machine."""
    with open(_SOURCE, "rb") as source:  # noqa: PTH123
        mark = crc32(source.read())
    machine = os.uname().machine if hasattr(os, "uname") else os.environ.get("PROCESSOR_ARCHITECTURE", "")
    # With the ending of a library, Python would take it for a module of the package.
    return f"{_SOURCE.removesuffix('.c')}-{mark:08x}-{sys.platform}-{machine}.library"


def _found() -> tuple[ctypes.CDLL | None, str]:
    """The library, or None if numpy does its work; what is wrong with the variable."""
    wanted, wrong = os.environ.get(VARIABLE, ""), ""
    if wanted in ("", "c"):
        try:
            return ctypes.CDLL(place()), ""
        except OSError as error:
            wrong = wanted and f"the library in C cannot be loaded ({error}): run make kernel, or unset the variable"
    elif wanted != "numpy":
        wrong = "write c or numpy, or unset the variable"
    return None, wrong and f"{VARIABLE} is {wanted!r}: {wrong}"


def library() -> ctypes.CDLL | None:
    """The library; None if numpy does its work.

    Raises
    ------
    FourpoleError
        If FOURPOLE_KERNEL wants a library that is not there, or something else.
    """
    found, wrong = _found()
    if wrong:
        from fourpole.errors import FourpoleError  # takes longer than all of this module

        raise FourpoleError(wrong)
    return found


def filling() -> str:
    """What does the work of the library: "c" or "numpy"; see `library`."""
    return "numpy" if library() is None else "c"


def said() -> str:
    """What `fourpole --version` says."""
    found, wrong = _found()
    return f"fourpole {VERSION} (kernel: {wrong or ('numpy' if found is None else 'c')})"


@contextmanager
def filled_by(wanted: str) -> Iterator[None]:
    """A context in which "c" or "numpy" does the work, here and in processes that start meanwhile.

    Where the library is not there, numpy does it. Another text leaves the choice as it is.
    """
    from fourpole.core import kernel

    before = os.environ.get(VARIABLE)
    try:
        if wanted == "numpy":
            os.environ[VARIABLE] = wanted
        elif wanted == "c":
            os.environ.pop(VARIABLE, None)
        kernel.library.cache_clear()
        yield
    finally:
        os.environ.pop(VARIABLE, None)
        if before is not None:
            os.environ[VARIABLE] = before
        kernel.library.cache_clear()


if __name__ == "__main__":
    sys.stdout.write(place())
