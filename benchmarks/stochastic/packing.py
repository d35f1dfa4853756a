"""Time of packing discs and of their Apollonius cells, over their number.

    ./enter python -m benchmarks.stochastic.packing --discs 1000 10000 100000

One process, one core. Writes packing.csv and packing.svg/.png to benchmarks/results/ and prints the
table: seconds to pack (checks of the packing included), seconds for the exact cells, and by how
much the sum of the cells differs from the box.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.tessellation.apollonius import apollonius

RESULTS = Path(__file__).parents[1] / "results"
KINDS = {"log-normal, 0.2": (0.2, 10.0), "log-normal, 0.6": (0.6, 10.0), "equal, 0.6": (0.6, 1.0)}


@dataclass(frozen=True)
class Timing:
    """Packing: kind, size, wall times in s, and relative error of the areas' sum."""

    kind: str
    discs: int
    pack: float
    cells: float
    error: float


def measure(kind: str, discs: int, *, seed: int = 1) -> Timing:
    """Pack once and measure its cells."""
    fraction, ratio = KINDS[kind]
    begin = perf_counter()
    packing = Packing(discs, fraction, LogNormalRadii(1e-3, 1e-3 * ratio)).make(
        np.random.default_rng(seed)
    )
    packed = perf_counter()
    areas = apollonius(packing).areas
    return Timing(
        kind, discs, packed - begin, perf_counter() - packed, abs(areas.sum() / packing.area - 1)
    )


def draw(timings: Sequence[Timing], folder: Path) -> None:
    """Seconds over the number of discs."""
    import matplotlib.pyplot as plt

    from alphacut.stochastic.figures.style import BLUE, GREEN, ORANGE, save, style

    with style():
        drawn, axes = plt.subplots(figsize=(6.4, 3.8))
        for kind, colour in zip(KINDS, (BLUE, ORANGE, GREEN), strict=True):
            points = [timing for timing in timings if timing.kind == kind]
            number = [point.discs for point in points]
            axes.loglog(
                number,
                [point.pack for point in points],
                "o-",
                color=colour,
                label=f"packing: {kind}",
            )
            axes.loglog(
                number,
                [point.cells for point in points],
                "s--",
                color=colour,
                label=f"cells: {kind}",
            )
        axes.axhline(60, color="#8c8c8c", lw=0.8)
        axes.set(xlabel="discs", ylabel="seconds, one core")
        axes.legend(fontsize=8)
        save(drawn, folder / "packing")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, write, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--discs", type=int, nargs="+", default=[1000, 10_000, 100_000], help="numbers of discs"
    )
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    options = parser.parse_args(arguments)
    timings = [measure(kind, discs) for discs in options.discs for kind in KINDS]
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "packing.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(asdict(timings[0])))
        writer.writeheader()
        writer.writerows(asdict(timing) for timing in timings)
    draw(timings, options.out)
    for timing in timings:
        seconds = f"packed in {timing.pack:6.2f} s, cells {timing.cells:6.2f} s"
        print(f"{timing.kind:16} {timing.discs:7d} discs: {seconds}, sum off by {timing.error:.1e}")


if __name__ == "__main__":
    main()
