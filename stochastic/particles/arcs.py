"""Touching discs told apart by the arcs of their common outline.

Smoothing closes the gap between three discs that touch and fills the necks between two. Distances
to the background then peak in the wrong places; the arcs that are left still tell each disc. Each
point of the outline votes for centres along its inward normal; a circle is fitted to the points of
an arc, and taken if it lies within the cluster.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from alphacut.stochastic.particles.touching import Labels
from alphacut.stochastic.theta.truncated_normal import Array

ARC = 0.18  # share of its circumference that a disc must show
NEAR = 1.5  # pixels from its circle at which a point or pixel still agrees
ALONG = 0.9  # cosine of the angle between a point's normal and its radius
WITHIN = 0.93  # share of a circle's pixels that must be particle
DEEP = 0.5  # of the smaller radius, by which two discs overlap at most
DIFFERENT = 0.03  # share of a cluster's pixels that its circles may miss or add without being told
FOREIGN = 0.1  # share above which they are not taken
TOLD = 0.5  # share of the outline that must lie on the circles
STEPS = 8  # of a circle's fit
PIXELS_OF_EDGE = 5.66  # of a disc's outline, over its radius


@dataclass(frozen=True)
class Outline:
    """Points between particle and matrix, and the unit normals into the particle; both (n, 2)."""

    points: Array
    inward: Array

    def near(self, circle: Array) -> NDArray[np.bool_]:
        """Points on a circle (row, column, radius) that look to its centre."""
        line = circle[:2] - self.points
        distance = np.maximum(np.hypot(*line.T), 1e-9)
        looks = (line * self.inward).sum(1) > ALONG * distance
        return np.asarray(looks & (abs(distance - circle[2]) < NEAR))

    def without(self, taken: NDArray[np.bool_]) -> Outline:
        """The other points."""
        return Outline(self.points[~taken], self.inward[~taken])


class Parting(NamedTuple):
    """What a cluster is made of.

    Args:
        circles: Row, column and radius of its discs, shape (n, 3).
        rest: Number of the piece, from 1, that no circle holds at each pixel.
        differs: Share of the cluster's pixels that circles miss or add, pieces at the edge of the
            image left out.
        unsure: Row and column of the pixels that circles miss or add, and of each such piece.
    """

    circles: Array
    rest: Labels
    differs: float
    unsure: list[tuple[float, float]]


def outline(share: Array, mask: NDArray[np.bool_]) -> Outline:
    """The outline of a mask at half of the particle's share, to a fraction of a pixel."""
    from scipy import ndimage

    edge = mask & ~ndimage.binary_erosion(mask, border_value=1)
    rows, columns = np.nonzero(edge)
    slope = np.stack([each[edge] for each in np.gradient(share)], axis=1)
    steep = np.maximum(np.hypot(*slope.T), 1e-3)[:, None]
    shift = np.clip((0.5 - share[edge])[:, None] / steep, -1, 1)
    inward = slope / steep
    return Outline(np.stack([rows, columns], axis=1) + shift * inward, inward)


def parted(
    share: Array, mask: NDArray[np.bool_], seen: NDArray[np.bool_], smallest: float
) -> Parting:
    """Circles of the discs that a mask is made of.

    Args:
        share: Particle's share of each pixel.
        mask: Pixels of the cluster, with a rim of others around.
        seen: Pixels of the image; what lies beyond its edge may be particle or not.
        smallest: Least radius, in pixels.
    """
    from scipy import ndimage

    left = outline(share, mask & seen)
    left = left.without(np.hypot(*left.inward.T) < 0.5)
    points = len(left.points)
    steepness = np.hypot(*np.gradient(share))[mask & ~ndimage.binary_erosion(mask)]
    blur = 1 / np.sqrt(2 * np.pi) / float(np.quantile(steepness, 0.75))
    deepest = float(ndimage.distance_transform_edt(mask).max())
    taken: list[Array] = []
    for start in _voted(left, mask.shape, np.arange(smallest, 1.3 * deepest + 2)):
        circle = _fitted(start, left)
        on = left.near(circle)
        if on.sum() < ARC * PIXELS_OF_EDGE * circle[2] or circle[2] < smallest:
            continue
        if _inside(circle, mask, seen) >= WITHIN and not any(_same(circle, one) for one in taken):
            taken.append(circle)
            left = left.without(on)
    circles = np.array(taken).reshape(-1, 3)
    wrong = _wrong(circles, mask, blur) & seen
    rest = _rest(wrong & mask, mask & (_beyond(circles, mask.shape) > 0), smallest)
    inner = np.setdiff1d(rest, [0, *rest[ndimage.binary_dilation(~seen, iterations=2)]])
    differs = (wrong & ((rest == 0) | np.isin(rest, inner))).sum() / mask.sum()
    places = [np.argwhere(rest == piece).mean(0) for piece in inner]
    if len(left.points) > (1 - TOLD) * points:
        differs = 1.0  # an outline that is not of discs
    if differs > DIFFERENT:
        places = [np.argwhere(wrong if wrong.any() else mask).mean(0)]
    return Parting(circles, rest, float(differs), [(float(x), float(y)) for x, y in places])


def _voted(edge: Outline, shape: tuple[int, ...], radii: Array) -> Array:
    """Circles that most points vote for, the best first, shape (n, 3)."""
    from scipy import ndimage
    from skimage import feature

    votes = []
    for radius in radii:
        at = np.rint(edge.points + radius * edge.inward).astype(int)
        at = at[((at >= 0) & (at < shape)).all(1)]
        count = np.zeros(shape)
        np.add.at(count, tuple(at.T), 1.0)
        width = 1 + 0.05 * radius
        density = ndimage.gaussian_filter(count, width, truncate=2.5)
        votes.append(density * width**2 / np.sqrt(radius))
    best = np.max(votes, axis=0)
    peaks = feature.peak_local_max(best, 2, exclude_border=False)  # type: ignore[no-untyped-call]
    order = np.argsort(-best[tuple(peaks.T)], kind="stable")
    radius = radii[np.argmax(votes, axis=0)[tuple(peaks.T)]]
    return np.column_stack([peaks, radius])[order].astype(float)


def _fitted(circle: Array, edge: Outline) -> Array:
    """Least squares of the distances to the points of an arc, which are told anew at each step."""
    for _ in range(STEPS):
        line = edge.points[edge.near(circle)] - circle[:2]
        if len(line) < 6:
            break
        distance = np.maximum(np.hypot(*line.T), 1e-9)
        slopes = np.column_stack([line / distance[:, None], np.ones(len(line))])
        step = np.linalg.lstsq(slopes, distance - circle[2], rcond=1e-3)[0]
        circle = circle + np.clip(step, -2, 2)
    return circle


def _same(one: Array, other: Array) -> bool:
    """Two circles overlap by more than discs do."""
    distance = np.hypot(*(one[:2] - other[:2]))
    return bool(one[2] + other[2] - distance > DEEP * min(one[2], other[2]))


def _beyond(circles: Array, shape: tuple[int, ...]) -> Array:
    """Least distance of each pixel to a circle's edge, negative inside it."""
    rows, columns = np.mgrid[tuple(slice(size) for size in shape)]
    beyond = np.full(shape, np.inf)
    for row, column, radius in circles:
        beyond = np.minimum(beyond, np.hypot(rows - row, columns - column) - radius)
    return beyond


def _inside(circle: Array, mask: NDArray[np.bool_], seen: NDArray[np.bool_]) -> float:
    """Share of a circle's pixels that are particle."""
    within = (_beyond(circle[None], mask.shape) < 0) & seen
    return float(mask[within].mean()) if within.any() else 0.0


def _wrong(circles: Array, mask: NDArray[np.bool_], blur: float) -> NDArray[np.bool_]:
    """Pixels that circles miss or add further than `NEAR` from their edge.

    Blur closes gaps between circles as it does between discs.
    """
    from scipy import ndimage

    beyond = _beyond(circles, mask.shape)
    covered = ndimage.gaussian_filter((beyond < 0).astype(float), blur) > 0.5
    return np.asarray((mask != (covered | (beyond < 0))) & (abs(beyond) > NEAR))


def _rest(missed: NDArray[np.bool_], free: NDArray[np.bool_], smallest: float) -> Labels:
    """Pieces as large as a particle among the pixels missed, with their rim of free pixels."""
    from scipy import ndimage

    pieces = ndimage.label(missed)[0]
    sizes = np.bincount(pieces.ravel())
    large = missed & (sizes[pieces] >= np.pi * smallest**2)
    return np.asarray(ndimage.label(ndimage.binary_dilation(large, iterations=2) & free)[0])


def deepest_in(circles: Array, rows: Labels, columns: Labels) -> Labels:
    """Number of the circle whose edge each pixel lies deepest inside, shape (n,)."""
    away = [np.hypot(rows - one[0], columns - one[1]) - one[2] for one in circles]
    return np.asarray(np.argmin(away, axis=0))
