#!/usr/bin/env bash
# SimpleITK 2.5.7 with tifffile 2026.3.3: voxel sizes that ImageJ and OME write into a TIFF are not read, and its own
# writer loses the third.
# Guess: GetSpacing() gives 0.5 x 0.5 x 3 from an ImageJ or OME file, and what SimpleITK writes as .tif it reads back.
# Seen: it gives (1, 1, 1) for both. Of its own file with spacing (1, 2, 3) it reads (1, 2, 1). In .mhd, .nrrd and
#   .nii all three are kept.
# Why it matters here: slices three times as far apart as pixels, taken for cubes, are another material along z; sizes
#   have to be given beside the file.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check simpleitk==2.5.7 tifffile==2026.3.3 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, SimpleITK as sitk, tifffile
volume = np.arange(5 * 6 * 7, dtype=np.uint16).reshape(5, 6, 7)
tifffile.imwrite("imagej.tif", volume, imagej=True, resolution=(2.0, 2.0), metadata={"spacing": 3.0, "unit": "um", "axes": "ZYX"})
sizes = {f"PhysicalSize{axis}": size for axis, size in zip("XYZ", (0.5, 0.5, 3.0))}
tifffile.imwrite("volume.ome.tif", volume, metadata={"axes": "ZYX", **sizes})
image = sitk.GetImageFromArray(volume)
image.SetSpacing((1.0, 2.0, 3.0))
found = {name: sitk.ReadImage(name).GetSpacing() for name in ("imagej.tif", "volume.ome.tif")}
for name in ("own.tif", "own.mhd", "own.nrrd", "own.nii"):
    sitk.WriteImage(image, name)
    found[name] = sitk.ReadImage(name).GetSpacing()
print(found)
assert found["imagej.tif"] == found["volume.ome.tif"] == (1.0, 1.0, 1.0)
assert np.allclose(found["own.tif"], (1, 2, 1))
assert all(np.allclose(found[name], (1, 2, 3)) for name in ("own.mhd", "own.nrrd", "own.nii"))
PROGRAM
