"""How Sphinx makes the site of these pages; `make docs` runs it."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "build"))

from fourpole.version import VERSION  # noqa: E402

project = "Fourpole"
author = "the Fourpole developers"
copyright = "2026, the Fourpole developers"  # noqa: A001
version = release = VERSION

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc", "sphinx_copybutton", "api", "mathml", "root"]
exclude_patterns = ["build", "notebooks"]
root_doc = "index"
nitpicky = True
# A name in single backticks is a link where it is a public name, otherwise code: parameters, too, stand so.
default_role = "py:obj"
nitpick_ignore_regex = [("py:obj", ".*")]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
html_math_renderer = "mathml"

autodoc_member_order = "bysource"
autodoc_typehints = "none"
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
add_module_names = False

html_theme = "pydata_sphinx_theme"
smartquotes = False  # K'' is no quotation
html_title = f"Fourpole {VERSION}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_context = {"default_mode": "auto"}
html_show_sourcelink = html_copy_source = html_show_sphinx = False
html_domain_indices = False
# Summaries are fetched page by page, which a browser does not allow for files.
html_show_search_summary = False
html_search_scorer = str(HERE / "build" / "scorer.js")
html_theme_options = {
    "logo": {"text": "Fourpole"},
    "navbar_end": ["theme-switcher"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
    "show_prev_next": False,
    "back_to_top_button": False,
    "show_toc_level": 2,
}
# Prompts are not copied, nor are the answers to them.
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

linkcheck_timeout = 20
linkcheck_anchors = False
