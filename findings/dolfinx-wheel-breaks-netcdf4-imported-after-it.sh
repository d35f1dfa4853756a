#!/usr/bin/env bash
# dolfinx-solver-real 0.11.0.post0 with netCDF4 1.7.5.1.post1, h5py 3.16.0 and Numba 0.68.1: what is imported after
# dolfinx.fem.petsc fails.
# Guess: wheels carry their own HDF5 under names of their own, so that their order does not matter, as among h5py,
#   netCDF4, Gmsh and VTK.
# Seen: where Numba is installed dolfinx.fem.petsc opens PETSc once more, and its HDF5 hides that of others. After it
#   netCDF4 ends in "NetCDF: HDF error" when it writes a file, and importing h5py in "Not a datatype". Imported before
#   it both work, and so they do without Numba.
# Why it matters here: a run that solves a cell by finite elements and stores its results does both; rve/fenicsx.py
#   imports h5py and netCDF4 first.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check dolfinx-solver-real==0.11.0.post0 numpy==2.4.6 \
    netCDF4==1.7.5.1.post1 h5py==3.16.0 numba==0.68.1 2>/dev/null
cat > both.py <<'PROGRAM'
import sys
if "numba" not in sys.argv:
    sys.modules["numba"] = None
for name in sys.argv[1:]:
    if name == "dolfinx":
        from mpi4py import MPI
        from petsc4py import PETSc
        from dolfinx.fem import petsc
    else:
        __import__(name)
import netCDF4
file = netCDF4.Dataset("a.nc", "w")
file.createDimension("x", 3)
file.createVariable("x", "f8", ("x",))[:] = [1, 2, 3]
file.close()
PROGRAM
environment/bin/python -W ignore both.py numba h5py netCDF4 dolfinx
environment/bin/python -W ignore both.py dolfinx h5py
if environment/bin/python -W ignore both.py numba dolfinx 2> netcdf.txt; then exit 1; fi
if environment/bin/python -W ignore both.py numba netCDF4 dolfinx h5py 2> h5py.txt; then exit 1; fi
tail -n 1 netcdf.txt h5py.txt
grep -q "NetCDF: HDF error" netcdf.txt
grep -q "Not a datatype" h5py.txt
