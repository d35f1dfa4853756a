#!/usr/bin/env bash
# CuPy 14.2.0 with SciPy 1.18.1 on an NVIDIA device: counts with weights have other last digits at every run, and what
# NumPy refuses passes. Runs the CuPy that is installed; without a device or CuPy nothing is claimed.
# Guess: sums of any kind repeat their bits; an index out of range and a singular matrix are errors; of repeated indices
#   the last one stays.
# Seen: of ten runs bincount and add.at give ten results, sums, products and FFTs one. Of repeated indices another value
#   stays at each run. Indices in an array are taken modulo the length. inv and solve of a singular matrix give numbers
#   that are not finite. With SCIPY_ARRAY_API=1 scipy.fft and scipy.ndimage take device arrays, scipy.linalg refuses them.
# Why it matters here: fields of voxels are solved for on a device as well: by slices and products alone.
set -euo pipefail
if ! nvidia-smi -L > /dev/null 2>&1 || ! python3 -c "import cupy, scipy" 2> /dev/null; then
    echo "no NVIDIA device with CuPy: nothing was run"
    exit 0
fi
SCIPY_ARRAY_API=1 python3 -W ignore - <<'PROGRAM'
import numpy as np, cupy as cp, scipy
from scipy import fft, linalg, ndimage
assert (cp.__version__, scipy.__version__) == ("14.2.0", "1.18.1"), (cp.__version__, scipy.__version__)
random = np.random.default_rng(1)
bins = cp.asarray(random.integers(100, size=1_000_000))
weights, square = cp.asarray(random.normal(size=1_000_000)), cp.asarray(random.normal(size=(300, 300)))
def added():
    total = cp.zeros(100)
    cp.add.at(total, bins, weights)
    return total
def assigned():
    values = cp.zeros(100)
    values[bins] = weights
    return values
vary = {"bincount": lambda: cp.bincount(bins, weights=weights), "add.at": added, "assignment": assigned}
stay = {"sum": weights.sum, "dot": lambda: weights @ weights, "matmul": lambda: square @ square,
    "fft": lambda: cp.fft.rfftn(weights.reshape(100, 100, 100))}
results = {name: len({run().get().tobytes() for _ in range(10)}) for name, run in {**vary, **stay}.items()}
print("results of ten runs:", results)
assert all(results[name] > 1 for name in vary) and all(results[name] == 1 for name in stay)
assert cp.arange(3.0)[cp.array([7])].tolist() == [1.0]
singular = cp.array([[1.0, 2.0], [2.0, 4.0]])
assert not cp.isfinite(cp.linalg.inv(singular)).all()
assert not cp.isfinite(cp.linalg.solve(singular, cp.ones(2))).all()
assert isinstance(fft.rfftn(square), cp.ndarray) and isinstance(ndimage.label(square > 0)[0], cp.ndarray)
try:
    linalg.inv(square)
except TypeError as error:
    print(error)
else:
    raise AssertionError
PROGRAM
