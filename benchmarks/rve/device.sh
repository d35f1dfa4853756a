#!/usr/bin/env bash
# Proved bounds of volumes with and without an NVIDIA device, in up to six minutes: every bound is compared where both solve.
# Needs Python 3.12 or later with NumPy, SciPy, Numba, CuPy and array-api-compat; not DOLFINx.
set -euo pipefail
cd "$(dirname "$0")/../.."
export PYTHONPATH=$PWD${PYTHONPATH:+:$PYTHONPATH}
"${PYTHON:-python3}" -m benchmarks.rve.voxels --devices cuda cpu --sizes 64 128 256 --largest-cpu 64
