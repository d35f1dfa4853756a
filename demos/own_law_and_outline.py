# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # A law and an outline of one's own
#
# The series is exact for circles of isotropic phases. Finite elements take any plane stiffness
# and any star-shaped particle, whose edge lies at the distance $\rho(\theta)\, s(\varphi)$ from
# its centre. Two discretisations that share neither mesh nor elements check each other: the
# product space, and slices at Gauss points of θ.

# %%
import os
from pathlib import Path

import numpy as np

from alphacut.rve import Ellipse, Phase, PrismModel, SlicesModel, VoigtPhase
from alphacut.stochastic import HermiteMap

radius, resin = HermiteMap(0.25, 0.1, 0.6, 0.1), Phase(4e9, 0.35)

# %% [markdown]
# ## A law: a carbon fibre, stiffer across one axis, turned by 30°
# A plane-strain stiffness in Voigt order (11, 22, 12 with 2 ε12), symmetric and positive
# definite. Turning it is a congruence with the matrix that turns strains.

# %%
along = np.array([[60e9, 8e9, 0], [8e9, 18e9, 0], [0, 0, 7e9]])


def turned(stiffness: np.ndarray, degrees: float) -> np.ndarray:
    """The stiffness of the material turned by an angle."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    strains = np.array(
        [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
    )
    return strains.T @ stiffness @ strains


fibre = VoigtPhase(turned(along, 30).tolist())

# %% [markdown]
# ## An outline: a star of three leaves
# Any smooth positive function of the angle of period 2π; `Ellipse(aspect)` is at hand.


# %%
def leaves(angle: np.ndarray) -> np.ndarray:
    """Distance from the centre over ρ."""
    return 1 + 0.2 * np.cos(3 * angle)


# %% [markdown]
# ## Both discretisations

# %%
prism = PrismModel(mesh_size=0.2, layers=6, stiffness=True, outline=leaves)
product = prism.solve(radius, resin, [fibre])[0]
slices = SlicesModel(mesh_size=0.3, points=6, outline=leaves).solve(radius, resin, [fibre])[0]
for result in (product, slices):
    print(
        result.method, np.round(result.stiffness / 1e9, 5).tolist(), f"± {result.largest_error:.1e}"
    )
apart = abs(product.stiffness - slices.stiffness).max() / slices.stiffness.max()
print(f"apart by {apart:.1e}")
assert apart <= product.largest_error + slices.largest_error
assert product.checks["reuss"] == product.checks["voigt"] == 0  # the bounds take any phase

# %% [markdown]
# ## A check by symmetry
# An ellipse turned by a right angle exchanges C11 and C22; for both the ellipse's area is that of
# the circle, so that the aspect alone differs.

# %%
carbon = Phase(60e9, 0.2)
lying, standing = (
    SlicesModel(mesh_size=0.3, points=4, outline=Ellipse(aspect))
    .solve(radius, resin, [carbon])[0]
    .stiffness
    for aspect in (2.0, 0.5)
)
print(f"lying C11 {lying[0, 0] / 1e9:.6f}, standing C22 {standing[1, 1] / 1e9:.6f} GPa")
assert abs(lying[0, 0] / standing[1, 1] - 1) < 1e-6
assert lying[0, 0] > 1.05 * lying[1, 1]

# %% [markdown]
# ## Pictures

# %%
drawn = prism.fields(radius, resin, [fibre])


def picture(folder: Path) -> None:
    """Draw the particle and the shear stress, by PyVista."""
    import pyvista

    fields = drawn.in_tetrahedra()
    grid = pyvista.UnstructuredGrid({pyvista.CellType.QUADRATIC_TETRA: fields.cells}, fields.points)
    assert (grid.compute_cell_sizes()["Volume"] > 0).all()
    grid.point_data["stress 12 in MPa"] = fields.stress[:, 2, 1] / 1e6
    plotter = pyvista.Plotter(off_screen=True, shape=(1, 2), window_size=(1300, 900))
    plotter.add_mesh(grid.extract_cells(fields.phase == 1), color="steelblue", show_edges=True)
    plotter.add_mesh(grid.outline(), color="black")
    plotter.add_text("three leaves, theta upwards", font_size=11)
    plotter.subplot(0, 1)
    lower = grid.extract_cells(grid.cell_centers().points[:, 2] < 0)
    plotter.add_mesh(lower, scalars="stress 12 in MPa", cmap="viridis", lighting=False)
    plotter.add_text("shear stress, cut at theta = 0", font_size=11)
    plotter.link_views()
    plotter.camera_position = [(6.0, -8.5, 9.0), (0, 0, -0.2), (0, 0, 1)]
    plotter.screenshot(folder / "own_law_and_outline.png")


if "DISPLAY" in os.environ:  # VTK wants one; ``xvfb-run`` lends it
    picture(Path(os.environ.get("PICTURES", ".")))
