"""Proved envelopes of linear structures with many fuzzy inputs: Lagrangian relaxation as a method.

A linear structure with classical modes answers as a sum over modes of functions of few intervening
variables each (section 7 of the paper): frequency, decay and shares, which bend little over the
box. `bounds.dual_function` states the bound, which holds for any multipliers. The cost is one of
modes, tables and nodes, and hardly one of inputs.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import checked_number
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.base.threads import KernelThreads
from alphacut.frame import numbers
from alphacut.frame.bounds.box import Box
from alphacut.frame.bounds.box_proof import Answer, BoxBounds, Goal
from alphacut.frame.bounds.least_peaks import call_bound_cell, least_peak
from alphacut.frame.bounds.level import LevelModels, OutputBounds, improve_all
from alphacut.frame.bounds.node_bounds import call_bound_nodes
from alphacut.frame.bounds.pruning import prune_ends, remainder_addition
from alphacut.frame.bounds.spatial_branch_and_bound import halvings, prove
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Ends, Envelope
from alphacut.frame.response.duhamel import call_with_load
from alphacut.frame.structures.linear import frequencies

DRIFT = 1e-6
"""Lowest frequency over the highest at which rounding of the stiffness may hide a drift."""
NEAR = 1e-3
"""Fraction of the box about the nominal inputs over which modes are enclosed if any part of the box
can be proved."""
WORK_OF_PASSES = 0.0, 0.05, 0.75, 1.0
"""Fractions of the work at which the passes over all nodes begin and end, about."""
Problems = dict[tuple[int, int], OutputBounds]
"""Bounds of an output on a side, by their indices."""


@dataclass(frozen=True)
class DualProof:
    """The method and its options.

    Args:
        gap: Distance of proved and attained bounds that suffices, as a fraction of each output's
            peak; what the remainders leave may be more.
        peaks: The same of the bounds above a peak, above which the box of inputs is parted.
        below: Gap that suffices below a peak, as a fraction of the distance from it; at 1 peaks
            alone are bounded.
        slabs: Most parts of the modes' ranges for a bound.
        steps: Most evaluations of the dual function for each of them.
        parts: Most parts of the box that a peak is worth, and that are refused.
        workers: Threads, which do not change the result; all cores unless given.

    Raises:
        RefusedError: A value is not positive.
    """

    name: ClassVar[str] = "dual"
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

        Raises:
            UnprovedError: The structure has no classical modes that can be enclosed, or the motion
                is not the exact one.
        """
        return prove(self, flow, progress)

    @property
    def bounds_peaks_alone(self) -> bool:
        """Whether no bound below a peak is worth any work."""
        return self.below >= 1

    def peak_gap(self, flow: UnitFlow) -> Array:
        """Return the gap at peaks that suffices, shape (m,)."""
        return self.peaks * flow.peak

    def forecast(self, flow: LinearFlow, boxes: Boxes) -> float:
        """Return the most evaluations of the dual function for a bound.

        A small part of the box is bounded first, so that what no part can mend is refused at once.

        Raises:
            UnprovedError: No mode of the structure can be enclosed, however narrow a part is.
        """
        rates = frequencies(flow.system)
        if rates[0] <= DRIFT * rates[-1]:
            what = "a mode does not oscillate: the stiffness lets the structure drift"
            raise UnprovedError(what, "take improved-graph-follower")
        ends = np.stack([boxes.lower[0], boxes.upper[0]])
        near = boxes.nominal + NEAR * (ends - boxes.nominal)
        if (near[1] > near[0]).any():
            Box(flow.system, boxes.names, flow.time, *near).level(
                np.arange(2), np.full(len(flow.outputs), np.inf)
            )
        return float(self.slabs * self.steps)

    def call_kernels(self) -> None:
        """Call the compiled kernels of `bounds` that take tuples once; see `KernelThreads`."""
        call_with_load()
        call_bound_nodes()
        call_bound_cell()

    def bounds(self, flow: LinearFlow, boxes: Boxes, goal: Goal) -> list[Answer]:
        """Return bounds on each level of a box, or the refusal where modes are not enclosed."""
        answers, wider = list[Answer](), np.full(goal.outer.shape[1:], np.inf)
        for k, (low, high) in enumerate(zip(boxes.lower, boxes.upper, strict=True)):
            box = Box(flow.system, boxes.names, flow.time, low, high)
            try:
                is_fuzzy = (high > low).any()
                found = self._relaxed(flow, box, goal, k, wider) if is_fuzzy else _exact(box)
                answers.append(found)
                wider = found.outer  # what holds on a wider level holds on those inside it
            except UnprovedError as refusal:
                answers.append(refusal)
        return answers

    def _relaxed(self, flow: LinearFlow, box: Box, goal: Goal, k: int, wider: Array) -> BoxBounds:
        """Bounds on level k by those of a wider one, and what motions at the maximisers reach."""
        needed, outer = goal.needed[k], np.minimum(goal.outer[k], wider)
        nodes, outputs = np.flatnonzero(needed.any((1, 2))), np.flatnonzero(needed.any((0, 2)))
        is_complete = bool(needed.all())
        gap = (self.gap if is_complete else self.peaks) * goal.peak
        level = box.level(nodes, numbers.TRUNCATION * gap[outputs], outputs)
        problems: Problems = {}
        for o, s in zip(*np.nonzero(needed.any(0)), strict=True):
            index = int(np.searchsorted(outputs, o)), int(s)
            problems[o, s] = OutputBounds.initial(level, *index, gap[o], goal.incumbent[k, o, s])
            problems[o, s].out[0] = outer[nodes, o, s]
        with KernelThreads(goal.workers, self.call_kernels) as pool:
            # 1. find multipliers with low bounds, and inputs with high values of the models
            tick = subprogress(goal.tick, k / len(goal.needed), (k + 1) / len(goal.needed))
            self._minimise(problems, goal, flow, box, pool, needed[nodes], is_complete, tick)
            unit = np.zeros((*needed.shape, len(box.active)))
            for (o, s), problem in problems.items():
                outer[nodes, o, s], unit[nodes, o, s] = problem.out[0], problem.at
            # 2. raise the incumbents to what the exact motions at these inputs reach
            node, output, side = np.nonzero(needed)
            at, is_moved = unit[needed], unit[needed].any(1)  # most may be the centre
            reached = np.stack([x[node, output] for x in box.centre_motion()])
            if is_moved.any():
                moved = (at[is_moved], node[is_moved], output[is_moved])
                reached[:, is_moved] = box.reached(*moved)
            value, error = reached
            inner, attained_error = np.full(needed.shape, -np.inf), np.zeros(needed.shape[:2])
            inner[needed] = np.where(side, value, -value) - error
            np.maximum.at(attained_error, (node, output), 2 * error)
            above = dict[tuple[int, int], Ints]()
            for (o, s), problem in problems.items():
                problem.wanted_gap = self.peaks * goal.peak[o]
                problem.reached = max(problem.reached, inner[:, o, s].max())
                above[o, s] = problem.nodes_above(np.flatnonzero(needed[nodes, o, s]))
            # 3. prune ends of the box that hold no peak above the incumbent and the gap
            peaks = [peak for peak in problems if len(above[peak])]
            shape = (*needed.shape[1:], len(box.low))
            shares, remaining, pruned = np.zeros(shape), np.empty((2, *shape)), outer.copy()
            remaining[:] = np.stack([box.low, box.high])[:, None, None]
            jobs = [pool.submit(prune_ends, level, problems[x], above[x]) for x in peaks]
            for (o, s), job in zip(peaks, jobs, strict=True):
                low, high, over_pruned, share = job.result()
                shares[o, s, box.active] = share
                remaining[:, o, s] = box.inputs(np.stack([low, high]))
                pruned[nodes[above[o, s]], o, s] = over_pruned
            # 4. bound from below how low a peak can be
            between, least = np.zeros(needed.shape[:2]), None
            if is_complete:
                between = level.line_deviation()
                least = self._least_peaks(flow, box, level, between, pool)
        return BoxBounds(
            outer=outer,
            inner=inner,
            at=box.inputs(unit),
            between=between,
            shares=shares,
            attained_error=attained_error,
            remaining=remaining,
            pruned=pruned,
            least_peaks=least,
            facts={"single_modes": len(level.models.oscillators)},
        )

    def _minimise(
        self,
        problems: Problems,
        goal: Goal,
        flow: LinearFlow,
        box: Box,
        pool: Executor,
        needed: Mask,
        is_complete: bool,
        progress: Progress,
    ) -> None:
        """Minimise the dual functions of bounds `needed` (J, m, 2), each passed over thrice."""
        if not is_complete:
            efforts = int(numbers.PEAK_CELLS), int(numbers.PEAK_STEPS), 1.0
            jobs = [
                (problem, np.flatnonzero(needed[:, o, s]), problem.effort(*efforts))
                for (o, s), problem in problems.items()
            ]
            alone = self.bounds_peaks_alone
            return improve_all(jobs, pool, lambda done: None, peaks_alone=alone)
        if self.bounds_peaks_alone:
            # no bound at a node matters that lies below the peak in the middle of the box
            motion = flow.values(box.inputs(np.zeros((1, len(box.active)))))[0]
            jobs = [
                (x, np.flatnonzero(np.isinf(x.out[0])), x.effort(1, 1)._replace(ascents=0))
                for x in problems.values()
            ]
            improve_all(jobs, pool, lambda done: None)
            for (o, _), problem in problems.items():
                problem.out[1], problem.at[:] = motion[:, o] * problem.side, 0.0
        # a first pass shows the peaks, a second halves cells where gaps are wide, a third does so
        # further where bounds lie above a peak
        cells_at_peaks = int(numbers.CELLS_ABOVE_PEAK * self.slabs)
        first_cells = int(numbers.FIRST_CELLS) if self.bounds_peaks_alone else self.slabs
        for number, (cells, steps, slack, multiple) in enumerate(
            (
                (1, 1, float(self.bounds_peaks_alone), 0.0),
                (first_cells, self.steps, self.below, numbers.REMAINDER_MULTIPLE),
                (cells_at_peaks, self.steps, 1.0, numbers.REMAINDER_MULTIPLE_AT_PEAKS),
            )
        ):
            jobs = [
                (problem, problem.open_nodes(slack), problem.effort(cells, steps, slack, multiple))
                for problem in problems.values()
            ]
            tick = subprogress(progress, *WORK_OF_PASSES[number : number + 2])
            improve_all(jobs, pool, tick, peaks_alone=self.bounds_peaks_alone and number == 2)
            if number == 0 and not goal.last:
                self._require_narrow(problems, box, goal.peak)

    def _require_narrow(self, problems: Problems, box: Box, peak: Array) -> None:
        """Refuse a box whose Taylor remainders exceed `WIDE` of a peak, if bisections help."""
        for (o, _), problem in problems.items():
            shares = np.zeros(len(box.low))
            highest = int(problem.out[1].argmax())
            addition, shares[box.active] = remainder_addition(problem, highest)
            if addition > numbers.WIDE * peak[o] and halvings(shares, self.parts) >= 1:
                what = f"the remainders of the modes are {addition / peak[o]:.2g} of a peak"
                raise UnprovedError(what, "take narrower inputs", int(shares.argmax()))

    def _least_peaks(
        self,
        flow: LinearFlow,
        box: Box,
        level: LevelModels,
        between: Array,
        pool: Executor,
    ) -> Ends:
        """Lower bound of each output's smallest peak, and the peak of a motion that peaks low."""
        count = len(level.structure.order)
        bounds, units = zip(*pool.map(partial(least_peak, level), range(count)), strict=True)
        unit, d = np.stack(units), len(box.active)
        # steepest descent over corners, from the inputs that the lower bounds name
        moves = 1 - 2 * np.eye(d + 1, d)  # one coordinate changes its sign, or none
        for _ in range(int(numbers.LEAST_PEAK_DESCENTS)):
            tried = np.unique((unit[:, None] * moves).reshape(-1, d), axis=0)
            unit = tried[np.abs(flow.values(box.inputs(tried))).max(1).argmin(0)]
        reached = [
            box.peak_over_time(unit[o], between[:, [o]], np.array([o]))[0] for o in range(count)
        ]
        return Ends(np.array(bounds), np.array(reached))


def _exact(box: Box) -> BoxBounds:
    """Bounds where no input has a width: the exact motion with its rounding."""
    value, error = box.centre_motion()
    sides, margin, between = np.stack([-value, value], -1), error[..., None], box.centre_straying()
    return BoxBounds(
        outer=sides + margin,
        inner=sides - margin,
        at=np.broadcast_to(box.low, (*sides.shape, len(box.low))).copy(),
        between=between,
        shares=np.zeros((*sides.shape[1:], len(box.low))),
        attained_error=2 * error,
        least_peaks=Ends((np.abs(value) - error).max(0), box.peak_over_time(np.zeros(0), between)),
    )
