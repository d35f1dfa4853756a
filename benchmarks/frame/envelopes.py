"""Envelope error over cost for all methods on the paper's frame, and where they fail.

All four inputs are fuzzy; errors are distances from the proved bounds at α = 0. With `--wide` the
supports are that much wider, where followers begin to miss basins.
Run `python -m benchmarks.frame.envelopes --help`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import matplotlib.pyplot as plt
import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame import GraphFollower, ImprovedFollower, Proof, Sampled, StoreyFrame, envelope
from alphacut.fuzzy import Interval, Triangular
from alphacut.fuzzy.sets.boxes import corners
from benchmarks.rows import write

FRAME = StoreyFrame(
    (20e3, 10e3, 5e3),
    (2.5, 2.7, 2.7),
    24.7561e9,
    1e-6,
    (50, 50, 50),
    "ground",
    (0.01, 0.03, 0.08),
    (0, -0.5, -0.5),
)
"""The paper's frame in the reading that reproduces its numbers."""
INPUTS = {
    "E": Triangular(22.7626e9, 24.7561e9, 25.8312e9),
    **{f"m{i + 1}": Triangular(0.95 * m, m, 1.05 * m) for i, m in enumerate(FRAME.masses)},
}
RESULTS = Path(__file__).parents[1] / "results"
LABELS = {
    "Proof": " (guaranteed)",
    "Vertex": " (corners of the box)",
    "Sampled": " (quasi-random points)",
    "MonteCarlo": " (random points)",
}
"""What the names of methods mean, where they do not say it."""


@dataclass(frozen=True)
class Vertex(Sampled):
    """The corners of each box."""

    name: ClassVar[str] = "vertex"

    def points(self, lower: Array, upper: Array) -> Array:
        """All corners."""
        return corners(lower, upper)


@dataclass(frozen=True)
class MonteCarlo(Sampled):
    """Uniform random points of each box."""

    name: ClassVar[str] = "monte-carlo"

    def points(self, lower: Array, upper: Array) -> Array:
        """As many as are asked for."""
        return np.random.default_rng(self.seed).uniform(lower, upper, (self.samples, len(lower)))


METHODS = [
    *(GraphFollower(tolerance=x) for x in (1e-2, 1e-3, 1e-4)),
    GraphFollower(order=1, tolerance=1e-3),
    *(ImprovedFollower(x) for x in (1e-2, 1e-3, 7e-5)),
    *(Proof(x) for x in (1e-2, 1e-3, 1e-4, 1e-5)),
    Vertex(16),
    *(MonteCarlo(n) for n in (100, 1000, 10000)),
    *(Sampled(n) for n in (128, 1024, 8192)),
]


def measured(duration: float, step: float, wide: float) -> Iterator[dict[str, Any]]:
    """A row for each method: error (m), evaluations and seconds."""
    ends = {name: (x.nominal, *x.cut(0)) for name, x in INPUTS.items()}
    inputs = {
        name: Interval(middle + wide * (low - middle), middle + wide * (high - middle))
        for name, (middle, low, high) in ends.items()
    }
    motion: dict[str, Any] = {"duration": duration, "step": step, "alpha": (0,), "relative": False}
    truth = envelope(FRAME, inputs, method=Proof(1e-6), **motion)
    for method in METHODS:
        begun = time.perf_counter()
        found = envelope(FRAME, inputs, method=method, integrator="exact", **motion)
        ends = ((found.upper, truth.upper), (found.lower, truth.lower))
        yield {
            "method": repr(method),
            "error_m": max(float(np.abs(end - proved).max()) for end, proved in ends),
            "declared_m": float(found.error.max()),
            "evaluations": found.evaluations,
            "seconds": time.perf_counter() - begun,
        }


def line_of(method: str) -> str:
    """Return the name of the line that a method belongs to: its class, and the order if it is 1."""
    name = method.partition("(")[0]
    return f"{name}, order 1" if "order=1" in method else name


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Error over evaluations of the motion, which a proof does not make, and over time."""
    figure, axes = plt.subplots(1, 2, figsize=(13, 5), sharey=True, layout="constrained")
    names = list(dict.fromkeys(line_of(row["method"]) for row in rows))
    for axis, key in zip(axes, ("evaluations", "seconds"), strict=True):
        for place, name in enumerate(names):
            own = [row for row in rows if line_of(row["method"]) == name]
            if key == "evaluations" and name == "Proof":
                continue
            points = [(float(row[key]), max(float(row["error_m"]), 1e-7)) for row in own]
            label = f"{name}{LABELS.get(name, '')}"
            axis.loglog(*zip(*points, strict=True), "o-", color=f"C{place}", label=label)
        axis.grid(alpha=0.3)
    axes[0].set(xlabel="motions computed (Proof bounds without any)", ylabel="largest error in m")
    axes[1].set_xlabel("time of the clock in s")
    figure.suptitle("Envelope of the paper's frame, four fuzzy inputs, 30 s: error of each method")
    axes[1].legend(fontsize=9, loc="lower left")
    for ending in (".svg", ".png"):
        figure.savefig(path.with_suffix(ending), dpi=150)


def main() -> None:
    """Measures, prints, writes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=30.0, help="length of the motion, s")
    parser.add_argument("--step", type=float, default=0.01, help="distance of nodes, s")
    parser.add_argument("--wide", type=float, default=1.0, help="factor on all supports")
    options = parser.parse_args()
    rows = []
    for row in measured(options.duration, options.step, options.wide):
        rows.append(row)
        print(*(f"{key} {value}" for key, value in row.items()), flush=True)
    stem = "frame_envelopes" if options.wide == 1 else f"frame_envelopes_wide_{options.wide:g}"
    write(rows, RESULTS / f"{stem}.csv")
    draw(rows, RESULTS / f"{stem}.svg")


if __name__ == "__main__":
    main()
