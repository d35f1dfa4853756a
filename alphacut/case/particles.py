"""Sections on particles: packed at random, measured, or seen on a photograph."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from alphacut.case.types import CaseFile, Length, Quantity, Section, Share, after, rising
from alphacut.fuzzy.refused import RefusedError
from alphacut.stochastic.microstructure import Study
from alphacut.stochastic.particles.circles_csv import CircleFile
from alphacut.stochastic.particles.image import SectionImage
from alphacut.stochastic.particles.packing import Packing as Specification
from alphacut.stochastic.particles.particles import DISCS, SPHERES
from alphacut.stochastic.particles.radius_laws import LogNormalRadii, MeasuredRadii, RadiusLaw
from alphacut.stochastic.sections import Measured, Simulated

SOURCES = ("packing", "circles", "image")


class Packing(Section):
    """Particles packed at random in a periodic box: discs, or spheres where the cell has spheres.

    Radii are log-normal between two ends (eq. 11), or those of a file.
    """

    packings: Annotated[int, Quantity(least=5, most=10_000, whole=True)] = Field(
        default=20, description="independent packings"
    )
    particles: Annotated[int, Quantity(least=10, most=1_000_000, whole=True)] = Field(
        description="particles in each packing"
    )
    fraction: Annotated[float, Quantity(above=0, below=0.84)] = Field(
        description="share of area, or of volume, that they cover"
    )
    smallest_radius: Length | None = Field(default=None, description="lower end of the radii")
    largest_radius: Length | None = Field(default=None, description="upper end of the radii")
    file: CaseFile | None = Field(
        default=None, description="CSV file of radii or diameters, a column r [mm] or d [mm]"
    )

    @property
    def radii(self) -> RadiusLaw:
        """Law of the radii."""
        if self.file is not None:
            return MeasuredRadii.read(self.file)
        return LogNormalRadii(self.smallest_radius or 0.0, self.largest_radius or 0.0)

    @model_validator(mode="after")
    def _one_law(self) -> Self:
        """Refuses radii of two laws, or of none.

        Raises:
            RefusedError: They are.
        """
        ends = (self.smallest_radius, self.largest_radius)
        if self.file is None and None in ends:
            name = "smallest_radius" if ends[0] is None else "largest_radius"
            raise RefusedError(f"microstructure.packing.{name}", None, "a length, or a file")
        if self.file is not None and ends != (None, None):
            key = "microstructure.packing.file"
            raise RefusedError(key, self.file.name, "a file, or both ends of the radii")
        return self


class Circles(Section):
    """Measured circles from a CSV file with the columns x, y, r."""

    file: CaseFile = Field(description="CSV file with the header x [mm], y [mm], r [mm]")
    size: tuple[Length, Length] = Field(description="width and height of the section")


class Photograph(Section):
    """Circles segmented from the image of a section."""

    file: CaseFile = Field(description="image file")
    pixel: Length = Field(description="side of a pixel")


class Microstructure(Section):
    """Particles from which the random radius comes: one of packing, circles and image."""

    seed: Annotated[int, Quantity(least=0, most=1e18, whole=True)] = Field(
        description="seed of everything left to chance"
    )
    limits: Annotated[tuple[Share, Share], after(rising)] | None = Field(
        default=None, description="lower and upper limit of r/a"
    )
    packing: Packing | None = None
    circles: Circles | None = None
    image: Photograph | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        """Refuses several sources, or none.

        Raises:
            RefusedError: There are.
        """
        names = [name for name in SOURCES if getattr(self, name) is not None]
        if len(names) != 1:
            allowed = "one of packing, circles and image"
            raise RefusedError("microstructure", ", ".join(names) or None, allowed)
        return self

    def study(self, *, spheres: bool) -> Study:
        """The way from the particles to the radius map.

        Args:
            spheres: Whether packed particles are spheres.
        """
        return Study(self._source(spheres), self.limits, seed=self.seed, sampling=not spheres)

    def _source(self, spheres: bool) -> Simulated | Measured:
        if self.circles is not None:
            of = self.circles
            return Measured(CircleFile(of.file, of.size))
        if self.image is not None:
            return Measured(SectionImage(self.image.file, self.image.pixel))
        assert self.packing is not None
        packing = self.packing
        shape = SPHERES if spheres else DISCS
        each = Specification(packing.particles, packing.fraction, packing.radii, shape=shape)
        return Simulated(each, packing.packings)
