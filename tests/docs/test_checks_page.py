"""docs/checks.md lists every check that the program makes."""

import re
import sys
from pathlib import Path

from fourpole.core.checks import Code
from fourpole.words import template

PAGE = Path(__file__).parents[2] / "docs" / "checks.md"


def remedy(code):
    """What to do, for a warning and for a rejection; remarks have what differs from test to test."""
    texts = dict.fromkeys(template(code, "remedy", verdict) for verdict in ("warning", "rejected"))
    said = "; ".join(text for text in texts if text and "{" not in text)
    return said or "see the remark"


def described():
    """docs/checks.md, from the codes: `python tests/docs/test_checks_page.py > docs/checks.md`."""
    lines = [
        "# Checks and remedies: what to do with a rejected test",
        "",
        "What each check of `checks.csv` looks at, what its warning or rejection means, and what to do.",
        "",
        "## When a test is rejected",
        "",
        "A test with the verdict `warning` is used; one with `rejected` is not, but stays as a row of the results. Its",
        "remark names the cause and the remedy, the report repeats both, and `checks.csv` has the statistic, the limit",
        "and the remedy of each check. After the remedy run `fourpole analyse` again: only what changed is read anew.",
        "",
        "## All checks",
        "",
        "| check | looks at | means | remedy |",
        "|---|---|---|---|",
    ]
    for code in Code:
        short = template(code, "short", "rejected") or "see the remark"
        lines.append(f"| `{code.text}` | {template(code, 'about')} | {short} | {remedy(code)} |")
    return re.sub(r"K\*", r"K\\*", "\n".join(lines)) + "\n"


def test_the_page_lists_all_checks():
    said = "run python tests/docs/test_checks_page.py > docs/checks.md"
    assert PAGE.read_text(encoding="utf-8") == described(), said


if __name__ == "__main__":
    sys.stdout.write(described())
