"""Keys of the section [cell] where the cell is an image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from alphacut.case.key import POISSON, Key, Range, Section, positive
from alphacut.fuzzy import FuzzyNumber

DIVISIONS = Range("from 1 to 16", 1.0, 16.0, closed=True)
PICTURES = ("image",)


@dataclass(frozen=True, kw_only=True, slots=True)
class Picture(Section):
    """An image of the cell's phases."""

    image: Annotated[
        str | None,
        Key(
            "grey or labelled image of every section of a prismatic material, in place of the round"
            " particle: PNG, TIFF, or a NumPy array .npy",
            file=True,
        ),
    ] = None
    pixel: Annotated[
        tuple[float, ...] | None,
        positive("side of a pixel of the image, or its width and height", "m", alone=True),
    ] = None
    threshold: Annotated[
        tuple[FuzzyNumber, ...] | None, Key("grey value from which on a pixel is of the next phase")
    ] = None
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
    smooth: Annotated[bool, Key("take the noise of the image away before it is segmented")] = False
    level: Annotated[bool, Key("take the drift of its light away before it is segmented")] = False
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
    def pairs(self) -> tuple[tuple[FuzzyNumber, ...], tuple[FuzzyNumber, ...]]:
        """E and ν of each phase, or K and G where no E is given."""
        first = self.bulk if self.modulus is None else self.modulus
        second = self.shear if self.modulus is None else self.poisson
        assert first is not None  # or the case is refused
        assert second is not None
        return first, second * len(first) if len(second) == 1 else second
