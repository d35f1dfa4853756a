"""Trajectories x[k+1] = T x[k] + G load[k] of many parameter sets, exact under a record."""

from __future__ import annotations

from collections.abc import Sequence
from math import isqrt

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate
from alphacut.frame.dynamics.integrators import StepMap, exponential
from alphacut.frame.dynamics.record_load import load_rule, parts_per_step
from alphacut.frame.structures.linear import Matrices
from alphacut.frame.structures.loads import History
from alphacut.frame.structures.modes import state_matrix

TERMS = 28
"""Terms of exp(A τ) where |λ| τ ≤ 2: the next is 2^28 / 28! = 1e-21."""


def exact_response(
    matrices: Matrices, pushes: Jet, loads: Sequence[History], *, step: float, steps: int
) -> tuple[StepMap, Array]:
    """Return the exact map of one step x[k+1] = T x[k] + G load[k], and load[k] of all steps.

    Duhamel's integral over a step is a rule with Q points for each of L loads: G holds exp(A τ) b
    at the points τ, shape (S, 2n, L Q), load[k] the rule's weights, shape (steps, L Q). A is the
    state matrix, and b = [0; pushes] the accelerations by a unit of each load.
    """
    flow = state_matrix(matrices)
    fastest = float(np.abs(np.linalg.eigvals(flow.value)).max())
    parts = parts_per_step(max(fastest, *(load.frequency for load in loads)), step)
    rules = [load_rule(load, step, steps, parts) for load in loads]
    substep = step / parts
    tau = rules[0].tau[: len(rules[0].tau) // parts]  # points in the last substep
    term = concatenate([pushes * 0.0, pushes], -2)
    series = [term]  # exp(A τ) b = Σ_k series[k] (τ / substep)^k
    for k in range(1, TERMS):
        term = flow @ term * (substep / k)
        series.append(term)
    powers = (tau / substep) ** np.arange(TERMS)[:, None]
    count = len(loads)
    columns = [concatenate([x[..., i : i + 1] for x in series], -1) @ powers for i in range(count)]
    transfer = exponential(flow * substep)
    for _ in range(parts.bit_length() - 1):  # doubles the time until it is a step
        columns = [concatenate([x, transfer @ x], -1) for x in columns]
        transfer = transfer @ transfer
    weights = np.concatenate([rule.weight for rule in rules], -1)
    return StepMap(transfer, concatenate(columns, -1)), weights


def trajectory(step_map: StepMap, start: Jet, rows: Jet, *, load: Array | None, count: int) -> Jet:
    """Return outputs C x[k] at `count` nodes, computed in blocks of √count steps.

    States at the first node of each block come from one another, those in a block from powers of T.

    Args:
        step_map: One step, x[k+1] = T x[k] + G load[k].
        start: Initial state, shape (S, N, 1).
        rows: Observation rows, shape (S, m, N).
        load: What G acts on in each step, shape (count − 1, L), or None.
        count: Number of nodes.

    Returns:
        Outputs, shape (S, count, m).
    """
    size = isqrt(count - 1) + 1  # of a block
    blocks = -(-count // size)
    powers = _powers(step_map.transfer, size)
    block_transfer = step_map.transfer @ powers[:, -1]
    observed = rows[:, None] @ powers  # C T^j, shape (S, size, m, N)
    samples, m, n = len(start.value), rows.value.shape[-2], start.value.shape[-2]
    flat = observed.map(lambda x: x.reshape((*x.shape[:-3], size * m, n)))
    if load is None:
        out = flat @ _block_starts(block_transfer, start, None, blocks)
    else:
        forced, ends = _responses_from_rest(step_map, rows, load, size, blocks)
        out = flat @ _block_starts(block_transfer, start, ends, blocks) + forced

    def in_time(x: Array) -> Array:  # from (…, S, size m, blocks) to (…, S, count, m)
        lead = x.shape[:-3]
        ordered = np.moveaxis(x.reshape((*lead, samples, size, m, blocks)), -1, -3)
        return ordered.reshape((*lead, samples, blocks * size, m))[..., :count, :]

    return out.map(in_time)


def _responses_from_rest(
    step_map: StepMap, rows: Jet, load: Array, size: int, blocks: int
) -> tuple[Jet, Jet]:
    """Return the motion in blocks of `size` steps that each start at rest under the load.

    Returns:
        Outputs, shape (S, size m, blocks), and states after a block, shape (S, N, blocks).
    """
    padded = np.zeros((blocks * size, load.shape[1]))
    padded[: len(load)] = load
    columns = padded.reshape(blocks, size, -1)
    state = step_map.load @ np.zeros((load.shape[1], blocks))
    outputs = []
    for k in range(size):  # all blocks at once
        outputs.append(rows @ state)  # eq. 18, of a linear structure
        state = step_map.transfer @ state + step_map.load @ columns[:, k].T
    return concatenate(outputs, -2), state


def _powers(transfer: Jet, count: int) -> Jet:
    """Return the powers T^0 … T^(count − 1) of a matrix by doubling, shape (S, count, N, N)."""
    eye = np.broadcast_to(np.eye(transfer.value.shape[-1]), transfer.value.shape)
    powers = Jet.constant(eye, transfer.directions)[:, None]
    next_power = transfer
    while powers.value.shape[1] < count:
        powers = concatenate([powers, powers @ next_power[:, None]], -3)
        next_power = next_power @ next_power
    return powers[:, :count]


def _block_starts(block_transfer: Jet, start: Jet, forced: Jet | None, blocks: int) -> Jet:
    """Return the states at the first node of each block, shape (S, N, blocks).

    `block_transfer` is the free motion over a block, `forced` the state after each block that
    starts at rest under the load, shape (S, N, blocks), or None without a load.
    """
    states = [start]
    for b in range(blocks - 1):
        following = block_transfer @ states[-1]
        states.append(following if forced is None else following + forced[..., b : b + 1])
    return concatenate(states, -1)
