"""Bathe's two masses under a step load.

Masses of 2 and 1 with the stiffness matrix [[6, −2], [−2, 4]] are at rest when a force of 10 begins
to act on the second one. Displacements after twelve steps of .28.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alphacut.frame import Force, History, LinearFlow, MatrixStructure, Midpoint
from benchmarks.frame.proved import outputs_at
from benchmarks.public.row import Row

NAME = "Bathe: two masses"
SOURCE = (
    "K.-J. Bathe, *Finite Element Procedures*, examples 9.1, 9.3 and 9.7, as tested in"
    " https://github.com/ONSAS/StructuralDynamicsODESolvers.jl, `test/problems.jl` (`U12`) and"
    " `test/solvers.jl` (“Newmark method”)"
)
STEP, STEPS = 0.28, 12
EXACT, NEWMARK = ("1.157", "2.489"), ("1.40", "2.31")


def rows() -> Iterator[Row]:
    """Enclose the exact motion, and follow it by the trapezoidal rule."""
    structure = MatrixStructure(
        {"factor": 1.0},
        [(1.0, np.diag([2.0, 1.0]))],
        [("factor", np.array([[6.0, -2.0], [-2.0, 4.0]]))],
        {"u1": np.array([1.0, 0.0]), "u2": np.array([0.0, 1.0])},
        loads=[Force(np.array([0.0, 10.0]), 1.0, History.constant())],
    )
    exact = outputs_at(structure, STEP * STEPS)
    for name, published in zip(structure.outputs, EXACT, strict=True):
        yield Row(f"{name}, exact", published, exact[name], remark="proved")
    flow = LinearFlow(structure, (), STEP * STEPS, STEP, Midpoint())
    last = flow.values(np.zeros((1, 0)))[0, -1].tolist()
    for name, published, found in zip(structure.outputs, NEWMARK, last, strict=True):
        yield Row(
            f"{name}, Newmark's scheme", published, found, remark="constant average acceleration"
        )
