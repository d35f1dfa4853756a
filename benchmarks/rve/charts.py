"""What a digit of the cell's modulus costs: error of E against time, for every way to it.

    ./enter python -m benchmarks.rve.charts

Made from scratch in one run on one core: `make charts`. Processor time of one call, without imports
and compilation; a family ends where a run would pass the cap. The truth is the series. CSV and
figures go to benchmarks/results/.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from alphacut.rve.prism.model import PrismModel
from alphacut.rve.prism.own_mesh import LevelSetModel
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.slices.model import SlicesModel
from benchmarks.rows import write
from benchmarks.rve.solvers import MATRIX, PAPER, PARTICLE, SOLVERS

RESULTS = Path(__file__).parents[1] / "results"
PLANES = ((0.6, 4), (0.45, 5), (0.3, 6), (0.2, 8), (0.14, 9))  # mesh size, nodes in θ
PRISMS = ((0.5, 4), (0.3, 6), (0.2, 9), (0.15, 12), (0.1, 12), (0.07, 12), (0.05, 12))  # layers
Way = Callable[[], HomogenisedStiffness]


@dataclass(frozen=True)
class Run:
    """One point of the chart.

    Args:
        family: Name of the line.
        setting: Its resolution, in words.
        error: Relative error of E.
        declared: The declared one.
        seconds: Processor time.
        unknowns: Of one linear system.
    """

    family: str
    setting: str
    error: float
    declared: float
    seconds: float
    unknowns: int


def way(model: PrismModel | SlicesModel | SeriesModel) -> Way:
    """A call of the model on the paper's cell."""
    return lambda: model.solve(PAPER, MATRIX, [PARTICLE])[0]


def ignoring_the_interface(mesh_size: float, layers: int) -> Way:
    """A call of prisms with the particle by its sign (eq. 13) on the paper's cell."""
    model = LevelSetModel(lambda x, y, theta: np.hypot(x, y) - PAPER(theta), mesh_size, layers)
    phases = {"matrix": MATRIX, "inclusion": PARTICLE}
    return lambda: model.solve(PAPER.distribution, phases)[0]


def families() -> dict[str, list[tuple[str, Way]]]:
    """All lines, each from coarse to fine."""
    lines = {"series": [(f"{n} nodes", way(SeriesModel(points=n))) for n in (2, 3, 4, 6, 8, 12)]}
    lines["slices"] = [(f"h {h:g}, {n} nodes", way(SlicesModel(h, n))) for h, n in PLANES]
    for name, solver in (("prism", "theta"), ("prism, MUMPS", "MUMPS")):
        lines[name] = [
            (f"h {h:g}, {n} layers", way(PrismModel(h, n, SOLVERS[solver]))) for h, n in PRISMS
        ]
    lines["prism, interface ignored"] = [
        (f"h {h:g}, {n} layers", ignoring_the_interface(h, n)) for h, n in PRISMS
    ]
    return lines


def runs(*, cap: float, only: Sequence[str]) -> Iterator[Run]:
    """All points; a line ends before a run that would take longer than `cap` seconds."""
    exact = SeriesModel().solve(PAPER, MATRIX, [PARTICLE])[0].modulus
    for family, settings in families().items():
        if only and family not in only:
            continue
        settings[0][1]()  # compiles
        for setting, call in settings:
            started = process_time()
            one = call()
            seconds = process_time() - started
            error = max(abs(one.modulus / exact - 1), 1e-16)
            yield Run(family, setting, error, one.estimated_error, seconds, one.unknowns)
            if 4 * seconds > cap:
                break


def draw(points: Sequence[Run], stem: Path) -> None:
    """Error over time, one line for each family."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 5.5), layout="constrained")
    for family in dict.fromkeys(point.family for point in points):
        own = [point for point in points if point.family == family]
        seconds, errors = [point.seconds for point in own], [point.error for point in own]
        axes.loglog(seconds, errors, "o-", label=family, ms=4)
    axes.set(xlabel="seconds of one core", ylabel="relative error of E")
    axes.set_title("What a digit of the effective modulus costs")
    axes.invert_yaxis()
    axes.grid(alpha=0.25)
    axes.legend(frameon=False)
    for suffix in (".svg", ".png"):
        figure.savefig(stem.with_suffix(suffix), dpi=160)
    plt.close(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the table and the chart; exit 1 where an error lies outside the declared one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cap", type=float, default=30.0, help="seconds of a run")
    parser.add_argument("--only", nargs="*", default=(), help="families to run")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args(arguments)
    started, points = perf_counter(), []
    for point in runs(cap=options.cap, only=options.only):
        points.append(point)
        print(
            f"{point.family:26} {point.setting:20} error {point.error:8.1e}"
            f" declared {point.declared:8.1e} {point.seconds:8.3f} s",
            flush=True,
        )
    options.out.mkdir(parents=True, exist_ok=True)
    write([asdict(point) for point in points], options.out / "cell_accuracy.csv")
    draw(points, options.out / "cell_accuracy")
    print(f"made in {perf_counter() - started:.0f} s, in {options.out}")
    return int(any(point.error > point.declared + 1e-12 for point in points))


if __name__ == "__main__":
    sys.exit(main())
