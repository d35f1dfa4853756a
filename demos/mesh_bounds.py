# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # A mesh of one's own, with bounds from both sides
#
# Gmsh meshes a rhombus, the cell of a hexagonal array, around a fibre with corners and a coating.
# The displacements of a finite element solution bound the stiffness from above. Stresses in
# equilibrium bound it from below; `MeshModel.bounds` takes them from stress functions on the same
# prisms, and counts curved edges and the distribution of θ.

# %%
import os
import tempfile
from pathlib import Path

from mpi4py import MPI  # noqa: F401 - before DOLFINx, whose wheels need that
import gmsh
import numpy as np
import ufl
from dolfinx import fem

from alphacut.rve import MeshModel, Phase, ProductSpace
from alphacut.stochastic import TruncatedNormal

folder = Path(tempfile.mkdtemp())
law = TruncatedNormal(-3, 3)

# %% [markdown]
# ## The mesh
# Opposite sides match by `setPeriodic`. The plane is extruded along θ from −3 to 3, in one layer
# of prisms, since nothing in it depends on θ. Physical groups name the phases.

# %%
FIRST, SECOND = np.array([2.0, 0.0]), np.array([1.0, np.sqrt(3.0)])


def write_mesh(path: Path, size: float) -> None:
    """Mesh the rhombus around a square inside a circle."""
    gmsh.initialize(["", "-v", "1"], readConfigFiles=False, interruptible=False)
    geo = gmsh.model.geo

    def loop_of_lines(places):
        points = [geo.addPoint(x, y, -3, size) for x, y in places]
        lines = [geo.addLine(points[k - 1], points[k]) for k in range(len(points))]
        return lines, geo.addCurveLoop(lines)

    corners = [(FIRST * a + SECOND * b) / 2 for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides, rhombus = loop_of_lines(corners)
    fibre = loop_of_lines([(-0.35, -0.35), (0.35, -0.35), (0.35, 0.35), (-0.35, 0.35)])[1]
    middle = geo.addPoint(0, 0, -3, size)
    places = ((0.65, 0), (0, 0.65), (-0.65, 0), (0, -0.65))
    poles = [geo.addPoint(*place, -3, size) for place in places]
    arcs = [geo.addCircleArc(poles[k - 1], middle, poles[k]) for k in range(4)]
    circle = geo.addCurveLoop(arcs)
    loops = [rhombus, circle], [circle, fibre], [fibre]
    surfaces = [(2, geo.addPlaneSurface(loop)) for loop in loops]
    geo.synchronize()
    # The lines begin with the one from the last corner to the first: left, bottom, right, top.
    left, bottom, right, top = sides
    for master, side, vector in ((left, right, FIRST), (bottom, top, SECOND)):
        shift = np.eye(4)
        shift[:2, 3] = vector
        gmsh.model.mesh.setPeriodic(1, [side], [master], shift.ravel().tolist())
    made = geo.extrude(surfaces, 0, 0, 6, numElements=[1], recombine=True)
    geo.synchronize()
    volumes = [tag for dimension, tag in made if dimension == 3]
    for volume, name in zip(volumes, ("matrix", "coating", "fibre"), strict=True):
        gmsh.model.addPhysicalGroup(3, [volume], name=name)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    gmsh.model.mesh.generate(3)
    gmsh.write(str(path))
    gmsh.finalize()


phases = {"matrix": Phase(3e9, 0.35), "coating": Phase(12e9, 0.3), "fibre": Phase(70e9, 0.2)}

# %% [markdown]
# ## Both bounds
# The bounds of each mesh hold for the geometry of that mesh. Here it is the same geometry to 1e-5,
# as arcs are parabolas; at the corners of the fibre fields are singular, so that the bounds close
# in more slowly than the fourth power of the mesh size that smooth outlines have. With
# `refine=True` each prism is split into eight.

# %%
found = []
for size, refine in ((0.4, False), (0.2, False), (0.2, True)):
    write_mesh(folder / "cell.msh", size)
    model = MeshModel(folder / "cell.msh", refine=refine)
    bounds = model.bounds(law, phases)
    found.append(bounds)
    low, high = np.array(bounds.young("isotropic")) / 1e9
    edge = size / 2 if refine else size
    print(f"edges of {edge}: E {low:.4f} … {high:.4f} GPa, width {bounds.width:.1e}")
assert found[0].width > 2 * found[1].width > 4 * found[2].width
assert (np.linalg.eigvalsh(found[0].upper - found[2].lower) > 0).all()

# %% [markdown]
# ## The upper bound, by DOLFINx alone
# `ProductSpace` gives the space on the mesh of the file. The energy of its solution is the upper
# bound but for the quadrature on curved prisms, of which the bound takes care.

# %%
model = MeshModel(folder / "cell.msh")
space = ProductSpace(model, law)
u, v = ufl.TrialFunction(space.space), ufl.TestFunction(space.space)
stiffness = {name: fem.Constant(space.space.mesh, x.stiffness) for name, x in phases.items()}


def work(first, second):
    """Weighted work of the stress of a strain on another."""
    return sum(
        space.density * ufl.dot(c * first, second) * space.dx[name] for name, c in stiffness.items()
    )


uniform = fem.Constant(space.space.mesh, np.array([1.0, 1.0, 0.0]))
matrix = space.assemble_matrix(work(space.strain(u), space.strain(v)))
solved = space.solve(matrix, [space.assemble_vector(-work(uniform, space.strain(v)))])
fluctuation = fem.Function(space.space)
space.assign(fluctuation, solved.vectors[0])
total = uniform + space.strain(fluctuation)
energy = space.mean(work(total, total))
low, high = [side[:2, :2].sum() for side in (found[1].lower, found[1].upper)]
print(f"2 (C11 + C12): {low / 1e9:.5f} … {high / 1e9:.5f} GPa, of DOLFINx {energy / 1e9:.5f}")
assert abs(energy / high - 1) < 1e-6

# %% [markdown]
# ## A picture
# Stresses at the nodes, seen along θ, under equal strains of .01 along both axes.

# %%
fields = model.fields(law, phases)


def picture(path: Path) -> None:
    """Draw the stress 11 in nine cells, by PyVista."""
    import pyvista

    cells = fields.in_tetrahedra()
    grid = pyvista.UnstructuredGrid({pyvista.CellType.QUADRATIC_TETRA: cells.cells}, cells.points)
    name = "stress 11 in MPa"
    grid.point_data[name] = cells.stress[:, 0, 0] / 1e6
    plotter = pyvista.Plotter(off_screen=True, window_size=(1100, 800))
    bar = {"title": name, "n_labels": 2, "fmt": "%.0f"}
    for a in (-1, 0, 1):
        for b in (-1, 0, 1):
            moved = grid.translate([*(a * FIRST + b * SECOND), 0])
            plotter.add_mesh(
                moved, scalars=name, cmap="viridis", lighting=False, scalar_bar_args=bar
            )
    plotter.view_xy()
    plotter.camera.zoom(1.25)
    plotter.screenshot(path)


if "DISPLAY" in os.environ:  # VTK wants one; ``xvfb-run`` lends it
    picture(Path(os.environ.get("PICTURES", ".")) / "mesh_bounds.png")
