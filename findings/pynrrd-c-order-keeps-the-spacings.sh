#!/usr/bin/env bash
# pynrrd with index_order="C", read by SimpleITK 2.5.7: the sizes are turned over, the spacings are not.
# Guess: with C order all entries that belong to an axis follow the array, so that spacings [z, y, x] arrive as (x, y,
#   z).
# Seen: an array (2, 3, 4) with spacings [3, 2, 1] arrives in SimpleITK with sizes (4, 3, 2), as it should, and
#   spacings (3, 2, 1): that of z stands at x. With the default order, F, the array arrives transposed, (4, 3, 2) for
#   (2, 3, 4).
# Why it matters here: voxels need not be cubes: a head of a raw volume (.nhdr) written this way has its long edge
#   along the wrong axis.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check pynrrd==1.1.3 simpleitk==2.5.7 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import nrrd, numpy as np, SimpleITK as sitk
volume = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
nrrd.write("c.nrrd", volume, {"spacings": [3.0, 2.0, 1.0]}, index_order="C")
nrrd.write("f.nrrd", volume)
c, f = sitk.ReadImage("c.nrrd"), sitk.ReadImage("f.nrrd")
print(c.GetSize(), c.GetSpacing(), sitk.GetArrayFromImage(f).shape)
assert c.GetSize() == (4, 3, 2) and (sitk.GetArrayFromImage(c) == volume).all()
assert c.GetSpacing() == (3.0, 2.0, 1.0)
assert sitk.GetArrayFromImage(f).shape == (4, 3, 2)
PROGRAM
