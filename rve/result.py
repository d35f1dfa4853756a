"""Result of every model of the cell: the homogenised stress over θ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from alphacut.rve.cell import STRAIN
from alphacut.stochastic.theta.truncated_normal import Array


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


@dataclass(frozen=True)
class StressCurve:
    """Homogenised stress of the slice at each θ (Fig. 16).

    Args:
        theta: Nodes, shape (n,), rising.
        weights: Quadrature weights with f_Θ inside, shape (n,), sum 1.
        s11: σ11 under load 1 at the nodes, shape (n,), in Pa.
        s12: σ12 under load 2 at the nodes, shape (n,), in Pa.
        stiffness: The whole planar stiffness at the nodes, Voigt order (11, 22, 12 with 2 ε12),
            shape (n, 3, 3), in Pa, if known.
    """

    theta: Array
    weights: Array
    s11: Array
    s12: Array
    stiffness: Array | None = None

    @property
    def mean(self) -> tuple[float, float]:
        """Means of s11 and s12 under f_Θ, in Pa."""
        return float(self.weights @ self.s11), float(self.weights @ self.s12)


@dataclass(frozen=True)
class Homogenised:
    """Effective behaviour of one cell with what it cost.

    Args:
        curve: Homogenised stress over θ.
        method: Name of the model: prism, slices, table or series.
        solver: Name of the linear solver and its options, or "none".
        unknowns: Unknowns of one linear system after elimination of constraints.
        iterations: Iterations of the linear solver, one number per load.
        seconds: Wall time by stage: mesh, assemble, setup, solve, total, jit.
        error: Estimated relative error of E by source: space, theta, table; empty where none was
            made.
        reason: Why this model and resolution were taken.
        checks: Certificate: name of each property to its measured violation, within its bound.
    """

    curve: StressCurve
    method: str
    solver: str = "none"
    unknowns: int = 0
    iterations: tuple[int, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    error: Mapping[str, float] = field(default_factory=dict)
    reason: str = ""
    checks: Mapping[str, float] = field(default_factory=dict)

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
    def estimated_error(self) -> float:
        """Estimated relative error of E, all sources together; nan where none was made."""
        return sum(self.error.values()) if self.error else float("nan")


def relative(value: float, reference: float) -> float:
    """|value − reference| / |reference|."""
    return float(np.abs(value - reference) / np.abs(reference))
