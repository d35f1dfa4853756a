#!/usr/bin/env bash
# DOLFINx 0.11.0 (dolfinx-solver-real 0.11.0.post0, Python 3.12 or later): LinearProblem.solve returns what has not
# converged.
# Guess: a Krylov method that ends without convergence, or a factorisation of a singular matrix, raises.
# Seen: after one iteration of CG (reason -3) the function holds half the solution, and after LU of a singular matrix
#   (reason -11) infinity; no exception, no line.
# Why it matters here: an option file that is tuned too far gives a stress, not an error: this program's solver looks
#   at the reason after each solve and raises.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check dolfinx-solver-real==0.11.0.post0 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, ufl
from mpi4py import MPI
from dolfinx import fem, mesh
from dolfinx.fem.petsc import LinearProblem
square = mesh.create_unit_square(MPI.COMM_WORLD, 8, 8)
V = fem.functionspace(square, ("Lagrange", 1))
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
square.topology.create_connectivity(1, 2)
fixed = fem.locate_dofs_topological(V, 1, mesh.exterior_facet_indices(square.topology))
clamped = [fem.dirichletbc(0.0, fixed, V)]
def solve(prefix, bcs, options):
    problem = LinearProblem(ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx, v * ufl.dx, bcs=bcs, petsc_options_prefix=prefix, petsc_options=options)
    return float(np.abs(problem.solve().x.array).max()), problem.solver.getConvergedReason()
one = solve("one_", clamped, {"ksp_type": "cg", "pc_type": "none", "ksp_max_it": 1, "ksp_rtol": 1e-12})
singular = solve("singular_", [], {"ksp_type": "preonly", "pc_type": "lu"})
right = solve("right_", clamped, {"ksp_type": "preonly", "pc_type": "lu"})
print(one, singular, right)
assert one[1] == -3 and one[0] < 0.5 * right[0]
assert singular == (np.inf, -11)
PROGRAM
