"""Images as cells: grey values or labels from files, least and greatest moduli of each pixel.

The stiffness of a composite grows in the Loewner order with the tensor of every point. So the image
of the least K + G/3 and the least G of each pixel, over all phases it may be and all moduli that
these may have, has a stiffness below every possible one.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from alphacut.fuzzy.arrays import Array, Ints
from alphacut.fuzzy.refused import RefusedError

MIN_MODULUS, MAX_MODULUS = 1e-60, 1e60  # Pa; products of four moduli must be numbers
NU_AT_LEAST_BULK = -0.25  # Poisson's ratio of the least plane-strain bulk modulus at a fixed E


@dataclass(frozen=True)
class PlaneModuli:
    """Moduli of an isotropic material in plane strain.

    Args:
        bulk: Plane-strain bulk modulus K + G/3, in Pa, from `MIN_MODULUS` to `MAX_MODULUS`; K is
            that of three dimensions.
        shear: Shear modulus G, in Pa, of the same range.

    Raises:
        RefusedError: A modulus lies outside its range.
    """

    bulk: float
    shear: float

    def __post_init__(self) -> None:
        """Refuse moduli outside (`MIN_MODULUS`, `MAX_MODULUS`)."""
        for name, value in (("plane-strain bulk", self.bulk), ("shear", self.shear)):
            if not MIN_MODULUS < value < MAX_MODULUS:
                allowed = f"values in ({MIN_MODULUS:g}, {MAX_MODULUS:g}) Pa"
                raise RefusedError(f"{name} modulus of a phase", f"{value:g} Pa", allowed)

    @classmethod
    def of_young(cls, modulus: float, poisson: float) -> PlaneModuli:
        """From Young's modulus in Pa and Poisson's ratio, inside (−1, 0.5)."""
        if not -1 < poisson < 0.5:
            raise RefusedError("Poisson's ratio of a phase", poisson, "values in (-1, 0.5)")
        shear = modulus / (2 * (1 + poisson))
        return cls(modulus / (3 * (1 - 2 * poisson)) + shear / 3, shear)


@dataclass(frozen=True)
class ModuliInterval:
    """All materials between the least and the greatest moduli."""

    lower: PlaneModuli
    upper: PlaneModuli

    @classmethod
    def of_young(cls, modulus: tuple[float, float], poisson: tuple[float, float]) -> ModuliInterval:
        """Least and greatest plane bulk and shear modulus over intervals of E (Pa) and of ν."""
        # K + G/3 = E/(2 (1 + ν) (1 − 2 ν)) is convex in ν; G decreases
        (young_low, young_high), (nu_low, nu_high) = modulus, poisson
        nu_softest = min(max(nu_low, NU_AT_LEAST_BULK), nu_high)
        least_bulk = PlaneModuli.of_young(young_low, nu_softest).bulk
        least_shear = PlaneModuli.of_young(young_low, nu_high).shear
        greatest_bulk = max(PlaneModuli.of_young(young_high, nu).bulk for nu in poisson)
        greatest_shear = PlaneModuli.of_young(young_high, nu_low).shear
        return cls(PlaneModuli(least_bulk, least_shear), PlaneModuli(greatest_bulk, greatest_shear))


@dataclass(frozen=True)
class ModuliImages:
    """Moduli of each pixel below and above all possible ones, each of shape (rows, columns), in Pa.

    Args:
        bulk: Least and greatest plane-strain bulk modulus K + G/3.
        shear: Least and greatest shear modulus.
    """

    bulk: tuple[Array, Array]
    shear: tuple[Array, Array]

    @property
    def geometric_mean(self) -> ModuliImages:
        """Image of the geometric means of the least and the greatest moduli."""
        bulk, shear = (np.sqrt(low * high) for low, high in (self.bulk, self.shear))
        return ModuliImages((bulk, bulk), (shear, shear))

    def equals(self, images: ModuliImages) -> bool:
        """True if both are the same moduli everywhere."""
        pairs = zip((*self.bulk, *self.shear), (*images.bulk, *images.shear), strict=True)
        return all(np.array_equal(a, b) for a, b in pairs)


def threshold_ranges(grey: Array, thresholds: Sequence[tuple[float, float]]) -> tuple[Ints, Ints]:
    """Least and greatest number of the phase that each pixel may be of, (rows, columns) each.

    A pixel is of phase k if k of the thresholds (lower, upper), rising, are ≤ its grey value.
    """
    lower, upper = np.array(thresholds).reshape(-1, 2).T
    first = np.searchsorted(upper, grey, side="right")
    last = np.searchsorted(lower, grey, side="right")
    return first, last


def moduli_images(first: Ints, last: Ints, phases: Sequence[ModuliInterval]) -> ModuliImages:
    """Least and greatest moduli of each pixel over the phases `first` … `last` it may be of."""
    tables = np.zeros((4, len(phases), len(phases)))  # by first and last
    for code in np.unique(first * len(phases) + last):
        a, b = divmod(int(code), len(phases))
        candidates = phases[a : b + 1]
        tables[:, a, b] = (
            min(phase.lower.bulk for phase in candidates),
            max(phase.upper.bulk for phase in candidates),
            min(phase.lower.shear for phase in candidates),
            max(phase.upper.shear for phase in candidates),
        )
    images = [table[first, last] for table in tables]
    return ModuliImages(bulk=(images[0], images[1]), shear=(images[2], images[3]))


PLANE_MODES = ("1", "L", "I;16", "I;16B", "I;16L", "I", "F")
PHOTOMETRIC, WHITE_IS_ZERO = 262, 0  # tag of TIFF and its value
SAMPLE_FORMAT, SIGNED = 339, 2
BYTES, BYTES_PER_ELEMENT = 1.3e8, 1450
"""Of the program, and of each element of the cuts' solutions with their first guess; within 1.25 of
peaks measured at 128² … 512² pixels of two elements a side, and 512² and 1024² of one."""


def read_grey(path: Path, *, square: bool = True) -> Array:
    """Grey values of ``.png``, ``.tif`` … or ``.npy``, (rows, columns), row 0 at the bottom.

    Refuses what is no plane image of numbers or too large for memory and, with `square`, a file
    that says that its pixels are not square.
    """
    try:
        values = _array(path) if path.suffix == ".npy" else _picture(path, square)
    except (RefusedError, MemoryError):
        raise
    except Exception as error:  # readers of damaged files raise errors of many kinds
        raise RefusedError(path.name, f"unreadable ({error})", "an image or an array") from error
    if values.ndim != 2 or min(values.shape) < 2 or values.dtype.kind not in "buif":
        what = f"{values.dtype} of shape {values.shape}"
        raise RefusedError(path.name, what, "one plane of 2 × 2 numbers or more")
    require_memory(*values.shape)
    if not np.isfinite(values).all():
        count = int((~np.isfinite(values)).sum())
        raise RefusedError(path.name, f"with {count} values that are not finite", "numbers")
    return np.ascontiguousarray(values[::-1])


def _array(path: Path) -> Array:
    # mapped: one too large for memory must come as far as the question of how large it is
    return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))


def _picture(path: Path, square: bool) -> Array:
    """Read the pixels of an image file with one page of grey values, top row first."""
    from PIL import Image

    Image.MAX_IMAGE_PIXELS = None  # the memory is checked here, before the pixels are read
    with Image.open(path) as picture:
        mode, frames = picture.mode, getattr(picture, "n_frames", 1)
        if mode not in PLANE_MODES or frames > 1:
            what = f"of mode {mode} with {frames} pages"
            raise RefusedError(path.name, what, "one page of grey values", "save the one meant")
        dpi_x, dpi_y = map(float, picture.info.get("dpi", (1, 1)))
        if square and abs(dpi_x / dpi_y - 1) > 0.01:
            what = f"of pixels {dpi_x:g} by {dpi_y:g} per inch"
            raise RefusedError(path.name, what, "square ones", "give cell.pixel = [width, height]")
        require_memory(picture.height, picture.width)
        values = np.asarray(picture)
        tags = getattr(picture, "tag_v2", {})
        greys = np.unique(values) if tags.get(PHOTOMETRIC) == WHITE_IS_ZERO else []
        if len(greys) == 2:  # tifffile writes masks so, and readers exchange the phases
            value = f"two-valued with white as zero, bright on {np.mean(values == greys[1]):.4g}"
            cure = "save it as .npy or PNG, and look at the fractions that check prints"
            raise RefusedError(path.name, value, "masks that all programs read alike", cure)
        is_signed = tags.get(SAMPLE_FORMAT, (1,)) == (SIGNED,)
        is_changed = (
            is_signed if mode == "L" else not is_signed and mode == "I" and values.min() < 0
        )
        if is_changed:
            what = f"of integers whose sign Pillow changes, as {values.min()}"
            raise RefusedError(path.name, what, "values from 0 to 2³¹ − 1", "save it as .npy")
        return values


def needed_memory(rows: int, columns: int, division: int = 1) -> float:
    """Bytes that the cuts of an image take with so many elements along each side of a pixel."""
    return BYTES + BYTES_PER_ELEMENT * rows * columns * division**2


def require_memory(rows: int, columns: int, division: int = 1) -> None:
    """Refuse an image whose solution needs more memory than this machine has."""
    available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    needed = needed_memory(rows, columns, division)
    if needed > available:
        side = int((available / BYTES_PER_ELEMENT) ** 0.5 / division)
        what = f"{rows} × {columns} pixels, about {needed / 1e9:.0f} GB"
        allowed = f"up to {available / 1e9:.0f} GB of memory"
        raise RefusedError("image", what, allowed, f"crop a piece of {side} × {side} pixels")


def require_phases(grey: Array, thresholds: tuple[tuple[float, float], ...]) -> None:
    """Refuse thresholds (lower, upper), rising, that may leave a phase without a pixel."""
    low, high = float(grey.min()), float(grey.max())
    for lower, upper in thresholds:
        if not (low < lower and upper <= high):
            span = f"{lower:g}" if lower == upper else f"[{lower:g}, {upper:g}]"
            raise RefusedError("threshold", span, f"grey values of the image, {low:g} to {high:g}")
    for (_, lower), (upper, _) in pairwise(thresholds):  # of the pixels surely between both
        if not ((grey >= lower) & (grey < upper)).any():
            what = f"{lower:g} and {upper:g}"
            raise RefusedError("threshold", what, "rising values with pixels between them")
