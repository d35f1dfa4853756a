# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # A law of one's own: heated phases
#
# A cell whose phases want to expand, held at its mean size. The form is the user's UFL on the
# product space: stress σ = C (ε(u) − ε*), where ε* is what a phase would take without constraint.
# For two phases Levin (1967) gives the mean stress exactly from the elastic stiffness of the cell
# alone, so there is something to compare with.

# %%
from mpi4py import MPI  # before DOLFINx, whose wheels need that

import numpy as np
import ufl
from dolfinx import fem

from alphacut.rve import Phase
from alphacut.rve.form import strain
from alphacut.rve.mesh.columns import extrude
from alphacut.rve.prism.problem import PrismProblem
from alphacut.rve.solver.krylov import solve
from alphacut.rve.solver.options import SolverOptions
from alphacut.stochastic import HermiteMap

# %% [markdown]
# ## Mesh, space, measures
# `dx` holds one measure for each phase, `density` is the density of θ at quadrature points.

# %%
phases = {"matrix": Phase(20e9, 0.3), "inclusion": Phase(80e9, 0.2)}
free = {"matrix": np.array([1e-3, 1e-3, 0.0]), "inclusion": np.array([2e-4, 2e-4, 0.0])}
problem = PrismProblem(extrude(size=0.4, radius=0.5, layers=4), MPI.COMM_SELF)
problem.move(HermiteMap(0.3, 0.1, 0.7, 0.1))
space, density, dx = problem.form.space, problem.form.elastic.density, problem.form.dx
C = {name: fem.Constant(problem.form.mesh, phase.stiffness) for name, phase in phases.items()}
star = {name: fem.Constant(problem.form.mesh, value) for name, value in free.items()}

# %% [markdown]
# ## The form
# Both sides are assembled straight into the reduced unknowns, in which opposite nodes are one.

# %%
u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
left = sum(density * ufl.dot(C[x] * strain(u), strain(v)) * dx[x] for x in dx)
right = sum(density * ufl.dot(C[x] * star[x], strain(v)) * dx[x] for x in dx)
stiffness = problem.assemble_operator(fem.form(left))
forces = problem.assemble_forces(fem.form(right))
ksp = problem.solver(SolverOptions({"ksp_rtol": "1e-12"}), stiffness)
heated = solve(ksp, [forces])
print(f"iterations {heated.iterations}")

# %% [markdown]
# ## The mean stress
# `slice_strains` gives the mean strain of each phase over each slice.

# %%
order = problem.form.grid.names
moduli = [phases[name].stiffness for name in order]
means = problem.slice_strains([(np.zeros(3), problem.field(heated.vectors[0]))])
shares = means.fractions @ means.weights
stress = means.weights @ means.stress(moduli)[..., 0]
stress -= sum(share * phases[x].stiffness @ free[x] for share, x in zip(shares, order, strict=True))
print("mean stress, MPa:", stress / 1e6)

# %% [markdown]
# ## Levin's relation
# The elastic cell C̄ tells the mean strain of the inclusion under any load, hence its part in the
# mean stress: σ̄ = −C_m ε*_m − (C̄ − C_m)(C_i − C_m)⁻¹ (C_i ε*_i − C_m ε*_m).

# %%
loads = np.eye(3)
problem.assemble(moduli)
elastic = solve(problem.solver(SolverOptions({"ksp_rtol": "1e-12"})), problem.loads(loads))
fields = [(load, problem.field(x)) for load, x in zip(loads, elastic.vectors, strict=True)]
strains = problem.slice_strains(fields)
cell = np.tensordot(strains.weights, strains.stress(moduli), axes=1)
matrix, inclusion = (phases[name].stiffness for name in ("matrix", "inclusion"))
contrast = inclusion @ free["inclusion"] - matrix @ free["matrix"]
levin = -matrix @ free["matrix"]
levin -= (cell - matrix) @ np.linalg.solve(inclusion - matrix, contrast)
error = abs(stress - levin).max() / abs(levin).max()
print(f"Levin's: {levin / 1e6}, relative difference {error:.1e}")
assert error < 1e-10
