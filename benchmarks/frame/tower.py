"""Tower of 50 storeys and 10 bays: reduced envelopes against the full model.

Run `python -m benchmarks.frame.tower --help`.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from alphacut.frame import Accelerogram, Envelope, envelope
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import corners
from alphacut.frame.reduced.beam import BeamFrame
from alphacut.frame.reduced.reduction import AffineStructure, ReducedStructure
from alphacut.fuzzy import Triangular
from benchmarks.frame.envelopes import RESULTS
from benchmarks.rows import write

RECORD = Path(__file__).parents[2] / "cases" / "building.record.csv"
INPUTS = {
    "E_columns": Triangular(28e9, 30e9, 31e9),
    "E_beams": Triangular(28e9, 30e9, 31e9),
    "mass": Triangular(11e3, 12e3, 13e3),
}
STEP = 0.02


def recorded() -> Accelerogram:
    """The synthetic record of the cases."""
    time_, acceleration = np.loadtxt(RECORD, delimiter=",", comments=("#", "t")).T
    return Accelerogram(float(time_[1] - time_[0]), acceleration)


def bounds(reduced: ReducedStructure, duration: float, alpha: tuple[float, ...]) -> Envelope:
    """Envelope of the reduced structure, as the case of the tower asks for it."""
    return envelope(
        reduced,
        INPUTS,
        duration=duration,
        step=STEP,
        alpha=alpha,
        method="modal",
        integrator="exact",
        relative=True,
        tolerance=2e-4,
    )


@dataclass(frozen=True)
class FullModel:
    """The full structure beside an envelope of the reduced one.

    Attributes:
        structure: The full structure.
        found: The envelope to judge.
    """

    structure: AffineStructure
    found: Envelope

    @cached_property
    def peak(self) -> Array:
        """Greatest bound of each output, (m,), in its unit."""
        return np.maximum(np.abs(self.found.lower), np.abs(self.found.upper)).max((0, 1))

    def outputs(self, point: Array) -> Array:
        """Exact outputs (T, m) at the fuzzy inputs `point`."""
        inputs = dict(zip(self.found.parameters, point, strict=True))
        return self.structure.trajectories({**self.structure.parameters, **inputs}, self.found.time)

    def leaves(self, points: Array) -> float:
        """How far the outputs at any of the points (n, d) leave the envelope, over the peak."""
        lower, upper = self.found.lower[0], self.found.upper[0]
        outside = 0.0
        for point in points:
            values = self.outputs(point)
            beyond = np.maximum(values - upper, lower - values).max(0) / self.peak
            outside = max(outside, float(beyond.max()))
        return outside

    def misses(self, nodes: Array) -> float:
        """Greatest difference from the upper bounds at their own points, over the peak."""
        wrong = 0.0
        for node in nodes:
            for output in range(len(self.found.outputs)):
                value = self.outputs(self.found.upper_at[0, node, output])[node, output]
                off = abs(value - self.found.upper[0, node, output]) / self.peak[output]
                wrong = max(wrong, float(off))
        return wrong


def measured(
    frame: BeamFrame, duration: float, alpha: tuple[float, ...], random: int, at_bounds: int
) -> dict[str, float]:
    """Seconds, and errors as shares of each output's peak.

    Args:
        frame: The full structure.
        duration: Length of the simulation, in s.
        alpha: Levels.
        random: Random parameter sets at which the full structure must stay within the envelope,
            besides all corners.
        at_bounds: Bounds recomputed by the full structure at the parameters that are said to reach
            them.

    Returns:
        "outside": by how much the full structure leaves the envelope; "at_bounds": difference of
        bounds; "seconds" of all computing of the envelope, reduction included; "shapes" and
        "analyses".
    """
    begun = time.perf_counter()
    full = frame.structure()
    box = {name: tuple(number.cut(0)) for name, number in INPUTS.items()}
    reduced = full.reduced(box)
    found = bounds(reduced, duration, alpha)
    seconds = time.perf_counter() - begun
    low, high = np.array(list(box.values())).T
    rng, judge = np.random.default_rng(7), FullModel(full, found)
    points = np.vstack([corners(low, high), rng.uniform(low, high, (random, len(low)))])
    return {
        "seconds": seconds,
        "outside": judge.leaves(points),
        "at_bounds": judge.misses(rng.integers(len(found.time) // 4, len(found.time), at_bounds)),
        "shapes": reduced.basis.shape[1],
        "analyses": found.trajectories,
    }


def main() -> None:
    """Measures, prints, writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--random", type=int, default=6, help="random parameter sets of the full structure (6)"
    )
    options = parser.parse_args()
    RESULTS.mkdir(exist_ok=True)
    rows = []
    for alpha in ((0.0,), (0.0, 0.25, 0.5, 0.75, 1.0)):
        row = {
            "levels": len(alpha),
            **measured(BeamFrame(50, 10, ground=recorded()), 20.0, alpha, options.random, 2),
        }
        rows.append(row)
        print(
            f"{row['levels']} levels: {row['seconds']:.1f} s, {row['shapes']:.0f} shapes,"
            f" {row['analyses']:.0f} eigen-analyses; full structure outside by"
            f" {row['outside']:.2e}, at the bounds off by {row['at_bounds']:.2e} of the peak",
            flush=True,
        )
    write(rows, RESULTS / "frame_tower.csv")


if __name__ == "__main__":
    main()
