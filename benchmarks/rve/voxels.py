"""Time and gap of the proved bounds of a volume, on the processor and on a device.

    ./enter python -m benchmarks.rve.voxels --sizes 32 64
    python -m benchmarks.rve.voxels --sizes 64 128 256 --devices cuda cpu --largest-cpu 64

A random two-phase volume (correlation length 4 voxels, 40 % of the stiffer phase) and a sphere of
fraction 0.2, both at contrast 10, all six loads. Where both devices solve the same volume, every
entry of both bounds is compared.

`--chart` draws the gap over time of one volume of 16³ voxels of n³ elements, beside muGrid's error.
"""

from __future__ import annotations

import argparse
import resource
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.model import ImageModel
from alphacut.rve.image.phases import ModuliImages, PhaseModuli

SEED = 886601
CONTRAST = 10.0
MUGRID = {1: (33.1270, 0.16), 2: (32.2186, 0.19), 3: (31.9910, 0.21)}
# of muGrid 1.6.1, energy within 3e-6, by elements along a voxel: Voigt's K, and its processor time
# over that of both bounds in the same run
MUGRID_LIMIT = 31.705  # by Aitken's extrapolation of 1, 2 and 4 elements


def random_volume(
    size: int, length: float = 4.0, fraction: float = 0.4, dimension: int = 3
) -> Mask:
    """Phases parted at a quantile of Gaussian noise of correlation exp(−distance²/length²)."""
    noise = np.random.default_rng(SEED).normal(size=(size,) * dimension)
    wave = 2 * np.pi * np.fft.fftfreq(size)
    squares = sum(w**2 for w in np.meshgrid(*[wave] * dimension, indexing="ij"))
    smooth = np.fft.ifftn(np.fft.fftn(noise) * np.exp(-squares * length**2 / 8)).real
    return np.asarray(smooth > np.quantile(smooth, 1 - fraction))


def sphere(size: int, fraction: float = 0.2) -> Mask:
    """Voxels whose centre lies in a sphere in the middle."""
    radius = (3 * fraction / (4 * np.pi)) ** (1 / 3)
    x = (np.arange(size) + 0.5) / size - 0.5
    return np.asarray(x[:, None, None] ** 2 + x[:, None] ** 2 + x**2 < radius**2)


def solve(
    mask: Mask, device: str, accuracy: float, division: int = 1
) -> tuple[StiffnessBounds, float, float]:
    """Bounds, and seconds of the wall and of the processor."""
    matrix, particle = (
        PhaseModuli.of_young(e, nu, 3) for e, nu in ((20, 0.2), (20 * CONTRAST, 0.3))
    )
    bulk, shear = (np.where(mask, b, a) for a, b in ((matrix.bulk, particle.bulk),
                                                     (matrix.shear, particle.shear)))  # fmt: skip
    model = ImageModel((1.0, 1.0, 1.0), division, ConjugateGradient(accuracy), device=device)
    start, used = perf_counter(), process_time()
    bounds = model.solve(ModuliImages.crisp(bulk, shear)).bounds
    return bounds, perf_counter() - start, process_time() - used


def difference(first: StiffnessBounds, second: StiffnessBounds) -> float:
    """Largest difference of an entry of either bound over the largest entry."""
    pairs: list[tuple[Array, Array]] = [(first.lower, second.lower), (first.upper, second.upper)]
    return max(float(np.abs(a - b).max() / np.abs(a).max()) for a, b in pairs)


def chart(accuracy: float) -> None:
    """Picture of the gap of K's bounds, and of muGrid's error, over seconds."""
    from matplotlib import pyplot

    points, mask = [], random_volume(16)
    solve(mask, "cpu", accuracy)  # compiles
    for parts, (mugrid_bulk, mugrid_time) in MUGRID.items():
        bounds, _, seconds = solve(mask, "cpu", accuracy, parts)
        gap = bounds.upper[:3, :3].sum() / bounds.lower[:3, :3].sum() - 1
        points.append((seconds, gap, mugrid_time * seconds, mugrid_bulk / MUGRID_LIMIT - 1))
        print(f"{parts}³ elements a voxel: {points[-1]}", flush=True)
    _, axes = pyplot.subplots(figsize=(6.5, 4.0), layout="constrained")
    for x, label in enumerate(("distance of both proved bounds", "error of muGrid, from above")):
        own = np.array(points)[:, 2 * x : 2 * x + 2]
        axes.loglog(*own.T, "o-", label=label)
        for parts, place in zip(MUGRID, own, strict=True):
            words = f"{parts}³" if parts > 1 else "1 element a voxel"
            axes.annotate(words, place, (5, 5), textcoords="offset points", fontsize=8)
    axes.set(xlabel="processor time of six loads in s", ylabel="over K")
    axes.set_title("K of a random volume of 16³ voxels, contrast 10")
    ticks = (0.01, 0.02, 0.05, 0.1)
    axes.set_yticks(ticks, [f"{100 * tick:g} %" for tick in ticks])
    axes.minorticks_off()
    axes.set_ylim(0.007, 0.12)
    axes.grid(alpha=0.25)
    axes.legend(frameon=False)
    pyplot.savefig(Path(__file__).parents[1] / "results/voxels.png", dpi=160)


def main() -> None:
    """Print a row for each volume, size and device."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[32, 64])
    parser.add_argument("--devices", nargs="+", default=["cpu"])
    parser.add_argument("--largest-cpu", type=int, default=10**6, help="size solved on cpu at most")
    parser.add_argument("--accuracy", type=float, default=3e-6, help="relative energy left")
    parser.add_argument("--chart", action="store_true", help="gap over time, beside muGrid")
    options = parser.parse_args()
    if options.chart:
        chart(options.accuracy)
        return
    print("volume   size  device   wall s   cpu s  gap of K   of G_xy  peak GB  largest difference")
    for name, make in (("random", random_volume), ("sphere", sphere)):
        for size in options.sizes:
            solved: dict[str, StiffnessBounds] = {}
            for device in options.devices:
                if device == "cpu" and size > options.largest_cpu:
                    continue
                bounds, wall, used = solve(make(size), device, options.accuracy)
                solved[device] = bounds
                bulk, shear = bounds.bulk, bounds.constants()[-1]
                peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
                apart = f"{difference(*solved.values()):.1e}" if len(solved) == 2 else ""
                gaps = [100 * (high / low - 1) for low, high in (bulk, shear)]
                print(
                    f"{name:8} {size:4}  {device:6} {wall:8.2f} {used:7.1f}  {gaps[0]:6.2f} %"
                    f"  {gaps[1]:6.2f} %  {peak:7.2f}  {apart}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
