"""Frames in plan under two components from all directions: do proofs hold, and what do they cost?

Random frames in plan, with rigid floors that move along x and y and turn, stand on frames along x
and along y that are not alike. The inputs are the stiffnesses of these frames, the same in all
storeys, and the damping ratio. Bounds of a corner's drift over all angles of incidence are compared
with exact responses at random angles and inputs, of which none may lie above.

    python -m benchmarks.frame.plan_frames                  30 frames, each against 2000 responses
    python -m benchmarks.frame.plan_frames --cost           8 storeys, 5 inputs, a record of 20 s
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame import Accelerogram, Exact, LinearFlow, MatrixStructure, over_angles
from alphacut.fuzzy import FuzzyNumber, Interval
from benchmarks.rows import write
from benchmarks.synthetic_record import SyntheticRecord

RESULTS = Path(__file__).parents[1] / "results"
STEP = 0.005
"""Distance of the time nodes, in s, of frames of few storeys, whose periods begin at 0.1 s."""
STEP_OF_TALL = 0.01
"""The same of the frame of eight storeys, whose first period is some 0.6 s."""


class Plan(NamedTuple):
    """A frame in plan with two components of ground motion, its fuzzy inputs, and times in s."""

    structure: MatrixStructure
    inputs: dict[str, FuzzyNumber]
    duration: float
    step: float = STEP


def ground(seed: int, duration: float) -> Accelerogram:
    """Return a synthetic record of a length in s, no measured earthquake."""
    made = SyntheticRecord(duration=duration, step=0.02, seed=seed)
    return Accelerogram(made.step, made.acceleration())


def random_plan(rng: np.random.Generator, storeys: int, count: int, duration: float) -> Plan:
    """Return a random frame in plan with some inputs, under a record of a length in s.

    Args:
        rng: Draws sides, frames, tolerances of 5 to 10 %, and records.
        storeys: Number of floors.
        count: Number of fuzzy inputs from 1 to 6: stiffnesses of the frames along x and y in turn,
            and at last the damping ratio of all modes.
        duration: Length of the record; the response is as long.
    """
    sides = rng.uniform(10, 25, 2)  # m
    n_frames = max(count - 1, 2)
    mass = 200e3  # of a floor, kg
    springs = 2 * np.eye(storeys) - np.eye(storeys, k=1) - np.eye(storeys, k=-1)
    springs[-1, -1] = 1.0
    # A storey's period is some 0.1 s for a building of one storey, as a shear wall has it.
    total = mass * (2 * np.pi / rng.uniform(0.10, 0.16)) ** 2
    stiffness: list[tuple[str, Array]] = []
    for k in range(n_frames):
        direction = k % 2
        row = np.zeros(3)
        row[direction] = 1.0
        # The frame stands at most at the edge of the floor: x - y r along x, y + x r along y.
        row[2] = (1 if direction else -1) * rng.uniform(-0.5, 0.5) * sides[1 - direction]
        part = total * rng.uniform(0.5, 1.5) / (n_frames / 2) * np.outer(row, row)
        # Columns resist the rotation of floors as well.
        part[2, 2] += 0.06 * total * (sides @ sides) / n_frames
        stiffness.append((f"k{k + 1}", np.asarray(np.kron(springs, part))))
    inertia = (sides @ sides) / 12
    corner = np.zeros(3 * storeys)
    corner[:3] = [1.0, 0.0, -sides[1] / 2]
    east, north, _ = (np.tile(axis, storeys) for axis in np.eye(3))
    names = [name for name, _ in stiffness]
    structure = MatrixStructure(
        dict.fromkeys(names, 1.0) | {"zeta": 0.05},
        mass=[(mass, np.kron(np.eye(storeys), np.diag([1.0, 1.0, inertia])))],
        stiffness=stiffness,
        observed={"drift": corner},
        ratios=["zeta"],
        ground=ground(int(rng.integers(2**31)), duration),
        pattern=east,
        components=[(ground(int(rng.integers(2**31)), duration), north)],
    )
    inputs: dict[str, FuzzyNumber] = {}
    for name in [*names[: max(count - 1, 1)], *["zeta"] * (count > 1)]:
        tolerance = rng.uniform(0.05, 0.10)
        nominal = structure.parameters[name]
        inputs[name] = Interval(nominal * (1 - tolerance), nominal * (1 + tolerance))
    return Plan(structure, inputs, duration)


def largest_motion(plan: Plan, rng: np.random.Generator, count: int) -> float:
    """Return the largest drift of exact responses at random angles and inputs, each of its own.

    The response to a turned ground motion is that to its two components by superposition, each
    moving the structure alone, so that neither bounds nor formulas of angles enter.
    """
    low, high = np.array([number.support for number in plan.inputs.values()]).T
    unit = rng.random((count, len(low)))
    unit[::2] = unit[::2].round()  # corners of the box
    points = low + unit * (high - low)
    first, second = plan.structure.accelerograms
    still = Accelerogram(first.step, np.zeros(len(first.samples)))

    def responses(x: Accelerogram, y: Accelerogram) -> Array:
        """Return exact drifts under two components, shape (structures, times)."""
        moved = plan.structure.moved_by(x, y)
        flow = LinearFlow(moved, tuple(plan.inputs), plan.duration, plan.step, Exact())
        return np.asarray(flow.values(points)[..., 0])

    # Along x act a_x cos φ - a_y sin φ, along y a_x sin φ + a_y cos φ.
    cosine_part = responses(first, still) + responses(still, second)
    back = Accelerogram(second.step, -second.samples)
    sine_part = responses(back, still) + responses(still, first)
    angles = rng.uniform(0, 2 * np.pi, (count, 1))
    return float(np.abs(np.cos(angles) * cosine_part + np.sin(angles) * sine_part).max())


def bounded(plan: Plan) -> dict[str, Any]:
    """Return bound and attained value over all angles, and what they took."""
    begun = time.perf_counter()
    spent = time.process_time()
    found = over_angles(
        plan.structure,
        plan.inputs,
        duration=plan.duration,
        step=plan.step,
        alpha=[0.0],
        progress=lambda _: None,
    )
    peak = found.peak["drift"]
    return {
        "storeys": plan.structure.size // 3,
        "inputs": len(plan.inputs),
        "nature": str(peak.nature),
        "bound [m]": float(peak.proved[0]),
        "reached [m]": float(peak.reached[0]),
        "gap": float(peak.gaps[0]),
        "angle": float(peak.worst.angle) if peak.worst else np.nan,
        "directions": len(found.by_angle),
        "seconds": time.perf_counter() - begun,
        "processor seconds": time.process_time() - spent,
    }


def validation(seed: int, frames: int, angles: int) -> Iterator[dict[str, Any]]:
    """Yield a row for each of some random frames of one to three storeys and one to six inputs."""
    for k in range(frames):
        rng = np.random.default_rng([seed, k])
        plan = random_plan(rng, int(rng.integers(1, 4)), 1 + k % 6, duration=4.0)
        row = bounded(plan)
        row["largest exact [m]"] = largest_motion(plan, rng, angles)
        row["inside"] = bool(row["largest exact [m]"] <= row["bound [m]"])
        yield row


def main() -> None:
    """Print a row for each frame and what was found; rows are kept as CSV."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=30)
    parser.add_argument("--angles", type=int, default=2000, help="random responses of each frame")
    parser.add_argument("--seed", type=int, default=None, help="by default a free one")
    parser.add_argument("--cost", action="store_true", help="time one frame of 8 storeys")
    options = parser.parse_args()
    seed = options.seed
    if seed is None:
        seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}", flush=True)
    if options.cost:
        plan = random_plan(np.random.default_rng(seed), 8, 5, duration=20.0)
        print(bounded(plan._replace(step=STEP_OF_TALL)))
        return
    rows = []
    for row in validation(seed, options.frames, options.angles):
        print(row, flush=True)
        rows.append(row)
    write(rows, RESULTS / "plan_frames.csv")
    gaps = [row["gap"] for row in rows]
    inside = sum(row["inside"] for row in rows)
    print(f"{inside} of {len(rows)} frames without a response above the bound; ", end="")
    print(f"gaps: largest {max(gaps):.2%}, median {np.median(gaps):.2%}")


if __name__ == "__main__":
    main()
