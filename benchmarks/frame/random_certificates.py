"""Exact trajectories against certificates of random frames, half of them under cut, odd records.

Run `python -m benchmarks.frame.random_certificates --help`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame import Envelope, Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.calculus.jet import Array
from alphacut.fuzzy import FuzzyNumber
from benchmarks.frame.random_frames import DURATION, drawn
from benchmarks.rows import write

RESULTS = Path(__file__).parents[1] / "results"
STEPS = (0.05, 0.1)
"""Distances of nodes, in s: two certificates of each frame."""
GAP = 1e-5
"""Gap asked for, as a share of each output's peak."""
CHUNK = 2000
OPTIMA = 100
"""Nodes and outputs whose best parameters are tried, and points next to them."""


def certified(
    frame: StoreyFrame, inputs: Mapping[str, FuzzyNumber], step: float
) -> Envelope | None:
    """A guaranteed envelope; None where there is none."""
    try:
        found = envelope(
            frame,
            inputs,
            duration=DURATION,
            step=step,
            alpha=(0,),
            method="modal",
            certify=GAP,
            relative=True,
        )
    except (ValueError, RuntimeError):
        return None
    return found if found.nature == "guaranteed" else None


def violation(
    found: Envelope, frame: StoreyFrame, inputs: Mapping[str, FuzzyNumber], points: Array
) -> float:
    """Largest distance by which exact trajectories leave the bounds, as a share of the peak.

    Args:
        found: A certificate of the lowest level.
        frame: Its structure.
        inputs: Its fuzzy inputs.
        points: Shares of the supports, shape (S, d); points next to the optima are added.
    """
    flow = LinearFlow(frame, tuple(inputs), DURATION, float(found.time[1]), Exact())
    low, high = np.array([number.cut(0) for number in inputs.values()]).T
    peak = np.maximum(np.abs(found.lower), np.abs(found.upper)).max((0, 1))
    points = np.vstack([points, near_optima(found, low, high)])
    worst = -np.inf
    for part in np.array_split(points, -(-len(points) // CHUNK)):
        values = flow.values(low + (high - low) * part)
        beyond = np.maximum(values.max(0) - found.upper[0], found.lower[0] - values.min(0))
        worst = max(worst, float((beyond / peak).max()))
    return worst


def near_optima(found: Envelope, low: Array, high: Array) -> Array:
    """Parameters of some attained bounds and points next to them, as shares of the supports."""
    rng = np.random.default_rng(len(found.time))
    at = np.concatenate([found.lower_at[0], found.upper_at[0]]).reshape(-1, len(low))
    best = (rng.permutation(at)[:OPTIMA] - low) / (high - low)
    return np.clip(np.vstack([best, best + rng.normal(0, 0.01, best.shape)]), 0, 1)


def disagreement(a: Envelope, b: Envelope) -> float:
    """Distance of the bounds of two certificates where both have nodes, as a share of the peak."""
    every = round(b.time[1] / a.time[1])
    peak = np.maximum(np.abs(a.lower), np.abs(a.upper)).max((0, 1))
    off = [np.abs(getattr(a, side)[:, ::every] - getattr(b, side)) for side in ("lower", "upper")]
    return float((np.maximum(*off) / peak).max())


def points_of(count: int, d: int, seed: int) -> Array:
    """Corners and random points of the unit cube, half of them near its faces, shape (S, d)."""
    rng = np.random.default_rng([seed, 2])
    corners = np.array(np.meshgrid(*[[0.0, 1.0]] * d)).reshape(d, -1).T
    inner = rng.random((count, d))
    edge = rng.random((count, d)) < 0.3
    inner[edge] = np.round(inner[edge])
    return np.vstack([corners, inner])


def judged(seed: int, counts: tuple[int, int]) -> dict[str, Any]:
    """One row: what the certificates of a frame promise, and what trajectories do.

    Args:
        seed: Of the frame.
        counts: Trajectories at all nodes of the fine certificate and of the coarse one.
    """
    frame, inputs = drawn(seed)
    row: dict[str, Any] = {"seed": seed, "storeys": frame.floors, "fuzzy": " ".join(inputs)}
    row |= {"record_step_s": frame.ground.step if frame.ground else 0.0}
    found = [certified(frame, inputs, step) for step in STEPS]
    if found[0] is None or found[1] is None:
        return row | {"violation": np.nan, "disagreement": np.nan, "gap": np.nan}
    fine, coarse = (points_of(count, len(inputs), seed) for count in counts)
    worst = max(
        violation(found[0], frame, inputs, fine), violation(found[1], frame, inputs, coarse)
    )
    gap = max(float(found[k].facts["gap"]) for k in (0, 1))
    return row | {
        "violation": worst,
        "disagreement": disagreement(found[0], found[1]),
        "gap": gap,
    }


def measured(first: int, frames: int, counts: tuple[int, int]) -> Iterator[dict[str, Any]]:
    """One row per frame."""
    for seed in range(first, first + frames):
        yield judged(seed, counts)


def main() -> None:
    """Measures, prints, writes; exit status 1 where a certificate is violated."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first", type=int, default=0, help="first seed (0)")
    parser.add_argument("--frames", type=int, default=100, help="number of frames (100)")
    parser.add_argument(
        "--fine", type=int, default=2000, help=f"trajectories, step {STEPS[0]:g} s (2000)"
    )
    parser.add_argument(
        "--coarse", type=int, default=100_000, help=f"trajectories, step {STEPS[1]:g} s (100000)"
    )
    options = parser.parse_args()
    rows = []
    for row in measured(options.first, options.frames, (options.fine, options.coarse)):
        rows.append(row)
        print(", ".join(f"{key} {value}" for key, value in row.items()), flush=True)
    proved = [row for row in rows if np.isfinite(row["violation"])]
    broken = [row["seed"] for row in proved if row["violation"] > 0]
    apart = [row["seed"] for row in proved if row["disagreement"] > row["gap"]]
    print(f"{len(proved)} of {len(rows)} guaranteed; violated: {broken}; contradicting: {apart}")
    RESULTS.mkdir(exist_ok=True)
    write(rows, RESULTS / "frame_certificates.csv")
    raise SystemExit(bool(broken or apart))


if __name__ == "__main__":
    main()
