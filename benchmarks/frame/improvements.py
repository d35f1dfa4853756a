"""Gain of each improvement of the Graph Follower on the paper's frame.

The faithful method with one switch turned at a time, all switches together, and the method in
rounds. Errors are against the certified envelope of the same exact trajectories.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from alphacut.frame import envelope
from benchmarks.frame.envelopes import FRAME, INPUTS, RESULTS, worst
from benchmarks.rows import write

FAITHFUL: Mapping[str, Any] = {"method": "graph-follower", "tolerance": 1e-4}
VARIANTS: Mapping[str, Mapping[str, Any]] = {
    "faithful, κ = 1": {**FAITHFUL, "order": 1},
    "faithful, κ = 2": FAITHFUL,
    "+ backward sweep": {**FAITHFUL, "sweeps": 2},
    "+ exact box problem": {**FAITHFUL, "exact": True},
    "+ models of 3 graphs": {**FAITHFUL, "models": 3},
    "+ Taylor-corrected value": {**FAITHFUL, "corrected": True},
    "all of these": {**FAITHFUL, "sweeps": 2, "exact": True, "models": 3, "corrected": True},
    "in rounds (improved)": {"method": "improved-graph-follower", "tolerance": 7e-5},
}


def measured(duration: float, step: float, *, gap: float = 1e-6) -> Iterator[dict[str, Any]]:
    """One row per variant: largest error (m), graphs computed, seconds, on the support (α = 0)."""
    common: dict[str, Any] = {
        "duration": duration,
        "step": step,
        "alpha": (0,),
        "integrator": "exact",
    }
    truth = envelope(FRAME, INPUTS, **(common | {"method": "modal", "certify": gap}))
    for name, options in VARIANTS.items():
        begun = time.perf_counter()
        found = envelope(FRAME, INPUTS, **common, **options)
        yield {
            "variant": name,
            "error_m": worst(found, truth),
            "graphs": found.trajectories,
            "seconds": time.perf_counter() - begun,
        }


def draw(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """A row for each variant: its error to the left, its graphs to the right."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 3.4), layout="constrained")
    both = figure.subplots(1, 2, sharey=True)
    names = [row["variant"] for row in rows]
    colours = ["#D55E00" if name.startswith("faithful") else "#0072B2" for name in names]
    for axes, key, label in zip(
        both,
        ("error_m", "graphs"),
        ("largest error of the envelope, m", "graphs computed"),
        strict=True,
    ):
        values = [row[key] for row in rows]
        axes.hlines(names, min(values) / 3, values, color="#d9d9d9", zorder=1)
        axes.scatter(values, names, color=colours, zorder=2)
        for name, value in zip(names, values, strict=True):
            axes.annotate(
                f"{value:.2g}" if key == "error_m" else f"{value}",
                (value, name),
                (7, -3),
                textcoords="offset points",
                fontsize=8,
            )
        axes.set(xlabel=label, xscale="log", xlim=(min(values) / 3, max(values) * 6))
        axes.grid(axis="x", alpha=0.25)
    both[0].invert_yaxis()
    figure.savefig(path, dpi=150)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print, write the table and the picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--duration", type=float, default=30.0, help="length of the simulation, s (30)"
    )
    parser.add_argument("--step", type=float, default=0.01, help="distance of nodes, s (0.01)")
    parser.add_argument(
        "--out", type=Path, default=RESULTS, help="folder for frame_improvements.csv and .png"
    )
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for row in measured(options.duration, options.step):
        rows.append(row)
        print(
            f"{row['variant']:26s} {row['graphs']:6d} graphs {row['seconds']:8.2f} s  error"
            f" {row['error_m']:.2e} m",
            flush=True,
        )
    write(rows, options.out / "frame_improvements.csv")
    draw(rows, options.out / "frame_improvements.png")


if __name__ == "__main__":
    main()
