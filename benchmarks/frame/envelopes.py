"""Envelope error over cost for all methods on the paper's frame.

Run `python -m benchmarks.frame.envelopes --help`, or from `make charts`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from alphacut.frame.methods.sampling import sample

from alphacut.frame import Envelope, Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.fuzzy import General, Reduced, Triangular, levels
from alphacut.fuzzy.sets.boxes import Domain
from benchmarks.frame.references.alpha_cut_optimisation import CutOptimisation
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
TRANSFORMATIONS = {
    "transformation, reduced": (Reduced(), (2, 4, 8)),
    "transformation, general": (General(), (2, 4, 6)),
}
OPTIMISERS = ("L-BFGS-B", "differential_evolution", "shgo", "direct")
PER_NODE = 2
"""Nodes at which SciPy's optimisers run; their cost is extrapolated to all nodes and outputs."""
METHODS: list[tuple[str, str, dict[str, Any]]] = [
    *[("Graph Follower, faithful", "graph-follower", {"tolerance": t}) for t in (1e-2, 1e-3, 1e-4)],
    *[
        ("Graph Follower, improved", "improved-graph-follower", {"tolerance": t})
        for t in (1e-2, 1e-3, 7e-5)
    ],
    *[("modal", "modal", {"tolerance": t}) for t in (1e-2, 1e-4, 1e-6)],
    *[("guaranteed", "modal", {"certify": gap}) for gap in (1e-2, 1e-3, 1e-4, 1e-5)],
    ("vertex", "vertex", {}),
    *[("Monte Carlo", "monte-carlo", {"samples": n}) for n in (100, 1000, 10000)],
    *[("quasi-Monte Carlo", "quasi-monte-carlo", {"samples": n}) for n in (128, 1024, 8192)],
]


def transformed(plan: General | Reduced, steps: int, duration: float, step: float) -> Envelope:
    """Envelope at α = 0 of a transformation method with `steps` steps of membership."""
    cuts = boxes(INPUTS, (0,))
    points = cuts.to_unit(plan.points(Domain(INPUTS, levels(steps))).points)
    return sample(
        UnitFlow(LinearFlow(FRAME, cuts.names, duration, step, Exact()), cuts),
        lambda lower, upper: points,
        "transformation",
    )


def optimised(
    truth: Envelope, duration: float, step: float, optimiser: str, nodes: int
) -> dict[str, Any]:
    """Error of a SciPy optimiser at a few nodes of the third floor."""
    cuts, output = boxes(INPUTS, (0,)), 2
    flow = UnitFlow(LinearFlow(FRAME, cuts.names, duration, step, Exact()), cuts)
    error, calls, begun = 0.0, 0, time.perf_counter()
    chosen = np.linspace(0, len(flow.time) - 1, nodes + 1).astype(int)[1:]
    for node in chosen:
        short = UnitFlow(
            LinearFlow(FRAME, cuts.names, float(flow.time[node]), float(flow.time[node]), Exact()),
            cuts,
        )
        for side, bound in ((1, truth.upper), (-1, truth.lower)):
            found, _, used = CutOptimisation(optimiser).bound(
                short, 0, node=1, output=output, side=side
            )
            error, calls = (
                max(error, abs(float(found) - float(bound[0, node, output]))),
                calls + used,
            )
    share = len(flow.time) * len(flow.outputs) / nodes
    spent = time.perf_counter() - begun
    return {
        "method": f"SciPy {optimiser}",
        "error_m": error,
        "trajectories": round(share * calls),
        "seconds": share * spent,
    }


def worst(found: Envelope, truth: Envelope) -> float:
    """Largest deviation of an envelope from the certified one, in m."""
    return float(
        max(np.abs(found.upper - truth.upper).max(), np.abs(found.lower - truth.lower).max())
    )


def measured(
    duration: float,
    step: float,
    gap: float,
    methods: list[tuple[str, str, dict[str, Any]]],
    optimisers: Sequence[str] = OPTIMISERS,
) -> Iterator[dict[str, Any]]:
    """One row per method: error (m), trajectories and seconds on the support (α = 0)."""
    common: dict[str, Any] = {
        "duration": duration,
        "step": step,
        "alpha": (0,),
        "integrator": "exact",
    }
    truth = envelope(FRAME, INPUTS, method="modal", certify=gap, **common)
    yield {
        "method": "guaranteed",
        "error_m": gap,
        "trajectories": truth.trajectories,
        "seconds": truth.seconds,
    }
    for name, method, options in methods:
        begun = time.perf_counter()
        found = envelope(FRAME, INPUTS, method=method, **options, **common)
        seconds = time.perf_counter() - begun
        yield {
            "method": name,
            "error_m": worst(found, truth),
            "trajectories": found.trajectories,
            "seconds": seconds,
        }
    for name, (plan, efforts) in TRANSFORMATIONS.items():
        for steps in efforts:
            found = transformed(plan, steps, duration, step)
            yield {
                "method": name,
                "error_m": worst(found, truth),
                "trajectories": found.trajectories,
                "seconds": found.seconds,
            }
    for optimiser in optimisers:
        yield optimised(truth, duration, step, optimiser, PER_NODE)


LOOKS = {  # colours that all readers tell apart (Okabe and Ito), and markers besides
    "Graph Follower, faithful": ("#e69f00", "o"),
    "Graph Follower, improved": ("#d55e00", "o"),
    "modal": ("#0072b2", "s"),
    "guaranteed": ("black", "*"),
    "vertex": ("#999999", "v"),
    "transformation, reduced": ("#cc79a7", "v"),
    "transformation, general": ("#cc79a7", "^"),
    "Monte Carlo": ("#56b4e9", "x"),
    "quasi-Monte Carlo": ("#009e73", "+"),
    "SciPy L-BFGS-B": ("#7f7f00", "1"),
    "SciPy differential_evolution": ("#7f7f00", "2"),
    "SciPy shgo": ("#7f7f00", "3"),
    "SciPy direct": ("#7f7f00", "4"),
}


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Error over trajectories and over time."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(13, 5), sharey=True, layout="constrained")
    for axis, key, label in (
        (axes[0], "trajectories", "trajectories or eigen-analyses"),
        (axes[1], "seconds", "wall time, s"),
    ):
        for name in dict.fromkeys(row["method"] for row in rows):
            points = [
                (row[key], max(row["error_m"], 1e-7)) for row in rows if row["method"] == name
            ]
            colour, marker = LOOKS[name]
            axis.loglog(
                *zip(*points, strict=True), color=colour, marker=marker, markersize=8, label=name
            )
        axis.set_xlabel(label)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("largest envelope error, m")
    figure.legend(*axes[1].get_legend_handles_labels(), loc="outside right center", fontsize=9)
    for ending in (".svg", ".png"):
        figure.savefig(path.with_suffix(ending), dpi=150)
    plt.close(figure)


def main() -> None:
    """Measures, prints, writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--duration", type=float, default=30.0, help="length of the simulation, s (30)"
    )
    parser.add_argument("--step", type=float, default=0.01, help="distance of nodes, s (0.01)")
    parser.add_argument(
        "--gap", type=float, default=1e-6, help="gap of the certified reference, m (1e-6)"
    )
    options = parser.parse_args()
    RESULTS.mkdir(exist_ok=True)
    rows = []
    for row in measured(options.duration, options.step, options.gap, METHODS):
        rows.append(row)
        print(
            f"{row['method']:28s} {row['trajectories']:8d} runs {row['seconds']:8.2f} s  error"
            f" {row['error_m']:.2e} m",
            flush=True,
        )
    write(rows, RESULTS / "frame_envelopes.csv")
    draw(rows, RESULTS / "frame_envelopes.svg")


if __name__ == "__main__":
    main()
