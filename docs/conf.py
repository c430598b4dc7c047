"""How the site is made: MyST pages, the API from docstrings, tables and command line from the code (`make docs`)."""

from __future__ import annotations

import sys
from importlib import metadata
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "_extensions")]

project = "line-landing"
author = "The line-landing authors"
copyright = "2026, The line-landing authors"
release = metadata.version("line-landing")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "plain_docstrings", "from_code"]
exclude_patterns = ["_build", "figures", "reference/generated"]
suppress_warnings = ["myst.header"]  # the page of `make verify` begins its studies at the third level
myst_enable_extensions = ["attrs_inline", "colon_fence", "deflist"]
myst_heading_anchors = 3
default_role = "literal"

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autosummary_generate = False
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]  # types of other libraries in signatures; links between pages are checked

html_theme = "furo"
html_title = f"line-landing {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
