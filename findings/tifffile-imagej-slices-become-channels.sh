#!/usr/bin/env bash
# tifffile 2026.3.3: five slices written as an ImageJ stack come back as five channels.
# Guess: an array of three axes in an ImageJ file is a stack, axes ZYX, as ImageJ's own "Save as TIFF" has it.
# Seen: series[0].axes is CYX and the metadata say channels: 5. The array itself is the same; axes="ZYX" in the metadata
#   makes it slices: 5. Without imagej=True the axes are QYX, "unknown".
# Why it matters here: a tomogram that went through it is opened in ImageJ or by a reader that goes by axes as a picture of
#   five colours: a volume is handed over as an array.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check tifffile==2026.3.3 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, tifffile
volume = np.arange(5 * 6 * 7, dtype=np.uint8).reshape(5, 6, 7)
def written(**options):
    tifffile.imwrite("volume.tif", volume, **options)
    with tifffile.TiffFile("volume.tif") as file:
        said = file.imagej_metadata or {}
        assert np.array_equal(file.asarray(), volume)
        return file.series[0].axes, said.get("channels"), said.get("slices")

print(written(imagej=True), written(imagej=True, metadata={"axes": "ZYX"}), written())
assert written(imagej=True) == ("CYX", 5, None)
assert written(imagej=True, metadata={"axes": "ZYX"}) == ("ZYX", None, 5)
assert written()[0] == "QYX"
PROGRAM
