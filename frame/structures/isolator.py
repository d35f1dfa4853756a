"""A bilinear isolator by its post-yield period and characteristic strength."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

from alphacut.base.errors import checked_number, require
from alphacut.fuzzy import Crisp, FuzzyNumber, Triangular


class BilinearIsolator(NamedTuple):
    """The isolated storey of a `StoreyFrame`, in SI units.

    Args:
        stiffness: Initial stiffness k, in N/m.
        yield_force: Force F_y at which it yields, in N.
        hardening: Stiffness after yielding over the initial one.

    Example:
        >>> storey = BilinearIsolator.of(400e3, period=2.5, strength=200e3, hardening=0.1)
        >>> round(storey.stiffness / 1e6, 2), round(storey.yield_force / 1e3, 1)
        (25.27, 222.2)
    """

    stiffness: float
    yield_force: float
    hardening: float

    @classmethod
    def of(
        cls, mass: float, *, period: float, strength: float, hardening: float = 0.1
    ) -> BilinearIsolator:
        """Return the isolator of a building.

        The stiffness after yielding, k_d = m (2π/T_d)², gives the mass m the period T_d; with the
        hardening a the initial one is k_d / a. The characteristic strength Q is the force at zero
        displacement on the branch of yielding, so that F_y = Q / (1 − a).

        Args:
            mass: Mass of all floors m, in kg.
            period: T_d, in s.
            strength: Q, in N.
            hardening: a, above 0 and below 1.

        Raises:
            RefusedError: A number is not positive, or the hardening is not below 1.
        """
        checked_number("mass", mass, positive=True)
        checked_number("period", period, positive=True)
        checked_number("strength", strength, positive=True)
        checked_number("hardening", hardening, positive=True)
        require(hardening < 1, "hardening", value=f"{hardening:g}", allowed="below 1")
        stiffness = mass * (2 * pi / period) ** 2 / hardening
        return cls(stiffness, strength / (1 - hardening), hardening)

    def storeys(
        self, above: int, factors: tuple[float, float], *, linked: bool
    ) -> dict[str, tuple[FuzzyNumber, ...]]:
        """Return numbers of a `StoreyFrame` on isolators, by the names of its arguments.

        Args:
            above: Number of storeys above the isolators, which stay elastic.
            factors: Smallest and largest property modification factor λ of stiffness and strength
                (ASCE 7, chapter 17).
            linked: Whether one factor holds for both, so that the stiffness alone is fuzzy.

        Returns:
            Stiffness of the isolated storey, and yield points and hardening of all storeys.
        """
        stiffness = _between(self.stiffness, factors)
        force = _between(self.yield_force, factors)
        # A storey of hardening 1 is elastic whatever its yield point is.
        storeys: dict[str, tuple[FuzzyNumber, ...]] = {
            "stiffness": (stiffness,),
            "hardening": (Crisp(self.hardening), *[Crisp(1.0)] * above),
        }
        if linked:  # a crisp yield drift: the yield force is proportional to the stiffness
            drift = Crisp(self.yield_force / self.stiffness)
            return storeys | {"yield_drift": (drift,) * (above + 1)}
        return storeys | {"yield_force": (force, *[Crisp(self.yield_force)] * above)}


def _between(nominal: float, factors: tuple[float, float]) -> FuzzyNumber:
    """Return the fuzzy number between both factors of a nominal value."""
    smallest, largest = factors
    if smallest == largest:
        return Crisp(nominal)
    return Triangular(smallest * nominal, nominal, largest * nominal)
