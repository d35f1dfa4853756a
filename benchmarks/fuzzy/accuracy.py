"""Error of each method's bounds over its evaluations, beside the error that it states.

Four functions with known bounds: Ishigami's, Branin's, two bells whose optima lie inside, and a
product that is monotone. The error is the largest distance of a bound to the true one over five
levels, as a share of the widest cut. Nothing is extrapolated: each row was run. Writes
benchmarks/results/fuzzy_accuracy.csv and .png.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from alphacut.fuzzy import (
    Automatic,
    Extended,
    FuzzyNumber,
    General,
    Reduced,
    Signed,
    Triangular,
    levels,
    propagate,
)
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.plans.design import Plan
from benchmarks.rows import write

_GRID = 1e-4  # share of the widest cut that the grid of the true bounds may miss
RESULTS = Path(__file__).parents[1] / "results"
METHODS: dict[str, list[Plan]] = {
    "reduced": [Reduced()],
    "general": [General()],
    "extended": [Extended()],
    "signed": [Signed()],
    "automatic": [Automatic(uncovered=share) for share in (0.02, 0.002)],
}


@dataclass(frozen=True)
class Problem:
    """A function of arrays, its fuzzy inputs, and its true bounds on every level, (2, levels)."""

    name: str
    function: Callable[..., Array]
    inputs: Mapping[str, FuzzyNumber]

    def true(self, steps: int) -> Array:
        """Bounds over a grid of every cut."""
        ends = []
        for alpha in levels(4):
            axes = [np.linspace(*number.cut(alpha), steps) for number in self.inputs.values()]
            values = self.function(*np.meshgrid(*axes, indexing="ij", sparse=True))
            ends.append((values.min(), values.max()))
        return np.array(ends).T


def ishigami(x: Array, y: Array, z: Array) -> Array:
    """Three inputs, many hills."""
    return np.sin(x) + 7 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)


def branin(x: Array, y: Array) -> Array:
    """Two inputs, three minima."""
    square = (y - 5.1 / (4 * np.pi**2) * x**2 + 5 / np.pi * x - 6) ** 2
    return square + 10 * (1 - 1 / (8 * np.pi)) * np.cos(x) + 10


def bells(x: Array, y: Array) -> Array:
    """Both optima lie inside."""
    return np.exp(-((x - 0.4) ** 2) - (y - 0.3) ** 2) - np.exp(-((x + 0.5) ** 2) - (y + 0.6) ** 2)


def product(x: Array, y: Array, z: Array) -> Array:
    """Monotone in every input."""
    return x * y**3 / z


PROBLEMS = (
    Problem("Ishigami", ishigami, {name: Triangular(-np.pi, 0.5, np.pi) for name in "xyz"}),
    Problem("Branin", branin, {"x": Triangular(-5, 2, 10), "y": Triangular(0, 5, 15)}),
    Problem("bells", bells, {"x": Triangular(-2, 0.1, 2), "y": Triangular(-2, 0.0, 2)}),
    Problem("product", product, {name: Triangular(1, 2, 2.5) for name in "xyz"}),
)


@dataclass(frozen=True)
class Row:
    """What a method cost on a problem, and how wrong it was and said to be."""

    problem: str
    method: str
    evaluations: int
    nature: str
    error: float
    stated: float


def measure(problem: Problem, steps: int = 401) -> Iterator[Row]:
    """Every method on a problem."""
    lower, upper = problem.true(steps if len(problem.inputs) < 3 else steps // 2)
    span = upper[0] - lower[0]
    for name, methods in METHODS.items():
        for method in methods:
            found = propagate(
                problem.function,
                problem.inputs,
                method,
                vectorised=True,
                budget=10**6,
                progress=False,
            )
            low, high = found.bounds()
            lacking = max((low - lower).max(), (upper - high).max(), 0.0) / span
            beyond = max((lower - low).max(), (high - upper).max()) / span
            missed = max(lacking, beyond if beyond > _GRID else 0.0)
            stated = float(np.nanmax(found.error)) / span
            yield Row(problem.name, name, found.evaluations, found.nature, float(missed), stated)


def draw(rows: list[Row], path: Path) -> None:
    """Error over evaluations, a panel a problem, a line a method."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5.5), layout="constrained")
    for axes, problem in zip(figure.subplots(2, 2).ravel(), PROBLEMS, strict=True):
        for number, name in enumerate(METHODS):
            own = [row for row in rows if (row.problem, row.method) == (problem.name, name)]
            errors = [max(row.error, 1e-6) for row in own]
            line = {"marker": "osv^D*xP"[number], "linewidth": 1.2, "label": name}
            axes.loglog([row.evaluations for row in own], errors, **line)
        axes.set(title=problem.name, xlabel="evaluations", ylabel="error / widest cut")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.savefig(path, dpi=120)


def main() -> None:
    """Measure, print, write and draw."""
    rows = [row for problem in PROBLEMS for row in measure(problem)]
    for row in rows:
        print(
            f"{row.problem:9} {row.method:23} {row.evaluations:6} evaluations,"
            f" error {row.error:.1e}, {row.nature}, stated {row.stated:.1e}"
        )
    write([asdict(row) for row in rows], RESULTS / "fuzzy_accuracy.csv")
    draw(rows, RESULTS / "fuzzy_accuracy.png")


if __name__ == "__main__":
    main()
