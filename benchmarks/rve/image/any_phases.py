"""A million proved stiffnesses of one image, phases drawn within a factor 16, from a few solves."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.reduced.build import ReducedBounds, reduced_bounds, widths
from alphacut.rve.image.solve import solve_image
from benchmarks.rve.image.cases import Array, discs

FACTOR = 16.0
BATCH = 20_000


def draw(rng: np.random.Generator, number: int) -> tuple[Array, Array]:
    """K + G/3 and G of both phases, K and G within the factor, each of shape (number, 2)."""
    bulk, shear = np.exp(rng.uniform(0, np.log(FACTOR), (2, number, 2)))
    return bulk + shear / 3, shear


def evaluate(reduced: ReducedBounds, number: int, seed: int) -> float:
    """Seconds of so many pairs of bounds on two threads; every one is checked to be ordered."""

    def batch(k: int) -> bool:
        lower, upper = reduced.bounds(*draw(np.random.default_rng([seed, k]), BATCH))
        return bool((np.linalg.eigvalsh(upper - lower)[:, 0] > 0).all())

    began = time.perf_counter()
    with ThreadPoolExecutor(2) as pool:
        if not all(pool.map(batch, range(number // BATCH))):
            raise ArithmeticError("an upper bound lies below its lower one")
    return time.perf_counter() - began


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the bases, evaluate, compare with full solves."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--solves", type=int, default=10)
    parser.add_argument("--number", type=int, default=1_000_000)
    parser.add_argument("--full", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    labels = discs(options.size, seed=options.seed).astype(int)
    candidates = draw(np.random.default_rng([options.seed, 1]), 1000)
    reduced = reduced_bounds(labels, *candidates, solves=options.solves)
    print(f"{options.solves} solves a side at {options.size}²: {reduced.seconds:.1f} s")
    seconds = evaluate(reduced, options.number, options.seed + 100)
    print(
        f"{options.number} pairs of bounds: {seconds:.0f} s, "
        f"{1e6 * seconds / options.number:.0f} µs each"
    )
    bulk, shear = draw(np.random.default_rng([options.seed, 2]), options.full)
    found = widths(*reduced.bounds(bulk, shear))
    full = [
        solve_image(b[labels], s[labels], solver=ConjugateGradient(1e-8)).bounds.width
        for b, s in zip(bulk, shear, strict=True)
    ]
    ratios = found / full
    print(
        f"width over that of the full solve, {options.full} draws: "
        f"median {np.median(ratios):.3f}, most {ratios.max():.3f}"
    )
    return 0 if ratios.max() <= 1.2 else 1


if __name__ == "__main__":
    sys.exit(main())
