"""Bounds of one level: all outputs, both sides, all nodes."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from alphacut.frame.dual import kernel
from alphacut.frame.dual.eigenpairs import modes
from alphacut.frame.dual.expansion import ROUND_OFF, Expansion
from alphacut.frame.dual.intervening import Group, Oscillator, oscillators
from alphacut.frame.dual.structure import Classical
from alphacut.frame.dual.waves import Grid, Oscillators
from alphacut.frame.structures.linear import Accelerogram
from alphacut.fuzzy.arrays import Array

POINTS = (70, 10)
"""Points of a mode's table along ω and along g/ω."""
FIRST = 40
"""Most evaluations for a bound before the peaks are known."""
OF_GROUP = (160, 8)
"""The same of the group's, over its own range."""


@dataclass(frozen=True, eq=False)
class Tables:
    """Responses of the oscillators of a level, by order of the derivative that is observed.

    Args:
        value: For each order responses, shape (K, sources, T, Q W).
        error: Bounds of what interpolation and round-off miss, shape (K, sources, T).
        stray: Bounds of what responses stray from straight lines in the step to a node, the same.
        grids: For each mode its points.
        middle: Of the group, half way between its least and greatest response, (sources, T).
        half: Half their distance, with the tables' error.
        group_stray: As `stray`.
        time: Nodes, shape (T,), in s.
    """

    value: dict[int, Array]
    error: dict[int, Array]
    stray: dict[int, Array]
    grids: list[Grid]
    middle: dict[int, Array]
    half: dict[int, Array]
    group_stray: dict[int, Array]
    time: Array


def tables(
    single: Sequence[Oscillator],
    group: Group | None,
    ground: Accelerogram | None,
    time: Array,
    sources: tuple[str, ...],
    orders: Sequence[int],
) -> Tables:
    """Tables of all modes and of the group."""
    grids = [_grid(mode.omega_range, mode.quotient_range, POINTS) for mode in single]
    of_mode: dict[int, list[list[Array]]] = {order: [[], [], []] for order in orders}
    for grid in grids:
        oscillators = Oscillators(grid, ground if "load" in sources else None, time)
        for order in orders:
            waves = [oscillators.waves(source, order) for source in sources]
            of_mode[order][0].append(np.stack([w.value.reshape(len(time), -1) for w in waves]))
            largest = [np.abs(w.value).max((1, 2)) for w in waves]
            error = [w.error + ROUND_OFF * x for w, x in zip(waves, largest, strict=True)]
            of_mode[order][1].append(np.stack(error))
            of_mode[order][2].append(np.stack([w.stray for w in waves]))
    value, error, stray = ({o: np.stack(of_mode[o][i]) for o in orders} for i in range(3))
    middle, half, group_stray = {}, {}, {}
    if group is not None:
        grid = _grid(group.omega_range, group.quotient_range, OF_GROUP)
        oscillators = Oscillators(grid, ground if "load" in sources else None, time)
        for order in orders:
            waves = [oscillators.waves(source, order) for source in sources]
            ends = [np.stack([f(w.value, axis=(1, 2)) for w in waves]) for f in (np.min, np.max)]
            middle[order] = (ends[0] + ends[1]) / 2
            half[order] = (ends[1] - ends[0]) / 2 + np.stack([w.error for w in waves])
            group_stray[order] = np.stack([w.stray for w in waves])
    return Tables(value, error, stray, grids, middle, half, group_stray, time)


def _grid(
    omega: tuple[float, float], quotient: tuple[float, float], points: tuple[int, int]
) -> Grid:
    """Points that span a range; at least two along each axis."""
    q = quotient if quotient[1] > quotient[0] else (quotient[0], quotient[0] + 1e-12)
    w = omega if omega[1] > omega[0] * (1 + 1e-12) else (omega[0], omega[0] * (1 + 1e-9))
    return Grid(np.linspace(*w, points[0]), np.linspace(*q, points[1]))


@dataclass(frozen=True, eq=False)
class Level:
    """One level's models and tables.

    Args:
        structure: The structure over the level's box.
        single: Its single modes.
        group: The others, or None.
        tables: Responses.
        sources: Names of what moves the structure.
    """

    structure: Classical
    single: list[Oscillator]
    group: Group | None
    tables: Tables
    sources: tuple[str, ...]

    @classmethod
    def of(
        cls,
        structure: Classical,
        ground: Accelerogram | None,
        time: Array,
        sources: tuple[str, ...],
    ) -> Level:
        """The level of a structure over its box.

        Raises:
            UncoveredError: Its modes cannot be enclosed.
        """
        single, group = oscillators(structure, modes(structure), sources)
        orders = sorted(set(structure.order.tolist()))
        made = tables(single, group, ground, time, sources, orders)
        return cls(structure, single, group, made, sources)

    def bounds(self, enough: Array, effort: tuple[int, int], workers: int) -> tuple[Array, Array]:
        """Upper bounds of (−output, output), shape (T, m, 2), and inputs that lead there.

        Args:
            enough: Gap of each output at which its bounds are left, shape (m,).
            effort: Most slabs of a bound, and most evaluations for each.
            workers: Threads.

        Returns:
            The bounds, and unit coordinates, shape (T, m, 2, d).
        """
        m, d = len(enough), self.structure.rayleigh.inner
        total = len(self.tables.time)
        for o in range(m):  # compiles before there are threads
            self._one(o, 0, np.arange(0), (1.0, 1.0), effort)
        out, at = np.empty((4, total, m, 2)), np.empty((total, m, 2, d))
        open_ = np.ones((total, m, 2), bool)
        for slabs, steps in ((1, FIRST), effort):
            top = np.max(out[1], axis=0) if slabs > 1 else np.full((m, 2), 1e300)
            jobs = [
                (o, s, nodes)
                for o in range(m)
                for s in (0, 1)
                for nodes in _blocks(np.flatnonzero(open_[:, o, s]), workers)
            ]

            def run(
                job: tuple[int, int, Array],
                top: Array = top,
                effort: tuple[int, int] = (slabs, steps),
            ) -> None:
                o, s, nodes = job
                found, where = self._one(o, s, nodes, (float(enough[o]), float(top[o, s])), effort)
                out[:, nodes, o, s], at[nodes, o, s] = found, where

            with ThreadPoolExecutor(workers) as pool:
                list(pool.map(run, jobs))
            top = np.maximum(np.max(out[1], axis=0), 0.0)
            left = enough[:, None] + kernel.LOOSE * np.maximum(top - out[1], 0.0)
            open_ = out[0] - out[1] > left
        return out[0], at

    def _one(
        self, o: int, s: int, nodes: Array, ends: tuple[float, float], effort: tuple[int, int]
    ) -> tuple[Array, Array]:
        """Bounds of one output and side at nodes, and what `kernel.bounds` tells besides."""
        order, side = int(self.structure.order[o]), (-1.0, 1.0)[s]
        scale, share, models = self._models(o)
        group, constant = self._group(o, order, side)
        place = _places(self.tables.grids, scale)
        grid = _grid_numbers(self.tables.grids)
        data = (self.tables.value[order], place, grid, scale, share, models, group)
        d = self.structure.rayleigh.inner
        mu, u = np.zeros(len(models[0])), np.zeros(d)
        out, at = np.empty((4, len(nodes))), np.empty((len(nodes), d))
        kernel.bounds(nodes, side, *effort, *ends, constant, data, mu, u, out, at)
        return out, at

    def _models(self, o: int):
        """Centres and radii of ω and g, of the shares, and scaled models of all of them."""
        rows, centre, radius, middle, reach = [], [], [], [], []
        for mode in self.single:
            own = [mode.omega, mode.decay]
            centre.append([float(x.parts[0]) for x in own])
            radius.append([_spread(x) for x in own])
            shares = [mode.share[s, o] for s in range(len(self.sources))]
            middle.append([float(x.parts[0]) for x in shares])
            reach.append([_spread(x) for x in shares])
            rows += [
                _scaled(x, r) for x, r in zip(own + shares, radius[-1] + reach[-1], strict=True)
            ]
        models = tuple(np.stack(column) for column in zip(*rows, strict=True))
        return (np.array(centre), np.array(radius)), (np.array(middle), np.array(reach)), models

    def _group(self, o: int, order: int, side: float):
        """The group's part of the second line, and all constants at all nodes (T,)."""
        made, d = self.tables, self.structure.rayleigh.inner
        constant = np.zeros((2, made.error[order].shape[-1]))
        for k, mode in enumerate(self.single):
            constant[1] += mode.share.size()[:, o] @ made.error[order][k]
        if self.group is None:
            return (np.zeros((0, 1)), np.zeros((0, d)), np.zeros((0, d * (d + 1) // 2))), constant
        share, middle = self.group.share[:, o], made.middle[order]
        rows = [_scaled(share[s], 1.0) for s in range(len(self.sources))]
        linear, quadratic, doubt = (np.stack(column) for column in zip(*rows, strict=True))
        constant[0] += side * share.parts[0] @ middle
        constant[1] += doubt @ np.abs(middle) + self.group.doubt[:, o] @ made.half[order]
        return (middle, linear, quadratic), constant

    def stray(self) -> Array:
        """Bound of how far outputs stray from straight lines in the step to each node, (T, m)."""
        made = self.tables
        columns = []
        for o, order in enumerate(self.structure.order.tolist()):
            total = sum(
                mode.share.size()[:, o] @ made.stray[order][k] for k, mode in enumerate(self.single)
            )
            if self.group is not None:
                total = total + self.group.doubt[:, o] @ made.group_stray[order]
            columns.append(total)
        return np.stack(columns, -1)


def _spread(x: Expansion) -> float:
    return max(float(x.spread()), 1e-12 * abs(float(x.parts[0])), 1e-300)


def _scaled(x: Expansion, radius: float) -> tuple[Array, Array, float]:
    """Linear part, upper triangle of the quadratic part, and the bound of the rest, over radius."""
    d = x.inner
    bend = (2 - np.eye(d)) * x.parts[2]
    return (
        x.parts[1] / radius,
        bend[np.triu_indices(d)] / radius,
        float((x.sizes()[3] + x.rest) / radius),
    )


def _blocks(nodes: Array, workers: int) -> list[Array]:
    """Nodes in pieces for the threads."""
    return np.array_split(nodes, max(1, min(workers, len(nodes) // 40))) if len(nodes) else []


def _places(grids: Sequence[Grid], scale: tuple[Array, Array]) -> tuple[Array, Array]:
    """Scaled ω and g of all points of the modes' tables, each shape (K, Q W)."""
    centre, radius = scale
    omega = np.stack([np.tile(g.omega, len(g.quotient)) for g in grids])
    decay = np.stack([(g.quotient[:, None] * g.omega).ravel() for g in grids])
    both = [(x - centre[:, [i]]) / radius[:, [i]] for i, x in enumerate((omega, decay))]
    return both[0], both[1]


def _grid_numbers(grids: Sequence[Grid]):
    start = np.array([[g.omega[0], g.quotient[0]] for g in grids])
    step = np.array([[g.omega[1] - g.omega[0], g.quotient[1] - g.quotient[0]] for g in grids])
    return start, step, (len(grids[0].quotient), len(grids[0].omega))
