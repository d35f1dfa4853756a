"""Improved Graph Follower: Taylor models of all time nodes propose trajectories in batches.

The idea is that of `graph_follower`: stored trajectories ("graphs"), Taylor models, a tolerance and
a final choice among all graphs. Instead of one node after the other, every round asks the models of
the best graphs at all nodes, takes the proposal with the largest predicted gain in each window of
time, and computes these graphs together. Nodes before and after a discovery profit alike. Points
spread over the box at the start find basins that no model shows. With many inputs, basins are also
looked for among crossings: optima of some nodes with a few inputs of others. Peaks, which matter
more than other nodes, are followed to a smaller gain.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isqrt
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import checked_number
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.frame.bounds.box_proof import take_larger
from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import global_maximum, local_maximum
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.methods.graph_follower import Places, Storage, estimated_envelope
from alphacut.frame.methods.method import Method
from alphacut.frame.methods.sampled import SAFETY, independent_excess, largest_values, spread_points
from alphacut.frame.result import Envelope
from alphacut.frame.structures.linear import frequencies

BATCH = 32
"""Graphs that are computed together (tuned: more are faster, but know less of each other)."""
MAX_GLOBAL_INPUTS = 4
"""Inputs up to which Taylor models are maximised globally, and above which optima are crossed
(tuned: the time of a global maximum grows as 3 to the power of the inputs)."""
LEAST_GAIN = 1e-10
"""Gain, as a fraction of a peak, that may be rounding."""


@dataclass(frozen=True)
class ImprovedFollower(Method):
    """The improved Graph Follower and its options.

    Args:
        tolerance: Predicted gain above which a new graph is computed, as a fraction of the peak of
            each output, or in the unit of the first displacement (of the first output if there is
            none) if the envelope is not relative.
        budget: Largest number of graphs over all levels.
        seed: Seed of the points that are spread over the boxes.

    Raises:
        RefusedError: An option is out of range.
    """

    name: ClassVar[str] = "improved-graph-follower"
    tolerance_is_gain: ClassVar[bool] = True
    tolerance: float = 7e-4
    budget: int = 5000
    seed: int = 0

    def __post_init__(self) -> None:
        checked_number("tolerance", self.tolerance, positive=True)
        checked_number("budget", self.budget, whole=True, least=1)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the envelope of two passes from different points, with an estimated error.

        The error is twice the sum of what the Taylor models still predict, what an independent
        sample finds beyond the bounds, and the difference of the two passes. If neighbouring
        trajectories diverge there is no estimate, and the bounds are attained only.

        Args:
            flow: The response over the boxes of the inputs.
            progress: Called with the completed fraction.

        Raises:
            RefusedError: A trajectory does not exist or is not finite, or columns yield, so that
                there are no derivatives.
            StepError: A time step did not converge.
        """
        from scipy.ndimage import maximum_filter1d

        # Gain of each output that is not worth a trajectory, shape (outputs, 1).
        limit = self._limit(flow)
        first = self.run_pass(flow, subprogress(progress, 0.0, 0.4))
        other_points = replace(self, seed=self.seed + 1)
        second = other_points.run_pass(flow, subprogress(progress, 0.4, 0.8))
        # Upper bounds of both sides of the outputs, (levels, times, outputs, 2), and their points.
        # Both passes attain their bounds, so that the larger one of each is attained, too.
        is_better = second.bounds > first.bounds
        bounds = np.maximum(first.bounds, second.bounds)
        points = np.where(is_better[..., np.newaxis], second.points, first.points)
        missed, count = independent_excess(flow, bounds, subprogress(progress, 0.8, 1.0))

        # Gains above the tolerance remain where the budget ended a pass. They are added up.
        gains = np.array([first.predicted_gain, second.predicted_gain])
        is_large = gains > limit
        predicted = np.where(is_large, 0.0, gains).max(axis=0)
        predicted += np.where(is_large, gains, 0.0).sum(axis=0)
        # The difference of the passes at a node is the largest one over a twentieth of the nodes
        # around it, and at least a tenth of the largest of all.
        difference = np.abs(second.bounds - first.bounds).max(axis=-1)
        window = 2 * (len(flow.time) // 40) + 1
        # A basin that one pass missed is missed at neighbouring nodes as well, where the passes may
        # agree by chance.
        nearby = maximum_filter1d(difference, window, axis=1)
        difference = np.maximum(nearby, 0.1 * difference.max(axis=1, keepdims=True))
        # Gains up to the tolerance are left aside on purpose; half of the tolerance stands for
        # those that no model shows.
        left_aside = predicted.max(axis=-1) + limit[:, 0] / 2
        error = SAFETY * (left_aside + difference + missed[:, np.newaxis])
        notes: tuple[str, ...] = ()
        if is_large.any():
            notes = (f"stopped at the budget of {self.budget} trajectories",)
        return estimated_envelope(
            flow,
            bounds,
            points,
            error=error,
            steepest=np.maximum(first.storage.steepest, second.storage.steepest),
            method=self.name,
            evaluations=first.evaluations + second.evaluations + count,
            facts={"gain": self.tolerance, "order": 2},
            notes=notes,
        )

    def run_pass(
        self, flow: UnitFlow, progress: Progress | None = None, asked: Mask | None = None
    ) -> PassBounds:
        """Return the bounds of one pass on all levels, from the narrowest box to the widest.

        Args:
            flow: The problem.
            progress: Called with the completed fraction.
            asked: Bounds of (-output, output) whose gain counts, shape (levels, times, outputs, 2);
                all by default.
        """
        n_levels = len(flow.boxes.alpha)
        d = len(flow.boxes.names)
        storage = Storage(flow)
        shape = (n_levels, *storage.top.shape)
        out = PassBounds(np.zeros(shape), np.zeros((*shape, d)), np.zeros(shape), storage)
        # Without a selection the gain of every bound counts.
        if asked is None:
            asked = np.ones(shape, bool)
        chunk_size = _chunk_size(flow)
        nominal = flow.boxes.to_unit(flow.boxes.nominal)[np.newaxis]
        has_crossings = d > MAX_GLOBAL_INPUTS and isinstance(flow.flow, LinearFlow)
        for level, tick in flow.boxes.inside_out(progress):
            # Points of the quasi-random sequence that no other level and no other seed uses.
            box = flow.boxes.unit_ends(level)
            skip = 100_003 * (n_levels * self.seed + level + 1)
            max_graphs = self.budget * (n_levels - level) // n_levels
            first = len(storage)
            has_width = bool((box[1] > box[0]).any())
            explored = points = nominal
            if has_width:
                # The values alone of 256 trajectories of each kind are looked at, and 64 graphs are
                # computed (tuned: fewer miss basins, more take longer).
                lower, upper = box
                explored = spread_points(lower, upper, count=256, skip=skip)
                points = np.vstack([nominal, explored[:64]])
            elif len(storage):
                points = nominal[:0]  # the only point of the box has a graph
            models = _LevelModels(storage, box, self._limit(flow), asked[level])
            if level + 1 < n_levels:  # a wider box contains what a narrower one attains
                models.sampled[:] = out.bounds[level + 1]
                models.sampled_at[:] = out.points[level + 1]
            models.explore(explored)
            rounds = 1
            if has_crossings and has_width:
                rounds += 8  # tuned: later rounds rarely find a new basin
            for crossing in range(rounds):
                if crossing:
                    explored = models.crossed_optima(np.random.default_rng([skip, crossing]))
                    models.explore(explored)
                    points = models.proposals(max_graphs - len(storage))
                out.evaluations += len(explored)
                while len(points):
                    points = points[: max(1, max_graphs - len(storage))]
                    for chunk in np.array_split(points, -(-len(points) // chunk_size)):
                        models.predict(storage.add(chunk))
                        computed = len(storage) - first
                        allowed = max(1, max_graphs - first)
                        tick(min(1.0, computed / allowed))
                    points = models.proposals(max_graphs - len(storage))
            # Optima of the models that are not worth a graph are worth their values.
            is_predicted = models.predicted > storage.top
            if has_crossings and is_predicted.any():
                # With many inputs a graph with all derivatives costs as much as many values.
                targets = np.unique(models.target[is_predicted], axis=0)
                models.explore(targets)
                out.evaluations += len(targets)

            # Post-processing: the best of all graphs and explored trajectories counts.
            # A trajectory that was only explored may exceed all graphs.
            is_sampled = (models.sampled > storage.top)[..., np.newaxis]
            graph_points = storage.points[storage.best]
            out.bounds[level] = np.maximum(models.sampled, storage.top)
            out.points[level] = np.where(is_sampled, models.sampled_at, graph_points)
            out.predicted_gain[level] = np.maximum(models.predicted - out.bounds[level], 0.0)
        out.evaluations += len(storage)
        return out

    def _limit(self, flow: UnitFlow) -> Array:
        """Return the gain that is not worth a graph, shape (outputs, 1); at least rounding."""
        allowed = np.maximum(self.tolerance * flow.scale, LEAST_GAIN * flow.peak)
        return np.asarray(allowed[:, np.newaxis])


def _chunk_size(flow: UnitFlow) -> int:
    """Return how many graphs (trajectories with two derivatives) are computed at a time, 1 to 32.

    Their arrays have at most 64 million numbers (512 MB): for each graph the outputs at all nodes,
    or the powers of the step map within a block of nodes, each with its derivatives. A single graph
    may need more, and is computed nevertheless.

    Args:
        flow: The response, which tells the numbers of time nodes, outputs, inputs and unknowns.
    """
    d = len(flow.boxes.names)
    n_times = flow.time.size
    # The propagator of linear structures is applied in blocks of about √times nodes.
    count = n_times * len(flow.outputs)
    if isinstance(flow.flow, LinearFlow):
        states = 2 * len(frequencies(flow.flow.system))
        count = max(count, (isqrt(n_times) + 1) * states**2)
    # Each number comes with d first and d² second derivatives.
    return int(np.clip(64e6 / (count * (1 + d + d * d)), 1, BATCH))


@dataclass(eq=False)
class PassBounds:
    """Attained bounds of (-output, output) of one pass.

    Args:
        bounds: The bounds, shape (levels, times, outputs, 2).
        points: Unit coordinates that attain them, shape (levels, times, outputs, 2, inputs).
        predicted_gain: Gain that the models predict beyond the bounds, same shape as `bounds`. It
            is above the tolerance where the budget ended the pass.
        storage: All graphs.
        evaluations: Number of graphs and of trajectories whose values alone were looked at.
    """

    bounds: Array
    points: Array
    predicted_gain: Array
    storage: Storage
    evaluations: int = 0


class _LevelModels:
    """Predictions of the Taylor models of stored graphs in one box.

    Args:
        storage: The graphs.
        box: Lower and upper ends of the box in unit coordinates, shape (inputs,) each.
        limit: Gain of each output that is not worth a graph, shape (outputs, 1).
        asked: Bounds whose gain counts, shape (times, outputs, 2).

    Attributes:
        sampled: Largest values of explored trajectories, shape (times, outputs, 2).
        sampled_at: Unit coordinates of these trajectories, shape (times, outputs, 2, inputs).
        predicted: Largest values that the models predict, shape (times, outputs, 2).
        target: Unit coordinates at which they are predicted, as `sampled_at`.
    """

    def __init__(
        self, storage: Storage, box: tuple[Array, Array], limit: Array, asked: Mask
    ) -> None:
        """Predict all bounds from the graphs that are stored already."""
        self.storage = storage
        self.box = box
        self.limit = limit
        self.asked = asked
        self.sampled: Array = np.full(storage.top.shape, -np.inf)
        self.sampled_at = np.zeros((*storage.top.shape, len(box[0])))
        self.predicted = storage.top.copy()
        self.target = np.zeros(self.sampled_at.shape)
        if len(storage):
            self.predict(storage.all_places)

    @property
    def radius(self) -> Array:
        """Radii of the box, shape (inputs,)."""
        lower, upper = self.box
        return (upper - lower) / 2

    def explore(self, points: Array) -> None:
        """Compute trajectories without derivatives, and keep their values where they are larger.

        `self.sampled` gets the largest values of all trajectories explored so far, for each time
        node, output and side, and `self.sampled_at` their unit coordinates, both in place.

        Args:
            points: Inputs, shape (trajectories, inputs), in unit coordinates, in which each input
                runs over [-1, 1] on its widest cut.

        Raises:
            RefusedError: A trajectory does not exist or is not finite.
            StepError: A time step did not converge.
        """
        values, index = largest_values(self.storage.flow, points)
        # The first of equal trajectories is kept, so that the result does not depend on later ones.
        take_larger(self.sampled, self.sampled_at, values, points[index])

    def crossed_optima(self, rng: np.random.Generator) -> Array:
        """Return points between known optima, which may lie in a basin that no model shows.

        An optimum is the graph that is the best at a place: a time node, an output and one of its
        signs. The optima of random places are drawn, and each of their inputs is replaced with the
        probability 2 / (number of inputs): in half of the points by the same input of the optimum
        of another place, in the other half by a random number within the box.

        Args:
            rng: Generator of all random numbers.

        Returns:
            Unit coordinates, 8 points for each stored graph, shape (points, inputs). They are
            neither sorted nor distinct.
        """
        storage = self.storage
        d = len(self.radius)
        count = 8 * len(storage)  # tuned
        # Places are drawn with their frequency: a graph that is the best at many nodes is drawn
        # often.
        optima, partners = storage.points[rng.choice(storage.best.ravel(), (2, count))]
        # A third of the random numbers lies at the ends of the range.
        unit = np.clip(rng.uniform(-1.5, 1.5, optima.shape), -1, 1)
        drawn = unit * (self.box[1] - self.box[0]) / 2 + (self.box[0] + self.box[1]) / 2
        replacements = np.where(rng.random((count, 1)) < 0.5, drawn, partners)
        return np.where(rng.random(optima.shape) < 2.0 / d, replacements, optima)

    def predict(self, places: Places) -> None:
        """Update predictions at places from the Taylor models of the best graphs there.

        `self.predicted` gets the largest value of each model within the box and not too far from
        its graph, and `self.target` the unit coordinates of this value, in place. In a box without
        width, and without places, nothing changes.

        Args:
            places: Indices of time nodes, outputs and sides (0 for the output with its sign
                changed, 1 for the output), arrays of shape (places,).
        """
        if len(places[0]) and (self.radius > 0).any():
            maximise: Callable[..., Array] = local_maximum
            if len(self.radius) <= MAX_GLOBAL_INPUTS:
                maximise = global_maximum
            # A Taylor model is trusted up to 0.6 times the radius of the box (tuned: with a larger
            # region more proposals are wrong, with a smaller one more are needed).
            reach = 0.6 * np.maximum(self.radius, 1e-300)
            maxima = self.storage.predicted(places, self.box, maximise, reach=reach)
            self.predicted[places] = maxima.value
            self.target[places] = maxima.point

    @property
    def least_gains(self) -> Array:
        """Predicted gain from which on each bound is worth a new graph, shape (times, outputs, 2).

        The last axis has first the output with its sign changed, then the output. The gain is the
        tolerance, a fiftieth of it near the peak of a side, at least 1e-10 of the peak of the
        output, and infinite for bounds that are not asked for.
        """
        top = self.storage.top
        peak = self.storage.flow.peak[:, np.newaxis]
        # Within 2 % of a peak, 2 % of the tolerance is worth a graph (tuned: this costs a Newton
        # step or two for each peak).
        near_peak = top >= (1 - 0.02) * np.maximum(top.max(axis=0), 0.0)
        least = np.maximum(self.limit * np.where(near_peak, 0.02, 1.0), LEAST_GAIN * peak)
        return np.where(self.asked, least, np.inf)

    def proposals(self, count: int) -> Array:
        """Return points at which models or explored trajectories promise enough gain for a graph.

        The time nodes are divided into up to 32 windows, and each gives at most one point: the one
        with the largest gain over the gain that is worth a graph, if it lies at least 0.02 in some
        unit coordinate from those of earlier windows. Predictions at points whose graphs are stored
        already were wrong: such entries of `self.predicted` are set to the best value that is
        stored, in place.

        Args:
            count: Largest number of points, 0 or more.

        Returns:
            Unit coordinates, shape (points, inputs); without points where no gain is worth a graph.
        """
        # Gains are compared over the least gain of each bound, since outputs have different units
        # and peaks are worth more.
        gains = (np.maximum(self.predicted, self.sampled) - self.storage.top) / self.least_gains
        chosen: list[Array] = []
        # The graphs of one batch do not know of each other: they come from different windows of
        # time and lie apart, so that they find different optima.
        count = min(count, BATCH)
        windows = np.array_split(np.arange(len(gains)), max(1, min(count, len(gains))))
        for window in windows:
            # The 40 largest gains of a window are looked at (tuned).
            for k in np.argsort(-gains[window], axis=None)[:40]:
                node, output, side = np.unravel_index(k, gains[window].shape)
                place = (window[node], output, side)
                if gains[place] <= 1:
                    break
                point = self.target[place]
                if self.sampled[place] > self.predicted[place]:
                    point = self.sampled_at[place]
                if self.storage.holds(point, near=1e-7):
                    self.predicted[place] = self.storage.top[place]
                elif all(np.abs(point - neighbour).max() > 0.02 for neighbour in chosen):
                    # Graphs of one batch are at least this far apart in unit coordinates.
                    chosen.append(point)
                    break
        return np.array(chosen)[:count].reshape(-1, len(self.radius))
