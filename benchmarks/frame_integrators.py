"""Error over step size, stability limits and energy drift of the integrators: CSV and figure in benchmarks/results/."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.frame_envelopes import FRAME, RESULTS
from frame import INTEGRATORS, Exact, LinearFlow
from frame.linear import evaluate

POINT = np.array([[FRAME.modulus]])


def errors(steps: list[float], duration: float) -> Iterator[dict[str, Any]]:
    """Largest deviation from the exact solution for every integrator and step, in m."""
    for name, method in INTEGRATORS.items():
        for step in steps:
            mine, truth = (LinearFlow(FRAME, ("E",), duration, step, m).values(POINT) for m in (method, Exact()))
            error = float(np.abs(mine - truth).max())
            if np.isfinite(error) and error < 1:
                yield {
                    "integrator": name,
                    "order": method.order,
                    "stability_limit": method.stability_limit,
                    "step_s": step,
                    "error_m": error,
                }


def drift(steps: int, step: float) -> dict[str, float]:
    """Largest relative change of the energy of the undamped frame over `steps` steps, for every integrator."""
    outputs = ("q1", "q2", "q3", "v1", "v2", "v3")
    free = replace(FRAME, dampers=(0, 0, 0), outputs=outputs)
    matrices, _ = evaluate(free, (), np.zeros((1, 0)), derivatives=False)
    K, M = matrices.stiffness.value[0], matrices.mass.value[0]
    found = {}
    for name, method in INTEGRATORS.items():
        state = LinearFlow(free, ("E",), steps * step, step, method).values(POINT)[0]
        energy = 0.5 * np.einsum("ti,ij,tj->t", state[:, :3], K, state[:, :3]) + 0.5 * np.einsum(
            "ti,ij,tj->t", state[:, 3:], M, state[:, 3:]
        )
        found[name] = float(np.abs(energy / energy[0] - 1).max())
    return found


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Error over step size."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(6, 4.5), layout="constrained")
    for name in dict.fromkeys(row["integrator"] for row in rows):
        points = [(row["step_s"], row["error_m"]) for row in rows if row["integrator"] == name and row["error_m"] > 0]
        if points:
            axis.loglog(*zip(*points, strict=True), "o-", label=name)
    axis.set(xlabel="step, s", ylabel="largest error in 30 s, m")
    axis.grid(alpha=0.3)
    axis.legend()
    figure.savefig(path)
    plt.close(figure)


def main() -> None:
    """Measures, prints, writes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=10**6, help="steps of the energy test (1e6)")
    options = parser.parse_args()
    RESULTS.mkdir(exist_ok=True)
    rows = list(errors([0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002], 30.0))
    for row in rows:
        print(f"{row['integrator']:10s} h = {row['step_s']:<6g} error {row['error_m']:.2e} m")
    with (RESULTS / "frame_integrators.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    for name, value in drift(options.steps, 0.01).items():
        print(f"{name:10s} energy drift over {options.steps} steps: {value:.2e}")
    draw(rows, RESULTS / "frame_integrators.svg")


if __name__ == "__main__":
    main()
