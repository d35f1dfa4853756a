"""Cost until all bounds are right to 1e-3 of the width, by plan and package.

Every method gets the same fuzzy inputs and five α-levels, and more effort step by step until the
worst bound of all levels is within 1e-3 of the width of the support's image; the first effort that
gets there counts. The exact bounds come from a fine multistart search that brute force on a grid
confirms. Branch and bound also calls the function on enclosures: that counts in its time, not in
its evaluations. One process, one run, imports left out. Writes benchmarks/results/fuzzy_bounds.csv
and .png.

The UQ package pyuncertainnumber takes part where it is installed (see fuzzy_requirements.txt); it
is no dependency of the project.
"""

from __future__ import annotations

import argparse
import csv
import logging
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from alphacut.fuzzy import (
    BranchAndBound,
    Chebyshev,
    FuzzyNumber,
    General,
    Known,
    Optimisation,
    QuasiMonteCarlo,
    Reduced,
    Signed,
    Triangular,
    levels,
    propagate,
)
from alphacut.fuzzy.samples.result import Plan

Array = NDArray[np.float64]
Function = Callable[..., Array]
Bounds = tuple[Array, Array]
ALPHA = levels(4)
GOAL = 1e-3
LIMIT = 200_000  # evaluations beyond which no effort is made


@dataclass(frozen=True)
class Problem:
    """Function of arrays with its fuzzy inputs, and the signs of its effects."""

    name: str
    function: Function
    inputs: Mapping[str, FuzzyNumber]
    signs: Mapping[str, int]


@dataclass(frozen=True)
class Row:
    """Cost of one method on one problem; NaN where no effort was enough."""

    problem: str
    method: str
    evaluations: float
    seconds: float
    error: float


def _ishigami(x1: Array, x2: Array, x3: Array) -> Array:
    return np.sin(x1) + 7 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)


def _rosenbrock(x: Array, y: Array) -> Array:
    return (1 - x) ** 2 + 100 * (y - x * x) ** 2


def _branin(x: Array, y: Array) -> Array:
    return (
        (y - 5.1 / (4 * np.pi**2) * x**2 + 5 / np.pi * x - 6) ** 2
        + 10 * (1 - 1 / (8 * np.pi)) * np.cos(x)
        + 10
    )


def _product(**x: Array) -> Array:
    return np.prod(list(x.values()), axis=0)


def _modulus(a2: Array, a4: Array, e: Array) -> Array:
    return np.sqrt(1 + a2) * e**0.2 / (1 + a4)


PROBLEMS = (
    Problem(
        "Ishigami", _ishigami, {name: Triangular(-3.1, 0.5, 3.0) for name in ("x1", "x2", "x3")}, {}
    ),
    Problem(
        "Rosenbrock", _rosenbrock, {"x": Triangular(-2, 0.5, 1.9), "y": Triangular(-1, 1, 3)}, {}
    ),
    Problem("Branin", _branin, {"x": Triangular(-5, 2, 10), "y": Triangular(0, 5, 15)}, {}),
    Problem(
        "product of 8",
        _product,
        {f"x{i}": Triangular(0.5, 1, 2) for i in range(8)},
        {f"x{i}": 1 for i in range(8)},
    ),
    Problem(
        "monotone, 3 inputs",
        _modulus,
        {
            "a2": Triangular(0.001, 0.1, 0.3145),
            "a4": Triangular(0.001, 0.1692, 0.9975),
            "e": Triangular(75, 80, 85),
        },
        {"a2": 1, "a4": -1, "e": 1},
    ),
)


class Counted:
    """A function of points (n, inputs) that counts its evaluations."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.count = problem, 0

    def __call__(self, points: Array) -> Array:
        """Values at the points, shape (n,)."""
        points = np.atleast_2d(np.asarray(points, float))
        self.count += len(points)
        return np.asarray(
            self.problem.function(**dict(zip(self.problem.inputs, points.T, strict=True))), float
        )


def exact(problem: Problem) -> Bounds:
    """Bounds on every level by a search far finer than any that is measured."""
    known = Known(dict(problem.signs))
    plan: Plan = Signed() if problem.signs else Optimisation(starts=12, look=300)
    return propagate(
        problem.function, problem.inputs, plan, alpha=ALPHA, vectorised=True, known=known
    ).bounds()


def own_plans(problem: Problem) -> Iterator[tuple[str, Sequence[Plan]]]:
    """This package's plans with rising effort."""
    if problem.signs:
        yield "alphacut: signed, signs stated", [Signed()]
    if len(problem.inputs) < 8:
        yield "alphacut: general", [General()]
    yield "alphacut: reduced", [Reduced()]
    yield (
        "alphacut: multistart",
        [
            Optimisation(starts=starts, look=look)
            for starts, look in ((1, 2), (1, 4), (2, 8), (3, 16), (5, 64))
        ],
    )
    yield (
        "alphacut: Chebyshev surface",
        [Chebyshev(tolerance=10.0**-e, budget=3000) for e in (1, 1.5, 2, 2.5, 3, 4)],
    )
    yield "alphacut: branch and bound (proved)", [BranchAndBound(problem.function, tolerance=1e-3)]
    yield (
        "alphacut: quasi-Monte Carlo",
        [QuasiMonteCarlo(2**e, density="chebyshev") for e in range(4, 16)],
    )


def scipy_efforts(name: str) -> Sequence[int]:
    """Rising limits of iterations or evaluations for one of SciPy's optimisers."""
    return {
        "differential_evolution": (2, 5, 10, 20, 50, 100, 200),
        "shgo": (1, 2, 3, 4),
        "dual_annealing": (2, 5, 10, 50, 200),
    }.get(name, (50, 100, 200, 500, 1000, 3000, 10000))


def scipy_bounds(name: str, counted: Counted, effort: int) -> Bounds:
    """Both bounds of every level by one of SciPy's global optimisers."""
    import scipy.optimize

    options = {
        "differential_evolution": {"maxiter": effort, "rng": 1},
        "shgo": {"iters": effort},
        "direct": {"maxfun": effort, "eps": 1e-6},
        "dual_annealing": {"maxiter": effort, "rng": 1},
    }[name]
    optimiser = getattr(scipy.optimize, name)
    ends = np.empty((2, len(ALPHA)))
    for level, alpha in enumerate(ALPHA):
        cuts = [number.cut(alpha) for number in counted.problem.inputs.values()]
        if all(cut.width == 0 for cut in cuts):
            ends[:, level] = counted(np.array([[cut.lower for cut in cuts]]))[0]
            continue
        for side, sign in enumerate((1.0, -1.0)):
            found = optimiser(
                lambda x, sign=sign: sign * float(counted(x)[0]),
                [tuple(cut) for cut in cuts],
                **options,
            )
            ends[side, level] = sign * found.fun
    return ends[0], ends[1]


def package_bounds(style: str, counted: Counted, effort: int) -> Bounds:
    """Both bounds of every level by pyuncertainnumber's interval propagation."""
    from pyuncertainnumber import pba  # type: ignore[import-not-found]
    from pyuncertainnumber.propagation.b2b import b2b  # type: ignore[import-not-found]

    options = {"interval_strategy": "endpoints"}
    if style == "subinterval":
        options = {
            "interval_strategy": "subinterval",
            "subinterval_style": "endpoints",
            "n_sub": effort,
        }  # type: ignore[dict-item]
    ends = np.empty((2, len(ALPHA)))
    for level, alpha in enumerate(ALPHA):
        cuts = [number.cut(alpha) for number in counted.problem.inputs.values()]
        if all(cut.width == 0 for cut in cuts):
            ends[:, level] = counted(np.array([[cut.lower for cut in cuts]]))[0]
            continue
        found = b2b(vars=[pba.I(*cut) for cut in cuts], func=counted, **options)
        ends[:, level] = float(found.lo), float(found.hi)
    return ends[0], ends[1]


def attempts(problem: Problem) -> Iterator[tuple[str, Callable[[], tuple[Bounds, int]]]]:
    """Every method at every effort, in rising order for each method."""

    def counted_by(
        bounds: Callable[..., Bounds], kind: str, effort: int
    ) -> Callable[[], tuple[Bounds, int]]:
        def attempt() -> tuple[Bounds, int]:
            counted = Counted(problem)
            return bounds(kind, counted, effort), counted.count

        return attempt

    for name, plans in own_plans(problem):
        for plan in plans:
            yield name, lambda plan=plan: _own(problem, plan)
    for name in ("differential_evolution", "shgo", "direct", "dual_annealing"):
        for effort in scipy_efforts(name):
            yield f"SciPy: {name}", counted_by(scipy_bounds, name, effort)
    if find_spec("pyuncertainnumber"):
        logging.disable(logging.INFO)
        yield "pyuncertainnumber: endpoints", counted_by(package_bounds, "endpoints", 1)
        for parts in (2, 4, 8, 16, 32, 64, 128):
            if (2 * parts) ** len(problem.inputs) * 4 <= 4 * LIMIT:
                yield (
                    "pyuncertainnumber: subintervals",
                    counted_by(package_bounds, "subinterval", parts),
                )


def _own(problem: Problem, plan: Plan) -> tuple[Bounds, int]:
    known = Known(dict(problem.signs))
    result = propagate(
        problem.function, problem.inputs, plan, alpha=ALPHA, vectorised=True, known=known
    )
    return result.bounds(), result.runs + result.verification_runs


def measure(problem: Problem) -> list[Row]:
    """The first effort of every method that reaches the goal; NaN evaluations where none does."""
    reference = exact(problem)
    span = float(reference[1][0] - reference[0][0])
    rows: dict[str, Row] = {}
    done: set[str] = set()
    for name, attempt in attempts(problem):
        if name in done:
            continue
        start = perf_counter()
        bounds, evaluations = attempt()
        seconds = perf_counter() - start
        error = float(
            max(np.abs(a - b).max() for a, b in zip(bounds, reference, strict=True)) / span
        )
        reached = error <= GOAL
        best = min(error, rows[name].error) if name in rows else error
        rows[name] = Row(
            problem.name,
            name,
            evaluations if reached else np.nan,
            seconds if reached else np.nan,
            error if reached else best,
        )
        if reached or evaluations > LIMIT:
            done.add(name)
    return list(rows.values())


def draw(rows: Sequence[Row], path: Path) -> None:
    """Evaluations to the goal by method, one panel per problem."""
    from matplotlib.figure import Figure

    problems = list(dict.fromkeys(row.problem for row in rows))
    methods = sorted(dict.fromkeys(row.method for row in rows), key=_rank, reverse=True)
    figure = Figure(
        figsize=(3.0 + 2.3 * len(problems), 0.9 + 0.3 * len(methods)), layout="constrained"
    )
    for axes, problem in zip(
        np.atleast_1d(figure.subplots(1, len(problems), sharey=True)), problems, strict=True
    ):
        for row in (row for row in rows if row.problem == problem):
            at = methods.index(row.method)
            colour = "#0072B2" if row.method.startswith("alphacut") else "#999999"
            if np.isfinite(row.evaluations):
                axes.barh(at, row.evaluations, color=colour, left=1)
                axes.annotate(
                    f" {row.evaluations:.0f}", (row.evaluations, at), va="center", fontsize="small"
                )
            else:
                axes.annotate(
                    f"best {row.error:.0e}",
                    (1.3, at),
                    va="center",
                    fontsize="small",
                    color="#D55E00",
                )
        axes.set(xscale="log", xlim=(1, 3e7), title=problem, xlabel="evaluations")
        axes.set_yticks(range(len(methods)), methods)
    figure.suptitle(
        f"Evaluations until all bounds of five α-cuts are right to {GOAL:g} of the width; 'best':"
        " the goal was not reached"
    )
    figure.savefig(path, dpi=150)


def _rank(method: str) -> tuple[bool, bool]:
    """This package's plans first, the signed one at the top."""
    return not method.startswith("alphacut"), "signed" not in method


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, write the table and the picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(__file__).parents[1] / "results",
        help="folder for fuzzy_bounds.csv and .png",
    )
    parser.add_argument(
        "--problem",
        choices=[problem.name for problem in PROBLEMS],
        action="append",
        help="only this one (repeatable)",
    )
    options = parser.parse_args(arguments)
    for module in (
        "scipy.optimize",
        "scipy.stats",
        *(["pyuncertainnumber"] if find_spec("pyuncertainnumber") else []),
    ):
        import_module(module)  # so that it counts for nobody
    rows = [
        row
        for problem in PROBLEMS
        if options.problem is None or problem.name in options.problem
        for row in measure(problem)
    ]
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "fuzzy_bounds.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, [*Row.__dataclass_fields__])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    draw(rows, options.out / "fuzzy_bounds.png")
    for row in rows:
        reached = (
            f"{row.evaluations:9.0f} evaluations {row.seconds:8.3f} s"
            if np.isfinite(row.evaluations)
            else "not reached".ljust(32)
        )
        print(f"{row.problem:20} {row.method:36} {reached}  error {row.error:.1e}")


if __name__ == "__main__":
    main()
