"""Radius map of spheres whose sections show the paper's circles.

    ./enter python -m benchmarks.stochastic.sphere_map

The paper's circles: log-normal radii over a factor of ten (eq. 11). Their law is unfolded to that
of spheres (Wicksell), the spheres are packed and divided into power cells; r_n = r / (V^⅓/2),
weighted by volume, between two limits as in the paper. They are packed so densely that the
fitted map has the volume fraction that the paper's map has as area fraction, 0.2092. Prints the
map that cases/paper-3d.toml has, and writes sphere_map.csv to benchmarks/results/.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from alphacut.stochastic.fit.hermite_fit import HermiteFit
from alphacut.stochastic.fit.pbox import least_pbox
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.radius_map import HermiteMap
from alphacut.stochastic.spheres.packing import SpherePacking
from alphacut.stochastic.spheres.power_cells import reduced_radii, volume_fraction
from alphacut.stochastic.spheres.wicksell import unfolded
from alphacut.stochastic.theta.quadrature import gauss_rule
from alphacut.stochastic.theta.truncated_normal import TruncatedNormal

RESULTS = Path(__file__).parents[1] / "results"
FRACTION = 0.2092  # of the paper's map
LIMIT = 0.95  # of r_n; a cell may hold more than a cubic array, up to (6/π)^⅓ = 1.24
SHARE = 0.9927  # of the volume above the lower limit, as the paper keeps of the area
LEVEL = 0.99


def fraction_of(radius_map: HermiteMap) -> float:
    """Mean volume fraction of a map, π/6 E[r³]."""
    rule = gauss_rule(radius_map.distribution, points=40)
    return float(np.pi / 6 * rule.weights @ radius_map(rule.nodes) ** 3)


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute, write, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--spheres", type=int, default=2000, help="in each packing (2000)")
    parser.add_argument("--packings", type=int, default=20, help="number of packings (20)")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    options = parser.parse_args(arguments)
    generator = np.random.default_rng(1)
    law = unfolded(
        LogNormalRadii(1e-3, 1e-2).sample(200_000, generator), visible=1e-3, largest=1e-2
    )
    packed = FRACTION
    for count in (5, 5, 5, 5, 5, options.packings):
        packing = SpherePacking(options.spheres, packed, law)
        whole = reduced_radii([packing.make(generator) for _ in range(count)])
        lower = float(whole.quantile(1 - SHARE))
        kept, fit = whole.truncated(lower, LIMIT), HermiteFit(lower, LIMIT, TruncatedNormal())
        mapped = fraction_of(fit.map(fit.slopes(kept)))
        packed *= (FRACTION / mapped) ** 1.5  # more than in proportion: the limit cuts more off
    pbox = least_pbox(fit, kept, kept.band(LEVEL, 500, generator))
    row = {
        "a1": lower,
        **{
            f"a2_{end}": value for end, value in zip(("low", "modal", "high"), pbox.a2, strict=True)
        },
        "a3": LIMIT,
        **{
            f"a4_{end}": value for end, value in zip(("low", "modal", "high"), pbox.a4, strict=True)
        },
        "volume_fraction_packed": volume_fraction(whole),
        "volume_fraction_of_sample": volume_fraction(kept),
        "volume_fraction_of_map": mapped,
        "share_beyond_limit": 1 - float(whole.cdf(LIMIT)),
        "misfit": fit.misfit(kept, (pbox.a2[1], pbox.a4[1])),
    }
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "sphere_map.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(row))
        writer.writeheader()
        writer.writerow(row)
    for name, value in row.items():
        print(f"{name:28} {value:.5f}")


if __name__ == "__main__":
    main()
