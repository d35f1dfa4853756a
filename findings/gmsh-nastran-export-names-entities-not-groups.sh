#!/usr/bin/env bash
# Gmsh 4.15.2: physical groups do not reach Nastran's .bdf.
# Guess: the property of an element is the tag of its physical group, as the tag in .msh 2.2 is.
# Seen: property ids are the tags of the geometrical entities (1 and 2), not of the groups (70 and 80); the groups'
#   names are nowhere. Mesh.SaveElementTagType = 2 writes the groups' tags.
# Why it matters here: phases are groups here: a mesh that went through .bdf has its phases under other numbers, and
#   two entities of one phase under two.
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
box = [gmsh.model.occ.addBox(x, 0, 0, 1, 1, 1) for x in (0, 1)]
gmsh.model.occ.fragment([(3, box[0])], [(3, box[1])])
gmsh.model.occ.synchronize()
for tag, name, volume in ((70, "matrix", box[0]), (80, "particle", box[1])):
    gmsh.model.addPhysicalGroup(3, [volume], tag, name=name)
gmsh.option.setNumber("Mesh.MeshSizeMin", 2)
gmsh.model.mesh.generate(3)
properties = {}
for kind in (1, 2):
    gmsh.option.setNumber("Mesh.SaveElementTagType", kind)
    gmsh.write("cell.bdf")
    text = open("cell.bdf").read()
    properties[kind] = {row.split()[2] for row in text.splitlines() if row.startswith("CTETRA")}
    assert "particle" not in text
print(properties)
assert properties == {1: {"1", "2"}, 2: {"70", "80"}}
PROGRAM
