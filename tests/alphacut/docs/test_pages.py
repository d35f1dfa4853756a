"""The built pages: formulas, style and scripts come with them, nothing is asked of a network."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    command = [sys.executable, "-m", "sphinx", "-q", "-b", "html", str(ROOT / "docs"), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr, done.stderr
    return folder


def test_no_page_asks_a_network(built):
    pages = list(built.rglob("*.html"))
    assert pages
    for page in pages:
        loaded = re.findall(
            r"<(?:script|img|iframe)[^>]*src=\"([^\"]*)\"|<link[^>]*rel=\"stylesheet\"[^>]*href=\"([^\"]*)\"",
            page.read_text(encoding="utf-8"),
        )
        for target in (a or b for a, b in loaded):
            assert not target.startswith(("http:", "https:", "//")), f"{page.name}: {target}"
            assert (page.parent / target.partition("?")[0]).is_file(), f"{page.name}: {target}"


def test_no_page_needs_a_server(built):
    """Browsers refuse modules to pages that are opened from a disk."""
    for page in built.rglob("*.html"):
        assert 'type="module"' not in page.read_text(encoding="utf-8"), page.name


def test_formulas_have_what_draws_them(built):
    theory = (built / "theory.html").read_text(encoding="utf-8")
    assert r"\(r_n = r/a\)" in theory
    assert "_static/mathjax/MathJax.js" in theory
    for part in ("jax/input/TeX/jax.js", "jax/output/SVG/jax.js", "extensions/tex2jax.js"):
        assert (built / "_static/mathjax" / part).is_file()


@pytest.mark.parametrize("name", ["alphacut.fuzzy.propagate", "alphacut.frame.envelope"])
def test_public_docstrings_are_on_the_reference_page(built, name):
    assert f'id="{name}"' in (built / "reference.html").read_text(encoding="utf-8")
