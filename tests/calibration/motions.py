"""Random structures, and the ends that motions of a box reach by other means than a method's."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import minimize

from alphacut.frame import Accelerogram, Exact, LagrangianFlow, LinearFlow, StoreyFrame
from alphacut.fuzzy import FuzzyNumber, Interval, Nature

POINTS = 1000
"""Random points of a box, beside its corners."""
POLISHED = 3
"""Bounds of each output and side that are searched for by gradients."""


@dataclass(frozen=True)
class Drawn:
    """A structure with fuzzy inputs, and the duration and step of its motion in s."""

    system: object
    inputs: dict[str, FuzzyNumber]
    duration: float = 5.0
    step: float = 0.04

    @property
    def motion(self) -> dict:
        """Arguments of `envelope`."""
        nodes = {"duration": self.duration, "step": self.step, "alpha": (0,)}
        return nodes | {"relative": True, "progress": False}


def about(value: float, share: float) -> Interval:
    """An interval about a value."""
    return Interval((1 - share) * value, (1 + share) * value)


def random_frame(
    rng: np.random.Generator, inputs: int, *, damped: bool = True, storeys: tuple[int, int] = (2, 4)
) -> Drawn:
    """A frame of so many storeys, on a record or let go, and outputs of every kind."""
    n, shaken = int(rng.integers(storeys[0], storeys[1] + 1)), bool(rng.integers(2))
    record, step = 2 * rng.standard_normal(200) * np.hanning(200), rng.choice([0.003, 0.017, 0.2])
    system = StoreyFrame(
        rng.uniform(5e3, 3e4, n).tolist(),
        stiffness=rng.uniform(2e6, 2e7, n).tolist(),
        damping_ratio=float(rng.uniform(0.01, 0.06)) if damped else 0.0,
        ground=Accelerogram(float(step), record) if shaken else None,
        q0=[] if shaken else rng.uniform(-0.05, 0.05, n).tolist(),
        outputs=(f"q{n}", "v1", f"drift{n}", "base_shear", "a2"),
    )
    names = [*system.group("k"), *system.group("m"), *["zeta"] * damped]
    chosen = rng.permutation(names)[:inputs].tolist()
    share = float(rng.choice([0.02, 0.05, 0.1]))
    return Drawn(system, {name: about(system.parameters[name], share) for name in chosen})


def exact_flow(drawn: Drawn) -> LinearFlow:
    """Exact motions of a linear structure."""
    return LinearFlow(drawn.system, tuple(drawn.inputs), drawn.duration, drawn.step, Exact())


@dataclass(frozen=True)
class Extrapolated:
    """Motions of order 4: those of a scheme of order 2 and of half its step, extrapolated."""

    flow: LagrangianFlow

    @cached_property
    def half(self):
        """The motions of half the step."""
        return self.flow.finer()[0]

    def values(self, points):
        """Trajectories at points (S, d), shape (S, T, m)."""
        fine = self.half.values(points)[:, ::2]
        return fine + (fine - self.flow.values(points)) / 3

    def taylor(self, points):
        """The same with derivatives."""
        fine = self.half.taylor(points)[:, ::2]
        return fine + (fine - self.flow.taylor(points)) / 3


def reached(flow, inputs, rng: np.random.Generator, alpha=0.0, points=POINTS):
    """Least and greatest values of motions of a cut, shape (T, m) each.

    At random points and corners, and on the way of local searches from the best of these for some
    nodes, the highest among them.
    """
    low, high = np.array([number.cut(alpha) for number in inputs.values()]).T
    is_high = rng.integers(2, size=(POINTS, len(low)))  # corners, of which there may be 2³⁰
    half = np.where(np.unique(is_high, axis=0), high, low)
    tried = np.vstack([rng.uniform(low, high, (points, len(low))), half])
    parts = [flow.values(chunk) for chunk in np.array_split(tried, -(-len(tried) // 200))]
    values = np.concatenate(parts)
    ends = [values.min(0), values.max(0)]
    for output in range(values.shape[2]):
        for side in (0, 1):
            signed = (1 - 2 * side) * values[:, :, output]
            peak = signed.min(0).argmin()
            for node in [peak, *rng.integers(1, signed.shape[1], POLISHED - 1)]:
                start = tried[signed[:, node].argmin()]
                path = polished(flow, start, low, high, (node, output, 1 - 2 * side))
                ends = [np.minimum(ends[0], path.min(0)), np.maximum(ends[1], path.max(0))]
    return ends


def polished(flow, start, low, high, bound):
    """Motions on the way from a point to a local optimum of one bound, shape (S, T, m)."""
    node, output, sign = bound
    size, path = np.maximum(high - low, 1e-300), []

    def value(unit):
        jet = flow.taylor((low + size * unit)[None])
        path.append(jet.value[0])
        slope = jet.first[:, 0, node, output] * size
        return sign * jet.value[0, node, output] / scale, sign * slope / scale

    scale = np.abs(flow.values(start[None])[0, :, output]).max() or 1.0
    box = [(0, 1)] * len(low)
    minimize(value, (start - low) / size, jac=True, bounds=box, options={"maxiter": 12})
    return np.array(path)


def judged(table, found, ends, quantity, case, *, tolerance=0.0, level=0, outputs=slice(None)):
    """Adds the bounds of an envelope by what its nature promises; reached ones promise nothing.

    `ends` are least and greatest values that motions reach, (T, m) each, and `tolerance` is the
    error asked for, as a share of each output's peak.
    """
    low, high = (end[:, outputs] for end in ends)
    lower, upper, errors = (x[level][:, outputs] for x in (found.lower, found.upper, found.error))
    size = np.broadcast_to(np.maximum(np.abs(low), np.abs(high)).max(0), low.shape)
    if found.nature is Nature.GUARANTEED:
        proved = lower.ravel(), upper.ravel()
        own = low.ravel(), high.ravel()
        table.guaranteed(quantity, proved, own, size=size.ravel(), case=case)
    elif found.nature is Nature.ESTIMATED:
        for true in (lower - low, high - upper):
            least, error = 0.1 * tolerance * size, errors
            true = np.maximum(true, 0)
            table.estimated(quantity, error, true, size=size, least=least, case=case)
