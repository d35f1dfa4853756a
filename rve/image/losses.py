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
from alphacut.rve.image.bounds import Enclosure, StiffnessBounds
from alphacut.rve.image.fields.energy import UNIT
from alphacut.rve.image.model import ImageModel, ImageSolution
from alphacut.rve.image.phases import ModuliImages

ROUNDING = 64 * UNIT  # quotients and differences take fewer than 64 rounded operations


def concave_constants(bounds: StiffnessBounds, average: str) -> dict[str, Enclosure]:
    """Return bounds in Pa of the effective Young's moduli along the axes, and of G and K.

    Each is the least energy under some load, or a mean of such energies, and so is concave in the
    moduli of the phases. Bounds of its derivatives follow from that.

    Args:
        bounds: Bounds of the effective stiffness.
        average: Average over directions of the plane for G, "axes" or "isotropic". In space G and K
            are those of Hill's average.

    Returns:
        Lower and upper bound by name: "E_x", "E_y" and, in space, "E_z"; then "G" and "K". Missing
        bounds are 0 and infinite.
    """
    # Young's moduli along the axes are the first rows of the constants, one for each axis.
    low, high = bounds.constants()[: bounds.dimension].T
    values = {f"E_{'xyz'[k]}": Enclosure(float(low[k]), float(high[k])) for k in range(len(low))}
    return {**values, "G": bounds.shear(average), "K": bounds.bulk}


def energy_fractions(
    model: ImageModel,
    solution: ImageSolution[StiffnessBounds],
    images: ModuliImages,
    phase: Ints,
    n_phases: int,
) -> dict[str, Array]:
    """Return bounds of the fraction of the strain energy that belongs to each phase, by constant.

    Let c(s) be an effective modulus with the moduli of one phase times s. As the least energy of a
    load it is concave in s, so that c′(1) lies between the slopes of its chords to 1 − t and to 1 +
    t. The fraction of the phase is c′(1)/c(1). With lower bounds of c(1 ± t) and an upper bound C
    of c(1) it lies between [c(1 + t)/C − 1]/t and [1 − c(1 − t)/C]/t.

    Args:
        model: Model by which `solution` was made and by which the changed images are solved.
        solution: Solution of an image whose upper and lower moduli are the same. Its solid
            percolates in all directions and no phase is rigid, so that both bounds of its constants
            are finite and positive; this is not checked. Its stresses are the first guess.
        images: Moduli of that image.
        phase: Number from 0 of the phase of each pixel or voxel, shape (y, x) or (z, y, x).
        n_phases: Number of phases.

    Returns:
        Lower and upper bound of the fraction of each phase, shape (phases, 2), within 0 and 1, for
        the constants "E_x", "E_y", "E_z" (of a volume), "G" and "K".

    Raises:
        FailedError: A solution does not converge.
    """
    unchanged = concave_constants(solution.bounds, model.average)
    fractions = {name: np.tile([0.0, 1.0], (n_phases, 1)) for name in unchanged}
    # Each quotient is off by at most gap/t + |c″/c| t/2, which is least at t = √(2 gap/|c″/c|). Of
    # two phases in series with equal fractions |c″/c| is 1/2. Any t in (0, 1) is proved; the limits
    # keep 1 − t positive, and `ROUNDING` small beside t.
    with np.errstate(divide="ignore"):  # of a lower bound that rounding has taken to 0
        gap = max(np.divide(ends.upper, ends.lower) - 1 for ends in unchanged.values())
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
    solution: ImageSolution[StiffnessBounds],
    images: ModuliImages,
    phase: Ints,
) -> dict[str, float]:
    """Return lower bounds in Pa of effective moduli, with the moduli of one phase times a factor.

    Args:
        factor: Positive factor of the bulk and the shear modulus.
        changed_phase: Number of the phase.
        model: Model by which the changed image is solved.
        solution: Solution of the unchanged image, whose stresses are the first guess.
        images: Moduli of the unchanged image, whose solid percolates in all directions.
        phase: Number of the phase of each pixel or voxel, shape (y, x) or (z, y, x).

    Returns:
        Bounds by name: "E_x", "E_y" and, of a volume, "E_z"; "G" of the average of `model`, and
        "K".

    Raises:
        FailedError: The solver does not converge.
    """
    factors = np.where(phase == changed_phase, factor, 1.0)
    # Only the lower bound is needed, which stresses give: half the work of both sides.
    stresses = model.solve_side(factors * images.lower, dual=True, start=solution.lower)
    bounds = concave_constants(StiffnessBounds(stresses.bound, stresses.bound), model.average)
    return {name: ends.lower for name, ends in bounds.items()}


def mean_loss(fractions: Array, lowest: Array, highest: Array) -> Enclosure:
    """Return bounds of the mean loss factor Σ_k fraction_k · loss_k over all phases k.

    The fractions sum to 1 and are known within bounds, as the loss factors are.

    Args:
        fractions: Lower and upper bound of each fraction, shape (phases, 2). The lower bounds sum
            to at most 1, the upper ones to at least 1.
        lowest: Lower bound of the loss factor of each phase, shape (phases,).
        highest: Upper bound of the loss factor of each phase, shape (phases,).
    """
    # `_min_mean` gives a lower bound of the least mean; the greatest is minus the least of minus.
    lower = _min_mean(fractions, np.asarray(lowest))
    return Enclosure(lower, -_min_mean(fractions, -np.asarray(highest)))


def _min_mean(fractions: Array, losses: Array) -> float:
    """Return the least Σ fraction · loss over fractions within bounds that sum to 1.

    This is a linear program with one equation. As in the fractional knapsack the greedy choice is
    optimal: from their lower bounds on, the fractions are raised to their upper bounds in the order
    of rising loss until their sum is 1. The result is lowered by a bound of its rounding error.

    Args:
        fractions: Lower and upper bound of each fraction, shape (phases, 2), within 0 and 1. The
            lower bounds sum to at most 1, the upper ones to at least 1.
        losses: Loss factor of each phase, of any sign, shape (phases,).
    """
    used = fractions[:, 0].copy()
    remaining = 1 - used.sum()
    for k in np.argsort(losses):
        added = min(remaining, fractions[k, 1] - used[k])
        used[k] += added
        remaining -= added
    # Taking the smallest loss out of the sum makes the mean of equal losses exact: it counts
    # Σ fraction = 1 times, whatever rounding leaves of that sum.
    common = losses.min()
    return float(common + used @ (losses - common) - ROUNDING * np.abs(losses).max())


def loss_of_young(bounds: StiffnessBounds, losses: Mapping[str, Array], average: str) -> Array:
    """Return bounds of the loss factor of Young's modulus E of an average, shape (levels, 2).

    E is 9 K G/(3 K + G), or G (3 − G/K) with the K of plane strain. So d ln E = w d ln K + (1 − w)
    d ln G with w = G/(3 K + G) or, in the plane, w = G/(3 K − G). The loss factor of E is the mean
    of the loss factors of K and G with the same weights, to first order. It is bilinear in w and
    the loss factors, so that it is extreme at their ends.

    Args:
        bounds: Bounds of the stiffness, both present, by which K and G are positive and, in the
            plane, G < 3 K.
        losses: Lower and upper bound of the loss factors of "K" and "G" at each α-level, shape
            (levels, 2) each.
        average: In the plane, "axes" or "isotropic": the average over directions that E is of.

    Returns:
        Lower and upper bound at each level.
    """
    min_bulk, max_bulk = bounds.bulk
    min_shear, max_shear = bounds.shear(average)
    sign = 1 if bounds.dimension == 3 else -1
    # In both formulas w rises with G and falls with K.
    min_weight = min_shear / (3 * max_bulk + sign * min_shear)
    max_weight = max_shear / (3 * min_bulk + sign * max_shear)
    values = [
        w * of_bulk + (1 - w) * of_shear
        for w in (min_weight, max_weight)
        for of_bulk in losses["K"].T
        for of_shear in losses["G"].T
    ]
    return np.stack([np.min(values, axis=0), np.max(values, axis=0)], axis=-1)
