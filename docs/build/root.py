"""Links of pages to files at the root of the repository lead to the pages of the site that include them."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

from sphinx.addnodes import pending_xref

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx

#: File at the root -> page of the site.
PAGES = {
    "ARCHITECTURE.md": "architecture",
    "CHANGELOG.md": "changelog",
    "CODE_OF_CONDUCT.md": "conduct",
    "CONTRIBUTING.md": "contributing",
    "README.md": "index",
    "SECURITY.md": "security",
    "SUPPORT.md": "support",
}


def setup(app: Sphinx) -> dict[str, Any]:
    """Change the links of a page when it was read."""
    app.connect("doctree-read", lambda _, doctree: lead_to_pages(doctree))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def lead_to_pages(doctree: nodes.document) -> None:
    """Change each link that MyST left open and that names a file at the root."""
    for link in doctree.findall(pending_xref):
        name = PurePosixPath(link["reftarget"]).name
        if link.get("reftype") == "myst" and name in PAGES:
            link.update_all_atts({"refdomain": "std", "reftype": "doc", "reftarget": f"/{PAGES[name]}"}, replace=True)
            link["refexplicit"] = True
