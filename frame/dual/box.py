"""A box of a linear structure's inputs: models over it or a part of it, and exact motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from alphacut.frame.dual.expansion import Expansion
from alphacut.frame.dual.level import Level
from alphacut.frame.dual.structure import Classical, classical
from alphacut.frame.dual.waves import Grid, Oscillators
from alphacut.frame.response.duhamel import responses_at_named_nodes
from alphacut.frame.structures.linear import LinearSystem, evaluate
from alphacut.frame.structures.polynomial_dependence import UnprovedError
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

    def crisp_stray(self) -> Array:
        """Bound of how far the motion at the centre strays from straight lines, shape (T, m).

        Raises:
            UnprovedError: A mode does not oscillate there.
        """
        modes = _modal(self, np.zeros((1, len(self.active))))
        every, order = np.arange(len(self.structure.order)), self.structure.order
        read = modes.read(np.zeros(len(order), int), every)
        stray: Array = np.zeros((len(self.time), len(order)))
        for k, sigma in enumerate(modes.sigma[0]):
            grid = Grid(np.array([sigma.imag]), np.array([-sigma.real / sigma.imag]))
            oscillator = Oscillators(grid, self.system.ground, self.time)
            for source, share in modes.share.items():
                for o in every:
                    wave = oscillator.waves(source, int(order[o]))
                    stray[:, o] += abs(read[o, k] * share[0, k]) * wave.stray
        return stray


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


@dataclass(frozen=True, eq=False)
class Modal:
    """Modes of a structure at S points.

    Args:
        structure: The structure over the box.
        seen: Rows of all outputs on the state, shape (S, m, 2 n).
        shape: Displacements of the modes, each of unit mass, shape (S, n, n).
        sigma: Exponents −g + iω, shape (S, n), in 1/s.
        share: What each source, by its name, puts into the modes, shape (S, n).
    """

    structure: Classical
    seen: Array
    shape: Array
    sigma: Array
    share: dict[str, Array]

    def read(self, point: Rows, output: Rows) -> Array:
        """What outputs (N,) take of the modes at points (N,), shape (N, n)."""
        n, order = self.shape.shape[-1], self.structure.order[output][:, None]
        rows = self.seen[point, output]
        row = np.where(order == 1, rows[:, n:], rows[:, :n])
        row = np.where(order == 2, self.structure.rows[output], row)
        return np.asarray(np.einsum("si,sik->sk", row, self.shape[point]))


def _modal(box: Box, unit: Array) -> Modal:
    """Modes at unit coordinates (S, d).

    Raises:
        UnprovedError: One does not oscillate.
    """
    system, structure = box.system, box.structure
    matrices, seen = evaluate(system, box.names, box.inputs(unit), derivatives=False)
    M, K = matrices.mass.value, matrices.stiffness.value
    below = np.linalg.inv(np.linalg.cholesky(M))
    squared, U = np.linalg.eigh(below @ K @ below.swapaxes(-1, -2))
    shape = below.swapaxes(-1, -2) @ U
    a, b = structure.rayleigh.at(unit).T[:, :, None]
    positive = np.maximum(squared, 0.0)
    decay = (a + b * squared) / 2 + structure.ratio.at(unit) * np.sqrt(positive)
    if not (positive > decay**2).all():
        raise UnprovedError("a mode may not oscillate", "take less damping, and hold the structure")
    sigma = -decay + 1j * np.sqrt(squared - decay**2)
    share = {}
    if system.ground is not None:
        share["load"] = np.einsum("sik,sij,j->sk", shape, M, matrices.rigid[:, 0])
    for name, x in (("start", matrices.q0.value), ("velocity", matrices.v0.value)):
        share[name] = np.einsum("sik,sij,sj->sk", shape, M, x[..., 0])
    return Modal(structure, seen.value, shape, sigma, share)


def _motions(box: Box, unit: Array, node: Rows, output: Rows) -> Array:
    system, modes = box.system, _modal(box, unit)
    sigma, share = modes.sigma, modes.share
    power = sigma ** modes.structure.order[output][:, None]
    free = power * np.exp(sigma * box.time[node][:, None])
    wave = share["start"] * free.real
    wave += (share["velocity"] - sigma.real * share["start"]) * free.imag / sigma.imag
    if system.ground is not None:
        rho = responses_at_named_nodes(sigma, system.ground, box.time, node, 0)[0][0]
        wave -= share["load"] * (power * rho).imag / sigma.imag
    return np.asarray((modes.read(np.arange(len(unit)), output) * wave).sum(-1))
