"""Result of every model of the cell: the homogenised stress over θ, and the constants from it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError
from alphacut.rve.cell.cell import STRAIN, Cell
from alphacut.rve.result.moduli import (
    AVERAGES,
    AXES,
    plane_constants,
    require_average,
    shear_modulus,
    square_moduli,
)
from alphacut.stochastic import ThetaRule


def effective_modulus(s11: float, s12: float) -> tuple[float, float]:
    """Return Young's modulus (Pa) and Poisson's ratio by the paper's convention, eq. 16.

    With A = 2 C33 and B = C11 + C12 they are ν = (1 − A/B)/2 and E = A (1 + ν).

    Args:
        s11: Mean homogenised σ11 under ε11 = ε22 = 0.01, in Pa; not 0.
        s12: Mean homogenised σ12 under ε12 = 0.01, in Pa.
    """
    # σ11 is (C11 + C12) ε11, and σ12 is C33 · 2 ε12. C11 − C12 is not known, nor used.
    moduli = np.array([s11, np.nan, s12 / 2]) / STRAIN
    young, poisson = plane_constants(moduli, AXES)
    return float(young), float(poisson)


@dataclass(frozen=True, eq=False)
class StressCurve:
    """Homogenised stress of the slice at each θ (Fig. 16).

    Args:
        theta: Nodes, shape (n,), rising.
        weights: Quadrature weights with f_Θ inside, shape (n,), sum 1.
        s11: σ11 under load 1 at the nodes, shape (n,), in Pa.
        s12: σ12 under load 2 at the nodes, shape (n,), in Pa.
        stiffness: The whole stiffness at the nodes if known, in Voigt order, in Pa: of the plane
            (11, 22, 12 with 2 ε12), shape (n, 3, 3), or of space, (n, 6, 6).
        error: Declared relative error of the stress at a single θ, beside that of the means.
    """

    theta: Array
    weights: Array
    s11: Array
    s12: Array
    stiffness: Array | None = None
    error: float = 0.0

    @classmethod
    def from_stiffness(cls, rule: ThetaRule, stiffness: Array) -> StressCurve:
        """Stress under the loads of eq. 15 from the stiffness at the nodes."""
        # The loads of eq. 15 are ε11 = ε22 = STRAIN, and ε12 = STRAIN, whose Voigt component is 2
        # ε12.
        s11 = STRAIN * (stiffness[:, 0, 0] + stiffness[:, 0, 1])
        return cls(rule.nodes, rule.weights, s11, 2 * STRAIN * stiffness[:, -1, -1], stiffness)

    @property
    def mean(self) -> tuple[float, float]:
        """Means of s11 and s12 under f_Θ, in Pa."""
        return float(self.weights @ self.s11), float(self.weights @ self.s12)


@dataclass(frozen=True)
class DeclaredConstants:
    """Constants by name, moduli in Pa, and their declared absolute errors, nan if unknown."""

    values: dict[str, float]
    errors: dict[str, float]

    @classmethod
    def from_arrays(cls, names: Sequence[str], values: Array, errors: Array) -> DeclaredConstants:
        """Return the constants from arrays in the order of their names."""
        values_by_name = dict(zip(names, map(float, values), strict=True))
        return cls(values_by_name, dict(zip(names, map(float, errors), strict=True)))


STEP = 1e-30
"""Step h of complex-step derivatives f'(x) = Im f(x + i h) / h. They have no difference of equal
numbers, so that h may be far below round-off."""


def young_shear_bulk(moduli: Array, constants_of: Callable[[Array], Array]) -> Array:
    """Return E, G and the first modulus from the three moduli, shape (3,), in Pa.

    The first modulus is 2 K_T of the plane, and K of space.
    """
    young, poisson = constants_of(moduli)
    return np.array([young, young / (2 * (1 + poisson)), moduli[0]])


@dataclass(frozen=True, eq=False)
class PhaseEnergies:
    """Parts of the phases in the strain energy: X ∂c/∂X of the three moduli c.

    Args:
        values: For X = K and G of each phase, shape (phases, 2, 3), in Pa; their sum is the three
            moduli (nan where not computed).
        errors: Declared absolute errors, same shape; nan where unknown.
        moduli_at: Function that returns the three moduli, shape (3,), for complex K and G of all
            phases, shape (phases,) each; None where the model takes real ones alone.
    """

    values: Array
    errors: Array
    moduli_at: Callable[[Array, Array], Array] | None = None

    def energy_fractions(self, constants_of: Callable[[Array], Array]) -> tuple[Array, Array]:
        """Return the fractions ∂ln c/∂ln X of c = E, G, K that belong to X = K, G of each phase.

        They follow by the chain rule from X ∂c/∂X of the three moduli of the cell, `self.values`.

        Args:
            constants_of: Function that returns E and ν, shape (2,), for the three moduli of the
                cell, shape (3,), also complex ones: of the plane C11 + C12, C11 − C12 and C33,
                where one that was not computed is NaN and must not be used.

        Returns:
            The fractions and their declared absolute errors (NaN where unknown), shape (phases, K
            and G of the phase, E, G and K of the cell) each. K of the cell is that of plane strain,
            of spheres that of space.
        """
        moduli = self.values.sum(axis=(0, 1))

        def logarithmic_change(change: Array) -> Array:
            """Return the relative change of E, G, K for a small change of the three moduli."""
            constants = young_shear_bulk(moduli + 1j * STEP * change, constants_of)
            return np.asarray(constants.imag / (STEP * constants.real))

        # X ∂c/∂X is how the moduli c change with ln X. Through E, G and K it is a change of their
        # logarithms: the fraction.
        fractions = np.apply_along_axis(logarithmic_change, -1, self.values)
        slopes = abs(np.array([logarithmic_change(unit) for unit in np.eye(3)]))
        is_unknown = np.isnan(moduli)
        errors = np.where(is_unknown, 0, abs(self.errors))
        parts = np.where(is_unknown, 0, abs(self.values))
        # The slopes have the relative error of the moduli, the largest of which is added.
        modulus_errors = errors.sum(axis=(0, 1)) / np.where(is_unknown, 1, moduli)
        return fractions, np.asarray((errors + modulus_errors.max() * parts) @ slopes)


@dataclass(frozen=True, eq=False, repr=False)
class HomogenisedStiffness:
    """Effective stiffness of one cell, with declared errors, checks and cost.

    Args:
        curve: Homogenised stress over θ.
        method: Name of the model: prism, slices or series.
        solver: Name of the linear solver and its options, or "none".
        unknowns: Unknowns of one linear system after elimination of constraints.
        iterations: Iterations of the linear solver, one number per load.
        seconds: Wall time, in s, without that of the errors' reference.
        errors: Declared relative errors of the mean moduli by source (space, theta): of C11 + C12,
            C11 − C12 and C33, shape (3,), nan for a modulus that was not computed; empty where none
            were estimated.
        checks: Measured relative violation of each property that right results have, by name.
        cell: What was homogenised.
        average: Average that E and ν belong to, a name in `moduli.AVERAGES`.
        energies: Parts of the phases in the strain energy, for loss factors, where computed.

    Example:
        >>> from alphacut.rve import Phase, SeriesModel
        >>> from alphacut.stochastic import HermiteMap
        >>> radius = HermiteMap(0.2, 0.1, 0.6, 0.1)
        >>> [result] = SeriesModel().solve(radius, Phase(20e9), [Phase(80e9)])
        >>> f"{result.modulus / 1e9:.3f} GPa"
        '22.773 GPa'
    """

    curve: StressCurve
    method: str
    solver: str = "none"
    unknowns: int = 0
    iterations: tuple[int, ...] = ()
    seconds: float = 0.0
    errors: Mapping[str, Array] = field(default_factory=dict)
    checks: Mapping[str, float] = field(default_factory=dict)
    cell: Cell | None = None
    average: str = AXES
    energies: PhaseEnergies | None = None

    def with_average(self, average: str) -> HomogenisedStiffness:
        """Return a copy whose E and ν are those of another average of the plane stiffness.

        Args:
            average: "axes" for eq. 16 of the paper, with the shear modulus C33, or "isotropic" for
                Hill's mean over all directions of the plane.

        Raises:
            RefusedError: The name is another, or the average needs C11 − C12, which was not
                computed.
        """
        require_average(average)
        if average != AXES and self.stiffness is None:
            cure = "let the model make the whole plane stiffness"
            raise RefusedError("average", average, f"{AXES} without C11 − C12", cure)
        return replace(self, average=average)

    @property
    def convention(self) -> str:
        """Name, in words, of the average that E and ν belong to."""
        return AVERAGES[self.average]

    def __repr__(self) -> str:
        """Return a line with E, ν, the relative error of E if declared, the model and its time."""
        error = f"{self.estimated_error:.2g}" if self.errors else "not declared"
        return (
            f"HomogenisedStiffness(E = {self.modulus:.7g} Pa, ν = {self.poisson:.5g}"
            f" ({self.convention}), relative error of E {error},"
            f" by {self.method}, {self.seconds:.2g} s)"
        )

    @property
    def is_of_fibres(self) -> bool:
        """Whether the particles are round fibres, and both phases isotropic."""
        return self.cell is not None and self.cell.square

    @property
    def fractions(self) -> Array:
        """Mean fractions of the phases of the cell under f_Θ, matrix first, shape (2,).

        Raises:
            RefusedError: The cell is a mesh from a file, or a level set.
        """
        if self.cell is None:
            cure = "integrate them in the program that made the mesh"
            raise RefusedError("fractions", None, "a cell of a matrix and a particle", cure)
        return np.asarray(self.cell.fractions(self.curve.theta) @ self.curve.weights)

    @property
    def stiffness(self) -> Array | None:
        """Mean stiffness under f_Θ in the order of the curve's, in Pa, or None."""
        curve = self.curve
        if curve.stiffness is None:
            return None
        return np.asarray(np.tensordot(curve.weights, curve.stiffness, axes=1))

    @property
    def moduli(self) -> Array:
        """Mean C11 + C12, C11 − C12 (nan where not computed) and C33, shape (3,), in Pa."""
        if self.stiffness is not None:
            return square_moduli(self.stiffness)
        s11, s12 = self.curve.mean
        return np.array([s11, np.nan, s12 / 2]) / STRAIN

    def constants_of(self, moduli: Array) -> Array:
        """E in Pa and ν from the three moduli, shape (2,)."""
        return plane_constants(moduli, self.average)

    def shear_of(self, moduli: Array) -> float:
        """Shear modulus of the average from the three moduli, in Pa."""
        return float(shear_modulus(moduli, self.average))

    @property
    def modulus(self) -> float:
        """Young's modulus E of the average, in Pa."""
        return float(self.constants_of(self.moduli)[0])

    @property
    def poisson(self) -> float:
        """Poisson's ratio ν of the average."""
        return float(self.constants_of(self.moduli)[1])

    @property
    def has_isotropic_constants(self) -> bool:
        """Whether an isotropic solid has these moduli; in the plane if 2 G_T < 3 (C11 + C12)."""
        return self.modulus > 0

    @property
    def shear(self) -> float:
        """Shear modulus of the average, in Pa; of fibres it is G_T."""
        return self.shear_of(self.moduli)

    @property
    def modulus_errors(self) -> Array:
        """Declared relative errors of the three mean moduli, all sources, (3,); nan if unknown."""
        if not self.errors:
            return np.full(3, np.nan)
        # Errors of several sources are factors of a modulus, so that they are multiplied.
        return np.asarray(np.prod([1 + error for error in self.errors.values()], axis=0) - 1)

    @property
    def stiffness_errors(self) -> Array | None:
        """Declared absolute errors of the entries of the mean plane stiffness, shape (3, 3), in Pa.

        They follow from the relative errors of C11 + C12, C11 − C12 and C33, and are NaN where
        these are unknown. None without a plane stiffness.
        """
        C = self.stiffness
        if C is None or C.shape != (3, 3):
            return None
        sum_error, difference_error, shear_error = self.modulus_errors
        # C_kk is half of (C_kk + C12) + (C_kk − C12).
        axial = np.diag(C)[:2]
        by_sum = sum_error * abs(axial + C[0, 1])
        by_difference = difference_error * abs(axial - C[0, 1])
        diagonal = np.append((by_sum + by_difference) / 2, shear_error * C[2, 2])
        # Approximate fields can only have more energy, so that the error δC of the matrix is
        # positive semidefinite: |δC_ij| ≤ √(δC_ii δC_jj).
        return np.asarray(np.sqrt(np.outer(diagonal, diagonal)))

    def error_of(self, function: Callable[[Array], Array | float]) -> Array:
        """Return the declared absolute error of a function of the three moduli, in its shape.

        The function is to be monotone in each modulus within the errors.
        """
        return self._largest_change(function, self.modulus_errors)

    def _largest_change(self, function: Callable[[Array], Array | float], errors: Array) -> Array:
        """Return the largest change of a function of the moduli by their relative errors.

        Moduli that were not computed do not change.
        """
        known_errors = np.where(np.isnan(self.moduli), 0.0, errors)
        return largest_change(function, self.moduli, known_errors)

    @property
    def estimated_error(self) -> float:
        """Declared relative error of E, all sources together; nan if none was declared."""
        return self._error_of_modulus(self.modulus_errors)

    @property
    def error(self) -> dict[str, float]:
        """Declared relative error of E by source; empty if none is declared.

        Sources are "space", the cell at each θ, and "theta", the quadrature. The errors add up to
        `estimated_error`, that of all sources together; they are NaN if one is unknown.
        """
        errors = {name: self._error_of_modulus(part) for name, part in self.errors.items()}
        total = sum(errors.values())
        if total == 0:
            return errors
        # E is no linear function of the moduli: its errors by source are scaled to add up to its
        # whole error.
        return {name: self.estimated_error * error / total for name, error in errors.items()}

    @property
    def poisson_error(self) -> float:
        """Declared absolute error of ν; nan if none was declared."""
        return float(self.error_of(lambda moduli: self.constants_of(moduli)[1]))

    @property
    def largest_error(self) -> float:
        """Largest relative error of E and the moduli and absolute error of ν; nan if unknown."""
        if not self.errors:
            return float("nan")
        return float(np.nanmax([*self.modulus_errors, self.estimated_error, self.poisson_error]))

    def _error_of_modulus(self, errors: Array) -> float:
        """Return the relative error of Young's modulus E for given errors of the three moduli.

        It is the larger of E/E₀ − 1 and E₀/E − 1 at the corners of the box of the moduli, with E₀
        at its centre; infinite if E is not positive at a corner.

        Args:
            errors: Relative errors of C11 + C12, C11 − C12 and C33 (of spheres K, (C11 − C12)/2 and
                C44), shape (3,). Those of moduli that were not computed do not count; another NaN
                gives NaN.
        """
        modulus = self.modulus

        def ratios(moduli: Array) -> Array:
            """Return E/E₀ and E₀/E, which is infinite for E ≤ 0."""
            changed = float(self.constants_of(moduli)[0])
            inverse = modulus / changed if changed > 0 else np.inf
            return np.array([changed / modulus, inverse])

        return float(self._largest_change(ratios, errors).max())


def largest_change(
    function: Callable[[Array], Array | float], values: Array, errors: Array
) -> Array:
    """Return the largest change of a function at the corners of a box around its arguments.

    Args:
        function: Function of an array of n numbers, monotone in each of them over the box; its
            result is a number or an array.
        values: Centre of the box, positive, shape (n,).
        errors: Relative errors, shape (n,): each argument runs from value/(1 + error) to value·(1 +
            error). If one is NaN or infinite, all changes are NaN.

    Returns:
        Largest magnitudes of the changes, in the shape of the function's result.
    """
    value = np.asarray(function(values))
    if not np.isfinite(errors).all():
        return np.full(value.shape, np.nan)
    # A function that is monotone in each argument has its extremes at corners of the box.
    changes = []
    for signs in product((-1, 1), repeat=len(values)):
        changed = np.asarray(function(values * (1 + errors) ** np.array(signs)))
        changes.append(abs(changed - value))
    return np.asarray(np.max(changes, axis=0))
