#!/usr/bin/env bash
# PyVista 0.49.1 with VTK 9.7.2: the volume of a curved quadratic wedge is that of its flat pieces, and the filter
# that would refine it drops it.
# Guess: compute_cell_sizes integrates the cell that is drawn, or tessellate() followed by it does.
# Seen: a wedge with one bulged edge has 0.8 where the integral is 0.9 (11 % less), slices have the same flat area,
#   and tessellate() returns no cell at all, with a line on standard error.
# Why it matters here: the volume of a particle measured in an exported file is too small by the curvature; fractions
#   are integrated by the elements and printed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check pyvista==0.49.1 vtk==9.7.2 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, pyvista as pv, vtk
corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], float)
edges = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
wedge = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in edges]])
def grid(kind, points):
    return pv.UnstructuredGrid(np.r_[len(points), np.arange(len(points))], np.array([kind]), points)

bulged = wedge.copy()
bulged[[7, 10], :2] += 0.3
cells = grid(vtk.VTK_QUADRATIC_WEDGE, bulged)
exact = 0.5 + 2 / 3 * 0.3 * np.sqrt(2) * np.sqrt(2)  # a parabola over the edge of length sqrt(2)
area = cells.slice("z", origin=(0, 0, 0.5)).area
print(cells.volume, area, exact, cells.tessellate().n_cells)
assert np.isclose(cells.volume, 0.8) and np.isclose(area, 0.8) and np.isclose(exact, 0.9)
assert cells.tessellate().n_cells == 0
PROGRAM
