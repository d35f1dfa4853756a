"""Declared against true error of everything that the cell's models print and export.

    ./enter python -m benchmarks.rve.calibration --cases 300 --seed 1

Cells are drawn at random: contrasts of 1e-3 to 1e3, Poisson's ratios to 0.4999 in either phase,
random Hermite maps with radii up to nearly touching; the models take turns, each at a random
resolution or tolerance. The truth is the multipole series at 1e-12 for every model but the series,
whose truth is planar elements of order 4 where it claims no more than these reach, and itself at
1e-12 otherwise. Prints, for each quantity that is printed or exported and for each model, how many
numbers lie outside their declared errors, and the median of declared over true; exit status 1 if
one number lies outside, or a quantity's median is above 10. A model that refuses is counted, not
judged. In pieces: `--first 0 --cases 100 --out A.csv`, `--first 100 …`, then
`--read A.csv B.csv …` sums up and keeps the table.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.rve.cell import Cell, Phase
from alphacut.rve.fibre_constants import fibre_constants
from alphacut.rve.model import Model, named
from alphacut.rve.result import Homogenised
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.stages.cell import declared_errors, document
from alphacut.stochastic import HermiteMap
from benchmarks.rows import write

ROUND_OFF = 3e-11  # of the truth, relative: rounding near incompressibility
REFUSED = "refused"
MOST_MEDIAN = 10.0  # declared over true, of a quantity
RESULTS = Path(__file__).parents[1] / "results" / "cell_calibration.csv"
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
        size, points = float(rng.uniform(0.2, 1.0)), int(rng.integers(3, 10))
        return named(name, order=int(rng.integers(2, 5)), mesh_size=size, points=points)
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
    cases: int, seed: int, models: Sequence[str] = MODELS, first: int = 0
) -> Iterator[tuple[str, Cell, object]]:
    """Each case's model, cell, and its judgements or the refusal's text; from `first` on."""
    rng = np.random.default_rng(seed)
    for k in range(first + cases):
        name = models[k % len(models)]
        cell, model = draw_cell(rng), draw_model(name, rng)
        if k < first:
            continue
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
    parser.add_argument("--first", type=int, default=0, help="cases to draw but leave out (0)")
    parser.add_argument("--out", type=Path, help="CSV of every number judged, for --read")
    parser.add_argument("--read", type=Path, nargs="+", help="sum up such files, compute nothing")
    parser.add_argument("--models", default=",".join(MODELS), help="models that take turns")
    options = parser.parse_args(arguments)
    if options.read:
        rows = [row for path in options.read for row in _read(path)]
    else:
        models = options.models.split(",")
        rows = list(_judged(options.cases, options.seed, models, options.first))
    if options.out:
        write(rows, options.out)
    summary = list(sums(rows))
    print_table(summary)
    if options.read:
        write(summary, RESULTS)
    return int(not holds(summary))


def print_table(summary: Sequence[Mapping[str, Any]]) -> None:
    """A line for each quantity and model."""
    print(f"{'quantity':24} {'cells':>5} {'numbers':>7} {'outside':>7}  median declared/true")
    for row in summary:
        print(
            "{quantity:24} {cells:5d} {numbers:7d} {outside:7d}  {median}".format(**row), flush=True
        )


def holds(summary: Sequence[Mapping[str, Any]]) -> bool:
    """Whether numbers were judged, none lies outside, and no quantity's median is too large."""
    rows = [row for row in summary if row["quantity"] != REFUSED]
    quantities = [row for row in rows if not row["quantity"].startswith("model ")]
    loose = [row for row in quantities if row["median"] and float(row["median"]) > MOST_MEDIAN]
    return bool(rows) and not loose and not any(row["outside"] for row in rows)


def _judged(cases: int, seed: int, models: Sequence[str], first: int) -> Iterator[dict[str, Any]]:
    """Rows of every number; misses and refusals are printed."""
    for k, (name, cell, found) in enumerate(calibrate(cases, seed, models, first), start=first):
        place = {"seed": seed, "case": k, "model": name}
        if isinstance(found, str):
            print(f"case {k}: {name} refused: {found[:110]}", flush=True)
            yield {**place, "quantity": REFUSED, "ratio": "", "outside": 0}
            continue
        worst = {}
        for one in found:
            if not one.covered:
                worst[one.quantity] = f"{one.true / one.declared:.3g} times its declared error"
            told = one.quantity != "tolerance" and one.true > 3 * one.noise
            ratio = f"{one.declared / one.true:.4g}" if told else ""
            yield {
                **place,
                "quantity": one.quantity,
                "ratio": ratio,
                "outside": int(not one.covered),
            }
        if worst:
            print(f"case {k}: {name} {cell}: {worst}", flush=True)


def _read(path: Path) -> Iterator[dict[str, Any]]:
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            yield {**row, "outside": int(row["outside"])}


def sums(rows: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Numbers, misses and the median of declared over true for each quantity and model.

    The median is empty where no true error stands out from what the truth may be off by.
    """
    groups: defaultdict[str, list[Mapping[str, Any]]] = defaultdict(list)
    for row in rows:
        groups[str(row["quantity"])].append(row)
        if row["quantity"] != REFUSED:
            groups[f"model {row['model']}"].append(row)
            groups["all"].append(row)
    for name, group in sorted(groups.items()):
        ratios = [float(str(row["ratio"])) for row in group if row["ratio"]]
        yield {
            "quantity": name,
            "cells": len({(row["seed"], row["case"]) for row in group}),
            "numbers": len(group),
            "outside": sum(int(str(row["outside"])) for row in group),
            "median": f"{np.median(ratios):.3g}" if ratios else "",
        }


if __name__ == "__main__":
    sys.exit(main())
