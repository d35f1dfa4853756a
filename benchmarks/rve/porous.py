"""Bounds of random porous images and volumes, against values extrapolated from finer grids.

    ./enter python -m benchmarks.rve.porous --cells 30 --conduct
    ./enter python -m benchmarks.rve.porous --cells 30 --seed 1
    ./enter python -m benchmarks.rve.porous --mirrored    # beside a two-point value

The solid is where Gaussian noise is above a quantile, of one or two materials. Each pixel or voxel
is cut in 2 and in 4 along each axis: bounds of the finer grids are extrapolated with the order that
they show, from above and from below, and the exact tensor is declared to be half way between both,
within half their distance and a twentieth of what extrapolation moved. It must be inside the bounds
of the coarse grid, in the Loewner order, and bounds of all grids must overlap; where nothing
percolates it is 0. Printed are the trace of upper over lower bound, its gap on each grid in the
directions that percolate, and the thickness of the walls. Exit status 1 if a cell does not hold.
"""

from __future__ import annotations

import argparse
import sys
from itertools import pairwise
from time import process_time

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.sparse import coo_array
from scipy.sparse.linalg import cg

from alphacut.base.arrays import Array, Mask
from alphacut.rve import solve_conduction, solve_image
from alphacut.rve.image.bounds import LoewnerBounds
from alphacut.rve.image.fields.forest import Percolation
from alphacut.rve.image.model import ConductionModel

PARTS = 1, 2, 4
"""Parts along each axis in which pixels and voxels are cut."""


def noise(rng: np.random.Generator, shape: tuple[int, ...], length: float, porosity: float) -> Mask:
    """Return where periodic Gaussian noise of a correlation length in voxels is solid."""
    values = gaussian_filter(rng.standard_normal(shape), length, mode="wrap")
    return np.asarray(values > np.quantile(values, porosity))


def cut(image: Array, parts: int) -> Array:
    """Return an image whose pixels or voxels are cut into parts along each axis."""
    return np.asarray(np.kron(image, np.ones((parts,) * image.ndim)))


def extrapolated(coarse: Array, middle: Array, fine: Array) -> Array:
    """Return the limit of tensors on grids that halve, with the order that their traces show."""
    first, second = np.trace(coarse - middle), np.trace(middle - fine)
    # Beside re-entrant edges the order is between 1 and 2 (a factor of 2 to 4 each halving).
    ratio = np.clip(first / second if second else 4.0, 2.0, 4.0)
    return np.asarray(fine + (fine - middle) / (ratio - 1))


def gap(bounds: LoewnerBounds, percolates: Mask) -> float:
    """Return the trace of upper less lower over that of upper, of the components that percolate."""
    upper, lower = (np.diag(x)[percolates].sum() for x in (bounds.upper, bounds.lower))
    return float(1 - lower / upper) if upper else 0.0


def judge(of_grids: list[LoewnerBounds]) -> tuple[bool, float]:
    """Return whether bounds on three grids hold, and the error of the extrapolated tensor."""
    coarse, _, fine = of_grids
    limits = [extrapolated(*(getattr(x, end) for x in of_grids)) for end in ("lower", "upper")]
    value = (limits[0] + limits[1]) / 2
    moved = [np.abs(fine.lower - limits[0]), np.abs(fine.upper - limits[1])]
    error = float(np.abs(limits[1] - limits[0]).max() / 2 + np.max(moved) / 20)
    margin = error + 1e-7 * np.trace(coarse.upper)
    inside = min(
        np.linalg.eigvalsh(coarse.upper - value)[0], np.linalg.eigvalsh(value - coarse.lower)[0]
    )
    overlap = min(np.linalg.eigvalsh(x.upper - y.lower)[0] for x in of_grids for y in of_grids)
    holds = inside > -margin and overlap > -1e-7 * np.trace(coarse.upper)
    return bool(holds), error / float(np.trace(value))


def run(cells: int, seed: int, *, conducts: bool, size: int = 8) -> int:
    """Print a row for each of some random cells; return how many do not hold."""
    rng = np.random.default_rng(seed)
    print(f"seed {seed}; {'conductivity' if conducts else 'stiffness'}, {size} voxels a side")
    print("cell  porosity  solids  thickness  upper/lower  gaps by grid  error  holds")
    wrong, factors = 0, []
    for number in range(cells):
        dimension = 3 if rng.random() < 0.7 else 2
        shape = (size * (1 if dimension == 3 else 2),) * dimension
        porosity, length = rng.uniform(0.3, 0.6), rng.uniform(1.0, 1.6)
        solid = noise(rng, shape, length, porosity)
        second = noise(rng, shape, length, 0.5) & (rng.random() < 0.5)
        factor = 10.0 ** rng.uniform(0.3, 1.3)
        young = solid * np.where(second, factor, 1.0)
        poisson = rng.uniform(-0.5, 0.45)
        of_grids: list[LoewnerBounds] = []
        for parts in PARTS:
            if conducts:
                of_grids.append(solve_conduction(cut(young, parts)).bounds)
            else:
                shear = young / (2 * (1 + poisson))
                bulk = young / (3 * (1 - 2 * poisson)) + (shear / 3 if dimension == 2 else 0)
                of_grids.append(solve_image(cut(bulk, parts), cut(shear, parts)).bounds)
        walls = Percolation.of_mask(solid)
        if any(walls.axes):
            holds, error = judge(of_grids)
        else:  # the exact tensor is 0
            holds = all(np.linalg.eigvalsh(-x.lower)[0] >= 0 for x in of_grids)
            holds = holds and all(np.linalg.eigvalsh(x.upper)[0] >= 0 for x in of_grids)
            error = 0.0
        wrong += not holds
        diagonal = np.diag(of_grids[-1].lower)
        percolates = diagonal > 1e-6 * np.trace(of_grids[-1].upper)
        gaps = [gap(x, percolates) for x in of_grids]
        factors += [a / b for a, b in pairwise(gaps) if b > 0]
        ratio = 1 / (1 - gaps[0])
        shown = " ".join(f"{x:.3f}" for x in gaps)
        text = f"{number} {dimension}D  {porosity:.2f}  {1 + second.any()}  {walls.thickness:.2f}"
        print(f"{text}  {ratio:.3f}  {shown}  {error:.1e}  {holds}", flush=True)
    if factors:
        print(f"gaps fall by {min(factors):.2f} at least, {np.median(factors):.2f} in the median")
    print(f"{wrong} of {cells} do not hold")
    return wrong


def two_point(conductivity: Array) -> float:
    """Return the conductivity along x by finite volumes with harmonic means between voxels."""
    number = np.arange(conductivity.size).reshape(conductivity.shape)
    rows, columns, entries = [], [], []
    for axis in range(conductivity.ndim):
        other = np.roll(conductivity, -1, axis)
        both = conductivity * other
        total = np.where(both > 0, conductivity + other, 1.0)
        link = (2 * both / total).ravel()
        here, there = number.ravel(), np.roll(number, -1, axis).ravel()
        rows += [here, there, here, there]
        columns += [here, there, there, here]
        entries += [link, link, -link, -link]
    triples = np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))
    source = np.bincount(here, link) - np.bincount(there, link)  # of a unit gradient along x
    solution, status = cg(coo_array(triples).tocsr(), source, rtol=1e-10)
    assert status == 0
    return float(np.mean(link * (1 + solution[there] - solution[here])))


def mirrored(seed: int, size: int = 12) -> None:
    """Print bounds of porous volumes mirrored in all axes beside their two-point value along x.

    Programs that take fixed temperatures at two faces and none of the flux through the others, as
    TauFactor, compute the two-point value of the mirrored volume.
    """
    rng = np.random.default_rng(seed)
    print(f"seed {seed}\nporosity  two-point  lower    upper    time of lower over upper")
    for porosity in (0.3, 0.4, 0.5, 0.6):
        image: Array = noise(rng, (size,) * 3, 1.5, porosity).astype(float)
        for axis in range(3):
            image = np.concatenate([image, np.flip(image, axis)], axis)
        low, high = solve_conduction(image).bounds.components()[0]
        value = two_point(image)
        assert value <= low * (1 + 1e-9)
        spent = []
        for dual in (True, False):
            start = process_time()
            ConductionModel(sides=(1.0,) * 3).solve_side(image[np.newaxis], dual=dual, start=None)
            spent.append(process_time() - start)
        print(
            f"{porosity:.1f}       {value:.5f}    {low:.5f}  {high:.5f}  {spent[0] / spent[1]:.2f}"
        )


def main() -> int:
    """Run what the command line asks for; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cells", type=int, default=30)
    parser.add_argument("--seed", type=int, default=int(np.random.default_rng().integers(2**32)))
    parser.add_argument("--conduct", action="store_true", help="conductivity in place of stiffness")
    parser.add_argument("--mirrored", action="store_true", help="beside a two-point value")
    options = parser.parse_args()
    if options.mirrored:
        mirrored(options.seed)
        return 0
    return int(run(options.cells, options.seed, conducts=options.conduct) > 0)


if __name__ == "__main__":
    sys.exit(main())
