"""Values of the exact motion at single nodes, for many sets of inputs together."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from alphacut.frame.dual.structure import Classical
from alphacut.frame.dual.waves import phases_of, step_integrals
from alphacut.frame.structures.linear import LinearSystem, evaluate
from alphacut.fuzzy.arrays import Array, Rows

PIECE = 4000
"""Points treated together."""


def attained(
    system: LinearSystem,
    structure: Classical,
    names: Sequence[str],
    points: tuple[Array, Array],
    places: tuple[Rows, Rows],
    time: Array,
) -> Array:
    """Values of one output at one node for each of S points, shape (S,).

    Args:
        system: The structure.
        structure: The same over a box.
        names: Inputs of the structure, n of them.
        points: Their values, shape (S, n), in SI units, and their unit coordinates in the box of
            `structure`, shape (S, d).
        places: Nodes and outputs, each shape (S,).
        time: All nodes, in s.
    """
    pieces = np.array_split(np.arange(len(points[0])), -(-len(points[0]) // PIECE))
    (physical, unit), (node, output) = points, places
    parts = [
        _piece(system, structure, names, physical[i], unit[i], node[i], output[i], time)
        for i in pieces
    ]
    return np.concatenate(parts)


def _piece(
    system: LinearSystem,
    structure: Classical,
    names: Sequence[str],
    points: Array,
    unit: Array,
    node: Rows,
    output: Rows,
    time: Array,
) -> Array:
    matrices, seen = evaluate(system, names, points, derivatives=False)
    M, K = matrices.mass.value, matrices.stiffness.value
    n = M.shape[-1]
    below = np.linalg.inv(np.linalg.cholesky(M))
    squared, U = np.linalg.eigh(below @ K @ below.swapaxes(-1, -2))
    shape = below.swapaxes(-1, -2) @ U
    a, b = structure.rayleigh.at(unit).T[:, :, None]
    decay = (a + b * squared) / 2 + structure.ratio.at(unit) * np.sqrt(squared)
    sigma = -decay + 1j * np.sqrt(squared - decay**2)
    every, order = np.arange(len(points)), structure.order[output]
    row = np.where(
        (order == 1)[:, None], seen.value[every, output, n:], seen.value[every, output, :n]
    )
    row = np.where((order == 2)[:, None], structure.rows[output], row)
    read = np.einsum("si,sik->sk", row, shape)
    power = sigma ** order[:, None]
    start = [np.einsum("sij,sjk->sik", M, x.value)[..., 0] for x in (matrices.q0, matrices.v0)]
    q, v = (np.einsum("sik,si->sk", shape, x) for x in start)
    free = power * np.exp(sigma * time[node][:, None])
    wave = (v + decay * q) * free.imag / sigma.imag + q * free.real
    if system.ground is not None:
        driven = np.einsum("sik,sij,j->sk", shape, M, matrices.rigid[:, 0])
        wave = wave - driven * (power * _load(system, sigma, node, time)).imag / sigma.imag
    return np.asarray((read * wave).sum(-1))


def _load(system: LinearSystem, sigma: Array, node: Rows, time: Array) -> Array:
    """ρ(σ; t) at one node for each point, shape (S, n)."""
    assert system.ground is not None
    left, right, last, phases, which = phases_of(system.ground, time)
    out = np.empty(sigma.shape, complex)
    _march(sigma, left, right, system.ground.step, phases[which][node], last[node], out)
    return out


@numba.njit(cache=True, parallel=True)
def _march(
    sigma: Array, left: Array, right: Array, h: float, phase: Array, last: Rows, out: Array
) -> None:
    """Writes ρ at the node of each point, by recursion over the record."""
    for s in numba.prange(len(sigma)):
        J = np.empty(4, np.complex128)
        for k in range(sigma.shape[1]):
            step_integrals(sigma[s, k], h, J)
            turn = np.exp(sigma[s, k] * h)
            at_end, by_slope = J[0], -J[1] / h
            rho = 0.0 + 0.0j
            for i in range(last[s]):
                rho = turn * rho + right[i] * at_end + (right[i] - left[i]) * by_slope
            x = phase[s]
            step_integrals(sigma[s, k], x, J)
            slope = (right[last[s]] - left[last[s]]) / h
            rho = np.exp(sigma[s, k] * x) * rho + (left[last[s]] + slope * x) * J[0] - slope * J[1]
            out[s, k] = rho
