"""Cost over size: unknowns of a cell, storeys, fuzzy inputs, records, workers.

    ./enter python -m benchmarks.costs

Processor time of a first computation with code compiled, and the exponent p in seconds ~ size^p by
least squares of the logarithms, of three points or more. For workers it is the clock that counts.
Storeys have five inputs, inputs eight storeys, records three inputs, workers eleven records.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame import DualProof, StoreyFrame, envelope
from alphacut.frame.records.history import Accelerogram
from alphacut.fuzzy import Triangular
from alphacut.rve.prism.model import PrismModel
from benchmarks.rows import write
from benchmarks.rve.solvers import MATRIX, PAPER, PARTICLE
from benchmarks.synthetic_record import SyntheticRecord, write_suite

RESULTS = Path(__file__).parent / "results"
MESH_SIZES = (0.15, 0.11, 0.08, 0.055, 0.04)  # 34,000 to 385,000 unknowns
STOREYS, INPUTS, RECORDS, WORKERS = (3, 6, 12, 24), (2, 4, 8, 12, 17), (1, 4, 11, 44), (1, 2)
OF = {
    "unknowns": "of the paper's cell",
    "storeys": "of a frame, five inputs",
    "inputs": "of eight storeys",
    "records": "of a suite, three inputs",
    "workers": "for eleven records",
}
"""What each size is of, for the axes."""
MIN_POINTS = 3
"""Fewest points that an exponent is fitted to."""
SUITE = """
title = "Two storeys under records"
stages = ["envelope"]
[frame]
stiffness = ["90 MN/m ± 6 %", "80 MN/m ± 6 %"]
masses = ["50 t", "40 t"]
damping_ratio = "[3, 4, 5] %"
outputs = ["drift1", "drift2"]
[records]
files = ["records/*.AT2"]
[envelope]
fuzzy = ["k", "zeta"]
alpha = [0, 1]
duration = "8 s"
step = "0.02 s"
"""
Row = dict[str, Any]


def cells() -> Iterator[Row]:
    """First solves of the paper's cell by product-space elements."""
    PrismModel(1.0, estimate=False).solve(PAPER, MATRIX, [PARTICLE])  # loads what all need
    for size in MESH_SIZES:
        begun = time.process_time()
        (result,) = PrismModel(size, estimate=False).solve(PAPER, MATRIX, [PARTICLE])
        seconds = time.process_time() - begun
        yield {"size of": "unknowns", "size": result.unknowns, "seconds": seconds}


def frames() -> Iterator[Row]:
    """Dual bounds of a frame's envelopes, at five inputs by storeys, then by inputs."""
    for kind, storeys, inputs in (
        *(("storeys", count, 5) for count in (3, *STOREYS)),
        *(("inputs", 8, count) for count in (2, *INPUTS)),
    ):
        record = SyntheticRecord(duration=4.0)
        numbers = {f"k{z}": 9e7 for z in range(1, storeys + 1)}
        numbers |= {f"m{z}": 5e4 for z in range(1, storeys + 1)}
        chosen = ["zeta", *np.ravel([[f"k{z}", f"m{z}"] for z in range(1, storeys + 1)])][:inputs]
        frame = StoreyFrame(
            masses=[5e4] * storeys,
            stiffness=[9e7] * storeys,
            damping_ratio=0.04,
            outputs=("q1", f"q{storeys}"),
            ground=Accelerogram(record.step, record.acceleration()),
        )
        fuzzy = {x: Triangular(*frame.parameters[x] * np.array([0.95, 1, 1.05])) for x in chosen}
        begun = time.process_time()
        envelope(frame, fuzzy, DualProof(), duration=4.0, step=0.02, alpha=(0, 1))
        size = storeys if kind == "storeys" else inputs
        yield {"size of": kind, "size": size, "seconds": time.process_time() - begun}


def suites() -> Iterator[Row]:
    """Runs of a suite by records, then by worker processes, whose clock counts."""
    runs = [("records", count, 1) for count in (1, *RECORDS)]
    for kind, records, workers in (*runs, *(("workers", RECORDS[-2], count) for count in WORKERS)):
        with tempfile.TemporaryDirectory() as folder:
            write_suite(Path(folder, "records"), records, 8.0)
            Path(folder, "suite.toml").write_text(SUITE, encoding="utf-8")
            words = ("run", f"{folder}/suite.toml", f"--out={folder}/results", "--no-figures")
            command = (sys.executable, "-m", "alphacut", *words, f"--workers={workers}", "--quiet")
            before, begun = os.times(), time.monotonic()
            subprocess.run(command, check=True)
            after, clock = os.times(), time.monotonic() - begun
        used = np.subtract(after, before)[2:4].sum()  # user and system, of child processes
        size, seconds = (workers, clock) if kind == "workers" else (records, used)
        yield {"size of": kind, "size": size, "seconds": seconds}


def draw(rows: Sequence[Row]) -> None:
    """Draw seconds over size, a panel for each kind of size with its exponent."""
    import matplotlib.pyplot as plt

    kinds = list(dict.fromkeys(row["size of"] for row in rows))
    figure, panels = plt.subplots(1, len(kinds), figsize=(15, 3.6), layout="constrained")
    for axes, kind in zip(panels, kinds, strict=True):
        line = [row for row in rows if row["size of"] == kind]
        size, seconds = (np.array([row[key] for row in line], float) for key in ("size", "seconds"))
        if len(size) >= MIN_POINTS:
            power = float(np.polyfit(np.log(size), np.log(seconds), 1)[0])
            words = f"time ~ {kind}$^{{{power:.2f}}}$"
        else:
            words = f"{seconds[-1] / seconds[0]:.2f} of the time of {size[0]:g}"
        print(f"{kind}: {words}")
        axes.loglog(size, seconds, "o-")
        axes.set(xlabel=f"{kind} {OF[kind]}", title=words)
        axes.set_xticks(size, [f"{x:,.0f}" for x in size], rotation=30)
        axes.set_yticks(seconds, [f"{x:.2g}" for x in seconds])
        axes.minorticks_off()
        axes.grid(alpha=0.25)
    panels[0].set_ylabel("processor time in s")
    panels[-1].set_ylabel("time of the clock in s")
    figure.suptitle("Time of a first computation over its size")
    for suffix in (".svg", ".png"):
        figure.savefig(RESULTS / f"costs{suffix}", dpi=160)


def main() -> None:
    """Print the table, write it, and draw it."""
    costs: dict[tuple[str, int], Row] = {}
    for source in (cells, frames, suites):
        for row in source():
            costs[row["size of"], row["size"]] = row  # the first, repeated, loads compiled code
            print(row["size of"], row["size"], f"{row['seconds']:.2f} s", flush=True)
    write([*costs.values()], RESULTS / "costs.csv")
    draw([*costs.values()])


if __name__ == "__main__":
    main()
