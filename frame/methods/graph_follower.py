"""Graph Follower (section 5.3 and eq. 21 of the paper): envelopes from few trajectories.

The paper is Computational Mechanics (2019), doi 10.1007/s00466-019-01737-9, which calls a
trajectory of the outputs over time a graph. The implementation differs from it in two points:

1. One storage serves all outputs, both sides and all levels. The levels are treated from the
   narrowest box to the widest, so that every stored graph belongs to all later boxes and the
   α-cuts are nested by construction.
2. A new graph is computed only if the Taylor model predicts more gain than a tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import checked_number, require
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import gain, local_maximum
from alphacut.frame.methods.method import Method
from alphacut.frame.methods.sampled import (
    SAFETY,
    independent_excess,
    independent_points,
    largest_values,
)
from alphacut.frame.result import Envelope
from alphacut.fuzzy.result import Nature

Places = tuple[Ints, ...]
"""Indices of time nodes, of outputs and of sides, three arrays of one shape (places,). A place is
an upper bound that is followed: the side 0 is -output, the side 1 is the output."""


class ModelMaxima(NamedTuple):
    """Maxima of Taylor models over a box.

    Args:
        value: Maxima, shape (places,).
        point: Unit coordinates at which they are attained, shape (places, inputs).
    """

    value: Array
    point: Array


class Storage:
    """All graphs (trajectories) that were computed, and the best of them at each place.

    Args:
        flow: Response as a function of unit coordinates.

    Attributes:
        points: Unit coordinates of all graphs, shape (graphs, inputs).
        top: Largest value of any graph at each place, shape (times, outputs, 2).
        best: Index of the first graph with this value, same shape.
        first: First derivatives of the output of this graph by the unit coordinates, shape (times,
            outputs, 2, inputs).
        second: Second derivatives, shape (times, outputs, 2, inputs, inputs).
        steepest: Largest magnitude of a first derivative of any graph, shape (outputs,).
    """

    def __init__(self, flow: UnitFlow) -> None:
        """Begin a storage without graphs for the outputs of a problem."""
        d = len(flow.boxes.names)
        shape = (len(flow.time), len(flow.outputs), 2)
        self.flow = flow
        self.points: Array = np.empty((0, d))
        self.top = np.full(shape, -np.inf)
        self.best = np.zeros(shape, np.int64)
        self.first = np.zeros((*shape, d))
        self.second = np.zeros((*shape, d, d))
        self.steepest = np.zeros(len(flow.outputs))

    def __len__(self) -> int:
        return len(self.points)

    @property
    def all_places(self) -> Places:
        """Indices of all places."""
        return tuple(np.indices(self.top.shape).reshape(3, -1))

    def holds(self, point: Array, near: float = 1e-9) -> bool:
        """Return whether a graph is stored whose unit coordinates differ by less than `near`."""
        return bool((np.abs(self.points - point).max(axis=1, initial=0.0) < near).any())

    def add(self, points: Array) -> Places:
        """Compute graphs (trajectories of all outputs) with derivatives, and store them.

        A place is an upper bound that is followed: one side (0 for the output with its sign
        changed, 1 for the output) of an output at a time node. At each place `top` (largest value),
        `best` (index of its graph), and `first` and `second` (derivatives of the output there, with
        the sign of the output on both sides) are updated; so are `points` (of all graphs) and, by
        output, `steepest` (largest magnitude of a first derivative). Where a new graph equals the
        best value so far, the older graph stays the best.

        Args:
            points: Inputs of the graphs, at least one, shape (graphs, inputs), in unit coordinates,
                in which each input runs over [-1, 1] on its widest cut.

        Returns:
            The places where one of these graphs is now the best: indices of the time node, of the
            output and of the side, arrays of shape (places,).

        Raises:
            RefusedError: A trajectory does not exist or is not finite.
            StepError: A time step did not converge.
        """
        jet = self.flow.taylor(points)
        top = self.top.reshape(-1)
        # The first derivatives of all graphs are kept only by their largest magnitude, which tells
        # whether neighbouring trajectories diverge.
        slopes = np.abs(np.moveaxis(jet.first, -1, 0)).reshape(len(self.steepest), -1)
        self.steepest = np.maximum(self.steepest, slopes.max(axis=1))
        # Each new graph is compared with the best values so far, so that of equal graphs the first
        # one is kept and a repeated run has the same bits.
        best_new = np.full(top.shape, -1)  # index among the new graphs; -1 for none
        for k, value in enumerate(jet.value):
            signed = np.stack([-value, value], axis=-1).ravel()
            better = np.flatnonzero(signed > top)
            top[better] = signed[better]  # `top` is a view of `self.top`
            best_new[better] = k
        improved = np.flatnonzero(best_new >= 0)
        places: Places = np.unravel_index(improved, self.top.shape)
        nodes, outputs, _ = places
        best = jet[best_new[improved], nodes, outputs]
        self.best[places] = len(self) + best_new[improved]
        self.first[places] = best.first.T
        self.second[places] = best.second.T
        self.points = np.vstack([self.points, points])
        return places

    def predicted(
        self,
        places: Places,
        box: tuple[Array, Array],
        maximise: Callable[..., Array],
        *,
        bend: float = 1.0,
        reach: Array | float = np.inf,
    ) -> ModelMaxima:
        """Return the maxima over a box of the Taylor models of the best graphs.

        A place is a side of an output at a time node. Its model is the polynomial of second degree
        in the unit coordinates about the graph that is the best there.

        Args:
            places: Places at which the models are maximised: indices of the time node, of the
                output, and of the side (0 for the output with its sign changed, 1 for the output),
                arrays of shape (places,).
            box: Lower and upper ends of the box in unit coordinates, shape (inputs,) each. The
                graphs must lie inside.
            maximise: Function that returns the maximisers x, shape (places, inputs), of
                g·x + x·H·x / 2 from g of this shape, H of shape (places, inputs, inputs), and the
                lower and upper ends of x of the shape of g.
            bend: Factor of the second derivatives; 0 for linear models.
            reach: Largest distance from each graph along each coordinate; infinite for no limit.

        Returns:
            The maxima and the unit coordinates at which the models have them, inside the box.
        """
        sides = places[2]
        signs = 2.0 * sides - 1  # -1 for the side 0, 1 for the side 1
        center = self.points[self.best[places]]
        # The side -output has a Taylor model with the opposite signs.
        g = signs[:, np.newaxis] * self.first[places]
        H = bend * signs[:, np.newaxis, np.newaxis] * self.second[places]
        lower, upper = box
        # The graph lies inside the box or on its boundary, so that x = 0 is admissible and the
        # model predicts at least the stored value.
        x = maximise(g, H, np.maximum(lower - center, -reach), np.minimum(upper - center, reach))
        return ModelMaxima(self.top[places] + gain(g, H, x), np.clip(center + x, lower, upper))


@dataclass
class FollowedSteps:
    """What the Graph Follower did at each place, for drawings of its steps (Figs. 21 to 23).

    `GraphFollower.run` fills these fields.

    Attributes:
        storage: All graphs.
        guess: Index of the best stored graph when a node was reached, shape (levels, times,
            outputs, 2).
        new: Index of the better graph that was computed there, or -1, same shape.
    """

    storage: Storage | None = None
    guess: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    new: Ints = field(default_factory=lambda: np.empty(0, np.int64))


@dataclass(frozen=True)
class GraphFollower(Method):
    """Graph Follower: envelopes of any structure from few trajectories ("graphs").

    At each time node, Taylor models of the graphs computed so far point to the inputs at which the
    output is largest. If they predict enough gain, the graph of these inputs is computed as well.

    Args:
        order: Degree κ of the Taylor models, 1 or 2.
        tolerance: Predicted gain above which a new graph is computed, as a fraction of the peak of
            each output, or in the unit of the first displacement (of the first output if there is
            none) if the envelope is not relative.

    Raises:
        RefusedError: An option is out of range.
    """

    name: ClassVar[str] = "graph-follower"
    tolerance_is_gain: ClassVar[bool] = True
    order: int = 2
    tolerance: float = 1e-3

    def __post_init__(self) -> None:
        """Check the options."""
        allowed = "1 and 2, the degrees of a Taylor model"
        require(self.order in (1, 2), "order", value=self.order, allowed=allowed)
        checked_number("tolerance", self.tolerance, positive=True)

    def run(
        self,
        flow: UnitFlow,
        progress: Progress | None = None,
        *,
        steps: FollowedSteps | None = None,
    ) -> Envelope:
        """Return the envelope of all outputs on all levels.

        The error is estimated: it is the gain that the models still predict, and twice the amount
        by which an independent sample exceeds the bounds; `with_ascents` raises it where ascents
        from this sample attain more. If neighbouring trajectories diverge there is no estimate, and
        the bounds are attained only.

        Args:
            flow: Response as a function of unit coordinates.
            progress: Reports the completed fraction.
            steps: If given, it is filled with what was done at each place.
        """
        storage = Storage(flow)
        # The nominal graph belongs to all boxes.
        storage.add(flow.boxes.to_unit(flow.boxes.nominal)[np.newaxis])
        shape = (len(flow.boxes.alpha), *storage.top.shape)
        bounds = np.zeros(shape)
        predicted_gain = np.zeros(shape)
        best = np.full(shape, -1)
        if steps is None:
            steps = FollowedSteps()
        steps.storage = storage
        steps.guess = np.full(shape, -1)
        steps.new = np.full(shape, -1)
        limit = self.tolerance * flow.scale[:, np.newaxis]  # gain worth a graph, (outputs, 1)
        bend = float(self.order > 1)
        for level, tick in flow.boxes.inside_out(subprogress(progress, 0.0, 0.8)):
            box = flow.boxes.unit_ends(level)
            maxima = storage.predicted(storage.all_places, box, local_maximum, bend=bend)
            predicted = maxima.value.reshape(storage.top.shape)
            target = maxima.point.reshape(*storage.top.shape, -1)
            for node in range(len(flow.time)):
                tick(node / len(flow.time))
                steps.guess[level, node] = storage.best[node]
                # Eq. 21: the next graph is computed where a model predicts the largest output of
                # this node, if the gain is worth it.
                is_worth_a_graph = predicted[node] > storage.top[node] + limit
                points: list[Array] = []
                for point in target[node][is_worth_a_graph]:
                    # Both sides and several outputs often point to the same inputs.
                    is_new = all(np.abs(point - x).max() > 1e-9 for x in points)
                    if is_new and not storage.holds(point):
                        points.append(point)
                if points:
                    first_new = len(storage)
                    improved = storage.add(np.array(points))
                    is_from_new = storage.best[node] >= first_new
                    steps.new[level, node] = np.where(is_from_new, storage.best[node], -1)
                    # Predictions at later nodes change where one of the new graphs is the best.
                    is_later = improved[0] > node
                    later = tuple(indices[is_later] for indices in improved)
                    maxima = storage.predicted(later, box, local_maximum, bend=bend)
                    predicted[later] = maxima.value
                    target[later] = maxima.point
            # Post-processing (Fig. 24): at every node the best of all graphs counts.
            bounds[level] = storage.top
            best[level] = storage.best
            predicted_gain[level] = np.clip(predicted - storage.top, 0.0, limit)

        missed, count = independent_excess(flow, bounds, subprogress(progress, 0.8, 1.0))
        error = predicted_gain.max(axis=-1) + SAFETY * missed[:, np.newaxis]
        return estimated_envelope(
            flow,
            bounds,
            storage.points[best],
            error=error,
            steepest=storage.steepest,
            method=self.name,
            evaluations=len(storage) + count,
            facts={"order": self.order, "gain": self.tolerance},
        )


def with_ascents(bounds: Envelope, flow: UnitFlow) -> Envelope:
    """Return an envelope whose error covers what ascents from independent points attain.

    A follower that has missed a basin cannot see it in its own models, and independent points
    seldom lie near the maximum of a small basin. Therefore the Taylor models of the independent
    points that are the best ones at some time nodes are maximised, and the trajectories of the
    maximisers are compared with the bounds. The new error of an output is at least twice the
    largest excess of its trajectories over time, and at least half of the largest excess of any
    other output, both as fractions of the peaks, since a basin that was missed for one output may
    be missed for all.

    Args:
        bounds: Envelope of a follower. One that is attained only, without an estimate of its error,
            is returned as it is.
        flow: The response over the boxes of the inputs, for which it was computed.

    Raises:
        RefusedError: A trajectory does not exist or is not finite.
        StepError: A time step did not converge.
    """
    if bounds.nature is not Nature.ESTIMATED:
        return bounds
    # Up to 32 nodes and 256 ascents are looked at on each level, and a quarter of the excess of an
    # output counts for the others (tuned on random frames, with and without damping, with nodes up
    # to half of a period apart).
    n_times = len(flow.time)
    nodes = np.unique(np.linspace(0, n_times - 1, 32).astype(int))
    sides = np.arange(2)
    places = tuple(x.ravel() for x in np.meshgrid(nodes, range(len(flow.outputs)), sides))
    peak = flow.peak
    error = bounds.error.copy()
    count = 0
    for level in range(len(error)):
        points = independent_points(flow.boxes, level)
        _, best = largest_values(flow, points)
        starts = points[np.unique(best[nodes])]
        storage = Storage(flow)
        for chunk in np.array_split(starts, -(-len(starts) // 8)):  # which limits the memory
            storage.add(chunk)
        maxima = storage.predicted(places, flow.boxes.unit_ends(level), local_maximum)
        upper = np.stack([-bounds.lower[level], bounds.upper[level]], axis=-1)
        promised = (maxima.value - upper[places]) / peak[places[1]]
        targets = np.unique(maxima.point[promised.argsort()[-256:]], axis=0)
        values, _ = largest_values(flow, targets)
        excess = np.maximum(values - upper, 0.0).max(axis=(0, 2)) / peak
        missed = peak * np.maximum(excess, excess.max() / 4)
        error[level] = np.maximum(error[level], SAFETY * missed)
        count += len(points) + len(starts) + len(targets)
    return replace(bounds, error=error, evaluations=bounds.evaluations + count)


def estimated_envelope(
    flow: UnitFlow,
    bounds: Array,
    points: Array,
    *,
    error: Array,
    steepest: Array,
    method: str,
    evaluations: int,
    facts: Mapping[str, float],
    notes: tuple[str, ...] = (),
) -> Envelope:
    """Return an estimated envelope, or an attained one if neighbouring trajectories diverge.

    If they diverge, Taylor models predict nothing, and the estimate of the error is left out, so
    that the error is 0. This is assumed if some first derivative exceeds 8 times the half range of
    the output over time and over the widest box (tuned: a chaotic pendulum exceeds it many times,
    and other structures stay well below).

    Args:
        flow: The response over the boxes of the inputs.
        bounds: Attained upper bounds, shape (levels, times, outputs, 2): on the last axis first of
            the output with its sign changed, then of the output.
        points: Inputs that attain them, shape (levels, times, outputs, 2, inputs), in unit
            coordinates, in which each input runs over [-1, 1] on its widest cut.
        error: Estimated error of the bounds, shape (levels, times, outputs).
        steepest: Largest first derivative of each output by a unit coordinate, shape (outputs,).
        method: Name of the method.
        evaluations: Number of trajectories.
        facts: Further numbers by name, such as "order", the degree of the models, and "gain", the
            predicted gain that is worth a trajectory.
        notes: Remarks, one sentence each.

    Raises:
        RefusedError: A bound is not finite.
        FailedError: The bounds of a level exceed those of a lower level.
    """
    at = flow.boxes.to_physical(points)
    widest = bounds[0]
    half_range = (widest[..., 0].max(axis=0) + widest[..., 1].max(axis=0)) / 2
    nature = Nature.ESTIMATED
    estimate: Array | None = error
    if (steepest > 8.0 * half_range).any():
        nature = Nature.ATTAINED
        estimate = None
    return flow.envelope(
        bounds,
        at,
        estimate,
        method=method,
        nature=nature,
        evaluations=evaluations,
        facts=facts,
        notes=notes,
    )
