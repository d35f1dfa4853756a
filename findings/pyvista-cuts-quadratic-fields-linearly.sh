#!/usr/bin/env bash
# PyVista 0.49.1 with VTK 9.7.2: slices, contours, clips and integrals of a quadratic cell take its field as linear between
# nodes.
# Guess: a quadratic tetrahedron with x^2 at its nodes has the contour x^2 = 0.04 at x = 0.2, and an integral of 1/60.
# Seen: the contour lies at x = 0.08, a slice at x = 0.25 has 0.125 for 0.0625, the clipped volume is 0.037 for 0.081,
#   the integral 0.0234 for 0.0167. sample() takes the cell's own functions: 0.0900 at x = 0.3. Volume and area of the
#   cell are right.
# Why it matters here: the exported cell has quadratic stresses: contours and means that PyVista draws of a coarse mesh
#   are off by whole elements; values come from sample(), or from a refined mesh.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check pyvista==0.49.1 vtk==9.7.2 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, pyvista as pv
corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
edges = (0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)
points = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in edges]])
cell = pv.UnstructuredGrid({24: np.arange(10)[None]}, points)
cell["square"] = points[:, 0] ** 2
contour = cell.contour([0.04], scalars="square").points[:, 0]
cut = cell.slice("x", origin=(0.25, 0, 0))["square"]
clipped = cell.clip_scalar("square", value=0.04).volume
integral = cell.integrate_data()["square"][0]
sampled = pv.PolyData([[0.3, 0.2, 0.1]]).sample(cell)["square"][0]
print(contour[0], cut[0], clipped, integral, sampled)
assert np.allclose(contour, 0.08) and np.allclose(cut, 0.125)
assert np.isclose(clipped, 0.0369, atol=1e-4) and (1 - 0.8**3) / 6 > 0.08
assert np.isclose(integral, 0.0234375) and np.isclose(sampled, 0.09, atol=1e-4)
assert np.isclose(cell.volume, 1 / 6)
PROGRAM
