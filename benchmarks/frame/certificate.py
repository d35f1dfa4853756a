"""Certificate of the paper's frame: time, gap, and trajectories that try to leave it.

Run `python -m benchmarks.frame.certificate --help`.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from alphacut.frame import Exact, LinearFlow, envelope
from alphacut.frame.calculus.low_discrepancy import corners
from benchmarks.frame.envelopes import FRAME, INPUTS

CHUNK = 500


def measured(
    duration: float, step: float, gap: float, trajectories: int, workers: int
) -> dict[str, float]:
    """Certify the support (α = 0), then try to leave it with many trajectories.

    Returns:
        "seconds" and "gap" (m) of the certificate, "trajectories" tried, "outside": by how much
        they leave the outer bounds (m; below 0 when they do not), "beyond_inner": by how much they
        pass the attained bounds (m).
    """
    found = envelope(
        FRAME,
        INPUTS,
        duration=duration,
        step=step,
        alpha=(0,),
        method="modal",
        certify=gap,
        workers=workers,
    )
    flow = LinearFlow(FRAME, found.parameters, duration, step, Exact())
    low, high = np.array([number.cut(0) for number in INPUTS.values()]).T
    rng = np.random.default_rng(11)
    begun, tried, outside, beyond = time.perf_counter(), 0, -np.inf, -np.inf
    points = corners(low, high)
    while tried < trajectories:
        values = flow.values(points)
        top, bottom = values.max(0), values.min(0)
        outside = max(
            outside, float(np.maximum(top - found.upper[0], found.lower[0] - bottom).max())
        )
        beyond = max(beyond, float(np.maximum(top - found.upper[0], found.lower[0] - bottom).max()))
        tried += len(points)
        share = rng.random((min(CHUNK, max(1, trajectories - tried)), len(low)))
        points = low + (high - low) * (
            share if (tried // CHUNK) % 2 else (1 - np.cos(np.pi * share)) / 2
        )
    return {
        "seconds": found.seconds,
        "gap": float(found.facts["gap"]),
        "trajectories": tried,
        "outside": outside,
        "beyond_inner": beyond,
        "sampling_seconds": time.perf_counter() - begun,
    }


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--duration", type=float, default=30.0, help="length of the simulation, s (30)"
    )
    parser.add_argument("--step", type=float, default=0.01, help="distance of nodes, s (0.01)")
    parser.add_argument("--gap", type=float, default=1e-6, help="gap, m (1e-6)")
    parser.add_argument(
        "--trajectories",
        type=int,
        default=100_000,
        help="trajectories that try to leave it (100000)",
    )
    parser.add_argument("--workers", type=int, default=2, help="processes (2)")
    options = parser.parse_args()
    for name, value in measured(
        options.duration, options.step, options.gap, options.trajectories, options.workers
    ).items():
        print(f"{name:18s} {value:.6g}")


if __name__ == "__main__":
    main()
