"""Preconditioned conjugate gradients on many systems, stopped by the energy to gain.

A step lowers the energy by (step length) × (residual · preconditioned residual), so the sum over
the last steps estimates what the field before them lacked (Hestenes and Stiefel 1952). The bounds
hold for whatever field comes out; stopping early only widens them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array

LIMIT = 2000  # iterations; with the preconditioner, contrasts of 1e6 need fewer


class ConvergenceError(RuntimeError):
    """The energy asked for is not reached."""


class Linear(Protocol):
    """A symmetric linear map of fields, shape (tiles, loads, types, rows, columns)."""

    def apply(self, fields: Array, /) -> Array:
        """The image of the fields."""


class Solver(Protocol):
    """A way to fields of little energy."""

    threads: ClassVar[int]
    """Systems that may be solved at once."""

    def coarser(self, factor: float) -> Solver:
        """The same way with less accuracy, for a start."""

    def solve(
        self,
        operator: Linear,
        preconditioner: Linear,
        load: Array,
        scale: Array,
        start: Array | None = None,
    ) -> Solution:
        """Fields with operator(fields) = load."""


@dataclass(frozen=True)
class Solution:
    """Fields and what they cost.

    Args:
        fields: Shape (tiles, loads, types, rows, columns).
        iterations: Of the slowest system.
    """

    fields: Array
    iterations: int


@dataclass(frozen=True)
class ConjugateGradient:
    """The solver's stopping rule.

    Args:
        accuracy: Energy still to be gained, relative to the scale given with the load, in (0, 0.1].
        iterations: Exact number of iterations instead, or None; fields are then not converged and
            not meant to be.

    Raises:
        ValueError: A value lies outside its range.
    """

    accuracy: float = 3e-6
    iterations: int | None = None
    threads: ClassVar[int] = 2

    def __post_init__(self) -> None:
        if not 0 < self.accuracy <= 0.1:
            raise ValueError(
                f"the accuracy of the energy is {self.accuracy:g}; it must lie in (0, 0.1]"
            )
        if self.iterations is not None and self.iterations < 0:
            raise ValueError(f"{self.iterations} iterations are asked for; take 0 or more")

    def coarser(self, factor: float) -> ConjugateGradient:
        """The rule with less accuracy, for a start."""
        return replace(self, accuracy=min(0.1, factor * self.accuracy))

    def solve(
        self,
        operator: Linear,
        preconditioner: Linear,
        load: Array,
        scale: Array,
        start: Array | None = None,
    ) -> Solution:
        """Fields with operator(fields) = load.

        Args:
            operator: Positive on fields that matter.
            preconditioner: Approximate inverse.
            load: Right-hand sides; overwritten by the residuals.
            scale: Energy that the accuracy refers to, shape (tiles, loads).
            start: First guess, zero by default; not changed.

        Raises:
            ConvergenceError: `LIMIT` iterations are not enough.
        """
        fields = np.zeros_like(load) if start is None else start.copy()
        residual = load
        if start is not None:
            residual -= operator.apply(start)
        direction = preconditioner.apply(residual)
        product = _dots(residual, direction)
        gains: list[Array] = []
        limit = LIMIT if self.iterations is None else self.iterations
        for number in range(limit):
            if self.iterations is None and self._enough(product, gains, scale):
                return Solution(fields, number)
            image = operator.apply(direction)
            length = _ratio(product, _dots(direction, image))
            gains.append(length * product)
            _add(fields, length, direction)
            _add(residual, -length, image)
            image = preconditioner.apply(residual)
            product, before = _dots(residual, image), product
            direction *= _ratio(product, before)[..., None, None, None]
            direction += image
        if self.iterations is None:
            lacking = float((gains[-1] / scale).max())
            raise ConvergenceError(
                f"the image's fields have not converged in {LIMIT} iterations (last gain of energy"
                f" {lacking:.1e}, {self.accuracy:.1e} asked for); lower the contrast of the phases"
                " or ask for less accuracy"
            )
        return Solution(fields, limit)

    def _enough(self, product: Array, gains: list[Array], scale: Array) -> bool:
        """True if every system's remaining gain is within the accuracy."""
        if not np.any(product > 1e-26 * scale):
            return True
        if len(gains) < 2:
            return False
        last, back = gains[-1], min(len(gains) - 1, 3)
        rate = np.clip(_ratio(last, gains[-1 - back]), 0, 0.9) ** (1 / back)
        return bool(np.all(last * rate / (1 - rate) <= self.accuracy * scale))


def _dots(first: Array, second: Array) -> Array:
    """Inner products, shape (tiles, loads)."""
    count = first.shape[0] * first.shape[1]
    products = np.einsum("bn,bn->b", first.reshape(count, -1), second.reshape(count, -1))
    return np.asarray(products.reshape(first.shape[:2]))


def _add(target: Array, factors: Array, term: Array) -> None:
    """Add a multiple of each system's field in place."""
    for place in np.ndindex(*factors.shape):
        target[place] += factors[place] * term[place]


def _ratio(above: Array, below: Array) -> Array:
    """Quotient, 0 where the divisor is 0: a system that is solved stays."""
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)
