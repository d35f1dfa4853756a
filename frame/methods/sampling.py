"""Envelopes of samples: vertex method, Monte Carlo, quasi-Monte Carlo."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import corners
from alphacut.frame.envelope import Envelope, signed_envelope
from alphacut.fuzzy.progress_bar import Progress, share

MOST = 16e6
"""Most numbers of trajectories at a time: 128 MB."""


def sample(
    flow: UnitFlow,
    points_of: Callable[[Array, Array], Array],
    method: str,
    progress: Progress | None = None,
) -> Envelope:
    """Nested envelope of trajectories at points (S, d) from each box's unit ends (d,), named."""
    begun, tick = time.perf_counter(), share(progress, 0.0, 1.0)
    shape = (len(flow.boxes.alpha), len(flow.time), len(flow.outputs), 2)
    bounds, at, runs = np.full(shape, -np.inf), np.zeros((*shape, len(flow.boxes.names))), 0
    at_once = int(np.clip(MOST / (shape[1] * shape[2]), 1, 256))
    for level in reversed(range(shape[0])):
        if level + 1 < shape[0]:
            bounds[level], at[level] = bounds[level + 1], at[level + 1]
        points = points_of(*flow.boxes.unit(level))
        runs += len(points)
        chunks = np.array_split(points, -(-len(points) // at_once))
        for done, chunk in enumerate(chunks):
            tick((shape[0] - 1 - level + done / len(chunks)) / shape[0])
            values = flow.values(chunk)
            signed = np.stack([-values, values], -1)
            best = signed.argmax(0)
            top = np.take_along_axis(signed, best[None], 0)[0]
            better = top > bounds[level]
            bounds[level], at[level][better] = np.maximum(top, bounds[level]), chunk[best][better]
    return signed_envelope(
        flow,
        bounds,
        at,
        method=method,
        nature="inner",
        trajectories=runs,
        seconds=time.perf_counter() - begun,
    )


@dataclass(frozen=True)
class Vertex:
    """Envelope of the corners of each box: the vertex method."""

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of all outputs on all levels."""
        return sample(flow, corners, "vertex", progress)


@dataclass(frozen=True)
class MonteCarlo:
    """Envelope of uniform random trajectories: so many samples on each level, from a seed."""

    samples: int = 1000
    seed: int = 0

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of all outputs on all levels."""
        draw = np.random.default_rng(self.seed).uniform
        return sample(
            flow, lambda a, b: draw(a, b, (self.samples, len(a))), "monte-carlo", progress
        )


@dataclass(frozen=True)
class QuasiMonteCarlo:
    """Envelope of a Sobol sequence of Chebyshev density, scrambled by a seed, on each level."""

    samples: int = 1024
    seed: int = 0

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of all outputs on all levels."""
        from scipy.stats import qmc

        def points(lower: Array, upper: Array) -> Array:
            unit = qmc.Sobol(len(lower), rng=np.random.default_rng(self.seed)).random(self.samples)
            return np.asarray((lower + upper) / 2 - (upper - lower) / 2 * np.cos(np.pi * unit))

        return sample(flow, points, "quasi-monte-carlo", progress)
