"""A box of a linear structure's inputs: models over it or a part of it, and exact motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numba
import numpy as np

from alphacut.frame.dual.expansion import Expansion
from alphacut.frame.dual.level import Level
from alphacut.frame.dual.structure import Classical, classical
from alphacut.frame.dual.waves import ALONE, phases_of, step_integrals
from alphacut.frame.structures.linear import LinearSystem, evaluate
from alphacut.fuzzy.arrays import Array, Rows

PIECE = 4000
"""Points whose exact motions are computed together."""


@dataclass(frozen=True, eq=False)
class Box:
    """Inputs of a structure between two ends, d of which have a width.

    Args:
        system: The structure.
        names: Its inputs, n of them.
        time: Nodes, shape (T,), in s.
        low: Lower ends, shape (n,), in SI units.
        high: Upper ends.
    """

    system: LinearSystem
    names: tuple[str, ...]
    time: Array
    low: Array
    high: Array

    @property
    def active(self) -> Rows:
        """Places of the inputs that have a width, shape (d,)."""
        return np.flatnonzero(self.high > self.low)

    @property
    def centre(self) -> Array:
        """Middle of all inputs, shape (n,)."""
        return np.asarray((self.low + self.high) / 2)

    @cached_property
    def structure(self) -> Classical:
        """The structure over the whole box."""
        return over_box(self.system, self.names, self.low, self.high)

    def inputs(self, unit: Array) -> Array:
        """Inputs (…, n) in SI units for unit coordinates (…, d)."""
        points = np.tile(self.centre, (*unit.shape[:-1], 1))
        points[..., self.active] += ((self.high - self.low) / 2)[self.active] * unit
        return np.clip(points, self.low, self.high)

    def level(self) -> Level:
        """Models of all outputs at all nodes."""
        moved = sources(self.system, self.structure)
        return Level.of(self.structure, self.system.ground, self.time, moved)

    def part(self, output: int, nodes: Rows, low: Array, high: Array) -> Level:
        """Models of one output at some nodes over the part between unit coordinates (d,)."""
        whole = over_box(self.system, self.names, self.inputs(low), self.inputs(high))
        one = slice(output, output + 1)
        structure = replace(
            whole, rows=whole.rows[one], factor=whole.factor[one], order=whole.order[one]
        )
        moved = sources(self.system, self.structure)
        return Level.of(structure, self.system.ground, self.time[nodes], moved)

    def attained(self, unit: Array, node: Rows, output: Rows) -> Array:
        """Exact values of outputs at nodes for unit coordinates (S, d), each shape (S,)."""
        pieces = np.array_split(np.arange(len(unit)), -(-len(unit) // PIECE))
        return np.concatenate([_motions(self, unit[i], node[i], output[i]) for i in pieces])


def over_box(system: LinearSystem, names: Sequence[str], low: Array, high: Array) -> Classical:
    """The structure over a box of its inputs."""
    active, centre, radius = np.flatnonzero(high > low), (low + high) / 2, (high - low) / 2
    inputs, d = Expansion.inputs(centre[active], radius[active]), len(active)
    own = {name: float(x) for name, x in zip(names, centre, strict=True)}
    p = {name: Expansion.constant(x, d) for name, x in {**system.parameters, **own}.items()}
    p |= {names[int(i)]: inputs[place] for place, i in enumerate(active)}
    return classical(system, p)


def sources(system: LinearSystem, structure: Classical) -> tuple[str, ...]:
    """Names of what moves the structure: load, velocity, start."""
    moved = np.asarray(structure.start.size().any(-1))
    present = {"load": system.ground is not None, "velocity": moved[1], "start": moved[0]}
    return tuple(name for name, is_there in present.items() if is_there)


def _motions(box: Box, unit: Array, node: Rows, output: Rows) -> Array:
    system, structure = box.system, box.structure
    matrices, seen = evaluate(system, box.names, box.inputs(unit), derivatives=False)
    M, K = matrices.mass.value, matrices.stiffness.value
    n = M.shape[-1]
    below = np.linalg.inv(np.linalg.cholesky(M))
    squared, U = np.linalg.eigh(below @ K @ below.swapaxes(-1, -2))
    shape = below.swapaxes(-1, -2) @ U
    a, b = structure.rayleigh.at(unit).T[:, :, None]
    decay = (a + b * squared) / 2 + structure.ratio.at(unit) * np.sqrt(squared)
    sigma = -decay + 1j * np.sqrt(squared - decay**2)
    every, order = np.arange(len(unit)), structure.order[output]
    row = np.where(
        (order == 1)[:, None], seen.value[every, output, n:], seen.value[every, output, :n]
    )
    row = np.where((order == 2)[:, None], structure.rows[output], row)
    read = np.einsum("si,sik->sk", row, shape)
    power = sigma ** order[:, None]
    start = [np.einsum("sij,sjk->sik", M, x.value)[..., 0] for x in (matrices.q0, matrices.v0)]
    q, v = (np.einsum("sik,si->sk", shape, x) for x in start)
    free = power * np.exp(sigma * box.time[node][:, None])
    wave = (v + decay * q) * free.imag / sigma.imag + q * free.real
    if system.ground is not None:
        driven = np.einsum("sik,sij,j->sk", shape, M, matrices.rigid[:, 0])
        wave = wave - driven * (power * _load(system, sigma, node, box.time)).imag / sigma.imag
    return np.asarray((read * wave).sum(-1))


def _load(system: LinearSystem, sigma: Array, node: Rows, time: Array) -> Array:
    """ρ(σ; t) at one node for each point, shape (S, n)."""
    assert system.ground is not None
    left, right, last, phases, which = phases_of(system.ground, time)
    out = np.empty(sigma.shape, complex)
    with ALONE:
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
