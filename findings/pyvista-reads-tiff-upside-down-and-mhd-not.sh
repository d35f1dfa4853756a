#!/usr/bin/env bash
# PyVista 0.49.1 with VTK 9.7.2: the same volume has its rows in the opposite order from .tif than from .mhd.
# Guess: one volume written by one library to two formats is one array after reading.
# Seen: from .mhd the array is as written; from .tif the rows of each slice are mirrored in y, and no key of the
#   reader is named for it.
# Why it matters here: a mirrored cell exchanges the signs of C16 and C26: a picture beside a computed cell has to be
#   drawn from the array that was computed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check pyvista==0.49.1 vtk==9.7.2 simpleitk==2.5.7 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, pyvista as pv, SimpleITK as sitk
volume = np.arange(2 * 3 * 5, dtype=np.uint8).reshape(2, 3, 5)
image = sitk.GetImageFromArray(volume)
arrays = {}
for name in ("v.mhd", "v.tif"):
    sitk.WriteImage(image, name)
    grid = pv.read(name)
    arrays[name] = np.asarray(grid[grid.array_names[0]]).reshape(volume.shape)
print(arrays["v.mhd"][0, 0], arrays["v.tif"][0, 0])
assert (arrays["v.mhd"] == volume).all()
assert (arrays["v.tif"] == volume[:, ::-1]).all()
PROGRAM
