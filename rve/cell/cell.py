"""The cell: two elastic phases and a random radius, and the loads it is homogenised under."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Self

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, checked_number, is_number
from alphacut.rve.cell.lattice import SQUARE, Lattice
from alphacut.rve.cell.outline import Outline, area, circle, is_round
from alphacut.stochastic import RadiusMap, require_map

STRAIN = 0.01
"""Macroscopic strain of eq. 15."""
LOADS = np.array([[STRAIN, STRAIN, 0.0], [0.0, 0.0, 2 * STRAIN]])
"""Macroscopic strains of eq. 15 as (ε11, ε22, 2 ε12); ε12 is the tensor component."""
THREE_LOADS = np.vstack([LOADS, [[STRAIN, -STRAIN, 0.0]]])
"""`LOADS` and a deviatoric strain, from which the whole planar stiffness follows."""


@dataclass(frozen=True)
class Phase:
    """An isotropic elastic material in plane strain.

    Args:
        modulus: Young's modulus in Pa, positive.
        poisson: Poisson's ratio, inside (−1, 0.5).
        loss: Loss factor tan δ of the whole stiffness, 0 or more; None where it is not asked for.

    Example:
        >>> (Phase(20e9, 0.25).stiffness / 1e9).tolist()  # Voigt order 11, 22, 12 with 2 ε12
        [[24.0, 8.0, 0.0], [8.0, 24.0, 0.0], [0.0, 0.0, 8.0]]
    """

    modulus: float
    poisson: float = 0.3
    loss: float | None = None

    def __post_init__(self) -> None:
        """Check the constants, and warn of a modulus that is probably not in Pa.

        The warning comes for moduli in [0.01 Pa, 10 kPa), but not for the number 1.

        Raises:
            RefusedError: A constant is no real number, the modulus is not positive and finite,
                Poisson's ratio is not inside (−1, 0.5), or the loss factor is negative or not
                finite.
        """
        for what, value in (("Young's modulus", self.modulus), ("Poisson's ratio", self.poisson)):
            if not isinstance(value, Real) or isinstance(value, bool):
                cure = "a fuzzy one is an input of fuzzy.propagate, each sample makes its own phase"
                raise RefusedError(what, repr(value), "plain numbers, in Pa", cure)
        if not (np.isfinite(self.modulus) and self.modulus > 0):
            raise RefusedError(
                "Young's modulus", f"{self.modulus:g} Pa", "positive and finite numbers"
            )
        # Solids have such a modulus in GPa or MPa, but the softest gel has more in Pa. The
        # number 1 is a common choice where only ratios of moduli count.
        if 0.01 <= self.modulus < 1e4 and self.modulus != 1:
            soft = f"Young's modulus is {self.modulus:g} Pa, softer than any gel"
            warnings.warn(f"{soft}; a phase takes Pa, 1 GPa is 1e9", stacklevel=3)
        if not -1 < self.poisson < 0.5:
            raise RefusedError("Poisson's ratio", f"{self.poisson:g}", "values inside (-1, 0.5)")
        require_loss(self.loss)

    @classmethod
    def of_bulk_and_shear(cls, bulk: float, shear: float) -> Self:
        """Return the material of a bulk modulus K of three dimensions and a shear modulus G.

        Args:
            bulk: K in Pa, positive.
            shear: G in Pa, positive; a fluid is no phase of this kind.

        Raises:
            RefusedError: K or G is no positive, finite number, or G/K is so small that Poisson's
                ratio is 1/2 to rounding.
        """
        k = checked_number("bulk modulus", bulk, positive=True)
        g = checked_number("shear modulus", shear, positive=True)
        # E = 9 K G/(3 K + G) and ν = (3 K − 2 G)/(2 (3 K + G)) of an isotropic solid.
        return cls(9 * k * g / (3 * k + g), (3 * k - 2 * g) / (6 * k + 2 * g))

    @property
    def stiffness(self) -> Array:
        """Plane-strain stiffness in Voigt order (11, 22, 12 with 2 ε12), (3, 3), in Pa (eq. 6)."""
        nu = self.poisson
        # Plane strain: ε33 = 0. The shear entry is half of that for tensors, since its strain is
        # 2 ε12.
        unit = np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, (1 - 2 * nu) / 2]])
        return self.modulus / ((1 + nu) * (1 - 2 * nu)) * unit

    @property
    def bulk_and_shear(self) -> Array:
        """K of three dimensions and G, shape (2,), in Pa."""
        # K of space, so that one name means the same for spheres and for fibres.
        bulk = self.modulus / (3 * (1 - 2 * self.poisson))
        return np.array([bulk, self.modulus / (2 * (1 + self.poisson))])

    @property
    def stiffness_parts(self) -> Array:
        """What K and what G give to the stiffness, shape (2, 3, 3), in Pa."""
        # σ = K tr ε 1 + 2 G dev ε: in the plane K acts on ε11 + ε22 alone, and gives both normal
        # stresses. What remains of the stiffness is proportional to G.
        by_bulk = np.zeros((3, 3))
        by_bulk[:2, :2] = self.bulk_and_shear[0]
        return np.array([by_bulk, self.stiffness - by_bulk])


@dataclass(frozen=True)
class VoigtPhase:
    """An elastic material of any plane-strain stiffness.

    Args:
        rows: Stiffness in Voigt order (11, 22, 12 with 2 ε12), symmetric positive definite, three
            rows of three, in Pa.
        loss: Loss factor tan δ of the whole stiffness, 0 or more; None where it is not asked for.
    """

    rows: tuple[tuple[float, ...], ...]
    loss: float | None = None

    def __post_init__(self) -> None:
        """Check the stiffness, and make it exactly symmetric by the mean with its transpose.

        Raises:
            RefusedError: The rows are not 3 × 3 finite numbers, differ from their transpose by more
                than 1e-9 of the largest entry, or have an eigenvalue that is not positive; or the
                loss factor is negative or not finite.
        """
        allowed = "symmetric positive definite matrices of 3 × 3, in Pa"
        try:
            matrix = np.asarray(self.rows, float)
        except (ValueError, TypeError):  # of rows that differ in length, texts, complex numbers
            raise RefusedError("stiffness of the phase", repr(self.rows), allowed) from None
        is_symmetric = matrix.shape == (3, 3) and np.isfinite(matrix).all()
        if is_symmetric:
            # Round-off of a matrix that was turned or inverted is far below 1e-9.
            is_symmetric = abs(matrix - matrix.T).max() <= 1e-9 * abs(matrix).max()
        if not is_symmetric or np.linalg.eigvalsh(matrix)[0] <= 0:
            raise RefusedError("stiffness of the phase", matrix.tolist(), allowed)
        require_loss(self.loss)
        # The dataclass is frozen, so that it can be the key of a cache; tuples can be hashed.
        symmetric_rows = ((matrix + matrix.T) / 2).tolist()
        object.__setattr__(self, "rows", tuple(map(tuple, symmetric_rows)))

    @property
    def stiffness(self) -> Array:
        """Plane-strain stiffness in Voigt order, (3, 3), in Pa (eq. 6)."""
        return np.array(self.rows)

    @property
    def stiffness_parts(self) -> Array:
        """No part of a bulk modulus, and all the stiffness, shape (2, 3, 3), in Pa."""
        return np.array([np.zeros((3, 3)), self.stiffness])


AnyPhase = Phase | VoigtPhase
Phases = Sequence[AnyPhase] | Mapping[str, AnyPhase]
"""Matrix and particle, or the phases of a mesh or level set of the user's own by name."""


def require_loss(loss: float | None) -> None:
    """Refuse a loss factor that is no number of 0 or more."""
    if loss is not None:
        checked_number("loss", loss, least=0.0)


@dataclass(frozen=True)
class Cell:
    """Periodic cell with one centred particle of random radius r(θ).

    Args:
        matrix: Material outside the particle.
        inclusion: Material of the particle.
        radius_map: Map θ ↦ r(θ) in (0, 1), with the law of θ.
        outline: Distance of the particle's edge from its centre over r(θ), a function of the angle.
        lattice: Outline and periods of the cell; by default the square of side 2.
    """

    matrix: AnyPhase
    inclusion: AnyPhase
    radius_map: RadiusMap
    outline: Outline = circle
    lattice: Lattice = SQUARE

    @property
    def phases(self) -> tuple[AnyPhase, ...]:
        """Matrix and particle."""
        return self.matrix, self.inclusion

    def fraction(self, theta: Array) -> Array:
        """Area fraction of the particle at θ of any shape."""
        # Outlines of all radii are similar, so that areas grow with r².
        return np.asarray(area(self.outline) / self.lattice.area * self.radius_map(theta) ** 2)

    def fractions(self, theta: Array) -> Array:
        """Area fractions of the phases at θ, shape (phases, n)."""
        inner = self.fraction(theta)
        return np.stack([1 - inner, inner])

    @property
    def stiffness(self) -> tuple[Array, ...]:
        """Of the phases, (3, 3) each, in Pa."""
        return tuple(phase.stiffness for phase in self.phases)

    @property
    def square(self) -> bool:
        """Whether C11 = C22 holds without coupling to shear.

        It does where both phases are isotropic, the outline is round and the cell is no rectangle.
        """
        is_isotropic = isinstance(self.matrix, Phase) and isinstance(self.inclusion, Phase)
        return is_isotropic and is_round(self.outline) and self.lattice.is_square


def require_mesh_size(size: float) -> None:
    """Refuse an edge length outside (0, 1], in halves of the cell's side."""
    if not (is_number(size) and 0 < size <= 1):
        allowed = "values in (0, 1], in halves of the cell's side"
        shown = f"{size:g}" if is_number(size) else repr(size)
        raise RefusedError("the mesh size", shown, allowed)


def require_points(points: int | None) -> None:
    """Refuse a quadrature rule in θ of fewer than two points; None means the model's choice."""
    if points is not None and not (is_number(points, whole=True) and points >= 2):
        raise RefusedError("number of points of the rule in θ", repr(points), "2 or more")


def continuous_radii(radius_map: RadiusMap) -> Array:
    """Return the radii of a map at 2049 even steps of θ over its support, shape (2049,).

    Args:
        radius_map: What the user gave as the map r(θ), in halves of the cell's side, with the
            distribution of θ.

    Raises:
        RefusedError: It is no radius map, a radius is outside (0, 1) at one of 65 even steps, or
            neighbouring radii differ by more than 0.01. Such a map has a jump, whose error no rule
            in θ can estimate.
    """
    require_map(radius_map)
    distribution = radius_map.distribution
    theta = np.linspace(distribution.lower, distribution.upper, 2049)
    radii = radius_map(theta)
    changes = abs(np.diff(radii))
    jump = int(np.argmax(changes))
    # Maps of particles change at most by about a twentieth of this in a step.
    if changes[jump] > 0.01:
        value = f"{radii[jump]:.4g} and {radii[jump + 1]:.4g} side by side"
        raise RefusedError(f"r at θ = {theta[jump]:.4g}", value, "maps without a jump")
    return np.asarray(radii)


def require_compressible(*phases: AnyPhase) -> None:
    """Raise for phases that are so incompressible that quadratic elements lock.

    Args:
        phases: Materials. Those of any stiffness, which have no Poisson's ratio, pass.

    Raises:
        RefusedError: A Poisson's ratio is above 0.45.
    """
    ratios = [phase.poisson for phase in phases if isinstance(phase, Phase)]
    # Tuned: above, the errors of quadratic elements grow quickly.
    max_poisson = 0.45
    if max(ratios, default=0.0) > max_poisson:
        cure = "finite elements lock above: take the series"
        allowed = f"values up to {max_poisson:g}"
        raise RefusedError("Poisson's ratio", f"{max(ratios):g}", allowed, cure)


def require_solve_arguments(
    radius_map: object, matrix: object, inclusions: object, *, isotropic: bool = True
) -> None:
    """Raise unless the arguments of `solve` are a radius map, a phase and a list of phases.

    A map is a function with the attribute `distribution`; its radii are not checked.

    Args:
        radius_map: First argument.
        matrix: Second argument.
        inclusions: Third argument.
        isotropic: Whether the model takes isotropic phases alone, and no VoigtPhase.

    Raises:
        RefusedError: One of the three is of another kind, or `inclusions` is empty. The message
            names the types that were given.
    """
    is_map = callable(radius_map) and hasattr(radius_map, "distribution")
    has_phases = False
    if isinstance(inclusions, Sequence) and len(inclusions) > 0:
        kinds = (Phase,) if isotropic else (Phase, VoigtPhase)
        has_phases = all(isinstance(phase, kinds) for phase in (matrix, *inclusions))
    if is_map and has_phases:
        return
    given = ", ".join(type(part).__name__ for part in (radius_map, matrix, inclusions))
    if isinstance(inclusions, Sequence) and len(inclusions) == 0:
        given += " (empty)"
    raise RefusedError(
        "parts of the cell",
        given,
        "the radius map, the matrix's phase and a list of the inclusions' phases",
        "any stiffness is for slices and prism; write solve(radius, Phase(3e9), [Phase(70e9)])",
    )
