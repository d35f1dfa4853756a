"""Sections on the random radius: its map, a fraction, or particles packed, measured or seen."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Self

from pydantic import Field, model_validator

from alphacut.case.types import (
    CaseFile,
    Fraction,
    Length,
    Quantity,
    Section,
    after,
    rising,
)
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.stochastic import HermiteMap, TruncatedNormal
from alphacut.stochastic.microstructure import MicrostructureStudy
from alphacut.stochastic.particles.circles_csv import CircleFile
from alphacut.stochastic.particles.image import SectionImage
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.particles import DISCS, SPHERES, Shape
from alphacut.stochastic.particles.radius_laws import LogNormalRadii, MeasuredRadii, RadiusLaw
from alphacut.stochastic.sections import Simulated

Radius = Annotated[FuzzyNumber, Quantity(above=0, below=1, fuzzy=True)]

Number = Annotated[FuzzyNumber, Quantity(fuzzy=True)]

Theta = Annotated[float, Quantity(least=-10, most=10)]


class ThetaSection(Section):
    """Law of θ alone, where a mesh from a file has the geometry."""

    theta: Annotated[tuple[Theta, Theta], after(rising)] = Field(
        default=(-3.0, 3.0), description="support of θ"
    )

    @property
    def law(self) -> TruncatedNormal:
        """Law of θ, a normal one cut off at both ends."""
        return TruncatedNormal(*self.theta)


class RadiusMapSection(ThetaSection):
    """Random radius of the particle over half the cell's side, as a map of θ (eq. 12)."""

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

    @property
    def largest_radius(self) -> float:
        """Largest radius at the corners of the supports."""
        corners = itertools.product(*(x.support for x in self.numbers.values()))
        maps = (self.at(dict(zip(self.numbers, corner, strict=True))) for corner in corners)
        return max(radius.extremes()[1] for radius in maps)

    @model_validator(mode="after")
    def _check_range(self) -> Self:
        """Refuses supports of a1 … a4 for which the radius leaves (0, 1) at some θ."""
        # corners of the supports suffice, as the map is linear in a1 … a4
        for corner in itertools.product(*({*x.support} for x in self.numbers.values())):
            values = dict(zip(self.numbers, corner, strict=True))
            try:
                self.at(values)  # refuses such a map
            except RefusedError as error:
                raise RefusedError("radius", values, error.allowed, error.cure) from None
        return self


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


class PackingSection(Section):
    """Particles packed at random in a periodic box: discs, or spheres where the cell has spheres.

    Radii are log-normal between two ends (eq. 11), or those of a file.
    """

    packings: Annotated[int, Quantity(least=5, most=10_000, is_integer=True)] = Field(
        default=20, description="independent packings"
    )
    particles: Annotated[int, Quantity(least=10, most=1_000_000, is_integer=True)] = Field(
        description="particles in each packing"
    )
    fraction: Annotated[float, Quantity(above=0, below=0.84)] = Field(
        description="area fraction, or volume fraction, of the particles"
    )
    smallest_radius: Length | None = Field(default=None, description="lower end of the radii")
    largest_radius: Length | None = Field(default=None, description="upper end of the radii")
    file: CaseFile | None = Field(
        default=None, description="CSV file of radii or diameters, a column r [mm] or d [mm]"
    )

    def source(self, spheres: bool) -> Simulated:
        """The random packings to be computed: of spheres, or else of discs."""
        if self.file is None:
            ends = self.smallest_radius or 0.0, self.largest_radius or 0.0  # both were required
            radii: RadiusLaw = LogNormalRadii(*ends)
        else:
            radii = MeasuredRadii.read(self.file)
        shape = SPHERES if spheres else DISCS
        fits, key = self.fraction <= shape.densest, "microstructure.packing.fraction"
        allowed = f"shares up to {shape.densest:g} of {shape.particles} packed at random"
        cure = f"set cell.fraction = {self.fraction:g} in place of [microstructure]"
        require(fits, key, value=self.fraction, allowed=allowed, cure=cure)
        packing = Packing(self.particles, self.fraction, radii, shape=shape)
        return Simulated(packing, self.packings)

    @model_validator(mode="after")
    def _check_radii(self) -> Self:
        """Refuses a file of radii beside their ends, and one end alone or none without a file."""
        ends = (self.smallest_radius, self.largest_radius)
        fits = None not in ends if self.file is None else ends == (None, None)
        key, allowed = "microstructure.packing.file", "a file, or both ends of the radii"
        require(fits, key, value="beside or without ends", allowed=allowed)
        return self


class Circles(Section):
    """Measured circles from a CSV file with the columns x, y, r."""

    file: CaseFile = Field(description="CSV file with the header x [mm], y [mm], r [mm]")
    size: tuple[Length, Length] = Field(description="width and height of the section")

    def source(self, spheres: bool) -> CircleFile:
        """The circles of the file."""
        return CircleFile(self.file, self.size)


class Photograph(Section):
    """Circles segmented from the image of a section."""

    file: CaseFile = Field(description="image file")
    pixel: Length = Field(description="side of a pixel")

    def source(self, spheres: bool) -> SectionImage:
        """The circles in the image."""
        return SectionImage(self.file, self.pixel)


class MicrostructureSection(Section):
    """Particles from which the random radius comes: one of packing, circles and image."""

    seed: Annotated[int, Quantity(least=0, most=1e18, is_integer=True)] = Field(
        description="seed of everything left to chance"
    )
    limits: Annotated[tuple[Fraction, Fraction], after(rising)] | None = Field(
        default=None, description="lower and upper limit of r/a"
    )
    packing: PackingSection | None = None
    circles: Circles | None = None
    image: Photograph | None = None

    @property
    def sources(self) -> list[PackingSection | Circles | Photograph]:
        """The section on the particles; one, once this is built."""
        return [x for x in (self.packing, self.circles, self.image) if x is not None]

    @model_validator(mode="after")
    def _check_source(self) -> Self:
        """Refuses several sources of the particles, or none."""
        allowed, count = "one of packing, circles and image", len(self.sources)
        value = f"with {count} of them" if count else None
        require(count == 1, "microstructure", value=value, allowed=allowed)
        return self

    def study(self, *, spheres: bool) -> MicrostructureStudy:
        """The study that computes the radius map from these particles, or from packed spheres."""
        return MicrostructureStudy(self.sources[0].source(spheres), self.limits, self.seed)


AnyRadius = RadiusMapSection | FractionMap
"""The random radius of a case, of [radius] or of cell.fraction."""
