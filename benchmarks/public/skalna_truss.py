"""Skalna's truss of seven bars with an uncertain one.

Nodes (0, 0), (1, 1), (2, 0), (3, 1), (4, 0) m, bars 1-2, 1-3, 2-3, 2-4, 3-4, 3-5 and 4-5 with
E = 200 GPa and A = 0.005 m². Node 1 is held in y, node 5 in both directions, and 10 kN push down
on node 2. The stiffness of bar 2-3 is within ± 10 %. The published ranges are enclosures of first
order, which are wider than the exact ones.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alphacut.frame import Force, History, MatrixStructure, static_bounds
from alphacut.fuzzy import Interval
from benchmarks.public.row import Row

NAME = "Skalna: a truss at rest"
SOURCE = (
    "I. Skalna, *Reliable Computing* 12 (2006), example 4.1, as tested in"
    " https://github.com/JuliaIntervals/IntervalLinearAlgebra.jl (`src/pils`)"
)
PUBLISHED = {
    "x of node 1": "-20",
    "x of node 2": "[-2.7, -2.3]",
    "y of node 2": "[-38.91, -38.52]",
    "x of node 3": "-5",
    "y of node 3": "[-34.53, -33.75]",
    "x of node 4": "[-12.7, -12.3]",
    "y of node 4": "[-19.77, -19.37]",
}
NODES = np.array([(0, 0), (1, 1), (2, 0), (3, 1), (4, 0)], float)
BARS = ((0, 1), (0, 2), (1, 2), (1, 3), (2, 3), (2, 4), (3, 4))
FREE = (0, 2, 3, 4, 5, 6, 7)


def rows() -> Iterator[Row]:
    """Bound the displacements of the free unknowns, in micrometres."""
    terms = []
    for number, (a, b) in enumerate(BARS, start=1):
        along = NODES[b] - NODES[a]
        length = float(np.linalg.norm(along))
        row = np.zeros(10)
        row[2 * b : 2 * b + 2] = along / length
        row[2 * a : 2 * a + 2] = -along / length
        stiffness = 200e9 * 0.005 / length * np.outer(row, row)
        terms.append((f"s{number}", stiffness[np.ix_(FREE, FREE)]))
    truss = MatrixStructure(
        {name: 1.0 for name, _ in terms},
        (),
        terms,
        {f"u{k}": np.eye(7)[k] for k in range(7)},
        loads=[Force(np.eye(7)[2], -10e3, History.constant(0, is_static=True))],
    )
    found = static_bounds(truss, {"s3": Interval(0.9, 1.1)}, alpha=[0], gap=1e-9)
    for (quantity, published), (lower, upper) in zip(
        PUBLISHED.items(), 1e6 * found.bounds[0], strict=True
    ):
        remark = "ends attained"
        yield Row(quantity, published, (float(lower), float(upper)), 5, "µm", remark=remark)
