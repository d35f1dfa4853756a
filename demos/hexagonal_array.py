# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # A hexagonal array, beside the FEniCS tour
#
# The best-known tour of periodic homogenisation with FEniCS (J. Bleyer, *Numerical tours of
# computational mechanics*, "Periodic homogenization of linear elastic materials") has discs of
# radius 0.2 at the points of a hexagonal lattice of spacing 1. Its cell is a skewed parallelogram,
# its stiffness isotropic but for the mesh. Here the same array is solved by a series that has no
# mesh, on two other cells by finite elements (dolfinx), and then with discs of random radius.

# %%
import os
import tempfile
from pathlib import Path

import gmsh
import matplotlib.pyplot as plt
import numpy as np

from alphacut.rve import MeshModel, Phase, PrismModel, SeriesModel
from alphacut.stochastic import FractionMap, HermiteMap, TruncatedNormal

matrix, disc = Phase(50e9, 0.2), Phase(210e9, 0.3)  # Em = 50e3, Er = 210e3 MPa in the tour
spacing, radius = 1.0, 0.2
reduced = radius / (spacing / 2)  # over half the distance of the nearest discs
same = HermiteMap(reduced, 0, reduced, 0)  # one radius, whatever θ

# %% [markdown]
# ## By the series
# Three loads that know nothing of one another give three moduli. A lattice with a symmetry of 60°
# makes them those of an isotropic plane: $C_{11} - C_{12} = 2\,C_{33}$. The tour checks the same
# of its mesh; here it holds to rounding, and is a check of every hexagonal result.

# %%
[exact] = SeriesModel(lattice="hexagonal").solve(same, matrix, [disc])
C = exact.stiffness / 1e6
print(np.round(C, 3), "MPa")
print(f"C11 {C[0, 0]:.6f}, λ + 2 μ {C[0, 1] + 2 * C[2, 2]:.6f} MPa")
assert abs(C[0, 0] - C[0, 1] - 2 * C[2, 2]) <= 1e-12 * C[0, 0]

# %% [markdown]
# The tour's Young's modulus and Poisson's ratio, $E = \mu\,(3λ + 2μ)/(λ + μ)$ and
# $ν = λ/2(λ + μ)$, are those of the result.

# %%
lame, shear = C[0, 1], C[2, 2]
young = shear * (3 * lame + 2 * shear) / (lame + shear)
print(f"E = {young:.3f} MPa, ν = {lame / (lame + shear) / 2:.6f}; {exact}")
assert abs(exact.modulus / 1e6 / young - 1) < 1e-12

# %% [markdown]
# ## On the tour's parallelogram, as a mesh of one's own
# Any parallelogram of the lattice's vectors will do, in any unit. Gmsh meshes it around one disc,
# sides alike, and extrudes one layer of prisms along θ.


# %%
def write_parallelogram(file: Path, first: np.ndarray, second: np.ndarray, size: float) -> None:
    """Write a cell with these sides around a disc in its middle."""
    gmsh.initialize(["", "-v", "0"], readConfigFiles=False, interruptible=False)
    geo = gmsh.model.geo
    middle = (first + second) / 2
    places = (0 * first, first, first + second, second)
    corners = [geo.addPoint(x, y, -3, size) for x, y in places]
    sides = [geo.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    centre = geo.addPoint(*middle, -3, size)
    turns = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
    poles = [geo.addPoint(*(middle + radius * turn), -3, size) for turn in turns]
    arcs = [geo.addCircleArc(poles[k], centre, poles[(k + 1) % 4]) for k in range(4)]
    geo.synchronize()
    for side, partner, vector in ((3, 1, first), (0, 2, second)):
        shift = np.eye(4)
        shift[:2, 3] = vector
        gmsh.model.mesh.setPeriodic(1, [sides[partner]], [sides[side]], shift.ravel().tolist())
    inner = geo.addCurveLoop(arcs)
    bases = [geo.addPlaneSurface([geo.addCurveLoop(sides), inner]), geo.addPlaneSurface([inner])]
    made = geo.extrude([(2, base) for base in bases], 0, 0, 6, numElements=[1], recombine=True)
    geo.synchronize()
    volumes = [tag for dimension, tag in made if dimension == 3]
    for volume, name in zip(volumes, ("matrix", "disc"), strict=True):
        gmsh.model.addPhysicalGroup(3, [volume], name=name)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    gmsh.model.mesh.generate(3)
    gmsh.write(str(file))
    gmsh.finalize()


sides = spacing * np.array([(1, 0), (0.5, np.sqrt(3) / 2)])
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder, "parallelogram.msh")
    write_parallelogram(file, *sides, size=0.05)
    own = MeshModel(file, refine=True)
    [skewed] = own.solve(TruncatedNormal(), {"matrix": matrix, "disc": disc})
distance = abs(skewed.stiffness - exact.stiffness).max() / exact.stiffness.max()
print(f"mesh of one's own: {distance:.1e} of C11 apart, {skewed.largest_error:.1e} declared")
assert distance <= skewed.largest_error < 1e-3

# %% [markdown]
# ## On a regular hexagon
# Prisms fill the hexagon around the disc, where no side is nearer to it than another. Their
# declared error is the distance from the series.

# %%
prism = PrismModel(mesh_size=0.15, layers=1, stiffness=True, lattice="hexagonal")
[hexagon] = prism.solve(same, matrix, [disc])
distance = abs(hexagon.stiffness - exact.stiffness).max() / exact.stiffness.max()
print(f"hexagon: {distance:.1e} of C11 apart, isotropic but for {hexagon.checks['isotropy']:.1e}")
assert distance <= hexagon.largest_error < 1e-3

# %% [markdown]
# ## Discs of random radius
# The tour ends where this program begins: with θ as third axis the discs have any radius that
# depends on θ. Means of isotropic planes are isotropic.

# %%
random = HermiteMap(0.2, 0.1, 0.8, 0.1)
[mean] = SeriesModel(lattice="hexagonal").solve(random, matrix, [disc])
print(mean, f"isotropic but for {mean.checks['isotropy']:.0e}")
assert mean.checks["isotropy"] < 1e-12

# %% [markdown]
# ## Square, hexagonal or rectangular?
# A square array has two shear moduli, along its axes and its diagonals; that of the hexagonal array
# lies between them. Rectangles, `lattice=[1, 1.5]`, have another stiffness along each axis.

# %%
fractions = np.linspace(0.05, 0.75, 15)
curves: dict[str, list[float]] = {"square, along the axes": [], "square, along the diagonals": []}
curves["hexagonal"] = []
for fraction in fractions:
    [square] = SeriesModel(points=2).solve(FractionMap(fraction), matrix, [disc])
    hexagonal_radius = np.sqrt(fraction * np.sqrt(12) / np.pi)
    constant = HermiteMap(hexagonal_radius, 0, hexagonal_radius, 0)
    [found] = SeriesModel(points=2, lattice="hexagonal").solve(constant, matrix, [disc])
    _, deviator, along_axes = square.moduli / 1e9
    for name, modulus in zip(curves, (along_axes, deviator / 2, found.shear / 1e9), strict=True):
        curves[name].append(modulus)
low, high, between = (np.array(curve) for curve in curves.values())
assert ((low < between) & (between < high)).all()
[rectangle] = SeriesModel(lattice=[1, 1.5]).solve(same, matrix, [disc])
print(f"rectangle: C11 {rectangle.stiffness[0, 0] / 1e9:.4f}", end=", ")
print(f"C22 {rectangle.stiffness[1, 1] / 1e9:.4f} GPa")

# %%
figure, axes = plt.subplots(figsize=(6.4, 4.0))
for name, curve in curves.items():
    axes.plot(fractions, curve, label=name)
axes.set(xlabel="fraction of the discs", ylabel="shear modulus (GPa)")
axes.legend()
figure.tight_layout()
figure.savefig(Path(os.environ.get("PICTURES", "."), "hexagonal_array.png"))
