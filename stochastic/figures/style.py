"""Style of all figures of the project, and their files: SVG and PNG, replaced at once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

# Okabe & Ito
INK, BLUE, ORANGE, GREEN = "#1a1a1a", "#0072b2", "#d55e00", "#009e73"
PURPLE = "#7b3294"  # differs from blue and orange in lightness
GREY, PALE, LIGHT = "#8c8c8c", "#dce9f2", "#9ecae1"
WIDTH, HEIGHT = 7.2, 3.8  # inches
SETTINGS: dict[str, Any] = {
    "figure.figsize": (WIDTH, HEIGHT),
    "figure.titlesize": 10,
    "font.size": 10,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "alphacut",
    "savefig.dpi": 150,
}


@contextmanager
def figure_style() -> Iterator[None]:
    """Context manager that sets this style."""
    mpl.use("Agg")
    with mpl.rc_context(SETTINGS):
        yield


def save(figure: Figure, stem: Path) -> list[Path]:
    """Write a figure to STEM.svg and STEM.png, close it, and return the two paths."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    if (layout := figure.get_layout_engine()) is not None:
        for _ in range(2):  # the second knows where the first put axes of equal scale
            layout.execute(figure)
    figure.set_layout_engine("none")
    files = []
    for kind in ("svg", "png"):
        partial, file = (stem.with_name(f"{stem.name}{x}.{kind}") for x in (".partial", ""))
        figure.savefig(partial, metadata={"Date": None} if kind == "svg" else None)
        files.append(partial.replace(file))
    plt.close(figure)
    return files
