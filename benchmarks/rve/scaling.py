"""Time per unknown and iterations over mesh size, layers and contrast; one cell on several ranks.

One process, one thread; set-up and both loads. Then a cell of mesh size 0.04 with its error
estimate, from a start without tables, on each number of ranks, and what the model of docs/theory.md
makes of one rank's times for others; after each run as many loops of arithmetic at once tell
whether the machine is quiet. Writes benchmarks/results/cell_scaling.csv; exit status 1 where a
factor exceeds 1.5, or an E of several ranks differs by more than 1e-12.
"""

from __future__ import annotations

import argparse
import csv
import json
import resource
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from pathlib import Path
from time import perf_counter
from typing import Any

from alphacut.io.files import leave
from alphacut.rve.cell import Phase
from benchmarks.rve.solvers import MATRIX, PAPER_MAP, PARTICLE, Timing, measure

FACTOR = 1.5
SAME = 1e-12
MODELLED = (2, 13, 26, 1000)  # ranks
_LEVELS, _LOADS, _RADII = 13, 2, 10  # radii of a table that are solved at once
_ARITHMETIC = """
from time import perf_counter
started, total = perf_counter(), 0
for k in range(2_000_000):
    total += k
print(perf_counter() - started)
"""
QUIET = 1.1  # crowding that says nothing
PHASES = ("start", "mesh", "assemble", "setup", "solve", "estimate")
CHANGES: Mapping[str, tuple[float, ...]] = {
    "mesh size": (0.15, 0.08, 0.04),
    "layers": (12, 24, 48),
    "contrast": (1e-4, 1e-2, 4.0, 1e2, 1e4),
}


def settings(change: str, value: float, mesh_size: float) -> dict[str, Any]:
    """Settings of `measure` for one point of a series."""
    chosen: dict[str, Any] = {
        "mesh_size": value if change == "mesh size" else mesh_size,
        "layers": int(value) if change == "layers" else 12,
    }
    return chosen | ({"particle": Phase(value * MATRIX.modulus)} if change == "contrast" else {})


def series(
    changes: Mapping[str, Sequence[float]], *, mesh_size: float, repeat: int
) -> Iterator[tuple[str, float, Timing]]:
    """Each change with its values, the fastest of the repetitions."""
    for change, values in changes.items():
        for value in values:
            yield (
                change,
                value,
                measure("theta", repeat=repeat, **settings(change, value, mesh_size)),
            )


def spreads(rows: Sequence[tuple[str, float, Timing]]) -> dict[str, tuple[float, float]]:
    """Largest over smallest time per unknown and iterations, for each change."""
    out = {}
    for change in dict.fromkeys(row[0] for row in rows):
        own = [timing for name, _, timing in rows if name == change]
        pace = [timing.seconds / timing.unknowns for timing in own]
        count = [max(timing.iterations) for timing in own]
        out[change] = max(pace) / min(pace), max(count) / min(count)
    return out


def on_rank(mesh_size: float) -> None:
    """One cell as a rank of mpirun works on it; the first prints a JSON object."""
    from alphacut.rve.prism.model import PrismModel

    # isort: split
    from mpi4py import MPI

    ranks = MPI.COMM_WORLD
    model = PrismModel(mesh_size, parallel=ranks.size > 1, estimate=True)
    result = model.solve(PAPER_MAP, MATRIX, [PARTICLE])[0]
    spent = resource.getrusage(resource.RUSAGE_SELF)
    own = spent.ru_maxrss / 1024, spent.ru_utime + spent.ru_stime
    megabytes, processor = (max(part) for part in zip(*ranks.allgather(own), strict=True))
    if ranks.rank == 0:
        found = {phase: result.seconds[phase] for phase in PHASES[1:]}
        found |= {"unknowns": result.unknowns, "iterations": max(result.iterations)}
        found |= {"E": result.modulus, "megabytes": megabytes, "processor": processor}
        print(json.dumps(found))


def shared(ranks: int, mesh_size: float) -> dict[str, float]:
    """Seconds of one cell by phase and in all, and the most memory and processor of a rank."""
    own = [sys.executable, "-m", __spec__.name, "--cell", str(mesh_size)]
    started = perf_counter()
    done = subprocess.run(
        ["mpirun", "-n", str(ranks), *own], capture_output=True, text=True, check=True
    )
    found: dict[str, float] = {"seconds": perf_counter() - started, **json.loads(done.stdout)}
    found["crowding"] = crowding(ranks)
    found["start"] = found["seconds"] - sum(found[phase] for phase in PHASES[1:])
    return found


def crowding(processes: int) -> float:
    """Seconds of arithmetic that fits a core's own memory, so many at once over one alone.

    1 on a quiet machine; 1.5 and more where what looks like cores shares one, or others work.
    """

    def loops(count: int) -> float:
        own = [sys.executable, "-c", _ARITHMETIC]
        all_of_them = [subprocess.Popen(own, stdout=subprocess.PIPE) for _ in range(count)]
        return max(float(one.communicate()[0]) for one in all_of_them)

    return loops(processes) / loops(1)


def modelled(one: Mapping[str, float], ranks: int) -> dict[str, float]:
    """Seconds by phase on so many ranks from those on one; see docs/theory.md."""
    levels, radii = (ceil(count / ranks) / count for count in (_LEVELS, _RADII))
    share = {
        "start": 1.0,
        "mesh": 1 / ranks,
        "assemble": min(levels + 1 / (_LEVELS - 1), 1.0),
        "setup": levels,
        "solve": levels / min(max(ranks // _LEVELS, 1), _LOADS),
        "estimate": max(radii, levels),
    }
    found = {phase: share[phase] * one[phase] for phase in PHASES}
    return {"seconds": sum(found.values()), **found}


def on_ranks(
    counts: Sequence[int], mesh_size: float, repeat: int = 1
) -> tuple[list[dict[str, Any]], int]:
    """Rows of the table, printed, the fastest of the repetitions each, and the number of faults."""
    rows: list[dict[str, Any]] = []
    runs = [[shared(count, mesh_size) for count in counts] for _ in range(repeat)]  # taken in turn
    for count, same in zip(counts, zip(*runs, strict=True), strict=True):
        found = min(same, key=lambda run: run["seconds"])
        rows.append({"change": "ranks", "value": count, **found})
        phases = "".join(f"  {phase} {found[phase]:.2f}" for phase in PHASES)
        print(
            f"{count} ranks{found['seconds']:>8.2f} s{found['megabytes']:>7.0f} MB"
            f"{found['processor']:>8.2f} s of processor, each at most:{phases}",
            flush=True,
        )
    first, faults = rows[0], 0
    for row in rows[1:]:
        wall, memory = (row[name] / first[name] for name in ("seconds", "megabytes"))
        apart = abs(row["E"] / first["E"] - 1)
        faults += apart > SAME
        print(f"{row['value']} ranks: {wall:.2f} of the time, {memory:.2f} of the memory of")
        print(f"  {first['value']}; E differs by {apart:.1e}")
        if row["crowding"] > QUIET:
            print(
                "  not a quiet machine: so many loops of arithmetic at once take"
                f" {row['crowding']:.2f} of the time of one"
            )
    if first["value"] == 1:
        modelled_rows = [(count, modelled(first, count)) for count in MODELLED]
        rows += [{"change": "ranks, modelled", "value": k, **row} for k, row in modelled_rows]
    return rows, faults


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--mesh-size",
        type=float,
        default=0.15,
        help="where layers and contrast change (default 0.15: 34,000 unknowns)",
    )
    parser.add_argument(
        "--repeat", type=int, default=4, help="repetitions, of which the fastest counts (default 4)"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(__file__).parents[1] / "results" / "cell_scaling.csv",
        help="CSV file to write",
    )
    parser.add_argument("--ranks", default="1,2", help="MPI ranks of one cell (default 1,2)")
    parser.add_argument("--cell", type=float, help="what each rank runs: a cell of this mesh size")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write the CSV file."""
    options = _options(arguments)
    if options.cell:
        on_rank(options.cell)
        leave(0)
    together, faults = on_ranks(
        [int(k) for k in options.ranks.split(",")], CHANGES["mesh size"][-1], options.repeat
    )
    rows = []
    for change, value, timing in series(
        CHANGES, mesh_size=options.mesh_size, repeat=options.repeat
    ):
        rows.append((change, value, timing))
        pace = 1e6 * timing.seconds / timing.unknowns
        print(
            f"{change:10s}{value:>8g}{timing.unknowns:>9} unknowns{max(timing.iterations):>4}"
            f" iterations{pace:>8.2f} us per unknown",
            flush=True,
        )
    _write(options.out, rows, together)
    return int(faults > 0 or _too_slow(rows))


def _write(
    path: Path, rows: Sequence[tuple[str, float, Timing]], together: Sequence[dict[str, Any]]
) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        names = ["change", "value", "unknowns", "iterations", "seconds", *PHASES]
        writer = csv.DictWriter(
            file, [*names, "megabytes", "processor", "crowding"], restval="", extrasaction="ignore"
        )
        writer.writeheader()
        writer.writerows(
            {
                "change": c,
                "value": v,
                "unknowns": t.unknowns,
                "iterations": max(t.iterations),
                "seconds": f"{t.seconds:.4f}",
            }
            for c, v, t in rows
        )
        for row in together:
            exact = {name: row[name] for name in ("change", *names[1:4]) if name in row}
            writer.writerow({k: f"{v:.4f}" for k, v in row.items() if k not in exact} | exact)


def _too_slow(rows: Sequence[tuple[str, float, Timing]]) -> bool:
    counts = [max(timing.iterations) for _, _, timing in rows]
    print(f"iterations from {min(counts)} to {max(counts)}")
    found = spreads(rows)
    for change, (pace, count) in found.items():
        print(
            f"{change}: time per unknown within a factor {pace:.2f}, iterations within {count:.2f}"
        )
    return any(max(pair) > FACTOR for pair in found.values())


if __name__ == "__main__":
    sys.exit(main())
