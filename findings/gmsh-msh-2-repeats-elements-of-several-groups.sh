#!/usr/bin/env bash
# Gmsh 4.15.2: from MSH 2.2 a volume of two physical groups comes back with each of its elements twice.
# Guess: an element has the tags of all its groups in the file, and is one element again.
# Seen: it is written once for each group, under numbers of its own, and read as so many elements of one volume, which is
#   in both groups: masses and stiffnesses double. From MSH 4.1 it is one.
# Why it matters here: a group "all" beside those of the phases is usual: a mesh with it is refused here, whatever its
#   version.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check gmsh==4.15.2 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import gmsh
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
gmsh.model.occ.synchronize()
for name in ("clay", "all"):
    gmsh.model.addPhysicalGroup(3, [1], name=name)
gmsh.option.setNumber("Mesh.MeshSizeMin", 1)
gmsh.model.mesh.generate(3)
def tetrahedra():
    return len(gmsh.model.mesh.getElementsByType(4)[0])
meshed, found = tetrahedra(), {}
for version in (2.2, 4.1):
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.write(f"{version}.msh")
for version in (2.2, 4.1):
    gmsh.clear()
    gmsh.open(f"{version}.msh")
    found[version] = tetrahedra()
    groups = gmsh.model.getPhysicalGroups(3)
    assert [gmsh.model.getEntitiesForPhysicalGroup(*group).tolist() for group in groups] == [[1], [1]]
print(meshed, found)
assert found == {2.2: 2 * meshed, 4.1: meshed}
PROGRAM
