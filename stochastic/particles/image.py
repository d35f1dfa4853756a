"""Circles from the image of a section.

The image is smoothed and cut at Otsu's threshold. Particles that touch are told apart by the arcs
of their outline, or by a watershed on the distance to the background where arcs are of no discs.
Each particle becomes the circle of its centroid and area; its
area counts every pixel by the share that the smoothed grey value gives it, which places the edge to
a fraction of a pixel.

Tested limits: radii of 8 pixels or more, gaps of 3 or more, contrast at least 5 times the standard
deviation of the noise: the count is exact and half of the radii are within half a pixel. A piece
that is not round is split into parts that are rounder, if there are any. Particles that the image's
edge cuts are listed as rejected: their circle is not known.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from alphacut.stochastic.particles.annotation import Crop, cropped
from alphacut.stochastic.particles.arcs import FOREIGN, deepest_in, parted
from alphacut.stochastic.particles.circles_csv import MeasuredCircles
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.light import evened
from alphacut.stochastic.particles.touching import (
    CONVEX,
    Labels,
    convexity,
    pushed_apart,
    roundness,
    split,
)
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    from skimage.measure._regionprops import RegionProperties

# pixels by which a particle at the image's edge may be narrower than its area tells before it
# counts as cut
CUT = 1.2
CUT_OFF = "is cut by the image's edge"
LOST = 0.02  # share of the particles' area that may be left out
MISFIT = 0.09  # share of the particles' pixels that may lie outside the circle of their piece
LIT = 0.08  # of the contrast, by which slow light differs over the image before it is evened
LIGHT = 1.0  # of the contrast, to which evening is tested
UNEVEN = 0.2  # of the contrast, by which the brightness of the matrix may differ when evened
TILES = 8  # along each side of the image, over which that brightness is compared
RIM = 6  # pixels around a cluster in which its outline is looked at
STRANGE = 0.4  # of the contrast, by which a pixel lies beyond both phases and is of neither
STRANGERS = 5e-4  # share of such pixels that is warned of
INK = 5.0  # times as many pixels have a drawn grey as the next three greys together
FLATTENED = 0.45  # roundness of a disc that several neighbours overlap
DROP = "[microstructure.image] drop = true"
PARTICLES = ("auto", "bright", "dark")


class Segments(NamedTuple):
    """The particles' pixels.

    Args:
        share: Particle's share of each pixel.
        labels: Number of the particle at each pixel, 0 in the matrix.
        light: Slow light that was evened, over the contrast.
        centres: Row and column of the discs that touch others, by label.
        unsure: Row and column of clusters whose discs are not told for sure.
    """

    share: Array
    labels: Labels
    light: float
    centres: dict[int, tuple[float, float]]
    unsure: list[tuple[float, float]]


@dataclass(frozen=True)
class SectionImage:
    """An image of a section with round particles of one brightness in a matrix of another.

    Args:
        path: Image file.
        pixel: Side of a pixel, in m.
        particles: "bright" or "dark" against the matrix; "auto" takes the phase whose pieces fill
            more of their convex hulls.
        smallest: Least radius that counts as a particle, in pixels.
        smoothing: Standard deviation of the smoothing, in pixels.
        roundness: Least share of its own smallest round hull (diameter = longest chord) that a
            particle must fill.
        drop: Go on where particles left out hold more than `LOST` of the particles' area, or more
            than `MISFIT` of it lies outside the circles.
        crop: The part of the image that is material (left, top, right, bottom, in pixels from the
            upper left corner); None for all of it, which must then have no scale bar or caption.

    Raises:
        ValueError: A value lies outside its range.
    """

    path: Path
    pixel: float
    particles: str = "auto"
    smallest: float = 4.0
    smoothing: float = 1.5
    roundness: float = 0.7
    drop: bool = False
    crop: Crop | None = None

    def __post_init__(self) -> None:
        if not 0 < self.pixel < np.inf:
            raise ValueError(f"a pixel is {self.pixel:g} m wide; it must be positive and finite")
        if self.particles not in PARTICLES:
            raise ValueError(
                f"the particles are {self.particles!r}; take one of {', '.join(PARTICLES)}"
            )
        if not (self.smallest > 0 and self.smoothing >= 0 and 0 <= self.roundness <= 1):
            raise ValueError(
                "the smallest radius must be positive, the smoothing not negative, and the"
                " roundness in [0, 1]"
            )

    def read(self) -> MeasuredCircles:
        """The circles of the image file.

        Raises:
            ValueError: The file is no image, has no contrast, or shows no particle.
        """
        return self.circles(self.material())

    def material(self) -> Array:
        """Grey values of the part that is material, shape (rows, columns).

        Raises:
            ValueError: As `picture`, or `crop` lies outside the image, or what it leaves has a
                rectangle of one grey.
        """
        return cropped(self.picture(), self.crop, self.path)

    def picture(self) -> Array:
        """Grey values of the file, shape (rows, columns).

        Raises:
            ValueError: The file is no plane image of 16 × 16 pixels or more.
        """
        from skimage import color, io

        try:
            picture = np.asarray(io.imread(self.path))
        except Exception as error:  # the readers behind raise what they like
            raise ValueError(f"{self.path} cannot be read as an image: {error}") from error
        if picture.ndim == 3:
            picture = color.rgb2gray(picture[..., :3]) if picture.shape[2] >= 3 else picture[..., 0]
        if picture.ndim != 2 or min(picture.shape) < 16:
            raise ValueError(
                f"{self.path} has the shape {picture.shape}; it takes a plane image of 16 × 16"
                " pixels or more"
            )
        return picture.astype(float)

    def circles(self, picture: Array) -> MeasuredCircles:
        """Circles of a grey image, shape (rows, columns); y points up from the lower edge, in m.

        Raises:
            ValueError: The image has no contrast or no particle, or more than `LOST` of the
                particles' area lies in pieces that are no round particles, unless `drop` is set.
        """
        segmented = self._segmented(picture)
        share, labels, light, _, unsure = segmented
        found, rejected, lost, misfit = self._sorted(segmented)
        if not found:
            raise ValueError(
                f"{self.path} shows no round particle of {self.smallest:g} pixels or more in radius"
                f" ({_counted(rejected)}); {self._cure(picture, segmented, '')}"
            )
        fraction = float(share.mean())
        missing = lost / share.sum()
        if missing > LOST and not self.drop:
            raise ValueError(
                f"{self.path} shows particles on {fraction:.4f} of its area, and {missing:.1%} of"
                f" that lies in pieces that were left out ({_counted(rejected)});"
                f" {self._cure(picture, segmented, ', or drop them: ' + DROP)}"
            )
        if misfit > MISFIT and not self.drop:
            raise ValueError(
                f"{self.path} shows particles on {fraction:.4f} of its area, and {misfit:.1%} of"
                f" that lies outside the circles that would stand for them, where discs that touch"
                f" leave less than {MISFIT:.0%}: the particles are not round;"
                f" {self._cure(picture, segmented, ', or go on with the circles: ' + DROP)}"
            )
        (row, column, radius), (height, width) = np.array(found).T, picture.shape
        centres = np.stack([column + 0.5, height - row - 0.5], axis=1)
        size = np.array([width, height]) * self.pixel
        centres = np.clip(pushed_apart(centres, radius) * self.pixel, 0.0, size)
        discs = Discs(centres, radius * self.pixel, size, periodic=False)
        apart = self._unevenness(share, labels, light)
        strange = _strange(picture, share)
        places = np.array([(column + 0.5, height - row - 0.5) for row, column in unsure])
        unsure_at = places.reshape(-1, 2) * self.pixel
        return MeasuredCircles(
            discs, rejected, fraction, missing, misfit, apart, light, strange, unsure_at
        )

    def _cure(self, picture: Array, segmented: Segments, besides: str) -> str:
        """What helps where pieces are not round: other phase, even light, the image as the cell."""
        share = segmented[0]
        other = "dark" if np.vdot(share - share.mean(), picture) > 0 else "bright"
        turned = replace(self, particles=other)
        seen = turned._segmented(picture)
        found, _, lost, misfit = turned._sorted(seen)
        if found and lost <= LOST * seen[0].sum() and misfit <= MISFIT:
            key = f'[microstructure.image] particles = "{other}"'
            return f"the {other} phase is round: take it as the particles ({key})"
        if (apart := self._unevenness(*segmented[:3])) > UNEVEN:
            return uneven_in_words(apart)
        cell = "particles that are not round need the image itself as the cell ([cell] image)"
        return cell + besides

    def _sorted(
        self, segmented: Segments
    ) -> tuple[list[tuple[float, float, float]], dict[int, str], float, float]:
        """Circles in pixels, reasons of what was left out, pixels left out inside, and the misfit.

        That is the share of the circles' pieces that lies outside their own circle.
        """
        from skimage import measure

        share, labels, _, centres, _ = segmented
        found, rejected, lost = [], {}, 0.0
        beyond, kept = 0.0, 0
        touching = _touching(labels)
        for region in measure.regionprops(labels):  # type: ignore[no-untyped-call]
            circle = _circle(share, labels, region.label, region.bbox)
            circle = (*centres.get(region.label, circle[:2]), circle[2])
            reason = self._reason(region, circle[2], labels.shape, touching[region.label])
            if not all(-0.5 <= x <= n - 0.5 for x, n in zip(circle[:2], labels.shape, strict=True)):
                reason = CUT_OFF
            if not reason:
                found.append(circle)
                rows, columns = region.coords.T
                kept += len(rows)
                beyond += float((np.hypot(rows - circle[0], columns - circle[1]) > circle[2]).sum())
                continue
            rejected[region.label] = reason
            lost += 0.0 if reason == CUT_OFF else np.pi * circle[2] ** 2
        return found, rejected, lost, beyond / max(kept, 1)

    def _reason(
        self, region: RegionProperties, radius: float, shape: tuple[int, ...], touches: bool
    ) -> str:
        """Reason to leave a piece out; empty for a round particle."""
        top, left, bottom, right = region.bbox
        at_edge = top == 0 or left == 0 or bottom == shape[0] or right == shape[1]
        if at_edge and 2 * radius - min(bottom - top, right - left) > CUT:
            return CUT_OFF
        if radius < self.smallest:
            return f"is smaller than {self.smallest:g} pixels in radius"
        least = FLATTENED if touches else self.roundness
        return "is not round" if roundness(*region.coords.T) < least else ""

    def _core(self, phase: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Pixels of one phase away from the smoothed edge, or as far from it as pixels lie."""
        from scipy import ndimage

        depth = ndimage.distance_transform_edt(phase)
        inside: NDArray[np.bool_] = depth >= min(
            3 * self.smoothing + 1, float(np.quantile(depth[phase], 0.8))
        )
        return inside

    def _unevenness(self, share: Array, labels: Labels, light: float) -> float:
        """Greatest difference of the matrix's brightness between tiles, over the contrast."""
        if light > LIGHT:  # whatever evening seems to have left
            return light
        matrix = np.where(self._core(labels == 0), share, np.nan)
        rows = np.array_split(matrix, TILES)
        tiles = [tile[~np.isnan(tile)] for row in rows for tile in np.array_split(row, TILES, 1)]
        return float(np.ptp([np.median(tile) for tile in tiles if len(tile) >= 64] or [0.0]))

    def _segmented(self, picture: Array) -> Segments:
        """The particles' pixels."""
        from scipy import ndimage
        from skimage import filters

        smooth = ndimage.gaussian_filter(picture, self.smoothing)
        if not np.ptp(smooth) > 0:
            raise ValueError(f"{self.path} is of one grey throughout; nothing can be told apart")
        threshold = filters.threshold_otsu(smooth)  # type: ignore[no-untyped-call]
        flat, light = evened(smooth, smooth > threshold, self._core)
        if light > LIT:
            smooth, threshold = flat, 0.5
        else:
            light = 0.0
        mask = smooth > threshold
        # the particles' pieces fill more of their convex hulls
        bright = self.particles != "auto" or self._convexity(mask) > self._convexity(~mask)
        mask = ~mask if self.particles == "dark" or not bright else mask
        within, without = (float(np.median(smooth[self._core(one)])) for one in (mask, ~mask))
        share = (smooth - without) / (within - without)  # noise beyond 0 and 1 cancels in sums
        labels = _rounder(self._pieces(mask), self.roundness, np.pi * self.smallest**2)
        return Segments(share, labels, light, *_parted(share, labels, self.smallest))

    def _pieces(self, mask: NDArray[np.bool_]) -> Labels:
        """Watershed of the distance to the background."""
        from scipy import ndimage
        from skimage import feature, segmentation

        depth = ndimage.gaussian_filter(ndimage.distance_transform_edt(mask), 1.0)
        parts, apart = ndimage.label(mask)[0], max(2, round(self.smallest))
        peaks = feature.peak_local_max(depth, apart, labels=parts, exclude_border=False)  # type: ignore[no-untyped-call]
        seeds = np.zeros(mask.shape, int)
        seeds[tuple(peaks.T)] = np.arange(1, len(peaks) + 1)
        labels: Labels = segmentation.watershed(-depth, seeds, mask=mask)  # type: ignore[no-untyped-call]
        return _convex_whole(labels, parts)

    def _convexity(self, mask: NDArray[np.bool_]) -> float:
        """Area of all pieces over that of their convex hulls."""
        from skimage import measure

        pieces = measure.regionprops(self._pieces(mask))  # type: ignore[no-untyped-call]
        large = [piece for piece in pieces if piece.area >= np.pi * self.smallest**2]
        hulls = sum(piece.area_convex for piece in large)
        return sum(piece.area for piece in large) / hulls if hulls else 0.0


def uneven_in_words(apart: float) -> str:
    """Uneven light and its cure; `apart` is a share of the contrast."""
    return (
        f"the light is uneven, the matrix's brightness differs by {apart:.2f} of the contrast over"
        " the image: subtract the background in the program that makes the image"
    )


def _strange(picture: Array, share: Array) -> float:
    """Share of the pixels far beyond both phases: broad ones, and all of one outermost grey."""
    beyond = np.abs(share - 0.5) > 0.5 + STRANGE
    low, high = sorted(float(np.median(picture[part])) for part in (share < 0.5, share >= 0.5))
    values, counts = np.unique(picture, return_counts=True)
    for end, near in ((0, slice(1, 4)), (-1, slice(-4, -1))):
        far = max(low - values[end], values[end] - high) > STRANGE * (high - low)
        if far and counts[end] > INK * counts[near].sum():
            beyond |= picture == values[end]
    return float(beyond.mean())


def _counted(rejected: Mapping[int, str]) -> str:
    """Pieces that were left out, by reason."""
    told = Counter(rejected.values()).most_common()
    return ", ".join(f"{count} {reason.replace('is ', '', 1)}" for reason, count in told) or "none"


def _convex_whole(labels: Labels, parts: Labels) -> Labels:
    """Labels where a connected part without a neck is one piece, whatever its distances say."""
    from scipy import ndimage

    for part, window in enumerate(ndimage.find_objects(parts), start=1):
        here = parts[window] == part
        pieces = np.unique(labels[window][here])
        if len(pieces) > 1 and convexity(*np.nonzero(here)) >= CONVEX:
            labels[window][here] = pieces.max()
    return labels


def _rounder(labels: Labels, least: float, smallest: float) -> Labels:
    """Labels where pieces that are not round are split into parts that are, if they can be."""
    from scipy import ndimage

    new = labels.max() + 1
    for label, window in enumerate(ndimage.find_objects(labels), start=1):
        if window is None:
            continue
        rows, columns = np.nonzero(labels[window] == label)
        parts = split(rows, columns, least, smallest)
        for part in range(1, parts.max() + 1):
            labels[window][rows[parts == part], columns[parts == part]] = new
            new += 1
    return labels


def _parted(
    share: Array, labels: Labels, smallest: float
) -> tuple[dict[int, tuple[float, float]], list[tuple[float, float]]]:
    """Centres of discs by the arcs of clusters, which are labelled anew, and clusters left as is.

    A cluster keeps its pieces where circles differ from its pixels by more than `FOREIGN`.
    """
    from scipy import ndimage

    clusters = ndimage.label(labels > 0)[0]
    centres: dict[int, tuple[float, float]] = {}
    unsure = []
    for number, window in enumerate(ndimage.find_objects(clusters), start=1):
        here = clusters[window] == number
        rows, columns = np.nonzero(here)
        if len(rows) < np.pi * smallest**2 or convexity(rows, columns) >= CONVEX:
            continue
        found = parted(*_padded(share, window, here), smallest)
        corner = np.array([one.start for one in window])
        if found.differs <= FOREIGN or len(np.unique(labels[window][here])) > 1:
            unsure += [(x, y) for x, y in np.array(found.unsure).reshape(-1, 2) + corner - RIM]
        if found.differs > FOREIGN:
            continue
        new = labels.max() + 1
        circles = found.circles - np.array([RIM, RIM, 0])
        rest = found.rest[rows + RIM, columns + RIM]
        own = deepest_in(circles, rows, columns)
        labels[window][here] = new + np.where(rest, len(circles) + rest - 1, own)
        at = circles[:, :2] + corner
        centres |= {new + k: (float(x), float(y)) for k, (x, y) in enumerate(at)}
    return centres, unsure


def _padded(
    share: Array, window: tuple[slice, slice], here: NDArray[np.bool_]
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """A window's shares, pixels and what is seen with a rim of the next ones, or none beyond."""
    rim = tuple(slice(one.start, one.stop + 2 * RIM) for one in window)
    seen = np.pad(np.ones(share.shape, bool), RIM)[rim]
    return np.pad(share, RIM, mode="edge")[rim], np.pad(here, RIM), seen


def _touching(labels: Labels) -> NDArray[np.bool_]:
    """Labels whose pixels have a pixel of another particle beside them, shape (labels + 1,)."""
    touching = np.zeros(labels.max() + 1, bool)
    for one, other in ((labels[1:], labels[:-1]), (labels[:, 1:], labels[:, :-1])):
        meet = (one != other) & (one > 0) & (other > 0)
        touching[one[meet]] = touching[other[meet]] = True
    return touching


def _circle(
    share: Array, labels: Labels, label: int, box: tuple[int, int, int, int]
) -> tuple[float, float, float]:
    """Centroid (row, column) and radius of a particle, in pixels.

    Pixels up to four away count by their share too, unless another particle is nearer: the smoothed
    edge is wider than the mask.
    """
    from scipy import ndimage

    rim = 4
    window = tuple(
        slice(max(0, low - rim), min(end, high + rim))
        for low, high, end in zip(box[:2], box[2:], share.shape, strict=True)
    )
    here = labels[window]
    mine = ndimage.distance_transform_edt(here != label)
    others = (
        ndimage.distance_transform_edt((here == 0) | (here == label))
        if ((here != 0) & (here != label)).any()
        else np.inf
    )
    weight = np.where((mine <= rim) & (mine <= others), share[window], 0.0)
    rows, columns = np.mgrid[window]
    area = weight.sum()
    return (
        float((weight * rows).sum() / area),
        float((weight * columns).sum() / area),
        float(np.sqrt(area / np.pi)),
    )
