"""Inner bounds of envelopes by exact trajectories alone: what declared errors are judged by.

Trajectories are sums over the eigenvectors of the state matrix, marched through the corners of a
record; nothing of the integrators, jets or polynomials of the package is in their values. Newton's
method on a modal model only says where to look, from starts drawn here.
"""

from __future__ import annotations

from itertools import pairwise
from math import factorial

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import problems
from alphacut.frame.structures.linear import Accelerogram, evaluate
from alphacut.frame.structures.modes import ModalError

MOST = 3000
"""Polished points whose exact trajectories are computed beside the best of each bound."""


def trajectories(flow: LinearFlow, physical: Array) -> Array:
    """Outputs at all nodes, shape (S, T, m), for parameters (S, d) in SI units."""
    pieces = np.array_split(physical, -(-len(physical) // 500))
    return np.concatenate([_trajectories(flow, piece) for piece in pieces])


def _trajectories(flow: LinearFlow, physical: Array) -> Array:
    matrices, rows = evaluate(flow.system, flow.names, physical, derivatives=False)
    M, D, K = matrices.mass.value, matrices.damping.value, matrices.stiffness.value
    n = M.shape[-1]
    A = np.zeros((len(physical), 2 * n, 2 * n))
    A[:, :n, n:] = np.eye(n)
    A[:, n:, :n], A[:, n:, n:] = -np.linalg.solve(M, K), -np.linalg.solve(M, D)
    rate, X = np.linalg.eig(A)
    state = np.concatenate([matrices.q0.value, matrices.v0.value], -2)
    kick = np.concatenate([np.zeros((n, 1)), -matrices.rigid])
    start = np.linalg.solve(X, state + 0j)[..., 0]
    push = np.linalg.solve(X, np.broadcast_to(kick, state.shape) + 0j)[..., 0]
    seen = (rows.value @ X).swapaxes(-1, -2)  # (S, 2n, m)
    out = (np.exp(rate[:, None] * flow.time[:, None]) @ (start[..., None] * seen)).real
    if flow.system.ground is not None:
        out += (loaded(flow.system.ground, flow.time, rate) @ (push[..., None] * seen)).real
    return out


def loaded(ground: Accelerogram, time: Array, rate: Array) -> Array:
    """∫ exp(λ (t − s)) a(s) ds at all nodes, shape (S, T, K), exactly for a linear between samples.

    The record ends with its last sample, from which it drops to zero if that is not.
    """
    samples = np.arange(len(ground.acceleration)) * ground.step
    ends = np.unique(np.round(np.concatenate([time, samples[samples <= time[-1]]]), 12))
    now, out = np.zeros_like(rate), np.zeros((len(rate), len(time), rate.shape[1]), complex)
    row = {round(float(t), 12): k for k, t in enumerate(time)}
    known: dict[float, tuple[Array, Array, Array]] = {}
    for before, after in pairwise(ends):
        h = after - before
        inside = after <= samples[-1] + 1e-12
        a, b = np.interp([before, after], samples, ground.acceleration) if inside else (0.0, 0.0)
        if (key := round(float(h), 10)) not in known:
            known[key] = _phi(rate * h)
        f0, f1, f2 = known[key]
        now = f0 * now + h * (a * (f1 - f2) + b * f2)
        if (k := row.get(round(float(after), 12))) is not None:
            out[:, k] = now
    return out


def _phi(z: Array) -> tuple[Array, Array, Array]:
    """exp, (exp(z) − 1)/z and (exp(z) − 1 − z)/z²."""
    small = np.abs(z) < 0.5
    w, x = np.where(small, 1.0, z), np.where(small, z, 0.0)
    series = [sum(x**j / factorial(j + k) for j in range(14)) for k in (1, 2)]
    e = np.exp(z)
    return (
        e,
        np.where(small, series[0], (e - 1) / w),
        np.where(small, series[1], (e - 1 - z) / w**2),
    )


def inner_bounds(
    flow: UnitFlow, level: int, *, samples: int, starts: int, seed: int, nodes: int = 16
) -> Array:
    """Attained upper bounds of (−output, output) over a level's box, shape (T, m, 2).

    All nodes are sampled, and get what is found for the others; some, or all, are polished: from
    the best of many points, which lie on hills that are high before they are climbed, and from
    points drawn blindly, which meet the others.

    Args:
        flow: Time nodes, boxes and structure; its integrator is not used.
        level: Index of the α-cut.
        samples: Random points of the box.
        starts: Points of either kind from which every bound of a polished node begins.
        seed: Of the points and nodes.
        nodes: Number of nodes that are polished; all if there are no more.
    """
    assert isinstance(flow.flow, LinearFlow)
    rng, (lower, upper) = np.random.default_rng((seed, level)), flow.boxes.unit(level)
    best = np.full((len(flow.time), len(flow.outputs), 2), -np.inf)
    ends = [_offer(flow, best, chunk) for chunk in _parts(rng, lower, upper, samples, starts)]
    if not (upper > lower).any():
        return best
    count = len(flow.time)
    drawn = rng.permutation(count)[:nodes]
    chosen = np.unique([*drawn, best.max((1, 2)).argmax()])
    begun = [end[chosen] for end in ends]
    begun += [
        _drawn(rng, lower, upper, begun[0][..., 0].size).reshape(begun[0].shape) for _ in ends
    ]
    polished = _polished(flow, begun, chosen, lower, upper, rng)
    for spread in (0.0, 0.02):
        near = polished + spread * (upper - lower) * rng.normal(size=polished.shape)
        _offer(flow, best, np.clip(near, lower, upper))
    return best


def _parts(
    rng: np.random.Generator, lower: Array, upper: Array, samples: int, starts: int
) -> list[Array]:
    return np.array_split(_drawn(rng, lower, upper, samples), starts)


def _drawn(rng: np.random.Generator, lower: Array, upper: Array, count: int) -> Array:
    """Uniform points, a third of whose coordinates lie on faces in two of three of them."""
    points = rng.uniform(lower, upper, (count, len(lower)))
    faces = rng.random(points.shape) < rng.choice([0.0, 0.3, 0.7], (count, 1))
    return np.where(faces, np.where(rng.random(points.shape) < 0.5, lower, upper), points)


def _offer(flow: UnitFlow, best: Array, points: Array) -> Array:
    """Raise `best` by the trajectories of points (S, d); return each bound's best point."""
    top, at = np.full(best.shape, -np.inf), np.zeros((*best.shape, points.shape[1]))
    for chunk in np.array_split(points, -(-len(points) // 500)):
        values = trajectories(flow.flow, flow.boxes.to_physical(chunk))  # type: ignore[arg-type]
        for side, sign in ((0, -1.0), (1, 1.0)):
            pick = (sign * values).argmax(0)
            value = np.take_along_axis(sign * values, pick[None], 0)[0]
            better = value > top[..., side]
            top[..., side][better] = value[better]
            at[..., side, :][better] = chunk[pick[better]]
    np.maximum(best, top, out=best)
    return at


def _polished(
    flow: UnitFlow,
    begun: list[Array],
    nodes: Array,
    lower: Array,
    upper: Array,
    rng: np.random.Generator,
) -> Array:
    """Where Newton's method leads from each of `begun` (nodes, m, 2, d), thinned, shape (S, d)."""
    assert isinstance(flow.flow, LinearFlow)
    try:
        model = fit_modes(flow.flow, flow.boxes, tolerance=1e-4, budget=120)
        guide = ExactResponse.of(model, flow.scale)
    except ModalError:
        return np.unique(np.reshape(begun, (-1, begun[0].shape[-1])), axis=0)
    best, found = problems(nodes, len(flow.outputs), len(lower)), []
    every = np.arange(len(best.value))
    for start in begun:
        optima = problems(nodes, len(flow.outputs), len(lower))
        optima.offer(guide, start.reshape(optima.point.shape), every)
        refine(guide, optima, every, lower, upper, 1e-7)
        found.append(optima.point)
        best.offer(guide, optima.point, every)
    unique = np.unique(np.round(np.concatenate(found), 4), axis=0)
    tops = np.unique(np.round(best.point, 8), axis=0)
    return np.concatenate([tops, rng.permutation(unique)[:MOST]])
