"""Velocity in a clamped bar under an uncertain force, of the reachability competition ARCH-COMP.

The bar of length 200, area 1, Young's modulus 3·10⁷ and density 7.3·10⁻⁴ is clamped at one end and
divided into 100 elements with half of their mass at either end (case CBC01). Its damping matrix is
10⁻⁶ s K + 10⁻⁶ M / s. It is at rest when a force between 9,900 and 10,100 begins to pull at its
other end, and is followed for .01 s. Velocities are to stay below 74. The problem asks for node 70;
CORA's file takes state 140 of 200, which is the velocity of node 40.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alphacut.frame import Force, History, MatrixStructure, envelope
from alphacut.fuzzy import Interval
from benchmarks.public.row import Row

NAME = "Clamped bar (ARCH-COMP)"
SOURCE = (
    "https://github.com/JuliaReach/ClampedFreeBar, `tex/ClampedFreeBar.tex` (problem), and CORA,"
    " https://github.com/TUMcps/CORA, `examples/ARCHcompetition/linear/benchmark_linear_verifyFast_"
    "ARCH23_beam_CBC01.m` (`y1 <= 74`)"
)
ELEMENTS, LENGTH, MODULUS, DENSITY = 100, 200.0, 30e6, 7.3e-4
DAMPING = 1e-6
DURATION, STEPS = 0.01, 720
LIMIT = "≤ 74"


def bar(nodes: tuple[int, ...]) -> MatrixStructure:
    """The bar, with the velocities of these nodes, counted from the clamped end, as outputs."""
    length = LENGTH / ELEMENTS
    mass = DENSITY * length * np.eye(ELEMENTS)
    mass[-1, -1] /= 2
    beside = np.eye(ELEMENTS, k=1) + np.eye(ELEMENTS, k=-1)
    stiffness = MODULUS / length * (2 * np.eye(ELEMENTS) - beside)
    stiffness[-1, -1] /= 2
    return MatrixStructure(
        {"force": 10e3},
        [(1.0, mass)],
        [(1.0, stiffness)],
        {f"node{node}": np.eye(2 * ELEMENTS)[ELEMENTS + node - 1] for node in nodes},
        damping=[(DAMPING, stiffness), (DAMPING, mass)],
        loads=[Force(np.eye(ELEMENTS)[-1], "force", History.constant())],
    )


def rows() -> Iterator[Row]:
    """Bound the velocities at all times."""
    structure = bar((70, 40))
    inputs = {"force": Interval(9900.0, 10100.0)}
    step = DURATION / STEPS
    found = envelope(structure, inputs, duration=DURATION, step=step, alpha=(0.0,))
    for column, name in enumerate(structure.outputs):
        largest = float(found.attained.upper[0, :, column].max())
        upper = float(found.extremes_over_time(column).upper[0])
        remark = "proved at all times; the lower end is attained"
        yield Row(
            f"velocity of node {name.removeprefix('node')}",
            LIMIT,
            (largest, upper),
            5,
            remark=remark,
        )
