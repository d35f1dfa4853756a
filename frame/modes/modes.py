"""Modes of all structures in a box of inputs, and what they leave open, whoever supplies them.

Classical modes are supplied by `classical_modes`. Modes that dashpots couple are supplied here, as
oscillators: a damped mode λ = −g + iω with the coefficient C = a + ib adds 2 Re C ρ(t; λ) to an
output, with the Duhamel integral ρ of a load, or exp(λ t). In the responses of `Source`, Re ρ +
(g/ω) Im ρ of a displacement and Im ρ/ω, it is

    2 Re C ρ = 2 a (Re ρ + (g/ω) Im ρ) − 2 (a g + b ω) Im ρ/ω.

So each mode is an oscillator with two sources for each load. Outputs are taken off displacements
and velocities, accelerations by the equations of motion, with what forces add to these at once as a
term of its own. What the polynomials of the modes miss is bounded by theorem 1
(`modal_model.proved_error`), and takes the place of the coupling of classical modes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, comb
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame import numbers
from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.taylor_model import (
    ORDER,
    TaylorModel,
    concatenate,
)
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.modes.modal_model import (
    ModalModel,
    error_between_nodes,
    error_fractions,
    proved_error,
)
from alphacut.frame.modes.model_fields import on_subbox
from alphacut.frame.records.history import History
from alphacut.frame.response.chord_deviation import Grid, load_deviation
from alphacut.frame.response.tables import Direct, Oscillators, Source, grid_over
from alphacut.frame.structures.loads import distinct_histories


@dataclass(frozen=True, eq=False)
class TruncatedModes:
    """Response of modes that are known by sums: C m(t) ± R r(t) for each source and output."""

    participation: TaylorModel  # C, (sources, m)
    amplitude: TaylorModel  # R, (sources, m)
    response_midpoint: Array  # m, (sources, m, T)
    response_radius: Array  # r, (sources, m, T)
    # bound of the distance of the response from straight lines between nodes, (T, m)
    interpolation_error: Array

    def at(self, nodes: Ints | slice, outputs: Ints | slice) -> TruncatedModes:
        """Return the response at some nodes and for some outputs."""
        return TruncatedModes(
            participation=self.participation[:, outputs],
            amplitude=self.amplitude[:, outputs],
            response_midpoint=self.response_midpoint[:, outputs][..., nodes],
            response_radius=self.response_radius[:, outputs][..., nodes],
            interpolation_error=self.interpolation_error[nodes][:, outputs],
        )

    @property
    def radius(self) -> Array:
        """Bound of Σ R r over the sources, each at the node where it is largest, shape (m,)."""
        products = self.amplitude.magnitude()[..., np.newaxis] * self.response_radius
        return np.asarray(products.max(axis=-1).sum(axis=0))


def feedthroughs(factors: TaylorModel, histories: Sequence[History], time: Array) -> TruncatedModes:
    """Return what forces add to accelerations at once as a sum of known responses f(t).

    Args:
        factors: What a unit of each force adds to the m outputs, shape (forces, m).
        histories: The forces f over time.
        time: T time nodes, in s.
    """
    values = np.stack([history.values(time) for history in histories])
    deviations = np.stack([load_deviation(history, time) for history in histories])
    response = np.repeat(values[:, np.newaxis], factors.remainder.shape[1], axis=1)
    return TruncatedModes(
        participation=factors,
        amplitude=factors * 0.0,
        response_midpoint=response,
        response_radius=0.0 * response,
        interpolation_error=deviations.T @ factors.magnitude(),
    )


Ends = tuple[float, float]
"""Lower and upper end of a range."""


class Excitation(NamedTuple):
    """What moves a structure, and when its response is wanted."""

    time: Array  # time nodes, (T,), in s
    sources: Sequence[Source]


@dataclass(frozen=True, eq=False)
class Oscillator:
    """Intervening variables of one mode, or of one diagonal entry of a block."""

    omega: TaylorModel  # damped frequency ω, a scalar, in rad/s
    decay: TaylorModel  # g, a scalar, in 1/s
    quotient: TaylorModel  # g/ω, a scalar
    participation: TaylorModel  # participation factors c, (sources, m)
    omega_range: Ends  # range of ω over the box, which may be narrower than that of the model
    quotient_range: Ends  # range of g/ω

    def table_cell(self, grid: Grid) -> Ints:
        """Return the first and last points of a grid that enclose ω, then g/ω, shape (4,)."""
        first, last = _enclosing_points(grid.omega, self.omega_range)
        low, high = _enclosing_points(grid.quotient, self.quotient_range)
        return np.array([first, last, low, high])


def range_of(x: TaylorModel) -> Ends:
    """Return the range of a scalar Taylor model over the box."""
    low, high = x.bounds()
    return float(low), float(high)


def overlap(first: Ends, second: Ends) -> Ends:
    """Return the intersection of two ranges."""
    return max(first[0], second[0]), min(first[1], second[1])


def _enclosing_points(points: Array, ends: Ends) -> tuple[int, int]:
    """Return the indices of two of some points that enclose a range as closely as possible.

    A range that reaches beyond the points is enclosed up to the first or last of them.

    Args:
        points: Rising, shape (N,), N ≥ 1.
        ends: Lower and upper end of the range.
    """
    low, high = ends
    first = int(np.searchsorted(points, low, side="right")) - 1
    last = int(np.searchsorted(points, high))
    return max(first, 0), min(last, len(points) - 1)


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes over a box, for T time nodes and m outputs.

    An output is the sum of what the oscillators and the truncated modes give, up to what is left
    `open`: coupling in blocks of classical modes, or the error of the polynomials of damped ones.
    """

    time: Array  # time nodes, (T,), in s
    sources: Sequence[Source]  # what moves the oscillators
    orders: Ints  # derivative by time of the oscillators' responses that each output takes, (m,)
    oscillators: list[Oscillator]  # one for each mode that is enclosed as such
    # what is known by sums over modes: truncated ones, and what forces add at once
    truncated: list[TruncatedModes]
    open: Array  # bound of what is left open at the nodes, (T, m)
    # bound of its distance from straight lines between nodes, (T, m)
    open_between: Array

    def at(self, nodes: Ints | slice, outputs: Ints | slice) -> Modes:
        """Return the modes at some nodes and for some outputs."""
        oscillators = [
            replace(mode, participation=mode.participation[:, outputs]) for mode in self.oscillators
        ]
        return Modes(
            time=self.time[nodes],
            sources=self.sources,
            orders=self.orders[outputs],
            oscillators=oscillators,
            truncated=[x.at(nodes, outputs) for x in self.truncated],
            open=self.open[nodes][:, outputs],
            open_between=self.open_between[nodes][:, outputs],
        )

    def on_subbox(self, low: Array, high: Array) -> Modes:
        """Return the modes over the sub-box low ≤ u ≤ high, in its own unit coordinates.

        What is left open stays that of the whole box, which is valid in the sub-box, too. Ranges of
        the oscillators are the intersections of those of the whole box with those of the models.

        Args:
            low: Lower ends, shape (d,), not below −1.
            high: Upper ends, shape (d,), not above 1.
        """
        restricted = on_subbox(self, low, high)
        oscillators = []
        for mode in restricted.oscillators:
            omega_range = overlap(range_of(mode.omega), mode.omega_range)
            quotient_range = overlap(range_of(mode.quotient), mode.quotient_range)
            narrower = replace(mode, omega_range=omega_range, quotient_range=quotient_range)
            oscillators.append(narrower)
        return replace(restricted, oscillators=oscillators)

    def interpolation_error(self) -> Array:
        """Bound the distance of outputs from a straight line within each time step, shape (T, m).

        Row j belongs to the step that ends at node j. All outputs take displacements.

        Raises:
            UnprovedError: A mode turns too far within a sample interval of a load.
        """
        deviations = []
        for mode in self.oscillators:
            points = self._deviation_points(mode)
            grid = grid_over(mode.omega_range, mode.quotient_range, points)
            oscillators = Oscillators(grid, self.time, (0,))
            deviations.append([oscillators.line_deviation(source, 0) for source in self.sources])
        return self.with_deviations({0: np.array(deviations)})

    def _deviation_points(self, mode: Oscillator) -> tuple[int, int]:
        """Return the numbers of points along ω and along q = g/ω for `interpolation_error`.

        A mode that turns far within a step follows a smooth load closely, and may be farther from a
        chord by what interpolation between the points leaves open: (h/g)⁴ of its response over q,
        but for a factor, with the distance h of the points and the decay g. A limit of h/g, tuned,
        lets this be a few per cent of what the mode contributes.
        """
        low, high = mode.omega_range
        least, most = mode.quotient_range
        along_omega, along_quotient = numbers.DEVIATION_POINTS, 3
        if high * float(np.diff(self.time).max(initial=0.0)) > 1 and least > 0:
            distance = numbers.DEVIATION_DISTANCE * least * low
            along_omega = max(along_omega, ceil((high - low) / distance) + 1)
            along_quotient = max(along_quotient, ceil((most - least) * high / distance) + 1)
        return min(along_omega, 3 * numbers.DEVIATION_POINTS), min(along_quotient, 7)

    def with_deviations(self, deviations: dict[int, Array]) -> Array:
        """Return the same bound from those of the oscillators' responses to unit sources.

        Args:
            deviations: By order of the derivative, shape (modes, sources, T).
        """
        error: Array = self.open_between + sum(x.interpolation_error for x in self.truncated)
        for o, order in enumerate(self.orders):
            of_modes = deviations[int(order)]
            for mode, of_mode in zip(self.oscillators, of_modes, strict=True):
                error[:, o] += mode.participation.magnitude()[:, o] @ of_mode
        return error


class FittedModel(NamedTuple):
    """A modal model of a box, with T time nodes and m outputs."""

    model: ModalModel
    error: Array  # proved bound of its error at the nodes, (T, m)
    excess: float  # largest error over the tolerance of its output
    # how often each input that contributes would have to be halved for an error within the
    # tolerance at the largest degree, at least 1; estimated
    halvings: float


def fitted_model(
    flow: LinearFlow,
    boxes: Boxes,
    tolerance: Array,
    models: dict[int, tuple[ModalModel, Array]],
    *,
    fixed: Mapping[str, float] | None = None,
    max_excess: float = 1.0,
) -> FittedModel:
    """Return a modal model whose error is within a tolerance, or the most accurate one found.

    The degree of its polynomials rises until the error is small enough, or no degree is expected to
    make it small enough.

    Args:
        flow: The exact response.
        boxes: Nested boxes of the inputs, the widest first, whose inputs all have a width there.
        tolerance: Error that is wanted at the nodes, shape (m,).
        models: Models of the box by their degree, with their errors, for this tolerance or smaller
            ones; further ones are added.
        fixed: Values of other parameters by name, where they are not nominal.
        max_excess: Multiple of the tolerance that is of use.

    Raises:
        UnprovedError: The structure has no smooth oscillating modes over the box.
    """
    n_inputs = len(boxes.names)
    # Tuned: with more than 3100 monomials, the degrees 13, 10 and 8 for 4, 5 and 6 inputs, a model
    # takes more time than bisections of the box do. A polynomial of degree N in n inputs has
    # (n + N)! / (n! N!) monomials.
    max_degree = numbers.MAX_DEGREE
    while comb(n_inputs + max_degree, n_inputs) > 3100 and max_degree > 2:
        max_degree -= 1
    # Most structures need few degrees, and the cost of a degree grows as the number of monomials.
    degree = min(numbers.FIRST_DEGREE, max_degree)
    best: FittedModel | None = None
    last_excess = np.inf
    step = 0
    # The factor of the error for each further degree. Before it is known, 0.1 is taken: a larger
    # one would go up in larger steps (tuned).
    decay = 0.1
    while True:
        # Modes that contribute less than a small part of the tolerance are left out; their energy
        # counts as error.
        if degree not in models:
            left_out = numbers.LEFT_OUT_MODES * tolerance
            model = ModalModel.of_degree(flow, boxes, degree, left_out, fixed=fixed)
            models[degree] = model, proved_error(model)
        model, error = models[degree]
        excess = float((error / tolerance).max())
        if step:
            decay = (excess / last_excess) ** (1 / step)
        # Halving the inputs that contribute divides the error of the degree N by 2^(N + 1), its
        # first term that is left out.
        log2_excess = np.log2(max(excess, 1.0)) + (max_degree - degree) * np.log2(decay)
        halvings = max(1.0, np.ceil(log2_excess / (max_degree + 1)))
        if best is None or excess < best.excess:
            best = FittedModel(model, error, excess, halvings)
        # Of an error without bound no degree is known that would give it one.
        if excess <= 1 or degree == max_degree or decay >= 1 or excess == np.inf:
            return best
        last_degree = degree + np.log(excess / max_excess) / -np.log(decay)
        if step and not last_degree < max_degree + 1:
            return best
        # Four fifths of the degrees that the errors ask for are taken at once (tuned: more often
        # end at a degree that is higher than necessary).
        step = min(max(1, int(0.8 * np.log(excess) / -np.log(decay))), max_degree - degree)
        last_excess = excess
        degree += step


def damped_modes(
    flow: LinearFlow, boxes: Boxes, fixed: Mapping[str, float], tolerance: Array
) -> Modes:
    """Return models of a structure's response over a box whose inputs all have a width.

    Args:
        flow: The exact response.
        boxes: The box.
        fixed: Values of other parameters by name, where they are not nominal.
        tolerance: Error that the polynomials may have at the nodes, shape (m,).

    Raises:
        UnprovedError: The structure has no smooth oscillating modes over the box, or the error of
            the polynomials exceeds 20 times the tolerance; `along` is the input to bisect.
    """
    max_excess = 20.0  # tuned: wider bounds are bisected in less time
    found = fitted_model(flow, boxes, tolerance, {}, fixed=fixed, max_excess=max_excess)
    if not found.excess <= max_excess:
        what = f"the proved error of the modes is {found.excess:.2g} times what it may be"
        along = int(error_fractions(found.model).argmax())
        raise UnprovedError(what, "take narrower inputs", along)
    return as_oscillators(found.model, found.error)


def as_oscillators(model: ModalModel, error: Array) -> Modes:
    """Return a modal model with its error, shape (T, m), as oscillators and what they leave open.

    What forces add at once stands beside the oscillators.

    Raises:
        UnprovedError: A mode may not oscillate somewhere in the box.
    """
    parts: list[tuple[History | None, TaylorModel]] = [
        (load.history, load.share) for load in model.loads if not isinstance(load, Direct)
    ]
    if model.has_free_response:
        parts = [(None, model.coefficient), *parts]
    sources = list[Source]()
    for k, (history, _) in enumerate(parts):
        sources.append(Source(f"displacement{k}", history, is_displacement=True))
        sources.append(Source(f"velocity{k}", history))

    oscillators = []
    for k in range(model.count):
        omega = model.eigenvalue.imag[k]
        decay = -model.eigenvalue.real[k]
        omega_range = range_of(omega)
        if not omega_range[0] > 0:
            raise UnprovedError("a mode may not oscillate", "take less damping, or narrower inputs")
        participation = list[TaylorModel]()
        for _, coefficient in parts:
            a = coefficient.real[k]
            b = coefficient.imag[k]
            participation.append(a * 2.0)
            participation.append((a * decay + b * omega) * -2.0)
        quotient = decay * omega**-1.0
        low, high = range_of(quotient)
        oscillator = Oscillator(
            omega=omega.truncated(ORDER),
            decay=decay.truncated(ORDER),
            quotient=quotient.truncated(ORDER),
            participation=concatenate([x[None] for x in participation], -2).truncated(ORDER),
            omega_range=omega_range,
            # The tables take the upper end as the largest magnitude.
            quotient_range=(low, max(high, -low)),
        )
        oscillators.append(oscillator)
    truncated = list[TruncatedModes]()
    if model.structure.feeds is not None:
        forces = distinct_histories(model.flow.system.loads)
        factors = model.structure.feeds.truncated(ORDER).T
        truncated.append(feedthroughs(factors, forces, model.flow.time))
    return Modes(
        time=model.flow.time,
        sources=sources,
        orders=np.zeros(error.shape[1], int),
        oscillators=oscillators,
        truncated=truncated,
        open=error,
        open_between=error_between_nodes(model, error),
    )
