"""Branch and bound for the modal model: every bound between attained and proved.

All nodes, outputs and sides share one tree of boxes, and each box its polynomials. A box is closed
for a problem by one of five tests, all but the third on the quadratic Taylor model with the
remainder of `remainder`: 1. the output is monotone along an axis, and the neighbouring box, or the
face, covers it; 2. its bound lies below the best known value; 3. so does that of modes which turn
at rates linear in the parameters, with a remainder that holds only what else they do; 4. a concave
function above the quadratic model has no higher point; 5. near the best point the same holds for
the Taylor model there, made less concave by the remainder. Else it is halved.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.certificate.frontier import Frontier
from alphacut.frame.certificate.piece import Piece, Problems
from alphacut.frame.certificate.remainder import Remainder
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import Optima
from alphacut.fuzzy.progress_bar import Progress

PIECE = 30_000
"""Items examined together."""
HIGHER = 1e-10
"""Least gain for which a better point is taken over."""


@dataclass(frozen=True, eq=False)
class Enclosed:
    """Outcome for N problems.

    Args:
        point: Best points, shape (N, d).
        value: side × output there, shape (N,).
        proved: Proved bounds above `value`, shape (N,).
        boxes: Boxes looked at, each as often as there are problems that need it.
    """

    point: Array
    value: Array
    proved: Array
    boxes: int


@dataclass(frozen=True)
class BranchAndBound:
    """The enclosure and its effort.

    Args:
        gap: Wanted difference between proved and attained bound, in units of the outputs.
        budget: Most boxes per problem on average; where it ends, the gap reported is wider.
    """

    gap: float = 5e-7
    budget: float = 4000

    def run(
        self,
        model: ModalModel,
        lower: Array,
        upper: Array,
        optima: Optima,
        *,
        workers: int = 1,
        progress: Progress | None = None,
    ) -> Enclosed:
        """Encloses all problems of `optima`, whose points are the best known so far.

        Args:
            model: The modal model.
            lower: Lower ends of the box, shape (d,).
            upper: Upper ends.
            optima: The problems with their best points.
            workers: Threads; the result does not depend on their number.
            progress: Called with the fraction done.
        """
        tree = Tree.of(model, lower, upper, optima, self.gap)
        frontier, size, used = Frontier.whole(len(lower), tree.numbers), len(tree.numbers), 0
        while len(frontier) and used + len(frontier) <= self.budget * size:
            used += len(frontier)
            frontier = tree.examined(frontier, workers)
            if progress:
                progress(1 - len(np.unique(frontier.problem)) / size)
        proved = tree.proved(frontier)  # what the budget left open keeps its own bound
        return Enclosed(optima.point, optima.value, proved, used)


@dataclass(frozen=True, eq=False)
class Tree:
    """Boxes of one domain and the problems that share them.

    Args:
        model: The modal model.
        lower: Lower ends of the domain, shape (d,).
        upper: Upper ends.
        optima: N problems with their best points, which improve.
        numbers: Their numbers, see `Problems`, shape (N,).
        problems: All problems of the model by number; those without a place in `optima` are idle.
    """

    model: ModalModel
    lower: Array
    upper: Array
    optima: Optima
    numbers: Array
    problems: Problems

    @classmethod
    def of(cls, model: ModalModel, lower: Array, upper: Array, optima: Optima, gap: float) -> Tree:
        """The tree with nothing but its root."""
        m, d = len(model.outputs), len(lower)
        numbers = (optima.node * m + optima.output) * 2 + (optima.side > 0)
        remainder, total = Remainder.of(model, lower, upper), 2 * m * len(model.time)
        points, jets = np.zeros((total, d)), np.zeros((total, 1 + d + d * (d + 1) // 2))
        problems = Problems(model.time, remainder, np.zeros(total), points, jets, gap)
        tree = cls(model, lower, upper, optima, numbers, problems)
        tree._renew(np.arange(len(numbers)))
        return tree

    def examined(self, frontier: Frontier, workers: int) -> Frontier:
        """Boxes and items still open after one examination of all boxes of a frontier."""

        def of(part: tuple[slice, slice]) -> tuple[Array, Array, Array]:
            return self._piece(frontier, *part).examined(self.problems)

        if workers == 1:
            results = list(map(of, frontier.pieces(PIECE)))
        else:
            with ThreadPoolExecutor(workers) as pool:
                results = list(pool.map(of, frontier.pieces(PIECE)))
        code, value, _ = (np.concatenate(part) for part in zip(*results, strict=True))
        higher = np.flatnonzero(value > self.problems.best[frontier.problem] + HIGHER)
        if len(higher):
            self._improve(frontier, higher[np.argsort(value[higher])], value)
        return frontier.children(code)

    def proved(self, frontier: Frontier) -> Array:
        """Upper bounds of all problems, where the boxes of a frontier are left open, (N,)."""
        whole = self.problems.best + self.problems.gap
        for part in frontier.pieces(PIECE):
            bound = self._piece(frontier, *part).examined(self.problems)[2]
            np.maximum.at(whole, frontier.problem[part[1]], bound)
        return whole[self.numbers]

    def _improve(self, frontier: Frontier, items: Array, value: Array) -> None:
        """Take over the centres of items, the best last, and refine them."""
        place = np.zeros(len(self.problems.best), np.int64)
        place[self.numbers] = np.arange(len(self.numbers))
        which = place[frontier.problem[items]]
        centre = frontier.geometry(self.lower, self.upper)[0]
        self.optima.point[which] = centre[frontier.box[items]]
        self.optima.value[which] = value[items]
        which = np.unique(which)
        small = self.problems.gap / 100
        refine(self.model, self.optima, which, self.lower, self.upper, small)
        self._renew(which)

    def _renew(self, which: Array) -> None:
        """Values, points and jets of the problems at places `which` of the optima."""
        optima, own = self.optima, self.numbers[which]
        point = optima.point[which]
        f, g, H = self.model.at(point, optima.node[which], optima.output[which])
        row, column = np.triu_indices(g.shape[1])
        self.problems.best[own], self.problems.point[own] = optima.value[which], point
        self.problems.jets[own] = np.column_stack([f, g, H[:, row, column]])

    def _piece(self, frontier: Frontier, boxes: slice, items: slice) -> Piece:
        """Boxes and items of a frontier with their derivatives and waves."""
        outputs = len(self.model.outputs)
        centre, radius, edges = frontier.take(boxes).geometry(self.lower, self.upper)
        box, problem = frontier.box[items] - boxes.start, frontier.problem[items]
        node, column = np.divmod(problem, 2 * outputs)
        fresh = np.append(True, (np.diff(box) != 0) | (np.diff(node) != 0))
        begin = np.flatnonzero(fresh)
        row_box, row_node = box[begin], node[begin]
        jets, started = self.model.together.jets(centre), self.model.started
        rows, count = np.searchsorted(row_box, np.arange(len(centre) + 1)), self.model.count
        forced = self._forced(jets[:, 0, :count], row_box, row_node)
        place = centre, radius, edges, rows, np.append(begin, len(box))
        return Piece(*place, row_node, column, jets, count, started, forced)

    def _forced(self, rate: Array, box: Array, node: Array) -> Array | None:
        """Waves under a load of boxes `box` (R,) with eigenvalues (B, n) at nodes, (R, 3, n)."""
        if (load := self.model.load) is None:
            return None
        return np.stack(load.response(rate[box], node), 1)
