"""Damping ratios of a structure from the loss factor of its material."""

from __future__ import annotations

from math import atan, sin

from alphacut.base.errors import checked_number
from alphacut.fuzzy import Crisp, FuzzyNumber, PiecewiseLinear


def damping_from_loss(
    loss: FuzzyNumber | float, *, joints: FuzzyNumber | float = 0.0, energy_fraction: float = 1.0
) -> FuzzyNumber:
    """Return the damping ratio ζ = sin(½ arctan(w η)) of a mode in free oscillation, plus joints.

    Args:
        loss: Loss factor η of the material's Young's modulus, not negative.
        joints: Damping ratio of the joints, which is added.
        energy_fraction: Fraction w of the mode's strain energy that is in the material.

    Returns:
        ζ as a fuzzy number, whose α-cuts are exact at the levels of both numbers and linear between
        them; a crisp number if neither argument has a width.

    Raises:
        RefusedError: `energy_fraction` is not within [0, 1].

    Example:
        >>> from alphacut.fuzzy import Triangular
        >>> ratio = damping_from_loss(Triangular(0.01, 0.02, 0.04), joints=0.01)
        >>> round(ratio.support.lower, 4), round(ratio.support.upper, 4)
        (0.015, 0.03)
    """
    checked_number("energy_fraction", energy_fraction, least=0, most=1)
    numbers = {"loss": loss, "joints": joints}
    fuzzy = {
        name: number if isinstance(number, FuzzyNumber) else Crisp(number)
        for name, number in numbers.items()
    }

    # A mass on a spring k (1 + i η) has λ² = −ω² (1 + i η), so that ζ = −Re λ / |λ| is
    # sin(½ arctan η). The loss factor of a mode is w η, if the fraction w of its strain energy is
    # in the material (Ungar and Kerwin, J. Acoust. Soc. Am. 34, 954, 1962).
    def ratio(loss_factor: float, of_joints: float) -> float:
        return sin(atan(energy_fraction * loss_factor) / 2) + of_joints

    if all(number.support.width == 0 for number in fuzzy.values()):
        return Crisp(ratio(fuzzy["loss"].nominal, fuzzy["joints"].nominal))
    alpha = sorted(set(fuzzy["loss"].cuts.alpha) | set(fuzzy["joints"].cuts.alpha))
    lower: list[float] = []
    upper: list[float] = []
    for level in alpha:
        # ζ rises with both numbers, so that the ends of their α-cuts give its ends
        loss_cut = fuzzy["loss"].cut(level)
        joints_cut = fuzzy["joints"].cut(level)
        lower.append(ratio(loss_cut.lower, joints_cut.lower))
        upper.append(ratio(loss_cut.upper, joints_cut.upper))
    return PiecewiseLinear(tuple(alpha), tuple(lower), tuple(upper))
