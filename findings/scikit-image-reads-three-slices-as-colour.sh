#!/usr/bin/env bash
# scikit-image 0.26.0 with tifffile 2026.3.3: a grey volume of three or four slices is read as one colour image.
# Guess: the axes that the file itself names (ImageJ, ZYX, one page a slice, black is zero) are kept, as for five
#   slices.
# Seen: skimage.io.imread returns (y, x, 3) for 3 slices and (y, x, 4) for 4, and (z, y, x) for 2 and for 5. tifffile
#   returns (z, y, x) for all.
# Why it matters here: a thin tomogram becomes a colour micrograph and passes a check of its number of axes; images
#   for a case are prepared with tifffile.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check scikit-image==0.26.0 tifffile==2026.3.3 numpy==2.4.6 pillow==13.0.0 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, skimage.io, tifffile
for n in (2, 3, 4, 5):
    volume = np.arange(n * 6 * 7, dtype=np.uint8).reshape(n, 6, 7)
    tifffile.imwrite("v.tif", volume, imagej=True, photometric="minisblack", metadata={"axes": "ZYX"})
    read, direct = skimage.io.imread("v.tif"), tifffile.imread("v.tif")
    print(n, "slices: scikit-image", read.shape, "tifffile", direct.shape)
    assert direct.shape == volume.shape
    assert read.shape == ((6, 7, n) if n in (3, 4) else (n, 6, 7))
PROGRAM
