"""What keeps someone from using a page, by the guidelines for accessible content (WCAG 2.1 AA)."""

from __future__ import annotations

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

ALL = ["wcag2a", "wcag2aa", "wcag21aa"]


def barriers(page: Page) -> list[str]:
    """Serious faults of a page in light; of the same page in dark, where only colours differ, those of contrast."""
    found = []
    for theme, only in (
        ("light", {"type": "tag", "values": ALL}),
        ("dark", {"type": "rule", "values": ["color-contrast"]}),
    ):
        page.emulate_media(color_scheme=theme)
        answer = Axe().run(page, options={"runOnly": only}).response
        bad = [one for one in answer["violations"] if one["impact"] in ("serious", "critical")]
        found += [f"{theme}: {one['id']}: {node['html'][:200]}" for one in bad for node in one["nodes"][:3]]
    return found
