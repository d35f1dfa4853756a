"""Measured circles of a section: from a CSV file, or from an image by scikit-image.

An image is smoothed and cut at Otsu's threshold. A watershed on the distance to the background
separates particles that touch. Each piece becomes the circle of its centroid and area. Pieces at
the image's edge are left out, since their circle is not known.

Tested limits: radii of 8 pixels or more, gaps of 3 or more, contrast at least 5 times the standard
deviation of the noise: the count is exact and half of the radii are within half a pixel.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from alphacut.base.arrays import Array, Mask
from alphacut.base.csv_columns import length_columns
from alphacut.base.errors import RefusedError, checked_number, require, require_numbers
from alphacut.base.extras import extra_named
from alphacut.base.pictures import opened_picture
from alphacut.stochastic.particles.particles import Particles, close_pairs, surface_distance
from alphacut.stochastic.particles.radius_distributions import require_radii

MIN_RADIUS = 4.0
"""Smallest radius of a particle in an image, in pixels. Smaller spots are noise, and their area is
known too badly."""


def read_particles(
    path: str | Path,
    *,
    size: tuple[float, float] | None = None,
    pixel: float | None = None,
) -> Particles:
    r"""Read the circles of a section from a CSV file, or find them in an image of it.

    Give `size` with a CSV file, or `pixel` with an image, and not both.

    Args:
        path: CSV file with the columns ``x [mm], y [mm], r [mm]`` (or d, a diameter), where `size`
            is given; image of round particles of one brightness in a matrix of another, where
            `pixel` is.
        size: Width and height of the section, a window with a corner at the origin, in m, positive.
        pixel: Side of a pixel, in m, from 1e-12 to 1.

    Returns:
        The circles in a window that is not periodic: centres in m from the lower left corner of the
        section, radii in m. Particles of an image that its edge cuts are left out.

    Raises:
        RefusedError: The file cannot be read; the unit of a column is unknown; a circle has its
            centre outside the section or overlaps another one; the image hides its particles or
            more than 2 % of their area is not round; or not exactly one of `size` and `pixel` is
            given, or it is out of range.
        MissingLibraryError: The file is an image, and scikit-image is not installed.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> file = Path(mkdtemp()) / "circles.csv"
        >>> _ = file.write_text("x [mm],y [mm],r [mm]\n10,10,4\n30,12,5\n")
        >>> read_particles(file, size=(0.04, 0.04)).radii.tolist()
        [0.004, 0.005]
    """
    if size is not None and pixel is None:
        require_numbers("size", size)
        is_window = len(size) == 2 and min(size) > 0
        require(is_window, "size", size, allowed="width and height above 0, in m")
        return _read_circles(Path(path), size)
    allowed = "the size of the section, or the pixel of an image of it, in m"
    if pixel is None or size is not None:
        raise RefusedError("size, pixel", (size, pixel), allowed)
    checked_number("image.pixel [m]", pixel, least=1e-12, most=1)
    return circles_in(section_picture(Path(path)), pixel, name=Path(path).name)


def _read_circles(path: Path, size: tuple[float, float]) -> Particles:
    """Return the circles of a CSV file in a section, a window with a corner at the origin.

    Args:
        path: CSV file with the columns x, y and r (or d, diameters), each with its unit.
        size: Width and height of the section, in m.

    Raises:
        RefusedError: The file cannot be read, a radius is not from 1e-12 to 1e6 m, a centre is
            outside the section, or two circles overlap by more than 1e-9 of the smaller radius.
    """
    rows, values = length_columns(path, ("x", "y", "r"))
    centres = values[:, :2]
    radii = values[:, 2]
    for row, centre, radius in zip(rows, centres, radii, strict=True):
        require_radii(f"{path.name}, row {row}", radius)
        if not ((centre >= 0) & (centre <= size)).all():
            value = f"a centre {(1e3 * centre).round(6).tolist()} mm from the corner"
            allowed = f"places in the section of {1e3 * size[0]:g} × {1e3 * size[1]:g} mm"
            cure = "mend the row, or the size of the section"
            raise RefusedError(f"{path.name}, row {row}", value, allowed, cure)
    discs = Particles(centres, radii, np.array(size), periodic=False)
    first, second = close_pairs(discs, 0.0)
    overlap = -surface_distance(discs, first, second) / np.minimum(radii[first], radii[second])
    if overlap.max(initial=0.0) > 1e-9:  # of the smaller radius; less is rounding
        worst = int(np.argmax(overlap))
        upper, lower = sorted([int(rows[first[worst]]), int(rows[second[worst]])])
        value = f"a circle that overlaps that of row {upper} by {overlap[worst]:.2g} of its radius"
        key = f"{path.name}, row {lower}"
        cure = "mend the row; columns of radii have the head r, those of diameters d"
        raise RefusedError(key, value, "circles that do not overlap", cure)
    return discs


def section_picture(path: Path) -> Array:
    """Return the grey values of an image file as floats, shape (rows, columns).

    Colours are turned into grey values; grey images keep the numbers of their file.

    Raises:
        RefusedError: The file does not exist, is no image, is damaged or too large.
    """
    try:
        with opened_picture(path) as image:
            is_grey = image.mode in ("1", "L", "I", "F") or image.mode.startswith("I;16")
            return np.asarray(image if is_grey else image.convert("L"), float)
    except RefusedError:
        raise
    except Exception as error:  # readers of damaged files raise errors of many kinds
        allowed = f"images that can be read ({error})"
        raise RefusedError("image.file", path, allowed) from None


def circles_in(picture: Array, pixel: float, *, name: str) -> Particles:
    """Find the particles in a grey image, and return circles of equal area and centroid, in m.

    The particles are the phase whose pieces fill more of their convex hulls. Those that touch the
    edge are left out, since their circle is not known.

    Args:
        picture: Grey values, shape (rows, columns), the first row at the top.
        pixel: Side of a pixel, in m.
        name: Name of the image in messages.

    Returns:
        At least one disc in a window of the size of the image, with y upwards from its lower edge.
        Discs may overlap a little.

    Raises:
        RefusedError: Noise or light hides the particles, there are none, or more than 2 % of their
            area is in pieces that are not round: with less area than a circle of 4 pixels radius,
            or filling less than 90 % of their convex hull.
        MissingLibraryError: scikit-image is not installed.
    """
    with extra_named(name):
        from skimage import measure

    phase = _particle_mask(picture, name)
    rows, columns = phase.shape
    circles = []
    not_round_area = 0.0
    for piece in measure.regionprops(_label_particles(phase)):  # type: ignore[no-untyped-call]
        top, left, bottom, right = piece.bbox
        # The circle of a piece that the edge cuts is not known.
        if min(top, left) == 0 or bottom == rows or right == columns:
            continue
        if piece.area < np.pi * MIN_RADIUS**2 or piece.solidity < 0.9:
            not_round_area += piece.area
        else:
            row, column = piece.centroid
            circles.append((row, column, piece.equivalent_diameter_area / 2))
    fraction = not_round_area / max(phase.sum(), 1)
    max_fraction = 0.02
    require(
        bool(circles) and fraction <= max_fraction,
        name,
        value=f"{fraction:.1%} of the particles' area in pieces that are not round, beside"
        f" {len(circles)} that are",
        allowed=f"images with round particles, up to {max_fraction:.0%} of others",
        cure="take the image itself as the cell: cell.image",
    )
    # Indices count from the centre of the upper left pixel; y rises from the lower edge.
    row, column, radius = np.array(circles).T
    centres = np.stack([column + 0.5, rows - row - 0.5], axis=1)
    size = np.array([columns, rows]) * pixel
    return Particles(centres * pixel, radius * pixel, size, periodic=False)


def _particle_mask(picture: Array, name: str) -> Mask:
    """Return the pixels of the particles, by Otsu's threshold of the smoothed image.

    Of the two phases, that of the particles is the one whose pieces fill more of their convex
    hulls.

    Args:
        picture: Grey values, shape (rows, columns).
        name: Name of the image in messages.

    Returns:
        True in particles, shape (rows, columns).

    Raises:
        RefusedError: The image has one grey, the grey values of the phases are closer than three
            standard deviations of the noise, or the light changes the matrix by more than a fifth
            of the contrast.
    """
    from skimage import filters

    # The smoothing, by 1.5 pixels, is below the smallest radius.
    smooth = filters.gaussian(picture, 1.5, preserve_range=True)  # type: ignore[no-untyped-call]
    bright = smooth > filters.threshold_otsu(smooth)  # type: ignore[no-untyped-call]
    greys = [smooth[part] for part in (bright, ~bright) if part.any()]
    contrast = float(np.ptp([np.median(grey) for grey in greys]))
    noise = float(np.sqrt(np.mean([np.var(grey) for grey in greys])))
    require(
        len(greys) == 2 and contrast >= 3.0 * noise,
        name,
        value=f"one of {len(greys)} greys, apart by {contrast / max(noise, 1e-300):.2g} noises",
        allowed="images of two greys, 3 standard deviations apart",
        cure="average the image before",
    )
    # A matrix fills little of its convex hull: it has holes where the particles are.
    phase: Mask = ~bright if _convexity(~bright) > _convexity(bright) else bright
    unevenness = _unevenness(smooth, ~phase) / contrast
    require(
        unevenness <= 0.2,
        name,
        value=f"light that differs by {unevenness:.2g} of the contrast",
        allowed="values up to 0.2",
        cure="subtract the background, for example by skimage.restoration.rolling_ball",
    )
    return phase


def _label_particles(phase: Mask) -> NDArray[np.int_]:
    """Return the number of the particle at each pixel of a mask, from 1, and 0 outside.

    Particles that touch are parted by a watershed on the distance to the background.

    Args:
        phase: True in particles, shape (rows, columns).

    Returns:
        Whole numbers of the same shape; all 0 for an empty mask.
    """
    from scipy import ndimage
    from skimage import feature, measure, segmentation

    # Smoothing by a pixel removes the false peaks of a ragged outline.
    depth = ndimage.gaussian_filter(ndimage.distance_transform_edt(phase), 1.0)
    parts = measure.label(phase)  # type: ignore[no-untyped-call]
    # Peaks nearer than the smallest radius belong to one particle.
    peaks = feature.peak_local_max(depth, round(MIN_RADIUS), labels=parts, exclude_border=False)  # type: ignore[no-untyped-call]
    seeds = np.zeros(phase.shape, int)
    seeds[tuple(peaks.T)] = np.arange(1, len(peaks) + 1)
    labels: NDArray[np.int_] = segmentation.watershed(-depth, seeds, mask=phase)  # type: ignore[no-untyped-call]
    return labels


def _convexity(phase: Mask) -> float:
    """Return the area of all particles of a phase over the area of their convex hulls, in [0, 1].

    Pieces with less area than a circle of 4 pixels radius are left out; 0 if none is left.

    Args:
        phase: True in the phase, shape (rows, columns).
    """
    from skimage import measure

    pieces = measure.regionprops(_label_particles(phase))  # type: ignore[no-untyped-call]
    large = [piece for piece in pieces if piece.area >= np.pi * MIN_RADIUS**2]
    hulls = sum(piece.area_convex for piece in large)
    return float(sum(piece.area for piece in large) / hulls) if hulls else 0.0


def _unevenness(smooth: Array, matrix: Mask) -> float:
    """Return the range of the matrix's median grey value over 8 × 8 tiles of the image.

    Pixels within 4 of particles, where smoothing mixes greys, do not count, nor do tiles with fewer
    than 64 pixels that count. With fewer than two tiles the range is 0.

    Args:
        smooth: Smoothed grey values, shape (rows, columns).
        matrix: True outside the particles, same shape.
    """
    from scipy import ndimage

    core = ndimage.binary_erosion(matrix, iterations=4)
    greys = np.where(core, smooth, np.nan)
    medians = [0.0]  # for an image without any tile that counts
    for band in np.array_split(greys, 8):
        for tile in np.array_split(band, 8, axis=1):
            if np.count_nonzero(~np.isnan(tile)) >= 64:
                medians.append(float(np.nanmedian(tile)))
    return float(np.ptp(medians[1:] or medians))
