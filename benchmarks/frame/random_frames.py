"""Random frames: do exact motions stay inside guaranteed envelopes, and how many are refused?

Frames of 2 to 12 unknowns with stiffnesses and masses over two decades; in a tenth of them one
storey is 1,000 times stiffer or softer. A third each has dashpots, has forces, or is a frame in
plan. Each is bounded by branch and bound, by the dual bound and by the automatic choice, and
compared with exact motions of the judge at nodes and at drawn times between them, none of which
may lie outside.

    python -m benchmarks.frame.random_frames                       300 frames, 2000 motions each
    python -m benchmarks.frame.random_frames --seed 5 --first 40 --frames 20      a part of them
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, RefusedError
from alphacut.frame import (
    Accelerogram,
    Envelope,
    Force,
    History,
    MatrixStructure,
    StoreyFrame,
    envelope,
)
from alphacut.frame.verification.self_test import structures_at
from alphacut.fuzzy import Interval
from benchmarks.frame.plan_frames import random_plan
from benchmarks.rows import write

RESULTS = Path(__file__).parents[1] / "results"
KINDS = ("dashpots", "forces", "plan")
METHODS = ("proof", "dual", "auto")
DURATION, STEP = 2.0, 0.05
"""Length of the motions and distance of the time nodes, in s."""
TIMES_OF_STEP = 3
"""Times of a step at which motions are compared: its beginning, and two that are drawn."""


class Frame(NamedTuple):
    """A structure and its inputs."""

    structure: StoreyFrame | MatrixStructure
    inputs: dict[str, Interval]


def random_frame(rng: np.random.Generator, kind: str) -> Frame:
    """Return a random frame with one to eight inputs, known within 0.5 to 5 %."""
    if kind == "plan":
        plan = random_plan(rng, int(rng.integers(1, 5)), int(rng.integers(1, 7)), DURATION)
        return Frame(plan.structure, dict(plan.inputs))
    n = int(rng.integers(2, 13))
    stiffness = 10.0 ** rng.uniform(7, 9, n)
    if rng.random() < 0.1:
        stiffness[rng.integers(n)] *= rng.choice([1e-3, 1e3])
    masses = 10.0 ** rng.uniform(4, 6, n)
    given: dict[str, Any] = {"damping_ratio": float(rng.uniform(0.01, 0.1))}
    noise = rng.normal(size=(3, 60))
    if kind == "dashpots":
        dampers = rng.uniform(0.01, 0.1, n) * np.sqrt(masses * stiffness)
        given = {"dampers": dampers, "damper_placement": "storey"}
    if kind == "forces":
        given["loads"] = [
            Force(1, 2e4, History(0.05, noise[0], 0.1)),
            Force(n, 1e4, History.harmonic(float(rng.uniform(0.5, 5)))),
        ]
    if kind == "dashpots" or rng.random() < 0.5:
        given["ground"] = Accelerogram(0.05, noise[1])
    structure = StoreyFrame(
        masses, stiffness=stiffness, outputs=(f"q{n}", "drift1", f"a{n}"), **given
    )
    names = [f"{letter}{z + 1}" for letter in "km" for z in range(n)]
    chosen = rng.permutation(names)[: int(rng.integers(1, 9))]
    widths = rng.uniform(0.005, 0.05, len(chosen))
    inputs = {}
    for name, width in zip(map(str, chosen), widths, strict=True):
        value = structure.parameters[name]
        inputs[name] = Interval(value * (1 - width), value * (1 + width))
    return Frame(structure, inputs)


class Motions(NamedTuple):
    """Exact motions at nodes and between, and bounds of their rounding, (S, J, m) each."""

    values: Array
    rounding: Array
    step: Array  # number of the step of each time, (J,); 0 and a new one for each node itself


def exact_motions(frame: Frame, rng: np.random.Generator, count: int) -> Motions:
    """Return exact motions at random inputs, half of them corners, by the judge's series."""
    low, high = np.array([number.support for number in frame.inputs.values()]).T
    unit = rng.random((count, len(low)))
    unit[::2] = unit[::2].round()
    steps = round(DURATION / STEP)
    fractions = np.sort(rng.random((steps, TIMES_OF_STEP)), axis=1)
    fractions[:, 0] = 0.0
    times = np.append((np.arange(steps)[:, np.newaxis] + fractions).ravel() * STEP, DURATION)
    structures = structures_at(frame.structure, tuple(frame.inputs), low + unit * (high - low))
    found = [structure.outputs(times) for structure in structures]
    return Motions(
        values=np.stack([x.values for x in found]),
        rounding=np.stack([x.rounding for x in found]),
        step=np.minimum(np.arange(len(times)) // TIMES_OF_STEP + 1, steps),
    )


def outside(found: Envelope, motions: Motions) -> int:
    """Return how many motions leave the guaranteed bounds at some time."""
    assert found.between is not None
    is_node = np.arange(motions.values.shape[1]) % TIMES_OF_STEP == 0
    is_outside = np.zeros(len(motions.values), bool)
    for sign, at_nodes in ((1.0, found.proved.upper[0]), (-1.0, -found.proved.lower[0])):
        within = np.maximum(at_nodes[1:], at_nodes[:-1]) + found.between[1:]
        bound = within[motions.step - 1]
        bound[is_node] = at_nodes
        slack = motions.rounding + 1e-12 * np.abs(bound).max(axis=0)
        is_outside |= (sign * motions.values > bound + slack).any(axis=(1, 2))
    return int(is_outside.sum())


def rows(
    seed: int, first: int, frames: int, count: int, methods: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Yield a row for each frame and method: what became of it, its gap, and motions outside."""
    for number in range(first, first + frames):
        rng = np.random.default_rng([seed, number])
        kind = KINDS[number % len(KINDS)]
        frame = random_frame(rng, kind)
        motions = exact_motions(frame, rng, count)
        for method in methods:
            row: dict[str, Any] = {"frame": number, "kind": kind, "method": method}
            row |= {"unknowns": len(frame.structure.masses) if kind != "plan" else "", "result": ""}
            row["inputs"] = len(frame.inputs)
            begun = time.process_time()
            try:
                found = envelope(
                    frame.structure,
                    frame.inputs,
                    method,
                    duration=DURATION,
                    step=STEP,
                    alpha=[0.0],
                    progress=False,
                )
            except (FailedError, RefusedError) as error:
                row |= {"result": type(error).__name__, "reason": str(error)}
            else:
                row |= {"result": str(found.nature), "gap": found.facts.get("gap_of_peaks", "")}
                if found.outer is not None or row["result"] == "guaranteed":
                    row["outside"] = outside(found, motions)
            row["processor seconds"] = time.process_time() - begun
            yield row


def main() -> None:
    """Print and keep a row for each frame and method, and count what became of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, help="by default a free one")
    parser.add_argument("--first", type=int, default=0, help="number of the first frame")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--motions", type=int, default=2000, help="exact motions of each frame")
    parser.add_argument("--methods", nargs="*", default=METHODS, choices=METHODS)
    options = parser.parse_args()
    seed = options.seed
    if seed is None:
        seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}", flush=True)
    found = []
    for row in rows(seed, options.first, options.frames, options.motions, options.methods):
        print({k: f"{x:.3g}" if isinstance(x, float) else x for k, x in row.items()}, flush=True)
        found.append(row)
    write(found, RESULTS / "random_frames.csv")
    for (method, result), count in sorted(
        Counter((x["method"], x["result"]) for x in found).items()
    ):
        print(f"{method}: {count} {result}")
    print(f"{sum(row.get('outside', 0) for row in found)} motions outside")


if __name__ == "__main__":
    main()
