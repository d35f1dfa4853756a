# ---
# jupytext:
#   text_representation: {extension: .py, format_name: percent}
# kernelspec: {display_name: Python 3, language: python, name: python3}
# ---

# %% [markdown]
# # Sandstone: what the choice of a segmentation is worth
#
# **Goal.** Bounds of the moduli of a scanned rock that hold whichever of three segmentations of
# its grey values one believes, and an answer to a question: is the doubt in the segmentation or in
# the computation? Andrä et al. (2013, *Computers & Geosciences* 50, 33–43, abstract) computed three
# segmented images of Berea sandstone among others, by several programs, and their results vary.
#
# ## The scan
#
# The volume is made: noise is smoothed, and its lowest values are pores, an idea of the generator
# `blobs` of PoreSpy. The scanner sees it blurred, in voxels of twice its resolution and with noise:
# about 60 in pores and 180 in quartz.

# %%
import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy import ndimage

from alphacut.rve import Phase, reference_bounds, solve_image

SIDE = 20  # voxels
POROSITY = 0.18  # before the scan
rng = np.random.default_rng(5)
noise = ndimage.gaussian_filter(rng.standard_normal((2 * SIDE,) * 3), 4, mode="wrap")
pores = (noise < np.quantile(noise, POROSITY)).astype(float)
blurred = ndimage.gaussian_filter(pores, 1.6, mode="wrap")
seen = ndimage.uniform_filter(blurred, 2, mode="wrap")[::2, ::2, ::2]
grey = 180 - 120 * seen + rng.normal(0, 15, seen.shape)

# %% [markdown]
# ## Three segmentations
#
# A threshold in the middle of both grey values; one that counts voxels as pores which quartz fills
# by five eighths, as an operator may choose who expects more pores; and the middle again after
# smoothing, which takes noise and small pores away.

# %%
smoothed = ndimage.gaussian_filter(grey, 1, mode="wrap")
quartz = {
    "threshold 120": grey >= 120,
    "threshold 135": grey >= 135,
    "120, smoothed": smoothed >= 120,
}

# %% [markdown]
# ## Bounds of each
#
# Quartz has K = 37 and G = 44 GPa. The pores are full of bitumen, which is taken as a soft solid of
# K = 2.5 and G = 1 GPa, or empty. `solve_image` takes K and G of each voxel. Its bounds of K and G
# are those of Hill's average over all directions, and the P-wave modulus along z is the entry 33
# of the stiffness.

# %%
SOLID = (37e9, 44e9)  # K and G in Pa
FILLINGS = {"bitumen": (2.5e9, 1e9), "empty": (0.0, 0.0)}


def bounds_of(is_quartz: np.ndarray, filling: tuple[float, float]) -> dict[str, np.ndarray]:
    """Lower and upper bound in GPa of K, G and the P-wave modulus along z."""
    bulk, shear = (np.where(is_quartz, *moduli) for moduli in zip(SOLID, filling, strict=True))
    found = solve_image(bulk, shear).bounds
    p_wave = found.lower[2, 2], found.upper[2, 2]
    return {
        name: np.array(ends) / 1e9
        for name, ends in {"K": found.bulk, "G": found.shear(), "M_z": p_wave}.items()
    }


results = {
    filling: {name: bounds_of(mask, moduli) for name, mask in quartz.items()}
    for filling, moduli in FILLINGS.items()
}
for filling, of_segmentation in results.items():
    for name, moduli in of_segmentation.items():
        ranges = ", ".join(f"{key} {low:.1f} … {high:.1f}" for key, (low, high) in moduli.items())
        print(f"{filling}, {name}: porosity {1 - quartz[name].mean():.3f}, {ranges} GPa")

# %% [markdown]
# Empty pores reach through the volume. Stresses in equilibrium that load no pore bound the moduli
# from below there as well. A published modulus by finite elements of displacements is a bound from
# above.
#
# ## The union, and the classical bounds
#
# The union of the intervals holds whichever segmentation is right. Beside it stand the bounds of
# Hashin and Shtrikman for the porosities alone: they hold of any isotropic geometry, so that the
# difference is what the geometry of the scan is worth.


# %%
def classical(is_quartz: np.ndarray) -> dict[str, np.ndarray]:
    """Hashin–Shtrikman bounds in GPa of K, G and the P-wave modulus, filled with bitumen."""
    fractions = [1 - is_quartz.mean(), is_quartz.mean()]
    phases = [Phase.of_bulk_and_shear(*moduli) for moduli in (FILLINGS["bitumen"], SOLID)]
    found = reference_bounds(phases, fractions=fractions, space=True)
    bulk, shear = np.array(found.bulk), np.array(found.shear)
    return {"K": bulk / 1e9, "G": shear / 1e9, "M_z": (bulk + 4 / 3 * shear) / 1e9}


filled = results["bitumen"]
hashin_shtrikman = {name: classical(mask) for name, mask in quartz.items()}
for key in ("K", "G", "M_z"):
    ends = np.array([moduli[key] for moduli in filled.values()])
    low, high = ends[:, 0].min(), ends[:, 1].max()
    middles = ends.mean(axis=1)
    gap, choice = np.ptp(ends, axis=1).max(), np.ptp(middles)
    wide = np.array([moduli[key] for moduli in hashin_shtrikman.values()])
    print(f"{key}: union {low:.1f} … {high:.1f} GPa,", end=" ")
    print(f"Hashin–Shtrikman {wide[:, 0].min():.1f} … {wide[:, 1].max():.1f} GPa,")
    print(f"    widest proved gap {gap:.1f} GPa, choice of segmentation {choice:.1f} GPa")
    assert choice > gap

# %% [markdown]
# The choice of the segmentation, the distance of the middles of the intervals, is worth more than
# the gap of any of them: a finer computation would not help, a better segmentation would.
#
# ## Picture

# %%
figure, (slice_axes, axes) = plt.subplots(
    ncols=2, figsize=(9.5, 4), layout="constrained", width_ratios=(1, 1.4)
)
shown = slice_axes.imshow(grey[SIDE // 2], "gray", origin="lower")
for colour, (name, mask) in zip(("tab:blue", "tab:red", "tab:green"), quartz.items(), strict=True):
    slice_axes.contour(mask[SIDE // 2], [0.5], colors=colour, linewidths=1.5)
    row = list(quartz).index(name)
    for place, key in enumerate(("K", "G", "M_z")):
        x = place + 0.2 * (row - 1)
        label = name if place == 0 else None
        axes.vlines(x, *hashin_shtrikman[name][key], color=colour, lw=1)
        axes.vlines(x, *filled[name][key], color=colour, lw=8, label=label)
slice_axes.set(title="grey values and the edges of pores", xlabel="x (voxels)", ylabel="y (voxels)")
figure.colorbar(shown, ax=slice_axes, label="grey value", shrink=0.8)
axes.set_xticks(range(3), ["$K$", "$G$", "$M_z$"])
axes.set(title="thick: proved; thin: Hashin–Shtrikman", ylabel="modulus (GPa)", ylim=(0, None))
axes.legend(frameon=False, loc="upper left")
if "PICTURES" in os.environ:
    figure.savefig(Path(os.environ["PICTURES"]) / "rock.png", dpi=130)
plt.show()

# %% [markdown]
# ## How far to trust it
#
# - Each interval is guaranteed for its voxels, repeated periodically; the union for these three
#   segmentations, not for all that could be made. Since stiffer voxels make a stiffer rock, every
#   threshold between 120 and 135 gives moduli from the lower bound at 135 to the upper one at 120.
# - Nothing is said of what the scanner did not see: cracks, and contacts of grains thinner than a
#   voxel, make a rock softer than any such model.
# - A fluid is a phase with a shear modulus of 0. The bounds from above count its K, those from
#   below take its pores as empty: they are 0 where these reach through the volume.
