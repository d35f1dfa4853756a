# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # The cell on the product space, from mesh to modulus
#
# A fibre of random radius sits in a periodic square cell. The radius is a function of one normal
# variable θ, so cell × θ is a three-dimensional domain and the particle a cone in it. Elasticity
# acts in the plane alone: the form has no derivative along θ, and a weight $f_\Theta$. This demo
# solves it once, step by step, with Gmsh, DOLFINx and PETSc; `PrismModel` does the same in one
# call.

# %%
import os
from pathlib import Path


from mpi4py import MPI  # noqa: F401, before DOLFINx, whose wheels need that

import numpy as np
import ufl
from dolfinx import fem

from alphacut.rve import LOADS, Phase, PrismModel, ProductSpace, effective_modulus
from alphacut.stochastic import HermiteMap

# %% [markdown]
# ## The random radius
# The paper's map at its nominal values (eq. 11, 12): the radius rises with θ from 0.13 to 0.87 of
# half the cell's side, and θ is normal, cut off at ±3.

# %%
radius = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
matrix, fibre = Phase(20e9, 0.3), Phase(80e9, 0.3)

# %% [markdown]
# ## The mesh
# Gmsh meshes the square around a circle of middle size, opposite sides matching. Twelve layers of
# prisms over θ follow the cone: on each level the nodes slide along rays from the centre. Each
# prism is a serendipity wedge of 15 nodes, which Basix takes as a custom element, for the
# displacements and for the geometry, so the cone is curved.

# %%
space = ProductSpace(PrismModel(mesh_size=0.15, layers=12), radius)
mesh = space.space.mesh
print(f"{mesh.topology.index_map(3).size_local} wedges, {len(mesh.geometry.x)} nodes")

# %% [markdown]
# ## The form
# The strain takes the two derivatives in the plane (eq. 5), the stress one of two stiffnesses
# (eq. 6, 13), and the weak form is weighted with the density of θ (eq. 1, 7). `density` is a
# function at quadrature points, and each phase has its measure.

# %%
u, v = ufl.TrialFunction(space.space), ufl.TestFunction(space.space)
phases = {"matrix": matrix, "inclusion": fibre}
stiffness = {name: fem.Constant(mesh, phase.stiffness) for name, phase in phases.items()}


def strain(w):
    """(ε11, ε22, 2 ε12); θ is not differentiated."""
    gradient = ufl.grad(w)
    return ufl.as_vector([gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]])


def work(first, second):
    """Weighted work of the stress of a strain on another."""
    return sum(
        space.density * ufl.dot(stiffness[name] * first, second) * space.dx[name] for name in phases
    )


# %% [markdown]
# A constant strain ε̄11 = ε̄22 = 1 gives the Voigt bound of C11 + C12, a first check.

# %%
uniform = fem.Constant(mesh, np.array([1.0, 1.0, 0.0]))
print(f"Voigt bound of C11 + C12: {space.mean(work(uniform, uniform)) / 2 / 1e9:.4f} GPa")

# %% [markdown]
# ## Constraints and solver
# Opposite nodes are one unknown; the corner is fixed on its whole line over θ, since a
# translation that depends on θ costs nothing. Both are done by PETSc's local-to-global map while
# DOLFINx assembles. Conjugate gradients are preconditioned level by level
# (`rve.solver.theta_preconditioner`); every PETSc option under the prefix `rve_` and, for the
# plane problems, `rve_level_` is heard.

# %%
operator, loads = space.assemble_matrix(work(strain(u), strain(v))), []
for load in LOADS:
    uniform.value[:] = -load
    loads.append(space.assemble_vector(work(uniform, strain(v))))
solved = space.solve(operator, loads, {"ksp_rtol": "1e-9"})
print(f"iterations {solved.iterations}, relative residual {solved.residual:.1e}")

# %% [markdown]
# ## From stresses to the modulus
# The homogenised stress is the mean over cell and θ under each load (eq. 15, 16).

# %%
fluctuation, unit = fem.Function(space.space), fem.Constant(mesh, np.zeros(3))
means = []
for load, vector, component in zip(LOADS, solved.vectors, (0, 2), strict=True):
    space.assign(fluctuation, vector)
    uniform.value[:], unit.value[:] = load, np.eye(3)[component]
    means.append(space.mean(work(uniform + strain(fluctuation), unit)))
modulus, poisson = effective_modulus(*means)
print(f"E = {modulus / 1e9:.8f} GPa, ν = {poisson:.6f}")

# %% [markdown]
# One call does all of this, measures its error against the exact series, and certifies the
# result.

# %%
result = PrismModel().solve(radius, matrix, [fibre])[0]
print(result)
assert abs(result.modulus / modulus - 1) < 1e-9

# %% [markdown]
# ## Pictures
# The fields at the nodes go to ParaView as quadratic wedges; PyVista draws them here. The cell is
# cut open along a side of the cone.

# %%
drawn = PrismModel().fields(radius, matrix, [fibre])


def picture(folder: Path) -> None:
    """Write the fields, and draw the particle and the stress, by PyVista."""
    import pyvista

    fields = drawn.in_tetrahedra()
    grid = pyvista.UnstructuredGrid({pyvista.CellType.QUADRATIC_TETRA: fields.cells}, fields.points)
    assert (grid.compute_cell_sizes()["Volume"] > 0).all()
    grid.cell_data["phase"] = fields.phase
    grid.point_data["stress 11 in MPa"] = fields.stress[:, 0, 0] / 1e6
    grid.save(folder / "product_space_cell.vtu")
    plotter = pyvista.Plotter(off_screen=True, shape=(1, 2), window_size=(1300, 900))
    plotter.add_mesh(grid.extract_cells(fields.phase == 1), color="goldenrod", show_edges=True)
    plotter.add_mesh(grid.outline(), color="black")
    plotter.add_text("the particle, theta upwards", font_size=11)
    plotter.subplot(0, 1)
    half = grid.extract_cells(grid.cell_centers().points[:, 1] > 0)
    plotter.add_mesh(half, scalars="stress 11 in MPa", cmap="viridis", lighting=False)
    plotter.add_text("stress under equal strains of 0.01", font_size=11)
    plotter.link_views()
    plotter.camera_position = [(8.5, -12.0, 5.0), (0, 0, -0.4), (0, 0, 1)]
    plotter.screenshot(folder / "product_space_cell.png")


if "DISPLAY" in os.environ:  # VTK wants one; ``xvfb-run`` lends it
    picture(Path(os.environ.get("PICTURES", ".")))
