"""Spatial branch and bound for the modal model (Adjiman, Floudas 1998), up to the gap asked for.

All nodes, outputs and sides share one tree of boxes, and each box its polynomials. A box is
fathomed for a problem by one of four tests, all but the third on its quadratic Taylor model and
that one's `Remainder`: 1. the output is monotone along an axis, and the neighbouring box, or
the face, covers it; 2. its bound lies below the incumbent; 3. so does that of modes whose phase is
linear in the inputs, with a remainder that holds only what else they do; 4. a concave function
above the quadratic model (αBB) has no higher point. Else it is bisected. Incumbents are local
optima by Newton's method with a trust region, many at a time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import factorial

import numpy as np

from alphacut.base.arrays import Ints
from alphacut.base.progress_bar import Progress
from alphacut.base.threads import KernelThreads
from alphacut.frame import numbers
from alphacut.frame.bounds.kernel import FACES, call_examine, examine
from alphacut.frame.bounds.model_error import Remainder
from alphacut.frame.calculus.box_quadratic import gain, global_maximum, local_maximum
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.monomials import count, monomial_values
from alphacut.frame.modes.modal_model import ModalModel, in_planes, wave_factors
from alphacut.fuzzy.sets.boxes import chebyshev_points

PIECE = 30_000
"""Items examined together."""
HIGHER = 1e-10
"""Least gain for which a better point is taken over."""
LOWER, UPPER = -1, -2
"""Places of an axis that is confined to an end of the domain."""
BOX_WIDTH = 2.0
"""Width of the unit box [−1, 1]^d."""


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

    with KernelThreads(workers, call_examine) as pool:
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
    of_rate = np.ascontiguousarray(of_rate[:, 2:])
    return in_planes(share), slope, phase, decay, of_rate, of_share


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


@dataclass(eq=False)
class Optima:
    """Best points so far of N problems: of each node, output and side (−1, +1), in this order."""

    point: Array  # unit coordinates, (N, d)
    value: Array  # side × output there, (N,)


def first_optima(model: ModalModel, lower: Array, upper: Array, least_gain: float) -> Optima:
    """Local optima of all problems over a box.

    Each begins at the best of the centre and Chebyshev points, and is refined by Newton's method
    until that predicts a gain below `least_gain`, in units of the outputs.
    """
    samples = chebyshev_points(len(lower), int(numbers.NEWTON_SAMPLES))
    unit = np.vstack([np.zeros((1, len(lower))), samples])
    pool = (lower + upper) / 2 + (upper - lower) / 2 * unit
    values = np.concatenate([model.values(pool[k : k + 64]) for k in range(0, len(pool), 64)])
    values = values.reshape(len(pool), -1)
    best = np.stack([values.argmin(0), values.argmax(0)], 1).ravel()
    optima = Optima(pool[best], np.stack([-values.min(0), values.max(0)], 1).ravel())
    if (upper > lower).any():
        refine(model, optima, np.arange(len(best)), lower, upper, least_gain)
    return optima


def refine(
    model: ModalModel, optima: Optima, which: Ints, lower: Array, upper: Array, least_gain: float
) -> None:
    """Improve the optima in rows `which` by Newton's method in a box, in place.

    A problem ends when its quadratic model predicts a gain of at most `least_gain`.
    """
    size = max(int(numbers.NEWTON_PIECE) * 6 // max(lower.size, 6), 1)
    for piece in np.array_split(which, -(-len(which) // size) or 1):
        _newton(model, optima, piece, lower, upper, least_gain)


def _newton(
    model: ModalModel, optima: Optima, which: Ints, lower: Array, upper: Array, least_gain: float
) -> None:
    radius: Array = np.full(len(which), numbers.NEWTON_RADIUS)
    f, g, H = _signed(model, optima.point[which], which)
    for number in range(int(numbers.NEWTON_STEPS)):
        low = np.maximum(lower - optima.point[which], -radius[:, None])
        high = np.minimum(upper - optima.point[which], radius[:, None])
        step = (
            local_maximum(g, H, low, high, rounds=2)
            if number < numbers.NEWTON_LOCAL_STEPS
            else global_maximum(g, H, low, high)
        )
        predicted = gain(g, H, step)
        at_edge = np.abs(step).max(1, initial=0.0) >= 0.999 * radius
        # at the edge of the region, a parabola would gain as much more in the whole box
        growth = np.where(at_edge, np.minimum((BOX_WIDTH / radius) ** 2, 1e3), 1.0)
        open_ = predicted * growth > least_gain
        if not open_.all():
            which, radius, step, predicted, g, H = (
                x[open_] for x in (which, radius, step, predicted, g, H)
            )
        if not len(which):
            return
        trial = np.clip(optima.point[which] + step, lower, upper)
        f, trial_g, trial_H = _signed(model, trial, which)
        actual_gain = f - optima.value[which]
        better = actual_gain > 0
        optima.point[which[better]], optima.value[which[better]] = trial[better], f[better]
        g[better], H[better] = trial_g[better], trial_H[better]
        ratio = actual_gain / predicted
        expansion = np.where(np.abs(ratio - 1) < numbers.NEWTON_SOUND, 5, 2)
        wider, narrower = np.minimum(expansion * radius, BOX_WIDTH), 0.3 * np.abs(step).max(1)
        radius = np.where(ratio > 0.75, wider, np.where(ratio < 0.25, narrower, radius))


def _signed(model: ModalModel, points: Array, which: Ints) -> tuple[Array, Array, Array]:
    """Side × output (W,), its gradient and Hessian, of problems `which` at their points (W, d)."""
    node, column = np.divmod(which, 2 * len(model.flow.outputs))
    f, g, H = model.at(points, node, column // 2)
    side = 2.0 * (column % 2) - 1
    return side * f, side[:, None] * g, side[:, None, None] * H
