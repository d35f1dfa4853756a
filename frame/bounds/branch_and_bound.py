"""Spatial branch and bound for the modal model (Adjiman, Floudas 1998), up to the gap asked for.

All nodes, outputs and sides share one tree of boxes, and each box its polynomials. A box is
fathomed for a problem by one of four tests, all but the third on its quadratic Taylor model and
that one's `Remainder`: 1. the output is monotone along an axis, and the neighbouring box, or
the face, covers it; 2. its bound lies below the incumbent; 3. so does that of modes whose phase is
linear in the inputs, with a remainder that holds only what else they do; 4. a concave function
above the quadratic model (αBB) has no higher point. Else it is bisected.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import factorial

import numpy as np

from alphacut.frame.bounds.kernel import FACES, examine
from alphacut.frame.bounds.model_error import Remainder
from alphacut.frame.bounds.newton import Optima, refine
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.monomials import count, monomial_values
from alphacut.frame.modes.modal_model import ModalModel, in_planes, wave_factors
from alphacut.fuzzy.arrays import Ints
from alphacut.fuzzy.progress_bar import Progress

PIECE = 30_000
"""Items examined together."""
HIGHER = 1e-10
"""Least gain for which a better point is taken over."""
LOWER, UPPER = -1, -2
"""Places of an axis that is confined to an end of the domain."""


def enclosed(
    model: ModalModel,
    lower: Array,
    upper: Array,
    optima: Optima,
    *,
    gap: float,
    budget: float = 4000,
    workers: int = 1,
    progress: Progress | None = None,
) -> tuple[Array, int]:
    """Upper bounds of side × output for all N problems of `optima`, by spatial branch and bound.

    A problem is an output at a node on a side: number node · 2 m + 2 output + (1 for upper bounds).
    Better points that are met replace those of `optima`, in place.

    Args:
        model: The modal model.
        lower: Lower ends of the box, shape (d,).
        upper: Upper ends.
        optima: The problems with their best points.
        gap: Wanted difference between proved and attained bound, in units of the outputs.
        budget: Most boxes per problem on average; where it ends first, gaps are wider than `gap`.
        workers: Threads; the result does not depend on their number.
        progress: Called with the completed fraction.

    Returns:
        Proved upper bounds (N,), and the number of examined pairs of a box and a problem.
    """
    examined, n_problems, remainder = 0, len(optima.value), Remainder(model, lower, upper)
    frontier = Frontier.of_box(len(lower), n_problems)
    whole_box = np.full(n_problems, np.inf)  # bounds over the undivided box: 0 of outputs at rest

    def examined_piece(boxes: slice, items: slice) -> tuple[Array, Array, Array]:
        target = optima.value + gap
        return examine_items(model, (lower, upper), remainder, target, frontier, boxes, items)

    with ThreadPoolExecutor(workers) as pool:
        while len(frontier) and examined + len(frontier) <= budget * n_problems:
            examined += len(frontier)
            results = pool.map(examined_piece, *zip(*frontier.pieces(PIECE), strict=True))
            code, value, bound = (np.concatenate(x) for x in zip(*results, strict=True))
            if examined == n_problems:  # all problems over the undivided box
                whole_box = bound
            higher = np.flatnonzero(value > optima.value[frontier.problem] + HIGHER)
            if len(higher):  # the incumbent is the best of centres, refined
                higher = higher[np.argsort(value[higher])]
                problems, centre = frontier.problem[higher], frontier.geometry(lower, upper)[0]
                optima.point[problems] = centre[frontier.box[higher]]
                optima.value[problems] = value[higher]
                refine(model, optima, np.unique(problems), lower, upper, gap / 100)
            frontier = frontier.children(code)
            if progress:
                progress(1 - len(np.unique(frontier.problem)) / n_problems)
    proved = np.minimum(optima.value + gap, whole_box)
    for boxes, items in frontier.pieces(PIECE):  # boxes that are still open keep their own bounds
        np.maximum.at(proved, frontier.problem[items], examined_piece(boxes, items)[2])
    return proved, examined


def examine_items(
    model: ModalModel,
    domain: tuple[Array, Array],
    remainder: Remainder,
    target: Array,
    frontier: Frontier,
    boxes: slice,
    items: slice,
) -> tuple[Array, Array, Array]:
    """Codes, values at centres and upper bounds of some items of some boxes by `kernel.examine`.

    `domain` are the ends of all boxes together, (d,) each, `remainder` that of quadratic Taylor
    models over it, and `target` (N,) the values below which problems are fathomed.
    """
    centre, radius, edges = frontier.geometry(*domain, boxes)
    n, m, d = model.count, len(model.flow.outputs), centre.shape[1]
    box, problem = frontier.box[items] - boxes.start, frontier.problem[items]
    node, column = np.divmod(problem, 2 * m)
    is_new_row = np.append(True, (np.diff(box) != 0) | (np.diff(node) != 0))
    begin = np.flatnonzero(is_new_row)  # of rows, each a box at a node
    row_box, row_node = box[begin], node[begin]
    jets = model.together.jets(centre).swapaxes(0, 1)  # (q, B, n + P n m)
    rate, share = jets[..., :n], jets[..., n:].reshape(*jets.shape[:2], -1, n, m)
    starts = np.searchsorted(row_box, np.arange(len(centre) + 1)), np.append(begin, len(box))
    outcome: tuple[Array, Array, Array] = examine(
        (*starts, row_node, column),
        (radius, edges, wave_factors(rate, share, d)),
        model.waves(rate[0, row_box], row_node),
        model.flow.time,
        _linear_phases(remainder, radius, rate[1 : 1 + d], share[0, :, 0]),
        (remainder.tensor, remainder.margin),
        target,
        not model.loads,
    )
    return outcome


def _linear_phases(
    remainder: Remainder, radius: Array, slopes: Array, share: Array
) -> tuple[Array, ...]:
    """`modes` of `kernel.linear_phase_bound` for B boxes; `slopes` (d, B, n) are those of λ."""
    slopes, d = slopes.swapaxes(0, 1), radius.shape[1]
    phase, decay = (np.einsum("bd,bdn->bn", radius, np.abs(x)) for x in (slopes.imag, slopes.real))
    # derivatives of order k times k radii, summed, are k! times a majorant's part of degree k
    by_degree = np.split(monomial_values(radius, 3), np.cumsum([count(d, k) for k in range(3)]), 1)
    of_rate, of_share = (
        np.stack([factorial(k) * np.tensordot(by_degree[k], x, 1) for k, x in enumerate(parts)], 1)
        for parts in (remainder.rate, remainder.share)
    )
    slope = np.ascontiguousarray(slopes.imag.swapaxes(1, 2))
    return in_planes(share), slope, phase, decay, of_rate[:, 2:], of_share


@dataclass(frozen=True, eq=False)
class Frontier:
    """Open items by box, node and column.

    Along each axis a box is a dyadic interval of the domain, 2^depth + index, or one of its ends,
    `LOWER` or `UPPER`.
    """

    position: Array  # intervals of the boxes, (B, d)
    box: Array  # box of each item, rising, (I,)
    problem: Array  # number of its problem, rising for each box, (I,)

    @classmethod
    def of_box(cls, d: int, n_problems: int) -> Frontier:
        """The domain for all problems."""
        box = np.zeros(n_problems, np.int64)
        return cls(np.ones((1, d), np.int64), box, np.arange(n_problems))

    def __len__(self) -> int:
        return len(self.box)

    def geometry(
        self, lower: Array, upper: Array, boxes: slice = slice(None)
    ) -> tuple[Array, Array, Array]:
        """Centres (B, d), half widths (B, d) and outer faces (B, 2, d) of boxes of a domain.

        Outer are those lower and upper faces along each axis that lie on the domain's.
        """
        positions = self.position[boxes]
        interval = np.maximum(positions, 1)  # 2^depth + index; ends of the domain count as all
        width = 2.0 ** -np.floor(np.log2(interval + 0.5))  # fraction of the domain: 2^−depth
        begin = interval * width - 1
        at_ends = [positions == LOWER, positions == UPPER]
        middle = np.select(at_ends, [0.0, 1.0], begin + width / 2)
        radius = np.where(positions < 0, 0.0, (upper - lower) / 2 * width)
        is_outer = np.stack([begin == 0, begin + width == 1], 1)
        return lower + (upper - lower) * middle, radius, is_outer

    def pieces(self, max_items: int) -> Iterator[tuple[slice, slice]]:
        """Yield slices of boxes and of their items, in order, of at most `max_items` items.

        A box with more items is a piece alone.
        """
        n_boxes = len(self.position)
        first_items = np.append(np.searchsorted(self.box, np.arange(n_boxes)), len(self))
        start = 0
        while start < n_boxes:
            stop = int(np.searchsorted(first_items, first_items[start] + max_items, "right")) - 1
            stop = min(max(stop, start + 1), n_boxes)
            yield slice(start, stop), slice(int(first_items[start]), int(first_items[stop]))
            start = stop

    def children(self, code: Array) -> Frontier:
        """Halves and faces of boxes with the items left open by their codes of `kernel.examine`.

        A box is halved along the axis that most of its items ask for.
        """
        d = self.position.shape[1]
        to_halve = np.flatnonzero((code > 0) & (code < FACES))
        to_confine = np.flatnonzero(code >= FACES)
        count, box = 2 * d + 3**d, self.box[to_halve]  # count: halves and faces of a box
        votes = np.bincount(box * d + code[to_halve] - 1, minlength=d * len(self.position))
        halves = box * count + 2 * votes.reshape(-1, d).argmax(1)[box]
        faces = self.box[to_confine] * count + 2 * d + code[to_confine] - FACES
        keys = np.concatenate([halves, halves + 1, faces])  # of child boxes; see `_places`
        problem = self.problem[np.concatenate([to_halve, to_halve, to_confine])]
        distinct_keys = np.unique(keys)
        places = self._places(distinct_keys, count)
        positions, child = np.unique(places, axis=0, return_inverse=True)  # faces may coincide
        n_problems = int(problem.max(initial=0)) + 1
        items = np.unique(child[np.searchsorted(distinct_keys, keys)] * n_problems + problem)
        return Frontier(positions, *np.divmod(items, n_problems))

    def _places(self, keys: Ints, count: int) -> Ints:
        """Positions (K, d) of child boxes by key: parent × `count` + number."""
        d = self.position.shape[1]
        positions: Array = self.position[keys // count].copy()
        number = keys % count
        rows = np.flatnonzero(number < 2 * d)
        axis, half = np.divmod(number[rows], 2)
        positions[rows, axis] = 2 * positions[rows, axis] + half
        rows = np.flatnonzero(number >= 2 * d)
        ternary = (number[rows, None] - 2 * d) // 3 ** np.arange(d) % 3
        positions[rows] = np.select([ternary == 1, ternary == 2], [LOWER, UPPER], positions[rows])
        return np.asarray(positions)
