"""Sphinx settings: `make docs` builds the pages into build/docs."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

project = "alphacut"
author = "The alphacut developers"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
source_suffix = {".md": "markdown"}
exclude_patterns = ["README.md"]
html_theme = "alabaster"
html_theme_options = {
    "description": "From an uncertain microstructure to the fuzzy vibration of a structure",
    "fixed_sidebar": True,
}
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
nitpicky = False
