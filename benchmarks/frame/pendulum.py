"""Pendulum with six fuzzy parameters against a dense, polished reference.

The reference is kept in benchmarks/results/frame_pendulum_reference.csv; `--reference` makes it
anew (five minutes). Run `python -m benchmarks.frame.pendulum --help`.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame import Envelope, envelope, pendulum
from alphacut.frame.calculus.jet import Array
from alphacut.fuzzy import Triangular
from benchmarks.frame.references.polished_search import PolishedSearch
from benchmarks.frame.references.swing import PARAMETERS, Swing, exact_bounds
from benchmarks.rows import write

RESULTS = Path(__file__).parents[1] / "results"
REFERENCE = RESULTS / "frame_pendulum_reference.csv"
MODAL = {"m": 1.0, "l": 1.0, "d": 0.1, "g": 9.81, "phi_0": 1.5, "omega_0": 0.0}
SUPPORTS = {  # half widths of m, l, φ0 (shares), of d (share) and of φ̇0 (rad/s)
    "narrow": (0.05, 0.2, 0.1),
    "middle": (0.1, 0.4, 0.2),
    "wide": (0.2, 0.8, 0.4),
}
DURATION, STEP = 20.0, 0.01
METHODS: list[tuple[str, str, dict[str, Any]]] = [
    ("auto", "auto", {"tolerance": 0.02, "integrator": "composition4"}),
    ("Graph Follower, improved", "improved-graph-follower", {"tolerance": 0.005, "spread": 256}),
    ("Graph Follower, faithful", "graph-follower", {"tolerance": 0.01, "budget": 3000}),
    ("quasi-Monte Carlo", "quasi-monte-carlo", {"samples": 4096}),
]


def inputs(support: str) -> dict[str, Triangular]:
    """The fuzzy parameters of a support."""
    share, damping, rate = SUPPORTS[support]
    half = {
        "m": share,
        "l": share,
        "d": 0.1 * damping,
        "g": 0.0981,
        "phi_0": 1.5 * share,
        "omega_0": rate,
    }
    return {
        name: Triangular(MODAL[name] - half[name], MODAL[name], MODAL[name] + half[name])
        for name in PARAMETERS
    }


def reference(
    support: str,
    *,
    count: int = round(DURATION / STEP) + 1,
    samples: int = 2**15,
    candidates: int = 16,
    seed: int = 1,
) -> Array:
    """Lower and upper envelope of the force at α = 0 by brute force, shape (count, 2), in N."""
    lower, upper = np.array([number.cut(0) for number in inputs(support).values()]).T
    search = PolishedSearch(Swing(lower, upper, STEP, count), len(PARAMETERS), count)
    return search.run(samples, candidates, seed=seed, promising=2.0).value * [-1, 1]


def kept() -> dict[str, Array]:
    """The reference as kept, shape (2001, 2) per support."""
    with REFERENCE.open() as file:
        rows = list(csv.DictReader(file))
    return {
        name: np.array(
            [[float(row[f"{name}_{side}_N"]) for side in ("lower", "upper")] for row in rows]
        )
        for name in SUPPORTS
    }


def keep(found: dict[str, Array]) -> None:
    """Writes the reference, rounded to 1e-9 N."""
    with REFERENCE.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["time_s", *(f"{name}_{side}_N" for name in found for side in ("lower", "upper"))]
        )
        for k, row in enumerate(np.concatenate(list(found.values()), 1)):
            writer.writerow([f"{k * STEP:.2f}", *(f"{x:.9f}" for x in row)])


def computed(support: str, method: str, **options: Any) -> Envelope:
    """The envelope of a method of the project, α = 0."""
    return envelope(
        pendulum(),
        inputs(support),
        duration=DURATION,
        step=STEP,
        alpha=(0,),
        method=method,
        **options,
    )


def errors(found: Envelope, truth: Array) -> Array:
    """Distance of both bounds of the force from the reference at every node, shape (T, 2), in N."""
    force = found.outputs.index("force")
    return np.abs(np.stack([found.lower[0, :, force], found.upper[0, :, force]], -1) - truth)


def missed_and_declared(found: Envelope, inner: Array) -> tuple[Array, Array]:
    """What bounds of (−force, force) miss of attained ones (N, 2), and what is declared, in N.

    The attained ones are at N of the envelope's nodes, evenly spaced.
    """
    assert found.error is not None
    force, every = found.outputs.index("force"), (len(found.time) - 1) // (len(inner) - 1)
    lower, upper, error = (x[0, ::every, force] for x in (found.lower, found.upper, found.error))
    return inner - np.stack([-lower, upper], -1), error[:, None]


def exact(support: str, *, samples: int, seed: int) -> Array:
    """Attained bounds of (−force, force), exact motion, every second node, (1001, 2), in N."""
    lower, upper = np.array([number.cut(0) for number in inputs(support).values()]).T
    return exact_bounds(lower, upper, DURATION, 2 * STEP, samples=samples, seed=seed, finer=4)


def measured(
    support: str, truth: Array, methods: list[tuple[str, str, dict[str, Any]]]
) -> Iterator[dict[str, Any]]:
    """One row per method: largest error over all nodes (N), trajectories and seconds.

    That of a method with an integrator of its own is from attained bounds of the exact motion.
    """
    for name, method, options in methods:
        found = computed(support, method, **options)
        wrong = errors(found, truth)
        if "integrator" in options:  # the kept reference is of the midpoint rule
            wrong = np.abs(missed_and_declared(found, exact(support, samples=2**12, seed=1))[0])
        yield {
            "support": support,
            "method": name,
            "error_N": float(wrong.max()),
            "trajectories": found.trajectories,
            "seconds": found.seconds,
        }


def main() -> None:
    """Measures, prints, writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--reference", action="store_true", help="make the reference anew first")
    options = parser.parse_args()
    RESULTS.mkdir(exist_ok=True)
    if options.reference:
        keep({name: reference(name) for name in SUPPORTS})
    rows = []
    for support, truth in kept().items():
        for row in measured(support, truth, METHODS):
            rows.append(row)
            cost = f"{row['trajectories']:6d} runs {row['seconds']:7.1f} s"
            print(
                f"{support:7s} {row['method']:26s} {cost}  error {row['error_N']:.2e} N", flush=True
            )
    write(rows, RESULTS / "frame_pendulum.csv")


if __name__ == "__main__":
    main()
