"""Error over step, stability limits and energy drift of the integrators."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from alphacut.frame import INTEGRATORS, Exact, LinearFlow, StoreyFrame
from alphacut.frame.structures.linear import evaluate
from alphacut.fuzzy.arrays import Array
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
                    "order": method.order,
                    "stability_limit": method.stability_limit,
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


def growth(phase: Array) -> dict[str, Array]:
    """Factor per step on an undamped oscillation at ω h = `phase`."""
    oscillator = StoreyFrame((1.0,), (1.0,), 1 / 24, 1.0)  # ω = 1 rad/s
    matrices, _ = evaluate(oscillator, (), np.zeros((1, 0)), derivatives=False)
    pushes, found = matrices.pushes(ground=False), {}
    for name, method in INTEGRATORS.items():
        maps = (method.step_map(matrices, pushes, [], float(h), 1) for h in phase)
        transfer = np.array([x.transfer.value[0] for x in maps])
        found[name] = np.abs(np.linalg.eigvals(transfer)).max(1)
    return found


def stability_limits(highest: float = 6.0) -> dict[str, float]:
    """The measured limit of ω h, up to `highest`; infinite where no growth is found below it."""
    phase = np.linspace(0.01, highest, 2000)
    return {
        name: float(phase[factor > 1 + 1e-7].min(initial=np.inf))
        for name, factor in growth(phase).items()
    }


def draw(rows: list[dict[str, Any]], drifts: dict[str, Array], steps: int, path: Path) -> None:
    """Error over step size, growth per step, and energy drift."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    phase = np.linspace(0.01, 6, 600)
    factors = growth(phase)
    for colour, name in zip(("#0072b2", "#d55e00", "black"), INTEGRATORS, strict=True):
        line = {"color": colour, "linestyle": ":" if name == "exact" else "-", "label": name}
        own = [row for row in rows if row["integrator"] == name and row["error_m"] > 0]
        points = [row["step_s"] for row in own], [row["error_m"] for row in own]
        axes[0].loglog(*points, marker="o", markersize=4, **line)
        axes[1].plot(phase, factors[name], **line)
        axes[2].loglog(counts(steps), np.maximum(drifts[name], 1e-17), **line)
    axes[0].set(xlabel="step, s", ylabel="largest error in 30 s, m")
    label = "growth of an undamped oscillation per step"
    axes[1].set(xlabel="ω h, rad", ylabel=label, ylim=(0.5, 2))
    axes[2].set(xlabel="steps", ylabel="largest relative change of energy so far")
    for axis in axes:
        axis.grid(alpha=0.3)
    axes[2].legend(fontsize=9)
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
    drifts, limits = drift(options.steps, 0.01), stability_limits()
    for name, change in drifts.items():
        print(
            f"{name:10s} energy drift over {options.steps} steps: {change[-1]:.2e}, stable up to ω"
            f" h = {limits[name]:.3g}"
        )
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
