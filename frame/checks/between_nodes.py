"""Estimates of what outputs do between nodes beyond a straight line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.checks.step_error import probes
from alphacut.frame.dynamics.flow import Flow
from alphacut.frame.envelope import Envelope
from alphacut.fuzzy.arrays import Array

AT_ONCE = 16
"""Trajectories that are held at once."""
SAFETY = 1.5
"""Factor on the largest stray of the trajectories looked at."""
FLOOR = 0.1
"""Least stray of a step, as a share of the largest of all steps."""


def with_stray(of: Envelope, flow: UnitFlow) -> Envelope:
    """The envelope with an estimate of what lies between its nodes; a proof is left as it is."""
    if of.between is not None:
        return of
    corners = probes(flow.boxes)
    between = stray(flow.flow, np.vstack([corners, (corners + flow.boxes.modal) / 2]))
    facts = {**of.facts, "between_nodes": float((between / flow.scale).max())}
    return replace(of, between=between, facts=facts)


def stray(flow: Flow, points: Array) -> Array:
    """Estimate of how far outputs stray from straight lines between nodes, shape (T, m).

    Row j is that of the step that ends at node j, 0 for the first node.

    Args:
        flow: The trajectories.
        points: Parameters of those that are looked at, shape (S, d), in SI units.
    """
    pieces = np.array_split(points, -(-len(points) // AT_ONCE))
    off = np.max([_off(flow, some) for some in pieces], axis=0)
    # where the trajectories looked at are straight, others are not
    near = [np.roll(off, k, 0) for k in (-1, 0, 1)]
    near.append(np.broadcast_to(FLOOR * off.max(0), off.shape))
    return np.concatenate([np.zeros((1, off.shape[1])), SAFETY * np.max(near, 0)])


def _off(flow: Flow, points: Array) -> Array:
    """Largest distance of trajectories from straight lines in each step, shape (T − 1, m)."""
    finer, parts = flow.finer()
    fine = finer.values(points)
    ends = fine[:, ::parts]
    share = (np.arange(1, parts) / parts)[:, None]
    inner = fine[:, :-1].reshape(len(fine), -1, parts, fine.shape[-1])[:, :, 1:]
    straight = ends[:, :-1, None] * (1 - share) + ends[:, 1:, None] * share
    return np.asarray(np.abs(inner - straight).max((0, 2)))
