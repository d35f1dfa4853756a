"""The picture of the cell's mesh (Fig. 15).

PyVista draws in a process of its own: python -m alphacut.export.mesh MESH.npz PICTURE.png
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.case.material import Mesh
from alphacut.fuzzy.refused import FailedError
from alphacut.io.files import say, whole_file
from alphacut.rve.cell.cell import Cell
from alphacut.rve.mesh.gmsh_prisms import ABAQUS_ORDER

if TYPE_CHECKING:
    from pyvista import PolyData, UnstructuredGrid

COLOURS = "#f0a860", "#b79ad9"
"""Of matrix and particle, orange and lilac as in the paper."""
PIXELS = (1000, 1100)
FLATTENED = 0.6  # scale of the θ-axis in the picture
EDGES = np.column_stack([[0, 1, 2, 3, 4, 5, 0, 1, 2], range(6, 15), [1, 2, 0, 4, 5, 3, 3, 4, 5]])
"""Nodes of a wedge's edges: an end, the middle, the other end."""
QUADRATIC_WEDGE = 26  # VTK's number of it


def draw_mesh(cell: Cell, mesh: Mesh, path: Path) -> bool:
    """Draws the mesh of a case; returns whether a picture was made.

    Without a display Xvfb stands in for one; without both no picture is made, and one line says so.
    """
    command = [sys.executable, "-m", "alphacut.export.mesh"]
    if not os.environ.get("DISPLAY"):
        if not shutil.which("xvfb-run"):
            say("no picture of the mesh: it needs a display or Xvfb")
            return False
        command = ["xvfb-run", "-a", *command]
    with tempfile.TemporaryDirectory() as folder, whole_file(path) as partial:
        file = Path(folder) / "mesh.npz"
        np.savez(file, **_prism_mesh(cell, mesh))
        words = [*command, str(file), str(partial)]
        process = subprocess.run(words, capture_output=True, text=True, check=False)
        if process.returncode or not partial.is_file():
            reason = " ".join(process.stderr.split())[-300:]
            raise FailedError(f"the mesh could not be drawn: {reason}")
    return True


def _prism_mesh(cell: Cell, mesh: Mesh) -> dict[str, Any]:
    """The mesh of a case: points (n, 3), cells (m, 15) in VTK's order and phase (m,)."""
    from alphacut.rve.mesh.columns import extrude
    from alphacut.rve.mesh.prism_grid import reference_radius

    radius = reference_radius(cell.radius_map, cell.outline)
    grid = extrude(size=mesh.size, radius=radius, layers=mesh.layers, outline=cell.outline)
    points, cells = grid.positions(cell.radius_map), grid.cells[:, ABAQUS_ORDER]
    return {"points": points, "cells": cells, "phase": grid.phase}


def draw_wedges(file: str, picture: str) -> None:
    """Draws the phases of a mesh with their edges to a PNG file, the matrix cut open."""
    import pyvista

    mesh = np.load(file)
    grid = pyvista.UnstructuredGrid({QUADRATIC_WEDGE: mesh["cells"]}, mesh["points"])
    grid.cell_data["phase"] = mesh["phase"]
    plotter = pyvista.Plotter(off_screen=True, window_size=list(PIXELS))
    plotter.set_background("white")
    for phase in np.unique(grid.cell_data["phase"]):
        part, colour = grid.extract_cells(grid.cell_data["phase"] == phase), COLOURS[phase]
        if phase == 0:
            centres = part.cell_centers().points
            part = part.extract_cells(~((centres[:, 0] > 0) & (centres[:, 1] < 0)))
        # facets through the midpoints, where the edges run too
        surface = part.extract_surface(nonlinear_subdivision=1)
        plotter.add_mesh(surface, color=colour, smooth_shading=False, ambient=0.5, diffuse=0.6)
        plotter.add_mesh(
            edges(part), color="#54402c", line_width=1.6, render_lines_as_tubes=True, lighting=False
        )
    plotter.set_scale(zscale=FLATTENED)
    plotter.camera_position = [(8.0, -11.5, 7.5), (0.0, 0.0, -0.2), (0, 0, 1)]
    plotter.camera.zoom(1.65)
    plotter.enable_anti_aliasing("ssaa")
    plotter.screenshot(picture)


def edges(part: UnstructuredGrid) -> PolyData:
    """Edges of quadratic wedges in VTK's order, each as two straight pieces."""
    import pyvista

    cells = part.cells.reshape(-1, 16)[:, 1:]
    lines = np.unique(np.concatenate([cells[:, nodes] for nodes in EDGES]), axis=0)
    return pyvista.PolyData(part.points, lines=np.column_stack([np.full(len(lines), 3), lines]))


if __name__ == "__main__":
    draw_wedges(*sys.argv[1:])
