"""The section [microstructure]: particles packed, measured or seen, which make the radius map."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from alphacut.base.errors import require
from alphacut.case.types import CaseFile, Fraction, Length, Quantity, Section, after, rising
from alphacut.stochastic.microstructure import MicrostructureStudy
from alphacut.stochastic.particles.measured import CircleFile, SectionImage
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.particles import DISCS, SPHERES
from alphacut.stochastic.particles.radius_laws import LogNormalRadii, MeasuredRadii
from alphacut.stochastic.sections import Simulated


class PackingSection(Section):
    """Particles packed at random in a periodic box: discs, or spheres where the cell has spheres.

    Radii are log-normal between two limits (the paper's eq. 11), or those of a file.
    """

    packings: Annotated[int, Quantity(minimum=5, maximum=10_000, is_integer=True)] = 20
    """independent packings"""
    particles: Annotated[int, Quantity(minimum=10, maximum=1_000_000, is_integer=True)]
    """particles in each packing"""
    fraction: Annotated[float, Quantity(above=0, below=0.84)]
    """area fraction, or volume fraction, of the particles"""
    smallest_radius: Length | None = Field(default=None, description="lower end of the radii")
    largest_radius: Length | None = Field(default=None, description="upper end of the radii")
    file: CaseFile | None = None
    """CSV file of radii or diameters, a column r [mm] or d [mm]"""

    def source(self, spheres: bool) -> Simulated:
        """The random packings to be computed: of spheres, or else of discs."""
        shape = SPHERES if spheres else DISCS
        fits, key = self.fraction <= shape.densest, "microstructure.packing.fraction"
        allowed = f"shares up to {shape.densest:g} of {shape.particles} packed at random"
        cure = f"set cell.fraction = {self.fraction:g} in place of [microstructure]"
        require(fits, key, self.fraction, allowed, cure)
        ends = self.smallest_radius or 0.0, self.largest_radius or 0.0  # both are there, or a file
        radii = MeasuredRadii.read(self.file) if self.file else LogNormalRadii(*ends)
        return Simulated(Packing(self.particles, self.fraction, radii, shape=shape), self.packings)

    def require_consistent(self) -> None:
        """Refuses a file of radii beside their ends, and one end alone or none without a file."""
        ends = (self.smallest_radius, self.largest_radius)
        fits = None not in ends if self.file is None else ends == (None, None)
        key, allowed = "microstructure.packing.file", "a file, or both ends of the radii"
        require(fits, key, "beside or without ends", allowed)


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

    seed: Annotated[int, Quantity(minimum=0, maximum=1e18, is_integer=True)]
    """seed of everything left to chance"""
    limits: Annotated[tuple[Fraction, Fraction], after(rising)] | None = None
    """lower and upper limit of r/a"""
    packing: PackingSection | None = None
    circles: Circles | None = None
    image: Photograph | None = None

    @property
    def sources(self) -> list[PackingSection | Circles | Photograph]:
        """The section on the particles; one, once this is built."""
        return [x for x in (self.packing, self.circles, self.image) if x is not None]

    def require_consistent(self) -> None:
        """Refuses several sources of the particles, or none."""
        allowed, count = "one of packing, circles and image", len(self.sources)
        value = f"with {count} of them" if count else None
        require(count == 1, "microstructure", value, allowed)

    def study(self, *, spheres: bool) -> MicrostructureStudy:
        """The study that computes the radius map from these particles, or from packed spheres."""
        return MicrostructureStudy(self.sources[0].source(spheres), self.limits, self.seed)
