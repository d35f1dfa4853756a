"""Error over step and energy drift of the integrators."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame import INTEGRATORS, Exact, LinearFlow
from alphacut.frame.structures.linear import evaluate
from benchmarks.frame.envelopes import FRAME, RESULTS
from benchmarks.rows import write

POINT = np.array([[FRAME.modulus]])


def errors(steps: list[float], duration: float) -> Iterator[dict[str, Any]]:
    """Largest deviation from the exact solution for every integrator and step, in m."""
    for name, method in INTEGRATORS.items():
        for step in steps:
            mine, truth = (
                LinearFlow(FRAME, ("E",), duration, step, m).values(POINT)
                for m in (method, Exact())
            )
            error = float(np.abs(mine - truth).max())
            if np.isfinite(error) and error < 1:
                yield {
                    "integrator": name,
                    "step_s": step,
                    "error_m": error,
                }


def drift(steps: int, step: float) -> dict[str, Array]:
    """Largest energy change so far of the undamped frame, at the steps `counts(steps)`."""
    outputs = ("q1", "q2", "q3", "v1", "v2", "v3")
    free = replace(FRAME, dampers=(0, 0, 0), outputs=outputs)
    matrices, _ = evaluate(free, (), np.zeros((1, 0)), derivatives=False)
    K, M = matrices.stiffness.value[0], matrices.mass.value[0]
    found = {}
    for name, method in INTEGRATORS.items():
        state = LinearFlow(free, ("E",), steps * step, step, method).values(POINT)[0]
        energy = 0.5 * (
            (state[:, :3] @ K * state[:, :3]).sum(1) + (state[:, 3:] @ M * state[:, 3:]).sum(1)
        )
        found[name] = np.maximum.accumulate(np.abs(energy / energy[0] - 1))[counts(steps)]
    return found


def counts(steps: int) -> Array:
    """Numbers of steps at which the drift is told, evenly spread in their logarithm."""
    return np.unique(np.geomspace(1, steps, 40).astype(int))


def draw(rows: list[dict[str, Any]], drifts: dict[str, Array], steps: int, path: Path) -> None:
    """Error over step size, and energy drift."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    for colour, name in zip(("#0072b2", "black"), INTEGRATORS, strict=True):
        line = {"color": colour, "linestyle": ":" if name == "exact" else "-", "label": name}
        own = [row for row in rows if row["integrator"] == name and row["error_m"] > 0]
        points = [row["step_s"] for row in own], [row["error_m"] for row in own]
        axes[0].loglog(*points, marker="o", markersize=4, **line)
        axes[1].loglog(counts(steps), np.maximum(drifts[name], 1e-17), **line)
    axes[0].set(xlabel="step, s", ylabel="largest error in 30 s, m")
    axes[1].set(xlabel="steps", ylabel="largest relative change of energy so far")
    for axis in axes:
        axis.grid(alpha=0.3)
    axes[1].legend(fontsize=9)
    error = "error of displacements (the exact propagator has none)"
    figure.suptitle(f"The paper's frame: {error}, energy undamped")
    for ending in (".svg", ".png"):
        figure.savefig(path.with_suffix(ending), dpi=150)


def main() -> None:
    """Measures, prints, writes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=10**6, help="steps of the energy test (1e6)")
    options = parser.parse_args()
    rows = list(errors([0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002], 30.0))
    for row in rows:
        print(f"{row['integrator']:10s} h = {row['step_s']:<6g} error {row['error_m']:.2e} m")
    drifts = drift(options.steps, 0.01)
    for name, change in drifts.items():
        print(f"{name:10s} energy drift over {options.steps} steps: {change[-1]:.2e}")
    write(rows, RESULTS / "frame_integrators.csv")
    drifted = [
        {"integrator": n, "steps": int(k), "energy_change": x}
        for n, change in drifts.items()
        for k, x in zip(counts(options.steps), change, strict=True)
    ]
    write(drifted, RESULTS / "frame_integrators_energy.csv")
    draw(rows, drifts, options.steps, RESULTS / "frame_integrators.png")


if __name__ == "__main__":
    main()
