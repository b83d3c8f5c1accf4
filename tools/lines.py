"""Count the code lines of the package: physical lines that are not blank, comment or docstring.

Python is counted as `ruff format` writes it; `make lines` checks that first. Other kinds of files are counted apart, by
their lines that are not blank. Run ``python tools/lines.py`` for the sums, with ``--rooms`` for each room.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "fourpole"
#: Kinds of files that are counted beside Python.
OTHERS = (".c", ".h", ".js", ".css", ".html", ".toml", ".json")
_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
_NO_CODE = (
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER,
)  # fmt: skip


def code_lines(source: str) -> int:
    """Number of lines of a Python source that hold code."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    held = {line for token in tokens if token.type not in _NO_CODE for line in range(token.start[0], token.end[0] + 1)}
    return len(held - set(_docstrings(ast.parse(source))))


def _docstrings(tree: ast.Module) -> Iterator[int]:
    """Lines of the docstrings of a module."""
    for node in ast.walk(tree):
        if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            yield from range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1)


def main() -> None:
    """Print the sums."""
    files, lines = Counter[str](), Counter[str]()
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE).parts
        for room in ("python", *(parts[:1] if len(parts) > 1 and "--rooms" in sys.argv else ())):
            files[room] += 1
            lines[room] += code_lines(path.read_text(encoding="utf-8"))
    for ending in OTHERS:
        texts = [path.read_text(encoding="utf-8") for path in PACKAGE.rglob(f"*{ending}")]
        files[ending], lines[ending] = (
            len(texts),
            sum(bool(line.strip()) for text in texts for line in text.split("\n")),
        )
    for name, count in files.items():
        print(f"{name:<12} {lines[name]:>7} lines in {count:>4} files")


if __name__ == "__main__":
    main()
