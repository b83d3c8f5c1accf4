"""The texts of a statement: campaign.toml, tests.csv and limits.toml, and how large they may be."""

from __future__ import annotations

import hashlib
from pathlib import Path

from fourpole.errors import CampaignError, FileError, TableError
from fourpole.io.door import read_bytes
from fourpole.io.source import decode

#: Largest size of campaign.toml and of tests.csv [byte].
MOST_TOML, MOST_TESTS = 1_000_000, 200_000_000


def statement_text(path: Path, most: int, sha256: dict[str, str], *, strict: bool) -> str:
    """The text of a file of at most `most` bytes; CampaignError if `strict` and the text is not UTF-8.

    Its SHA-256 is put under its name.
    """
    try:
        content = read_bytes(path, max_bytes=most, label=path.name, within=path.parent)
        sha256[path.name] = hashlib.sha256(content).hexdigest()
        if strict:
            return content.decode("utf-8-sig")
        return decode(content, path.name)[0]
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise CampaignError(f"{path.name}: line {line} is not UTF-8 text; save the file as UTF-8") from None
    except (FileError, TableError) as error:
        raise CampaignError(str(error)) from None
