#!/usr/bin/env bash
# SciPy 1.17.1: scipy.io.mmwrite marks a matrix as symmetric up to 99 rows and as general from 100 on.
# Guess: symmetry=None detects symmetry whatever the size, or never.
# Seen: the tridiagonal matrix of 99 rows is 'coordinate real symmetric' (lower triangle), that of 100 is 'coordinate
#   real general' (both), dense ones likewise.
# Why it matters here: matrices of a frame come as .mtx: the head says nothing about the structure once it has a
#   hundred unknowns, its values do.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check scipy==1.17.1 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import scipy.io, scipy.sparse as sparse
heads = {}
for n in (99, 100):
    matrix = sparse.diags_array([[-1.0] * (n - 1), [2.0] * n, [-1.0] * (n - 1)], offsets=[-1, 0, 1])
    for name, values in (("sparse", matrix.tocsc()), ("dense", matrix.toarray())):
        scipy.io.mmwrite("k.mtx", values)
        heads[n, name] = open("k.mtx").readline().split()[-1]
print(heads)
assert heads == {(99, "sparse"): "symmetric", (99, "dense"): "symmetric", (100, "sparse"): "general", (100, "dense"): "general"}
PROGRAM
