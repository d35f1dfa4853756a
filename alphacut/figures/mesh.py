"""Fig. 15: the prism mesh, cut open, by PyVista in a process of its own.

xvfb-run -a python -m alphacut.figures.mesh MESH.vtu PICTURE.png
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.material import Mesh
from alphacut.export.fields import prism_mesh, write_mesh
from alphacut.fuzzy.refused import FailedError
from alphacut.io.files import say, whole_file
from alphacut.rve.cell import Cell

if TYPE_CHECKING:
    from pyvista import PolyData, UnstructuredGrid

MATRIX, PARTICLE = "#f0a860", "#b79ad9"  # orange and lilac, as in the paper
PIXELS = (1000, 1100)
FLATTENED = 0.6  # scale of the θ-axis in the picture
EDGES = np.column_stack([[0, 1, 2, 3, 4, 5, 0, 1, 2], range(6, 15), [1, 2, 0, 4, 5, 3, 3, 4, 5]])
"""Nodes of a wedge's edges: an end, the middle, the other end."""


def draw_mesh(cell: Cell, mesh: Mesh, path: Path) -> bool:
    """Draws the mesh of a case; returns whether a picture was made.

    Where there is no display, Xvfb makes one for the time of drawing. Where there is none of both,
    one line says so.
    """
    command = [sys.executable, "-m", "alphacut.figures.mesh"]
    if not os.environ.get("DISPLAY"):
        if not shutil.which("xvfb-run"):
            say("no picture of the mesh: it needs a display or Xvfb")
            return False
        command = ["xvfb-run", "-a", *command]
    with tempfile.TemporaryDirectory() as folder, whole_file(path) as partial:
        file = Path(folder) / "mesh.vtu"
        write_mesh(prism_mesh(cell, mesh.size, mesh.layers), file)
        words = [*command, str(file), str(partial)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode or not partial.is_file():
            reason = " ".join(done.stderr.split())[-300:]
            raise FailedError(f"the mesh could not be drawn: {reason}")
    return True


def mesh(file: str, picture: str) -> None:
    """Draw both phases with their edges; the matrix is cut open in front so that the cone shows."""
    import pyvista

    grid = pyvista.read(file)
    plotter = pyvista.Plotter(off_screen=True, window_size=list(PIXELS))
    plotter.set_background("white")
    for phase, colour in ((0, MATRIX), (1, PARTICLE)):
        part = grid.extract_cells(grid.cell_data["phase"] == phase)
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

    wedges = part.cells.reshape(-1, 16)[:, 1:]
    lines = np.unique(np.concatenate([wedges[:, ends] for ends in EDGES]), axis=0)
    return pyvista.PolyData(part.points, lines=np.column_stack([np.full(len(lines), 3), lines]))


if __name__ == "__main__":
    mesh(*sys.argv[1:])
