"""Linear systems of the fields, with what is known of their errors before they are solved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array


class Linear(Protocol):
    """A symmetric linear map of fields, shape (tiles, loads, types, rows, columns)."""

    def apply(self, fields: Array, /) -> Array:
        """The image of the fields."""


@dataclass(frozen=True)
class System:
    """Fields are wanted with operator(fields) = load.

    Args:
        operator: Positive on fields that matter.
        preconditioner: Inverse of the operator of one constant material.
        load: Right-hand sides, shape (tiles, loads, types, rows, columns).
        scale: Energy that an accuracy refers to, shape (tiles, loads).
        least: Energy of any field over the one that it has in the constant material, at least;
            shape (tiles,), positive.
        start: First guess, of the load's shape; None: zero.
        origin: What the operator is made of.
    """

    operator: Linear
    preconditioner: Linear
    load: Array
    scale: Array
    least: Array
    start: Array | None = None
    origin: tuple[Array, ...] = ()

    def begin(self) -> tuple[Array, Array]:
        """First fields and their residuals, arrays to work in; the residuals replace the load."""
        if self.start is None:
            return np.zeros_like(self.load), self.load
        residual = self.load
        residual -= self.operator.apply(self.start)
        return self.start.copy(), residual

    def lacking(self, residual: Array) -> Array:
        """Energy above the least one of fields with a residual, at most, shape (tiles, loads)."""
        products = inner(residual, self.preconditioner.apply(residual))
        return np.asarray(products / self.least[:, None])


def inner(first: Array, second: Array) -> Array:
    """Inner products of fields, shape (tiles, loads)."""
    count = first.shape[0] * first.shape[1]
    products = np.einsum("bn,bn->b", first.reshape(count, -1), second.reshape(count, -1))
    return np.asarray(products.reshape(first.shape[:2]))
