"""Make composite.png, the image of the case composite.toml: fibres of a known law of radii.

Grey values are the share of a pixel's blurred neighbourhood that fibres cover, with noise from a
seed: python cases/make_composite.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

SIZE, FIBRES, SEED = 256, 40, 7
SMALLEST, LARGEST = 0.03, 0.07  # radii over the side, uniform between them
GREY = (70, 190)  # of matrix and fibre
BLUR, NOISE = 1.0, 4.0  # pixels, grey levels


def fibres(rng: np.random.Generator) -> list[tuple[float, float, float]]:
    """Centres and radii of discs that do not touch, in a periodic cell of side 1."""
    found: list[tuple[float, float, float]] = []
    radii = np.sort(rng.uniform(SMALLEST, LARGEST, FIBRES))[::-1]
    while len(found) < FIBRES:
        x, y, radius = *rng.random(2), radii[len(found)]
        apart = (
            np.hypot((x - a + 0.5) % 1 - 0.5, (y - b + 0.5) % 1 - 0.5) > radius + r + 0.01
            for a, b, r in found
        )
        if all(apart):
            found.append((x, y, radius))
    return found


def picture(rng: np.random.Generator) -> np.ndarray:
    """Grey values, shape (SIZE, SIZE), 8 bits."""
    places = (np.arange(SIZE) + 0.5) / SIZE
    cover = np.zeros((SIZE, SIZE))
    for x, y, radius in fibres(rng):
        across, up = ((places - c + 0.5) % 1 - 0.5 for c in (x, y))
        distance = radius - np.hypot(across, up[:, None])
        cover = np.maximum(cover, np.clip(0.5 + distance * SIZE / (2 * BLUR), 0, 1))
    grey = GREY[0] + (GREY[1] - GREY[0]) * cover + NOISE * rng.normal(size=cover.shape)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


if __name__ == "__main__":
    from PIL import Image

    Image.fromarray(picture(np.random.default_rng(SEED))).save(
        Path(__file__).with_name("composite.png"), optimize=True
    )
