"""The paper's figures that hold data, drawn by this program, and the page that shows them.

`python -m alphacut.docs.gallery` runs the paper's case and the particles of `cases/concrete.toml`,
and writes docs/gallery.md with its pictures. Figs. 1 and 2 hold no data.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.figures.captions import caption

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
PICTURES = Path("docs/pictures/gallery")
NUMBERED = re.compile(r"(?:fig)?(\d+)(?:-(\d+))?[-_].+")
PARTICLES = ("packing.packings=5", "packing.discs=600")
"""Fewer sections than the case has: the pictures look alike."""
WIDTH = 720
"""Width of a picture, in pixels."""
HEAD = """# Gallery: the paper's figures

Every figure of the paper that holds data, drawn by this program. Figs. 1 and 2 are sketches. `make figures` computes all of them anew, from the
particles to the frame, and writes this page. Figs. 3 to 10 and 12 show particles packed as in `cases/concrete.toml`, fewer of them; Fig. 11 and all from
Fig. 13 on are of `cases/paper.toml`, which takes the paper's radius map.
"""


def main(arguments: list[str] | None = None) -> int:
    """Run, collect, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results/figures"))
    options = parser.parse_args(arguments)
    particles, paper = options.results / "particles", options.results / "paper"
    if status := run(particles, paper):
        return status
    found = {
        **numbered(particles / "figures", "03", "12"),
        **numbered(paper / "figures", "11", "35"),
    }
    found |= {number: file for number, file in drawn(options.results)}
    write_page(found)
    return 0


def run(particles: Path, paper: Path) -> int:
    """Compute both; returns the status of the first that fails."""
    from alphacut.entry import main as command

    cases = ROOT / "cases"
    fewer = [word for key in PARTICLES for word in ("--set", f"microstructure.{key}")]
    asked = ["microstructure", str(cases / "concrete.toml"), *fewer, "--out", str(particles)]
    return command(asked) or command(["run", str(cases / "paper.toml"), "--out", str(paper)])


def numbered(folder: Path, first: str, last: str) -> dict[str, Path]:
    """Pictures of a folder whose number in the paper lies in a range, by that number."""
    found = {}
    for file in sorted(folder.glob("*.png")):
        match = NUMBERED.fullmatch(file.stem)
        if match and first <= match[1] <= last:
            found[match[1]] = file
    return found


def drawn(folder: Path) -> Iterator[tuple[str, Path]]:
    """Figs. 36 and 37, which need no run."""
    from alphacut.figures.style import save, style
    from alphacut.fuzzy.plots import figure_36, figure_37

    folder.mkdir(parents=True, exist_ok=True)
    makers: dict[str, Callable[[], Figure]] = {
        "fig36-fuzzy-sets": figure_36,
        "fig37-cuts": figure_37,
    }
    for name, make in makers.items():
        with style():
            save(make(), folder / name)
        yield name[3:5], folder / f"{name}.png"


def write_page(found: dict[str, Path]) -> None:
    """The page, and its pictures in small."""
    (ROOT / PICTURES).mkdir(parents=True, exist_ok=True)
    entries = []
    for number in sorted(found):
        words = caption(found[number].stem, paper=True)
        name = f"{found[number].stem}.png"
        shrink(found[number], ROOT / PICTURES / name)
        entries.append(f"## {words}\n\n![{words}](pictures/gallery/{name})\n")
    (ROOT / "docs" / "gallery.md").write_text("\n".join([HEAD, *entries]), encoding="utf-8")


def shrink(file: Path, to: Path) -> None:
    """A picture of few colours and at most `WIDTH` pixels across."""
    from PIL import Image

    with Image.open(file) as whole:
        image = whole.convert("RGB")
    if image.width > WIDTH:
        image = image.resize(
            (WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS
        )
    image.quantize(256, Image.Quantize.FASTOCTREE).save(to, optimize=True)


if __name__ == "__main__":
    sys.exit(main())
