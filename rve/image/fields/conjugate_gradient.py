"""Preconditioned conjugate gradients on several loads, stopped by a bound of the energy to gain.

Fields lack at most (residual · preconditioned residual) / λ, where λ is a lower bound of the
spectrum of the preconditioned operator, here from the materials. The lengths of the steps sharpen
that bound without further cost: it is the rule of Gauss and Radau for the same integral (Golub and
Meurant 1997; in this form Meurant and Tichý 2013), above the true energy at every step. So the
solver cannot take a pause of the method for its end. The bounds of the stiffness hold for whatever
field comes out; stopping early only widens them.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError
from alphacut.rve.image.fields.grid import Fields, namespace, slabs

LOG = logging.getLogger(__name__)

LIMIT = 2000  # iterations; with the preconditioner, contrasts of 1e6 need fewer


LinearMap = Callable[[Fields], Fields]
"""A symmetric linear map of fields, shape (loads, unknowns, *grid)."""


@dataclass(frozen=True, eq=False)
class System:
    """Fields with operator(fields) = load.

    Args:
        operator: Positive on fields that matter.
        preconditioner: Inverse of the operator of one constant material.
        load: Right-hand sides, shape (loads, unknowns, *grid).
        scale: Energy that an accuracy refers to, shape (loads,).
        least: Energy of any field over the one that it has in the constant material, at least.
        start: First guess, of the load's shape; None: zero.
    """

    operator: LinearMap
    preconditioner: LinearMap
    load: Fields
    scale: Array
    least: float
    start: Fields | None = None


@dataclass(frozen=True)
class ConjugateGradient:
    """The solver's stopping rule.

    Args:
        accuracy: Energy that the fields may lack, relative to the system's scale, in (0, 0.1]; a
            bound of the stiffness is then within three times that of the one of solved fields.
        watch: Called before every iteration; what it raises ends it.
    """

    accuracy: float = 3e-6
    watch: Callable[[], None] = field(default=lambda: None, compare=False, repr=False, kw_only=True)

    def solve(self, system: System) -> tuple[Fields, int]:
        """Fields of all loads with an energy error within the accuracy, and number of iterations.

        Raises:
            FailedError: `LIMIT` iterations are not enough.
        """
        if system.start is None:
            x, r = namespace(system.load).zeros_like(system.load), system.load.copy()
        else:
            x, r = system.start.copy(), system.load - system.operator(system.start)
        p = system.preconditioner(r)
        gamma = inner(r, p)  # residual · preconditioned residual
        # energy error ≤ error_factor · gamma, by the lower bound of the spectrum
        error_factor = np.full(gamma.shape, 1 / system.least)
        allowed = self.accuracy * system.scale
        is_solved = np.zeros(gamma.shape, bool)
        for number in range(LIMIT):
            self.watch()
            is_solved |= error_factor * gamma <= allowed
            if is_solved.all():
                LOG.debug("fields on %s points: %d iterations", x.shape[2:], number)
                return x, number
            Ap = system.operator(p)
            # a load that is solved rests: its directions are rounding, and so are their steps
            alpha = np.where(is_solved, 0, _ratio(gamma, inner(p, Ap)))
            _add_multiple(x, alpha, p)
            _add_multiple(r, -alpha, Ap)
            del Ap  # memory for the preconditioner
            z = system.preconditioner(r)
            last_gamma, gamma = gamma, inner(r, z)
            beta = _ratio(gamma, last_gamma)
            error_factor = _radau(error_factor - alpha, beta, system.least)
            _add_multiple(z, beta, p)
            p = z
        energy_error = float((error_factor * gamma / system.scale).max())
        raise FailedError(
            f"the image's fields lack up to {energy_error:.1e} of the energy after {LIMIT}"
            f" iterations, {self.accuracy:.1e} is allowed",
            "lower the contrast of the phases or allow more",
        )


def inner(first: Fields, second: Fields) -> Array:
    """Inner products of fields, shape (loads,)."""
    xp = namespace(first)
    left, right = (xp.reshape(x, (x.shape[0], 1, -1)) for x in (first, second))
    products = left @ xp.moveaxis(right, 1, 2)
    return np.array([float(product) for product in products[:, 0, 0]])


def _radau(excess: Array, beta: Array, least: float) -> Array:
    """Next factor of the energy error's bound by the Gauss–Radau rule (Meurant, Tichý 2013)."""
    sharper = _ratio(excess, least * excess + beta)
    return np.where(excess > 0, sharper, 1 / least)


def _add_multiple(fields: Fields, factors: Array, added: Fields) -> None:
    """Add the other fields, times a factor a load, in place and by slabs."""
    for slab in slabs(fields):
        for load, factor in enumerate(factors):
            fields[load][:, slab] += float(factor) * added[load][:, slab]


def _ratio(above: Array, below: Array) -> Array:
    """Quotient, 0 where the divisor is 0: a system that is solved stays."""
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)
