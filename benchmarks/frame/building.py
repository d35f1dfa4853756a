"""Eight-storey building under its record: envelope time, and the full model.

Trajectories of the exact propagator try to leave the envelope: all corners, then random ones, then,
at some nodes, the best of these climbed further by exact gradients. Bounds are also computed anew
at the parameters that are said to reach them.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from alphacut.frame import Accelerogram, Envelope, Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import corners
from alphacut.fuzzy import Triangular
from benchmarks.frame.envelopes import RESULTS
from benchmarks.rows import write

STEP = 0.01
INPUTS = {
    "E": Triangular(22.8e9, 24.77e9, 25.84e9),
    "m8": Triangular(28e3, 30e3, 34e3),
    "l1": Triangular(3.92, 4.0, 4.08),
    "rayleigh_mass": Triangular(0.4, 0.5, 0.6),
    "rayleigh_stiffness": Triangular(2e-3, 2.5e-3, 3e-3),
}


RECORD = Path(__file__).parents[2] / "cases/building.record.csv"


def recorded() -> Accelerogram:
    """The synthetic record of the building's case."""
    time_, acceleration = np.loadtxt(RECORD, delimiter=",", comments=("#", "t")).T
    return Accelerogram(float(time_[1] - time_[0]), acceleration)


def building() -> StoreyFrame:
    """The frame of cases/building.toml."""
    masses, lengths = [40e3] * 7 + [30e3], [4.0] + [3.2] * 7
    outputs = ("q8", "drift1", "base_shear")
    return StoreyFrame(
        masses, lengths, 24.77e9, 3.2e-3, rayleigh=(0.5, 2.5e-3), ground=recorded(), outputs=outputs
    )


def measured(
    duration: float, alpha: Sequence[float], *, trajectories: int, climbed: int
) -> dict[str, float | str]:
    """Seconds of the envelope, and errors as shares of each output's peak.

    Args:
        duration: Length of the simulation, in s.
        alpha: Levels.
        trajectories: Random ones, besides all corners.
        climbed: Bounds that are climbed towards, and computed anew.

    Returns:
        "seconds", "method", "trajectories" of the envelope; "outside": by how much the full model
        leaves it; "at_bounds": by how much bounds differ from the full model's values at their
        parameters.
    """
    frame = building()
    found = envelope(
        frame,
        INPUTS,
        duration=duration,
        step=STEP,
        alpha=alpha,
        method="auto",
        integrator="exact",
        relative=True,
        tolerance=5e-4,
    )
    flow = UnitFlow(
        LinearFlow(frame, found.parameters, duration, STEP, Exact()), boxes(INPUTS, (0,))
    )
    peak = np.maximum(np.abs(found.lower), np.abs(found.upper)).max((0, 1))
    d, rng = len(INPUTS), np.random.default_rng(7)
    unit = np.vstack([corners(-np.ones(d), np.ones(d)), rng.uniform(-1, 1, (trajectories, d))])
    best, outside = _highest(flow, found, unit, peak)
    outside, wrong = _climbed(
        flow,
        found,
        best,
        peak,
        rng.integers(len(found.time) // 8, len(found.time), climbed),
        outside,
    )
    return {
        "seconds": found.seconds,
        "method": found.method,
        "trajectories": found.trajectories,
        "outside": outside,
        "at_bounds": wrong,
    }


def _highest(flow: UnitFlow, found: Envelope, unit: Array, peak: Array) -> tuple[Array, float]:
    """Points of the highest values, and by how much any value leaves the envelope."""
    top = np.full(found.upper[0].shape, -np.inf)
    best = np.zeros((*top.shape, unit.shape[1]))
    outside = 0.0
    for chunk in np.array_split(unit, -(-len(unit) // 64)):
        values = flow.values(chunk)
        beyond = np.maximum(values - found.upper[0], found.lower[0] - values) / peak
        outside = max(outside, float(beyond.max()))
        pick, high = values.argmax(0), values.max(0)
        best[high > top], top = chunk[pick][high > top], np.maximum(high, top)
    return best, outside


def _climbed(
    flow: UnitFlow, found: Envelope, best: Array, peak: Array, nodes: Array, outside: float
) -> tuple[float, float]:
    """Values that the full model reaches from the best samples at some nodes."""
    wrong = 0.0
    for k, node in enumerate(nodes):
        output = k % len(peak)

        def fall(x: Array, node: int = node, output: int = output) -> tuple[float, Array]:
            jet = flow.taylor(x[None])
            return (
                -float(jet.value[0, node, output]) / peak[output],
                -jet.first[:, 0, node, output] / peak[output],
            )

        reached = -minimize(
            fall, best[node, output], jac=True, bounds=[(-1, 1)] * len(INPUTS), method="L-BFGS-B"
        ).fun
        outside = max(outside, reached - found.upper[0, node, output] / peak[output])
        there = flow.values(flow.boxes.to_unit(found.upper_at[0, node, output])[None])[
            0, node, output
        ]
        wrong = max(wrong, abs(there - found.upper[0, node, output]) / peak[output])
    return outside, wrong


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--duration", type=float, default=20.0, help="length of the simulation, s (20)"
    )
    parser.add_argument(
        "--trajectories",
        type=int,
        default=4000,
        help="random trajectories of the full model (4000)",
    )
    parser.add_argument(
        "--climbed", type=int, default=60, help="bounds that are climbed towards (60)"
    )
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for frame_building.csv")
    options = parser.parse_args(arguments)
    rows: list[Mapping[str, float | str]] = []
    for alpha in ((0.0,), (0.0, 0.25, 0.5, 0.75, 1.0)):
        row = {
            "levels": len(alpha),
            **measured(
                options.duration, alpha, trajectories=options.trajectories, climbed=options.climbed
            ),
        }
        rows.append(row)
        print(
            f"{row['levels']} levels: {row['seconds']:.1f} s, {row['method']},"
            f" {row['trajectories']} eigen-analyses or trajectories; full model outside by"
            f" {row['outside']:.2e}, at the bounds off by {row['at_bounds']:.2e} of the peak",
            flush=True,
        )
    options.out.mkdir(parents=True, exist_ok=True)
    write(rows, options.out / "frame_building.csv")


if __name__ == "__main__":
    main()
