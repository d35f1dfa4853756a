"""All figures of a microstructure."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.stochastic.figures.cells import (
    draw_cells,
    draw_neighbours,
    draw_overlay,
    draw_two_point,
)
from alphacut.stochastic.figures.statistics import (
    draw_areas,
    draw_correlation,
    draw_map,
    draw_neighbour_statistics,
    draw_pbox,
    draw_radii,
)
from alphacut.stochastic.figures.style import save, style
from alphacut.stochastic.microstructure import Microstructure
from alphacut.stochastic.particles.image import SectionImage
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.particles import DISCS, Particles
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.sections import Measured, Simulated
from alphacut.stochastic.tessellation.apollonius import apollonius

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Figures = dict[str, Callable[[], "Figure"]]


def draw(result: Microstructure, folder: Path) -> dict[str, list[Path]]:
    """Draws every figure into `folder`; name of each figure to its files."""
    figures = of_map(result)
    if result.study.shape is DISCS:
        figures |= of_discs(result)
    with style():
        return {name: save(figure(), folder / name) for name, figure in sorted(figures.items())}


def of_map(result: Microstructure) -> Figures:
    """Figures of radii, cells and map, each to its drawing."""
    source = result.study.source
    law = source.packing.radii if isinstance(source, Simulated) else None
    return {
        "11_radii": lambda: draw_radii(result, law),
        "12_areas": lambda: draw_areas(result),
        "13_pbox": lambda: draw_pbox(result),
        "radius_map": lambda: draw_map(result),
    }


def of_discs(result: Microstructure) -> Figures:
    """Figures of discs, each to its drawing.

    Those on direct neighbours show discs of one size at the same area fraction, as in the paper.
    """
    first, source = result.sections[0], result.study.source
    generator = np.random.default_rng(result.study.seed)
    equal, many = _equal_discs(result, 120), _equal_discs(result, 4000)
    figures: Figures = {
        "03-04_two_point": lambda: draw_two_point(many, generator),
        "05-08_neighbours": lambda: draw_neighbours(equal),
        "06-07_neighbour_statistics": lambda: draw_neighbour_statistics(many),
        "09_correlation": lambda: draw_correlation(result, apollonius(many)),
    }
    if (diagram := first.diagram) is not None:
        figures["10_cells"] = lambda: draw_cells(diagram)
    if isinstance(source, Measured) and isinstance(source.file, SectionImage):
        picture = source.file.picture()
        figures["image_circles"] = lambda: draw_overlay(picture, first.particles)
    return figures


def _equal_discs(result: Microstructure, number: int) -> Particles:
    """A packing of equal discs with the area fraction and the mean disc area of the sections."""
    discs = [section.particles for section in result.sections]
    radius = float(np.sqrt(np.mean(np.concatenate([one.radii for one in discs]) ** 2)))
    fraction = float(np.mean([one.fraction for one in discs]))
    return Packing(number, min(fraction, DISCS.densest), LogNormalRadii(radius, radius)).make(
        np.random.default_rng([result.study.seed, number])
    )
