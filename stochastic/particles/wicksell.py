"""Law of sphere radii from circle radii in a plane section (Wicksell, Biometrika 17, 84, 1925).

A plane hits a sphere of radius R with a chance in proportion to R, and cuts a circle greater than r
with the chance √(1 − r²/R²). Spheres hardly larger than the smallest visible circle almost never
show one: how many of them there are the section does not tell.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.refused import RefusedError
from alphacut.stochastic.particles.radius_laws import MeasuredRadii, require_radii

BINS = 16  # of the law of spheres
FEWEST = 10  # circles


def unfolded(circles: ArrayLike, *, visible: float, largest: float) -> MeasuredRadii:
    """Law of sphere radii behind the circles, by number: Saltykov's, by least squares.

    Shares of bins in the law of spheres hit, none negative, whose share of circles greater than r
    is nearest to the circles' own.

    Args:
        circles: Radii of circles greater than `visible`, shape (n,), in m.
        visible: Radius from which on every circle is seen, and the smallest sphere, in m.
        largest: Radius that no sphere exceeds, in m.

    Raises:
        RefusedError: There are fewer than ten circles, or some lie outside the two radii.
    """
    from scipy.optimize import nnls

    circles = np.asarray(circles, float)
    require_radii("visible", visible)
    if circles.size < FEWEST or circles.min() < visible or circles.max() > largest:
        allowed = f"{FEWEST} or more between {visible:g} and {largest:g} m"
        raise RefusedError("circles", f"{circles.size} radii", allowed)
    edges = np.geomspace(visible, largest, BINS + 1)
    middle = np.sqrt(edges[1:] * edges[:-1])
    heights = np.geomspace(visible, largest, 8 * BINS + 1)[:-1]
    seen = (circles[None] > heights[:, None]).mean(axis=1)
    kernel = np.sqrt(np.maximum(1 - (heights[:, None] / middle) ** 2, 0.0))
    hit = nnls(kernel / kernel[0], seen)[0] / kernel[0]
    share = np.concatenate([[0.0], np.cumsum(hit / middle)])
    grade = (np.arange(4000) + 0.5) / 4000
    return MeasuredRadii(tuple(np.interp(grade, share / share[-1], edges)), "unfolded circles")
