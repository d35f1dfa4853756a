"""Fig. 15: the prism mesh, cut open, by PyVista in a process of its own.

xvfb-run -a python -m alphacut.figures.mesh KIND MESH.vtu PICTURE.png
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.case.material import Mesh
from alphacut.export.fields import cell_fields, prism_mesh, write_mesh
from alphacut.io.files import say, whole_file
from alphacut.rve.cell import Cell

if TYPE_CHECKING:
    from pyvista import Plotter, PolyData, UnstructuredGrid

MATRIX, PARTICLE = "#f0a860", "#b79ad9"  # orange and lilac, as in the paper
PIXELS = (1000, 1100)
SHEETS = 5  # slices in the picture of stress
HEIGHT = 6.9  # of their stack, in halves of the cell: none hides another
BAR = {
    "title": "stress 11 under strain 11 = 22 = 0.01, GPa\n",
    "color": "black",
    "vertical": False,
    "fmt": "%.2f",
    "position_x": 0.2,
    "width": 0.6,
}
LABEL = {  # VTK's own fonts have no θ
    "font_size": 26,
    "text_color": "black",
    "shape": None,
    "show_points": False,
    "always_visible": True,
}
FLATTENED = 0.6  # scale of the θ-axis in the picture
# end, middle, end
EDGES = [
    [0, 6, 1],
    [1, 7, 2],
    [2, 8, 0],
    [3, 9, 4],
    [4, 10, 5],
    [5, 11, 3],
    [0, 12, 3],
    [1, 13, 4],
    [2, 14, 5],
]


def draw_mesh(cell: Cell, mesh: Mesh, path: Path, kind: str = "mesh") -> bool:
    """Draw the mesh of a case, or the stress in it; returns whether a picture was made.

    Where there is no display, Xvfb makes one for the time of drawing. Where there is none of both,
    one line says so.
    """
    command = [sys.executable, "-m", "alphacut.figures.mesh", kind]
    if not os.environ.get("DISPLAY"):
        if not shutil.which("xvfb-run"):
            say("no picture of the mesh: it needs a display or Xvfb")
            return False
        command = ["xvfb-run", "-a", *command]
    with tempfile.TemporaryDirectory() as folder, whole_file(path) as partial:
        file, make = Path(folder) / "mesh.vtu", cell_fields if kind == "stress" else prism_mesh
        write_mesh(make(cell, mesh.size, mesh.layers), file)
        done = subprocess.run(
            [*command, str(file), str(partial)], capture_output=True, text=True, check=False
        )
        if done.returncode or not partial.is_file():
            raise RuntimeError(
                f"the {kind} could not be drawn: {' '.join(done.stderr.split())[-300:]}"
            )
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
    import numpy as np
    import pyvista

    wedges = part.cells.reshape(-1, 16)[:, 1:]
    lines = np.unique(np.concatenate([wedges[:, ends] for ends in EDGES]), axis=0)
    return pyvista.PolyData(part.points, lines=np.column_stack([np.full(len(lines), 3), lines]))


def stress(file: str, picture: str) -> None:
    """Stress 11 under load 1 on a stack of slices at fixed θ."""
    import numpy as np
    import pyvista

    grid = pyvista.read(file)
    grid["stress"] = grid["stress_1_11_Pa"] / 1e9
    parts = [grid.extract_cells(grid.cell_data["phase"] == phase) for phase in (0, 1)]
    low, high = np.quantile(grid["stress"], [0.01, 0.99])
    plotter = pyvista.Plotter(off_screen=True, window_size=list(PIXELS))
    plotter.set_background("white")
    bottom, top = grid.bounds[4:6]
    apart = HEIGHT / (top - bottom)
    for theta in np.linspace(bottom + 1e-6, top - 1e-6, SHEETS):
        # each phase by itself: slicing both at once would blend the stresses across the interface
        for part in parts:
            add_sheet(plotter, part.slice(normal="z", origin=(0, 0, theta)), (low, high))
        spot = np.array([[1.15, 1.0, theta * apart]])
        plotter.add_point_labels(spot, [f"theta = {theta:.1f}"], **LABEL)
    plotter.set_scale(zscale=apart)
    middle = apart * (bottom + top) / 2
    plotter.camera_position = [(6.8, -11.0, middle + 6.8), (0.3, 0.0, middle - 0.7), (0, 0, 1)]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = 4.7  # half the picture's height
    plotter.enable_anti_aliasing("ssaa")
    plotter.screenshot(picture)


def add_sheet(plotter: Plotter, sheet: PolyData, limits: tuple[float, float]) -> None:
    """One slice in colours of its stress, with its outline."""
    plotter.add_mesh(
        sheet, scalars="stress", clim=limits, cmap="cividis", scalar_bar_args=BAR, lighting=False
    )
    outline = sheet.extract_feature_edges(feature_edges=False, manifold_edges=False)
    plotter.add_mesh(outline, color="#222222", line_width=1.5)


if __name__ == "__main__":
    {"mesh": mesh, "stress": stress}[sys.argv[1]](*sys.argv[2:])
