"""The paper's statistics of r_n against packings of its data as described.

    ./enter python -m benchmarks.stochastic.paper_data

The paper: area fraction 0.2, radii over a factor of ten, limits 0.13 and 0.87 that keep 99.27 % of
the area, a2 = 0.1, a4 = 0.1692. Each row packs discs in one reading, and gives the share of area
within those limits, below and above them, and the fitted slopes with a1, a3 as the paper has them.
Writes paper_data.csv and paper_data.svg/.png to benchmarks/results/.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.fit.hermite_fit import HermiteFit
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.packing import Packing, packings
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.tessellation.apollonius import apollonius
from alphacut.stochastic.theta.truncated_normal import TruncatedNormal

RESULTS = Path(__file__).parents[1] / "results"
LIMITS = (0.13, 0.87)  # Fig. 12
ENDS = (0.1337, 0.8663)  # a1, a3: middles of the outer two of 100 bins between the limits


@dataclass(frozen=True)
class Reading:
    """One way to read the paper's data, and what it gives."""

    what: str
    within: float
    below: float
    above: float
    a2: float
    a4: float


def read(what: str, sample: AreaWeighted) -> Reading:
    """Shares and slopes of a sample of r_n."""
    below, within = float(sample.cdf(LIMITS[0])), sample.share_within(*LIMITS)
    slopes = HermiteFit(*ENDS, TruncatedNormal()).slopes(sample.truncated(*ENDS))
    return Reading(what, within, below, 1 - below - within, *slopes)


def sample_of(sections: Sequence[Discs]) -> AreaWeighted:
    """Area-weighted r_n of every cell; in open windows the cells as the window cuts them."""
    diagrams = [apollonius(section) for section in sections]
    seen = [~diagram.hidden for diagram in diagrams]
    radii = np.concatenate(
        [diagram.reduced_radii[one] for diagram, one in zip(diagrams, seen, strict=True)]
    )
    return AreaWeighted.of(
        radii,
        np.concatenate([diagram.areas[one] for diagram, one in zip(diagrams, seen, strict=True)]),
    )


def readings(*, discs: int, number: int, seed: int = 1) -> list[tuple[Reading, AreaWeighted]]:
    """All readings, each from about `discs` × `number` discs."""
    found = []

    def add(what: str, sections: Sequence[Discs]) -> None:
        sample = sample_of(sections)
        found.append((read(what, sample), sample))

    as_described = list(
        packings(Packing(discs, 0.2, LogNormalRadii(1e-3, 1e-2)), number, seed=seed)
    )
    add("as described: factor 10, periodic", as_described)
    for factor in (20, 25, 30):
        add(
            f"factor {factor}, periodic",
            list(
                packings(
                    Packing(discs, 0.2, LogNormalRadii(1e-3, 1e-3 * factor)), number, seed=seed
                )
            ),
        )
    add("factor 10, all cells of large windows", [_opened(one) for one in as_described])
    small = packings(
        Packing(100, 0.2, LogNormalRadii(1e-3, 1e-2)), max(5, discs * number // 100), seed=seed
    )
    add("factor 10, all cells of windows of 100 discs", [_opened(one) for one in small])
    return found


def _opened(discs: Discs) -> Discs:
    return Discs(discs.centres, discs.radii, discs.size, periodic=False)


def draw(found: Sequence[tuple[Reading, AreaWeighted]], folder: Path) -> None:
    """Distribution functions of r_n of every reading, and the paper's fitted map."""
    import matplotlib.pyplot as plt

    from alphacut.stochastic.figures.style import save, style
    from alphacut.stochastic.radius_map import HermiteMap

    law, paper = TruncatedNormal(), HermiteMap(ENDS[0], 0.1, ENDS[1], 0.1692)  # below eq. 12
    theta = np.linspace(-3, 3, 400)
    with style():
        drawn, axes = plt.subplots(figsize=(7.2, 4.4))
        grid = np.linspace(0.05, 1.0, 400)
        for reading, sample in found:
            axes.plot(
                grid, sample.cdf(grid), lw=1.2, label=f"{reading.what}: {reading.within:.2%} within"
            )
        axes.plot(
            paper(theta),
            law.cdf(theta),
            color="#1a1a1a",
            ls="--",
            label="the paper's fit, a2 = 0.1, a4 = 0.1692",
        )
        axes.set(xlabel="r_n = r/a", ylabel="area-weighted share", ylim=(0, 1.02))
        axes.legend(fontsize=8)
        save(drawn, folder / "paper_data")


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute, write, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--discs", type=int, default=2000, help="discs in each packing (2000)")
    parser.add_argument("--packings", type=int, default=20, help="packings of each reading (20)")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    options = parser.parse_args(arguments)
    found = readings(discs=options.discs, number=options.packings)
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "paper_data.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(asdict(found[0][0])))
        writer.writeheader()
        writer.writerows(asdict(reading) for reading, _ in found)
    draw(found, options.out)
    for reading, _ in found:
        shares = (
            f"within {reading.within:.2%}, below {reading.below:.3%}, above {reading.above:.3%}"
        )
        print(f"{reading.what:46} {shares}; a2 = {reading.a2:.3f}, a4 = {reading.a4:.3f}")


if __name__ == "__main__":
    main()
