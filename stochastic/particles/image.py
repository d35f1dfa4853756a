"""Circles from the image of a section.

The image is smoothed, cut at Otsu's threshold, and split by a watershed on the distance to the
background where particles touch. Each particle becomes the circle of its centroid and area; its
area counts every pixel by the share that the smoothed grey value gives it, which places the edge to
a fraction of a pixel.

Tested limits: radii of 8 pixels or more, gaps of 3 or more, contrast at least 5 times the standard
deviation of the noise: the count is exact and half of the radii are within half a pixel. Particles
that the image's edge cuts are listed as rejected: their circle is not known.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.stochastic.particles.circles_csv import MeasuredCircles
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.theta.truncated_normal import Array

# pixels by which a particle at the image's edge may be narrower than its area tells before it
# counts as cut
CUT = 1.2
PARTICLES = ("auto", "bright", "dark")


@dataclass(frozen=True)
class SectionImage:
    """An image of a section with round particles of one brightness in a matrix of another.

    Args:
        path: Image file.
        pixel: Side of a pixel, in m.
        particles: "bright" or "dark" against the matrix; "auto" takes the sort that the image's
            edge shows less of.
        smallest: Least radius that counts as a particle, in pixels.
        smoothing: Standard deviation of the smoothing, in pixels.
        roundness: Least share of its own smallest round hull (diameter = longest chord) that a
            particle must fill.

    Raises:
        ValueError: A value lies outside its range.
    """

    path: Path
    pixel: float
    particles: str = "auto"
    smallest: float = 4.0
    smoothing: float = 1.5
    roundness: float = 0.7

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
        return self.circles(picture.astype(float))

    def circles(self, picture: Array) -> MeasuredCircles:
        """Circles of a grey image, shape (rows, columns); y points up from the lower edge, in m."""
        from skimage import measure

        share, labels = self._segmented(picture)
        height, width = picture.shape
        found, rejected = [], {}
        for region in measure.regionprops(labels):  # type: ignore[no-untyped-call]
            top, left, bottom, right = region.bbox
            circle = _circle(share, labels, region.label, region.bbox)
            at_edge = top == 0 or left == 0 or bottom == height or right == width
            if circle[2] < self.smallest:
                rejected[region.label] = f"is smaller than {self.smallest:g} pixels in radius"
            elif at_edge and 2 * circle[2] - min(bottom - top, right - left) > CUT:
                rejected[region.label] = "is cut by the image's edge"
            elif region.area < self.roundness * np.pi / 4 * region.feret_diameter_max**2:
                rejected[region.label] = "is not round"
            else:
                found.append(circle)
        if not found:
            raise ValueError(
                f"{self.path} shows no round particle of {self.smallest:g} pixels or more in"
                " radius; is the contrast right?"
            )
        row, column, radius = np.array(found).T
        centres = np.stack([column + 0.5, height - row - 0.5], axis=1) * self.pixel
        return MeasuredCircles(
            Discs(
                centres, radius * self.pixel, np.array([width, height]) * self.pixel, periodic=False
            ),
            rejected,
        )

    def _segmented(self, picture: Array) -> tuple[Array, Array]:
        """Particle's share of each pixel, in [0, 1], and labels of the particles."""
        from scipy import ndimage
        from skimage import feature, filters, segmentation

        smooth = ndimage.gaussian_filter(picture, self.smoothing)
        if not np.ptp(smooth) > 0:
            raise ValueError(f"{self.path} is of one grey throughout; nothing can be told apart")
        threshold = filters.threshold_otsu(smooth)  # type: ignore[no-untyped-call]
        mask = smooth > threshold
        edge = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
        if self.particles == "dark" or (self.particles == "auto" and edge.mean() > 0.5):
            mask = ~mask
        within, without = np.median(smooth[mask]), np.median(smooth[~mask])
        share = np.clip((smooth - without) / (within - without), 0, 1)
        depth = ndimage.gaussian_filter(ndimage.distance_transform_edt(mask), 1.0)
        parts, apart = ndimage.label(mask)[0], max(2, round(self.smallest))
        peaks = feature.peak_local_max(depth, apart, labels=parts, exclude_border=False)  # type: ignore[no-untyped-call]
        seeds = np.zeros(mask.shape, int)
        seeds[tuple(peaks.T)] = np.arange(1, len(peaks) + 1)
        return share, segmentation.watershed(-depth, seeds, mask=mask)  # type: ignore[no-untyped-call]


def _circle(
    share: Array, labels: Array, label: int, box: tuple[int, int, int, int]
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
