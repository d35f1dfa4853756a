"""Guaranteed envelopes of linear structures with many fuzzy inputs, by Lagrangian relaxation.

The response of a linear structure with classical modes is a sum over modes of functions of few
intervening variables each (section 7 of the paper): frequency, decay and participation factors,
which are nearly linear in the inputs over the box. `bounds.dual_function` states the bound, which
holds for any multipliers. The cost is in proportion to the numbers of modes, table entries and time
nodes, and hardly depends on the number of inputs.
"""

from __future__ import annotations

from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import checked_number
from alphacut.base.progress_bar import Progress, nth_subprogress, subprogress
from alphacut.frame import numbers
from alphacut.frame.bounds.box import Box, prune_ends, remainder_addition
from alphacut.frame.bounds.box_proof import Answer, BoxBounds, Goal, PrunedPeaks, refusing
from alphacut.frame.bounds.level import LevelModels, OutputBounds, improve_all, least_peak
from alphacut.frame.bounds.spatial_branch_and_bound import halvings, prove
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import Flow, LinearFlow, exact_flow
from alphacut.frame.methods.method import Method
from alphacut.frame.result import Ends, Envelope
from alphacut.frame.structures.linear import frequencies
from alphacut.frame.verification.rounding import rounding_margin

DAMPED_WORK = 5.0
"""Factor of the forecast work for damped modes: with up to six inputs branch and bound comes first,
which closes gaps that the dual bound of these modes leaves (tuned)."""
Problems = dict[tuple[int, int], OutputBounds]
"""Bounds of -output (side 0) and output (side 1), by the indices of the output and of the side."""


@dataclass(frozen=True)
class DualProof(Method):
    """The dual bound as a method, and its options.

    Args:
        gap: Distance of guaranteed bounds and attained values that suffices, as a fraction of the
            peak of each output. The Taylor remainders may leave a wider gap.
        peaks: The same for the bounds above a peak. Where they are wider, the box is bisected.
        below: Gap that suffices below a peak, as a fraction of the distance from the peak. With 1
            only the peaks are bounded.
        slabs: Largest number of cells of the modes' ranges for a bound.
        steps: Largest number of evaluations of the dual function for each cell.
        parts: Largest number of sub-boxes for a peak, and of sub-boxes that may be refused.
        workers: Number of threads, which does not change the result; by default all cores.

    Raises:
        RefusedError: A value is not positive.
    """

    name: ClassVar[str] = "dual"
    is_exact: ClassVar[bool] = True
    gap: float = 2e-3
    peaks: float = 0.019
    below: float = 0.1
    slabs: int = 24
    steps: int = 40
    parts: int = 32
    workers: int | None = None

    def __post_init__(self) -> None:
        for key in ("gap", "peaks", "below", "slabs", "steps", "parts"):
            checked_number(key, getattr(self, key), positive=True)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the guaranteed envelope of all outputs on all levels.

        Boxes of inputs whose gaps of peaks are too wide are bisected.

        Args:
            flow: The response over the boxes of the inputs.
            progress: Called with the completed fraction.

        Raises:
            UnprovedError: The structure is not linear, has no classical modes that can be enclosed,
                or the integrator is not the exact one.
            FailedError: An attained value exceeds a guaranteed bound: the proof is wrong.
        """
        return prove(self, flow, rounding_margin, progress)

    @property
    def bounds_peaks_alone(self) -> bool:
        """Whether bounds below a peak are not worth any work."""
        return self.below >= 1

    def peak_gap(self, flow: UnitFlow) -> Array:
        """Return the gap that suffices at the peak of each output, shape (outputs,)."""
        return self.peaks * flow.peak

    def require_possible(self, flow: Flow, boxes: Boxes) -> None:
        """Refuse a structure without a proof, with `forecast`."""
        with refusing():
            self.forecast(exact_flow(flow), boxes)

    def forecast(self, flow: LinearFlow, boxes: Boxes) -> float:
        """Return the largest number of evaluations of the dual function for one bound.

        Damped modes count more: two responses of each to each load, and sub-boxes besides.

        A small part of the box is modelled first, so that a structure that cannot be bounded over
        any sub-box is refused at once.

        Args:
            flow: The exact response.
            boxes: The boxes of the inputs; the widest one counts.

        Raises:
            UnprovedError: A mode does not oscillate, or no mode of the structure can be enclosed,
                however narrow the box is.
            numpy.linalg.LinAlgError: A matrix of the structure is singular.
        """
        # With a smaller ratio of frequencies, rounding of the stiffness may hide a rigid motion.
        omega = frequencies(flow.system)
        if omega[0] <= 1e-6 * omega[-1]:
            what = "a mode does not oscillate: the stiffness lets the structure drift"
            raise UnprovedError(what, "take improved-graph-follower")
        # Modes are enclosed over a thousandth of the box if they are over any sub-box.
        work = float(self.slabs * self.steps)
        low = boxes.nominal + 1e-3 * (boxes.lower[0] - boxes.nominal)
        high = boxes.nominal + 1e-3 * (boxes.upper[0] - boxes.nominal)
        if (high > low).any():
            first_nodes = np.arange(2)
            any_error = np.full(len(flow.outputs), np.inf)
            box = Box(flow.system, boxes.names, flow.time, low, high)
            box.level(first_nodes, any_error)
            if box.structure is None:
                work *= DAMPED_WORK
        return work

    def bounds(self, flow: LinearFlow, boxes: Boxes, goal: Goal) -> list[Answer]:
        """Return bounds on each level of a box, or the error of a level that cannot be bounded.

        An error of one level does not keep the others from being bounded. The bounds over a wider
        box hold over the narrower ones, and are used there.

        Args:
            flow: The exact response.
            boxes: The box on each level, from the widest to the narrowest.
            goal: Which bounds are needed and what is known, with arrays whose first axis is that
                of the levels of `boxes`.

        Returns:
            For each level its bounds, or the `UnprovedError` that says why there are none.
        """
        answers: list[Answer] = []
        wider = np.full(goal.known_upper.shape[1:], np.inf)
        for k, (low, high) in enumerate(zip(boxes.lower, boxes.upper, strict=True)):
            box = Box(flow.system, boxes.names, flow.time, low, high)
            try:
                if (high > low).any():
                    found = self._level_bounds(flow, box, goal, k, wider=wider)
                else:
                    found = _exact_bounds(box)
                answers.append(found)
                wider = found.upper  # a narrower box lies inside the wider one
            except UnprovedError as error:
                answers.append(error)
        return answers

    def _level_bounds(
        self, flow: LinearFlow, box: Box, goal: Goal, k: int, *, wider: Array
    ) -> BoxBounds:
        """Return the bounds on one level of a box of inputs.

        Args:
            flow: The exact response.
            box: The box on the level; some input has a width.
            goal: Which bounds are needed, and what is known.
            k: Index of the level in `goal`.
            wider: Bounds of (-output, output) over a box that contains this one, shape (times,
                outputs, 2).
        """
        needed = goal.needed[k]
        upper = np.minimum(goal.known_upper[k], wider)
        nodes = np.flatnonzero(needed.any(axis=(1, 2)))
        outputs = np.flatnonzero(needed.any(axis=(0, 2)))
        is_complete = bool(needed.all())
        # Over the whole box all bounds are wanted; over a sub-box those of the peaks that are still
        # open.
        gap = self.peaks * goal.peak
        if is_complete:
            gap = self.gap * goal.peak
        level = box.level(
            nodes,
            numbers.TRUNCATION * gap[outputs],
            outputs,
            model_tolerance=numbers.TRUNCATION * self.peaks * goal.peak,
        )
        problems: Problems = {}
        for o, s in np.argwhere(needed.any(axis=0)):
            index = int(np.searchsorted(outputs, o))
            problem = OutputBounds.initial(level, index, int(s), gap[o], goal.incumbent[k, o, s])
            problem.upper[:] = upper[nodes, o, s]
            problems[o, s] = problem

        tick = nth_subprogress(goal.tick, k, len(goal.needed))
        with ThreadPoolExecutor(goal.workers) as pool:
            # 1. Find multipliers with low bounds, and inputs with large values of the models.
            if is_complete:
                self._minimise(problems, goal, flow, box, pool, progress=tick)
            else:
                # No bound below the peak needs to be lower.
                self._improve(
                    problems,
                    pool,
                    numbers.PEAK_CELLS,
                    numbers.PEAK_STEPS,
                    slack=1.0,
                    tick=tick,
                    peaks_alone=self.bounds_peaks_alone,
                )
            unit = np.zeros((*needed.shape, len(box.active)))
            for (o, s), problem in problems.items():
                upper[nodes, o, s] = problem.upper
                unit[nodes, o, s] = problem.model_inputs

            # 2. The exact responses at these inputs attain values, which raise the incumbents.
            attained = _attained_values(box, needed, unit=unit)
            for (o, s), problem in problems.items():
                problem.wanted_gap = self.peaks * goal.peak[o]
                problem.attained = max(problem.attained, attained[:, o, s].max())

            # 3. Prune ends of the box that contain no peak above the incumbent and the gap.
            shape = (*needed.shape[1:], len(box.low))
            fractions = np.zeros(shape)
            remaining = np.empty((2, *shape))
            remaining[:] = np.stack([box.low, box.high])[:, np.newaxis, np.newaxis]
            pruned_upper = upper.copy()
            jobs = []
            for (o, s), problem in problems.items():
                # What the models reach may lie above all that is attained.
                above = np.flatnonzero(problem.upper > problem.attained + problem.wanted_gap)
                if len(above):
                    job = pool.submit(prune_ends, level, problem, above)
                    jobs.append((o, s, nodes[above], job))
            for o, s, nodes_above, job in jobs:
                found = job.result()
                fractions[o, s, box.active] = found.gap_fractions
                remaining[:, o, s] = box.inputs(np.stack([found.low, found.high]))
                pruned_upper[nodes_above, o, s] = found.upper

            # 4. Bound the smallest peaks.
            between = np.zeros(needed.shape[:2])
            least_peaks = None
            if is_complete:
                between = level.interpolation_error()
                least_peaks = _least_peaks(flow, box, level, between=between, pool=pool)
        return BoxBounds(
            upper=upper,
            attained=attained,
            attained_at=box.inputs(unit),
            between_nodes=between,
            gap_fractions=fractions,
            pruned=PrunedPeaks(remaining, pruned_upper),
            least_peaks=least_peaks,
            facts={"single_modes": len(level.modes.oscillators)},
        )

    def _minimise(
        self,
        problems: Problems,
        goal: Goal,
        flow: LinearFlow,
        box: Box,
        pool: Executor,
        *,
        progress: Progress,
    ) -> None:
        """Minimise the dual functions of all bounds in three passes.

        A bound is the minimum of a dual function over cells of the ranges of the modes. The first
        pass shows where the peaks are. The second one bisects cells where gaps are wide. The third
        one bisects further where bounds lie above a peak.

        Args:
            problems: The bounds, which are improved in place.
            goal: What is known of the peaks.
            flow: The exact response.
            box: The box.
            pool: Threads.
            progress: Called with the completed fraction.

        Raises:
            UnprovedError: The models are too inaccurate over the box, and bisections would help.
        """
        if self.bounds_peaks_alone:
            # No bound at a node matters that lies below the peak at the midpoint of the box. Bounds
            # that are still infinite are made finite without effort.
            jobs = []
            for problem in problems.values():
                effort = problem.effort(1, 1)._replace(ascents=0)
                jobs.append((problem, np.flatnonzero(np.isinf(problem.upper)), effort))
            improve_all(jobs, pool, lambda done: None)
            midpoint = box.inputs(np.zeros((1, len(box.active))))
            response = flow.values(midpoint)[0]
            for (o, _), problem in problems.items():
                problem.model_value[:] = response[:, o] * problem.side
                problem.model_inputs[:] = 0.0

        alone = self.bounds_peaks_alone
        first_cells = self.slabs
        if alone:
            # The highest bounds get more afterwards. With four times as many cells of a node the
            # peaks of 13 inputs are lower by less than 0.02 % (measured).
            first_cells = 6
        # Bounds above a peak get three times the cells of others: with twice as many the peaks of
        # 13 inputs are 0.05 % lower (measured).
        cells_above_peak = 3 * self.slabs
        self._improve(
            problems, pool, 1, 1, slack=float(alone), tick=subprogress(progress, 0.0, 0.05)
        )
        if not goal.is_last:
            self._require_accurate(problems, box, goal.peak)
        self._improve(
            problems,
            pool,
            first_cells,
            self.steps,
            slack=self.below,
            multiple=numbers.REMAINDER_MULTIPLE,
            tick=subprogress(progress, 0.05, 0.75),
        )
        self._improve(
            problems,
            pool,
            cells_above_peak,
            self.steps,
            slack=1.0,
            multiple=numbers.REMAINDER_MULTIPLE_AT_PEAKS,
            tick=subprogress(progress, 0.75, 1.0),
            peaks_alone=alone,
        )

    def _improve(
        self,
        problems: Problems,
        pool: Executor,
        cells: int,
        steps: int,
        *,
        slack: float,
        tick: Progress,
        multiple: float = 0.0,
        peaks_alone: bool = False,
    ) -> None:
        """Lower all bounds that exceed the known values of the models by more than suffices.

        Args:
            problems: The bounds, which are improved in place, by the indices of the output and of
                the side: 0 for the output with its sign changed, 1 for the output.
            pool: Threads.
            cells: Largest number of cells into which a bound may divide the ranges of the modes.
            steps: Largest number of evaluations of the dual function for a cell.
            slack: Gap that suffices in addition to the wanted one, as a fraction of the distance of
                the model's value from the peak; with 1 bounds below the peak need not be lower.
            tick: Called with the completed fraction.
            multiple: Gap that is not worth any effort, as a multiple of what the Taylor remainders
                add to a bound.
            peaks_alone: Whether only the highest bound of each side is lowered.
        """
        jobs = []
        for problem in problems.values():
            effort = problem.effort(cells, steps, slack, multiple)
            jobs.append((problem, problem.open_nodes(slack), effort))
        improve_all(jobs, pool, tick, peaks_alone=peaks_alone)

    def _require_accurate(self, problems: Problems, box: Box, peak: Array) -> None:
        """Check that bounds are not made wide by Taylor remainders that bisections would reduce.

        Args:
            problems: Bounds at all time nodes with the largest known values of the models, by the
                indices of the output and of the side (0 for the output with its sign changed).
            box: The box of the inputs.
            peak: Peak of each output, shape (outputs,).

        Raises:
            UnprovedError: At the largest value of a model the remainders add more than a tenth of
                the peak to the bound, and the sub-boxes allowed suffice to halve the inputs that
                cause it. The error has the index of the input to bisect.
        """
        for (o, _), problem in problems.items():
            fractions = np.zeros(len(box.low))
            highest = int(problem.model_value.argmax())
            addition = remainder_addition(problem, highest)
            fractions[box.active] = addition.input_fractions
            if addition.total > numbers.WIDE * peak[o] and halvings(fractions, self.parts) >= 1:
                what = f"the remainders of the modes are {addition.total / peak[o]:.2g} of a peak"
                raise UnprovedError(what, "take narrower inputs", int(fractions.argmax()))


def _attained_values(box: Box, needed: Mask, *, unit: Array) -> Array:
    """Return what exact responses attain, each bound at a point of its own.

    The last axis of two, the side, has first the output with its sign changed, then the output.

    Args:
        box: The box of the inputs.
        needed: Bounds that are asked for, shape (times, outputs, 2).
        unit: Unit coordinates of the points, shape (times, outputs, 2, inputs with a width).

    Returns:
        Shape (times, outputs, 2), -∞ for bounds that are not asked for.
    """
    node, output, side = np.nonzero(needed)
    points = unit[needed]
    value = box.midpoint_modes.response(box.time)[node, output]
    # Most points may be the midpoint of the box, whose response is known.
    is_moved = points.any(axis=1)
    if is_moved.any():
        value[is_moved] = box.exact_values(points[is_moved], node[is_moved], output[is_moved])
    attained = np.full(needed.shape, -np.inf)
    attained[needed] = np.where(side == 1, value, -value)
    return attained


def _least_peaks(
    flow: LinearFlow, box: Box, level: LevelModels, *, between: Array, pool: Executor
) -> Ends:
    """Return bounds of the smallest peak of each output over a box of inputs.

    The peak of a response is the largest magnitude of the output over time, also between the time
    nodes. The smallest one belongs to the inputs under which the output moves least.

    Args:
        flow: The exact response as a function of the inputs in SI units.
        box: The box.
        level: Models of the response over the box, at all time nodes.
        between: Bound of the distance of outputs from straight lines in the step before each node,
            shape (times, outputs).
        pool: Threads, one job for each output.

    Returns:
        `lower`: guaranteed lower bounds of the smallest peaks, 0 or more; `upper`: upper bounds of
        the peak of one response that has a small one; shape (outputs,) each.
    """
    count = len(level.modes.orders)
    found = list(pool.map(partial(least_peak, level), range(count)))
    lower = np.array([bound for bound, _ in found])
    unit = np.stack([point for _, point in found])
    # Steepest descent over the corners of the box, from the points at which the bounds are taken.
    # In each step one coordinate changes its sign, or none.
    d = len(box.active)
    sign_changes = 1 - 2 * np.eye(d + 1, d)  # of one input in each row, and of none in the last
    # Tuned: more steps hardly lower the peaks, which hold as attained values in any case.
    for _ in range(3):
        tried = np.unique((unit[:, np.newaxis] * sign_changes).reshape(-1, d), axis=0)
        # Small peaks are often attained at corners, since outputs are nearly monotone in single
        # inputs.
        peaks = np.abs(flow.values(box.inputs(tried))).max(axis=1)
        unit = tried[peaks.argmin(axis=0)]
    reached = []
    for o in range(count):
        reached.append(float(box.peak_over_time(unit[o], between)[o]))
    return Ends(lower, np.array(reached))


def _exact_bounds(box: Box) -> BoxBounds:
    """Return the bounds over a box without width, which is one point: its exact response.

    No input accounts for a gap, since there is none: `gap_fractions` is zero.
    """
    value = box.midpoint_modes.response(box.time)
    sides = np.stack([-value, value], axis=-1)
    between = box.midpoint_modes.interpolation_error(box.time)
    return BoxBounds(
        upper=sides,
        attained=sides,
        attained_at=np.broadcast_to(box.low, (*sides.shape, len(box.low))).copy(),
        between_nodes=between,
        gap_fractions=np.zeros((*sides.shape[1:], len(box.low))),
        least_peaks=Ends(np.abs(value).max(axis=0), box.peak_over_time(np.zeros(0), between)),
    )
