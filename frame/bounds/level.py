"""Models of the motion over one level's box, and bounds of each output and side at all nodes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.progress_bar import Progress
from alphacut.frame import numbers
from alphacut.frame.bounds.dual_function import Data, require_in_range, roundings
from alphacut.frame.bounds.node_bounds import Effort, bound_nodes
from alphacut.frame.calculus.monomials import monomials
from alphacut.frame.calculus.rounding import gamma
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate
from alphacut.frame.modes.intervening import Excitation, Oscillator
from alphacut.frame.modes.models import MotionModels
from alphacut.frame.modes.structure import Classical
from alphacut.frame.response.oscillators import (
    Grid,
    ModalResponses,
    Oscillators,
    grid_over,
    is_fed_through,
    read_response,
)
from alphacut.frame.response.straying import (
    Response,
    load_deviation,
    narrowed_at_jumps,
    narrowed_straying,
)

POINTS = (8, 80), (3, 12)
"""Least and most points of a mode's table along ω and along q = g/ω."""
UNKNOWN = -1e300
"""Stands for −∞, the model's value where none is known."""
LEAST_SPREAD = 1e-30
"""Radius in SI units of a variable that does not vary, so that scaled ones stay finite."""
GRAIN = 2.0**-24
"""Distance of multipliers as a fraction of the output's modal responses: far above rounding, so
that units do not lead them elsewhere, and far below gaps."""
BLOCK = 40
"""Nodes that one thread bounds in turn, about."""


class ResponseTable(NamedTuple):
    """Responses of K oscillators to all sources, read by one derivative of the motion."""

    value: Array  # responses at the points of each mode's grid, (K, sources, T, Q W)
    largest: Array  # their largest magnitudes, (K, sources)
    error: Array  # bounds of what interpolation and round-off miss, (K, sources, T)
    line_deviation: Array  # bounds of their distance from straight lines between nodes, the same


def response_tables(
    grids: Sequence[Grid], excitation: Excitation, orders: Ints, inputs: int
) -> dict[int, ResponseTable]:
    """Return tables of the responses of oscillators on grids, with bounds of errors, by order.

    `orders` (m,) are the derivatives of the motion that outputs take, `inputs` the number of inputs
    of the sums that the responses enter.

    Raises:
        UnprovedError: A response is out of the range of the dual function.
    """
    loads, time, sources = excitation
    found = {order: list[list[ModalResponses]]() for order in sorted(map(int, set(orders)))}
    for grid in grids:
        oscillators = Oscillators(grid, loads, time, found)
        for order, modes in found.items():
            modes.append([oscillators.responses(source, order) for source in sources])
    rounding, tables = 2 * gamma(roundings(len(grids), len(sources), inputs)), {}
    for order, modes in found.items():
        value = np.array([[x.value.reshape(len(time), -1) for x in mode] for mode in modes])
        error = np.array([[x.error for x in mode] for mode in modes])
        deviation = np.array([[x.line_deviation for x in mode] for mode in modes])
        sizes = np.abs(value).max(-1)
        require_in_range({"table": sizes})
        tables[order] = ResponseTable(value, sizes.max(-1), error + rounding * sizes, deviation)
    return tables


def _points(oscillators: Sequence[Oscillator], duration: float) -> tuple[int, int]:
    """Numbers of table points along ω and along q = g/ω, the same for all modes."""
    along_omega, along_q, slowest = 2.0, 2.0, 2 / duration if duration > 0 else np.inf
    for mode in oscillators:
        (omega_low, omega_high), (q_low, q_high) = mode.omega_range, mode.quotient_range
        spacing = numbers.TABLE_SPACING * (max(q_low, 0.0) * omega_low + slowest)
        along_omega = max(along_omega, (omega_high - omega_low) / spacing)
        along_q = max(along_q, (q_high - q_low) * omega_high / spacing)
    return int(np.clip(along_omega, *POINTS[0])) + 1, int(np.clip(along_q, *POINTS[1])) + 1


@dataclass(frozen=True, eq=False)
class LevelModels:
    """One level's models and tables."""

    structure: Classical  # the structure over the level's box
    models: MotionModels  # its motion
    grids: list[Grid]  # of each oscillator the points of its tables
    tables: dict[int, ResponseTable]  # responses of its oscillators, by order of derivative
    excitation: Excitation  # the loads, nodes, and sources

    def on_subbox(self, low: Array, high: Array) -> LevelModels:
        """Models over the part low ≤ u ≤ high of the box, with the same response tables."""
        return replace(self, models=self.models.on_subbox(low, high))

    @classmethod
    def from_structure(
        cls, structure: Classical, excitation: Excitation, allowed: Array | None = None
    ) -> LevelModels:
        """Models of a structure's motion over its box, and the response tables of its oscillators.

        `allowed` is the truncation error of each output that is allowed, (m,); None to enclose as
        many modes as possible.

        Raises:
            UnprovedError: None of its modes can be enclosed.
        """
        models = MotionModels.from_structure(structure, excitation, allowed)
        modes, inputs = models.oscillators, structure.start.inputs
        points = _points(modes, float(excitation[1][-1]))
        grids = [grid_over(mode.omega_range, mode.quotient_range, points) for mode in modes]
        tables = response_tables(grids, excitation, structure.order, inputs)
        return cls(structure, models, grids, tables, excitation)

    def line_deviation(self) -> Array:
        """Bound of how far outputs lie beyond both their values in the step to each node, (T, m).

        Where no force jumps, it bounds how far they stray from a straight line there.
        """
        unresolved = self.models.line_deviation + sum(
            x.line_deviation for x in self.models.truncated
        )
        by_magnitude: Array = np.array(unresolved)
        for o, order in enumerate(map(int, self.structure.order)):
            deviations = self.tables[order].line_deviation
            for mode, deviation in zip(self.models.oscillators, deviations, strict=True):
                by_magnitude[:, o] += mode.share.magnitude()[:, o] @ deviation
        # The tables of oscillators contain what forces add at once through these; what they add
        # through all other modes is the difference to M⁻¹ b f.
        time, fed = self.excitation[1], dict(self._feedthroughs())
        for source, response in fed.items():
            assert response.load is not None
            of_others = self._fed_through_others(source, response)
            by_magnitude += np.outer(load_deviation(response.load, time), of_others)
        responses = [x for mode in self.models.oscillators for x in self._responses(mode)]
        responses += fed.values()
        straying = narrowed_straying(responses, time, by_magnitude, unresolved)
        if unresolved.any():  # whose change within a step is not known
            return straying
        return narrowed_at_jumps(responses, time, straying)

    def _fed_through_others(self, source: str, fed: Response) -> Array:
        """Bound of what a unit of a force adds at once by modes that are no oscillators, (m,)."""
        index, is_acceleration = self.excitation[2].index(source), self.structure.order == 2
        value: Array = fed.coefficient.real[:, 0, 0]
        spread: Array = fed.spread[0]
        for mode in self.models.oscillators:
            share = mode.share[index]
            value = value - np.where(is_acceleration, share.value, 0.0)
            spread = spread + np.where(is_acceleration, share.deviation(), 0.0)
        return np.asarray(np.abs(value) + spread)

    def _feedthroughs(self) -> Iterator[tuple[str, Response]]:
        """What each force adds to accelerations at once, M⁻¹ b f of all modes, by its source."""
        structure = self.structure
        rows = np.where((structure.order == 2)[:, None], structure.rows, 0.0)
        for source in self.excitation[2]:
            if is_fed_through(source, 2) and rows.any():
                fed = (structure.forced[source][None] @ rows.T)[0] * structure.factor
                spread = np.stack([fed.deviation(), 0 * fed.deviation()])
                kappa = fed.value[:, None, None]
                yield source, Response(None, self.excitation[0][source], 2, kappa, spread)

    def _responses(self, mode: Oscillator) -> Iterator[Response]:
        """What a mode adds to outputs by each source, without what forces add at once."""
        (loads, _, sources), orders = self.excitation, self.structure.order
        points = int(numbers.DEVIATION_POINTS), 3
        sigma = grid_over(mode.omega_range, mode.quotient_range, points).sigma
        for source, value, spread in zip(
            sources, mode.share.value, mode.share.deviation(), strict=True
        ):
            real, imag = (read_response(source, sigma, np.full_like(sigma, x)) for x in (1, -1j))
            for order in map(int, set(orders)):
                share, off = value * (orders == order), spread * (orders == order)
                kappa = share[:, None, None] * (real + 1j * imag)
                kappa_off = np.outer([np.abs(x).max() for x in (real, imag)], off)
                yield Response(sigma, loads.get(source), order, kappa, kappa_off)


@dataclass(eq=False)
class OutputBounds:
    """Bounds of side × one output at all T nodes, d inputs."""

    # number of the output in the level's models, and 0 for −output or 1 for the output
    index: tuple[int, int]
    wanted_gap: float  # distance of bound and reached value that suffices
    reached: float  # largest value of side × output that is known to be reached
    constant: Array  # what the motion has besides the model, and what a bound has besides, (2, T)
    data: Data  # models and tables of the output
    out: Array  # bounds and the model's values, (2, T)
    at: Array  # inputs of the model's values, (T, d)

    @classmethod
    def initial(
        cls, level: LevelModels, o: int, s: int, wanted_gap: float, reached: float = 0.0
    ) -> OutputBounds:
        """Infinite bounds of output number o of a level's models, of −output where s = 0."""
        data, constant = _data(level, o, (-1.0, 1.0)[s])
        out = np.zeros_like(constant) + np.array([[np.inf], [UNKNOWN]])
        at = np.zeros((out.shape[1], data.linear.shape[1]))
        return cls((o, s), wanted_gap, reached, constant, data, out, at)

    @property
    def side(self) -> float:
        """−1 or 1."""
        return (-1.0, 1.0)[self.index[1]]

    def nodes_above(self, nodes: Ints) -> Ints:
        """Those of some nodes whose bound exceeds the reached value by more than the wanted gap."""
        return nodes[self.out[0, nodes] > self.reached + self.wanted_gap]

    def open_nodes(self, slack_below_peak: float) -> Ints:
        """Nodes (J,) whose bound exceeds the model's value by more than suffices; see `Effort`."""
        bound, value = self.out
        below_peak = np.maximum(max(value.max(), self.reached) - value, 0.0)
        return np.flatnonzero(bound - value > self.wanted_gap + slack_below_peak * below_peak)

    def effort(
        self, cells: int, steps: int, slack_below_peak: float = 0.0, remainder_multiple: float = 0.0
    ) -> Effort:
        """Effort for a node, compared with the largest value so far; arguments are its fields."""
        incumbent = float(max(self.out[1].max(), self.reached))
        steps_of_model, grace = int(numbers.ASCENTS), int(numbers.CELL_GRACE)
        tuned = int(numbers.PATIENCE), steps_of_model, grace, numbers.MIN_CELL_PROGRESS
        of_node = cells, steps, slack_below_peak, remainder_multiple
        return Effort(*of_node, self.wanted_gap, incumbent, *tuned)

    def improve(self, nodes: Ints, effort: Effort) -> None:
        """Lower the bounds and raise the model's values at nodes (J,), reading no others."""
        new, at = np.empty((2, len(nodes))), np.empty((len(nodes), self.at.shape[1]))
        bound_nodes(nodes, self.side, effort, self.constant, self.data, new, at)
        better = new[1] > self.out[1, nodes]
        self.at[nodes[better]] = at[better]
        self.out[1, nodes] = np.maximum(self.out[1, nodes], new[1])
        self.out[0, nodes] = np.minimum(self.out[0, nodes], new[0])

    def improve_peak(self, nodes: Ints, effort: Effort) -> None:
        """Lower the highest bound of nodes (J,): the highest first, until one remains the highest.

        Lower bounds of others would not lower that of the peak.
        """
        peak = -np.inf
        for node in nodes[np.argsort(-self.out[0, nodes], kind="stable")]:
            if self.out[0, node] <= peak:
                break
            self.improve(np.array([node]), effort)
            peak = max(peak, float(self.out[0, node]))


def improve_all(
    jobs: Sequence[tuple[OutputBounds, Ints, Effort]],
    pool: Executor,
    tick: Progress,
    *,
    peaks_alone: bool = False,
) -> None:
    """Improve bounds at nodes by threads, in blocks; each node begins where the last one ended.

    Efforts are fixed before, so that no bound depends on which thread ends first. With
    `peaks_alone` the highest bound of each job is lowered, and others for its sake.
    """
    futures = [
        pool.submit(bounds.improve_peak if peaks_alone else bounds.improve, block, effort)
        for bounds, nodes, effort in jobs
        if len(nodes)
        for block in np.array_split(nodes, 1 if peaks_alone else -(-len(nodes) // BLOCK))
    ]
    for done, future in enumerate(futures, start=1):
        future.result()
        tick(done / len(futures))


def _data(level: LevelModels, o: int, side: float) -> tuple[Data, Array]:
    """Models and tables of output o, and constants of the motion and of a bound, (2, T)."""
    modes, order = level.models.oscillators, int(level.structure.order[o])
    models = [(mode.omega[None], mode.decay[None], mode.share[:, o]) for mode in modes]
    variables = concatenate([x for of_mode in models for x in of_mode], -1)
    spread = np.maximum(variables.deviation(), 1e-9 * np.abs(variables.value))
    radius = np.maximum(spread, LEAST_SPREAD)  # by which variables are scaled, shape (Z,)
    linear, quadratic, cubic, remainder = _scaled(variables, radius)
    expected = numbers.EXPECTED_CUBIC * np.asarray(np.abs(cubic).sum(1))
    # of the sums that multipliers enter; scaled variables are at most 1, those of tables 2 or so
    of_sums = 8 * gamma(roundings(len(modes), modes[0].share.shape[0], linear.shape[1]))
    grids, table = level.grids, level.tables[order]
    centres, radii = (x.reshape(len(modes), -1) for x in (variables.value, radius))
    omega = np.stack([np.tile(grid.omega, len(grid.quotient)) for grid in grids])
    decay = np.stack([(grid.quotient[:, None] * grid.omega).ravel() for grid in grids])
    start = np.array([[grid.omega[0], grid.quotient[0]] for grid in grids])
    second = np.array([[grid.omega[1], grid.quotient[1]] for grid in grids])
    ends = [mode.places(grid) for mode, grid in zip(modes, grids, strict=True)]
    sizes = [np.abs(mode.share.value[:, o]) for mode in modes]
    responses = float((np.array(sizes) * table.largest).sum())
    truncated_terms, constant = _truncation_terms(level, o, side)
    data = Data(
        table=table.value,
        omega=(omega - centres[:, [0]]) / radii[:, [0]],
        decay=(decay - centres[:, [1]]) / radii[:, [1]],
        start=start,
        step=second - start,
        points=np.array([len(grids[0].omega), len(grids[0].quotient)], float),
        ends=np.array(ends, float),
        centre=centres[:, :2].copy(),
        radius=radii[:, :2].copy(),
        share=centres[:, 2:].copy(),
        reach=radii[:, 2:].copy(),
        linear=linear,
        quadratic=quadratic,
        cubic=cubic,
        expected=expected,
        remainder=remainder + of_sums + expected,
        truncated_response=truncated_terms[0],
        truncated_linear=truncated_terms[1],
        truncated_quadratic=truncated_terms[2],
        grain=np.array([GRAIN * responses or 1.0]),
    )
    require_in_range({name: x for name, x in data._asdict().items() if name != "table"})
    return data, constant


def _truncation_terms(level: LevelModels, o: int, side: float) -> tuple[list[Array], Array]:
    """Fields of `Data` on truncated modes, and constants of the motion and of a bound, (2, T)."""
    modes, table = level.models.oscillators, level.tables[int(level.structure.order[o])]
    constant: Array = np.zeros((2, len(level.excitation[1])))
    constant[1] = level.models.added[:, o]
    for mode, error in zip(modes, table.error, strict=True):
        constant[1] += mode.share.magnitude()[:, o] @ error
    d, sources = level.structure.rayleigh.inputs, modes[0].share.shape[0]
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
    constant[1] += gamma(roundings(len(modes), sources, d)) * (size @ np.abs(wave))
    constant[1] += gamma(len(wave) + 4) * np.abs(constant).sum(0)
    return [wave, linear, quadratic], constant


def _scaled(x: TaylorModel, radius: Array) -> tuple[Array, ...]:
    """Linear, quadratic and cubic coefficients of models (Z,), and remainders, over `radius`."""
    pairs = monomials(x.inputs, 2)
    by_rows = np.lexsort((pairs[:, 1], pairs[:, 0]))  # i ≤ j, as the kernel has them
    remainder = np.asarray(x.remainder + gamma(8) * x.magnitude())
    parts = (
        (part / radius).T
        for part in (x.homogeneous_part(1), x.homogeneous_part(2)[by_rows], x.homogeneous_part(3))
    )
    return (*(np.ascontiguousarray(part) for part in parts), remainder / radius)
