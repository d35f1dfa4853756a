"""Growth of the product-space solve with size, layers, contrast, ranks; `make bench-scaling`.

    ./enter python -m benchmarks.rve.scaling
    ./enter python -m benchmarks.rve.scaling --ranks 1 2 3 --finest 0.04

Ranks run under mpirun, each line processes of its own, and must give the E of one. The fastest
of several solves after the first counts; a machine should do nothing else meanwhile.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from alphacut.rve.cell.cell import Phase
from alphacut.rve.prism.model import PrismModel
from benchmarks.rows import write
from benchmarks.rve.solvers import MATRIX, PAPER, PARTICLE

SAME = 1e-10  # relative, of E on ranks
RANKS = """
import json, sys
from time import perf_counter
from mpi4py import MPI
from benchmarks.rve.solvers import MATRIX, PAPER, PARTICLE
from alphacut.rve.prism.model import PrismModel

model = PrismModel(float(sys.argv[1]), parallel=True, estimate=False)
model.solve(PAPER, MATRIX, [PARTICLE])
seconds = []
for _ in range(int(sys.argv[2])):
    MPI.COMM_WORLD.Barrier()
    started = perf_counter()
    (result,) = model.solve(PAPER, MATRIX, [PARTICLE])
    MPI.COMM_WORLD.Barrier()
    seconds.append(perf_counter() - started)
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps({"seconds": min(seconds), "E": result.modulus}))
"""


def on_ranks(count: int, size: float, repeat: int) -> dict[str, Any]:
    """E and least seconds of a cell on so many ranks, its mesh and forms at hand."""
    command = ["mpirun", "-n", str(count), sys.executable, "-c", RANKS, str(size), str(repeat)]
    root = Path(__file__).parents[2]
    run = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    numbers: dict[str, Any] = json.loads(run.stdout.splitlines()[-1])
    return numbers


def grown(size: float, layers: int, contrast: float) -> dict[str, Any]:
    """One line of the table."""
    model = PrismModel(size, layers, estimate=False)
    started = perf_counter()
    one = model.solve(PAPER, MATRIX, [Phase(MATRIX.modulus * contrast, PARTICLE.poisson)])[0]
    return {
        "mesh_size": size,
        "layers": layers,
        "contrast": contrast,
        "unknowns": one.unknowns,
        "iterations": max(one.iterations),
        "wall": perf_counter() - started,
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables; exit 1 where ranks differ in E."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--finest", type=float, default=0.04, help="mesh size on ranks")
    parser.add_argument("--ranks", type=int, nargs="*", default=[1, 2, 3])
    parser.add_argument("--repeat", type=int, default=5, help="solves on ranks, the fastest counts")
    options = parser.parse_args(arguments)
    tabulate(options.finest)
    return compare_ranks(options.ranks, options.finest, options.repeat)


def tabulate(finest: float) -> None:
    """Print a line for each size, number of layers and contrast; write them as CSV."""
    changes = [(size, 12, 4.0) for size in (0.3, 0.15, 0.08, 0.04) if size >= finest]
    changes += [(0.15, layers, 4.0) for layers in (6, 24, 48)]
    changes += [(0.15, 12, contrast) for contrast in (1e-3, 1e3)]
    rows = []
    for change in changes:
        rows.append(grown(*change))
        print(" ".join(f"{name} {value:.4g}" for name, value in rows[-1].items()), flush=True)
    write(rows, Path(__file__).parents[1] / "results" / "cell_scaling.csv")


def compare_ranks(counts: Sequence[int], size: float, repeat: int) -> int:
    """Print the time and E of one cell on several ranks; 1 where E differs, else 0."""
    alone, faults = None, 0
    for count in counts:
        numbers = on_ranks(count, size, repeat)
        alone = alone or numbers
        apart = abs(numbers["E"] / alone["E"] - 1)
        faults += apart > SAME
        share = numbers["seconds"] / alone["seconds"]
        print(
            f"{count} ranks: {numbers['seconds']:.2f} s, {share:.2f} of one rank's time,"
            f" E {apart:.0e} apart"
        )
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
