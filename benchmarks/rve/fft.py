"""A short FFT solver beside the proved bounds of images and volumes: values, price and memory.

    ./enter python -m benchmarks.rve.fft

The solver has one point a pixel or voxel, derivatives by the rotated scheme (Willot, C. R.
Mécanique 343, 232, 2015), and conjugate gradients that are preconditioned by the Green operator of
a homogeneous material. It is what a reader may have written, not a library's. The material is a
random one of two phases at contrast 10, and in the last row a disc. Both solve the loads of all
directions, each in a process of its own, and FFT's value and the bounds are those of the mean k and
of K. Exit status 1 if two proved sides take more than 8 times the processor time of FFT.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import combinations_with_replacement
from multiprocessing import get_context
from pathlib import Path
from time import process_time
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from alphacut.base.arrays import Array, Mask
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.model import solve_conduction, solve_image
from alphacut.rve.image.phases import PhaseModuli
from benchmarks.rve.voxels import CONTRAST, random_volume

T = TypeVar("T")
Waves = NDArray[np.complex128]
TOLERANCE = 1e-5
"""Relative residual in the norm of the preconditioner, so that energies are left by some 1e-10."""
DEAREST = 8.0
"""Processor time of both proved sides over that of FFT, at most."""


class Cost(NamedTuple):
    """Price of a call: processor seconds, and MB by which the process grew at most."""

    seconds: float
    megabytes: float


def measured(call: Callable[[], T]) -> tuple[T, Cost]:
    """Return what a call returns, and its price.

    What earlier calls freed may be used again and is not seen to grow: where memory counts, a call
    is the first of its process, or each is larger than those before.
    """
    gc.collect()
    before = min(_resident("VmRSS"), _first_resident())
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    started = process_time()
    found = call()
    seconds = process_time() - started
    return found, Cost(seconds, (_resident("VmHWM") - before) / 1024)


def _resident(name: str) -> int:
    """Return a line of this process's status, in kB."""
    status = Path("/proc/self/status").read_text()
    return int(status.split(f"{name}:")[1].split()[0])


@cache
def _first_resident() -> int:
    """Return the memory in kB that this process had when it was first asked."""
    return _resident("VmRSS")


class Grid:
    """Differences of the rotated scheme on a periodic grid, as factors of Fourier coefficients."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.shape = shape
        steps = [np.exp(2j * np.pi * fft.fftfreq(n)) for n in shape[:-1]]
        steps.append(np.exp(2j * np.pi * fft.rfftfreq(shape[-1])))
        mesh = np.meshgrid(*steps, indexing="ij")
        means = [(one + 1) / 2 for one in mesh]
        self.differences: Waves = np.array(
            [
                np.prod([step - 1, *(x for k, x in enumerate(means) if k != axis)], axis=0)
                for axis, step in enumerate(mesh)
            ]
        )
        # Coefficients of real fields stand for their conjugates too, but for the ends of the axis.
        self.weight = np.full(self.differences.shape[1:], 2.0)
        self.weight[..., [0, -1] if shape[-1] % 2 == 0 else [0]] = 1.0

    def forward(self, fields: Array) -> Waves:
        """Return the coefficients of real fields, shape (…, *shape)."""
        return np.asarray(fft.rfftn(fields, self.shape, axes=range(-len(self.shape), 0)))

    def backward(self, waves: Waves) -> Array:
        """Return the real fields of coefficients."""
        return np.asarray(fft.irfftn(waves, self.shape, axes=range(-len(self.shape), 0)))


def solve(
    grid: Grid, flux: Callable[[Array], Array], precondition: Callable[[Waves], Waves], mean: Array
) -> Array:
    """Return the mean flux under a mean gradient by conjugate gradients, shape (components, d).

    Args:
        grid: The grid.
        flux: Flux of gradients, both of shape (components, d, *shape), linear and symmetric.
        precondition: Inverse of the homogeneous operator on coefficients (components, *half).
        mean: Mean gradient, shape (components, d).
    """
    ones = (1,) * len(grid.shape)
    uniform = mean.reshape(*mean.shape, *ones)

    def forces(gradient: Array) -> Waves:
        """Return the coefficients of the divergence of the flux, with the sign of a force."""
        waves = grid.forward(flux(gradient))
        return np.asarray((waves * grid.differences.conj()).sum(axis=1))

    def gradient(potential: Waves) -> Array:
        """Return the gradient of potentials, shape (components, d, *shape)."""
        return grid.backward(potential[:, np.newaxis] * grid.differences)

    def dot(a: Waves, b: Waves) -> float:
        """Return the inner product of two real fields by their coefficients."""
        return float((grid.weight * (a.conj() * b).real).sum())

    residual = -forces(np.broadcast_to(uniform, (*mean.shape, *grid.shape)))
    potential = np.zeros_like(residual)
    step = direction = precondition(residual)
    size = first = dot(residual, step)
    while size > TOLERANCE**2 * first:
        product = forces(gradient(direction))
        length = size / dot(direction, product)
        potential = potential + length * direction
        residual = residual - length * product
        step = precondition(residual)
        size, before = dot(residual, step), size
        direction = step + size / before * direction
    axes = tuple(range(2, 2 + len(grid.shape)))
    return np.asarray(flux(gradient(potential) + uniform).mean(axis=axes))


def conductivity(values: Array) -> Array:
    """Return the effective conductivity of an image or volume, shape (d, d)."""
    grid = Grid(values.shape)
    laplacian = (abs(grid.differences) ** 2).sum(axis=0)
    inverse = np.divide(1.0, laplacian, out=np.zeros_like(laplacian), where=laplacian > 1e-12)
    loads = np.eye(values.ndim)
    fluxes = [
        solve(grid, lambda g: values * g, lambda r: inverse * r, load[None]) for load in loads
    ]
    return np.array([flux[0] for flux in fluxes])


def stiffness(bulk: Array, shear: Array) -> Array:
    """Return the effective stiffness of an image or volume in Voigt's order with 2 ε.

    Args:
        bulk: Bulk modulus of each pixel, in the plane that of plane strain, K + G/3.
        shear: Shear modulus.
    """
    grid = Grid(bulk.shape)
    d = bulk.ndim
    lame = bulk - 2 / d * shear
    identity = np.eye(d).reshape(d, d, *(1,) * d)

    def stress(gradient: Array) -> Array:
        """Return λ tr ε I + 2 G ε of displacement gradients."""
        return lame * np.trace(gradient) * identity + shear * (gradient + gradient.swapaxes(0, 1))

    # (λ + G) D Dᴴ + G |D|² I has the inverse (I − (λ + G)/(λ + 2 G) D Dᴴ/|D|²) / (G |D|²).
    squares = (abs(grid.differences) ** 2).sum(axis=0)
    inverse = np.divide(1.0, squares, out=np.zeros_like(squares), where=squares > 1e-12)
    g = (shear.min() + shear.max()) / 2
    ratio = 1 - g / ((lame.min() + lame.max()) / 2 + 2 * g)

    def precondition(forces: Waves) -> Waves:
        """Return the displacements of the homogeneous material."""
        along = (grid.differences * forces).sum(axis=0) * inverse
        return np.asarray(inverse / g * (forces - ratio * along * grid.differences.conj()))

    pairs = [(k, k) for k in range(d)]
    pairs += [pair for pair in combinations_with_replacement(range(d), 2) if pair[0] != pair[1]][
        ::-1
    ]
    rows = []
    for i, j in pairs:
        strain = np.zeros((d, d))
        strain[i, j] += 0.5
        strain[j, i] += 0.5
        mean = solve(grid, stress, precondition, strain)
        rows.append([mean[a, b] for a, b in pairs])
    return np.array(rows)


def disc(size: int) -> Mask:
    """Return the pixels whose centre lies in a disc of half the cell's width."""
    places = (np.arange(size) + 0.5) / size - 0.5
    return np.asarray(np.hypot(places, places[:, np.newaxis]) < 0.25)


def priced(name: str, size: int, d: int, way: str) -> tuple[Array, Cost]:
    """Return FFT's value, or the two bounds, shape (2,), of a row, and the price.

    Args:
        name: "k", "K" or "K of a disc".
        size: Pixels or voxels along a side.
        d: Dimension, 2 or 3.
        way: "fft" or "bounds".
    """
    mask = disc(size) if "disc" in name else random_volume(size, dimension=d)
    if name == "k":
        values = np.where(mask, CONTRAST, 1.0)
        solve_conduction(np.ones((4,) * d))  # compiles
        if way == "bounds":
            return measured(lambda: np.array(solve_conduction(values).bounds.mean))
        found, price = measured(lambda: conductivity(values))
        return np.trace(found) / d, price
    matrix, particle = (
        PhaseModuli.of_young(young, poisson, 3) for young, poisson in ((20, 0.2), (200, 0.3))
    )
    shear = np.where(mask, particle.shear, matrix.shear)
    bulk = np.where(mask, particle.bulk, matrix.bulk) + (d == 2) * shear / 3
    solve_image(np.ones((4,) * d), np.ones((4,) * d))  # compiles
    if way == "bounds":
        return measured(lambda: np.array(solve_image(bulk, shear).bounds.bulk))
    found, price = measured(lambda: stiffness(bulk, shear))
    return np.mean(StiffnessBounds(found, found).bulk), price


def main() -> int:
    """Print the table; exit 1 where bounds are dearer than they are said to be."""
    print(
        "|   | size | FFT | lower bound | upper bound | FFT: s, MB | both bounds: s, MB | times |"
    )
    print("|---|---|---|---|---|---|---|---|")
    worst = 0.0
    cases = [("k", 256, 2), ("K", 256, 2), ("k", 64, 3), ("k", 128, 3), ("K", 64, 3)]
    for name, size, d in [*cases, ("K of a disc", 128, 2)]:
        found = []
        for way in ("fft", "bounds"):
            with ProcessPoolExecutor(1, get_context("spawn")) as apart:
                found.append(apart.submit(priced, name, size, d, way).result())
        (value, price), (bounds, dearer) = found
        times = dearer.seconds / price.seconds
        worst = max(worst, times)
        print(
            f"| {name} | {size}{'²³'[d - 2]} | {value:.4f} | {bounds[0]:.4f} | {bounds[1]:.4f} |"
            f" {price.seconds:.1f}, {price.megabytes:.0f} |"
            f" {dearer.seconds:.1f}, {dearer.megabytes:.0f} | {times:.1f} |",
            flush=True,
        )
    return int(worst > DEAREST)


if __name__ == "__main__":
    sys.exit(main())
