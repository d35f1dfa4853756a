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
    draw_section,
    draw_two_point,
)
from alphacut.stochastic.figures.statistics import (
    draw_areas,
    draw_correlation,
    draw_map,
    draw_neighbour_statistics,
    draw_pbox,
    draw_radii,
    draw_radii_bounds,
)
from alphacut.stochastic.figures.style import save, style
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.image import SectionImage
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.sections import Measured, Simulated
from alphacut.stochastic.spheres.microstructure import SphereMicrostructure
from alphacut.stochastic.tessellation.apollonius import apollonius
from alphacut.stochastic.tessellation.delaunay import neighbours

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from alphacut.stochastic.microstructure import Microstructure


def draw(found: Microstructure | SphereMicrostructure, folder: Path) -> dict[str, list[Path]]:
    """Draw every figure into `folder`; name of each figure to its files."""
    figures = of_spheres(found) if isinstance(found, SphereMicrostructure) else of_discs(found)
    with style():
        return {name: save(figure(), folder / name) for name, figure in figures.items()}


def of_spheres(found: SphereMicrostructure) -> dict[str, Callable[[], Figure]]:
    """Figures of spheres, each to its drawing."""
    packed, source = found.packed[0], found.source
    radii = np.concatenate([one.radii for one in packed.packings])
    cells = [
        (2 * one.radii / np.cbrt(volumes), volumes)
        for one, volumes in zip(packed.packings, packed.volumes, strict=True)
    ]
    figures: dict[str, Callable[[], Figure]] = {
        "10_cells": lambda: draw_section(packed.packings[0]),
        "11_radii": lambda: draw_radii(radii, source.packing.radii, "spheres"),
        "12_areas": lambda: draw_areas(found, cells),
        "13_pbox": lambda: draw_pbox(found),
        "radius_map": lambda: draw_map(found),
    }
    if source.section is not None:
        figures["radii_bounds"] = lambda: draw_radii_bounds(found)
    return figures


def of_discs(found: Microstructure) -> dict[str, Callable[[], Figure]]:
    """Figures of discs, each to its drawing.

    Those on direct neighbours show discs of one size at the same area fraction, as in the paper.
    """
    source = found.study.source
    law = source.packing.radii if isinstance(source, Simulated) else None
    equal, many = _equal_discs(found, 120), _equal_discs(found, 4000)
    radii = np.concatenate([section.discs.radii for section in found.sections])
    generator = np.random.default_rng(found.study.seed)
    cells = [
        (section.diagram.reduced_radii[disc], section.diagram.areas[disc])
        for section in found.sections
        for disc in (section.whole.disc,)
    ]
    figures: dict[str, Callable[[], Figure]] = {
        "03-04_two_point": lambda: draw_two_point(many, generator),
        "05-08_neighbours": lambda: draw_neighbours(equal),
        "06-07_neighbour_statistics": lambda: draw_neighbour_statistics(
            [neighbours(many)], 2 * float(many.radii[0])
        ),
        "09_correlation": lambda: draw_correlation(found, apollonius(many)),
        "10_cells": lambda: draw_cells(found.sections[0].diagram),
        "11_radii": lambda: draw_radii(radii, law),
        "12_areas": lambda: draw_areas(found, cells),
        "13_pbox": lambda: draw_pbox(found),
        "radius_map": lambda: draw_map(found),
    }
    if isinstance(source, Measured) and isinstance(source.file, SectionImage):
        picture, discs = source.file.material(), found.sections[0].discs
        figures["image_circles"] = lambda: draw_overlay(picture, discs)
    return figures


def _equal_discs(found: Microstructure, number: int) -> Discs:
    """A packing of equal discs with the area fraction and the mean disc area of the sections."""
    discs = [section.discs for section in found.sections]
    radius = float(np.sqrt(np.mean(np.concatenate([one.radii for one in discs]) ** 2)))
    fraction = float(np.mean([one.area_fraction for one in discs]))
    return Packing(number, fraction, LogNormalRadii(radius, radius)).make(
        np.random.default_rng([found.study.seed, number])
    )
