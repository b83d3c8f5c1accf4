"""Links of pages to files at the root of the repository lead to the pages of the site that include them."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

from sphinx.addnodes import pending_xref

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx

#: File at the root, without its ending -> page of the site.
PAGES = {
    "ARCHITECTURE": "architecture",
    "CHANGELOG": "changelog",
    "CODE_OF_CONDUCT": "conduct",
    "CONTRIBUTING": "contributing",
    "README": "index",
    "SECURITY": "security",
    "SUPPORT": "support",
}


def setup(app: Sphinx) -> dict[str, Any]:
    """Change the links of a page when it was read."""
    app.connect("doctree-read", lambda app, doctree: lead_to_pages(doctree, PurePosixPath(app.srcdir).parent))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def lead_to_pages(doctree: nodes.document, root: PurePosixPath) -> None:
    """Change each link to a file at the root: MyST gives its whole path, or in an included file its name."""
    for link in doctree.findall(pending_xref):
        if link.get("reftype") != "myst":
            continue
        path, _, anchor = link["reftarget"].partition("#")
        file = PurePosixPath(path)
        if file.stem in PAGES and file.parent in (root, PurePosixPath(".")):
            link["refdomain"], link["reftarget"] = "doc", PAGES[file.stem]
            link["reftargetid"] = link.get("reftargetid") or anchor or None
