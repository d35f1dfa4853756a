"""Bounds of one level: all outputs, both sides, all nodes."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from alphacut.frame.dual import kernel
from alphacut.frame.dual.eigenpairs import modes
from alphacut.frame.dual.expansion import ROUND_OFF, Expansion
from alphacut.frame.dual.homogeneous import monomials, packed
from alphacut.frame.dual.intervening import Group, Oscillator, oscillators
from alphacut.frame.dual.structure import Classical, UncoveredError
from alphacut.frame.dual.waves import Grid, Oscillators
from alphacut.frame.structures.linear import Accelerogram
from alphacut.fuzzy.arrays import Array, Rows

FINE = 0.045
"""Distance of the points of a mode's table along ω, as a share of its decay; a tenth of half of it
along g."""
POINTS = (8, 120), (3, 12)
"""Least and most of them along ω and along g/ω."""
HUGE = 1e300
"""Peak that is assumed before it is known: no gap is narrow enough to leave there."""
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
    points = _points(single, float(time[-1]))
    grids = [_grid(mode.omega_range, mode.quotient_range, points) for mode in single]
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
    made = [{o: np.stack(of_mode[o][i]) for o in orders} for i in range(3)]
    middle, half, group_stray = dict[int, Array](), dict[int, Array](), dict[int, Array]()
    if group is not None:
        grid = _grid(group.omega_range, group.quotient_range, OF_GROUP)
        oscillators = Oscillators(grid, ground if "load" in sources else None, time)
        for order in orders:
            waves = [oscillators.waves(source, order) for source in sources]
            ends = [np.stack([f(w.value, axis=(1, 2)) for w in waves]) for f in (np.min, np.max)]
            middle[order] = (ends[0] + ends[1]) / 2
            half[order] = (ends[1] - ends[0]) / 2 + np.stack([w.error for w in waves])
            group_stray[order] = np.stack([w.stray for w in waves])
    return Tables(made[0], made[1], made[2], grids, middle, half, group_stray, time)


def _points(single: Sequence[Oscillator], duration: float) -> tuple[int, int]:
    """Points of the modes' tables, all as many as the most demanding one needs."""
    most = [2.0, 2.0]
    for mode in single:
        (low, high), (least, top) = mode.omega_range, mode.quotient_range
        reach = FINE * (max(least, 0.0) * low + 2 / duration)
        most = [max(most[0], (high - low) / reach), max(most[1], (top - least) * high / reach / 4)]
    return (
        int(np.clip(most[0], *POINTS[0])) + 1,
        int(np.clip(most[1], *POINTS[1])) + 1,
    )


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
            UncoveredError: None of its modes can be enclosed.
        """
        single, group = oscillators(structure, modes(structure), sources)
        if not single:
            raise UncoveredError("dual: no mode keeps clear of the others", "take narrower inputs")
        orders = sorted({int(order) for order in structure.order})
        made = tables(single, group, ground, time, sources, orders)
        return cls(structure, single, group, made, sources)

    def bounds(self, enough: Array, effort: tuple[int, int], workers: int) -> tuple[Array, Array]:
        """Upper bounds of (−output, output), shape (T, m, 2), and inputs that lead there.

        A first pass takes few steps at all nodes; a second one halves ranges where gaps are wide.

        Args:
            enough: Gap of each output at which its bounds are left, shape (m,).
            effort: Most slabs of a bound, and most evaluations for each.
            workers: Threads.

        Returns:
            The bounds, and unit coordinates, shape (T, m, 2, d).
        """
        problems = [
            Problem.of(self, o, s, float(enough[o])) for o in range(len(enough)) for s in (0, 1)
        ]
        problems[0].run(np.arange(0), (1, 1))  # compiles before there are threads
        nodes = np.arange(len(self.tables.time))

        def run(job: tuple[Problem, Rows, tuple[int, int]]) -> None:
            problem, own, most = job
            problem.run(own, most)

        for first in (True, False):
            most = (1, FIRST) if first else effort
            jobs = [
                (problem, own, most)
                for problem in problems
                for own in _blocks(nodes if first else problem.left(), workers)
            ]
            with ThreadPoolExecutor(workers) as pool:
                list(pool.map(run, jobs))
        out = np.stack([problem.out[0] for problem in problems], -1)
        at = np.stack([problem.at for problem in problems], 1)
        shape = (len(nodes), len(enough), 2)
        return out.reshape(shape), at.reshape(*shape, -1)

    def stray(self) -> Array:
        """Bound of how far outputs stray from straight lines in the step to each node, (T, m)."""
        made = self.tables
        columns = []
        for o in range(len(self.structure.order)):
            order, total = int(self.structure.order[o]), np.zeros(len(made.time))
            for k, mode in enumerate(self.single):
                total = total + mode.share.size()[:, o] @ made.stray[order][k]
            if self.group is not None:
                total = total + self.group.doubt[:, o] @ made.group_stray[order]
            columns.append(total)
        return np.stack(columns, -1)


@dataclass(frozen=True, eq=False)
class Problem:
    """Bounds of one output and side at all nodes.

    Args:
        side: −1 or 1.
        enough: Gap at which a bound is left.
        constant: What the motion has besides the model, and what a bound has besides, (2, T).
        data: What the kernel reads.
        out: Bounds, the model's values, evaluations and slabs, shape (4, T).
        at: Inputs of the model's values, shape (T, d).
    """

    side: float
    enough: float
    constant: Array
    data: kernel.Data
    out: Array
    at: Array

    @classmethod
    def of(cls, level: Level, o: int, s: int, enough: float) -> Problem:
        """Of one output of a level."""
        order, side = int(level.structure.order[o]), (-1.0, 1.0)[s]
        total, d = len(level.tables.time), level.structure.rayleigh.inner
        scale, share, models = _models(level, o)
        group, constant = _group(level, o, side)
        grids = level.tables.grids
        place, grid = _places(grids, scale), _grid_numbers(grids)
        data = (level.tables.value[order], place, grid, scale, share, models, group)
        out = np.full((4, total), np.inf)
        out[1] = -np.inf
        return cls(side, enough, constant, data, out, np.zeros((total, d)))

    @property
    def top(self) -> float:
        """The largest value so far, or 0."""
        return float(max(self.out[1].max(initial=0.0), 0.0))

    def left(self) -> Rows:
        """Nodes whose gap is too wide."""
        allowed = self.enough + kernel.LOOSE * np.maximum(self.top - self.out[1], 0.0)
        return np.flatnonzero(self.out[0] - self.out[1] > allowed)

    def run(self, nodes: Rows, effort: tuple[int, int]) -> None:
        """Improve the bounds at nodes, with at most so many slabs and evaluations."""
        out, at = np.empty((4, len(nodes))), np.empty((len(nodes), self.at.shape[1]))
        mu, u = np.zeros(len(self.data[5][0])), np.zeros(self.at.shape[1])
        top = self.top if effort[0] > 1 else HUGE
        ends = self.enough, top
        kernel.bounds(nodes, self.side, *effort, *ends, self.constant, self.data, mu, u, out, at)
        better = out[1] > self.out[1, nodes]
        self.at[nodes[better]] = at[better]
        self.out[1, nodes] = np.maximum(self.out[1, nodes], out[1])
        self.out[0, nodes] = np.minimum(self.out[0, nodes], out[0])
        self.out[2:, nodes] = out[2:]


def _models(level: Level, o: int) -> tuple[kernel.Pair, kernel.Pair, kernel.Models]:
    """Centres and radii of ω and g, of the shares, and scaled models of all of them."""
    both = [[mode.omega, mode.decay] for mode in level.single]
    shares = [[mode.share[s, o] for s in range(len(level.sources))] for mode in level.single]

    def ends(of: list[list[Expansion]]) -> kernel.Pair:
        return (
            np.array([[float(x.parts[0]) for x in own] for own in of]),
            np.array([[_spread(x) for x in own] for own in of]),
        )

    every = [x for own, share in zip(both, shares, strict=True) for x in [*own, *share]]
    rows = [_scaled(x, _spread(x)) for x in every]
    linear, quadratic, cubic, rest = (np.stack(column) for column in zip(*rows, strict=True))
    size = np.abs(cubic).sum(1)
    models = (linear, quadratic, rest + kernel.EXPECTED * size, cubic, size)
    return ends(both), ends(shares), models


def _group(level: Level, o: int, side: float) -> tuple[kernel.Triple, Array]:
    """The group's part of the dual function, and all constants at all nodes."""
    made, d, order = level.tables, level.structure.rayleigh.inner, int(level.structure.order[o])
    constant: Array = np.zeros((2, len(made.time)))
    for k, mode in enumerate(level.single):
        constant[1] += mode.share.size()[:, o] @ made.error[order][k]
    if level.group is None:
        return (np.zeros((0, 1)), np.zeros((0, d)), np.zeros((0, d * (d + 1) // 2))), constant
    share, middle = level.group.share[:, o], made.middle[order]
    rows = [_scaled(share[s], 1.0) for s in range(len(level.sources))]
    linear, quadratic, cubic, rest = (np.stack(column) for column in zip(*rows, strict=True))
    rest = rest + np.abs(cubic).sum(1)
    constant[0] += side * share.parts[0] @ middle
    constant[1] += rest @ np.abs(middle) + level.group.doubt[:, o] @ made.half[order]
    return (middle, linear, quadratic), constant


def _spread(x: Expansion) -> float:
    return max(float(x.spread()), 1e-9 * abs(float(x.parts[0])), 1e-300)


def _scaled(x: Expansion, radius: float) -> tuple[Array, Array, Array, float]:
    """Linear, packed quadratic and cubic parts, and the bound of the rest, over radius."""
    bend, twist = (packed(x.parts[m], m) / radius for m in (2, 3))
    # pairs by rows, as the kernel has them
    lists = monomials(x.inner, 2)
    order = np.lexsort((lists[:, 1], lists[:, 0]))
    rest = float((x.rest + ROUND_OFF * np.abs(x.parts[0])) / radius)
    return x.parts[1] / radius, bend[order], twist, rest


def _blocks(nodes: Rows, workers: int) -> list[Rows]:
    """Nodes in pieces for the threads."""
    return np.array_split(nodes, max(1, min(workers, len(nodes) // 40))) if len(nodes) else []


def _places(grids: Sequence[Grid], scale: tuple[Array, Array]) -> tuple[Array, Array]:
    """Scaled ω and g of all points of the modes' tables, each shape (K, Q W)."""
    centre, radius = scale
    omega = np.stack([np.tile(g.omega, len(g.quotient)) for g in grids])
    decay = np.stack([(g.quotient[:, None] * g.omega).ravel() for g in grids])
    both = [(x - centre[:, [i]]) / radius[:, [i]] for i, x in enumerate((omega, decay))]
    return both[0], both[1]


def _grid_numbers(grids: Sequence[Grid]) -> tuple[Array, Array, tuple[int, int]]:
    """Starts and steps along ω and q, each (K, 2), and how many points along q and ω."""
    start = np.array([[g.omega[0], g.quotient[0]] for g in grids])
    step = np.array([[g.omega[1] - g.omega[0], g.quotient[1] - g.quotient[0]] for g in grids])
    return start, step, (len(grids[0].quotient), len(grids[0].omega))
