"""Moduli of the square array over the area fraction, with bounds.

By the series; a row of planar slices beside it would not be told apart.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from alphacut.rve.anisotropy import shear_ratio
from alphacut.rve.bounds import bulk_modulus, hashin_shtrikman_bulk
from alphacut.rve.cell import Phase
from alphacut.rve.result import effective_modulus
from alphacut.rve.series.stiffness import square_stiffness

MATRIX, PARTICLE = Phase(20e9), Phase(80e9)
COLUMNS = (
    "fraction",
    "radius",
    "E_GPa",
    "nu",
    "bulk_GPa",
    "bulk_least_GPa",
    "bulk_greatest_GPa",
    "shear_axes_GPa",
    "shear_diagonal_GPa",
)


def sweep(count: int, *, matrix: Phase = MATRIX, particle: Phase = PARTICLE) -> np.ndarray:
    """One row of `COLUMNS` for each of `count` area fractions from 0 to 0.5, shape (count, 9)."""
    fraction = np.linspace(0, 0.5, count)
    radius = np.sqrt(4 * fraction / np.pi)
    cells = square_stiffness(radius, matrix, [particle]).matrix[:, 0]
    least, greatest = hashin_shtrikman_bulk(fraction, matrix, particle)
    rows = []
    for k, cell in enumerate(cells):
        modulus, nu = effective_modulus(0.01 * (cell[0, 0] + cell[0, 1]), 0.02 * cell[2, 2])
        shear = cell[2, 2]
        bulk = float(bulk_modulus(cell))
        moduli = np.array([bulk, least[k], greatest[k], shear, shear_ratio(cell) * shear]) / 1e9
        rows.append([fraction[k], radius[k], modulus / 1e9, nu, *moduli])
    return np.array(rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the CSV file and draw the figure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=51, help="area fractions (default 51)")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(__file__).parents[1] / "results",
        help="folder for CSV file and figure",
    )
    options = parser.parse_args(arguments)
    rows = sweep(options.count)
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "cell_sweep.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(rows.tolist())
    draw(rows, options.out / "cell_sweep")
    return 0


def draw(rows: np.ndarray, stem: Path) -> None:
    """Bulk modulus between its bounds, and the two shear moduli with E of eq. 16."""
    import matplotlib.pyplot as plt

    fraction, _, modulus, _, bulk, least, greatest, along, diagonal = rows.T
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    left.fill_between(fraction, least, greatest, color="#c6dbef", label="Hashin–Shtrikman")
    left.plot(fraction, bulk, color="#08519c", label="square array")
    left.set(xlabel="area fraction of the particle", ylabel="in-plane bulk modulus in GPa")
    right.plot(fraction, modulus, color="#08519c", label="E of eq. 16")
    right.plot(fraction, along, color="#d94801", label="shear modulus along the axes")
    right.plot(fraction, diagonal, "--", color="#d94801", label="along the diagonals")
    right.set(xlabel="area fraction of the particle", ylabel="GPa")
    for axes in (left, right):
        axes.legend(frameon=False)
        axes.grid(alpha=0.25)
    for suffix in (".svg", ".png"):
        figure.savefig(stem.with_suffix(suffix), dpi=160)
    plt.close(figure)


if __name__ == "__main__":
    sys.exit(main())
