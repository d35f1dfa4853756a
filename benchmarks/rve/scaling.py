"""Time per unknown and iterations over mesh size, layers and contrast.

One process, one thread; set-up and both loads. Writes benchmarks/results/cell_scaling.csv; exit
status 1 where a factor exceeds 1.5.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from alphacut.rve.cell import Phase
from benchmarks.rve.solvers import MATRIX, Timing, measure

FACTOR = 1.5
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write the CSV file."""
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
    options = parser.parse_args(arguments)
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
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with options.out.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["change", "value", "unknowns", "iterations", "seconds"])
        writer.writerows(
            [c, v, t.unknowns, max(t.iterations), f"{t.seconds:.4f}"] for c, v, t in rows
        )
    counts = [max(timing.iterations) for _, _, timing in rows]
    print(f"iterations from {min(counts)} to {max(counts)}")
    found = spreads(rows)
    for change, (pace, count) in found.items():
        print(
            f"{change}: time per unknown within a factor {pace:.2f}, iterations within {count:.2f}"
        )
    return int(any(max(pair) > FACTOR for pair in found.values()))


if __name__ == "__main__":
    sys.exit(main())
