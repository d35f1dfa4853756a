"""From a structure with fuzzy parameters to the envelopes of its outputs."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from frame.box import ALPHA, UnitFlow, boxes
from frame.envelope import Envelope
from frame.flow import LinearFlow
from frame.graph_follower import Followed, GraphFollower
from frame.integrators import INTEGRATORS, Integrator
from frame.jet import Array
from frame.linear import LinearSystem
from fuzzy import FuzzyNumber

Progress = Callable[[float], None]


def envelope(
    model: LinearSystem,
    inputs: Mapping[str, FuzzyNumber],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    method: str = "graph-follower",
    integrator: str | Integrator = "midpoint",
    progress: Progress | None = None,
    **options: Any,
) -> Envelope:
    """Lower and upper envelopes of the outputs of `model`.

    Args:
        model: The structure.
        inputs: Fuzzy parameters by name, in SI units.
        duration: Length of the simulation, in s.
        step: Distance of the nodes and step of the integrator, in s.
        alpha: Levels in [0, 1].
        method: Name of a method, see `METHODS`.
        integrator: Time stepping: a method or its name.
        progress: Called with the fraction done.
        options: Options of the method, such as `order`, `tolerance`, `budget` of the Graph Follower.

    Raises:
        ValueError: An unknown name, or a value outside its range.
    """
    if method not in METHODS:
        raise ValueError(f"method: '{method}' is unknown; allowed are {', '.join(METHODS)}")
    if isinstance(integrator, str) and integrator not in INTEGRATORS:
        raise ValueError(f"integrator: '{integrator}' is unknown; allowed are {', '.join(INTEGRATORS)}")
    scheme = INTEGRATORS[integrator] if isinstance(integrator, str) else integrator
    cuts = boxes(inputs, alpha)
    flow = UnitFlow(LinearFlow(model, cuts.names, duration, step, scheme), cuts)
    return METHODS[method](flow, progress, **options)


def follow(flow: UnitFlow, progress: Progress | None = None, **options: Any) -> Envelope:
    """Envelope by the Graph Follower; options are the fields of `GraphFollower`."""
    follower = GraphFollower(**options)
    begun = time.perf_counter()
    followed = follower.run(flow, progress=progress)
    return followed_envelope(flow, follower, followed, time.perf_counter() - begun)


def followed_envelope(flow: UnitFlow, follower: GraphFollower, followed: Followed, seconds: float) -> Envelope:
    """The envelope of a finished Graph Follower."""
    facts: dict[str, float | str] = {"order": follower.order, "tolerance": follower.tolerance, "recomputed": followed.storage.recomputed}
    if followed.exhausted:
        facts["reason"] = f"stopped at the budget of {follower.budget} trajectories"
    return signed_envelope(
        flow,
        followed.bounds + followed.correction,
        followed.storage.points[followed.best],
        method="graph-follower",
        nature="estimated" if follower.corrected else "inner",
        trajectories=len(followed.storage),
        seconds=seconds,
        error=followed.correction.max(-1) if follower.corrected else None,
        facts=facts,
    )


def signed_envelope(flow: UnitFlow, bounds: Array, at: Array, **rest: Any) -> Envelope:
    """An envelope from upper bounds of (−output, output), shape (A, T, m, 2), and their unit coordinates (A, T, m, 2, d)."""
    cuts = flow.boxes
    where = cuts.to_physical(at)
    return Envelope(
        cuts.alpha, flow.time, flow.outputs, cuts.names, -bounds[..., 0], bounds[..., 1], where[..., 0, :], where[..., 1, :], **rest
    )


def sample(flow: UnitFlow, points_of: Callable[[Array, Array], Array], method: str) -> Envelope:
    """Envelope of the trajectories at given points of each box, wider boxes taking over the points of the narrower ones.

    Args:
        flow: The trajectories.
        points_of: From lower and upper ends (d,) to unit coordinates (S, d).
        method: Name for the result.
    """
    begun = time.perf_counter()
    shape = (len(flow.boxes.alpha), len(flow.time), len(flow.outputs), 2)
    bounds, at, runs = np.full(shape, -np.inf), np.zeros((*shape, len(flow.boxes.names))), 0
    for level in reversed(range(shape[0])):
        if level + 1 < shape[0]:
            bounds[level], at[level] = bounds[level + 1], at[level + 1]
        points = points_of(*flow.boxes.unit(level))
        runs += len(points)
        for chunk in np.array_split(points, -(-len(points) // 256)):
            values = flow.values(chunk)
            signed = np.stack([-values, values], -1)
            best = signed.argmax(0)
            top = np.take_along_axis(signed, best[None], 0)[0]
            better = top > bounds[level]
            bounds[level], at[level][better] = np.maximum(top, bounds[level]), chunk[best][better]
    return signed_envelope(flow, bounds, at, method=method, nature="inner", trajectories=runs, seconds=time.perf_counter() - begun)


def corners(lower: Array, upper: Array) -> Array:
    """All corners of a box, shape (2^d, d); axes without width count once."""
    axes = [(low,) if low == high else (low, high) for low, high in zip(lower, upper, strict=True)]
    return np.array(np.meshgrid(*axes, indexing="ij")).reshape(len(axes), -1).T


def vertex(flow: UnitFlow, progress: Progress | None = None) -> Envelope:
    """Envelope of the corners of each box: the vertex method."""
    return sample(flow, corners, "vertex")


def monte_carlo(flow: UnitFlow, progress: Progress | None = None, *, samples: int = 1000, seed: int = 0) -> Envelope:
    """Envelope of `samples` uniform random trajectories per level."""
    rng = np.random.default_rng(seed)
    return sample(flow, lambda lower, upper: rng.uniform(lower, upper, (samples, len(lower))), "monte-carlo")


def quasi_monte_carlo(flow: UnitFlow, progress: Progress | None = None, *, samples: int = 1024, seed: int = 0) -> Envelope:
    """Envelope of a scrambled Sobol sequence of Chebyshev density per level."""
    from scipy.stats import qmc

    def points(lower: Array, upper: Array) -> Array:
        unit = qmc.Sobol(len(lower), rng=np.random.default_rng(seed)).random(samples)
        chebyshev: Array = (lower + upper) / 2 - (upper - lower) / 2 * np.cos(np.pi * unit)
        return chebyshev

    return sample(flow, points, "quasi-monte-carlo")


METHODS: dict[str, Callable[..., Envelope]] = {
    "graph-follower": follow,
    "vertex": vertex,
    "monte-carlo": monte_carlo,
    "quasi-monte-carlo": quasi_monte_carlo,
}
