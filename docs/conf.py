"""Settings of the site: python -m sphinx -W docs out/site"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS), str(DOCS.parent)]

from docutils.nodes import SkipNode  # noqa: E402
from latex2mathml.converter import convert  # noqa: E402
from sphinx.util.inspect import TypeAliasForwardRef  # noqa: E402

# Autodoc writes annotations of its own into the tables that it documents; models that are made of them afterwards would be refused.
import warpflat.app.scene.schema  # noqa: E402

project = "warpflat"
version = release = warpflat.__version__
copyright = "the warpflat authors"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
]
myst_enable_extensions = ["dollarmath", "fieldlist", "html_image"]
myst_heading_anchors = 3
# Notebooks are run by `python docs/run_notebooks.py`, which keeps what they show.
nb_execution_mode = "off"
suppress_warnings = ["misc.highlighting_failure"]
exclude_patterns = ["gallery/*"]

autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
# Named, not spelt out: an array or what NumPy makes one of.
autodoc_type_aliases = {name: name for name in ("ArrayLike", "FloatArray", "IntArray", "BoolArray")}
# Sphinx writes an alias in a union by its repr.
TypeAliasForwardRef.__repr__ = lambda alias: alias.name  # type: ignore[method-assign]
autodoc_member_order = "bysource"
napoleon_google_docstring = True
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"warpflat {release}"
html_static_path: list[str] = []
html_show_sphinx = False
html_math_renderer = "mathml"


def _math(display: str) -> Any:
    """Return a visitor that writes an equation as MathML, which browsers show without a script from elsewhere."""

    def visit(translator: Any, node: Any) -> None:
        # Room below, so that a browser does not offer to scroll an equation up and down.
        style = '<math style="padding-bottom: 0.4em; overflow-y: hidden" ' if display == "block" else "<math "
        translator.body.append(convert(node.astext(), display=display).replace("<math ", style, 1))
        raise SkipNode

    return visit


def setup(app: Any) -> None:
    """Register the renderer of equations."""
    app.add_html_math_renderer("mathml", (_math("inline"), None), (_math("block"), None))
