"""The margin that covers rounding in guaranteed bounds, and the test that it suffices."""

from __future__ import annotations

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.bounds.box_proof import ROUNDING_MARGIN
from alphacut.frame.boxes import UnitFlow
from alphacut.frame.dynamics.flow import exact_flow
from alphacut.frame.modes.structure import PointModes
from alphacut.frame.verification.self_test import structures_at

EXCESS = 10.0
"""Factor of the margin over the largest difference of two algorithms that is seen; chosen."""


def rounding_margin(problem: UnitFlow) -> Array:
    """Return a margin for the rounding of bounds and attained values of each output, shape (m,).

    Bounds are proved in exact arithmetic. Their rounding is that of responses, tables and sums
    alike, and is judged by two algorithms of the exact response that have nothing in common: modes,
    which proofs rest on, and the series of the judge. The margin is 1e-9 of the peak, or ten times
    the largest difference at the nominal inputs and at two corners where that is more.

    Args:
        problem: The exact response of a linear structure over the boxes of its inputs.

    Raises:
        UnprovedError: Modes drift, are nearly defective, or turn too far within a sample interval
            of a load.
        numpy.linalg.LinAlgError: A matrix is singular.
    """
    flow = exact_flow(problem.flow)
    cuts = problem.boxes
    points = np.stack([cuts.nominal, cuts.lower[0], cuts.upper[0]])
    difference = np.zeros(len(flow.outputs))
    judges = structures_at(flow.system, cuts.names, points)
    for point, judge in zip(points, judges, strict=True):
        modes = PointModes.of_system(flow.system, cuts.names, point[np.newaxis])
        judged = judge.outputs(flow.time)
        off = np.abs(modes.response(flow.time) - judged.values) - judged.rounding
        difference = np.maximum(difference, off.max(axis=0))
    return np.maximum(ROUNDING_MARGIN * problem.peak, EXCESS * difference)
