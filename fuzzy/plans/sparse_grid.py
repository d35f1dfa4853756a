"""Adaptive sparse interpolation on nested Clenshaw–Curtis points.

Refined input by input where the surface still misses new samples most: the dimension-adaptive
method of Gerstner and Griebel (Computing 71, 2003), for interpolation instead of quadrature.
"""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from alphacut.fuzzy.samples.model import Memo
from alphacut.fuzzy.sets.numbers import Array
from alphacut.fuzzy.surrogates.chebyshev_polynomial import Polynomial

Level = tuple[int, ...]
_FIRST = 2  # level that every input reaches before the surface is trusted: 5 points
_CHECKS = 4  # held-out samples per input, and 8 more
_ROUNDING = 1e-13  # of an output: a range that says nothing


@cache
def nodes(level: int) -> Array:
    """1 point (level 0) or 2**level + 1 points in [−1, 1], nested to the last bit."""
    if level == 0:
        return np.zeros(1)
    x: Array = np.cos(np.pi * np.arange(2**level + 1) / 2**level)
    x[2 ** (level - 1)] = 0.0
    return x


@cache
def _transform(level: int) -> Array:
    """Matrix from values at the nodes to Chebyshev coefficients."""
    inverse: Array = np.asarray(
        np.linalg.inv(chebvander(nodes(level), len(nodes(level)) - 1)), float
    )
    return inverse


class SparseGrid:
    """A surface under construction.

    Args:
        memo: The model.
        lower: Lower corner of its box, shape (inputs,).
        upper: Upper corner, shape (inputs,).
    """

    def __init__(self, memo: Memo, lower: Array, upper: Array) -> None:
        self.memo, self.lower, self.upper = memo, lower, upper
        self._moving = np.flatnonzero(upper > lower)
        self._accepted: set[Level] = set()
        self._active: dict[Level, Array] = {}  # with its disagreement, shape (outputs,)
        self._terms: dict[Level, Array] = {}
        inputs = len(lower)
        from scipy.stats import qmc  # which takes longer to load than all else here

        spread: Array = qmc.Halton(inputs, scramble=False).random(_CHECKS * inputs + 9)[1:]
        self._checks = lower + spread * (upper - lower)
        self._add((0,) * inputs)

    @staticmethod
    def first(inputs: int) -> int:
        """Samples of the modal point, the coarsest surface, and those that judge it."""
        return 1 + 2 * inputs + 1 + _CHECKS * inputs + 8

    def refine(self, tolerance: float, budget: int) -> tuple[Array, bool]:
        """Refine until samples agree with the surface to a share `tolerance` of the range.

        Returns:
            The largest disagreement left, shape (outputs,), and whether it is within the tolerance.
        """
        while True:
            left = self._left()
            # nearly all samples of a level as coarse as these could be zeros by symmetry
            rough = [one for one in self._active if sum(one) == max(one) < _FIRST]
            if not rough and (left <= tolerance * self._scale()).all():
                return left, True
            if not self._active or len(self.memo) >= budget:
                return left, False
            self.memo.report(0.5 * len(self.memo) / budget)  # a search follows
            self._accept(rough[0] if rough else self._worst(tolerance))

    def polynomial(self) -> Polynomial:
        """The surface through all samples of the index set."""
        return Polynomial(
            self.lower,
            self.upper,
            np.array(list(self._terms)),
            np.array(list(self._terms.values())),
        )

    def points(self, level: Level) -> Array:
        """Tensor grid of a level, shape (n, inputs)."""
        unit = np.array(list(product(*(nodes(one) for one in level))))
        return np.clip(
            (self.lower + self.upper) / 2 + unit * (self.upper - self.lower) / 2,
            self.lower,
            self.upper,
        )

    def _worst(self, tolerance: float) -> Level:
        """Level whose samples the surface missed most; the coarsest if it missed none."""
        missed = {
            level: float((disagreement / self._scale()).max())
            for level, disagreement in self._active.items()
        }
        worst = max(missed, key=lambda level: missed[level])
        return (
            worst
            if missed[worst] > tolerance
            else min(missed, key=lambda level: (sum(level), level))
        )

    def _left(self) -> Array:
        """Largest disagreement at held-out and newest samples, shape (outputs,)."""
        held_out = np.abs(self.polynomial()(self._checks) - self.memo(self._checks).array).max(
            axis=0
        )
        return np.asarray(np.max([held_out, *self._active.values()], axis=0))

    def _scale(self) -> Array:
        """Range of each output over all samples, shape (outputs,); no limit if it is rounding."""
        values = self.memo.values.array
        span = np.ptp(values, axis=0)
        return np.where(span > _ROUNDING * np.abs(values).max(axis=0), span, np.inf)

    def _accept(self, level: Level) -> None:
        del self._active[level]
        self._accepted.add(level)
        for i in self._moving:
            forward = tuple(one + (j == i) for j, one in enumerate(level))
            backward = [
                tuple(one - (j == k) for j, one in enumerate(forward))
                for k in range(len(level))
                if forward[k]
            ]
            if all(below in self._accepted for below in backward):
                self._add(forward)

    def _add(self, level: Level) -> None:
        """Run the samples of a level, note the surface's misses, and take them in."""
        points = self.points(level)
        values = self.memo(points).array
        missed = (
            np.abs(self.polynomial()(points) - values).max(axis=0)
            if self._terms
            else np.full(values.shape[1], np.inf)
        )
        self._active[level] = missed
        # the tensor product of differences of interpolants
        for step in product(*((0, 1) if one else (0,) for one in level)):
            self._add_tensor(
                tuple(one - down for one, down in zip(level, step, strict=True)), (-1) ** sum(step)
            )

    def _add_tensor(self, level: Level, weight: int) -> None:
        """Add the coefficients of one tensor interpolant to the surface's."""
        sizes = [len(nodes(one)) for one in level]
        table = self.memo(self.points(level)).array.reshape(*sizes, -1)
        for axis, one in enumerate(level):
            table = np.moveaxis(
                np.asarray(np.tensordot(_transform(one), table, axes=(1, axis)), float), 0, axis
            )
        for degrees in np.ndindex(*sizes):
            self._terms[degrees] = self._terms.get(degrees, 0.0) + weight * table[degrees]
