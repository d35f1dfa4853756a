#!/usr/bin/env bash
# PyVista 0.49.1 with VTK 9.7.2 and meshio 5.3.5: what meshio writes as .xdmf, pv.read() ends in a TypeError, and what it
# could read meshio cannot.
# Guess: a static grid in XDMF 3 is read as one, as VTK's own reader does.
# Seen: "'NoneType' object is not iterable", since PyVista asks for time values first. With <Time Value="0"/> in the grid
#   PyVista reads it, and meshio.read() ends the process: "Unknown section 'Time'". VTK's vtkXdmfReader reads both.
# Why it matters here: the .xdmf of a cell has no time: open it in ParaView, or take .vtu.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check pyvista==0.49.1 vtk==9.7.2 meshio==5.3.5 h5py==3.16.0 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import meshio, numpy as np, pyvista as pv
from vtkmodules.vtkIOXdmf2 import vtkXdmfReader
mesh = meshio.Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]), [("tetra", np.array([[0, 1, 2, 3]]))])
meshio.write("static.xdmf", mesh, data_format="XML")
text = open("static.xdmf").read()
assert '<Grid Name="Grid">' in text
open("timed.xdmf", "w").write(text.replace('<Grid Name="Grid">', '<Grid Name="Grid"><Time Value="0.0"/>'))
for name in ("static.xdmf", "timed.xdmf"):
    reader = vtkXdmfReader()
    reader.SetFileName(name)
    reader.Update()
    assert reader.GetOutputDataObject(0).GetNumberOfCells() == 1
assert pv.read("timed.xdmf").n_cells == 1 and len(meshio.read("static.xdmf").cells) == 1
try:
    pv.read("static.xdmf")
except TypeError as error:
    print(error)
else:
    raise AssertionError("PyVista reads it")
try:
    meshio.read("timed.xdmf")
except SystemExit:
    pass
else:
    raise AssertionError("meshio reads it")
PROGRAM
