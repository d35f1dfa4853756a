"""Preconditioned conjugate gradients, stopped by a bound of the energy that is still to be gained.

A field lacks at most (residual · preconditioned residual) / λ, where λ is a lower bound of the
spectrum of the preconditioned operator, here from the materials. The lengths of the steps sharpen
that bound without further cost: it is the rule of Gauss and Radau for the same integral (Golub and
Meurant 1997; in this form Meurant and Tichý 2013), above the true energy at every step. So the
solver cannot take a pause of the method for its end. The bounds of the stiffness hold for whatever
field comes out; stopping early only widens them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from alphacut.base.errors import FailedError
from alphacut.rve.image.fields.grid import Fields, namespace, slabs

LinearMap = Callable[[Fields], Fields]
"""A symmetric linear map of a field, shape (1, unknowns, *grid)."""


@dataclass(frozen=True, eq=False)
class System:
    """The linear system operator(x) = load of a field x.

    Args:
        operator: Symmetric map, positive on the fields that matter.
        preconditioner: Inverse of the operator of one constant material.
        load: Right-hand side, shape (1, unknowns, *grid).
        scale: Energy that an accuracy refers to.
        min_energy_ratio: Positive lower bound of the energy x · operator(x) of any field over its
            energy in the constant material.
        start: First guess, of the shape of `load`; None for zero.
    """

    operator: LinearMap
    preconditioner: LinearMap
    load: Fields
    scale: float
    min_energy_ratio: float
    start: Fields | None = None


@dataclass(frozen=True)
class ConjugateGradient:
    """The solver and its stopping rule.

    Args:
        accuracy: Energy that the field may lack, over the scale of its system, in (0, 0.1]. A bound
            of the stiffness is then within three times that of the bound by solved fields.
        watch: Function that is called before every iteration; what it raises ends the solution.
    """

    accuracy: float = 3e-6
    watch: Callable[[], None] = field(default=lambda: None, compare=False, repr=False, kw_only=True)

    def solve(self, system: System) -> Fields:
        """Return a field whose energy error is at most `self.accuracy` times `system.scale`.

        It is the square of the distance from the exact solution in the norm of the operator.
        `self.watch` is called before each iteration, and what it raises is not caught.

        Args:
            system: The equation operator(x) = load, whose load has the shape (1, unknowns of a
                cell, y, x) or (1, unknowns of a cell, z, y, x). Its preconditioner is the inverse
                of the operator of a constant material, and `min_energy_ratio` the positive lower
                bound of the energy of any field over that in this material. `system.start`, the
                first guess or None for zero, is not changed.

        Returns:
            New array in the shape of the load, in its library (NumPy or CuPy).

        Raises:
            FailedError: 2000 iterations do not suffice.
        """
        # With the preconditioner, contrasts of 1e6 between phases need fewer.
        max_iterations = 2000
        if system.start is None:
            x = namespace(system.load).zeros_like(system.load)
            residual = system.load.copy()
        else:
            x = system.start.copy()
            residual = system.load - system.operator(x)
        direction = system.preconditioner(residual)
        gamma = inner(residual, direction)
        # The energy error is at most error_factor · gamma: gamma is the energy that the field lacks
        # in the constant material.
        error_factor = 1 / system.min_energy_ratio
        for _ in range(max_iterations):
            self.watch()
            if error_factor * gamma <= self.accuracy * system.scale:
                return x
            # Hestenes and Stiefel (1952) with a preconditioner: the step along the direction that
            # gains most energy, then a direction that is conjugate to those before.
            forces = system.operator(direction)
            curvature = inner(direction, forces)
            step = gamma / curvature if curvature > 0 else 0.0  # 0 by rounding alone
            _add_multiple(x, step, direction)
            _add_multiple(residual, -step, forces)
            del forces  # leaves memory for the preconditioner
            preconditioned = system.preconditioner(residual)
            last_gamma = gamma
            gamma = inner(residual, preconditioned)
            beta = gamma / last_gamma
            # The Gauss-Radau rule with the node min_energy_ratio (Meurant and Tichý 2013) sharpens
            # the bound by the lengths of the steps. Rounding may exhaust what is left of it;
            # then the bound without the steps, by the smallest eigenvalue alone, holds.
            excess = error_factor - step
            error_factor = 1 / system.min_energy_ratio
            if excess > 0:
                error_factor = excess / (system.min_energy_ratio * excess + beta)
            _add_multiple(preconditioned, beta, direction)
            direction = preconditioned
        energy_error = error_factor * gamma / system.scale
        raise FailedError(
            f"the image's fields lack up to {energy_error:.1e} of the energy after"
            f" {max_iterations} iterations, {self.accuracy:.1e} is allowed",
            "lower the contrast of the phases or allow more",
        )


def inner(first: Fields, second: Fields) -> float:
    """Return the inner product of two arrays of one shape."""
    xp = namespace(first)
    return float(xp.vdot(xp.reshape(first, (-1,)), xp.reshape(second, (-1,))))


def _add_multiple(x: Fields, factor: float, added: Fields) -> None:
    """Add a multiple of a field to `x` in place, by slabs, which bound the memory."""
    for slab in slabs(x):
        x[:, :, slab] += factor * added[:, :, slab]
