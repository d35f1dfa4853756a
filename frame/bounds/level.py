"""Bounds of one level: all outputs, both sides, all nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from alphacut.frame.bounds.dual_function import EXPECTED, Data, require_in_range, roundings
from alphacut.frame.bounds.slabs import Effort, bounds
from alphacut.frame.calculus.monomials import monomials
from alphacut.frame.calculus.rounding import gamma
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate
from alphacut.frame.modes.intervening import Excitation, Oscillator
from alphacut.frame.modes.models import MotionModels
from alphacut.frame.modes.structure import Classical
from alphacut.frame.response.oscillators import Grid, Oscillators, grid_over
from alphacut.frame.structures.loads import History
from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.progress_bar import Progress, subprogress

FINE = 0.07
"""Distance of the points of a mode's table along ω and g, as a share of its decay."""
POINTS = (8, 80), (3, 12)
"""Least and most of them along ω and along g/ω."""
HUGE = 1e300
"""Its negative stands for −∞, a value that is not known."""
LEAST_SPREAD = 1e-30
"""Radius in SI units of a variable that does not vary, so that scaled ones stay finite."""
AT_PEAKS = 6
"""Multiple of the slabs that nodes are worth whose bounds lie above the peak."""
FLOORS = 1.0, 0.25
"""Multiples of the remainders' own part below which no effort is made: elsewhere, and there."""
WORK_OF_PASSES = 0.0, 0.05, 0.75, 1.0
"""Shares of the work at which the passes of a level begin and end, about."""
GRAIN = 2.0**-24
"""Distance of multipliers as a share of the output's modal responses: far above rounding, so that
units do not lead them elsewhere, and far below gaps."""
BLOCK = 40
"""Nodes of a piece, about."""


@dataclass(frozen=True, eq=False)
class ResponseTables:
    """Responses of the oscillators of a level, by order of the derivative that is observed.

    Args:
        value: For each order responses, shape (K, sources, T, Q W).
        error: Bounds of what interpolation and round-off miss, shape (K, sources, T).
        line_deviation: Bounds of their distance from straight lines between nodes, the same.
        grids: For each mode its points.
        time: Nodes, shape (T,), in s.

    Raises:
        UnprovedError: A response is out of the range of the dual function.
    """

    value: dict[int, Array]
    error: dict[int, Array]
    line_deviation: dict[int, Array]
    grids: list[Grid]
    time: Array

    def __post_init__(self) -> None:
        for value in self.value.values():
            require_in_range({"table": value})


def response_tables(
    single: Sequence[Oscillator], excitation: Excitation, orders: Rows
) -> ResponseTables:
    """Tables of the responses of all oscillators to all sources, with bounds of their errors.

    Args:
        single: The oscillators.
        excitation: The loads, the nodes and the names of the sources.
        orders: Derivative of the motion that each output takes, shape (m,).
    """
    loads, time, sources = excitation
    points, distinct = _points(single, float(time[-1])), sorted(map(int, set(orders)))
    grids = [grid_over(mode.omega_range, mode.quotient_range, points) for mode in single]
    modes = [_responses(grid, loads, time, sources, distinct) for grid in grids]
    value, error, line_deviation = (
        {order: np.stack([mode[order][i] for mode in modes]) for order in distinct}
        for i in range(3)
    )
    count = roundings(len(single), len(sources), single[0].omega.inputs)
    for order in distinct:  # of the sums that the responses enter
        error[order] = error[order] + 2 * gamma(count) * np.abs(value[order]).max(-1)
    return ResponseTables(value, error, line_deviation, grids, time)


def _responses(
    grid: Grid,
    loads: Mapping[str, History],
    time: Array,
    sources: Sequence[str],
    orders: Sequence[int],
) -> dict[int, tuple[Array, Array, Array]]:
    """By order: responses over a grid, shape (sources, T, Q W), and bounds of their errors.

    The errors, (sources, T) each, are those of interpolation over the grid with rounding, and of
    straight lines between nodes.
    """
    oscillators = Oscillators(grid, loads, time)
    responses = {}
    for order in orders:
        waves = [oscillators.responses(source, order) for source in sources]
        value = np.stack([wave.value.reshape(len(time), -1) for wave in waves])
        error = np.stack([wave.error for wave in waves])
        responses[order] = value, error, np.stack([wave.line_deviation for wave in waves])
    return responses


def _points(single: Sequence[Oscillator], duration: float) -> tuple[int, int]:
    """Numbers of table points along ω and along q = g/ω, the same for all modes."""
    along_omega, along_q, slowest = 2.0, 2.0, 2 / duration if duration > 0 else np.inf
    for mode in single:
        (omega_low, omega_high), (q_low, q_high) = mode.omega_range, mode.quotient_range
        spacing = FINE * (max(q_low, 0.0) * omega_low + slowest)
        along_omega = max(along_omega, (omega_high - omega_low) / spacing)
        along_q = max(along_q, (q_high - q_low) * omega_high / spacing)
    return int(np.clip(along_omega, *POINTS[0])) + 1, int(np.clip(along_q, *POINTS[1])) + 1


@dataclass(frozen=True, eq=False)
class LevelModels:
    """One level's models and tables.

    Args:
        structure: The structure over the level's box.
        models: Its motion.
        tables: Responses of its oscillators.
        sources: Names of what moves the structure.
    """

    structure: Classical
    models: MotionModels
    tables: ResponseTables
    sources: tuple[str, ...]

    @property
    def oscillators(self) -> list[Oscillator]:
        """Oscillators, one for each mode that is enclosed."""
        return self.models.oscillators

    def within(self, low: Array, high: Array) -> LevelModels:
        """Models over the part low ≤ u ≤ high of the box, with the same response tables."""
        return replace(self, models=self.models.within(low, high))

    @classmethod
    def from_structure(
        cls,
        structure: Classical,
        loads: Mapping[str, History],
        time: Array,
        sources: tuple[str, ...],
        allowed: Array | None = None,
    ) -> LevelModels:
        """Models of a structure's motion over its box, and the response tables of its oscillators.

        Args:
            structure: The structure.
            loads: Histories by name.
            time: Nodes, shape (T,), in s.
            sources: Names of what moves the structure.
            allowed: Truncation error of each output that is allowed, shape (m,);
                None to enclose as many modes as possible.

        Raises:
            UnprovedError: None of its modes can be enclosed.
        """
        excitation = (loads, time, sources)
        models = MotionModels.from_structure(structure, excitation, allowed)
        return cls(
            structure,
            models,
            response_tables(models.oscillators, excitation, structure.order),
            sources,
        )

    def bounds(
        self,
        enough: Array,
        below: float,
        slabs: int,
        steps: int,
        workers: int,
        tick: Progress | None = None,
    ) -> tuple[Array, Array]:
        """Upper bounds of (−output, output), shape (T, m, 2), and inputs of near values.

        A first pass at all nodes shows the peaks; a second one halves ranges where gaps are wide; a
        third one halves them further where bounds lie above the peak.

        Args:
            enough: Gap between bound and attained value of each output that suffices, shape (m,).
            below: Further gap allowed, as a share of the bound's distance below the peak.
            slabs: Most slabs (parts of a range) of a bound in the second pass.
            steps: Most evaluations of the dual function for each.
            workers: Threads.
            tick: Called with the completed fraction.

        Returns:
            The bounds, and unit coordinates of the best inputs found, shape (T, m, 2, d).
        """
        problems = [
            OutputBounds.initial(self, o, s, float(enough[o]))
            for o in range(len(enough))
            for s in (0, 1)
        ]
        problems[0].run(np.arange(0), 1, 1, 0.0, 0.0)  # compiles before there are threads
        passes = (
            (1, 1, 0.0, 0.0),
            (slabs, steps, below, FLOORS[0]),
            (AT_PEAKS * slabs, steps, 1.0, FLOORS[1]),
        )
        with ThreadPoolExecutor(workers) as pool:
            for number, (slabs, steps, slack_below_peak, remainder_multiple) in enumerate(passes):
                # what a pass compares with is fixed before its first block: no result depends on
                # which thread ends first
                efforts = [
                    problem.effort(slabs, steps, slack_below_peak, remainder_multiple)
                    for problem in problems
                ]
                jobs = [
                    pool.submit(problem.improve, nodes, effort)
                    for problem, effort in zip(problems, efforts, strict=True)
                    for nodes in _blocks(problem.open_nodes(slack_below_peak))
                ]
                advance = subprogress(tick, *WORK_OF_PASSES[number : number + 2])
                for done, job in enumerate(jobs, start=1):
                    job.result()
                    advance(done / len(jobs))
        out = np.stack([problem.out[0] for problem in problems], -1)
        at = np.stack([problem.at for problem in problems], 1)
        shape = (len(out), len(enough), 2)
        return out.reshape(shape), at.reshape(*shape, -1)

    def line_deviation(self) -> Array:
        """Bound of how far outputs stray from straight lines in the step to each node, (T, m)."""
        tables = self.tables
        columns = []
        for o in range(len(self.structure.order)):
            order = int(self.structure.order[o])
            total: Array = np.zeros(len(tables.time))
            for k, mode in enumerate(self.oscillators):
                total = total + mode.share.size()[:, o] @ tables.line_deviation[order][k]
            for truncated in self.models.truncated:
                total = total + truncated.line_deviation[:, o]
            columns.append(total + self.models.line_deviation[:, o])
        return np.stack(columns, -1)


@dataclass(frozen=True, eq=False)
class OutputBounds:
    """Bounds of one output and side at all nodes.

    Args:
        side: −1 or 1.
        wanted_gap: Distance of bound and attained value that suffices.
        constant: What the motion has besides the model, and what a bound has besides, (2, T).
        data: Models and tables of the output.
        out: Bounds and the model's values, shape (2, T).
        at: Inputs of the model's values, shape (T, d).
        attained: A value that is known to be attained.
    """

    side: float
    wanted_gap: float
    constant: Array
    data: Data
    out: Array
    at: Array
    attained: float

    @classmethod
    def initial(
        cls, level: LevelModels, o: int, s: int, wanted_gap: float, attained: float = 0.0
    ) -> OutputBounds:
        """Infinite bounds of output o, negated where s = 0, to be improved by `run`.

        Args:
            level: Models and response tables over the box.
            o: Output.
            s: 0 for bounds of −output, 1 for bounds of the output.
            wanted_gap: Distance of bound and attained value that suffices.
            attained: Value of side × output that is known to be attained.
        """
        side, n_nodes = (-1.0, 1.0)[s], len(level.tables.time)
        truncation, constant = _truncation_terms(level, o, side)
        variables = _variables(level, o)
        tables, models = _tables(level, o, variables), _models(level, variables)
        fields = [*tables, *models, *truncation, _grain(level, o)]
        data = Data(*fields)
        require_in_range({name: x for name, x in data._asdict().items() if name != "table"})
        return cls(
            side=side,
            wanted_gap=wanted_gap,
            constant=constant,
            data=data,
            out=np.stack([np.full(n_nodes, np.inf), np.full(n_nodes, -HUGE)]),
            at=np.zeros((n_nodes, data.linear.shape[1])),
            attained=attained,
        )

    @property
    def incumbent(self) -> float:
        """The largest attained value of side × output so far."""
        return float(max(self.out[1].max(), self.attained))

    def open_nodes(self, slack_below_peak: float) -> Rows:
        """Nodes (J,) at which the bound exceeds the model's value by more than suffices.

        `slack_below_peak` is as of `Effort`.
        """
        allowed = self.wanted_gap + slack_below_peak * np.maximum(self.incumbent - self.out[1], 0.0)
        return np.flatnonzero(self.out[0] - self.out[1] > allowed)

    def run(
        self,
        nodes: Rows,
        slabs: int,
        steps: int,
        slack_below_peak: float,
        remainder_multiple: float,
    ) -> None:
        """Improve the output's bounds at nodes (J,), and the model's values beside them, in place.

        The other arguments are the fields of `Effort`: most slabs, evaluations for each, the gap
        that is allowed below the peak, and the least gap in remainders that is worth any effort.
        """
        self.improve(nodes, self.effort(slabs, steps, slack_below_peak, remainder_multiple))

    def effort(
        self, slabs: int, steps: int, slack_below_peak: float, remainder_multiple: float
    ) -> Effort:
        """Effort for each node, compared with the largest attained value so far; see `Effort`."""
        return Effort(
            slabs, steps, self.wanted_gap, self.incumbent, slack_below_peak, remainder_multiple
        )

    def improve(self, nodes: Rows, effort: Effort) -> None:
        """Lower the bounds and raise the model's values at nodes (J,), reading no others."""
        new, at = np.empty((2, len(nodes))), np.empty((len(nodes), self.at.shape[1]))
        bounds(nodes, self.side, effort, self.constant, self.data, new, at)
        better = new[1] > self.out[1, nodes]
        self.at[nodes[better]] = at[better]
        self.out[1, nodes] = np.maximum(self.out[1, nodes], new[1])
        self.out[0, nodes] = np.minimum(self.out[0, nodes], new[0])


def _variables(level: LevelModels, o: int) -> TaylorModel:
    """Taylor models of ω, g and the amplitudes of each mode, in this order, shape (Z,)."""
    models = ((mode.omega[None], mode.decay[None], mode.share[:, o]) for mode in level.oscillators)
    return concatenate([x for of_mode in models for x in of_mode], -1)


def _tables(level: LevelModels, o: int, variables: TaylorModel) -> list[Array]:
    """Fields of `Data` from `table` to `reach`: tables, points, ranges of `variables` (Z,)."""
    grids, single = level.tables.grids, level.oscillators
    centre, radius = (x.reshape(len(single), -1) for x in (variables.value, _radii(variables)))
    omega = np.stack([np.tile(grid.omega, len(grid.quotient)) for grid in grids])
    decay = np.stack([(grid.quotient[:, None] * grid.omega).ravel() for grid in grids])
    scaled = [(x - centre[:, [i]]) / radius[:, [i]] for i, x in enumerate((omega, decay))]
    start = np.array([[grid.omega[0], grid.quotient[0]] for grid in grids])
    step = np.array([[grid.omega[1], grid.quotient[1]] for grid in grids]) - start
    points = np.array([len(grids[0].omega), len(grids[0].quotient)], float)
    ends = np.array([mode.places(grid) for mode, grid in zip(single, grids, strict=True)], float)
    value = level.tables.value[int(level.structure.order[o])]
    of_exponent, of_shares = slice(2), slice(2, None)
    ranges = [x[:, part].copy() for part in (of_exponent, of_shares) for x in (centre, radius)]
    return [value, *scaled, start, step, points, ends, *ranges]


def _models(level: LevelModels, variables: TaylorModel) -> list[Array]:
    """Fields of `Data` from `linear` to `remainder`: scaled models of all variables."""
    linear, quadratic, cubic, remainder = _scaled(variables, _radii(variables))
    size = np.asarray(np.abs(cubic).sum(1))
    # of the sums that multipliers enter; scaled variables are at most 1, those of tables 2 or so
    of_sums = 8 * gamma(roundings(len(level.oscillators), len(level.sources), linear.shape[1]))
    return [linear, quadratic, cubic, size, remainder + of_sums + EXPECTED * size]


def _truncation_terms(level: LevelModels, o: int, side: float) -> tuple[list[Array], Array]:
    """Terms that truncated modes and errors add to bounds of side × output o.

    Returns:
        The three fields of `Data` on truncated modes, for what depends on the inputs; constants to
        add to the model's value for the motion's, and to that for its upper bound, at all nodes,
        shape (2, T).
    """
    tables, order = level.tables, int(level.structure.order[o])
    constant: Array = np.zeros((2, len(tables.time)))
    constant[1] = level.models.added[:, o]
    for k, mode in enumerate(level.oscillators):
        constant[1] += mode.share.size()[:, o] @ tables.error[order][k]
    d, sources = level.structure.rayleigh.inputs, len(level.sources)
    if not level.models.truncated:
        return [np.zeros((0, x)) for x in (1, d, d * (d + 1) // 2)], constant
    waves, models = list[Array](), list[TaylorModel]()
    for truncated in level.models.truncated:
        middle, half = truncated.middle[:, o], truncated.half[:, o]
        waves += [middle, side * half]
        models += [truncated.share[:, o], truncated.amplitude[:, o]]
        constant[0] += side * truncated.share.value[:, o] @ middle
        constant[1] += truncated.amplitude.value[:, o] @ half
    wave, model = np.concatenate(waves), concatenate(models, -1)
    linear, quadratic, cubic, remainder = _scaled(model, np.ones(len(wave)))
    constant[1] += (remainder + np.abs(cubic).sum(1)) @ np.abs(wave)
    size = np.abs(linear).sum(1) + np.abs(quadratic).sum(1)
    constant[1] += gamma(roundings(len(level.oscillators), sources, d)) * (size @ np.abs(wave))
    constant[1] += gamma(len(wave) + 4) * np.abs(constant).sum(0)
    return [wave, linear, quadratic], constant


def _grain(level: LevelModels, o: int) -> Array:
    """Spacing of multiplier values: `GRAIN` times Σ_k |c_k| max |e_k|, or 1 where it is 0, (1,)."""
    responses = np.abs(level.tables.value[int(level.structure.order[o])]).max((2, 3))
    size = sum(
        float(np.abs(mode.share.value[:, o]) @ response)
        for mode, response in zip(level.oscillators, responses, strict=True)
    )
    return np.array([GRAIN * size or 1.0])


def _radii(x: TaylorModel) -> Array:
    """Half ranges by which variables are scaled, positive, shape V."""
    return np.asarray(np.maximum(np.maximum(x.spread(), 1e-9 * np.abs(x.value)), LEAST_SPREAD))


def _scaled(x: TaylorModel, radius: Array) -> tuple[Array, ...]:
    """Linear, quadratic and cubic coefficients of models shape (Z,), and remainders, over `radius`.

    Shapes are (Z, monomials), quadratic ones by rows i ≤ j as the kernel has them, and (Z,).
    """
    pairs = monomials(x.inputs, 2)
    by_rows = np.lexsort((pairs[:, 1], pairs[:, 0]))
    remainder = np.asarray(x.remainder + gamma(8) * x.size())
    parts = ((part / radius).T for part in (x.part(1), x.part(2)[by_rows], x.part(3)))
    return (*(np.ascontiguousarray(part) for part in parts), remainder / radius)


def _blocks(nodes: Rows) -> list[Rows]:
    """Nodes in pieces for the threads, in order: each node begins where the one before ended."""
    return np.array_split(nodes, -(-len(nodes) // BLOCK)) if len(nodes) else []
