"""Solvers of the product-space cell: set-up, solves and iterations; `make bench-solver`.

    ./enter python -m benchmarks.rve.solvers
    ./enter python -m benchmarks.rve.solvers --iterations

The first compares the named solvers with the default one on the paper's cell and exits with 1 where
E differs or MUMPS on the whole system is not 6 times slower. The second prints iterations of the
default over maps, contrasts and layers, and exits with 1 above 25 from 6 layers on.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter

from alphacut.rve.cell import LOADS, Phase
from alphacut.rve.prism import model as prism
from alphacut.rve.prism.model import PrismModel
from alphacut.rve.solver.krylov import solve
from alphacut.stochastic import HermiteMap, RadiusMap
from benchmarks.rows import write

PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)  # modal values of the paper, section 4.1
MATRIX, PARTICLE = Phase(20e9), Phase(80e9)
SLOWER = 6.0  # at least, MUMPS on the whole system at h .15
MOST = 25  # iterations from 6 layers on
RESULTS = Path(__file__).parents[1] / "results"
SOLVERS = {  # PETSc options without prefix
    "theta": {},
    "gamg": {"pc_type": "gamg", "pc_gamg_threshold": "0.01"},
    "mumps": {
        "ksp_type": "preonly",
        "pc_type": "cholesky",
        "pc_factor_mat_solver_type": "mumps",
    },
}
MAPS: dict[str, RadiusMap] = {
    "paper": PAPER,
    "paper, a2 and a4 highest": HermiteMap(0.1337, 0.3145, 0.8663, 0.9975),
    "paper, a2 and a4 lowest": HermiteMap(0.1337, 0.001, 0.8663, 0.001),
    "radii .05 to .95": HermiteMap(0.05, 0.0, 0.95, 0.0),
    "not monotone": HermiteMap(0.6, -1.5, 0.7, 0.5),
    "steep": HermiteMap(0.1, 0.0, 0.9, 2.0),
    "crisp": HermiteMap(0.5, 0.0, 0.5, 0.0),
}


@dataclass(frozen=True)
class Timing:
    """One solver on one system.

    Args:
        solver: Its name.
        unknowns: Of the system.
        setup: Seconds.
        solve: Seconds of both loads.
        iterations: For each load.
        modulus: E, in Pa.
    """

    solver: str
    unknowns: int
    setup: float
    solve: float
    iterations: tuple[int, ...]
    modulus: float

    @property
    def seconds(self) -> float:
        """Both together."""
        return self.setup + self.solve


def timing(solver: str, size: float, layers: int = 12, repeat: int = 3) -> Timing:
    """The fastest of a few runs, each with a set-up of its own."""
    model = PrismModel(size, layers, petsc=SOLVERS[solver], estimate=False)
    results = []
    for _ in range(repeat):
        prism._problem.cache_clear()
        results.append(model.solve(PAPER, MATRIX, [PARTICLE])[0])
    one = min(results, key=lambda result: result.seconds["setup"] + result.seconds["solve"])
    return Timing(
        solver,
        one.unknowns,
        one.seconds["setup"],
        one.seconds["solve"],
        one.iterations,
        one.modulus,
    )


def compare(timings: Sequence[Timing]) -> Iterator[str]:
    """Print the table; gives each fault in a sentence."""
    first = timings[0]
    print(f"{'solver':8} {'unknowns':>9} {'setup s':>8} {'solve s':>8} {'times':>6} iterations")
    for one in timings:
        times = one.seconds / first.seconds
        print(
            f"{one.solver:8} {one.unknowns:9} {one.setup:8.3f} {one.solve:8.3f} {times:6.1f}"
            f" {one.iterations}"
        )
        if abs(one.modulus / first.modulus - 1) > 1e-8:
            yield f"E of {one.solver} is {one.modulus:.10g} Pa, not {first.modulus:.10g} Pa"
        if one.solver == "mumps" and times < SLOWER:
            yield f"mumps is {times:.1f} times slower, not {SLOWER:g}"


def iterations(size: float) -> Iterator[tuple[str, float, int, int]]:
    """Map, contrast, layers, and most iterations of both loads."""
    settings = [(name, 4.0, layers) for name in MAPS for layers in (1, 2, 4, 6, 12, 24)]
    settings += [("paper", contrast, 12) for contrast in (1e-3, 1e-2, 1e2, 1e3)]
    problem_of = {}
    for name, contrast, layers in settings:
        key = layers, name
        model = PrismModel(size, layers)
        problem = problem_of[key] = model.problem(MAPS[name])
        problem.assemble((MATRIX.stiffness, Phase(MATRIX.modulus * contrast).stiffness))
        solved = solve(problem.solver(model.options), problem.loads(LOADS))
        yield name, contrast, layers, max(solved.iterations)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table, write the CSV; exit 1 at a fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mesh-size", type=float, default=0.15)
    parser.add_argument("--solvers", nargs="*", default=list(SOLVERS), choices=list(SOLVERS))
    parser.add_argument("--iterations", action="store_true")
    options = parser.parse_args(arguments)
    started = perf_counter()
    if options.iterations:
        rows, faults = [], []
        for name, contrast, layers, count in iterations(options.mesh_size):
            print(f"{name:26} contrast {contrast:6g} {layers:3} layers {count:4}", flush=True)
            rows.append({"map": name, "contrast": contrast, "layers": layers, "iterations": count})
            if layers >= 6 and count > MOST:
                faults.append(f"{name} with {layers} layers takes {count} iterations")
        write(rows, RESULTS / "cell_iterations.csv")
    else:
        timings = [timing(solver, options.mesh_size) for solver in options.solvers]
        faults = list(compare(timings))
        rows = [{**asdict(one), "iterations": max(one.iterations)} for one in timings]
        write(rows, RESULTS / "cell_solvers.csv")
    print(f"made in {perf_counter() - started:.0f} s")
    for fault in faults:
        print(fault, file=sys.stderr)
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
