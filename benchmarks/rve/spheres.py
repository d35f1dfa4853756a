"""Spheres beside cylinders: the fuzzy modulus of the paper's case, and what the series costs.

    ./enter python -m benchmarks.rve.spheres

Writes spheres.csv and spheres.svg/.png to benchmarks/results/: the α-cuts of E of cases/paper.toml
and cases/paper-3d.toml by their exact series, with the time of five levels; and processor seconds a
radius for all three moduli of spheres at 1e-8, declared errors beside them.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np

from alphacut.case.load import load
from alphacut.rve import Phase
from alphacut.rve.spheres.series.stiffness import cubic_stiffness
from alphacut.stages.material import modulus
from alphacut.stages.material.campaign import campaign
from alphacut.stochastic.theta.truncated_normal import Array

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "benchmarks" / "results"
CASES = {"cylinders": "paper", "spheres": "paper-3d"}
GPA = 1e9


@dataclass(frozen=True)
class Cuts:
    """α-cuts of E of one case, in GPa, and the processor time that they took."""

    alpha: Array
    lower: Array
    upper: Array
    seconds: float


def fuzzy_modulus(name: str) -> Cuts:
    """E of a shipped case by series to 1e-6."""
    changes = ['modulus.method="series"', "modulus.tolerance=1e-6"]
    start = process_time()
    found = modulus.compute(campaign(load(str(ROOT / "cases" / f"{name}.toml"), changes)))
    lower, upper = found.result.bounds("E")
    return Cuts(found.result.alpha, lower / GPA, upper / GPA, process_time() - start)


def seconds_a_radius(radius: float, *, contrast: float) -> tuple[float, float]:
    """Processor time for all three moduli at 1e-8, lattice sums at hand, and the declared error."""
    matrix, inclusion = Phase(20e9), Phase(20e9 * contrast)
    cubic_stiffness([radius], matrix, [inclusion], tolerance=1e-8)
    start = process_time()
    cell = cubic_stiffness([radius], matrix, [inclusion], tolerance=1e-8)
    return process_time() - start, float(cell.errors.max())


def draw(found: dict[str, Cuts], folder: Path) -> None:
    """Both fuzzy moduli in one picture."""
    import matplotlib.pyplot as plt

    from alphacut.stochastic.figures.style import save, style

    with style():
        drawn, axes = plt.subplots(figsize=(6.4, 3.4))
        for (name, cuts), line in zip(found.items(), ("-", "--"), strict=True):
            ends = np.concatenate([cuts.lower, cuts.upper[::-1]])
            levels = np.concatenate([cuts.alpha, cuts.alpha[::-1]])
            axes.plot(ends, levels, ls=line, marker="o", ms=3, label=f"aggregates as {name}")
        axes.set(xlabel="effective Young's modulus E, GPa", ylabel="α", ylim=(0, 1.05))
        axes.legend(loc="upper left", fontsize=8)
        save(drawn, folder / "spheres")


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute, write, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    options = parser.parse_args(arguments)
    found = {name: fuzzy_modulus(case) for name, case in CASES.items()}
    rows = [
        (f"E of {name} at alpha {alpha:g}", f"{low:.6f}", f"{high:.6f}", "GPa")
        for name, cuts in found.items()
        for alpha, low, high in zip(cuts.alpha, cuts.lower, cuts.upper, strict=True)
    ]
    rows += [(f"time of {name}", f"{cuts.seconds:.2f}", "", "s") for name, cuts in found.items()]
    for radius in (0.5, 0.8, 0.9, 0.95):
        for contrast in (1e-3, 4, 1e3):
            seconds, error = seconds_a_radius(radius, contrast=contrast)
            what = f"one radius {radius:g}, contrast {contrast:g}: time, declared error"
            rows.append((what, f"{seconds:.4f}", f"{error:.1e}", "s"))
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "spheres.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["what", "value", "upper value or error", "unit"])
        writer.writerows(rows)
    draw(found, options.out)
    for row in rows:
        print(" ".join(f"{cell:>12}" if k else f"{cell:52}" for k, cell in enumerate(row)))


if __name__ == "__main__":
    main()
