#!/usr/bin/env bash
# Pillow 13.0.0 with tifffile 2026.3.3: integer images change sign without a word.
# Guess: unsigned 32 bit labels are read as they are or refused, as Pillow refuses 64 bit floats; signed bytes
#   likewise.
# Seen: labels from 2**31 on become negative (mode I is signed), and the signed byte -5 becomes 251 (mode L).
# Why it matters here: segmentation tools number phases with uint32 and mark the outside with -1: a phase would be
#   looked up under another label.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check pillow==13.0.0 tifffile==2026.3.3 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, tifffile
from PIL import Image, UnidentifiedImageError
def through_pillow(array):
    tifffile.imwrite("labels.tif", np.tile(array, (4, 1)))
    return np.asarray(Image.open("labels.tif"))[0].tolist()
large = through_pillow(np.array([0, 1, 2**31, 2**32 - 1], np.uint32))
small = through_pillow(np.array([0, 1, -5, 100], np.int8))
print(large, small)
assert large == [0, 1, -(2**31), -1] and small == [0, 1, 251, 100]
try:
    through_pillow(np.array([0.5]))
except UnidentifiedImageError:
    print("64 bit floats are refused")
else:
    raise AssertionError
PROGRAM
