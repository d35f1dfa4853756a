#!/usr/bin/env bash
# DOLFINx 0.11.0 (dolfinx-solver-real 0.11.0.post0, Python 3.12 or later): a form with another quadrature rule, or an
# expression at other points, may be the one before.
# Guess: what was compiled is found again by all of the points and weights, so that others give something else.
# Seen: it is told apart by the points as they are printed: eight digits, and of more than 1,000 numbers the first and
#   last three rows. A rule with another point in its middle gets the integral of the rule before, an expression the
#   values at the points before, and so in later processes, from the cache. 0.9 of Debian 13 does the same.
# Why it matters here: the prisms' rule, of 54 numbers, is handed over both ways: were it to grow beyond 1,000, or
#   change in its last digits, the old one would be taken.
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
def evaluated(points):
    return np.asarray(fem.Expression(x, points).eval(square, np.array([0], np.int32))).reshape(points.shape)
for degree, is_right in ((40, True), (60, False)):
    points, _ = basix.make_quadrature(basix.CellType.triangle, degree)
    others, middle = points.copy(), len(points) // 2
    others[middle] *= 0.5
    vertices = evaluated(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    right = vertices[0] + others[middle] @ (vertices[1:] - vertices[0])
    before, after = evaluated(points)[middle], evaluated(others)[middle]
    print(f"{points.size} numbers: x is {right} at the point, given as {after}, at the one before {before}")
    assert np.allclose(after, right if is_right else before) and not np.allclose(before, right)
PROGRAM
