"""Links between the pages lead somewhere, on a code host and in the site alike."""

import re
from functools import cache
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "paper").rglob("*.md")])
FENCE = re.compile(r"^(```+|~~~+).*?^\1`*[ \t]*$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"(`+)(?!`).+?(?<!`)\1(?!`)", re.DOTALL)
LINK = re.compile(r"\]\(<?([^()\s>]+)>?(?:\s+\"[^\"]*\")?\)|^\[[^\]]+\]:\s+(\S+)", re.MULTILINE)
OUTSIDE = re.compile(r"[a-z][a-z+.-]*:", re.IGNORECASE)


def prose(path):
    """The text of a page without code."""
    return CODE.sub("", FENCE.sub("", path.read_text(encoding="utf-8")))


def links(path):
    """Targets of the links of a page that stay within the repository."""
    found = (first or second for first, second in LINK.findall(prose(path)))
    return [unquote(target) for target in found if not OUTSIDE.match(target)]


@cache
def anchors(path):
    """Anchors of a page's headings as code hosts make them, and as MyST does: small letters, blanks as hyphens."""
    found = set()
    for heading in re.findall(r"^#{1,6}\s+(.+?)\s*#*$", FENCE.sub("", path.read_text(encoding="utf-8")), re.MULTILINE):
        text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("\\", "")
        slug = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
        copies = (slug, *(f"{slug}-{count}" for count in range(1, 99)))
        found.add(next(name for name in copies if name not in found))
    return found | set(re.findall(r"^\(([\w-]+)\)=$", path.read_text(encoding="utf-8"), re.MULTILINE))


def broken(path, target):
    """Why a link of a page is broken; None if it is not."""
    name, _, anchor = target.partition("#")
    there = (path.parent / name).resolve() if name else path
    if there.is_relative_to(ROOT / "docs" / "api" / "made"):  # written from the docstrings when the site is built
        return None
    if not there.exists():
        return f"{target}: there is no such file"
    if anchor and there.suffix == ".md" and anchor not in anchors(there):
        return f"{target}: the page has no such heading"
    return None


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_link_leads_somewhere(path):
    assert [why for target in links(path) if (why := broken(path, target))] == []


def test_links_are_found_and_held(tmp_path):
    page = tmp_path / "a.md"
    page.write_text("# A b\n[x](#a-b) [y](#c) [z](gone.md) [w](https://a.b) `[v](no.md)`\n```\n[u](no.md)\n```\n")
    assert links(page) == ["#a-b", "#c", "gone.md"]
    assert [broken(page, target) is None for target in links(page)] == [True, False, False]


def test_no_line_of_text_is_taken_for_a_comment():
    """A line that begins with a per cent sign is left out of the site."""
    assert [path.name for path in PAGES if re.search(r"^\s*%", path.read_text(encoding="utf-8"), re.MULTILINE)] == []


def test_every_page_of_docs_opens_with_a_heading_and_a_sentence():
    """A page says first what it is for; included pages say it in their own file."""
    silent = []
    for path in (ROOT / "docs").rglob("*.md"):
        text = path.read_text(encoding="utf-8")
        if not re.match(r"# .+\n\n(?! {4}|```)[^\n|#>!]", text) and not text.startswith("```{include}"):
            silent.append(path.relative_to(ROOT).as_posix())
    assert silent == []
