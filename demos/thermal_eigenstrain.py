# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # Thermal expansion of the cell, against Levin's relation
#
# Each phase expands when it is heated, and the other hinders it. The load is an eigenstrain in
# the form; `ProductSpace` brings all else. For two phases Levin (1967) tells the effective
# expansion from the effective stiffness alone, whatever the geometry.

# %%
from mpi4py import MPI  # noqa: F401 - before DOLFINx, whose wheels need that

import numpy as np
import ufl
from dolfinx import fem

from alphacut.rve import Phase, PrismModel, ProductSpace, VoigtPhase
from alphacut.stochastic import HermiteMap

radius = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
resin = Phase(4e9, 0.35)
fibre = VoigtPhase(((60e9, 8e9, 3e9), (8e9, 18e9, 2e9), (3e9, 2e9, 7e9)))
expansion = np.array([60e-6, 60e-6, 0.0]), np.array([-1e-6, 12e-6, 5e-6])  # ε of each, 1/K
model = PrismModel(0.3, 6, petsc={"ksp_rtol": "1e-11"}, stiffness=True, estimate=False)
cell = ProductSpace(model, radius)

# %% [markdown]
# ## The form
# σ = C (ε(u) + ε̄ − ε*), with ε̄ = 0: the sides of the cell are held. Where the fibre is
# orthotropic and turned, all three components couple.

# %%
u, v = ufl.TrialFunction(cell.space), ufl.TestFunction(cell.space)
stiffness = [fem.Constant(cell.space.mesh, phase.stiffness) for phase in (resin, fibre)]
eigenstrains = [fem.Constant(cell.space.mesh, value) for value in expansion]
parts = list(zip((cell.dx["matrix"], cell.dx["inclusion"]), stiffness, eigenstrains, strict=True))
left = sum(cell.density * ufl.dot(c * cell.strain(u), cell.strain(v)) * dx for dx, c, _ in parts)
right = sum(cell.density * ufl.dot(c * thermal, cell.strain(v)) * dx for dx, c, thermal in parts)
solved = cell.solve(cell.assemble_matrix(left), [cell.assemble_vector(right)])
print(f"iterations {solved.iterations}, relative residual {solved.residual:.1e}")

# %% [markdown]
# ## The thermal stress
# The mean of C (ε(u) − ε*) is −β̄, the stress that holds the cell when it is heated by 1 K.

# %%
fluctuation = fem.Function(cell.space)
cell.assign(fluctuation, solved.vectors[0])
stress = [
    sum(cell.density * (c * (cell.strain(fluctuation) - e))[i] * dx for dx, c, e in parts)
    for i in range(3)
]
beta = -np.array([cell.mean(form) for form in stress])
print("thermal stress, kPa/K:", beta / 1e3)

# %% [markdown]
# ## Levin's relation
# β̄ = β₀ + (C̄ − C₀)(C₁ − C₀)⁻¹ (β₁ − β₀), with β = C ε* of each phase and C̄ from three
# mechanical loads.

# %%
result = model.solve(radius, resin, [fibre])[0]
first, second = (
    phase.stiffness @ strain for phase, strain in zip((resin, fibre), expansion, strict=True)
)
contrast = np.linalg.solve(fibre.stiffness - resin.stiffness, second - first)
levin = first + (result.stiffness - resin.stiffness) @ contrast
difference = abs(beta - levin).max() / abs(levin).max()
print(f"Levin, kPa/K: {levin / 1e3}, {difference:.1e} from it")
assert difference < 1e-10

expansion_of_cell = np.linalg.solve(result.stiffness, beta)
print("the free cell expands by", expansion_of_cell * 1e6, "1e-6 / K")
