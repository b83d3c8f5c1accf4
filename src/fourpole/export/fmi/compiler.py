"""The binary of an FMU for this platform, by the C compiler on the path."""

from __future__ import annotations

import platform
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from fourpole.export.fmi.csource import COMPILED
from fourpole.io.processes import output_of, program_path

#: Commands that are tried, in this order.
COMPILERS = ("gcc", "cc", "clang")
#: Time that the compiler may take [s].
_LONGEST = 120.0
#: Variables by which a user says where the compiler finds its headers and libraries.
_OF_COMPILER = ("C_INCLUDE_PATH", "CPATH", "DEVELOPER_DIR", "GCC_EXEC_PREFIX", "LIBRARY_PATH", "SDKROOT")
_ENDINGS = {"win32": ".dll", "darwin": ".dylib"}
_SYSTEMS = {"win32": ("win", "windows"), "darwin": ("darwin", "darwin")}
_MACHINES = {"amd64": "x86_64", "arm64": "aarch64", "i386": "x86", "i686": "x86"}


class NoBinaryError(Exception):
    """There is no binary; the message says why and what to do."""


def binary_place(identifier: str, version: int) -> str:
    """Path of the binary of this platform inside an FMU."""
    short, long = _SYSTEMS.get(sys.platform, ("linux", "linux"))
    if version == 2:
        folder = f"{short}{64 if sys.maxsize > 2**32 else 32}"
    else:
        machine = platform.machine().lower()
        folder = f"{_MACHINES.get(machine, machine)}-{long}"
    return f"binaries/{folder}/{identifier}{_ENDINGS.get(sys.platform, '.so')}"


def compiled(source: Mapping[str, str], version: int) -> bytes:
    """The shared library of the files of a source; `NoBinaryError` if there is no compiler or it fails."""
    compiler = next((found for name in COMPILERS if (found := program_path(name))), None)
    if compiler is None:
        raise NoBinaryError(f"no C compiler was found ({', '.join(COMPILERS)}): install one, as gcc, and export again")
    flags = ["-std=c99", "-O2", "-shared", "-fvisibility=hidden", *([] if sys.platform == "win32" else ["-fPIC"])]
    with tempfile.TemporaryDirectory() as folder:
        for name, text in source.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        command = [compiler, *flags, "-o", "binary", *COMPILED[version]]
        try:
            code, _, said = output_of(command, seconds=_LONGEST, folder=folder, also=_OF_COMPILER)
        except OSError as error:
            raise NoBinaryError(f"{compiler} could not be run ({error})") from None
        if code or not Path(folder, "binary").is_file():
            first = next(iter(said.decode(errors="replace").strip().splitlines()), f"exit code {code}")
            raise NoBinaryError(f"{compiler} failed: {first}")
        return Path(folder, "binary").read_bytes()
