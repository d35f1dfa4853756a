"""Result of every model of the cell: the homogenised stress over θ."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from alphacut.rve.cell import STRAIN, Cell, square_moduli, square_voigt, with_ratio_errors
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def effective_modulus(s11: float, s12: float) -> tuple[float, float]:
    """Young's modulus (Pa) and Poisson's ratio by the paper's convention, eq. 16.

    A square array is not isotropic: this E is the paper's convention, not a property in every
        direction.

    Args:
        s11: Mean homogenised σ11 under ε11 = ε22 = 0.01, in Pa.
        s12: Mean homogenised σ12 under ε12 = 0.01, in Pa.
    """
    shear, bulk = s12 / STRAIN, s11 / STRAIN  # A and B of eq. 16 solved for its two unknowns
    nu = (1 - shear / bulk) / 2
    return shear * (1 + nu), nu


@dataclass(frozen=True, eq=False)
class StressCurve:
    """Homogenised stress of the slice at each θ (Fig. 16).

    Args:
        theta: Nodes, shape (n,), rising.
        weights: Quadrature weights with f_Θ inside, shape (n,), sum 1.
        s11: σ11 under load 1 at the nodes, shape (n,), in Pa.
        s12: σ12 under load 2 at the nodes, shape (n,), in Pa.
        stiffness: The whole planar stiffness at the nodes, Voigt order (11, 22, 12 with 2 ε12),
            shape (n, 3, 3), in Pa, if known.
        error: Declared relative errors of s11 and s12 at the nodes, shape (n, 2), if estimated.
    """

    theta: Array
    weights: Array
    s11: Array
    s12: Array
    stiffness: Array | None = None
    error: Array | None = None

    @property
    def mean(self) -> tuple[float, float]:
        """Means of s11 and s12 under f_Θ, in Pa."""
        return float(self.weights @ self.s11), float(self.weights @ self.s12)


@dataclass(frozen=True, eq=False, repr=False)
class Homogenised:
    """Effective behaviour of one cell with what it cost.

    Args:
        curve: Homogenised stress over θ.
        method: Name of the model: prism, slices, table, series or image.
        solver: Name of the linear solver and its options, or "none".
        unknowns: Unknowns of one linear system after elimination of constraints.
        iterations: Iterations of the linear solver, one number per load.
        seconds: Wall time by stage: mesh, assemble, setup, solve, total, jit.
        errors: Declared relative errors of the mean moduli by source (space, theta, table): of
            C11 + C12, C11 − C12, C33 and, where it is known by itself, the ratio of the last two,
            shape (3,) or (4,), nan for a modulus that was not computed; empty where none were
            estimated.
        reason: Why this model and resolution were taken.
        checks: Certificate: name of each property to its measured violation, within its bound.
        cell: What was homogenised.
    """

    curve: StressCurve
    method: str
    solver: str = "none"
    unknowns: int = 0
    iterations: tuple[int, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    errors: Mapping[str, Array] = field(default_factory=dict)
    reason: str = ""
    checks: Mapping[str, float] = field(default_factory=dict)
    cell: Cell | None = None
    convention: ClassVar[str] = "eq. 16"

    def __repr__(self) -> str:
        """E and ν with the declared error, the model and its cost."""
        cost = self.seconds.get("total", 0.0)
        return (
            f"Homogenised(E = {self.modulus:.7g} Pa, ν = {self.poisson:.5g} ({self.convention}),"
            f" relative error of E {self.estimated_error:.2g}, by {self.method}, {cost:.2g} s)"
        )

    def _repr_html_(self) -> str:
        """The same as a table, for notebooks."""
        from html import escape

        rows = {
            f"E of {self.convention}": f"{self.modulus:.7g} Pa",
            f"ν of {self.convention}": f"{self.poisson:.5g}",
            "declared relative error of E": f"{self.estimated_error:.2g}",
            "model": self.method,
            "why": self.reason,
        }
        cells = "".join(f"<tr><th>{k}</th><td>{escape(v)}</td></tr>" for k, v in rows.items() if v)
        return f"<table>{cells}</table>"

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the homogenised stress over θ (Fig. 16).

        Args:
            axes: Where to draw; a new figure if not given.

        Returns:
            The axes drawn on.
        """
        if axes is None:
            from matplotlib import pyplot

            axes = pyplot.subplots(figsize=(5.0, 3.0), layout="constrained")[1]
        axes.plot(self.curve.theta, self.curve.s11, label="σ11 under ε11 = ε22")
        axes.plot(self.curve.theta, self.curve.s12, label="σ12 under ε12")
        axes.set(xlabel="θ", ylabel="homogenised stress in Pa")
        axes.legend(frameon=False)
        return axes

    @property
    def modulus(self) -> float:
        """Effective Young's modulus of eq. 16, in Pa."""
        return effective_modulus(*self.curve.mean)[0]

    @property
    def poisson(self) -> float:
        """Effective Poisson's ratio of eq. 16."""
        return effective_modulus(*self.curve.mean)[1]

    @property
    def stiffness(self) -> Array | None:
        """Mean planar stiffness under f_Θ, Voigt order, shape (3, 3), in Pa, or None."""
        curve = self.curve
        return (
            None
            if curve.stiffness is None
            else np.tensordot(curve.weights, curve.stiffness, axes=1)
        )

    @property
    def modulus_errors(self) -> Array:
        """Declared relative errors of the mean C11 + C12, C11 − C12 and C33, shape (3,).

        All sources together; nan where unknown.
        """
        return self._all_errors[:3]

    @property
    def ratio_error(self) -> float:
        """Declared relative error of (C11 − C12)/C33, all sources together; nan where unknown."""
        return float(self._all_errors[3])

    @property
    def _all_errors(self) -> Array:
        """Declared relative errors of the three moduli and of the ratio, shape (4,)."""
        if not self.errors:
            return np.full(4, np.nan)
        found = np.prod([1 + error for error in self.errors.values()], axis=0) - 1
        propagated = with_ratio_errors(found[:3])
        return np.minimum(found, propagated) if found.size == 4 else propagated

    @property
    def estimated_error(self) -> float:
        """Declared relative error of E, all sources together; nan where none was made."""
        return self._error_of_modulus(self.modulus_errors)

    @property
    def error(self) -> dict[str, float]:
        """Declared relative error of E by source; their sum is `estimated_error`."""
        shares = {name: self._error_of_modulus(part) for name, part in self.errors.items()}
        scale = self.estimated_error / (sum(shares.values()) or 1.0)
        return {name: scale * share for name, share in shares.items()}

    @property
    def largest_error(self) -> float:
        """The largest declared error of what is printed and exported; nan where none was made.

        Relative for E, mean stresses and moduli, absolute for Poisson's ratio.
        """
        if not self.errors:
            return float("nan")
        return float(np.nanmax([*self.modulus_errors, self.estimated_error, self.poisson_error]))

    @property
    def poisson_error(self) -> float:
        """Declared absolute error of ν; nan where none was made."""
        means, errors = np.array(self.curve.mean), self.modulus_errors[[0, 2]]
        return float(spread(lambda s: effective_modulus(*s)[1], means, errors))

    def _error_of_modulus(self, errors: Array) -> float:
        """Relative error of E from those of the moduli."""
        modulus = self.modulus
        means = np.array(self.curve.mean)

        def ratio(stresses: Array) -> Array:
            other = effective_modulus(*stresses)[0]
            return np.array([other / modulus, modulus / other if other > 0 else np.inf])

        return float(spread(ratio, means, errors[[0, 2]]).max())


def spread(function: Callable[[Array], Array | float], values: Array, errors: Array) -> Array:
    """Largest change of `function` over a box of its arguments, seen at the corners.

    Each value runs from value/(1 + error) to value·(1 + error).

    Args:
        function: Takes an array like `values`; monotone in each of them over the box.
        values: Positive, shape (n,).
        errors: Relative, shape (n,).

    Returns:
        Absolute, of the function's shape; nan where an error is.
    """
    if not np.isfinite(errors).all():
        return np.full(np.shape(function(values)), np.nan)
    centre = np.asarray(function(values))
    ends = product(*((1 / (1 + error), 1 + error) for error in errors))
    changes = [abs(np.asarray(function(values * factor)) - centre) for factor in ends]
    return np.asarray(np.max(changes, axis=0))


def relative(value: float, reference: float) -> float:
    """|value − reference| / |reference|."""
    return float(np.abs(value - reference) / np.abs(reference))


def error_of_means(result: Homogenised) -> Array:
    """Absolute errors of E (Pa), ν and the mean stresses s11 and s12 (Pa), shape (4,).

    They are nan where none were made.
    """
    stresses = spread(np.asarray, np.array(result.curve.mean), result.modulus_errors[[0, 2]])
    return np.array([result.estimated_error * result.modulus, result.poisson_error, *stresses])


def error_of_stiffness(result: Homogenised, function: Callable[[Array], Array | float]) -> Array:
    """Absolute error of a function of the plane stiffness.

    The exact stiffness has the symmetry of the square; what a mesh lacks of it is known and counts
    besides the declared errors of the three moduli.

    Args:
        result: With its whole plane stiffness.
        function: Takes a Voigt matrix, shape (3, 3), in Pa.

    Returns:
        Of the function's shape, nan where no error was made.
    """
    stiffness = np.asarray(result.stiffness)
    moduli = square_moduli(stiffness)

    def of_moduli(values: Array) -> Array:
        return np.asarray(function(square_voigt(*values)))

    uneven = abs(np.asarray(function(stiffness)) - of_moduli(moduli))
    return np.asarray(uneven + spread(of_moduli, moduli, result.modulus_errors))
