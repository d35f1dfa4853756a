#!/usr/bin/env bash
# Gmsh 4.15.2: a periodic mesh that it scaled (Mesh.ScalingFactor, or mesh.affineTransform) is torn when MSH 4.1 is read.
# Guess: a file in millimetres written with ScalingFactor = 0.001 is read as the same mesh in metres.
# Seen: nodes are scaled, the affine map between the sides in $Periodic is not; on reading, Gmsh puts the nodes of each
#   dependent side at that map of their masters: one metre, not one millimetre, from them, without a word, and elements
#   along two sides are drawn out. Mesh.IgnorePeriodicity (1 unless told otherwise) holds for MSH 2.2 alone, which is
#   read right; meshio reads the nodes of both as they were written.
# Why it matters here: a cell is periodic and often drawn in another unit than it is solved in: such a file is
#   handed to Gmsh here without its section $Periodic.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check gmsh==4.15.2 meshio==5.3.5 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import gmsh
import meshio
import numpy as np

FACTOR = 0.001


def nodes():
    tags, points, _ = gmsh.model.mesh.getNodes()
    return points.reshape(-1, 3)[np.argsort(tags)]


gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
geo = gmsh.model.geo
corners = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
sides = [geo.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
geo.addPlaneSurface([geo.addCurveLoop(sides)])
geo.synchronize()
for master, dependent, axis in ((sides[3], sides[1], 0), (sides[0], sides[2], 1)):
    shift = np.eye(4)
    shift[axis, 3] = 1
    gmsh.model.mesh.setPeriodic(1, [dependent], [master], shift.ravel().tolist())
gmsh.option.setNumber("Mesh.MeshSizeMax", 0.25)
gmsh.model.mesh.generate(2)
right = FACTOR * nodes()
gmsh.option.setNumber("Mesh.ScalingFactor", FACTOR)
for version in (2.2, 4.1):
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.write(f"{version}.msh")
gmsh.option.setNumber("Mesh.ScalingFactor", 1)
gmsh.model.mesh.affineTransform([FACTOR, 0, 0, 0, 0, FACTOR, 0, 0, 0, 0, FACTOR, 0])
gmsh.write("transformed.msh")
assert gmsh.option.getNumber("Mesh.IgnorePeriodicity") == 1  # its default
shift = {}
for name, ignored in (("2.2", 1), ("2.2", 0), ("4.1", 1), ("4.1", 0), ("transformed", 1)):
    gmsh.clear()
    gmsh.option.setNumber("Mesh.IgnorePeriodicity", ignored)
    gmsh.open(f"{name}.msh")
    shift[name, ignored] = abs(nodes() - right).max(axis=1)
    triangles = gmsh.model.mesh.getElementsByType(2)[0]
    area = gmsh.model.mesh.getElementQualities(triangles, "volume").sum()
    print(f"{name}.msh, IgnorePeriodicity {ignored}: {(shift[name, ignored] > 1e-9).sum()} of {len(right)} nodes"
          f" moved, by {shift[name, ignored].max():.3f} at most; area {area:.3g}, right is {FACTOR**2:.3g}")
assert shift["2.2", 1].max() < 1e-12
for torn in (("2.2", 0), ("4.1", 1), ("4.1", 0), ("transformed", 1)):
    assert np.isclose(shift[torn].max(), 1 - FACTOR)
written = meshio.read("4.1.msh").points
distance = abs(np.sort(written, axis=0) - np.sort(right, axis=0)).max()
print(f"nodes in 4.1.msh by meshio: {distance:.1e} from the right ones")
assert distance < 1e-12
PROGRAM
