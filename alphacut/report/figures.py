"""Figures in the report: vector drawings inside the page, each once."""

from __future__ import annotations

import base64
import re
from pathlib import Path

from markupsafe import Markup

from alphacut.figures.captions import caption
from alphacut.io.files import Document
from alphacut.report.tables import fragment, paragraphs, section

# figures that stand in the section they belong to
ELSEWHERE = re.compile(
    r"(fig18-)?modulus|image(_circles)?|response|exceedance|update-.+|decision|joint"
)
# figures that need the page's whole width
WIDE = re.compile(r"envelope-|chain|record|shares-over-time|graph-follower")
SVG_LIMIT = 200_000  # bytes; a heavier figure goes into the page as PNG


def listed(summary: Document, folder: Path, name: str) -> Markup:
    """Figure by its name without the paper's number, if this run has drawn it."""
    for file in summary.get("figures", []):
        if re.fullmatch(rf"(fig\d+-)?{name}", Path(file).stem) and file.endswith(".svg"):
            words = caption(Path(file).stem, paper=bool(summary.get("paper")))
            return picture(folder / file, words)
    return Markup("")


def gallery(summary: Document, folder: Path) -> Markup:
    """Every figure of the run that no other section shows."""
    paper, figures = bool(summary.get("paper")), []
    for path in map(Path, summary.get("figures", [])):
        if path.suffix == ".png" and not ELSEWHERE.fullmatch(path.stem):
            words, wide = caption(path.stem, paper=paper), bool(WIDE.search(path.stem))
            figures.append(picture(folder / path.with_suffix(".svg"), words, wide=wide))
    shown = Markup('<div class="gallery">{}</div>').format(Markup("\n").join(figures))
    return section("Figures", shown) if figures else Markup("")


def missing(summary: Document, folder: Path) -> Markup:
    """What the run wrote and the folder lacks; empty where it lacks nothing."""
    named = [*(f"{x}.nc" for x in summary["fingerprints"]), *summary.get("figures", [])]
    gone = [name for name in named if not (folder / name).is_file()]
    some = ", ".join(gone[:4]) + (f" and {len(gone) - 4} more" if len(gone) > 4 else "")
    told = f"The run wrote files that are no longer here: {some}. The same run makes them anew."
    return section("Missing files", paragraphs(told)) if gone else Markup("")


def picture(svg: Path, caption: str, *, wide: bool = False) -> Markup:
    """A figure: as SVG where that is light, else as PNG; empty where there is none."""
    png = svg.with_suffix(".png")
    if svg.is_file() and svg.stat().st_size < SVG_LIMIT:
        text = re.sub(r"^.*?(?=<svg)", "", svg.read_text(encoding="utf-8"), flags=re.DOTALL)
        text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
        content = Markup(unique_ids(text, svg.stem + "-"))
    elif png.is_file():
        content = Markup('<img alt="{}" src="data:image/png;base64,{}">').format(
            caption, base64.b64encode(png.read_bytes()).decode()
        )
    else:
        return Markup("")
    return fragment("figure", content, caption, wide)


def unique_ids(svg: str, prefix: str) -> str:
    """An SVG whose ids do not clash with another's on the same page."""
    svg = re.sub(r'\bid="([^"]+)"', rf'id="{prefix}\1"', svg)
    svg = re.sub(r"url\(#([^)]+)\)", rf"url(#{prefix}\1)", svg)
    return re.sub(r'href="#([^"]+)"', rf'href="#{prefix}\1"', svg)
