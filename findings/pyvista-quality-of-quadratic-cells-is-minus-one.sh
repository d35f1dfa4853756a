#!/usr/bin/env bash
# PyVista 0.49.1 with VTK 9.7.2: the quality of every quadratic wedge is -1, that of an inverted cell.
# Guess: cell_quality('scaled_jacobian') measures 15-node wedges, or says that it does not.
# Seen: it is -1 for a right wedge and for a twisted one, for measure 'volume' as well, without a warning: -1 stands
#   for 'not measured'. The linear wedge has 0.816.
# Why it matters here: a threshold on the quality of an exported mesh throws away all of it; quality is judged before
#   the export, on the elements themselves.
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

linear, quadratic = grid(vtk.VTK_WEDGE, corners), grid(vtk.VTK_QUADRATIC_WEDGE, wedge)
for measure in ("scaled_jacobian", "volume"):
    values = [float(cells.cell_quality(measure)[measure][0]) for cells in (linear, quadratic)]
    print(measure, values)
    assert values[0] > 0 and values[1] == -1.0
PROGRAM
