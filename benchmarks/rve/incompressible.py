"""Iterations and locking of the product-space elements as Poisson's ratio nears one half.

    ./enter python -m benchmarks.rve.incompressible

The paper's map, E_i/E_m = 4, Poisson's ratios of both phases, the default mesh and layers; mean
stresses and E beside the exact series. Exit status 1 if iterations exceed twice those at ν = 0.3.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from alphacut.rve.cell import Phase
from alphacut.rve.series.model import SeriesModel
from alphacut.stochastic import HermiteMap
from benchmarks.rows import write

PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
RATIOS = (0.3, 0.45, 0.49, 0.499, 0.4999)
PAIRS = (*((ratio, ratio) for ratio in RATIOS), (0.4999, 0.3), (0.3, 0.4999))
RESULTS = Path(__file__).parents[1] / "results" / "cell_incompressible.csv"


def rows(mesh_size: float, layers: int) -> Iterator[dict[str, float]]:
    """Poisson's ratios, the most iterations of a load, and relative errors."""
    from alphacut.rve.prism.model import PrismModel

    model = PrismModel(mesh_size=mesh_size, layers=layers)
    for matrix, particle in PAIRS:
        phases = Phase(20e9, matrix), [Phase(80e9, particle)]
        (result,), (exact,) = model.solve(PAPER, *phases), SeriesModel().solve(PAPER, *phases)
        (s11, s12), (true11, true12) = result.curve.mean, exact.curve.mean
        yield {
            "nu_matrix": matrix,
            "nu_particle": particle,
            "iterations": max(result.iterations),
            "error_of_E": float(f"{result.modulus / exact.modulus - 1:.3g}"),
            "error_of_s11": float(f"{s11 / true11 - 1:.3g}"),
            "error_of_s12": float(f"{s12 / true12 - 1:.3g}"),
        }


def main(arguments: Sequence[str] | None = None) -> int:
    """Solve, print and keep."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mesh-size", type=float, default=0.15, help="edge length (0.15)")
    parser.add_argument("--layers", type=int, default=12, help="layers in θ (12)")
    parser.add_argument("--out", type=Path, default=RESULTS, help="table to write")
    options = parser.parse_args(arguments)
    found = []
    for row in rows(options.mesh_size, options.layers):
        found.append(row)
        print(
            "nu = {nu_matrix:g}, {nu_particle:g}: {iterations} iterations, E off by"
            " {error_of_E:+.2e}, s11 by {error_of_s11:+.2e}, s12 by {error_of_s12:+.2e}".format(
                **row
            ),
            flush=True,
        )
    write(found, options.out)
    return int(max(row["iterations"] for row in found) > 2 * found[0]["iterations"])


if __name__ == "__main__":
    sys.exit(main())
