"""Spatial branch and bound for the modal model (Adjiman, Floudas 1998), up to the gap asked for.

A problem is one side (−1 or 1) of an output at a time node: side × output is to be bounded from
above over a box. All problems share one tree of sub-boxes, and each sub-box has its own
polynomials. A sub-box is fathomed for a problem by one of three tests on the quadratic Taylor model
and the bounds of what that leaves out (`remainder_bounds`):

1. the output is monotonic along an axis, and the neighbouring sub-box, or the face, covers it;
2. its bound lies below the incumbent;
3. a concave function above the quadratic model (αBB) has no higher point.

Else it is bisected. Incumbents are local optima by Newton's method with a trust region, many at a
time.

What quadratic Taylor models of a modal model's outputs leave out is bounded first. A part of a
modal model is 2 Re Σ_k C_k(p) w(t; λ_k(p)) with the wave w = exp(λ t) or w = R = ∫ exp(λ (t − s))
a(s) ds. The r-th derivative of w by λ is bounded by t^r exp(g t), or by ∫ τ^r exp(g τ) |a(t − τ)|
dτ, where g is a bound of Re λ. From these follow bounds of what quadratic Taylor models of the part
leave out.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.progress_bar import Progress
from alphacut.frame.bounds.kernel import (
    FACES,
    BoxTables,
    Examination,
    Items,
    examine,
)
from alphacut.frame.calculus.box_quadratic import gain, global_maximum, local_maximum
from alphacut.frame.calculus.polynomials import count, exponents, product_part, product_places
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.modes.modal_model import (
    ModalModel,
    OutputJets,
    largest_growth,
    response_parts,
    wave_factors,
)
from alphacut.fuzzy.sets.boxes import chebyshev_points


def bound_problems(
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
    """Return upper bounds of side × output for all N problems, by spatial branch and bound.

    A problem is one side (−1 or 1) of one of m outputs at one of T time nodes. Its number is (node
    · m + output) · 2 for the side −1, and one more for the side 1. Points are in unit coordinates,
    in which each of the d inputs runs over [−1, 1]. Outputs are those of the modal model: a bound
    of its error is not added here.

    Args:
        model: The modal model, polynomials of eigenvalues and coefficients of the modes.
        lower: Lower ends of the box, shape (d,).
        upper: Upper ends, shape (d,).
        optima: Best point and value of each problem. Better points that are met replace them, in
            place.
        gap: Wanted distance of guaranteed bound and attained value, in units of the outputs, > 0.
        budget: Most sub-boxes per problem on average. Where it ends the search, problems that are
            still open have valid bounds with wider gaps.
        workers: Number of threads; the result does not depend on it.
        progress: Called with the fraction of problems that are closed, from 0 to 1.

    Returns:
        Guaranteed upper bounds, shape (N,), and the number of examined items, each a sub-box with a
        problem.
    """
    # Items that a thread examines together on average, tuned to limit the memory.
    max_items = 30_000
    n_problems = len(optima.value)
    third = remainder_bounds(model, lower, upper).third
    frontier = Frontier.whole_box(lower, upper, n_problems)
    examined = 0
    # Bounds over the undivided box: outputs at rest have 0 there, below optimum + gap.
    undivided: Array = np.full(n_problems, np.inf)
    with ThreadPoolExecutor(workers) as pool:
        while len(frontier) and examined + len(frontier) <= budget * n_problems:
            examine_piece = partial(examine_items, model, third, optima.value + gap, frontier)
            pieces = pool.map(examine_piece, frontier.pieces(max_items))
            found = Examination(*(np.concatenate(x) for x in zip(*pieces, strict=True)))
            if not examined:
                undivided = found.bound
            examined += len(frontier)
            _take_better_points(model, optima, frontier, found.value, min_gain=gap / 100)
            frontier = frontier.children(found.code)
            if progress:
                progress(1 - len(np.unique(frontier.problem)) / n_problems)
    bound = np.minimum(optima.value + gap, undivided)
    # Sub-boxes that are still open keep their own bounds.
    for piece in frontier.pieces(max_items):
        found = examine_items(model, third, optima.value + gap, frontier, piece)
        np.maximum.at(bound, frontier.problem[piece.items], found.bound)
    return bound, examined


def _take_better_points(
    model: ModalModel, optima: Optima, frontier: Frontier, value: Array, *, min_gain: float
) -> None:
    """Replace optima, in place, where the midpoint of a sub-box has a higher value.

    The best midpoint of each such problem is taken over, and then refined by Newton's method.
    Nothing changes where no midpoint is better by more than 1e-10 units.

    Args:
        model: The modal model, of which problem p is one side, −1 or 1, of one output at one time
            node.
        optima: Best points of the N problems, shape (N, d), in unit coordinates, and their values
            (N,).
        frontier: Sub-boxes that were examined, with I items, each a pair of a sub-box and a
            problem.
        value: Side × output at the midpoint of the sub-box of each item, shape (I,).
        min_gain: Predicted gain at which Newton's method ends, in units of the outputs.
    """
    # Differences up to 1e-10 units may be rounding.
    is_higher = value > optima.value[frontier.problem] + 1e-10
    higher = np.flatnonzero(is_higher)
    if not len(higher):
        return
    higher = higher[np.argsort(value[higher])]  # of equal problems the last one, the best, stays
    problems = frontier.problem[higher]
    boxes = frontier.box[higher]
    optima.point[problems] = (frontier.low[boxes] + frontier.high[boxes]) / 2
    refine(model, optima, np.unique(problems), frontier.lower, frontier.upper, min_gain)


class Piece(NamedTuple):
    """Consecutive sub-boxes of a frontier, and their items."""

    boxes: slice
    items: slice


def examine_items(
    model: ModalModel, third: Array, target: Array, frontier: Frontier, piece: Piece
) -> Examination:
    """Examine sub-boxes by the compiled kernel: which problems are closed, how others go on.

    A problem p is one side of an output at a time node, p = (node · m + output) · 2 + (0 for the
    side −1, 1 for 1); an item is a sub-box with one of its open problems.

    Args:
        model: The modal model of n modes and m outputs in d inputs.
        third: Bounds of the third derivatives of the outputs over the whole box, shape (T, m, d, d,
            d).
        target: Values of side × output below which problems are closed, shape (N,).
        frontier: All open items, ordered by sub-box and then by problem.
        piece: Which sub-boxes of the frontier, and which items, are examined; the items must be all
            items of these sub-boxes, at least one.

    Returns:
        For each item, in order: `code`, which is 0 where the item is closed, 1 + i where the
        sub-box is to be bisected along input i, and 16 + Σ_i 3^i e_i where it is to be confined to
        faces (e_i = 0: input i stays free, 1: its lower end, 2: its upper end); `value` of side ×
        output at the midpoint; and its guaranteed upper `bound` over the sub-box.
    """
    low = frontier.low[piece.boxes]
    high = frontier.high[piece.boxes]
    midpoint = (low + high) / 2
    n = model.count
    n_outputs = len(model.flow.outputs)
    n_boxes, d = midpoint.shape
    box = frontier.box[piece.items] - piece.boxes.start
    node, column = np.divmod(frontier.problem[piece.items], 2 * n_outputs)

    # Items of one sub-box at one time node are a row; they share its waves.
    is_new_row = np.append(True, (np.diff(box) != 0) | (np.diff(node) != 0))
    first_of_row = np.flatnonzero(is_new_row)
    row_box = box[first_of_row]
    row_node = node[first_of_row]
    items = Items(
        first_row=np.searchsorted(row_box, np.arange(n_boxes + 1)),
        first_item=np.append(first_of_row, len(box)),
        node=row_node,
        column=column,
    )
    # λ and C of all parts of the response at the midpoints, (q, B, n + parts n m): value, gradient
    # and packed second derivatives, q = 1 + d + d (d + 1)/2
    jets = model.together.jets(midpoint).swapaxes(0, 1)
    eigenvalues = jets[..., :n]
    coefficients = jets[..., n:].reshape(*jets.shape[:2], -1, n, n_outputs)
    boxes = BoxTables(
        radius=(high - low) / 2,
        is_outer=np.stack([low == frontier.lower, high == frontier.upper], axis=1),
        factors=wave_factors(eigenvalues, coefficients, d),
    )
    waves = model.waves(eigenvalues[0, row_box], row_node)
    n_items = len(column)
    found = Examination(np.zeros(n_items, np.int64), np.zeros(n_items), np.zeros(n_items))
    examine(items, boxes, waves, third, target, found)
    return found


@dataclass(frozen=True, eq=False)
class Frontier:
    """Open items: pairs of a sub-box and a problem, ordered by sub-box and then by problem."""

    lower: Array  # lower ends of the whole box, (d,)
    upper: Array  # upper ends, (d,)
    low: Array  # lower ends of the sub-boxes, (B, d)
    high: Array  # upper ends; those of an input that is confined to an end are equal, (B, d)
    box: Ints  # sub-box of each item, rising, (I,)
    problem: Ints  # number of its problem, rising for each sub-box, (I,)

    @classmethod
    def whole_box(cls, lower: Array, upper: Array, n_problems: int) -> Frontier:
        """Return the whole box for all problems."""
        box = np.zeros(n_problems, np.int64)
        return cls(lower, upper, lower[np.newaxis], upper[np.newaxis], box, np.arange(n_problems))

    def __len__(self) -> int:
        return len(self.box)

    def pieces(self, max_items: int) -> Iterator[Piece]:
        """Yield pieces of about equally many sub-boxes, with `max_items` items on average.

        An item is a sub-box with one of its open problems. A sub-box is not divided, however many
        items it has. An empty frontier yields nothing.

        Args:
            max_items: Items of a piece on average, at least 1.

        Yields:
            Slices of the consecutive sub-boxes, and of the items that belong to them.
        """
        n_boxes = len(self.low)
        count = min(-(-len(self) // max_items), n_boxes)
        first_boxes = np.linspace(0, n_boxes, count + 1).astype(int)
        first_items = np.searchsorted(self.box, first_boxes)
        for k in range(count):
            boxes = slice(int(first_boxes[k]), int(first_boxes[k + 1]))
            yield Piece(boxes, slice(int(first_items[k]), int(first_items[k + 1])))

    def children(self, code: Ints) -> Frontier:
        """Return the halves and faces of sub-boxes with the problems that are left open there.

        An item is a sub-box with one of its open problems. A sub-box is halved along the axis that
        most of its items ask for, the lowest one in a tie; all items that are to be halved go into
        both halves. Items that are confined to faces go into the sub-box of these faces alone.
        Nothing is changed in place.

        Args:
            code: What `kernel.examine` says of each of I items, shape (I,): 0 closes it, 1 + i asks
                for a bisection along axis i, and `FACES` + Σ_i 3^i (0: free, 1: lower end, 2: upper
                end of axis i) confines it.

        Returns:
            The new items, ordered by sub-box and then by problem; no items if all codes are 0.
        """
        d = self.low.shape[1]
        is_to_halve = (code > 0) & (code < FACES)
        to_halve = np.flatnonzero(is_to_halve)
        to_confine = np.flatnonzero(code >= FACES)
        # A sub-box has 2 d halves, lower and upper along each axis, and then 3^d faces.
        children_of_box = 2 * d + 3**d
        box = self.box[to_halve]
        votes = np.bincount(box * d + code[to_halve] - 1, minlength=d * len(self.low))
        axis = votes.reshape(-1, d).argmax(axis=1)[box]
        lower_half = box * children_of_box + 2 * axis
        faces = self.box[to_confine] * children_of_box + 2 * d + code[to_confine] - FACES
        keys = np.concatenate([lower_half, lower_half + 1, faces])
        problem = self.problem[np.concatenate([to_halve, to_halve, to_confine])]

        # Faces of different sub-boxes may coincide: they become one sub-box, and items one item.
        distinct_keys, child = np.unique(keys, return_inverse=True)
        ends, of_key = np.unique(self._child_ends(distinct_keys), axis=0, return_inverse=True)
        n_problems = int(problem.max(initial=0)) + 1
        items = np.unique(of_key[child] * n_problems + problem)
        new_box, new_problem = np.divmod(items, n_problems)
        low, high = np.split(ends, 2, axis=1)
        return Frontier(self.lower, self.upper, low, high, new_box, new_problem)

    def _child_ends(self, keys: Ints) -> Array:
        """Return the lower and then the upper ends of the children of sub-boxes, shape (K, 2 d).

        Children that coincide have the same numbers, as each axis is halved for itself.

        Args:
            keys: Keys of K children, shape (K,): index of the parent × (2 d + 3^d) + number. The
                numbers 2 i and 2 i + 1 are the lower and the upper half along axis i; 2 d + Σ_i 3^i
                e_i is the child with the end e_i of each axis: 0 as the parent, 1 lower end, 2
                upper end.
        """
        d = self.low.shape[1]
        parent, number = np.divmod(keys, 2 * d + 3**d)
        low = self.low[parent]
        high = self.high[parent]
        middle = (low + high) / 2
        half = np.arange(2 * d).reshape(d, 2)
        is_half = number[:, np.newaxis, np.newaxis] == half
        # The digits of a face to base 3 say for each axis: free, lower end, upper end.
        face = np.maximum(number - 2 * d, 0)[:, np.newaxis] // 3 ** np.arange(d) % 3
        ends = [
            np.select([is_half[..., 1], face == 2], [middle, high], low),
            np.select([is_half[..., 0], face == 1], [middle, low], high),
        ]
        return np.hstack(ends)


@dataclass(eq=False)
class Optima:
    """Best points so far of N problems: by node, then output, then side (−1, 1)."""

    point: Array  # unit coordinates, (N, d)
    value: Array  # side × output there, (N,)


def first_optima(model: ModalModel, lower: Array, upper: Array, min_gain: float) -> Optima:
    """Return local optima of all problems over a box, to begin branch and bound with.

    A problem is to maximise one side, −1 or 1, of one output at one time node; problems run over
    nodes, then outputs, then sides. Each begins at the best of the midpoint and of some Chebyshev
    points (quasi-random, denser towards the ends), and is refined by Newton's method.

    Args:
        model: The modal model of m outputs at T time nodes.
        lower: Lower ends of the box in unit coordinates, shape (d,).
        upper: Upper ends, shape (d,).
        min_gain: Predicted gain at which Newton's method ends, in units of the outputs.

    Returns:
        Points, shape (2 T m, d), and values of side × output there, shape (2 T m,). They are
        attained by the model and thus lower bounds of the maxima, not guaranteed to be global.
    """
    # 256 is tuned: more samples find better optima in more time. Chunks of 64 limit the memory.
    samples = chebyshev_points(len(lower), 256)
    unit = np.vstack([np.zeros((1, len(lower))), samples])
    points = (lower + upper) / 2 + (upper - lower) / 2 * unit
    chunks = [model.values(points[k : k + 64]) for k in range(0, len(points), 64)]
    values = np.concatenate(chunks).reshape(len(points), -1)  # (points, T m)
    best = np.stack([values.argmin(axis=0), values.argmax(axis=0)], axis=1).ravel()
    # These values choose points alone. Those that are returned come from the tables of the loads,
    # as those of branch and bound do.
    optima = Optima(points[best], np.empty(len(best)))
    refine(model, optima, np.arange(len(best)), lower, upper, min_gain)
    return optima


def refine(
    model: ModalModel,
    optima: Optima,
    problems: Ints,
    lower: Array,
    upper: Array,
    min_gain: float,
) -> None:
    """Improve the best points of some problems by Newton's method within a box, in place.

    A problem ends when its quadratic model predicts a gain of at most `min_gain`, or after a fixed
    number of steps. Problems are taken in chunks that limit the memory.

    Args:
        model: The modal model, whose outputs are maximised with the sign of the problem's side.
        optima: Points, shape (N, d), in unit coordinates, and values, shape (N,), of all problems.
            The values of `problems` need not be known.
        problems: Numbers of the problems to improve, each once, shape (P,); it may be empty.
        lower: Lower ends of the box, shape (d,), in unit coordinates.
        upper: Upper ends, shape (d,).
        min_gain: In units of the outputs.
    """
    # Tuned: the arrays of more than 6000 problems of six inputs do not fit into the cache of a
    # processor.
    size = max(6000 * 6 // max(lower.size, 6), 1)
    for piece in np.array_split(problems, -(-len(problems) // size) or 1):
        _newton(model, optima, piece, lower, upper, min_gain)


def _newton(
    model: ModalModel,
    optima: Optima,
    problems: Ints,
    lower: Array,
    upper: Array,
    min_gain: float,
) -> None:
    """Maximise side × output of some problems by trust-region steps within a box, in place.

    Each step maximises the quadratic Taylor model over the intersection of the box and of a cube
    about the point (Conn, Gould, Toint 2000). A better point is taken over, whatever the step
    predicted. The radius of the cube grows where the gain is close to the predicted one, and
    shrinks where it is much smaller.

    Args:
        model: The modal model.
        optima: Points, shape (N, d), in unit coordinates, and values, shape (N,), of all problems;
            rows of `problems` are overwritten.
        problems: Numbers of P problems, each once. A problem is dropped when no gain above
            `min_gain` is predicted.
        lower: Lower ends of the box, shape (d,).
        upper: Upper ends, shape (d,).
        min_gain: In units of the outputs.
    """
    box_width = 2.0  # of the unit box [−1, 1]^d
    # Tuned: with a larger first radius more first steps fail.
    radius: Array = np.full(len(problems), 0.4)
    jets = _jets(model, optima.point[problems], problems)
    optima.value[problems] = jets.value
    gradient = jets.gradient
    hessian = jets.hessian
    # A problem that has not converged after 300 steps, which is rare, keeps an attained value.
    for number in range(300):
        point = optima.point[problems]
        low = np.maximum(lower - point, -radius[:, np.newaxis])
        high = np.minimum(upper - point, radius[:, np.newaxis])
        # Problems that need more than six steps lie on ridges. Their models are maximised over all
        # faces of the box, which takes longer (tuned).
        if number < 6:
            step = local_maximum(gradient, hessian, low, high, rounds=2)
        else:
            step = global_maximum(gradient, hessian, low, high)
        predicted = gain(gradient, hessian, step)

        # At the edge of the cube the whole box may allow more: a parabola gains with the square of
        # the distance. The limit of 1000 avoids that tiny gains in tiny cubes go on for long.
        is_at_edge = np.abs(step).max(axis=1, initial=0.0) >= 0.999 * radius
        growth = np.where(is_at_edge, np.minimum((box_width / radius) ** 2, 1e3), 1.0)
        is_open = predicted * growth > min_gain
        if not is_open.any():
            return
        problems = problems[is_open]
        radius = radius[is_open]
        step = step[is_open]
        predicted = predicted[is_open]
        gradient = gradient[is_open]
        hessian = hessian[is_open]

        trial = np.clip(optima.point[problems] + step, lower, upper)
        jets = _jets(model, trial, problems)
        actual = jets.value - optima.value[problems]
        is_better = actual > 0
        optima.point[problems[is_better]] = trial[is_better]
        optima.value[problems[is_better]] = jets.value[is_better]
        gradient[is_better] = jets.gradient[is_better]
        hessian[is_better] = jets.hessian[is_better]

        ratio = actual / predicted
        # A gain within 10 % of the predicted one shows that the model is good far beyond the step
        # (tuned).
        expansion = np.where(np.abs(ratio - 1) < 0.1, 5, 2)
        wider = np.minimum(expansion * radius, box_width)
        narrower = 0.3 * np.abs(step).max(axis=1)
        radius = np.select([ratio > 0.75, ratio < 0.25], [wider, narrower], radius)


def _jets(model: ModalModel, points: Array, problems: Ints) -> OutputJets:
    """Return side × output of P problems, each at a point of its own, with derivatives.

    Args:
        model: The modal model of m outputs in d inputs.
        points: Unit coordinates of the points, shape (P, d).
        problems: Numbers of the problems, shape (P,): (node · m + output) · 2 + (0 for the side −1,
            1 for 1).

    Returns:
        `value` (P,), `gradient` (P, d) and `hessian` (P, d, d), by the unit coordinates.
    """
    node, column = np.divmod(problems, 2 * len(model.flow.outputs))
    found = model.at(points, node, column // 2)
    side = 2.0 * (column % 2) - 1
    return OutputJets(
        value=side * found.value,
        gradient=side[:, np.newaxis] * found.gradient,
        hessian=side[:, np.newaxis, np.newaxis] * found.hessian,
    )


class Remainder(NamedTuple):
    """Bounds of what is left out of the outputs over the whole box, for T time nodes."""

    third: Array  # third derivatives by the inputs, (T, m, d, d, d)
    tables: Array  # what tables of loads miss of the values, (T, m)


def majorant_parts(polynomials: TaylorModel, reach: Array) -> list[Array]:
    """Return bounds of polynomials' derivatives over a box, as the coefficients of a majorant.

    The majorant is Σ |coefficient| (reach + v)^exponents. At v = 0 its derivatives bound the
    magnitudes of those of the polynomials at all points with |u_i| ≤ reach_i.

    Args:
        polynomials: Polynomials of d inputs u, an array of shape V, real or complex.
        reach: Half-widths, shape (d,), ≥ 0; they may exceed 1.

    Returns:
        The coefficients of degree 0, 1, 2 and 3 in v, shape (monomials, *V) each; a coefficient is
        the derivative divided by the factorials of its exponents.
    """
    magnitudes = replace(polynomials, parts=tuple(np.abs(part) for part in polynomials.parts))
    parts = magnitudes.shifted_parts(reach)
    missing = range(len(parts), 4)
    return parts[:4] + [magnitudes.homogeneous_part(degree) for degree in missing]


def remainder_bounds(model: ModalModel, lower: Array, upper: Array) -> Remainder:
    """Bound what quadratic Taylor models of a modal model's outputs leave out in a box.

    They may be expanded about any point of the box [lower, upper]. The bounds follow by majorants:
    derivatives by the inputs of C exp(λ t) over exp(λ₀ t) are at most those of Σ_p t^p C ρ^p / p!
    with majorants of C and of ρ = λ − λ₀, that is, with polynomials whose coefficients are positive
    and whose derivatives are at least as large.

    The model is that of the tables of loads, whose series are functions of λ with derivatives of
    their own. By what they miss its values differ from those of the modes.

    Args:
        model: The modal model with T time nodes, m outputs and d inputs.
        lower: Lower ends of the box in unit coordinates, shape (d,).
        upper: Upper ends, shape (d,).

    Returns:
        `third`, bounds of the third derivatives by u_i, u_j, u_k, shape (T, m, d, d, d), symmetric
        in the last three axes; and `tables`, what the tables of loads miss, shape (T, m).
    """
    d = len(lower)
    n = model.count
    m = len(model.flow.outputs)
    time = model.flow.time
    reach = np.maximum(np.abs(lower), np.abs(upper))
    growth = largest_growth(model.eigenvalue, reach)
    eigenvalue = majorant_parts(model.eigenvalue, reach)  # by degree, (monomials, n)
    rho = [part[..., np.newaxis] for part in eigenvalue]
    cubic = np.zeros((len(time), count(d, 3), m))
    of_tables = np.zeros((len(time), m))
    for part in response_parts(model, growth):
        waves = part.waves
        term = majorant_parts(part.coefficient, reach)  # of C ρ^p / p!, (monomials, n, m)
        if part.load is not None:
            missed = part.load.errors(waves)
            of_tables += 2 * missed[0] @ term[0][0]
            waves = waves + missed
        for p in range(4):
            cubic += np.tensordot(2 * waves[p], term[3], (1, 1))
            term = [
                product_part(term, rho, k, d, np.multiply, lowest=(0, 1)) / (p + 1)
                for k in range(4)
            ]
        if part.load is None:
            # The free response comes first. At t = 0 the sum over its modes is an initial
            # state, of which most cancels, and is bounded as one polynomial.
            at_start = np.full(n, 2.0) @ part.coefficient.real
            cubic[time == 0] = majorant_parts(at_start, reach)[3]

    # The third derivative of u^e at 0 is e!, and all other derivatives are zero there.
    factorials = np.array([1, 1, 2, 6])
    of_exponents = factorials[exponents(d, 3)].prod(axis=1)
    third = (cubic * of_exponents[:, np.newaxis]).swapaxes(1, 2)
    places = product_places(d, 1, 2)[:, product_places(d, 1, 1)]  # of u_i u_j u_k, (d, d, d)
    return Remainder(np.ascontiguousarray(third[..., places]), of_tables)
