"""Proved bounds of loss factors: how much each phase's stiffness counts in the effective one.

An effective constant c that is a least energy over fields is concave in the moduli of the phases.
So with the moduli of one phase times 1 + t,

    [c(t) − c(0)]/t ≤ c′(0) ≤ [c(0) − c(−t)]/t   for any 0 < t < 1.

The fraction of the energy that belongs to the phase is c′(0)/c(0). Divided by c(0), the left side
falls with c(0) and the right side rises with it. So with lower bounds of c(t) and c(−t) and the
upper bound C of c(0)

    [c(t)/C − 1]/t ≤ c′(0)/c(0) ≤ [1 − c(−t)/C]/t.

The loss factor is the mean of those of the phases by these fractions, to first order in the loss
factors; their squares are left out.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.rve.image.bounds import Enclosure, StiffnessBounds, inverse_below
from alphacut.rve.image.fields.energy import UNIT
from alphacut.rve.image.model import ImageModel, ImageSolution
from alphacut.rve.image.phases import ModuliImages

ROUNDING = 64 * UNIT
"""Bound of the rounding of quotients and differences, derived by counting operations."""


def concave_constants(bounds: StiffnessBounds, average: str) -> dict[str, Enclosure]:
    """Return bounds in Pa of constants that are least energies, by name.

    They are E along the axes, and G and K of an average of the plane, or of Hill's average.
    """
    low, high = bounds.constants()[: bounds.dimension].T
    values = {f"E_{'xyz'[k]}": Enclosure(float(low[k]), float(high[k])) for k in range(len(low))}
    return {**values, "G": bounds.shear(average), "K": bounds.bulk}


def energy_fractions(
    model: ImageModel, solution: ImageSolution, images: ModuliImages, phase: Ints, n_phases: int
) -> dict[str, Array]:
    """Return bounds of the fraction of the energy that belongs to each phase.

    Args:
        model: Model of the solution.
        solution: Solution of one image without pores, whose upper and lower moduli are the same.
        images: Its moduli.
        phase: Number of the phase of each pixel or voxel.
        n_phases: Number of phases.

    Returns:
        Bounds by the name of the constant, shape (phases, 2) each.
    """
    unchanged = concave_constants(solution.bounds, model.average)
    fractions = {name: np.tile([0.0, 1.0], (n_phases, 1)) for name in unchanged}
    # Each quotient is off by at most gap/t + |c″/c| t/2, which is least at t = √(2 gap/|c″/c|). Of
    # two phases in series with equal fractions |c″/c| is 1/2. Any t is proved.
    gap = max(ends.upper / ends.lower - 1 for ends in unchanged.values())
    t = float(np.clip(np.sqrt(2 * gap / 0.5), 1e-6, 0.5))
    for k in range(n_phases):
        stiffer = _lower_bounds_with(1 + t, k, model, solution, images, phase)
        softer = _lower_bounds_with(1 - t, k, model, solution, images, phase)
        for name, ends in unchanged.items():
            lower = (stiffer[name] / ends.upper - 1 - ROUNDING) / t
            upper = (1 - softer[name] / ends.upper + ROUNDING) / t
            fractions[name][k] = np.clip((lower, upper), 0, 1)
    return fractions


def _lower_bounds_with(
    factor: float,
    changed_phase: int,
    model: ImageModel,
    solution: ImageSolution,
    images: ModuliImages,
    phase: Ints,
) -> dict[str, float]:
    """Return lower bounds of the constants with the moduli of one phase times a factor."""
    factors = np.where(phase == changed_phase, factor, 1.0)
    stresses = model.solve_side(factors * images.lower, stress=True, start=solution.lower)
    assert stresses is not None  # None beside pores alone
    stiffness = inverse_below(stresses.energy.upper)
    bounds = concave_constants(StiffnessBounds(stiffness, stiffness), model.average)
    return {name: ends.lower for name, ends in bounds.items()}


def mean_loss(fractions: Array, lowest: Array, highest: Array) -> Enclosure:
    """Return bounds of Σ fraction · loss, where the fractions sum to 1.

    Args:
        fractions: Bounds of the fraction of each phase, shape (phases, 2).
        lowest: Lower bound of the loss factor of each phase.
        highest: Upper bound of it.
    """
    lower = _min_mean(fractions, np.asarray(lowest))
    return Enclosure(lower, -_min_mean(fractions, -np.asarray(highest)))


def _min_mean(fractions: Array, losses: Array) -> float:
    """Return the least Σ fraction · loss over fractions within bounds that sum to 1.

    It is attained where phases take as much as they can in the order of rising loss, and the others
    their smallest fraction.
    """
    # a linear program of one equation: the greedy order is optimal, as of the fractional knapsack
    used = fractions[:, 0].copy()
    remaining = 1 - used.sum()
    for k in np.argsort(losses):
        added = min(remaining, fractions[k, 1] - used[k])
        used[k] += added
        remaining -= added
    common = losses.min()  # taken out, so that equal losses are exact
    return float(common + used @ (losses - common) - ROUNDING * np.abs(losses).max())


def loss_of_young(bounds: StiffnessBounds, losses: Mapping[str, Array], average: str) -> Array:
    """Return bounds of the loss factor of E of an average, shape (levels, 2).

    E is 9 K G/(3 K + G), or G (3 − G/K) with the K of plane strain. So d ln E = w d ln K +
    (1 − w) d ln G with w = G/(3 K + G) or, in the plane, w = G/(3 K − G). The sum is bilinear in w
    and the loss factors, so that it is extreme at their ends.

    Args:
        bounds: Bounds of the stiffness, by which E is positive.
        losses: Bounds of the loss factors of "K" and "G", shape (levels, 2) each.
        average: Average of the plane.
    """
    min_bulk, max_bulk = bounds.bulk
    min_shear, max_shear = bounds.shear(average)
    sign = 1 if bounds.dimension == 3 else -1
    min_weight = min_shear / (3 * max_bulk + sign * min_shear)
    max_weight = max_shear / (3 * min_bulk + sign * max_shear)
    values = [
        w * of_bulk + (1 - w) * of_shear
        for w in (min_weight, max_weight)
        for of_bulk in losses["K"].T
        for of_shear in losses["G"].T
    ]
    return np.stack([np.min(values, axis=0), np.max(values, axis=0)], axis=-1)
