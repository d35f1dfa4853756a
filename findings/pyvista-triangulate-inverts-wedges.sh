#!/usr/bin/env bash
# PyVista 0.49.1 with VTK 9.7.2: triangulate() makes tetrahedra of negative volume out of wedges of positive volume.
# Guess: a filter keeps the orientation: volume 0.5 before and after, as it is for hexahedra.
# Seen: linear and 15-node wedges of volume +0.5 become tetrahedra whose volumes are all negative, in sum -0.5. Up to
#   9.6 the same wedge has -0.5, and its tetrahedra too: 9.7 turned the wedge, and not the filter.
# Why it matters here: exported cells are wedges, and the first thing that other programs ask for is tetrahedra: they
#   refuse them as inside out.
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

cube = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
for kind, points, sign in ((vtk.VTK_WEDGE, corners, -1), (vtk.VTK_QUADRATIC_WEDGE, wedge, -1), (vtk.VTK_HEXAHEDRON, cube, 1)):
    before = grid(kind, points)
    volumes = before.triangulate().compute_cell_sizes()["Volume"]
    print(kind, before.volume, volumes.sum())
    assert before.volume > 0 and (np.sign(volumes) == sign).all() and np.isclose(abs(volumes.sum()), before.volume)
PROGRAM
