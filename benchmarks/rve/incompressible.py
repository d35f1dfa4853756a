"""Iterations and locking of the product-space elements as Poisson's ratio nears one half.

    ./enter python -m benchmarks.rve.incompressible

The paper's map, E_i/E_m = 4, one Poisson's ratio in both phases, the default mesh and layers; E
beside the exact series.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

from alphacut.rve.cell import Phase
from alphacut.rve.series.model import SeriesModel
from alphacut.stochastic import HermiteMap

PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
RATIOS = (0.3, 0.45, 0.49, 0.499, 0.4999)


def rows(mesh_size: float, layers: int) -> Iterator[tuple[float, int, float]]:
    """Poisson's ratio, the most iterations of a load, and the relative error of E."""
    from alphacut.rve.prism.model import PrismModel

    model = PrismModel(mesh_size=mesh_size, layers=layers)
    for poisson in RATIOS:
        phases = Phase(20e9, poisson), [Phase(80e9, poisson)]
        (result,), (exact,) = model.solve(PAPER, *phases), SeriesModel().solve(PAPER, *phases)
        yield poisson, max(result.iterations), result.modulus / exact.modulus - 1


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mesh-size", type=float, default=0.15, help="edge length (0.15)")
    parser.add_argument("--layers", type=int, default=12, help="layers in θ (12)")
    options = parser.parse_args(arguments)
    for poisson, iterations, error in rows(options.mesh_size, options.layers):
        print(f"nu = {poisson:g}: {iterations} iterations, E off by {error:+.2e}")


if __name__ == "__main__":
    main()
