"""The product-space solve on ranks of MPI; `make bench-scaling`.

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
from pathlib import Path
from typing import Any

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
    output = subprocess.check_output(command, cwd=Path(__file__).parents[2], text=True)
    numbers: dict[str, Any] = json.loads(output.splitlines()[-1])
    return numbers


def main() -> int:
    """Print a line for each number of ranks; exit 1 where they differ in E."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--finest", type=float, default=0.04, help="mesh size on ranks")
    parser.add_argument("--ranks", type=int, nargs="*", default=[1, 2, 3])
    parser.add_argument("--repeat", type=int, default=5, help="solves on ranks, the fastest counts")
    options = parser.parse_args()
    alone, faults = None, 0
    for count in options.ranks:
        numbers = on_ranks(count, options.finest, options.repeat)
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
