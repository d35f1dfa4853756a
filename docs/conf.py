"""Sphinx settings: `make docs` builds the pages into build/docs."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sphinx.pycode import ModuleAnalyzer

if TYPE_CHECKING:
    from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parent.parent))
os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"  # demos show their pictures

project = "alphacut"
author = "The alphacut developers"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
]
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_update_mathjax = False
myst_heading_anchors = 3
# demos are programs in percent format: they run while the pages are built
source_suffix = {".md": "myst-nb", ".py": "myst-nb"}
nb_custom_formats = {".py": ["jupytext.reads", {"fmt": "py:percent"}]}
nb_execution_mode = "cache"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
exclude_patterns = ["conf.py", "**/__pycache__", "demos/templates/*"]
suppress_warnings = ["mystnb.unknown_mime_type", "myst-nb.lexer"]
html_theme = "furo"
html_title = "alphacut"
html_theme_options = {"source_repository": "", "navigation_with_keys": True}
html_static_path = ["static"]
html_css_files = ["pages.css"]
html_js_files = ["pages.js"]
# formulas are drawn without a network, by Debian's copy of MathJax 2
MATHJAX = Path("/usr/share/javascript/mathjax")
MATHJAX_PARTS = ("MathJax.js", "extensions", "jax/element", "jax/input/TeX", "jax/output/SVG")
mathjax_path = "mathjax/MathJax.js"
mathjax2_config = {
    "jax": ["input/TeX", "output/SVG"],
    "extensions": ["tex2jax.js"],
    "TeX": {"extensions": ["AMSmath.js", "AMSsymbols.js"]},
    "tex2jax": {
        "inlineMath": [["\\(", "\\)"]],
        "displayMath": [["\\[", "\\]"]],
        "ignoreClass": "tex2jax_ignore|mathjax_ignore",
        "processClass": "tex2jax_process|mathjax_process|math",
    },
    "SVG": {"linebreaks": {"automatic": True}},  # on narrow screens
    "showMathMenu": False,
    "messageStyle": "none",
}
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "imported-members": True}
ALIASES = ("Array", "Ints", "Mask", "Values", "Outline", "LevelFunction", "Sampler", "Arrangement")
"""Names of types that signatures show in place of what they stand for, as ndarray[tuple[…"""
autodoc_type_aliases = {name: name for name in ALIASES}
CONSTANTS = {
    "DISCS": "alphacut.stochastic.particles.shapes",
    "INTEGRATORS": "alphacut.frame.dynamics.integrators",
    "LOADS": "alphacut.rve.cell.cell",
    "METHODS": "alphacut.frame.methods.method",
    "SPHERES": "alphacut.stochastic.particles.shapes",
    "STRAIN": "alphacut.rve.cell.cell",
}
"""Module that assigns each public constant."""


def copy_mathjax(app: Sphinx) -> None:
    """Puts the scripts that draw formulas beside the pages."""
    for part in MATHJAX_PARTS:
        source, target = MATHJAX / part, Path(app.outdir) / "_static/mathjax" / part
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target, dirs_exist_ok=True)
        else:
            shutil.copyfile(source, target)


def without_modules(
    _app: Sphinx, _page: str, _template: str, context: dict[str, Any], _doctree: object
) -> None:
    """Leaves the theme's script out, which browsers refuse to pages that are opened from a disk."""
    scripts = context["script_files"]
    context["script_files"] = [one for one in scripts if "scripts/furo.js" not in str(one)]


def with_bars(
    _app: Sphinx, _what: str, _name: str, _documented: object, _options: object, lines: list[str]
) -> None:
    """Keeps the bars of absolute values, between which reStructuredText expects a substitution."""
    for number, line in enumerate(lines):
        if "``" not in line and not line.lstrip().startswith((">>>", "...")):
            lines[number] = line.replace("|", "\\|")


def with_strings_below(
    _app: Sphinx, what: str, name: str, _documented: object, _options: object, lines: list[str]
) -> None:
    """Describes a public constant by the string that stands below its assignment."""
    constant = name.rpartition(".")[2]
    if what == "data" and constant in CONSTANTS:
        analyzer = ModuleAnalyzer.for_module(CONSTANTS[constant])
        lines[:] = analyzer.find_attr_docs()["", constant]


def setup(app: Sphinx) -> None:
    """Hooks into the build."""
    app.connect("builder-inited", copy_mathjax)
    app.connect("autodoc-process-docstring", with_bars)
    app.connect("autodoc-process-docstring", with_strings_below, priority=900)
    app.connect("html-page-context", without_modules, priority=900)
