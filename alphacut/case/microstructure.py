"""The section [microstructure]: particles packed, measured or seen, which make the radius map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

from alphacut.base.errors import require
from alphacut.case.types import CaseFile, Fraction, Length, Quantity, Section, after, rising
from alphacut.stochastic.particles.shapes import DISCS, SPHERES

if TYPE_CHECKING:
    from alphacut.stochastic import Packings, Particles
    from alphacut.stochastic.particles.radius_distributions import RadiusDistribution

Progress = Callable[[float], None]


class PackingSection(Section):
    """Particles packed at random in a periodic box: discs, or spheres where the cell has spheres.

    Radii are log-normal between two limits (the paper's eq. 11), or those of a file.

    Args:
        packings: independent packings.
        particles: particles in each packing.
        fraction: area fraction, or volume fraction, of the particles.
        smallest_radius: lower end of the radii.
        largest_radius: upper end of the radii.
        file: CSV file of radii or diameters, a column r [mm] or d [mm].
    """

    # How much statistics vary from packing to packing cannot be told from fewer than five.
    packings: Annotated[int, Quantity(minimum=5, maximum=10_000, is_integer=True)] = 20
    particles: Annotated[int, Quantity(minimum=10, maximum=1_000_000, is_integer=True)]
    # Equal discs jam at an area fraction of about 0.84, spheres at a smaller volume fraction.
    fraction: Annotated[float, Quantity(above=0, below=0.84)]
    smallest_radius: Length | None = None
    largest_radius: Length | None = None
    file: CaseFile | None = None

    @property
    def radii(self) -> RadiusDistribution:
        """Distribution of the radii."""
        from alphacut.stochastic import LogNormalRadii, MeasuredRadii  # few cases need them

        if self.file is not None:
            return MeasuredRadii.read(self.file)
        assert self.smallest_radius is not None
        assert self.largest_radius is not None
        return LogNormalRadii(self.smallest_radius, self.largest_radius)

    def require_readable(self, *, spheres: bool) -> None:
        """Refuse a fraction too dense for a random packing, and a file of radii that is not read.

        Args:
            spheres: Whether the particles are spheres, which pack less densely than discs.

        Raises:
            RefusedError: The fraction is near that of random close packing or above it, or the
                radii of the file or the two limits make no distribution.
        """
        # Still nearer to random close packing the simulation would not come to an end.
        shape = SPHERES if spheres else DISCS
        fits = self.fraction <= shape.densest
        key = "microstructure.packing.fraction"
        allowed = f"shares up to {shape.densest:g} of {shape.particles} packed at random"
        cure = f"set cell.fraction = {self.fraction:g} in place of [microstructure]"
        require(fits, key, self.fraction, allowed, cure)
        _ = self.radii  # reads the file, or builds the distribution between the two limits

    def pack(
        self, *, spheres: bool, seed: int, workers: int = 1, progress: Progress | None = None
    ) -> Packings:
        """Return independent random packings of particles in a periodic box.

        Args:
            spheres: Whether to pack spheres in space instead of discs in the plane.
            seed: Seed of the random numbers.
            workers: Number of processes; the packings do not depend on it.
            progress: Called with the completed fraction of the work.

        Raises:
            RefusedError: As `require_readable`: the fraction is too dense, or there are no radii.
            FailedError: Particles still overlap after all steps of the packing.
        """
        from alphacut.stochastic import pack  # takes time to import

        self.require_readable(spheres=spheres)
        return pack(
            self.particles,
            packings=self.packings,
            fraction=self.fraction,
            radii=self.radii,
            shape="spheres" if spheres else "discs",
            seed=seed,
            workers=workers,
            progress=progress,
        )

    def require_consistent(self) -> None:
        """Refuse radii from two sources or none.

        The radii come from `file`, or from a distribution between `smallest_radius` and
        `largest_radius`, of which both must then be there.
        """
        ends = (self.smallest_radius, self.largest_radius)
        fits = None not in ends
        if self.file is not None:
            fits = ends == (None, None)
        key = "microstructure.packing.file"
        require(fits, key, "beside or without ends", "a file, or both ends of the radii")


class Circles(Section):
    """Measured circles from a CSV file with the columns x, y, r.

    Args:
        file: CSV file with the header x [mm], y [mm], r [mm].
        size: width and height of the section.
    """

    file: CaseFile
    size: tuple[Length, Length]


class Photograph(Section):
    """Circles segmented from the image of a section.

    Args:
        file: image file.
        pixel: side of a pixel.
    """

    file: CaseFile
    pixel: Length


class MicrostructureSection(Section):
    """Particles from which the random radius comes: one of packing, circles and image.

    Args:
        seed: seed of everything left to chance.
        limits: lower and upper limit of r/a.
    """

    seed: Annotated[int, Quantity(minimum=0, maximum=1e18, is_integer=True)]
    limits: Annotated[tuple[Fraction, Fraction], after(rising)] | None = None
    packing: PackingSection | None = None
    circles: Circles | None = None
    image: Photograph | None = None

    @property
    def sources(self) -> list[PackingSection | Circles | Photograph]:
        """The section on the particles; one, once this is built."""
        return [x for x in (self.packing, self.circles, self.image) if x is not None]

    @property
    def measured(self) -> Particles | None:
        """The circles that were measured or seen; None of packings."""
        from alphacut.stochastic import read_particles  # takes time to import

        if self.circles is not None:
            return read_particles(self.circles.file, size=self.circles.size)
        if self.image is not None:
            return read_particles(self.image.file, pixel=self.image.pixel)
        return None

    def particles(self, *, spheres: bool, workers: int, progress: Progress) -> Sequence[Particles]:
        """Return the packings, or the one section of a material whose circles were measured.

        Measured circles come from a file, or are found in an image.

        Args:
            spheres: Whether packed particles are spheres instead of discs. Measured ones are discs.
            workers: Number of processes that pack.
            progress: Called with the completed fraction of the packing; never for measured circles.

        Raises:
            RefusedError: The fraction does not pack, or a file is not read.
            FailedError: Particles still overlap after all steps of the packing.
        """
        if self.packing is None:
            measured = self.measured
            assert measured is not None  # a section without packing has circles or an image
            return [measured]
        return self.packing.pack(
            spheres=spheres, seed=self.seed, workers=workers, progress=progress
        )

    def require_readable(self, *, spheres: bool) -> None:
        """Refuse a fraction that does not pack, and a file that is not read."""
        if self.packing is not None:
            self.packing.require_readable(spheres=spheres)
        _ = self.measured  # reads the file, which may be no image or have no circles

    def require_consistent(self) -> None:
        """Refuse several sources of the particles, or none."""
        count = len(self.sources)
        allowed = "one of packing, circles and image"
        require(count > 0, "microstructure", None, allowed)
        require(count == 1, "microstructure", f"with {count} of them", allowed)
