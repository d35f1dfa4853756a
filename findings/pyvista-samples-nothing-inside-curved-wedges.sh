#!/usr/bin/env bash
# PyVista 0.49.1 with VTK 9.7.2: values sampled inside a curved wedge are 0 with a mask, at points that
# find_containing_cell finds.
# Guess: x sampled at (0.45, 0.45, 0.5), well inside, is 0.45; coordinates are reproduced exactly.
# Seen: the point counts as outside (mask 0, value 0), though the cell is found for it; at (0.2, 0.2, 0.5) x is
#   0.2007. The inverse of the map ends early.
# Why it matters here: lines through the exported stress field have holes and a third digit that is wrong; profiles
#   are evaluated by the elements before the export.
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
cells.point_data["x"] = cells.points[:, 0]
inside, near = ([0.45, 0.45, 0.5], [0.2, 0.2, 0.5])
found = pv.PolyData([inside, near]).sample(cells)
print(cells.find_containing_cell(inside), found["vtkValidPointMask"], found["x"])
assert cells.find_containing_cell(inside) == 0
assert found["vtkValidPointMask"].tolist() == [0, 1] and found["x"][0] == 0
assert 3e-4 < abs(found["x"][1] - 0.2) < 3e-3
PROGRAM
