"""One-sphere cell against cells of many random spheres, and what the latter may be off by.

    ./enter python -m benchmarks.rve.many_spheres --workers 2

Periodic packings (log-normal radii over a factor of ten, volume fraction 0.2092, E_i/E_m = 4) of
two sizes are homogenised on grids of voxels. Their E stands with its declared error, in parts,
beside the one-sphere cell for the r_n of the very same packings, the cell of the mean volume
fraction, the case cases/paper-3d.toml and the bounds. Before that the grids' error is set beside
the truth where it is known: 100 means over four random cells of one sphere, by their series. Writes
many_spheres.csv to benchmarks/results/; ends with 1 where a declared error is exceeded.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
from scipy.interpolate import CubicSpline

from alphacut.case.load import load
from alphacut.rve.cell import Phase
from alphacut.rve.spheres.bounds import hashin_shtrikman
from alphacut.rve.spheres.cubic import hill_average
from alphacut.rve.spheres.series.stiffness import cubic_stiffness
from alphacut.stages.material import modulus
from alphacut.stages.material.campaign import campaign
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.spheres.packing import SpherePacking
from alphacut.stochastic.spheres.power_cells import reduced_radii
from alphacut.stochastic.spheres.spheres import Spheres
from alphacut.stochastic.theta.truncated_normal import Array
from benchmarks.rve.many_material import Declared, RandomMaterial, random_material
from benchmarks.rve.many_random_cells import SOLVER, RandomCells, limit_of_grids
from benchmarks.rve.voxels.stiffness import stiffness_of
from benchmarks.rve.voxels.voxels import voxels_of

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "benchmarks" / "results"
GPA = 1e9
GRIDS = (9, 13, 19)  # of the cells of one sphere
CELLS = 4  # as few as are ever refined
WIDEST = 0.97


@dataclass(frozen=True)
class Calibration:
    """Declared and true errors of means over one-sphere cells, relative, shape (draws,) each."""

    declared: Array
    true: Array

    @property
    def covered(self) -> int:
        """Draws all of whose moduli are as near as declared."""
        return int((self.true <= self.declared).sum())


def calibrate(draws: int, seed: int) -> Calibration:
    """Limits of three grids beside the series: random phases, radii and places of `CELLS` cells."""
    rng = np.random.default_rng([seed, 1])
    declared, true = [], []
    for _ in range(draws):
        contrast = 10 ** rng.uniform(-1, 1)
        phases = Phase(20e9, rng.uniform(0.1, 0.4)), Phase(20e9 * contrast, rng.uniform(0.1, 0.4))
        radii = rng.uniform(0.4, 0.85, CELLS)
        spheres = [Spheres(rng.uniform(0, 2, (1, 3)), np.array([r]), 2.0) for r in radii]
        found = np.array(
            [[stiffness_of(voxels_of(one, n), *phases).moduli for n in GRIDS] for one in spheres]
        )
        cell = cubic_stiffness(radii, phases[0], [phases[1]], tolerance=1e-8)
        exact = np.array([own[:, 0].mean() for own in (cell.bulk, cell.deviator, cell.shear)])
        limits, error = limit_of_grids(found.mean(axis=0), GRIDS)
        declared.append(error + SOLVER)
        true.append(abs(limits / exact - 1).max())
    return Calibration(np.array(declared), np.array(true))


def one_sphere(cells: RandomCells, phases: tuple[Phase, Phase], seed: int) -> dict[str, float]:
    """E in GPa of one-sphere cells: over r_n of the packings, and of their volume fraction.

    Spheres wider than their cells, r_n ≥ 1, have no cubic cell: radii end at `WIDEST`.
    """
    sample = reduced_radii([cells.cell(number, seed) for number in range(cells.cells)])
    radii, weights = np.minimum(sample.values, WIDEST), sample.weights
    print(
        f"r_n above {WIDEST}: {weights @ (sample.values > WIDEST):.1%} of the volume, taken as"
        f" {WIDEST}; that leaves the volume fraction {np.pi / 6 * weights @ radii**3:.4f}"
    )
    single = np.cbrt(6 * cells.packing.volume_fraction / np.pi)
    nodes = np.linspace(0, max(radii.max(), single), 80)
    found = cubic_stiffness(nodes, phases[0], [phases[1]], tolerance=1e-7)
    at = CubicSpline(nodes, np.stack([found.bulk, found.deviator, found.shear], axis=-1)[:, 0])
    own = at(radii)
    moduli = {
        "r_n of the same spheres, equal strain": weights @ own,
        "r_n of the same spheres, equal stress": 1 / (weights @ (1 / own)),
        "one cell of the mean volume fraction": at(single),
    }
    return {name: float(hill_average(of)[0]) / GPA for name, of in moduli.items()}


def of_the_case() -> float:
    """E in GPa of cases/paper-3d.toml at the modal values."""
    case = load(str(ROOT / "cases" / "paper-3d.toml"), ["modulus.alpha=[1]"])
    return float(modulus.compute(campaign(case)).result.bounds("E")[0][0]) / GPA


def sentences(
    found: RandomMaterial, phases: tuple[Phase, Phase], others: dict[str, float]
) -> list[str]:
    """One sentence for each number, in GPa."""
    few, many = found.sizes
    lines = [
        _declared(name, own, many)
        for name, own in (("E", found.young), ("K", found.bulk), ("mu", found.shear))
    ]
    lines.append(
        f"E of cells of {few} spheres: {found.smaller[0] / GPA:.4f} GPa,"
        f" {found.smaller[0] / found.young.value - 1:+.4%} from those of {many}"
    )
    limits = hashin_shtrikman(np.array(found.volume_fraction), *phases)
    low, high = (9 * k * g / (3 * k + g) / GPA for k, g in limits.T)
    lines.append(f"Hashin-Shtrikman bounds of E: {low:.4f} ... {high:.4f} GPa")
    return lines + [
        f"{name}: {value:.3f} GPa, {value * GPA / found.young.value - 1:+.2%}"
        for name, value in others.items()
    ]


def _declared(name: str, own: Declared, spheres: int) -> str:
    parts = ", ".join(
        f"{part.replace('_', ' ')} {getattr(own, part) / own.value:.4%}"
        for part in ("statistics", "discretisation", "finite_size", "solver")
    )
    return (
        f"{name} of cells of {spheres} spheres: {own.value / GPA:.4f} ± {own.error / GPA:.4f} GPa,"
        f" ± {own.error / own.value:.4%}: {parts}"
    )


def parser() -> argparse.ArgumentParser:
    """The options."""
    found = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    found.add_argument(
        "--spheres", type=int, nargs=2, default=(30, 100), help="in a cell of each size (30 100)"
    )
    found.add_argument(
        "--cells", type=int, nargs=2, default=(400, 110), help="cells of each size (400 110)"
    )
    found.add_argument("--refined", type=int, default=8, help="of them on four grids (8)")
    found.add_argument("--resolution", type=float, default=8, help="voxels along a spacing (8)")
    found.add_argument("--fraction", type=float, default=0.2092, help="volume fraction (0.2092)")
    found.add_argument("--contrast", type=float, default=4, help="modulus over the matrix's (4)")
    found.add_argument(
        "--draws", type=int, default=100, help="means over cells of one sphere (100)"
    )
    found.add_argument("--seed", type=int, default=1, help="seed of the packings (1)")
    found.add_argument("--workers", type=int, default=1, help="processes (1)")
    found.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    return found


def require(options: argparse.Namespace) -> None:
    """Raise ValueError for a number out of its range that nothing else refuses in time."""
    for name, least in (("draws", 1), ("seed", 0), ("workers", 1)):
        if (value := getattr(options, name)) < least:
            raise ValueError(f"--{name} is {value}; it must be {least} or more")
    few, many = options.spheres
    if many < 2 * few:
        raise ValueError(f"--spheres is {few} {many}; the second must be twice the first or more")


def random_cells(options: argparse.Namespace) -> list[RandomCells]:
    """Cells of both sizes, their radii log-normal over a factor of ten."""
    law = LogNormalRadii(1e-3, 1e-2)
    return [
        RandomCells(
            SpherePacking(count, options.fraction, law), cells, options.refined, options.resolution
        )
        for count, cells in zip(options.spheres, options.cells, strict=True)
    ]


def grids_hold(draws: int, seed: int) -> bool:
    """Print how the declared error of the grids fares where the series is exact."""
    known = calibrate(draws, seed)
    ratio = np.median(known.declared / np.maximum(known.true, 1e-12))
    print(
        f"{CELLS} cells of one sphere on grids {GRIDS}: declared error covers in {known.covered}"
        f" of {draws} draws, the median over the truth {ratio:.1f},"
        f" the truth at most {known.true.max():.2%}"
    )
    return known.covered == draws


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute, write, print; exit 1 where the grids' error does not cover, 2 for bad input."""
    options = parser().parse_args(arguments)
    try:
        require(options)
        phases, sizes = (Phase(20e9), Phase(20e9 * options.contrast)), random_cells(options)
    except ValueError as error:
        print(f"many_spheres: {error}", file=sys.stderr)
        return 2
    hold = grids_hold(options.draws, options.seed)
    start = perf_counter()
    found = random_material(
        *sizes, phases[0], phases[1], seed=options.seed, workers=options.workers
    )
    seconds = perf_counter() - start
    others = one_sphere(sizes[1], phases, options.seed)
    if (options.fraction, options.contrast) == (0.2092, 4):
        others["the case paper-3d, its map of radii"] = of_the_case()
    grids = " and ".join(str(cells.grids) for cells in sizes)
    print(f"cells {options.cells}, grids {grids}: {seconds:.0f} s, {options.workers} processes")
    print("\n".join(sentences(found, phases, others)))
    _write(options.out, found, others)
    return 0 if hold else 1


def _write(folder: Path, found: RandomMaterial, others: dict[str, float]) -> None:
    """The table many_spheres.csv."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "many_spheres.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["what", "value [GPa]", "declared error [GPa]"])
        for name in ("young", "bulk", "shear"):
            own = getattr(found, name)
            writer.writerow([name, f"{own.value / GPA:.6f}", f"{own.error / GPA:.6f}"])
        writer.writerows([name, f"{value:.6f}", ""] for name, value in others.items())


if __name__ == "__main__":
    sys.exit(main())
