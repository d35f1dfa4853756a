"""Tilings bracket their cell; windows with the scatter of their tiles cover the material."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np
from scipy.stats import binom

from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.moduli import PlaneModuli
from alphacut.rve.image.solve import solve_image
from alphacut.rve.image.windows import CONFIDENCE, tiles_of
from benchmarks.rve.image.cases import moduli_of, noise, phases_of, solve_tiles

LEVEL = 0.5  # of the noise above which a pixel is particle: 31 % of the area


def tilings(number: int, seed: int) -> int:
    """How many random tilings bracket the proved interval of their cell."""
    good = 0
    for k in range(number):
        rng = np.random.default_rng([seed, k])
        image = noise(48, waves=rng.uniform(3, 10), seed=int(rng.integers(1 << 30)))
        phases = [PlaneModuli(*10 ** rng.uniform(0, 1.5, 2)) for _ in range(2)]
        bulk, shear = moduli_of(image > rng.uniform(-1, 1), phases)
        cell = solve_image(bulk, shear, solver=ConjugateGradient(1e-9)).bounds
        along = int(rng.choice([1, 2, 3, 4, 6]))
        found = solve_tiles(tiles_of(bulk, along), tiles_of(shear, along)).bracket
        gaps = (found.upper - cell.upper, cell.lower - found.lower)
        good += all(np.linalg.eigvalsh(gap)[0] >= 0 for gap in gaps)
    print(f"tilings that bracket their cell: {good} of {number}", flush=True)
    return good


def coverage(number: int, contrast: float, along: int, seed: int) -> float:
    """Probability of so few windows or fewer holding the material, were 95 % of all to hold it.

    Windows are cut from independent periodic cells four times as large; the material is the mean of
    large cells, known to its proved bounds and to the scatter of their mean.
    """
    size, phases = 64, phases_of(contrast)
    large = [
        solve_image(
            *moduli_of(noise(512, waves=48, seed=900_000 + seed + k) > LEVEL, phases)
        ).bounds
        for k in range(6)
    ]
    truth = np.array([bounds.modulus for bounds in large])
    low, high = truth.mean(axis=0)
    held, alone, share = 0, 0, []
    for k in range(number):
        whole = noise(256, waves=24, seed=1000 * seed + k) > LEVEL
        bulk, shear = moduli_of(whole[:size, :size], phases)
        found = solve_tiles(tiles_of(bulk, along), tiles_of(shear, along))
        interval = found.material_modulus()
        held += bool(interval[0] <= low and high <= interval[1])
        single = solve_tiles(bulk[None], shear[None]).bracket.modulus
        alone += bool(single[0] <= low and high <= single[1])
        share.append((interval[1] - interval[0]) / (low + high) * 2)
    chance = float(binom.cdf(held, number, CONFIDENCE))
    print(
        f"contrast {contrast:g}: material E in [{low:.3f}, {high:.3f}] GPa "
        f"(scatter of the large cells {truth.mean(axis=1).std(ddof=1):.3f}); "
        f"{along} × {along} tiles: {held} of {number} intervals hold it "
        f"(chance of as few at 95 %: {chance:.2f}), median width {np.median(share):.0%} of E; "
        f"single windows' own brackets: {alone} of {number}",
        flush=True,
    )
    return chance


def main(arguments: Sequence[str] | None = None) -> int:
    """Both counts; 1 if one fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--number", type=int, default=400)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    good = tilings(options.number, options.seed) == options.number
    chances = [coverage(options.number, c, 2, options.seed) for c in (4.0, 20.0)]
    return 0 if good and min(chances) > 0.05 else 1


if __name__ == "__main__":
    sys.exit(main())
