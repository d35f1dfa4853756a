"""Preconditioned conjugate gradients on many systems, stopped by a bound of the energy to gain.

Fields lack at most (residual · preconditioned residual) / λ, where λ is a lower bound of the
spectrum of the preconditioned operator, here from the materials. The lengths of the steps sharpen
that bound without further cost: it is the rule of Gauss and Radau for the same integral (Golub and
Meurant 1997; in this form Meurant and Tichý 2013), above the true energy at every step. So the
solver cannot take a pause of the method for its end. The bounds of the stiffness hold for whatever
field comes out; stopping early only widens them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from alphacut.rve.image.fields.solver import ConvergenceError, Solution, Solver
from alphacut.rve.image.fields.system import System, inner
from alphacut.stochastic.theta.truncated_normal import Array

LIMIT = 2000  # iterations; with the preconditioner, contrasts of 1e6 need fewer


@dataclass(frozen=True)
class ConjugateGradient(Solver):
    """The solver's stopping rule.

    Args:
        accuracy: Energy that the fields may lack, relative, in (0, 0.1].
        iterations: Exact number of iterations instead, or None; fields are then not converged and
            not meant to be.

    Raises:
        ValueError: A value lies outside its range.
    """

    iterations: int | None = None
    threads: ClassVar[int] = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.iterations is not None and self.iterations < 0:
            raise ValueError(f"{self.iterations} iterations are asked for; take 0 or more")

    def solve(self, system: System) -> Solution:
        """Fields that lack no more than the accuracy says; the system's load is overwritten.

        Raises:
            ConvergenceError: `LIMIT` iterations are not enough.
        """
        fields, residual = system.begin()
        direction = system.preconditioner.apply(residual)
        product, least = inner(residual, direction), system.least[:, None]
        reach = np.broadcast_to(1 / least, product.shape)  # energy lacking over product, at most
        allowed = self.accuracy * system.scale
        limit = LIMIT if self.iterations is None else self.iterations
        for number in range(limit):
            self.watch()
            if self.iterations is None and np.all(reach * product <= allowed):
                return Solution(fields, number)
            image = system.operator.apply(direction)
            length = _ratio(product, inner(direction, image))
            _add(fields, length, direction)
            _add(residual, -length, image)
            image = system.preconditioner.apply(residual)
            product, before = inner(residual, image), product
            change = _ratio(product, before)
            reach = _radau(reach - length, change, least)
            direction *= change[..., None, None, None]
            direction += image
        if self.iterations is None:
            lacking = float((reach * product / system.scale).max())
            raise ConvergenceError(
                f"the image's fields have not converged in {LIMIT} iterations (up to {lacking:.1e}"
                f" of the energy left, {self.accuracy:.1e} asked for); lower the contrast of the"
                " phases or ask for less accuracy"
            )
        return Solution(fields, limit)


def _radau(excess: Array, change: Array, least: Array) -> Array:
    """Next energy lacking over product, at most, from the last less the length of the step.

    Without rounding the excess is positive, and the result up to 1/least.
    """
    sharper = _ratio(excess, least * excess + change)
    return np.where(excess > 0, sharper, 1 / least)


def _add(target: Array, factors: Array, term: Array) -> None:
    """Add a multiple of each system's field in place."""
    for place in np.ndindex(*factors.shape):
        target[place] += factors[place] * term[place]


def _ratio(above: Array, below: Array) -> Array:
    """Quotient, 0 where the divisor is 0: a system that is solved stays."""
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)
