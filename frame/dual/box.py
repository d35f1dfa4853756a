"""A box of a linear structure's inputs: models over it or a part of it, and exact motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from alphacut.frame.dual.attained import attained
from alphacut.frame.dual.expansion import Expansion
from alphacut.frame.dual.level import Level
from alphacut.frame.dual.structure import Classical, classical
from alphacut.frame.structures.linear import LinearSystem
from alphacut.fuzzy.arrays import Array, Rows


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
        ends = self.inputs(low), self.inputs(high)
        whole = over_box(self.system, self.names, *ends)
        one = [output]
        structure = replace(
            whole, rows=whole.rows[one], factor=whole.factor[one], order=whole.order[one]
        )
        moved = sources(self.system, self.structure)
        return Level.of(structure, self.system.ground, self.time[nodes], moved)

    def attained(self, unit: Array, node: Rows, output: Rows) -> Array:
        """Exact values of outputs at nodes for unit coordinates (S, d), each shape (S,)."""
        points = self.inputs(unit), unit
        places = node, output
        return attained(self.system, self.structure, self.names, points, places, self.time)


def over_box(system: LinearSystem, names: Sequence[str], low: Array, high: Array) -> Classical:
    """The structure over a box of its inputs."""
    active, centre, radius = np.flatnonzero(high > low), (low + high) / 2, (high - low) / 2
    inputs, d = Expansion.inputs(centre[active], radius[active]), len(active)
    own = {name: float(x) for name, x in zip(names, centre, strict=True)}
    p = {name: Expansion.constant(x, d) for name, x in {**system.parameters, **own}.items()}
    p |= {names[i]: inputs[place] for place, i in enumerate(active)}
    return classical(system, p)


def sources(system: LinearSystem, structure: Classical) -> tuple[str, ...]:
    """Names of what moves the structure: load, velocity, start."""
    moved = np.asarray(structure.start.size().any(-1))
    present = {"load": system.ground is not None, "velocity": moved[1], "start": moved[0]}
    return tuple(name for name, is_there in present.items() if is_there)
