"""Radius map of spheres whose sections show the paper's circles.

    ./enter python -m benchmarks.stochastic.sphere_map

The paper's circles have log-normal radii over a factor of ten (eq. 11). Their law is unfolded to
that of spheres (Wicksell); the spheres are packed and divided into power cells. They are packed so
densely that the map has the volume fraction that the paper's map has as area fraction, 0.2092.
Prints the section [radius]. That of cases/paper-3d.toml came from other packings, and ends at 0.95.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls

from alphacut.fuzzy.arrays import Array
from alphacut.stochastic.microstructure import MicrostructureStudy, fragment, study, summary
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.particles import SPHERES
from alphacut.stochastic.particles.radius_laws import LogNormalRadii, MeasuredRadii
from alphacut.stochastic.sections import Simulated

FRACTION = 0.2092  # of the paper's map
CIRCLES = 200_000
BINS = 16  # of the law of spheres


def unfolded(circles: Array, *, visible: float, largest: float) -> MeasuredRadii:
    """Law of sphere radii behind circles in a plane (Wicksell, Biometrika 17, 84, 1925).

    Saltykov's, by least squares: a plane hits a sphere of radius R with a chance in proportion to
    R, and cuts a circle greater than r with the chance √(1 − r²/R²).

    Args:
        circles: Radii of circles, shape (n,), in m.
        visible: Radius from which on every circle is seen, and the smallest sphere, in m.
        largest: Radius that no sphere exceeds, in m.
    """
    edges = np.geomspace(visible, largest, BINS + 1)
    middle = np.sqrt(edges[1:] * edges[:-1])
    heights = np.geomspace(visible, largest, 8 * BINS + 1)[:-1]
    seen = (circles[None] > heights[:, None]).mean(axis=1)
    kernel = np.sqrt(np.maximum(1 - (heights[:, None] / middle) ** 2, 0.0))
    hit = nnls(kernel / kernel[0], seen)[0] / kernel[0]
    share = np.concatenate([[0.0], np.cumsum(hit / middle)])
    grade = (np.arange(4000) + 0.5) / 4000
    return MeasuredRadii(tuple(np.interp(grade, share / share[-1], edges)), "unfolded circles")


def main(arguments: Sequence[str] | None = None) -> None:
    """Computes and prints."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--spheres", type=int, default=2000, help="in each packing (2000)")
    parser.add_argument("--packings", type=int, default=20, help="number of packings (20)")
    parser.add_argument("--seed", type=int, default=1, help="of everything left to chance (1)")
    options = parser.parse_args(arguments)
    circles = LogNormalRadii(1e-3, 1e-2).sample(CIRCLES, np.random.default_rng(options.seed))
    law = unfolded(circles, visible=1e-3, largest=1e-2)
    packing = Packing(options.spheres, FRACTION, law, shape=SPHERES)
    result = study(MicrostructureStudy(Simulated(packing, options.packings), seed=options.seed))
    print(fragment(summary(result)), end="")
    print(f"# share of the volume beyond r_n = {SPHERES.reach:g}: {result.share_capped:.4f}")


if __name__ == "__main__":
    main()
