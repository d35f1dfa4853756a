"""Models of the cell at their edges: `make stability`.

Every row is one edge and one model: the error declared and the true one (against the series), or
the sentence of refusal. A row is wrong, and the program exits with 1, where a result came without a
word and its true error is above the declared one.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.rve import PrismModel, SlicesModel
from alphacut.rve.cell.cell import Phase
from alphacut.rve.series.model import SeriesModel
from alphacut.stochastic import HermiteMap, RadiusMap, TruncatedNormal
from benchmarks.rows import write

MATRIX, PARTICLE = Phase(20e9), Phase(80e9)
PAPER_MAP = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)  # nominal values of the paper, section 4.1
ROUND_OFF = 1e-11


def crisp(radius: float) -> HermiteMap:
    """The map of a certain radius."""
    return HermiteMap(radius, 0.0, radius, 0.0)


@dataclass(frozen=True)
class Jump:
    """A radius of 0.4 below θ = 0.3 and 0.7 above."""

    distribution: TruncatedNormal = field(default_factory=TruncatedNormal)

    def __call__(self, theta: ArrayLike) -> Array:
        """Radius at `theta`, any shape."""
        return np.where(np.asarray(theta, float) < 0.3, 0.4, 0.7)


@dataclass(frozen=True)
class Edge:
    """A cell at the edge of what a model can do."""

    name: str
    radius_map: RadiusMap
    matrix: Phase = MATRIX
    particle: Phase = PARTICLE


EDGES = (
    Edge("r = 1e-6", crisp(1e-6)),
    Edge("r = 0.001", crisp(1e-3)),
    Edge("r = 0.98", crisp(0.98)),
    Edge("r = 0.98, hole", crisp(0.98), particle=Phase(20e3)),
    Edge("r = 0.98, rigid", crisp(0.98), particle=Phase(20e15)),
    Edge("r = 0.99999, hole", crisp(0.99999), particle=Phase(20e3)),
    Edge("contrast 1e-6", PAPER_MAP, particle=Phase(20e3)),
    Edge("contrast 1e6", PAPER_MAP, particle=Phase(20e15)),
    Edge("ν_m = ν_i = 0.45", PAPER_MAP, Phase(20e9, 0.45), Phase(80e9, 0.45)),
    Edge("ν_m = ν_i = 0.4999", PAPER_MAP, Phase(20e9, 0.4999), Phase(80e9, 0.4999)),
    Edge("map not monotone", HermiteMap(0.6, -1.5, 0.7, 0.5)),
    Edge("map that jumps", Jump()),
    Edge("steep map (distorted layers)", HermiteMap(0.02, 0.0, 0.95, 2.5)),
)


LAYERS = (2, 3, 6, 12, 25, 50, 100, 200)


@dataclass(frozen=True)
class Row:
    """Edge met by one model; `declared` and `true` are nan where refused."""

    edge: str
    model: str
    outcome: str
    declared: float
    true: float
    seconds: float
    sentence: str = ""


def meet(edge: Edge, name: str, model: Any) -> Row:
    """Try one model on one edge."""
    cell, started = (edge.radius_map, edge.matrix, [edge.particle]), perf_counter()
    try:
        found = model.solve(*cell)[0]
    except (RuntimeError, ValueError) as refusal:
        words, seconds = str(refusal).splitlines()[0], perf_counter() - started
        return Row(edge.name, name, "refuses", np.nan, np.nan, seconds, words)
    seconds, declared = perf_counter() - started, found.estimated_error
    try:
        exact = SeriesModel().solve(*cell)[0]
    except RuntimeError as refusal:
        return Row(edge.name, name, "unjudged", declared, np.nan, seconds, f"no truth: {refusal}")
    true = abs(found.modulus / exact.modulus - 1)
    works = true <= declared + ROUND_OFF
    return Row(edge.name, name, "works" if works else "WRONG", declared, true, seconds)


def table() -> Iterator[Row]:
    """All rows: every edge by every model, then the layers of the prism model."""
    models = {"series": SeriesModel(), "slices": SlicesModel(0.25, 8), "prism": PrismModel(0.25)}
    for edge in EDGES:
        for name, model in models.items():
            yield meet(edge, name, model)
    for layers in LAYERS:
        yield meet(Edge(f"{layers} layers", PAPER_MAP), "prism", PrismModel(0.25, layers))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table and write the CSV file; exit 1 if a row is wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    file = Path(__file__).parents[1] / "results" / "cell_stability.csv"
    parser.add_argument("--out", type=Path, default=file, help="CSV file to write")
    options = parser.parse_args(arguments)
    rows = []
    print(f"{'edge':30} {'model':16} {'outcome':10} {'declared':>9} {'true':>9} {'seconds':>8}")
    for row in table():
        rows.append(row)
        print(
            f"{row.edge:30} {row.model:16} {row.outcome:10} {row.declared:9.1e} {row.true:9.1e}"
            f" {row.seconds:8.2f}  {row.sentence}",
            flush=True,
        )
    write([asdict(row) for row in rows], options.out)
    return int(any(row.outcome == "WRONG" for row in rows))


if __name__ == "__main__":
    sys.exit(main())
