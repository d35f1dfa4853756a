"""Declared against true error of everything that the cell's models print and export.

    ./enter python -m benchmarks.rve.calibration --cases 300 --seed 1

Cells are drawn at random: contrasts of 1e-3 to 1e3, Poisson's ratios to 0.4999 in either phase,
random Hermite maps with radii up to nearly touching; the models take turns, each at a random
resolution or tolerance. The truth is the multipole series at 1e-12 for every model but the series,
whose truth is planar elements of order 4 where it claims no more than these reach, and itself at
1e-12 otherwise. Prints how many numbers lie within their declared errors, and the median of
declared over true for each quantity; exit status 1 if one number lies outside. A model that refuses
is counted, not judged.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alphacut.rve.cell import Cell, Phase
from alphacut.rve.fibre_constants import fibre_constants
from alphacut.rve.model import Model, named
from alphacut.rve.result import Homogenised
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.stages.material.cell import declared_errors, document
from alphacut.stochastic import HermiteMap

ROUND_OFF = 3e-11  # of the truth, relative: rounding near incompressibility
MODELS = ("series", "slices", "table", "prism", "auto")


@dataclass(frozen=True)
class Judgement:
    """One number beside its truth.

    Args:
        quantity: Its name.
        declared: Its declared absolute error.
        true: Its true one.
        noise: What the truth itself may be off by.
    """

    quantity: str
    declared: float
    true: float
    noise: float

    @property
    def covered(self) -> bool:
        """Whether the declared error covers the true one."""
        return bool(self.true <= self.declared + self.noise)


def draw_cell(rng: np.random.Generator) -> Cell:
    """A random cell."""
    while True:
        ends = rng.uniform([0.02, -0.5, 0.05, -0.5], [0.9, 1.0, 0.99, 1.0])
        try:
            radius = HermiteMap(*map(float, ends))
        except ValueError:
            continue
        if radius.extremes()[1] < 0.99:
            matrix = Phase(20e9, _poisson(rng))
            return Cell(matrix, Phase(20e9 * 10 ** rng.uniform(-3, 3), _poisson(rng)), radius)


def _poisson(rng: np.random.Generator) -> float:
    """Ordinary, or nearly incompressible."""
    ordinary, near = rng.uniform(0, 0.45), 0.5 - 10 ** rng.uniform(-4, -1.3)
    return float(ordinary if rng.random() < 0.7 else near)


def draw_model(name: str, rng: np.random.Generator) -> Model:
    """A model at a random resolution."""
    tolerance = float(10 ** rng.uniform(-5, -2))
    if name == "series":
        points = int(rng.integers(3, 12)) if rng.random() < 0.5 else None
        return named(name, accuracy=float(10 ** rng.uniform(-8, -2)), points=points)
    if name == "slices":
        size, points = float(rng.uniform(0.2, 0.6)), int(rng.integers(3, 10))
        return named(name, order=int(rng.integers(3, 5)), mesh_size=size, points=points)
    if name == "table":
        return named(name, accuracy=tolerance)
    if name == "prism":
        size, layers = float(rng.uniform(0.2, 0.5)), int(rng.choice([1, 2, 4, 6]))
        return named(name, mesh_size=size, layers=layers, stiffness=True, estimate=True)
    exclude = ((), ("series",), ("series", "table"))[int(rng.integers(3))]
    return named(name, tolerance=float(10 ** rng.uniform(-4, -2)), exclude=exclude)


def judge(result: Homogenised, truth: Homogenised) -> Iterator[Judgement]:
    """Every number of a result beside that of the truth."""
    declared = declared_errors(result)
    if declared is None:
        raise ValueError(f"{result.method} declares no error")
    own, exact = document(result), document(truth)
    yield from _compare("", own, exact, declared, declared_errors(truth))
    if result.stiffness is not None:
        first, second = fibre_constants(result), fibre_constants(truth)
        for name, error in first.errors.items():
            scale = ROUND_OFF * abs(second.values[name]) + second.errors[name]
            yield Judgement(
                f"card {name}", error, abs(first.values[name] - second.values[name]), scale
            )
    yield from _judge_curve(result)


def _compare(place: str, own: Any, exact: Any, declared: Any, unsure: Any) -> Iterator[Judgement]:
    if isinstance(declared, dict):
        for name, inner in declared.items():
            if name != "curve":
                within = (values[name] for values in (own, exact))
                yield from _compare(f"{place} {name}".strip(), *within, inner, unsure[name])
    elif declared is not None:
        values, truths = np.atleast_1d(own), np.atleast_1d(exact)
        noise = ROUND_OFF * np.abs(truths).max() + np.atleast_1d(unsure)
        for k, error in np.ndenumerate(np.atleast_1d(declared)):
            yield Judgement(place, float(error), float(abs(values[k] - truths[k])), float(noise[k]))


def _judge_curve(result: Homogenised) -> Iterator[Judgement]:
    """Stresses at the nodes in θ beside the series there."""
    curve, cell = result.curve, result.cell
    if curve.error is None or cell is None:
        return
    exact = square_stiffness(cell.radius(curve.theta), cell.matrix, [cell.inclusion])
    pairs = (curve.s11, 0.01 * exact.bulk[:, 0]), (curve.s12, 0.02 * exact.shear[:, 0])
    for name, (own, truth), error in zip(("s11", "s12"), pairs, curve.error.T, strict=True):
        for value, right, relative in zip(own, truth, error, strict=True):
            noise = ROUND_OFF * abs(right)
            yield Judgement(
                f"curve {name}", float(relative * value), float(abs(value - right)), float(noise)
            )


def truth_of(cell: Cell, result: Homogenised) -> Homogenised:
    """The exact answer: series at 1e-12, confirmed by planar elements for the series itself."""
    phases = cell.matrix, [cell.inclusion]
    exact = SeriesModel(accuracy=1e-12).solve(cell.radius, *phases)[0]
    if result.method == "series" and result.largest_error > 1e-5:
        other = named("auto", tolerance=1e-6, exclude=("series", "slices", "prism"))
        return other.solve(cell.radius, *phases)[0]
    return exact


def calibrate(
    cases: int, seed: int, models: Sequence[str] = MODELS
) -> Iterator[tuple[str, Cell, object]]:
    """Each case's model, cell, and its judgements or the refusal's text."""
    rng = np.random.default_rng(seed)
    for k in range(cases):
        name = models[k % len(models)]
        cell, model = draw_cell(rng), draw_model(name, rng)
        try:
            result = model.solve(cell.radius, cell.matrix, [cell.inclusion])[0]
            truth = truth_of(cell, result)
        except RuntimeError as refusal:
            yield name, cell, str(refusal)
            continue
        judgements = list(judge(result, truth))
        if name == "auto":
            allowed = model.tolerance  # type: ignore[attr-defined]
            judgements.append(Judgement("tolerance", allowed, result.largest_error, 0.0))
        yield name, cell, judgements


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw, judge, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=300, help="random cells (300)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the draws (1)")
    parser.add_argument("--models", default=",".join(MODELS), help="models that take turns")
    options = parser.parse_args(arguments)
    ratios: defaultdict[str, list[float]] = defaultdict(list)
    refused: Counter[str] = Counter()
    outside = judged = 0
    for k, (name, cell, found) in enumerate(
        calibrate(options.cases, options.seed, options.models.split(","))
    ):
        if isinstance(found, str):
            refused[name] += 1
            print(f"case {k}: {name} refused: {found[:110]}", flush=True)
            continue
        judged += 1
        worst = {}
        for one in found:
            if not one.covered:
                outside += 1
                worst[one.quantity] = f"{one.true / one.declared:.3g} times its declared error"
            if one.quantity != "tolerance" and one.true > 3 * one.noise:
                ratios[one.quantity].append(one.declared / one.true)
                ratios[f"model {name}"].append(one.declared / one.true)
        if worst:
            print(f"case {k}: {name} {cell}: {worst}", flush=True)
    print(f"{judged} cells judged, {outside} numbers outside their declared error", flush=True)
    print("refused: " + (", ".join(f"{n} {name}" for name, n in refused.items()) or "none"))
    for quantity, values in sorted(ratios.items()):
        print(f"{quantity:28} median of declared over true {np.median(values):7.3g}")
    every = [value for name, values in ratios.items() if name[:6] != "model " for value in values]
    print(f"{'all':28} median of declared over true {np.median(every):7.3g}")
    return 1 if outside or not judged else 0


if __name__ == "__main__":
    sys.exit(main())
