"""Keys of the section [cell] where the cell is a picture: an image, polygons, an inequality."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from alphacut.case.key import POISSON, UNIT, Key, Range, Section, positive
from alphacut.fuzzy import FuzzyNumber

DIVISIONS = Range("from 1 to 16", 1.0, 16.0, closed=True)
TILES = Range("from 2 to 64", 2.0, 64.0, closed=True)
PICTURES = ("image", "polygons", "inequality")


@dataclass(frozen=True, kw_only=True, slots=True)
class Picture(Section):
    """A picture of the cell's phases: one of image, polygons, inequality."""

    image: Annotated[
        str | None,
        Key(
            "grey or labelled image of every section of a prismatic material, in place of the round"
            " particle: PNG, TIFF, or a NumPy array .npy",
            file=True,
        ),
    ] = None
    polygons: Annotated[
        str | None,
        Key(
            "CSV file of the particle's corners instead, x [mm], y [mm], y upwards; a row nan, nan"
            " between polygons",
            file=True,
        ),
    ] = None
    inequality: Annotated[
        str | None,
        Key('where the particle is instead, x and y in m: "(x - 1)**2 + (y - 1)**2 <= 0.25"'),
    ] = None
    pixel: Annotated[
        tuple[float, ...] | None,
        positive("side of a pixel of the image, or its width and height", "m", alone=True),
    ] = None
    size: Annotated[
        tuple[float, ...] | None,
        positive(
            "width and height of the cell: needed by an outline, checked against an image's pixels",
            "m",
        ),
    ] = None
    pixels: Annotated[
        int,
        Key(
            "pixels across the cell of an outline",
            allowed=Range("from 4 to 8192", 4.0, 8192.0, closed=True),
        ),
    ] = 256
    threshold: Annotated[
        tuple[FuzzyNumber, ...] | None, Key("grey value from which on a pixel is of the next phase")
    ] = None
    threshold_deviation: Annotated[
        FuzzyNumber | None,
        positive("standard deviation of a random threshold, normal about threshold"),
    ] = None
    quantiles: Annotated[
        tuple[float, ...],
        Key(
            "probabilities whose quantiles of E are wanted, beside a random threshold", allowed=UNIT
        ),
    ] = (0.05, 0.5, 0.95)
    labels: Annotated[
        tuple[float, ...] | None,
        Key("value of each phase in a labelled image, instead of thresholds"),
    ] = None
    modulus: Annotated[
        tuple[FuzzyNumber, ...] | None,
        positive("Young's modulus of each phase, from dark to bright or as labelled", "Pa"),
    ] = None
    poisson: Annotated[
        tuple[FuzzyNumber, ...] | None,
        Key("Poisson's ratio of each phase", allowed=POISSON, alone=True),
    ] = None
    bulk: Annotated[
        tuple[FuzzyNumber, ...] | None,
        positive(
            "bulk modulus K of each phase, that of three dimensions, instead of modulus", "Pa"
        ),
    ] = None
    shear: Annotated[
        tuple[FuzzyNumber, ...] | None, positive("shear modulus of each phase, beside bulk", "Pa")
    ] = None
    boundary: Annotated[
        Literal["periodic", "window"],
        Key("periodic: the picture repeats itself; window: it is cut from a larger material"),
    ] = "periodic"
    tiles: Annotated[int, Key("tiles along each side of a window", allowed=TILES)] = 4
    division: Annotated[
        int | None,
        Key(
            "parts along each side into which every pixel is divided; if left out 2 where the"
            " moduli differ by at most a factor 10, else 1",
            allowed=DIVISIONS,
        ),
    ] = None
    width: Annotated[
        float | None,
        Key(
            "width of the stiffness's bounds, as a share, for which pixels are divided further",
            allowed=Range("from 1e-6 to 1", 1e-6, 1.0, closed=True),
        ),
    ] = None

    @property
    def sources(self) -> list[str]:
        """Keys that give a picture."""
        every = {"image": self.image, "polygons": self.polygons, "inequality": self.inequality}
        return [name for name, value in every.items() if value is not None]

    @property
    def pairs(self) -> tuple[tuple[FuzzyNumber, ...], tuple[FuzzyNumber, ...]]:
        """E and ν of each phase, or K and G where no E is given."""
        first = self.bulk if self.modulus is None else self.modulus
        second = self.shear if self.modulus is None else self.poisson
        assert first is not None  # or the case is refused
        assert second is not None
        return first, second * len(first) if len(second) == 1 else second
