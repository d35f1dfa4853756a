#!/usr/bin/env bash
# petsc4py 3.22.4 of Debian 13: the array of a dense matrix outlives it.
# Guess: as the array of a vector does, the one that Mat.getDenseArray returns keeps its matrix alive.
# Seen: it does not: A.matMult(X).getDenseArray(), whose matrix has no name, is an array on memory that is free; arrays
#   made afterwards write there, without an error.
# Why it matters here: products with several fields at once are read that way; the cell's operator was wrong by 5 %
#   and conjugate gradients stopped with "indefinite". Here the product has a name until its values are copied.
set -euo pipefail
"$(dirname "$0")/../enter" python - <<'PROGRAM'
import numpy as np
import petsc4py
petsc4py.init()
from petsc4py import PETSc
size = 20_000
A = PETSc.Mat().createAIJ((size, size), nnz=1, comm=PETSc.COMM_SELF)
for row in range(size):
    A.setValue(row, row, 2.0)
A.assemble()
fields = np.ones((2, size))
X = PETSc.Mat().createDense((size, 2), array=fields.T, comm=PETSc.COMM_SELF)
X.assemble()
product = A.matMult(X)  # whose values are all 2
named = product.getDenseArray()
array = A.matMult(X).getDenseArray()
others = [np.full((size, 2), 7.0) for _ in range(4)]
print("with a name:", np.unique(named), "without:", np.unique(array))
assert (named == 2).all() and (array != 2).any()
PROGRAM
