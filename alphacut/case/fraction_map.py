"""The radius map of cells whose particles all take the same fraction: crisp over θ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from alphacut.fuzzy import FuzzyNumber
from alphacut.stochastic import HermiteMap, TruncatedNormal
from alphacut.stochastic.particles.particles import Shape


@dataclass(frozen=True)
class FractionMap:
    """Radius map of particles that take the same `fraction` of the cell at all θ."""

    fraction: FuzzyNumber
    shape: Shape
    theta: tuple[float, float] = (-3.0, 3.0)

    @property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """Parameters of the map by name."""
        return {"fraction": self.fraction}

    @property
    def law(self) -> TruncatedNormal:
        """Law of θ, a normal one cut off at both ends."""
        return TruncatedNormal(*self.theta)

    @property
    def largest_radius(self) -> float:
        """Largest radius of the support."""
        return float(self.shape.reduced_radius(self.fraction.support.upper))

    def at(self, values: Mapping[str, float]) -> HermiteMap:
        """The map at a crisp fraction."""
        radius = self.shape.reduced_radius(values["fraction"])
        return HermiteMap(radius, 0.0, radius, 0.0, self.law)
