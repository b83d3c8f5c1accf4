"""The entries of a cache as they stand in its file, for tests that change them behind its back."""

from pathlib import Path

from fourpole.io.records import _HEAD

NAME = "kept.fpp"


def entries_of(folder: Path) -> dict[str, tuple[bytes, bytes]]:
    """Signature and content of each entry of a cache, by name, in their order; none without a file."""
    path, at, found = folder / NAME, 0, {}
    content = path.read_bytes() if path.is_file() else b""
    while len(content) >= at + _HEAD.size:
        _, name, length, signed = _HEAD.unpack_from(content, at)
        if len(content) < (end := at + _HEAD.size + length):
            break
        found[name.hex()] = signed, content[at + _HEAD.size : end]
        at = end
    return found


def put_entries(folder: Path, entries: dict[str, tuple[bytes, bytes]]) -> None:
    """Write the file of a cache with other entries."""
    parts = [
        _HEAD.pack(b"FPR1", bytes.fromhex(name), len(content), signed) + content
        for name, (signed, content) in entries.items()
    ]
    (folder / NAME).write_bytes(b"".join(parts))
