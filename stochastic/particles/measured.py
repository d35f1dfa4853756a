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
from alphacut.base.errors import RefusedError, checked_number, require, require_numbers
from alphacut.base.pictures import opened_picture
from alphacut.stochastic.particles.csv_columns import length_columns
from alphacut.stochastic.particles.particles import Particles, close_pairs, surface_distance
from alphacut.stochastic.particles.radius_distributions import require_radii

SMOOTHING = 1.5  # standard deviation, in pixels
SMALLEST = 4.0  # least radius of a particle, in pixels
ROUND = 0.9  # share of its convex hull that a round piece fills
MAX_NOT_ROUND = 0.02  # share of the particles' area in pieces that are not round
NOISE = 3.0  # distance of the two greys over their standard deviation, at least
MAX_UNEVENNESS = 0.2  # of the contrast, by which the matrix may differ between tiles
TILES = 8  # along each side of the image
ROUNDING = 1e-9  # overlap over the smaller radius that is no overlap


def read_particles(
    path: str | Path,
    *,
    size: tuple[float, float] | None = None,
    pixel: float | None = None,
) -> Particles:
    r"""Read the circles of a section from a CSV file, or find them in an image of it.

    Args:
        path: CSV file with the columns ``x [mm], y [mm], r [mm]`` (or d, a diameter), where `size`
            is given; image of round particles of one brightness in a matrix of another, where
            `pixel` is.
        size: Width and height of the section, a window with a corner at the origin, in m.
        pixel: Side of a pixel, in m.

    Returns:
        The circles, in m from the section's corner.

    Raises:
        RefusedError: The file cannot be read, circles leave the section or overlap, or the image
            hides its particles; or not one of `size` and `pixel` is given.

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
    """Return the circles of a CSV file, all inside the section and without overlap."""
    rows, values = length_columns(path, ("x", "y", "r"))
    centres, radii = values[:, :2], values[:, 2]
    for row, centre, radius in zip(rows, centres, radii, strict=True):
        require_radii(f"{path.name}, row {row}", radius)
        if not ((centre >= 0) & (centre <= size)).all():
            value = f"a centre {(1e3 * centre).round(6).tolist()} mm from the corner"
            width, height = (f"{1e3 * side:g}" for side in size)
            allowed = f"places in the section of {width} × {height} mm"
            raise RefusedError(f"{path.name}, row {row}", value, allowed)
    discs = Particles(centres, radii, np.array(size), periodic=False)
    first, second = close_pairs(discs, 0.0)
    overlap = -surface_distance(discs, first, second) / np.minimum(radii[first], radii[second])
    if overlap.max(initial=0.0) > ROUNDING:
        worst = int(np.argmax(overlap))
        upper, lower = sorted(int(rows[k]) for k in (first[worst], second[worst]))
        value = f"a circle that overlaps that of row {upper} by {overlap[worst]:.2g} of its radius"
        key, allowed = f"{path.name}, row {lower}", "circles that do not overlap"
        raise RefusedError(key, value, allowed, "mend the row")
    return discs


def section_picture(path: Path) -> Array:
    """Return the grey values of the image file, (rows, columns); refuse other files."""
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
    """Return the circles, of equal area and centroid, of the particles in a grey image, in m.

    The particles are the phase whose pieces fill more of their convex hulls. Those that touch the
    edge are left out. An image whose particles noise or light hide, or of which too many are not
    round, is refused.

    Args:
        picture: Grey values, shape (rows, columns); y rises from the lower edge.
        pixel: Side of a pixel, in m.
        name: Name of the image in messages.
    """
    from skimage import measure

    phase = _particle_mask(picture, name)
    rows, columns = phase.shape
    circles, not_round_area = [], 0.0
    for piece in measure.regionprops(_label_particles(phase)):  # type: ignore[no-untyped-call]
        top, left, bottom, right = piece.bbox
        if min(top, left) == 0 or bottom == rows or right == columns:
            continue
        if piece.area < np.pi * SMALLEST**2 or piece.solidity < ROUND:
            not_round_area += piece.area
        else:
            circles.append((*piece.centroid, piece.equivalent_diameter_area / 2))
    fraction = not_round_area / max(phase.sum(), 1)
    value = f"{fraction:.1%} of the particles' area in pieces that are not round, beside"
    value += f" {len(circles)} that are"
    is_round = bool(circles) and fraction <= MAX_NOT_ROUND
    allowed = f"images with round particles, up to {MAX_NOT_ROUND:.0%} of others"
    cure = "take the image itself as the cell: cell.image"
    require(is_round, name, value=value, allowed=allowed, cure=cure)
    row, column, radius = np.array(circles).T
    centres = np.stack([column + 0.5, rows - row - 0.5], axis=1)  # y from the lower edge
    size = np.array([columns, rows]) * pixel
    return Particles(centres * pixel, radius * pixel, size, periodic=False)


def _particle_mask(picture: Array, name: str) -> Mask:
    """Mask of the particles' pixels, by Otsu's threshold of the smoothed image."""
    # the phase whose pieces fill more of their convex hulls is that of the particles
    from skimage import filters

    smooth = filters.gaussian(picture, SMOOTHING, preserve_range=True)  # type: ignore[no-untyped-call]
    bright = smooth > filters.threshold_otsu(smooth)  # type: ignore[no-untyped-call]
    greys = [smooth[part] for part in (bright, ~bright) if part.any()]
    contrast = float(np.ptp([np.median(grey) for grey in greys]))
    noise = float(np.sqrt(np.mean([np.var(grey) for grey in greys])))
    is_clear = len(greys) == 2 and contrast >= NOISE * noise
    value = f"one of {len(greys)} greys, apart by {contrast / max(noise, 1e-300):.2g} noises"
    allowed = f"images of two greys, {NOISE:g} standard deviations apart"
    cure = "average the image before"
    require(is_clear, name, value=value, allowed=allowed, cure=cure)
    phase: Mask = ~bright if _convexity(~bright) > _convexity(bright) else bright
    unevenness = _unevenness(smooth, ~phase) / contrast
    value = f"light that differs by {unevenness:.2g} of the contrast"
    is_even, allowed = unevenness <= MAX_UNEVENNESS, f"values up to {MAX_UNEVENNESS:g}"
    cure = "subtract the background, for example by skimage.restoration.rolling_ball"
    require(is_even, name, value=value, allowed=allowed, cure=cure)
    return phase


def _label_particles(phase: Mask) -> NDArray[np.int_]:
    """Number of the particle at each pixel, 0 outside; touching ones are parted by a watershed."""
    from scipy import ndimage
    from skimage import feature, measure, segmentation

    depth = ndimage.gaussian_filter(ndimage.distance_transform_edt(phase), 1.0)
    parts = measure.label(phase)  # type: ignore[no-untyped-call]
    peaks = feature.peak_local_max(depth, round(SMALLEST), labels=parts, exclude_border=False)  # type: ignore[no-untyped-call]
    seeds = np.zeros(phase.shape, int)
    seeds[tuple(peaks.T)] = np.arange(1, len(peaks) + 1)
    labels: NDArray[np.int_] = segmentation.watershed(-depth, seeds, mask=phase)  # type: ignore[no-untyped-call]
    return labels


def _convexity(phase: Mask) -> float:
    """Return the area of all particles of a phase over that of their convex hulls."""
    from skimage import measure

    pieces = measure.regionprops(_label_particles(phase))  # type: ignore[no-untyped-call]
    large = [piece for piece in pieces if piece.area >= np.pi * SMALLEST**2]
    hulls = sum(piece.area_convex for piece in large)
    return float(sum(piece.area for piece in large) / hulls) if hulls else 0.0


def _unevenness(smooth: Array, matrix: Mask) -> float:
    """Return the range of the matrix's median grey value over 8 × 8 tiles of the image."""
    from scipy import ndimage

    core = ndimage.binary_erosion(matrix, iterations=4)
    greys = np.where(core, smooth, np.nan)
    rows = np.array_split(greys, TILES)
    tiles = [tile[~np.isnan(tile)] for row in rows for tile in np.array_split(row, TILES, axis=1)]
    return float(np.ptp([np.median(tile) for tile in tiles if len(tile) >= 64] or [0.0]))
