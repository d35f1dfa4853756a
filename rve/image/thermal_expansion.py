"""Thermal stress and expansion of a periodic cell, from bounds of its stiffness.

The phases are isotropic. With c I = C : I of a phase (c = 3 K, or in plane strain 2 (K + G/3)) and
a = α (in plane strain (1 + ν) α, since nothing expands along z), heating by 1 K at zero strain
gives a phase the pressure b = c a. Of the cell, β̄ is the stress that holds it at zero mean strain,
with the sign of a pressure, and ᾱ = S̄ : β̄ its mean strain without mean stress; S̄ inverts C̄.

For any numbers m and w, superposition of the uniform strain m I, or of the uniform pressure w I,
leaves a cell with the pressures b − m c, or with the free strains a − w/c. With means ⟨⟩ by
fractions

    β̄ = m C̄ : I + ⟨b − m c⟩ I + δ,    ᾱ = w S̄ : I + ⟨a − w/c⟩ I + δ′.

Uniform trial fields bound the quadratic form of strain and temperature, as Rosen and Hashin (Int.
J. Eng. Sci. 8, 157, 1970) did: for any x and r, in n = 2 or 3 dimensions,

    (x·δ)² ≤ x·(⟨C⟩ − C̄) x n ⟨(b − m c − r)²/c⟩,
    (x·δ′)² ≤ x·(⟨S⟩ − S̄) x n ⟨(a − w/c − r)² c⟩,

and C̄ ≥ ⟨S⟩⁻¹, S̄ ≥ ⟨C⟩⁻¹. Both lines are one formula, in c and in 1/c. Two phases of different c
lie on one line b = m c + r: then δ and δ′ are 0, whatever the geometry and the fractions (Levin,
Mech. Solids 2 (1), 58, 1967), and the results are as narrow as C̄ : I and S̄ : I. With m = 0 nothing
is divided by a difference of moduli. Several m and w between these are taken; each is proved, and
so is what they have in common.

Phases of equal c: C̄ : I = c I, so that x = I leaves no δ. The mean of β̄ over the axes is then ⟨b⟩,
and that of ᾱ is ⟨a⟩. Along single axes they differ from it in a cell without cubic symmetry, if the
phases differ in G.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, RefusedError, require, require_ordered
from alphacut.fuzzy import FuzzyNumber
from alphacut.rve.image.bounds import StiffnessBounds, inverse_above, inverse_below
from alphacut.rve.image.fields.energy import SAFETY, UNIT
from alphacut.rve.image.model import nested
from alphacut.rve.image.study import FuzzyImageStiffness, ImagePhase, as_fuzzy
from alphacut.rve.result.result import HomogenisedStiffness

ROUNDING = 64 * UNIT
"""Sums of fewer than 64 rounded products are off by at most this fraction of their magnitudes."""


@dataclass(frozen=True, eq=False)
class ThermalBounds:
    """Bounds of the thermal stress and of the thermal expansion of a cell.

    The last axis of both arrays is the lower and the upper bound. The axis before holds the
    components in Voigt's order (of space 11, 22, 33, 23, 13, 12; of the plane 11, 22, 12; strains
    with 2 ε12), and then the mean of the normal ones. α-levels, if any, are the first axis.

    Args:
        stress: Stress β̄ that holds the cell at zero mean strain, in Pa/K, positive for a pressure
            on heating; shape (…, components + 1, 2). In the plane ε33 = 0 throughout, and the
            stress σ33 is not told.
        expansion: Mean strain ᾱ without mean stress, in 1/K, of the same shape. In the plane the
            stress in the plane has no mean, and ε33 = 0: nothing expands along z, so that a
            homogeneous cell has ᾱ = (1 + ν) α.

    Raises:
        FailedError: A lower bound is above its upper one, or a bound is NaN.
    """

    stress: Array
    expansion: Array

    def __post_init__(self) -> None:
        """Check the ends."""
        require_ordered("the thermal stress", self.stress[..., 0], self.stress[..., 1])
        require_ordered("the thermal expansion", self.expansion[..., 0], self.expansion[..., 1])


def thermal_bounds(
    bounds: StiffnessBounds,
    phases: Sequence[Mapping[str, FuzzyNumber | float]],
    expansions: Sequence[FuzzyNumber | float],
    *,
    fractions: Sequence[float] | Array | None = None,
    level: float = 1.0,
) -> ThermalBounds:
    """Return bounds of the thermal stress and expansion of a periodic cell of isotropic phases.

    They are as guaranteed as `bounds`. For two crisp phases with different c = 3 K (in the plane
    2 (K + G/3)) they narrow as these do; for others they stay apart. Of fuzzy values the cuts
    count, within which a phase has one value of each in the whole cell. Expansions are taken at the
    corners of their box, which loses nothing. Moduli, the stiffness and, in the plane, the ν in
    (1 + ν) α are taken as if each varied alone, which widens the result.

    Args:
        bounds: Bounds of the stiffness for all phases in the cuts; the upper one is finite.
        phases: "modulus" in Pa, 0 of a pore, and "poisson" of each, numbers or fuzzy numbers.
        expansions: Coefficient of thermal expansion α of each, in 1/K; that of a pore is not used.
        fractions: Fraction of each phase, above 0 with the sum 1; None where they are not known, in
            which case only two phases with c apart have useful bounds.
        level: α-level of the cuts.

    Returns:
        `stress` and `expansion`, shape (components + 1, 2) each. Beside pores the expansion is that
        of the only solid phase, or has infinite bounds where there are several.

    Raises:
        RefusedError: A value is missing or not allowed, or a phase is rigid.
        FailedError: No cell of these phases has such a stiffness, or a bound is singular to
            rounding.

    Example:
        >>> phases = [{"modulus": 3e9, "poisson": 0.35}, {"modulus": 70e9, "poisson": 0.2}]
        >>> stiffness = np.array([[12e9, 4e9, 0], [4e9, 10e9, 0], [0, 0, 3e9]])  # known exactly
        >>> known = StiffnessBounds(stiffness, stiffness)
        >>> thermal = thermal_bounds(known, phases, [60e-6, 5e-6])
        >>> [round(float(low) * 1e6, 2) for low, high in thermal.expansion]  # 11, 22, 12, mean
        [34.51, 46.07, -0.0, 40.29]
    """
    n = bounds.dimension
    counts = len(phases), len(expansions)
    require(counts[0] == counts[1] > 0, "expansions", counts[1], "one for each phase")
    require(bounds.has_upper, "bounds", "without an upper one", "those beside no rigid phase")
    weights = None
    if fractions is not None:
        weights = np.asarray(fractions, float)
        is_whole = weights.shape == counts[:1] and weights.min() > 0
        is_whole = is_whole and abs(weights.sum() - 1) < ROUNDING
        require(bool(is_whole), "fractions", fractions, "one above 0 for each phase, of sum 1")

    moduli = []
    strains = []
    for values, expansion in zip(phases, expansions, strict=True):
        phase = ImagePhase.of(values)
        moduli.append(phase.interval(level, n).moduli)
        factors: Array = np.zeros(2)
        if n == 2:
            factors = np.array(phase.poisson.cut(level))
        corners = np.outer(1 + factors, as_fuzzy("expansion", expansion).cut(level))
        strains.append([corners.min(), corners.max()])
    # The intervals are widened by the rounding of their ends, and of what is made of these.
    c, shear = np.moveaxis(np.array(moduli), -1, 0) * [1 - ROUNDING, 1 + ROUNDING]
    c = n * c
    free = np.array(strains)
    free += ROUNDING * abs(free) * [-1, 1]
    is_solid = c[:, 1] > 0

    above = np.full_like(bounds.lower, np.inf)
    if bounds.has_lower:
        above = inverse_above(bounds.lower)
    stiff = _Tensor(bounds.lower, bounds.upper, c, shear, weights, deviator_factor=2.0)
    found = []
    with np.errstate(divide="ignore", invalid="ignore"):  # of pores
        below = inverse_below(bounds.upper)
        soft = _Tensor(below, above, 1 / c, 1 / shear, weights, deviator_factor=0.5)
        # Both results are linear in the expansions, so that they are extreme at corners.
        for corner in product(*free):
            a = np.repeat(corner, 2).reshape(c.shape)
            found.append([stiff.response(c * a), soft.response(a)])
    lower, upper = np.moveaxis(np.array(found), -1, 0)
    ends = np.stack([lower.min(axis=0), upper.max(axis=0)], axis=-1)
    if is_solid.sum() == 1 < len(phases):
        # The only solid phase expands freely, by a uniform strain.
        ends[1] = 0.0
        ends[1, [*range(n), -1]] = free[is_solid]
        ends[1, -1] *= n
    if not (ends[..., 0] <= ends[..., 1]).all():
        what = "the bounds of the stiffness are of no cell of these phases and fractions"
        raise FailedError(what, "give the phases that the stiffness was computed with")
    ends[:, -1] /= n  # from x = I to the mean of the normal components
    return ThermalBounds(*ends)


def declared_bounds(result: HomogenisedStiffness) -> StiffnessBounds:
    """Return (1 ∓ e) C̄ with the largest declared relative error e of the moduli of a result.

    They are estimated, as the declared errors are. `thermal_bounds` takes them with the phases and
    fractions of the cell, also where these are means over θ.

    Raises:
        RefusedError: The result has no whole stiffness, or declares no errors.
    """
    stiffness = result.stiffness
    error = result.modulus_errors.max()
    cure = "let the model make both, or take StiffnessBounds(C, C)"
    if stiffness is None or not np.isfinite(error):
        raise RefusedError("result", "without its stiffness or errors", "one with both", cure)
    return StiffnessBounds((1 - error) * stiffness, (1 + error) * stiffness)


def fuzzy_thermal_bounds(
    stiffness: FuzzyImageStiffness,
    phases: Sequence[Mapping[str, FuzzyNumber | float]],
    expansions: Sequence[FuzzyNumber | float],
) -> ThermalBounds:
    """Return proved bounds of the thermal stress and expansion of an image at its α-levels.

    Args:
        stiffness: Bounds of the stiffness of the image.
        phases: The phases that these were computed with, in the same order.
        expansions: Coefficient of thermal expansion α of each, in 1/K.

    Returns:
        Bounds at each level, nested, shape (levels, components + 1, 2) each; see `thermal_bounds`.
        The fractions are used where the thresholds are crisp.

    Raises:
        RefusedError: As `thermal_bounds`.
        FailedError: As `thermal_bounds`.
    """
    fractions = None
    if not stiffness.is_open.any():
        fractions = list(stiffness.fractions.values())
    found = []
    for level, cut in zip(stiffness.alpha[::-1], stiffness.cuts[::-1], strict=True):
        thermal = thermal_bounds(
            cut.bounds, phases, expansions, fractions=fractions, level=float(level)
        )
        found.append(np.array([thermal.stress, thermal.expansion]))
    return ThermalBounds(*np.swapaxes(nested(found)[::-1], 0, 1))


@dataclass(frozen=True, eq=False)
class _Tensor:
    """A stiffness or compliance T of a cell, with what the phases give to it.

    Args:
        lower: Lower bound of T in the Loewner order, in Voigt's, shape (components, components).
        upper: Upper bound, infinite where there is none.
        moduli: Lower and upper c of each phase for a stiffness, shape (phases, 2); for a compliance
            1/c, whose ends are those of the same c.
        shear: G, or 1/G, of the same shape.
        fractions: Fractions of the phases; None if unknown.
        deviator_factor: 2 for a stiffness, 1/2 for a compliance: what multiplies G or 1/G in x·T x
            for a deviator x without shear.
    """

    lower: Array
    upper: Array
    moduli: Array
    shear: Array
    fractions: Array | None
    deviator_factor: float

    def response(self, values: Array) -> Array:
        """Return bounds of x·β̄ for a stiffness, or of x·ᾱ for a compliance, shape (rows, 2).

        The rows x are the unit vectors and I, in Voigt's order.

        Args:
            values: Pressure b, or free strain a, of each phase, at both ends of its modulus, shape
                (phases, 2). Between these it is linear in the modulus, or in its inverse.
        """
        size = len(self.lower)
        n = size // 3 + 1
        identity = np.repeat([1.0, 0.0], [n, size - n])
        rows = np.vstack([np.eye(size), identity])
        trace = rows @ identity
        if not (np.isfinite(self.upper).all() and np.isfinite(self.moduli).all()):
            return np.tile([-np.inf, np.inf], (size + 1, 1))
        # With D = upper − lower, |x·(T − (lower + upper)/2) I| ≤ √(x·D x) √(I·D I)/2.
        difference = self.upper - self.lower
        widths = np.einsum("ri,ij,rj->r", rows, difference, rows)
        # D is positive semidefinite: rounding of its entries is below that of its diagonal.
        widths = np.maximum(widths + ROUNDING * rows @ np.diagonal(difference), 0)
        radius = SAFETY * np.sqrt(widths * widths[-1]) / 2
        radius += ROUNDING * rows @ (abs(self.lower) + abs(self.upper)) @ identity
        middle = rows @ (self.lower + self.upper) @ identity / 2
        # ⟨T⟩ − T ≤ ⟨T⟩ − ⟨T⁻¹⟩⁻¹, which is isotropic.
        by_trace = trace**2 / n
        by_shear = self.deviator_factor * (trace - by_trace)
        by_shear[n:size] = 1.0
        gap = by_trace * self._excess(self.moduli) + by_shear * self._excess(self.shear)

        # The regression line of the values over the moduli, with weights 1/modulus, leaves the
        # least remainder; it passes through the origin where there are pores, whose weight is
        # infinite and whose terms, not numbers, are left out.
        y = values.mean(axis=1)
        k = self.moduli.mean(axis=1)
        weights = np.ones(len(k)) if self.fractions is None else self.fractions
        weights = weights / k
        offset = k - np.nan_to_num(weights @ k / weights.sum())
        variance = np.nansum(weights * offset**2)
        best = 0.0
        if variance > 0:
            best = np.nansum(weights * offset * y) / variance
        found = []
        for slope in best * np.linspace(0, 1, 9):  # any slope is proved
            rest = values - slope * self.moduli
            center = np.nan_to_num(weights @ rest.mean(axis=1) / weights.sum())
            margin = ROUNDING * (abs(values) + abs(slope) * self.moduli + abs(center))
            # The squares over the moduli are convex in these: largest at an end. A pore has none.
            squares = (abs(rest - center) + margin) ** 2 / self.moduli
            squares = np.nan_to_num(squares, posinf=np.inf)
            remainder = SAFETY * np.sqrt(n * gap * self._mean(squares))
            constant = np.array([-self._mean(margin - rest), self._mean(margin + rest)])
            total = (1 + ROUNDING) * (abs(slope) * radius + remainder)
            ends = np.outer(trace, constant) + np.stack([-total, total], axis=-1)
            found.append((slope * middle)[:, np.newaxis] + ends)
        lower, upper = np.moveaxis(np.array(found), -1, 0)
        return np.stack([lower.max(axis=0), upper.min(axis=0)], axis=-1)

    def _mean(self, ends: Array) -> float:
        """Return the mean over the phases of the larger ends, or the largest, (phases, 2)."""
        largest = ends.max(axis=1)
        if self.fractions is None:
            return float(largest.max())
        return float(self.fractions @ largest)

    def _excess(self, values: Array) -> float:
        """Return an upper bound of ⟨y⟩ − 1/⟨1/y⟩ for values y ≥ 0 within ends, (phases, 2).

        It is ⟨(y − h)²/y⟩ with h = 1/⟨1/y⟩, and at most that for any other h: a sum of squares,
        which does not suffer from cancellation.
        """
        h = 1 / self._mean(1 / values)  # 0 beside pores
        return self._mean(np.nan_to_num(values * (1 - h / values) ** 2, posinf=np.inf))
