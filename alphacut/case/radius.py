"""Sections on the random radius: its map over θ, or a fraction."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from alphacut.case.types import Quantity, Section, after, rising
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.refused import RefusedError
from alphacut.stochastic import HermiteMap, TruncatedNormal
from alphacut.stochastic.particles.particles import Shape

Radius = Annotated[FuzzyNumber, Quantity(above=0, below=1, fuzzy=True)]

Number = Annotated[FuzzyNumber, Quantity(fuzzy=True)]

Theta = Annotated[float, Quantity(minimum=-10, maximum=10)]


class ThetaSection(Section):
    """Law of θ alone, where a mesh from a file has the geometry."""

    theta: Annotated[tuple[Theta, Theta], after(rising)] = (-3.0, 3.0)
    """support of θ"""

    @property
    def law(self) -> TruncatedNormal:
        """Law of θ, a normal one cut off at both ends."""
        return TruncatedNormal(*self.theta)


class RadiusMapSection(ThetaSection):
    """Random radius of the particle over half the cell's side, a map of θ (the paper's eq. 12)."""

    a1: Radius = Field(description="radius at the lower end of θ")
    a3: Radius = Field(description="radius at the upper end of θ")
    a2: Number = Field(description="slope dr/dξ at the lower end")
    a4: Number = Field(description="slope dr/dξ at the upper end")

    @property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """Parameters of the map by name: the factors a1 … a4 of the functions of eq. 12."""
        return {"a1": self.a1, "a2": self.a2, "a3": self.a3, "a4": self.a4}

    def at(self, values: Mapping[str, float]) -> HermiteMap:
        """The map at crisp values of its parameters."""
        a1, a2, a3, a4 = (values[name] for name in self.numbers)
        return HermiteMap(a1, a2, a3, a4, self.law)

    def require_consistent(self) -> None:
        """Refuses supports of a1 … a4 for which the radius leaves (0, 1) at some θ."""
        # corners of the supports suffice, as the map is linear in a1 … a4
        for ends in itertools.product(*({*x.support} for x in self.numbers.values())):
            corner = dict(zip(self.numbers, ends, strict=True))
            try:
                self.at(corner)  # refuses such a map
            except RefusedError as error:
                raise RefusedError("radius", corner, error.allowed, error.cure) from None


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
        """Law of θ, on which nothing depends."""
        return TruncatedNormal(*self.theta)

    def at(self, values: Mapping[str, float]) -> HermiteMap:
        """The map at a crisp fraction."""
        radius = self.shape.reduced_radius(values["fraction"])
        return HermiteMap(radius, 0.0, radius, 0.0, self.law)


AnyRadius = RadiusMapSection | FractionMap
"""The random radius of a case, of [radius] or of cell.fraction."""
