"""The BibTeX entry of CITATION.cff: `python tools/citation.py` writes it into docs/citing.md."""

from __future__ import annotations

import re
from datetime import date
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"(?<=```bibtex\n).*?(?=```)", flags=re.DOTALL)


def read_citation(root: Path) -> dict[str, Any]:
    """The metadata of CITATION.cff."""
    return yaml.safe_load((root / "CITATION.cff").read_text(encoding="utf-8"))


def bibtex(said: dict[str, Any]) -> str:
    """The metadata as an entry of BibTeX. A name in double braces is one of a group, and stays whole."""
    released = date.fromisoformat(str(said["date-released"]))
    authors = " and ".join(f"{{{author['name']}}}" for author in said["authors"])
    lines = [
        f"@software{{fourpole_{said['version']},",
        f"  author  = {{{authors}}},",
        f"  title   = {{{{{said['title']}}}}},",
        f"  version = {{{said['version']}}},",
        f"  year    = {{{released.year}}},",
        f"  month   = {f'{released:%b}'.lower()},",
        f"  note    = {{License: {said['license']}}},",
        "}",
    ]
    return "\n".join(lines) + "\n"


def with_entry(page: str, entry: str) -> str:
    """The page with this entry in its block of BibTeX."""
    if not BLOCK.search(page):
        raise ValueError("docs/citing.md has no block ```bibtex")
    return BLOCK.sub(lambda _: entry, page)


if __name__ == "__main__":
    citing = ROOT / "docs" / "citing.md"
    citing.write_text(with_entry(citing.read_text(encoding="utf-8"), bibtex(read_citation(ROOT))), encoding="utf-8")
