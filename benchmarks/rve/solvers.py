"""Solvers of the product-space cell: set-up, solves and iterations; `make bench-solver`.

    ./enter python -m benchmarks.rve.solvers
    ./enter python -m benchmarks.rve.solvers --iterations

The first compares PETSc options with the default ones on the paper's cell and exits with 1 where E
differs or MUMPS on the system of all levels is not 8 times slower. Options that do not converge, or
that this build of PETSc has not, are told as such. The second prints iterations of the
default over maps, contrasts and layers, and exits with 1 above 25 from 6 layers on.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from math import nan
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from alphacut.base.errors import RefusedError
from alphacut.rve.cell.cell import LOADS, Phase
from alphacut.rve.fenicsx import PETSc
from alphacut.rve.prism.model import PrismModel
from alphacut.rve.prism.problem import PrismProblem
from alphacut.rve.result.result import effective_modulus
from alphacut.rve.solver.krylov import ConvergenceError, Solutions, SolverOptions, solve
from alphacut.stochastic import HermiteMap, RadiusMap
from benchmarks.rows import write

PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)  # nominal values of the paper, section 4.1
MATRIX, PARTICLE = Phase(20e9), Phase(80e9)
SAME = 1e-8  # relative, of E by any options that converge
SLOWER = 8.0  # at least, MUMPS on the system of all levels
LARGE = 30_000  # unknowns from which it is: h .15 with 12 layers
LONG = 3.0  # seconds of a run that is not repeated
MOST = 25  # iterations from 6 layers on
RESULTS = Path(__file__).parents[1] / "results"
DIRECT = {"ksp_type": "preonly", "pc_type": "cholesky"}
SPLIT = {"pc_type": "fieldsplit", "pc_fieldsplit_block_size": "2"}
SOLVERS = {  # PETSc options without prefix
    "theta": {},
    "theta, GAMG": {"level_pc_type": "gamg"},
    "theta, hypre": {"level_pc_type": "hypre"},
    "theta, CG by GAMG": {
        "level_pc_type": "gamg",
        "level_ksp_type": "cg",
        "level_ksp_rtol": "1e-9",
    },
    "GAMG": {"pc_type": "gamg", "pc_gamg_threshold": "0.01"},
    "hypre": {"pc_type": "hypre", "pc_hypre_boomeramg_nodal_coarsen": "6"},
    "ICC": {"pc_type": "icc"},
    "fieldsplit, GAMG": SPLIT
    | {"pc_fieldsplit_type": "additive"}
    | {f"fieldsplit_{k}_pc_type": "gamg" for k in (0, 1)},
    "fieldsplit, hypre": SPLIT
    | {"pc_fieldsplit_type": "additive"}
    | {f"fieldsplit_{k}_pc_type": "hypre" for k in (0, 1)},
    "MUMPS": DIRECT | {"pc_factor_mat_solver_type": "mumps"},
    "SuperLU": {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "superlu"},
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
    """PETSc options on one system; numbers are NaN where they do not converge.

    Args:
        solver: Name of the options.
        unknowns: Of the system.
        setup: Processor seconds.
        solve: Processor seconds of both loads.
        iterations: Most of both loads, 0 where they do not converge.
        modulus: E, in Pa.
        outcome: "converges", or why not.
    """

    solver: str
    unknowns: int
    setup: float
    solve: float
    iterations: int
    modulus: float
    outcome: str = "converges"

    @property
    def seconds(self) -> float:
        """Seconds of set-up and solves."""
        return self.setup + self.solve


def timing(solver: str, size: float, layers: int = 12, repeat: int = 3) -> Timing:
    """The fastest of a few runs, each with its set-up; one where it does not converge."""
    model = PrismModel(size, layers, estimate=False)
    problem = model.problem(PAPER)
    stiffness = [MATRIX.stiffness, PARTICLE.stiffness]
    problem.assemble(stiffness)
    loads, runs = problem.loads(LOADS), []
    try:
        for _ in range(repeat):
            runs.append(run(problem, solver, loads))
            if sum(runs[-1][:2]) > LONG:
                break
    except (ConvergenceError, RefusedError) as error:
        why = "does not converge" if isinstance(error, ConvergenceError) else "is not in PETSc"
        return Timing(solver, problem.numbering.size, nan, nan, 0, nan, why)
    setup, solving, solved = min(runs, key=lambda one: one[0] + one[1])
    means = problem.slice_strains(LOADS, solved.vectors)
    stress = np.tensordot(means.weights, means.stress(stiffness), axes=1)
    modulus, _ = effective_modulus(stress[0, 0], stress[2, 1])
    most = max(solved.iterations)
    return Timing(solver, problem.numbering.size, setup, solving, most, float(modulus))


def run(
    problem: PrismProblem, solver: str, loads: list[PETSc.Vec]
) -> tuple[float, float, Solutions]:
    """Processor seconds of set-up and of the solves, and the solutions.

    Raises:
        ConvergenceError: The options do not converge.
        RefusedError: This build of PETSc has them not.
    """
    started = process_time()
    ksp = problem.solver(SolverOptions(SOLVERS[solver]), problem.matrix)
    built = process_time()
    solutions = solve(ksp, loads)
    return built - started, process_time() - built, solutions


def compare(timings: Iterable[Timing]) -> Iterator[str]:
    """Print the table line by line; gives each fault in a sentence."""
    first = None
    print(f"{'options':18} {'unknowns':>9} {'setup s':>8} {'solve s':>8} {'times':>6} iterations")
    for row in timings:
        first = first or row
        if row.outcome != "converges":
            print(f"{row.solver:18} {row.unknowns:9} {row.outcome}", flush=True)
            continue
        times = row.seconds / first.seconds
        print(
            f"{row.solver:18} {row.unknowns:9} {row.setup:8.3f} {row.solve:8.3f} {times:6.1f}"
            f" {row.iterations:10}",
            flush=True,
        )
        if abs(row.modulus / first.modulus - 1) > SAME:
            yield f"E of {row.solver} is {row.modulus:.10g} Pa, not {first.modulus:.10g} Pa"
        if row.solver == "MUMPS" and row.unknowns >= LARGE and times < SLOWER:
            yield f"MUMPS is {times:.1f} times slower, not {SLOWER:g}"


def iterations(size: float) -> Iterator[tuple[str, float, int, int]]:
    """Map, contrast, layers, and most iterations of both loads."""
    settings = [(name, 4.0, layers) for name in MAPS for layers in (1, 2, 4, 6, 12, 24)]
    settings += [("paper", contrast, 12) for contrast in (1e-3, 1e-2, 1e2, 1e3)]
    for name, contrast, layers in settings:
        model = PrismModel(size, layers)
        problem = model.problem(MAPS[name])
        particle = Phase(MATRIX.modulus * contrast)
        problem.assemble([MATRIX.stiffness, particle.stiffness])
        solved = solve(problem.solver(model.options, problem.matrix), problem.loads(LOADS))
        yield name, contrast, layers, max(solved.iterations)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table, write the CSV; exit 1 at a fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mesh-size", type=float, default=0.15)
    parser.add_argument("--layers", type=int, default=12)
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
        timings = [timing(x, options.mesh_size, options.layers) for x in options.solvers]
        faults = list(compare(timings))
        rows = [asdict(one) for one in timings]
        write(rows, RESULTS / "cell_solvers.csv")
    print(f"made in {perf_counter() - started:.0f} s")
    for fault in faults:
        print(fault, file=sys.stderr)
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
