"""Guaranteed cuts of an image with a fuzzy threshold and fuzzy K, G of both phases.

Measured: time against one crisp image, distance of the ends from full solves, random samples.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence

import numpy as np

from alphacut.rve.image.cuts import ImageBox, each_cut
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.moduli import ModuliInterval, PlaneModuli
from alphacut.rve.image.solve import solve_image
from benchmarks.rve.image.cases import Array, moduli_of, noise

LEVELS = (1.0, 0.75, 0.5, 0.25, 0.0)
PHASES = ((16.7, 7.7), (66.7, 30.8))  # K and G of matrix and particle, E = 20 and 80, ν = 0.3
SPREAD = 0.1  # of each modulus either way at α = 0
THRESHOLD, GREY_SPREAD = 0.5, 0.05
MOST_TIMES, MOST_GAP = 6.0, 1e-3  # time over that of a crisp image, distance from full solves


def box(alpha: float) -> ImageBox:
    """The cut of the input at a level."""
    slack = 1 - alpha
    moduli = [
        [PlaneModuli.of_bulk(k * (1 + s), g * (1 + s)) for s in (-SPREAD * slack, SPREAD * slack)]
        for k, g in PHASES
    ]
    ends = (THRESHOLD - GREY_SPREAD * slack, THRESHOLD + GREY_SPREAD * slack)
    return ImageBox([ends], [ModuliInterval(low, high) for low, high in moduli])


def time_of_cuts(size: int, seed: int) -> bool:
    """Five levels against one crisp image and against full solves; True if they meet the claims."""
    grey = noise(size, seed=seed)
    matrix, particle = (PlaneModuli.of_bulk(*pair) for pair in PHASES)
    began = time.perf_counter()
    solve_image(*moduli_of(grey >= THRESHOLD, [matrix, particle]))
    crisp = time.perf_counter() - began
    began = time.perf_counter()
    cuts = [*each_cut(grey, [box(alpha) for alpha in LEVELS])]
    seconds = time.perf_counter() - began
    print(
        f"{size}²: one crisp image {crisp:.1f} s, five levels {seconds:.1f} s, "
        f"{seconds / crisp:.1f} times"
    )
    exact = [*each_cut(grey, [box(alpha) for alpha in LEVELS], solver=ConjugateGradient(1e-9))]
    gaps = [
        abs(a / b - 1)
        for near, full in zip(cuts, exact, strict=True)
        for a, b in zip(near.bounds.modulus, full.bounds.modulus, strict=True)
    ]
    print(f"largest difference of an end of E from its full solve: {max(gaps):.1e}")
    for alpha, cut in zip(LEVELS, cuts, strict=True):
        low, high = cut.bounds.modulus
        print(f"  α = {alpha:4.2f}: E in [{low:.4f}, {high:.4f}] GPa, {cut.nature}", flush=True)
    return seconds <= MOST_TIMES * crisp and max(gaps) <= MOST_GAP


def samples_outside(size: int, number: int, seed: int) -> int:
    """How many random samples of the box at α = 0 may lie outside its cut."""
    grey, cut = noise(size, seed=seed), box(0.0)
    bounds = next(each_cut(grey, [cut])).bounds
    outside = 0
    for k in range(number):
        found = solve_image(*_sample(cut, grey, np.random.default_rng([seed, k]))).bounds
        low, high = found.modulus
        outside += not (
            bounds.modulus[0] <= low
            and high <= bounds.modulus[1]
            and bounds.contains(found.lower)
            and bounds.contains(found.upper)
        )
    print(f"{number} random samples at {size}²: {outside} with a bound outside the cut at α = 0")
    return outside


def _sample(cut: ImageBox, grey: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """An image from inside a cut; a fifth of the values lie at an end."""
    corner = rng.random() < 0.2

    def value(low: float, high: float) -> float:
        return float(rng.choice([low, high]) if corner else rng.uniform(low, high))

    phases = []
    for (k, g), _ in zip(PHASES, cut.phases, strict=True):
        shear = value(g * (1 - SPREAD), g * (1 + SPREAD))
        phases.append(PlaneModuli.of_bulk(value(k * (1 - SPREAD), k * (1 + SPREAD)), shear))
    return moduli_of(grey >= value(*cut.thresholds[0]), phases)


def main(arguments: Sequence[str] | None = None) -> int:
    """Time and samples; 1 if a sample lies outside, or time or distance are more than claimed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--samples", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    near = time_of_cuts(options.size, options.seed)
    return 0 if samples_outside(64, options.samples, options.seed) == 0 and near else 1


if __name__ == "__main__":
    sys.exit(main())
