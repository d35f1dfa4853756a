"""Envelope of a sample of each box: points of a Sobol sequence, denser towards the faces."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.envelope import Envelope
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import checked_number
from alphacut.fuzzy.result import Nature

MAX_NUMBERS = 16e6
"""Most numbers of trajectories at a time: 128 MB."""


@dataclass(frozen=True)
class Sampled:
    """Attained bounds of so many trajectories on each level, from a seed.

    Raises:
        RefusedError: No trajectory is asked for.

    Example:
        >>> from alphacut.frame import StoreyFrame, envelope
        >>> from alphacut.fuzzy import Triangular
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> inputs = {"m1": Triangular(900, 1000, 1100)}
        >>> str(envelope(frame, inputs, Sampled(samples=64), duration=0.5, step=0.1).nature)
        'attained'
    """

    name: ClassVar[str] = "quasi-monte-carlo"
    samples: int = 1024
    seed: int = 0

    def __post_init__(self) -> None:
        checked_number("samples", self.samples, whole=True, least=1)

    def points(self, lower: Array, upper: Array) -> Array:
        """Return Sobol points of a box, denser towards its faces, shape (samples, d)."""
        from scipy.stats import qmc

        unit = qmc.Sobol(len(lower), rng=np.random.default_rng(self.seed)).random(self.samples)
        return np.asarray((lower + upper) / 2 - (upper - lower) / 2 * np.cos(np.pi * unit))

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the attained envelope of all outputs on all levels."""
        start_time, levels = time.perf_counter(), len(flow.boxes.alpha)
        shape = (levels, len(flow.time), len(flow.outputs), 2)
        bounds, at = np.full(shape, -np.inf), np.zeros((*shape, len(flow.boxes.names)))
        chunk_size = int(np.clip(MAX_NUMBERS / (shape[1] * shape[2]), 1, 256))
        for done, level in enumerate(reversed(range(levels))):
            if level + 1 < levels:  # what a narrower box attains
                bounds[level], at[level] = bounds[level + 1], at[level + 1]
            points = self.points(*flow.boxes.unit(level))
            chunks = np.array_split(points, -(-len(points) // chunk_size))
            for count, chunk in enumerate(chunks, start=1):
                update_bounds(flow.values(chunk), chunk, bounds[level], at[level])
                if progress:
                    progress((done + count / len(chunks)) / levels)
        return flow.envelope(
            bounds,
            at,
            method=self.name,
            nature=Nature.ATTAINED,
            evaluations=levels * self.samples,
            seconds=time.perf_counter() - start_time,
        )


def update_bounds(values: Array, points: Array, bounds: Array, at: Array) -> None:
    """Update attained bounds and their inputs in place by a batch of trajectories.

    Args:
        values: Outputs, shape (S, T, m).
        points: Their unit coordinates, shape (S, d).
        bounds: Largest values of (−output, output) so far, shape (T, m, 2).
        at: Unit coordinates of these, shape (T, m, 2, d).
    """
    signed = np.stack([-values, values], -1)
    best = signed.argmax(0)  # trajectory of the largest value
    largest = np.take_along_axis(signed, best[None], 0)[0]
    better = largest > bounds
    bounds[better], at[better] = largest[better], points[best][better]
