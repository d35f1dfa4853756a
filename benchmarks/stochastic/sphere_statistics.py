"""Spheres judged by what is known: time, stereology, and how often the p-box of a section holds.

    ./enter python -m benchmarks.stochastic.sphere_statistics --seed 1

Packs and tessellates spheres of log-normal radii over a factor of ten; compares the area fraction
of random plane sections with the volume fraction (Delesse), in standard errors over packings; and
unfolds sections of synthetic specimens whose law is drawn at random, counting those in which the
p-box holds the true law. The circles of a specimen are drawn by Wicksell's argument and not from a
packing. Writes sphere_statistics.csv to benchmarks/results/; ends with 1 where a number misses:
more than a minute, three standard errors, or fewer than 95 % of the specimens.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

import numpy as np

from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.spheres.packing import SpherePacking
from alphacut.stochastic.spheres.power_cells import cell_volumes
from alphacut.stochastic.spheres.wicksell import WEIGHTS, radii_pbox
from alphacut.stochastic.theta.truncated_normal import Array

RESULTS = Path(__file__).parents[1] / "results"
LAW, FRACTION = LogNormalRadii(1e-3, 1e-2), 0.2092
VISIBLE, SMALLEST, LARGEST = 5e-4, 1e-3, 1.2e-2
CIRCLES, BINS = 300, 16
SECONDS, ERRORS, COVERAGE = 60.0, 3.0, 0.95


def pack(spheres: int, seed: int) -> tuple[float, float]:
    """Seconds of packing and tessellating, and by how much the cells' volumes miss the cube."""
    start = perf_counter()
    packing = SpherePacking(spheres, FRACTION, LAW).make(np.random.default_rng([seed, 1]))
    volumes = cell_volumes(packing)
    return perf_counter() - start, abs(float(volumes.sum()) / packing.side**3 - 1)


def sections(number: int, seed: int) -> tuple[float, float]:
    """Mean area fraction of one random plane in each packing of 300 spheres, and its error."""
    shares = []
    for count in range(number):
        generator = np.random.default_rng([seed, 2, count])
        packing = SpherePacking(300, FRACTION, LAW).make(generator)
        circles = packing.section(count % 3, generator.uniform(0, packing.side))
        shares.append(np.pi * (circles**2).sum() / packing.side**2)
    return float(np.mean(shares)), float(np.std(shares, ddof=1) / np.sqrt(number))


def circles_of(
    law: LogNormalRadii, number: int, generator: np.random.Generator, visible: float
) -> Array:
    """Circles of a random plane, in m: spheres are hit in proportion to R, heights even in R."""
    drawn = np.empty(0)
    while drawn.size < number:
        radii = law.sample(8 * number, generator)
        radii = radii[generator.uniform(0, law.largest, radii.size) < radii]
        circles = radii * np.sqrt(1 - generator.uniform(0, 1, radii.size) ** 2)
        drawn = np.concatenate([drawn, circles[circles > visible]])
    return drawn[:number]


def truth(law: LogNormalRadii, weight: str, smallest: float) -> tuple[Array, Array]:
    """Radii and the distribution function above `smallest`."""
    radii = np.linspace(smallest, law.largest, 4001)
    mass = np.diff(law.cdf(radii)) * ((radii[1:] + radii[:-1]) / 2) ** (WEIGHTS[weight] + 1)
    return radii, np.concatenate([[0.0], np.cumsum(mass) / mass.sum()])


def covered(
    count: int, seed: int, *, bins: int = BINS, weights: Sequence[str] = tuple(WEIGHTS)
) -> tuple[dict[str, float], float]:
    """Shares of specimens whose p-box holds the truth, by weight, and its mean width."""
    generator = np.random.default_rng(seed)
    inside, width = dict.fromkeys(weights, 0), 0.0
    for _ in range(count):
        low = 10 ** generator.uniform(-3.3, -2.6)
        high = min(max(low * generator.uniform(1.5, 12), 1.2 * SMALLEST), 1.1e-2)
        law = LogNormalRadii(low, high)
        circles = circles_of(law, CIRCLES, generator, VISIBLE)
        for weight in weights:
            found = radii_pbox(
                circles,
                visible=VISIBLE,
                smallest=SMALLEST,
                largest=LARGEST,
                weight=weight,
                bins=bins,
            )
            inside[weight] += found.holds(*truth(law, weight, SMALLEST))
            width += float((found.upper - found.lower).mean()) / (len(weights) * count)
    return {weight: number / count for weight, number in inside.items()}, width


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute, write, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1, help="of everything drawn (1)")
    parser.add_argument("--spheres", type=int, default=10_000, help="packed at once (10000)")
    parser.add_argument("--sections", type=int, default=200, help="packings cut once each (200)")
    parser.add_argument("--specimens", type=int, default=200, help="of 300 circles (200)")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    options = parser.parse_args(arguments)
    seconds, off = pack(options.spheres, options.seed)
    print(
        f"{options.spheres} spheres packed and tessellated in {seconds:.1f} s; the cells' volumes"
        f" add up to the cube's within {off:.1e}"
    )
    mean, error = sections(options.sections, options.seed)
    apart = (mean - FRACTION) / error
    print(
        f"area fraction of {options.sections} random sections {mean:.4f} ± {error:.4f}:"
        f" {apart:+.2f} standard errors from the volume fraction {FRACTION}"
    )
    shares, width = covered(options.specimens, options.seed)
    told = ", ".join(f"{share:.1%} by {weight}" for weight, share in shares.items())
    print(
        f"p-box of {CIRCLES} circles at 95 %: holds the true law of {options.specimens} specimens"
        f" in {told}; its mean width {width:.2f}"
    )
    row = {"seconds": seconds, "sum_error": off, "area_fraction": mean, "standard_error": error}
    _write(options.out, {**row, **shares, "width": width})
    good = seconds <= SECONDS and abs(apart) <= ERRORS and min(shares.values()) >= COVERAGE
    return 0 if good else 1


def _write(folder: Path, row: dict[str, float]) -> None:
    """The table sphere_statistics.csv."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "sphere_statistics.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(row)
        writer.writerow([f"{value:.6g}" for value in row.values()])


if __name__ == "__main__":
    sys.exit(main())
