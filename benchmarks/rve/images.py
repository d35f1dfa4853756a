"""Accuracy over time of the proved bounds of an image, and whether they hold what is known exactly.

    ./enter python -m benchmarks.rve.images --sizes 64 128 256

Discs that do not touch, solved as pixels and as divided pixels; the round particle of a square cell
beside its exact series. A table goes to the screen, a chart to benchmarks/results/images.png.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.rve.cell.cell import Phase
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.model import ImageModel, ImageSolution, solve_image
from alphacut.rve.image.phases import ModuliInterval, PhaseModuli, moduli_images
from alphacut.rve.series.model import square_stiffness

RESULTS = Path(__file__).parents[1] / "results"
DIVISIONS = (1, 2, 4)


def discs(
    size: int, *, number: int = 24, radius: float = 0.055, gap: float = 0.01, seed: int = 0
) -> Mask:
    """Periodic image of discs drawn one after another, shape (size, size); lengths per side."""
    rng = np.random.default_rng(seed)
    centres: list[Array] = []
    while len(centres) < number:
        place = rng.random(2)
        if all(np.hypot(*between(place, c)) > 2 * radius + gap for c in centres):
            centres.append(place)
    places = (np.arange(size) + 0.5) / size
    mask = np.zeros((size, size), bool)
    for x, y in centres:
        mask |= between(places, x) ** 2 + between(places, y)[:, None] ** 2 < radius**2
    return mask


def between(first: Array, second: Array | float) -> Array:
    """The shortest way between places on a circle of length 1."""
    return np.asarray((first - second + 0.5) % 1 - 0.5)


def phases_of(contrast: float, *, modulus: float = 20.0, poisson: float = 0.3) -> list[PhaseModuli]:
    """Matrix and particle of one Poisson's ratio."""
    return [PhaseModuli.of_young(e, poisson) for e in (modulus, contrast * modulus)]


def moduli_of(mask: Mask, phases: list[PhaseModuli]) -> tuple[Array, Array]:
    """K + G/3 and G of each pixel; the mask tells the second phase."""
    matrix, particle = phases
    return (
        np.where(mask, particle.bulk, matrix.bulk),
        np.where(mask, particle.shear, matrix.shear),
    )


def round_particle(size: int, radius: float, phases: list[PhaseModuli]) -> ImageSolution:
    """Bounds of the cell with one disc, of pixels inside it and of pixels that it touches."""
    edge = np.abs(np.linspace(-1, 1, size + 1))
    near, far = np.minimum(edge[1:], edge[:-1]), np.maximum(edge[1:], edge[:-1])
    inner, outer = (np.hypot(x, x[:, None]) <= radius for x in (far, near))
    intervals = [ModuliInterval(phase, phase) for phase in phases]
    return ImageModel().solve(moduli_images(inner.astype(int), outer.astype(int), intervals))


def exact(radius: float, contrast: float) -> Array:
    """Stiffness of the cell with one disc by the series, shape (3, 3)."""
    phases = Phase(20e9), [Phase(20e9 * contrast)]
    return np.asarray(square_stiffness(np.array([radius]), *phases).matrix[0, 0] / 1e9)


def rows(sizes: Sequence[int], contrast: float) -> list[tuple[str, int, float, float]]:
    """Way, pixels along a side, width of the bounds of E over E, seconds."""
    found = []
    for size in sizes:
        moduli = moduli_of(discs(size), phases_of(contrast))
        for parts in DIVISIONS:
            began = perf_counter()
            low, high = solve_image(
                *moduli, division=parts, solver=ConjugateGradient(1e-6)
            ).bounds.young()
            found.append((f"{parts} parts", size, high / low - 1, perf_counter() - began))
        began = perf_counter()
        bounds = round_particle(size, 0.5, phases_of(contrast)).bounds
        low, high = bounds.young()
        assert bounds.contains(exact(0.5, contrast)), "the exact stiffness left its proved bounds"
        found.append(("round particle", size, high / low - 1, perf_counter() - began))
    return found


def chart(found: list[tuple[str, int, float, float]], path: Path) -> None:
    """Width over time, one line a way."""
    from matplotlib import pyplot

    drawn, axes = pyplot.subplots(figsize=(5.0, 3.5), layout="constrained")
    for way in dict.fromkeys(row[0] for row in found):
        points = np.array([row[2:] for row in found if row[0] == way])
        axes.loglog(points[:, 1], points[:, 0], "o-", label=way)
    axes.set(xlabel="seconds", ylabel="width of the proved bounds over E")
    axes.legend(frameon=False)
    drawn.savefig(path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table and draw the chart."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[32, 64, 128, 256])
    parser.add_argument("--contrast", type=float, default=4.0)
    options = parser.parse_args(arguments)
    found = rows(options.sizes, options.contrast)
    for way, size, width, seconds in found:
        print(f"{way:16s} {size:5d}² pixels: width {width:.2e}, {seconds:.2f} s")
    chart(found, RESULTS / "images.png")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
