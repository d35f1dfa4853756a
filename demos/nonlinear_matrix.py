# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # A nonlinear matrix: Newton's method on the product space
#
# The matrix softens by a power law with a potential, the fibre is linear. `ProductSpace` brings
# the space, the measure of each phase, the assembly into periodic unknowns and the preconditioned
# solve. The law is UFL, and UFL differentiates it.

# %%
import os
from pathlib import Path

from mpi4py import MPI  # noqa: F401 - before DOLFINx, whose wheels need that
import matplotlib.pyplot as plt
import numpy as np
import ufl
from dolfinx import fem

from alphacut.rve import Phase, PrismModel, ProductSpace
from alphacut.stochastic import HermiteMap

radius = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
soft, stiff = Phase(20e9, 0.3), Phase(80e9, 0.3)
model = PrismModel(mesh_size=0.4, layers=4, stiffness=True, estimate=False)
cell = ProductSpace(model, radius)

# %% [markdown]
# ## The potential
# $w = \frac{K}{2}\,\mathrm{tr}^2\varepsilon + \frac{2 G \varepsilon_0^2}{n+1}
# \left[\left(1 + \frac{e:e}{\varepsilon_0^2}\right)^{(n+1)/2} - 1\right]$ with the deviator e of
# plane strain. It is linear elasticity for n = 1, and for any n near e = 0.

# %%
u, v, du = fem.Function(cell.space), ufl.TestFunction(cell.space), ufl.TrialFunction(cell.space)
uniform = fem.Constant(cell.space.mesh, np.zeros(3))  # (ε11, ε22, 2 ε12)
exponent = fem.Constant(cell.space.mesh, 1.0)
YIELD_STRAIN = 0.005


def potential(strain, phase, n):
    """Energy density of a phase."""
    bulk = phase.modulus / (3 * (1 - 2 * phase.poisson))
    shear = phase.modulus / (2 * (1 + phase.poisson))
    trace = strain[0] + strain[1]
    deviator = strain[0] ** 2 + strain[1] ** 2 + strain[2] ** 2 / 2 - trace**2 / 3
    power = (1 + deviator / YIELD_STRAIN**2) ** ((n + 1) / 2) - 1
    return bulk / 2 * trace**2 + 2 * shear * YIELD_STRAIN**2 / (n + 1) * power


# %% [markdown]
# The residual is the derivative of the energy in the fluctuation, the tangent that of the
# residual, the stress the derivative in the strain. All are weighted by $f_\Theta$.

# %%
strain = ufl.variable(uniform + cell.strain(u))
matrix, fibre = potential(strain, soft, exponent), potential(strain, stiff, 1.0)
energy = cell.density * matrix * cell.dx["matrix"] + cell.density * fibre * cell.dx["inclusion"]
residual = ufl.derivative(energy, u, v)
tangent = ufl.derivative(residual, u, du)
stresses = [
    cell.density * ufl.diff(matrix, strain)[k] * cell.dx["matrix"]
    + cell.density * ufl.diff(fibre, strain)[k] * cell.dx["inclusion"]
    for k in range(3)
]


def newton(load, n):
    """Mean stress, and the residual of each step over the first."""
    uniform.value[:], exponent.value, u.x.array[:] = load, n, 0.0
    total, norms = cell.assemble_vector(residual), []
    total.set(0.0)
    for _ in range(12):
        forces = cell.assemble_vector(residual)
        norms.append(forces.norm())
        if norms[-1] <= 1e-9 * norms[0]:
            return np.array([cell.mean(s) for s in stresses]), np.array(norms) / norms[0]
        solved = cell.solve(cell.assemble_matrix(tangent), [forces], {"ksp_rtol": "1e-12"})
        total.axpy(-1, solved.vectors[0])
        cell.assign(u, total)
    raise RuntimeError("Newton's method did not converge")


# %% [markdown]
# ## Checks
# With n = 1 one step is exact, and the stress that of the linear model. With n = 0.5 the digits
# double at each step, and the stress is the derivative of the energy in the mean strain.

# %%
LOAD = np.array([0.002, -0.002, 0.0])  # shear between the diagonals of the cell
linear = model.solve(radius, soft, [stiff])[0].stiffness @ LOAD
stress, norms = newton(LOAD, 1.0)
assert len(norms) == 2
assert np.allclose(stress, linear, rtol=1e-9, atol=1e-9 * linear[0])

energies = []
for sign in (1, -1):
    newton((1 + 1e-5 * sign) * LOAD, 0.5)
    energies.append(cell.mean(energy))
stress, norms = newton(LOAD, 0.5)
orders = np.log(norms[2:]) / np.log(norms[1:-1])
print(f"residuals {norms}, orders {orders}; σ11 {stress[0] / linear[0]:.4f} of the linear one")
assert min(orders[-2:]) >= 1.8
assert abs(stress @ LOAD / (energies[0] - energies[1]) * 2e-5 - 1) < 1e-7

# %% [markdown]
# ## Stress over strain

# %%
factors = np.array([1.0, 2.0, 4.0])
curve = [newton(factor * LOAD, 0.5)[0][0] for factor in factors]
plt.plot(100 * LOAD[0] * factors, np.array(curve) / 1e6, "o-", label="n = 0.5")
plt.plot(100 * LOAD[0] * factors, factors * linear[0] / 1e6, label="linear")
plt.gca().set(xlabel="mean strain 11, %", ylabel="mean stress 11, MPa")
plt.legend()
plt.savefig(Path(os.environ.get("PICTURES", ".")) / "nonlinear_matrix.png")
