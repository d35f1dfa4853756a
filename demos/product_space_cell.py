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

from mpi4py import MPI  # before DOLFINx, whose wheels need that

import numpy as np
import ufl
from dolfinx import fem

from alphacut.export.mesh import VTK_ORDER
from alphacut.rve import LOADS, Phase, PrismModel, effective_modulus
from alphacut.rve.mesh.columns import extrude
from alphacut.rve.mesh.triangulation import reference_radius
from alphacut.rve.prism.fields import cell_fields
from alphacut.rve.prism.problem import PrismProblem
from alphacut.rve.solver.krylov import solve
from alphacut.rve.solver.options import SolverOptions
from alphacut.stochastic import HermiteMap

# %% [markdown]
# ## The random radius
# The paper's map at its modal values (eq. 11, 12): the radius rises with θ from 0.13 to 0.87 of
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
grid = extrude(size=0.15, radius=reference_radius(radius), layers=12)
problem = PrismProblem(grid, MPI.COMM_SELF)
problem.move(radius)
mesh, space = problem.form.mesh, problem.form.space
print(f"{len(grid.cells)} wedges, {grid.nodes} nodes, {problem.numbering.size} unknowns")

# %% [markdown]
# ## The form
# The strain takes the two derivatives in the plane (eq. 5), the stress one of two stiffnesses
# (eq. 6, 13), and the weak form is weighted with the density of θ (eq. 1, 7). It stands in
# `rve.form` as here; `density` is a function at quadrature points, and each phase has its measure.

# %%
u, v = ufl.TrialFunction(space), ufl.TestFunction(space)


def strain(w):
    """(ε11, ε22, 2 ε12); θ is not differentiated."""
    gradient = ufl.grad(w)
    return ufl.as_vector([gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]])


density, dx = problem.form.elastic.density, problem.form.dx
stiff, soft = (fem.Constant(mesh, phase.stiffness) for phase in (fibre, matrix))
form = density * ufl.dot(soft * strain(u), strain(v)) * dx["matrix"]
form += density * ufl.dot(stiff * strain(u), strain(v)) * dx["inclusion"]

# %% [markdown]
# The affine field u = ε̄x, ε̄11 = ε̄22 = 1, has a constant strain, so the form tells the Voigt
# bound of C11 + C12, a first check.

# %%
affine = fem.Function(space)
places = mesh.geometry.x[:, :2]
nodes = np.empty(len(places), dtype=np.int64)
nodes[space.dofmap.list] = mesh.geometry.dofmap
affine.x.array[:] = places[nodes].ravel()
energy = fem.assemble_scalar(fem.form(ufl.replace(form, {u: affine, v: affine})))
print(f"Voigt bound of C11 + C12: {energy / 8 / 1e9:.4f} GPa")

# %% [markdown]
# ## Constraints and solver
# Opposite nodes are one unknown; the corner is fixed on its whole line over θ, since a
# translation that depends on θ costs nothing. Both are done by PETSc's local-to-global map while
# DOLFINx assembles. Conjugate gradients are preconditioned level by level
# (`rve.solver.theta_preconditioner`); every PETSc option under the prefix `rve_` and, for the
# plane problems, `rve_level_` is heard.

# %%
problem.assemble((matrix.stiffness, fibre.stiffness))
ksp = problem.solver(SolverOptions({"ksp_rtol": "1e-9"}))
solved = solve(ksp, problem.loads(LOADS))
print(f"iterations {solved.iterations}, relative residual {solved.residual:.1e}")

# %% [markdown]
# ## From stresses to the modulus
# The homogenised stress is the mean over each slice at fixed θ, and then over θ (eq. 15, 16).

# %%
fields = [(load, problem.field(x)) for load, x in zip(LOADS, solved.vectors, strict=True)]
slices = problem.slice_strains(fields)
stress = slices.stress((matrix.stiffness, fibre.stiffness))
s11, s12 = slices.weights @ stress[:, 0, 0], slices.weights @ stress[:, 2, 1]
modulus, poisson = effective_modulus(s11, s12)
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
drawn = cell_fields(PrismModel(), radius, matrix, fibre)


def picture(folder: Path) -> None:
    """Write the fields, and draw the particle and the stress, by PyVista."""
    import pyvista

    cells = np.hstack([np.full((len(drawn.cells), 1), 15), drawn.cells[:, VTK_ORDER]])
    wedges = pyvista.UnstructuredGrid(cells.ravel(), np.full(len(cells), 26), drawn.points)
    assert (wedges.compute_cell_sizes()["Volume"] > 0).all()
    wedges.cell_data["phase"] = drawn.phase
    wedges.point_data["stress 11 in MPa"] = drawn.stress[:, 0, 0] / 1e6
    wedges.save(folder / "product_space_cell.vtu")
    plotter = pyvista.Plotter(off_screen=True, shape=(1, 2), window_size=(1300, 900))
    plotter.add_mesh(wedges.extract_cells(drawn.phase == 1), color="goldenrod", show_edges=True)
    plotter.add_mesh(wedges.outline(), color="black")
    plotter.add_text("the particle, theta upwards", font_size=11)
    plotter.subplot(0, 1)
    half = wedges.extract_cells(wedges.cell_centers().points[:, 1] > 0)
    plotter.add_mesh(half, scalars="stress 11 in MPa", cmap="viridis", lighting=False)
    plotter.add_text("stress under equal strains of 0.01", font_size=11)
    plotter.link_views()
    plotter.camera_position = [(8.5, -12.0, 5.0), (0, 0, -0.4), (0, 0, 1)]
    plotter.screenshot(folder / "product_space_cell.png")


if "DISPLAY" in os.environ:  # VTK wants one; ``xvfb-run`` lends it
    picture(Path(os.environ.get("PICTURES", ".")))
