"""Settings of the site: python -m sphinx -W docs out/site"""

from __future__ import annotations

import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS), str(DOCS.parent)]

import warpflat  # noqa: E402

project = "warpflat"
version = release = warpflat.__version__
copyright = "the warpflat authors"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
]
myst_enable_extensions = ["dollarmath", "fieldlist"]
myst_heading_anchors = 3
# Notebooks are run by `python docs/run_notebooks.py`, which keeps what they show.
nb_execution_mode = "off"
suppress_warnings = ["misc.highlighting_failure"]
exclude_patterns = ["gallery/*"]

autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
napoleon_google_docstring = True
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"warpflat {release}"
html_static_path: list[str] = []
html_show_sphinx = False
