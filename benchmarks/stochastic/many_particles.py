"""One-particle cell against many-particle cells, homogenised directly.

    ./enter python -m benchmarks.stochastic.many_particles --cells 30 --discs 60

Periodic packings (log-normal radii over a factor of ten, area fraction 0.2, E_i/E_m = 4) are meshed
conformingly and homogenised under three loads; their Young's moduli are set beside the one-particle
result for the r_n of the very same packings, Mori–Tanaka and the bounds. Writes many_particles.csv
and many_particles.svg/.png to benchmarks/results/ and prints what follows.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.packing import Packing, packings
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.radius_map import HermiteMap
from alphacut.stochastic.sections import Simulated, reduced_radii
from benchmarks.stochastic.averages import Averages, Isotropic, averages, mori_tanaka

RESULTS = Path(__file__).parents[1] / "results"
MATRIX, INCLUSION = Phase(20e9), Phase(80e9)


def homogenised(discs: Discs, *, size: float, around: int) -> np.ndarray:
    """Stiffness of one packing, shape (3, 3), in Pa."""
    from benchmarks.stochastic.representative.many_particles import many_particles

    return many_particles(discs, MATRIX, INCLUSION, size=size, around=around)


def compare(
    *,
    cells: int,
    discs: int,
    fraction: float = 0.2,
    seed: int = 1,
    workers: int = 1,
    size: float = 0.2,
    around: int = 20,
):
    """Stiffness of each many-particle cell, (cells, 3, 3), and averages over r_n."""
    wish = Packing(discs, fraction, LogNormalRadii(1e-3, 1e-2), gap=1e-4)
    sample = reduced_radii(Simulated(wish, cells).sections(seed))
    task = partial(homogenised, size=size, around=around)
    if workers > 1:
        with ProcessPoolExecutor(workers, mp_context=get_context("forkserver")) as pool:
            stiffness = list(pool.map(task, packings(wish, cells, seed=seed)))
    else:
        stiffness = [task(packing) for packing in packings(wish, cells, seed=seed)]
    inside = sample.values < 1
    known = averages(
        sample.values[inside],
        sample.weights[inside] / sample.weights[inside].sum(),
        MATRIX,
        INCLUSION,
    )
    return np.array(stiffness), known


def sentences(moduli: np.ndarray, known: Averages, *, mesh: float, fraction: float) -> list[str]:
    """What the comparison says, one sentence for each number; moduli in GPa.

    Args:
        moduli: Of the many-particle cells.
        known: Averages over the r_n of the same packings.
        mesh: Relative change of a cell's modulus by a finer mesh.
        fraction: Area fraction of the packings.
    """
    mean, error = moduli.mean(), moduli.std(ddof=1) / np.sqrt(len(moduli))
    named = {
        "eq. 16 on the r_n of the same discs": known.equation_16,
        "mean of both shear moduli, equal strain": known.one_particle,
        "mean of both shear moduli, equal stress": known.equal_stress,
        "one square cell of the mean fraction, both shear moduli": known.single,
        "Mori-Tanaka, the lower bound of Hashin and Shtrikman": known.mori_tanaka,
    }
    return [
        f"{len(moduli)} cells of area fraction {fraction:g}: E = {mean:.3f} ± {error:.3f} GPa"
        f" (standard error; cell to cell {moduli.std(ddof=1):.3f})",
        f"a mesh of half the size changes E by {mesh:+.3%}, {1000 * mesh * mean:+.1f} MPa",
        *(
            f"{name}: {one.modulus / 1e9:.3f} GPa, {one.modulus / 1e9 / mean - 1:+.2%}"
            for name, one in named.items()
        ),
    ]


def of_the_paper(moduli: np.ndarray) -> str:
    """E of eq. 16 for the paper's own map beside the bound at its mean area fraction."""
    from alphacut.rve.series.model import SeriesModel

    radius = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
    result = SeriesModel().solve(radius, MATRIX, [INCLUSION])[0]
    curve = result.curve
    fraction = float(np.pi / 4 * curve.weights @ radius(curve.theta) ** 2)
    bound = mori_tanaka(fraction, MATRIX, INCLUSION).modulus / 1e9
    own = result.modulus / 1e9
    return (
        f"the paper's map, area fraction {fraction:.4f}: eq. 16 gives {own:.3f} GPa,"
        f" {own / moduli.mean() - 1:+.2%}; the lower bound there is {bound:.3f} GPa"
    )


def mesh_change(discs: Discs, *, size: float, around: int) -> float:
    """Relative change of one cell's modulus by a mesh of half the size."""
    coarse, fine = (
        Isotropic.of(homogenised(discs, size=size / k, around=k * around)).modulus for k in (1, 2)
    )
    return fine / coarse - 1


def draw(moduli: np.ndarray, known: Averages, folder: Path) -> None:
    """One figure: the distribution over cells beside every average."""
    import matplotlib.pyplot as plt

    from alphacut.stochastic.figures.style import BLUE, GREEN, GREY, INK, ORANGE, save, style

    lines = [
        ("one-particle model (equal strain)", known.one_particle, ORANGE, "-"),
        ("E of eq. 16 on the same r_n", known.equation_16, GREEN, ":"),
        ("its cells at equal stress", known.equal_stress, ORANGE, ":"),
        ("one square cell", known.single, GREEN, "-"),
        ("Mori–Tanaka = lower bound", known.mori_tanaka, INK, "--"),
    ]
    with style():
        drawn, axes = plt.subplots(figsize=(7.2, 4.2))
        axes.hist(moduli, bins=max(6, len(moduli) // 4), color=BLUE, alpha=0.45)
        axes.plot(moduli, np.full(len(moduli), 0.15), "|", color=BLUE, ms=12)
        half = 1.96 * moduli.std(ddof=1) / np.sqrt(len(moduli))
        axes.axvspan(
            moduli.mean() - half,
            moduli.mean() + half,
            color=BLUE,
            alpha=0.5,
            lw=0,
            label=f"{len(moduli)} cells: mean ± 95 %",
        )
        for label, value, colour, dash in lines:
            axes.axvline(
                value.modulus / 1e9,
                color=colour,
                ls=dash,
                lw=1.6,
                label=f"{label}: {value.modulus / 1e9:.3f}",
            )
        beyond = (
            f"bounds: Reuss {known.reuss.modulus / 1e9:.2f}, Voigt {known.voigt.modulus / 1e9:.2f},"
            f" upper {known.upper.modulus / 1e9:.2f}"
        )
        axes.set(xlabel="Young's modulus [GPa]", ylabel="cells")
        axes.set_title(beyond, fontsize=9, color=GREY)
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
        save(drawn, folder / "many_particles")


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute, write, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", type=int, default=30, help="many-particle cells (30)")
    parser.add_argument("--discs", type=int, default=60, help="discs in each (60)")
    parser.add_argument("--fraction", type=float, default=0.2, help="area fraction (0.2)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the packings (1)")
    parser.add_argument("--workers", type=int, default=1, help="processes (1)")
    parser.add_argument(
        "--size", type=float, default=0.2, help="edge length over the mean spacing of discs (0.2)"
    )
    parser.add_argument("--around", type=int, default=20, help="edges around each circle (20)")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    options = parser.parse_args(arguments)
    stiffness, known = compare(
        cells=options.cells,
        discs=options.discs,
        fraction=options.fraction,
        seed=options.seed,
        workers=options.workers,
        size=options.size,
        around=options.around,
    )
    each = [Isotropic.of(one) for one in stiffness]
    moduli = np.array([one.modulus for one in each]) / 1e9
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "many_particles.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["what", "E [GPa]", "bulk [GPa]", "shear [GPa]"])
        named = {name: value for name, value in vars(known).items() if isinstance(value, Isotropic)}
        for name, value in [*((f"cell {k}", one) for k, one in enumerate(each)), *named.items()]:
            writer.writerow(
                [name, *(f"{x / 1e9:.6f}" for x in (value.modulus, value.bulk, value.shear))]
            )
    draw(moduli, known, options.out)
    wish = Packing(options.discs, options.fraction, LogNormalRadii(1e-3, 1e-2), gap=1e-4)
    first = next(iter(packings(wish, 1, seed=options.seed)))
    mesh = mesh_change(first, size=options.size, around=options.around)
    print("\n".join(sentences(moduli, known, mesh=mesh, fraction=options.fraction)))
    print(of_the_paper(moduli))


if __name__ == "__main__":
    main()
