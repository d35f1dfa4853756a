"""The paper's statistics of r_n against packings of its data as described.

    ./enter python -m benchmarks.stochastic.paper_data

The paper: area fraction 0.2, radii over a factor of ten, limits 0.13 and 0.87 that keep 99.27 % of
the area, a2 = 0.1, a4 = 0.1692. Each row packs discs in one reading, and gives the share of area
within those limits, below and above them, and the fitted slopes with a1, a3 as the paper has them.
Draws paper_data.svg/.png in benchmarks/results/.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.fit.hermite_fit import HermiteFit
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.packings import Packings
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.particles.radius_distributions import LogNormalRadii
from alphacut.stochastic.radius_map import HermiteMap
from alphacut.stochastic.tessellation.apollonius import apollonius

RESULTS = Path(__file__).parents[1] / "results"
LIMITS = (0.13, 0.87)  # Fig. 12
ENDS = (0.1337, 0.8663)  # a1, a3: middles of the outer two of 100 bins between the limits
FACTORS = (10, 20, 25, 30)  # of the largest radius over the smallest


def readings(discs: int, number: int, seed: int) -> Iterator[tuple[str, AreaWeighted]]:
    """Readings of the paper's data, and the area-weighted r_n of each."""
    for factor in FACTORS:
        packing = Packing(discs, 0.2, LogNormalRadii(1e-3, 1e-3 * factor))
        packed = [*Packings.make(packing, number, seed=seed)]
        yield f"factor {factor}, periodic", sample_of(packed)
        if factor == FACTORS[0]:
            opened = [Particles(one.centres, one.radii, one.size, False) for one in packed]
            yield f"factor {factor}, all cells of open windows", sample_of(opened)


def sample_of(sections: Sequence[Particles]) -> AreaWeighted:
    """Area-weighted r_n of every cell; in open windows the cells as the window cuts them."""
    diagrams = [apollonius(section) for section in sections]
    radii = np.concatenate([diagram.reduced_radii for diagram in diagrams])
    return AreaWeighted.from_values(radii, np.concatenate([diagram.areas for diagram in diagrams]))


def row(name: str, sample: AreaWeighted) -> str:
    """Shares and slopes of a sample in one line."""
    below, within = float(sample.cdf(LIMITS[0])), sample.fraction_within(*LIMITS)
    a2, a4 = HermiteFit(*ENDS).slopes(sample.truncated(*ENDS))
    above = 1 - below - within
    return f"{name:40} {within:9.2%} {below:9.3%} {above:9.3%} {a2:7.3f} {a4:7.3f}"


def draw(rows: Sequence[tuple[str, AreaWeighted]], folder: Path) -> None:
    """Distribution functions of r_n of every reading, and the paper's fitted map."""
    import matplotlib.pyplot as plt

    from alphacut.figures.style import figure_style, save

    paper = HermiteMap(ENDS[0], 0.1, ENDS[1], 0.1692)  # below eq. 12
    theta, grid = np.linspace(-3, 3, 400), np.linspace(0.05, 1.0, 400)
    with figure_style():
        drawn, axes = plt.subplots(figsize=(7.2, 4.4))
        for name, sample in rows:
            axes.plot(grid, sample.cdf(grid), lw=1.2, label=name)
        share = paper.distribution.cdf(theta)
        axes.plot(paper(theta), share, color="#1a1a1a", ls="--", label="the paper's fit")
        axes.set(xlabel="reduced radius r/a", ylabel="share of area", ylim=(0, 1.02))
        axes.legend(fontsize=8)
        save(drawn, folder / "paper_data")


def main(arguments: Sequence[str] | None = None) -> None:
    """Computes, draws, prints."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--discs", type=int, default=2000, help="discs in each packing (2000)")
    parser.add_argument("--packings", type=int, default=20, help="packings of each reading (20)")
    parser.add_argument("--seed", type=int, default=1, help="of the packings (1)")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the chart")
    options = parser.parse_args(arguments)
    print(f"{'reading':40} {'within':>9} {'below':>9} {'above':>9} {'a2':>7} {'a4':>7}")
    rows = list(readings(options.discs, options.packings, options.seed))
    for name, sample in rows:
        print(row(name, sample))
    draw(rows, options.out)


if __name__ == "__main__":
    main()
