"""Finite elements of the sphere's cell: order, iterations, a million unknowns, ranks, peer.

    ./enter python -m benchmarks.rve.sphere_elements

Judged against the exact series: all moduli at extreme contrasts up to near touching; declared
errors of 100 random cells, and of the fuzzy modulus of cases/paper-3d.toml by a table; the order
of the error of E on meshes ever finer; iterations of conjugate gradients over mesh size and
contrast; a mesh of a million unknowns, all three loads, on two ranks; equal moduli on one rank and
on two; dolfinx_mpc on the whole periodic cell, whose mesh is the eighth's with its mirror images.
Prints a line each, writes sphere_elements.csv to benchmarks/results/; exit status 1 where a line
is broken.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import resource
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from alphacut.rve import Phase
from alphacut.rve.spheres.cubic import hill_average
from alphacut.rve.spheres.series.stiffness import cubic_stiffness
from alphacut.stochastic.theta.truncated_normal import Array

RESULTS = Path(__file__).parents[2] / "results"
RADIUS, MATRIX, SPHERE = 0.6, Phase(20e9), Phase(80e9, 0.2)
ORDER, FACTOR, SECONDS, SAME, AS_PEER = 2.7, 2.0, 180.0, 1e-10, 1e-9
SIZES = (0.2, 0.14, 0.1, 0.07)
CONTRASTS = (1e-2, 1e-1, 1, 10, 1e2)
DRAWS, TOLERANCE, MINUTES = 100, 1e-4, 5.0
RADII, EXTREMES, FINE = (0.1, 0.5, 0.8, 0.95), (1e-3, 1e3), 0.07
MILLION, LARGE, OF_RANKS, OF_PEER = 1_000_000, 0.0268, 0.1, 0.15


@dataclass(frozen=True)
class Line:
    """One measured number and its bound.

    Args:
        what: In words.
        value: As measured.
        bound: What it must keep.
        kept: Whether it does.
    """

    what: str
    value: str
    bound: str
    kept: bool


def young(moduli: Array) -> float:
    """E of Hill's average, in Pa."""
    return float(hill_average(np.asarray(moduli))[0])


def exact(matrix: Phase, sphere: Phase) -> float:
    """E by the series, in Pa."""
    cell = cubic_stiffness(np.array([RADIUS]), matrix, [sphere])
    return young(np.array([cell.bulk[0, 0], cell.deviator[0, 0], cell.shear[0, 0]]))


def order(sizes: Sequence[float] = SIZES) -> Line:
    """Slope of the error of E over the edge length that the unknowns tell, by least squares."""
    from alphacut.rve.spheres.fem.stiffness import OctantCell

    reference = exact(MATRIX, SPHERE)
    solved = [OctantCell(RADIUS, size=h).solve(MATRIX, SPHERE) for h in sizes]
    errors = [abs(young(one.moduli) / reference - 1) for one in solved]
    edges = [one.unknowns ** (-1 / 3) for one in solved]
    slope = float(np.polyfit(np.log(edges), np.log(errors), 1)[0])
    told = ", ".join(f"{one.unknowns}: {e:.1e}" for one, e in zip(solved, errors, strict=True))
    return Line(
        f"order of E; unknowns: error {told}", f"{slope:.2f}", f">= {ORDER}", slope >= ORDER
    )


def iterations(sizes: Sequence[float] = SIZES, contrasts: Sequence[float] = CONTRASTS) -> Line:
    """Largest over smallest number of iterations of any load."""
    from alphacut.rve.spheres.fem.stiffness import OctantCell

    counts: list[int] = []
    for size in sizes:
        cell = OctantCell(RADIUS, size=size)
        for contrast in contrasts:
            counts += cell.solve(MATRIX, Phase(contrast * MATRIX.modulus)).iterations
    ratio = max(counts) / min(counts)
    words = (
        f"iterations {min(counts)} to {max(counts)} over sizes {sizes[0]:g} … {sizes[-1]:g} and"
        f" contrasts {contrasts[0]:g} … {contrasts[-1]:g}: factor"
    )
    return Line(words, f"{ratio:.2f}", f"<= {FACTOR:g}", ratio <= FACTOR)


def one_mesh(size: float) -> None:
    """Solve one mesh on all ranks of this run; the first prints what `on_ranks` reads."""
    from alphacut.rve.petsc import PETSc  # noqa: F401

    # isort: split
    from mpi4py import MPI

    from alphacut.rve.spheres.fem.stiffness import OctantCell

    comm, started = MPI.COMM_WORLD, perf_counter()
    cell = OctantCell(RADIUS, size=size, comm=comm)
    mesh = perf_counter() - started
    solved = cell.solve(MATRIX, SPHERE)
    memory = comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6)
    if comm.rank == 0:
        found = {"moduli": solved.moduli.tolist(), "unknowns": solved.unknowns, "GB": memory}
        found |= {"iterations": solved.iterations, "mesh": mesh, **solved.seconds}
        print(json.dumps(found))


def on_ranks(ranks: int, size: float) -> dict[str, float]:
    """What `one_mesh` prints, and the wall time of the whole run as "total"."""
    start = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = [*start, sys.executable, "-m", "benchmarks.rve.sphere_elements", "--mesh", str(size)]
    started = perf_counter()
    done = subprocess.run(
        command, capture_output=True, text=True, env=dict(os.environ), check=False
    )
    if done.returncode:
        raise RuntimeError(f"{ranks} ranks end with status {done.returncode}: {done.stderr[-500:]}")
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found | {"total": perf_counter() - started}


def same_on_ranks(size: float = OF_RANKS) -> Line:
    """Largest relative difference of the moduli between one rank and two."""
    one, two = (np.array(on_ranks(ranks, size)["moduli"]) for ranks in (1, 2))
    gap = float(np.abs(two / one - 1).max())
    return Line("moduli on 1 and 2 ranks differ by", f"{gap:.1e}", f"<= {SAME:g}", gap <= SAME)


def large(size: float = LARGE, least: int = MILLION) -> Line:
    """Wall time from start to end of the process on two ranks, all three loads."""
    found = on_ranks(2, size)
    off = abs(young(np.array(found["moduli"])) / exact(MATRIX, SPHERE) - 1)
    stages = ", ".join(f"{k} {found[k]:.0f}" for k in ("mesh", "assemble", "setup", "solve"))
    words = (
        f"{found['unknowns']} unknowns, three loads, 2 ranks, {found['GB']:.1f} GB, iterations"
        f" {found['iterations']}, E off by {off:.1e} ({stages} s): seconds"
    )
    kept = found["unknowns"] >= least and found["total"] <= SECONDS
    return Line(words, f"{found['total']:.0f}", f"<= {SECONDS:g}", kept)


def beside_peer(size: float = OF_PEER) -> Line:
    """Largest relative difference from dolfinx_mpc on the whole cell, and the time of both."""
    from alphacut.rve.spheres.fem.stiffness import OctantCell
    from benchmarks.rve.sphere_elements.peer import mpc_stiffness

    own = OctantCell(RADIUS, size=size).solve(MATRIX, SPHERE)
    peer = mpc_stiffness(RADIUS, (MATRIX, SPHERE), size=size, rtol=1e-8)
    gap = float(np.abs(own.moduli / peer.moduli - 1).max())
    seconds = [sum(one.seconds.values()) for one in (own, peer)]
    words = (
        f"dolfinx_mpc with GAMG on the whole cell: {peer.unknowns} unknowns, iterations"
        f" {peer.iterations}, {seconds[1]:.1f} s; here {own.unknowns}, {own.iterations},"
        f" {seconds[0]:.2f} s, {seconds[1] / seconds[0]:.0f} times faster; moduli differ by"
    )
    return Line(words, f"{gap:.1e}", f"<= {AS_PEER:g}", gap <= AS_PEER)


def extremes(size: float = FINE) -> Line:
    """Farthest modulus of extrapolated elements from the series."""
    from benchmarks.rve.sphere_elements.declared import from_series

    far = max(from_series(r, MATRIX, contrast, size)[0] for r in RADII for contrast in EXTREMES)
    words = (
        f"moduli by elements, r {RADII[0]} … {RADII[-1]}, contrasts {EXTREMES[0]:g} and"
        f" {EXTREMES[1]:g}, from the series"
    )
    return Line(words, f"{far:.1e}", f"<= {TOLERANCE:g}", far <= TOLERANCE)


def declared(count: int = DRAWS, seed: int = 1) -> Line:
    """Random cells whose declared error covers the true one."""
    from benchmarks.rve.sphere_elements.declared import random_cells

    draws = random_cells(count, seed)
    ratio = draws.true / draws.declared
    words = (
        f"declared errors of {count} random cells (seed {seed}), {draws.declared.min():.0e} to"
        f" {draws.declared.max():.0e}, true over declared {np.median(ratio):.2f} in the median and"
        f" {ratio.max():.2f} at most: covered"
    )
    return Line(words, f"{draws.covered}", f"{count}", draws.covered == count)


def fuzzy(tolerance: float = TOLERANCE, workers: int = 2) -> Line:
    """Wall time of the fuzzy modulus by a table of elements, and its errors."""
    from benchmarks.rve.sphere_elements.declared import fuzzy_modulus

    found = fuzzy_modulus(tolerance, workers)
    words = (
        f"fuzzy modulus of paper-3d by a table, five levels, {workers} workers, declared error"
        f" {found.declared:.1e}, true {found.true:.1e}: minutes"
    )
    minutes = found.seconds / 60
    kept = found.true <= found.declared <= tolerance and minutes <= MINUTES
    return Line(words, f"{minutes:.2f}", f"<= {MINUTES:g}, error <= {tolerance:g}", kept)


def lines(seed: int = 1) -> Iterator[Line]:
    """All of them, one after the other."""
    yield extremes()
    yield declared(seed=seed)
    yield fuzzy()
    yield order()
    yield iterations()
    yield same_on_ranks()
    yield beside_peer()
    yield large()


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, judge, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mesh", type=float, help="solve this mesh size on all ranks, no more")
    parser.add_argument("--seed", type=int, default=1, help="seed of the random cells")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    options = parser.parse_args(arguments)
    if options.mesh is not None:
        one_mesh(options.mesh)
        return 0
    found = []
    for line in lines(options.seed):
        found.append(line)
        sign = "" if line.kept else "  BROKEN"
        print(f"{line.what} {line.value} (bound {line.bound}){sign}", flush=True)
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "sphere_elements.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["what", "value", "bound", "kept"])
        writer.writerows([line.what, line.value, line.bound, line.kept] for line in found)
    return 0 if all(line.kept for line in found) else 1


if __name__ == "__main__":
    sys.exit(main())
