#!/usr/bin/env bash
# DOLFINx 0.11.0 (dolfinx-solver-real 0.11.0.post0, Python 3.12 or later): forms whose own quadrature rules differ may be
# taken for one.
# Guess: a compiled form is found again by all of its rule, so that other points or weights give another form.
# Seen: UFL signs a form by the printed rule: eight digits, and of more than 1,000 numbers the first and last three
#   rows. A rule with another point in its middle, or whose numbers differ from the ninth digit on, gets the integral of
#   the rule before, and so in later processes, from the cache. 0.9 of Debian 13 does the same.
# Why it matters here: the prisms' rule is handed over that way, with 54 numbers: a rule that grows beyond 1,000, or is
#   tuned in its last digits, would solve with the old one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check dolfinx-solver-real==0.11.0.post0 numpy==2.4.6 2>/dev/null
XDG_CACHE_HOME=$folder environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, basix, ufl
from mpi4py import MPI
from dolfinx import fem, mesh
square = mesh.create_unit_square(MPI.COMM_WORLD, 1, 1)
x = ufl.SpatialCoordinate(square)
def integral(points, weights):
    rule = {"quadrature_rule": "custom", "quadrature_points": points, "quadrature_weights": weights}
    return fem.assemble_scalar(fem.form(x[0] ** 2 * ufl.Measure("dx", square, metadata=rule)))
for degree, factor, is_told_apart in ((4, 1 + 1e-6, True), (4, 1 + 1e-9, False), (40, 0.5, True), (60, 0.5, False)):
    points, weights = basix.make_quadrature(basix.CellType.triangle, degree)
    middle = len(points) // 2
    others = points.copy()
    others[middle] *= factor
    first, second = integral(points, weights), integral(others, weights)
    print(f"{points.size} numbers, one point times {factor}: {first} {second}")
    assert abs(first - 1 / 3) < 1e-12 and (first != second) == is_told_apart
PROGRAM
