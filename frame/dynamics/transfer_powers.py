"""Trajectories x[k+1] = T x[k] + G load[k] of many parameter sets, exact under a record."""

from __future__ import annotations

from collections.abc import Sequence
from math import isqrt

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate
from alphacut.frame.dynamics.integrators import StepMap, exponential
from alphacut.frame.dynamics.record_load import load_rule, parts_of
from alphacut.frame.structures.assembly import Matrices
from alphacut.frame.structures.loads import History
from alphacut.frame.structures.modes import state_matrix

TERMS = 28
"""Terms of exp(A τ) where |λ| τ ≤ 2: the next is 2^28 / 28! = 1e-21."""


def exact_response(
    matrices: Matrices, pushes: Jet, loads: Sequence[History], *, step: float, steps: int
) -> tuple[StepMap, Array]:
    """The exact step under loads that push as `pushes`, V = (S, n, L), and their rule's weights.

    Returns:
        The step, and what its load acts on, shape (steps, L Q).
    """
    flow = state_matrix(matrices)
    fastest = float(np.abs(np.linalg.eigvals(flow.value)).max())
    parts = parts_of(max(fastest, *(load.frequency for load in loads)), step)
    rules = [load_rule(load, step, steps, parts) for load in loads]
    tau, short = rules[0].tau[: len(rules[0].tau) // parts], step / parts
    term = concatenate([pushes * 0.0, pushes], -2)
    series = [term]
    for k in range(1, TERMS):
        term = flow @ term * (short / k)
        series.append(term)
    powers = (tau / short) ** np.arange(TERMS)[:, None]
    count = len(loads)
    columns = [concatenate([x[..., i : i + 1] for x in series], -1) @ powers for i in range(count)]
    transfer = exponential(flow * short)  # columns are exp(A τ) B of each load
    for _ in range(parts.bit_length() - 1):
        columns = [concatenate([x, transfer @ x], -1) for x in columns]
        transfer = transfer @ transfer
    weights = np.concatenate([rule.weight for rule in rules], -1)
    return StepMap(transfer, concatenate(columns, -1)), weights


def trajectory(step_map: StepMap, start: Jet, rows: Jet, *, load: Array | None, count: int) -> Jet:
    """Outputs at `count` nodes, in blocks of √count steps.

    Args:
        step_map: One step, x[k+1] = T x[k] + G load[k].
        start: Initial state, V = (S, N, 1).
        rows: Observation rows, V = (S, m, N).
        load: What G acts on in each step, shape (count − 1, L), or None.
        count: Number of nodes.

    Returns:
        Outputs, V = (S, count, m).
    """
    size = isqrt(count - 1) + 1
    blocks = -(-count // size)
    powers = _powers(step_map.transfer, size)
    jump = step_map.transfer @ powers[:, -1]
    observed = rows[:, None] @ powers  # C T^j, V = (S, size, m, N)
    samples, m, n = len(start.value), rows.value.shape[-2], start.value.shape[-2]
    flat = observed.map(lambda x: x.reshape((*x.shape[:-3], size * m, n)))
    if load is None:
        out = flat @ _starts(jump, start, None, blocks)
    else:
        forced, ends = _forced(step_map, rows, load, size, blocks)
        out = flat @ _starts(jump, start, ends, blocks) + forced

    def in_time(x: Array) -> Array:
        lead = x.shape[:-3]
        ordered = np.moveaxis(x.reshape((*lead, samples, size, m, blocks)), -1, -3)
        return ordered.reshape((*lead, samples, blocks * size, m))[..., :count, :]

    return out.map(in_time)


def _forced(step_map: StepMap, rows: Jet, load: Array, size: int, blocks: int) -> tuple[Jet, Jet]:
    """Outputs of blocks from rest, V = (S, size m, blocks), and last states, V = (S, N, blocks)."""
    padded = np.zeros((blocks * size, load.shape[1]))
    padded[: len(load)] = load
    columns = padded.reshape(blocks, size, -1)
    state = step_map.load @ np.zeros((load.shape[1], blocks))
    seen = []
    for k in range(size):
        seen.append(rows @ state)  # eq. 18, of a linear structure
        state = step_map.transfer @ state + step_map.load @ columns[:, k].T
    return concatenate(seen, -2), state


def _powers(transfer: Jet, count: int) -> Jet:
    """T^0 … T^(count − 1) by doubling, V = (S, count, N, N)."""
    eye = np.broadcast_to(np.eye(transfer.value.shape[-1]), transfer.value.shape)
    powers = Jet.constant(eye, transfer.directions)[:, None]
    top = transfer
    while powers.value.shape[1] < count:
        powers = concatenate([powers, powers @ top[:, None]], -3)
        top = top @ top
    return powers[:, :count]


def _starts(jump: Jet, start: Jet, forced: Jet | None, blocks: int) -> Jet:
    """States at the first node of every block, V = (S, N, blocks)."""
    states = [start]
    for b in range(blocks - 1):
        following = jump @ states[-1]
        states.append(following if forced is None else following + forced[..., b : b + 1])
    return concatenate(states, -1)
