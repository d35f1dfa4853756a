"""Make tomogram.npy, the volume of the case tomogram.toml: spheres in grey values, denoised.

Grey values are the share of a voxel's blurred neighbourhood that spheres cover, with noise from a
seed that non-local means take away again: python cases/make_tomogram.py. With --picture the volume
is drawn, its corner cut open: docs/pictures/tomogram.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

SIZE, SPHERES, SEED = 48, 12, 7
SMALLEST, LARGEST = 0.13, 0.2  # radii over the side, uniform between them
GREY = (70, 190)  # of matrix and spheres
BLUR, NOISE = 1.0, 12.0  # voxels, grey levels


def spheres(rng: np.random.Generator) -> list[tuple[np.ndarray, float]]:
    """Centres (z, y, x) and radii of spheres that do not touch, in a periodic cell of side 1."""
    found: list[tuple[np.ndarray, float]] = []
    radii = np.sort(rng.uniform(SMALLEST, LARGEST, SPHERES))[::-1]
    while len(found) < SPHERES:
        centre, radius = rng.random(3), radii[len(found)]
        distances = (np.linalg.norm((centre - c + 0.5) % 1 - 0.5) - r for c, r in found)
        if all(distance > radius + 0.01 for distance in distances):
            found.append((centre, radius))
    return found


def volume(rng: np.random.Generator) -> np.ndarray:
    """Grey values along (z, y, x), 8 bits."""
    from skimage.restoration import denoise_nl_means

    places = np.stack(np.meshgrid(*[(np.arange(SIZE) + 0.5) / SIZE] * 3, indexing="ij"), axis=-1)
    cover = np.zeros((SIZE,) * 3)
    for centre, radius in spheres(rng):
        distance = radius - np.linalg.norm((places - centre + 0.5) % 1 - 0.5, axis=-1)
        cover = np.maximum(cover, np.clip(0.5 + distance * SIZE / (2 * BLUR), 0, 1))
    grey = GREY[0] + (GREY[1] - GREY[0]) * cover + NOISE * rng.normal(size=cover.shape)
    quiet = denoise_nl_means(grey, patch_size=3, patch_distance=4, h=0.8 * NOISE, sigma=NOISE)
    return np.clip(np.rint(quiet), 0, 255).astype(np.uint8)


def picture(grey: np.ndarray, file: Path) -> None:
    """Draw the grey values on the faces, the nearest eighth taken out, and the spheres there."""
    import pyvista

    grid = pyvista.ImageData(dimensions=[n + 1 for n in grey.shape[::-1]])
    grid.cell_data["grey"] = grey.ravel()  # x varies fastest
    plotter = pyvista.Plotter(off_screen=True, window_size=(900, 760))
    half = SIZE / 2
    opened = grid.clip_box((half, SIZE, 0, half, half, SIZE))
    plotter.add_mesh(opened, scalars="grey", cmap="gray", clim=(40, 210), show_scalar_bar=False)
    smooth = grid.cell_data_to_point_data().contour([sum(GREY) / 2])
    inside = smooth.clip_box((half, SIZE, 0, half, half, SIZE), invert=False)
    plotter.add_mesh(inside, color="tab:orange", smooth_shading=True)
    plotter.camera_position = [(3.1 * SIZE, -2.1 * SIZE, 2.3 * SIZE), (half, half, half), (0, 0, 1)]
    plotter.screenshot(file)


if __name__ == "__main__":
    target = Path(__file__).with_name("tomogram.npy")
    if "--picture" in sys.argv:
        picture(np.load(target), target.parents[1] / "docs/pictures/tomogram.png")
    else:
        np.save(target, volume(np.random.default_rng(SEED)))
