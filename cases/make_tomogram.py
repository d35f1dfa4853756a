"""Make tomogram.npy, the volume of the case tomogram.toml: spheres in grey values, denoised.

Grey values are the share of a voxel's blurred neighbourhood that spheres cover, with noise from a
seed that non-local means take away again: python cases/make_tomogram.py. With --picture the volume
is drawn, spheres alone in its nearest corner: docs/pictures/tomogram.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

SIZE, SPHERES, SEED = 48, 12, 7
SMALLEST, LARGEST = 0.13, 0.2  # radii over the side, uniform between them
GREY = (70, 190)  # of matrix and spheres
BLUR, NOISE = 1.0, 12.0  # voxels, grey levels
VOXEL, OPEN = 5e-3, (126, 134)  # side in mm and support of the threshold, as in the case


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
    """Draw the grey values of the voxels, of the nearest eighth those of spheres alone.

    Voxels whose phase the threshold of the case leaves open are orange.
    """
    import pyvista

    grid = pyvista.ImageData(dimensions=[n + 1 for n in grey.shape[::-1]], spacing=(VOXEL,) * 3)
    grid.cell_data["grey value"] = grey.ravel()  # x varies fastest
    z, y, x = np.indices(grey.shape)
    is_nearest = (x >= SIZE // 2) & (y < SIZE // 2) & (z >= SIZE // 2)
    is_open = (grey >= OPEN[0]) & (grey < OPEN[1])
    is_shown = (~is_nearest | (grey >= OPEN[1])) & ~is_open
    plotter = pyvista.Plotter(off_screen=True, window_size=(1100, 900))
    plotter.set_background("white")
    place = {"vertical": True, "position_x": 0.88, "position_y": 0.3, "height": 0.45}
    bar = {**place, "color": "black", "fmt": "%.0f"}
    shown, opened = (grid.extract_cells(np.flatnonzero(x)) for x in (is_shown, is_open))
    plotter.add_mesh(shown, scalars="grey value", cmap="gray", clim=(40, 210), scalar_bar_args=bar)
    plotter.add_mesh(opened, color="tab:orange")
    words = f"orange: open, grey values {OPEN[0]} to {OPEN[1]}, {is_open.mean():.2%} of the voxels"
    plotter.add_text(words, position=(60, 830), font_size=12, color="black")
    plotter.show_bounds(
        **{f"{axis}title": f"{axis} (mm)" for axis in "xyz"},
        **{f"n_{axis}labels": 4 for axis in "xyz"},
        use_3d_text=False,
        fmt="%.2f",
        font_size=16,
        color="black",
        location="outer",
    )
    side = SIZE * VOXEL
    middle = (side / 2, side / 2, side / 2)
    plotter.camera_position = [(2.7 * side, -1.9 * side, 2.1 * side), middle, (0, 0, 1)]
    plotter.screenshot(file)


if __name__ == "__main__":
    target = Path(__file__).with_name("tomogram.npy")
    if "--picture" in sys.argv:
        picture(np.load(target), target.parents[1] / "docs/pictures/tomogram.png")
    else:
        np.save(target, volume(np.random.default_rng(SEED)))
