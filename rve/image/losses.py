"""Proved bounds of loss factors: how much each phase's stiffness counts in the effective one.

An effective constant c that is a least energy over fields is concave in the moduli of the phases.
So with the moduli of one phase times 1 + t,

    [c(t) − c(0)]/t ≤ c′(0) ≤ [c(0) − c(−t)]/t   for any 0 < t < 1,

and bounds of c bound c′(0)/c(0), the phase's share of the energy. The loss factor is the mean of
the phases' by these shares, to first order in the loss factors; their squares are left out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.rve.image.bounds import StiffnessBounds, inverse_below
from alphacut.rve.image.fields.energy import UNIT
from alphacut.rve.image.model import ImageModel, ImageSolution
from alphacut.rve.image.phases import ModuliImages

MIN_CHANGE, MAX_CHANGE = 1e-6, 0.5
CURVATURE = 0.5  # −c″/c of two phases in series with equal shares is 1/2
ROUNDING = 64 * UNIT  # of quotients and differences, relative to 1/t


def concave_constants(bounds: StiffnessBounds, average: str) -> dict[str, tuple[float, float]]:
    """Bounds in Pa of constants that are least energies: E along axes, G and K of an average."""
    low, high = bounds.constants()[: bounds.dimension].T
    values = {f"E_{'xyz'[k]}": (float(low[k]), float(high[k])) for k in range(len(low))}
    return {**values, "G": bounds.shear(average), "K": bounds.bulk}


def energy_shares(
    model: ImageModel, solution: ImageSolution, images: ModuliImages, phase: Ints, n_phases: int
) -> dict[str, Array]:
    """Bounds of each phase's share of the energy, (phases, 2), by the name of the constant.

    Args:
        model: The model of the solution.
        solution: Solution of one image.
        images: Its moduli, the least equal to the greatest.
        phase: Number of the phase of each pixel or voxel.
        n_phases: Number of phases.
    """
    unchanged = concave_constants(solution.bounds, model.average)
    shares = {name: np.tile([0.0, 1.0], (n_phases, 1)) for name in unchanged}
    gap = max(high / low - 1 for low, high in unchanged.values())
    # the error gap/t + CURVATURE t/2 is least here
    t = float(np.clip(np.sqrt(2 * gap / CURVATURE), MIN_CHANGE, MAX_CHANGE))
    for k in range(n_phases):
        changed_lower = {}  # lower bounds of c(t) and c(−t)
        for change in (t, -t):
            factor = np.where(phase == k, 1 + change, 1.0)
            moduli = factor * images.bulk[0], factor * images.shear[0]
            stresses = model.solve_side(0, *moduli, solution.lower)
            assert stresses is not None  # phases that have losses are no pores
            below = inverse_below(stresses.energy.upper)
            bounds = concave_constants(StiffnessBounds(below, below), model.average)
            changed_lower[change] = {name: low for name, (low, _) in bounds.items()}
        for name, (low, high) in unchanged.items():
            # c′(0), and its share of c(0), which is within low … high
            least_slope = (changed_lower[t][name] - high) / t
            greatest_slope = (high - changed_lower[-t][name]) / t
            least = least_slope / (high if least_slope > 0 else low)
            greatest = greatest_slope / (low if greatest_slope > 0 else high)
            shares[name][k] = np.clip((least - ROUNDING / t, greatest + ROUNDING / t), 0, 1)
    return shares


def mean_loss(
    shares: Array, lowest: Sequence[float], highest: Sequence[float]
) -> tuple[float, float]:
    """Bounds of Σ share · loss, where the shares, within (phases, 2), sum to 1.

    Args:
        shares: Bounds of the shares.
        lowest: Least loss factor of each phase.
        highest: Greatest loss factor of each phase.
    """
    return _least_mean(shares, np.array(lowest)), -_least_mean(shares, -np.array(highest))


def _least_mean(shares: Array, losses: Array) -> float:
    """Least Σ share · loss: what the least shares leave goes to the phases of the least loss."""
    share, remaining = shares[:, 0].copy(), 1 - shares[:, 0].sum()
    for k in np.argsort(losses):
        added = min(remaining, shares[k, 1] - share[k])
        share[k], remaining = share[k] + added, remaining - added
    common = losses.min()  # equal losses are exact
    return float(common + share @ (losses - common) - ROUNDING * np.abs(losses).max())


def loss_of_young(bounds: StiffnessBounds, bulk: Array, shear: Array, average: str) -> Array:
    """Bounds of the loss factor of an average's E from those of its K and G, (levels, 2) each.

    Of E = 9 K G/(3 K + G), or G (3 − G/K) with the K of plane strain; positive by the bounds.
    """
    # d ln E = w d ln K + (1 − w) d ln G with w = G/(3 K + G), of the plane G/(3 K − G)
    (low_bulk, high_bulk), (low_shear, high_shear) = bounds.bulk, bounds.shear(average)
    sign = 1 if bounds.dimension == 3 else -1
    weights = [
        low_shear / (3 * high_bulk + sign * low_shear),
        high_shear / (3 * low_bulk + sign * high_shear),
    ]
    means = [w * k + (1 - w) * g for w in weights for k in bulk.T for g in shear.T]
    return np.stack([np.min(means, axis=0), np.max(means, axis=0)], axis=-1)
