"""Branch and bound for the modal model: every bound between attained and proved.

A box of parameters is closed by one of four tests, each on the quadratic Taylor model with the
remainder of `frame.remainder`:
1. its bound lies below the best known value; 2. the output is monotone along an axis and the
neighbouring box, or the face, covers it; 3. near the best point the quadratic model, made less
concave by the remainder, has no higher point; else it is halved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from alphacut.frame.calculus.box_quadratic import gain, global_maximum
from alphacut.frame.calculus.jet import Array
from alphacut.frame.certificate.remainder import Remainder
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.search import Optima, refine

PIECE = 4000
"""Boxes examined together."""
PROBLEMS = 500
"""Problems of one task."""

Progress = Callable[[float], None]


@dataclass(eq=False)
class Cells:
    """Boxes still open, each for one problem.

    Args:
        problem: Index of the problem, shape (N,).
        centre: Unit coordinates, shape (N, d).
        radius: Half widths, shape (N, d); 0 along axes reduced to a face.
    """

    problem: Array
    centre: Array
    radius: Array

    def __len__(self) -> int:
        return len(self.problem)

    def take(self, which: Array) -> Cells:
        """The boxes `which`."""
        return Cells(self.problem[which], self.centre[which], self.radius[which])

    def pieces(self) -> list[Cells]:
        """The boxes in parts that stay in the cache."""
        return (
            [
                self.take(rows)
                for rows in np.array_split(np.arange(len(self)), -(-len(self) // PIECE))
            ]
            if len(self)
            else []
        )

    def halved(self, axis: Array) -> Cells:
        """Both halves along `axis` (N,)."""
        rows = np.arange(len(self))
        radius = self.radius.copy()
        radius[rows, axis] /= 2
        shift = np.zeros_like(radius)
        shift[rows, axis] = radius[rows, axis]
        both = np.concatenate([self.centre - shift, self.centre + shift])
        return Cells(np.tile(self.problem, 2), both, np.tile(radius, (2, 1)))


def _counted(results: Iterable[Enclosed], total: int, progress: Progress | None) -> list[Enclosed]:
    done = []
    for result in results:
        done.append(result)
        if progress:
            progress(len(done) / total)
    return done


def joined(parts: list[Cells]) -> Cells:
    """All boxes of `parts`."""
    return Cells(
        *(
            np.concatenate([getattr(p, name) for p in parts])
            for name in ("problem", "centre", "radius")
        )
    )


@dataclass(frozen=True, eq=False)
class Enclosed:
    """Outcome for N problems.

    Args:
        point: Best points, shape (N, d).
        value: side × output there, shape (N,).
        proved: Proved bounds above `value`, shape (N,).
        boxes: Boxes looked at.
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

    Raises:
        ValueError: A value is not positive.
    """

    gap: float = 5e-7
    budget: float = 4000

    def __post_init__(self) -> None:
        if not (self.gap > 0 and self.budget > 0):
            raise ValueError(
                f"certify: gap {self.gap:g}, budget {self.budget:g}; both must be positive"
            )

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
            workers: Processes; the result does not depend on their number.
            progress: Called with the fraction done.
        """
        remainder = Remainder.of(model, lower, upper)
        pieces = [
            optima.take(rows)
            for rows in np.array_split(
                np.arange(len(optima.value)), -(-len(optima.value) // PROBLEMS)
            )
        ]
        work = partial(self._piece, model, lower, upper, remainder)
        if workers == 1:
            done = _counted(map(work, pieces), len(pieces), progress)
        else:
            from concurrent.futures import ProcessPoolExecutor

            with ProcessPoolExecutor(workers) as pool:
                done = _counted(pool.map(work, pieces), len(pieces), progress)
        point, value, proved = (
            np.concatenate([getattr(part, name) for part in done])
            for name in ("point", "value", "proved")
        )
        return Enclosed(point, value, proved, sum(part.boxes for part in done))

    def _piece(
        self, model: ModalModel, lower: Array, upper: Array, remainder: Remainder, optima: Optima
    ) -> Enclosed:
        size = len(optima.value)
        cells = Cells(
            np.arange(size),
            np.tile((lower + upper) / 2, (size, 1)),
            np.tile((upper - lower) / 2, (size, 1)),
        )
        used = 0
        while len(cells) and used + len(cells) <= self.budget * size:
            used += len(cells)
            cells = joined(
                [
                    self._examined(model, lower, upper, optima, part, remainder)
                    for part in cells.pieces()
                ]
            )
        proved = optima.value + self.gap
        for part in cells.pieces():  # what the budget left open keeps its own bound
            np.maximum.at(proved, part.problem, _bound(model, optima, part, remainder))
        return Enclosed(optima.point, optima.value, proved, used)

    def _examined(
        self,
        model: ModalModel,
        lower: Array,
        upper: Array,
        optima: Optima,
        cells: Cells,
        remainder: Remainder,
    ) -> Cells:
        """The boxes that no test closes, reduced to a face or halved."""
        j = cells.problem
        T = remainder.at(optima.node[j], optima.output[j])
        f, g, H = _signed_taylor(model, optima, cells.centre, j)
        better = f > optima.value[j] + 1e-10
        if better.any():
            self._improve(model, optima, j[better], cells.centre[better], f[better], (lower, upper))
        r = cells.radius
        Tr = np.einsum("nijk,nk->nij", T, r)
        rest = cubic(Tr, r)
        target = optima.value[j] + self.gap
        open_ = f + _separable(g, H, r) + rest > target
        rising = np.abs(g) > np.einsum("nij,nj->ni", np.abs(H), r) + 0.5 * np.einsum(
            "nij,nj->ni", Tr, r
        )
        rising &= r > 0
        face = cells.centre + np.sign(g) * r
        edge = np.where(g > 0, upper, lower)
        inner = rising & (np.abs(face - edge) > 1e-12)
        open_ &= ~inner.any(1)  # the neighbour holds higher points
        collapse = rising & ~inner
        cells.centre[collapse], cells.radius[collapse] = face[collapse], 0.0
        open_ = self._close_by_quadratic(f, g, H, r, rest, target, open_ & ~collapse.any(1)) | (
            open_ & collapse.any(1)
        )
        undecided = np.flatnonzero(open_ & ~collapse.any(1))
        if len(undecided):
            still = self._not_closed_near_best(model, optima, cells.take(undecided), T[undecided])
            open_[undecided[~still]] = False
        split = np.flatnonzero(open_ & ~collapse.any(1))
        weight = r * (np.einsum("nij,nj->ni", Tr, r) + 0.5 * np.einsum("nij,nj->ni", np.abs(H), r))
        halves = cells.take(split).halved(weight[split].argmax(1))
        return joined([cells.take(np.flatnonzero(open_ & collapse.any(1))), halves])

    def _improve(
        self,
        model: ModalModel,
        optima: Optima,
        problem: Array,
        points: Array,
        values: Array,
        box: tuple[Array, Array],
    ) -> None:
        """Takes over the best of the points found higher, then refines them."""
        order = np.argsort(values)
        optima.point[problem[order]], optima.value[problem[order]] = points[order], values[order]
        refine(model, optima, np.unique(problem), *box, self.gap / 100)

    def _close_by_quadratic(
        self, f: Array, g: Array, H: Array, r: Array, rest: Array, target: Array, open_: Array
    ) -> Array:
        """Test 1 with the exact maximum of the quadratic model, where it can succeed."""
        which = np.flatnonzero(open_ & (f + rest <= target))
        if len(which):
            x = global_maximum(g[which], H[which], -r[which], r[which])
            closed = f[which] + gain(g[which], H[which], x) + rest[which] <= target[which]
            open_[which[closed]] = False
        return open_

    def _not_closed_near_best(
        self, model: ModalModel, optima: Optima, cells: Cells, T: Array
    ) -> Array:
        """Test 3: boxes in which the best point's Taylor model allows more than the gap."""
        j = cells.problem
        best = optima.point[j]
        low, high = cells.centre - cells.radius - best, cells.centre + cells.radius - best
        reach = np.maximum(np.abs(low), np.abs(high))
        near = (np.maximum(low, 0) + np.maximum(-high, 0) <= 2 * cells.radius).all(1)
        still = np.ones(len(cells), bool)
        which = np.flatnonzero(near)
        if not len(which):
            return still
        _, g, H = _signed_taylor(model, optima, best[which], j[which])
        span = np.maximum(reach[which], 1e-9)
        pair = np.einsum("nijk,nk->nij", T[which], span)
        bend = np.einsum("nij,nj->ni", pair, span) / span  # cubic remainder <= Σ bend_i x_i² / 6
        softer = H + np.einsum("ni,ij->nij", bend / 3, np.eye(H.shape[1]))
        x = global_maximum(g, softer, low[which], high[which])
        still[which] = gain(g, softer, x) > self.gap
        return still


def _signed_taylor(
    model: ModalModel, optima: Optima, points: Array, problem: Array
) -> tuple[Array, Array, Array]:
    side = optima.side[problem]
    f, g, H = model.at(points, optima.node[problem], optima.output[problem])
    return side * f, side[:, None] * g, side[:, None, None] * H


def cubic(Tr: Array, r: Array) -> Array:
    """Bound of what a quadratic Taylor model leaves out for |x| <= r, from T r, shape (N, d, d)."""
    rest: Array = np.einsum("nij,ni,nj->n", Tr, r, r) / 6
    return rest


def _separable(g: Array, H: Array, r: Array) -> Array:
    """Upper bound of max g·x + x·H·x/2 over |x| <= r, mixed terms moved to the diagonal."""
    diagonal = np.einsum("nii->ni", H)
    mixed = np.abs(H) * r[:, None, :]
    spread = np.where(r > 0, (mixed.sum(-1) - np.abs(diagonal) * r) / np.where(r > 0, r, 1.0), 0.0)
    bend, slope = diagonal + spread, np.abs(g)
    inside = (bend < 0) & (slope < -bend * r)
    top = np.where(
        inside, -(slope**2) / np.where(inside, 2 * bend, 1.0), slope * r + 0.5 * bend * r**2
    )
    total: Array = top.sum(1)
    return total


def _bound(model: ModalModel, optima: Optima, cells: Cells, remainder: Remainder) -> Array:
    """Upper bounds of boxes."""
    j, r = cells.problem, cells.radius
    f, g, H = _signed_taylor(model, optima, cells.centre, j)
    T = remainder.at(optima.node[j], optima.output[j])
    bound: Array = f + _separable(g, H, r) + cubic(np.einsum("nijk,nk->nij", T, r), r)
    return bound
