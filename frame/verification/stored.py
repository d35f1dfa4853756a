"""Structures whose exact motions a result was tested with, as arrays beside the result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from alphacut.frame.verification.exact_motion import LinearMotion
from alphacut.fuzzy.arrays import Array

if TYPE_CHECKING:
    import xarray

Variables = Mapping[str, tuple[tuple[str, ...], Array]]
"""Arrays with the names of their axes."""
MOST = 1_000_000
"""Most numbers of all matrices, 8 MB; structures beyond are left out, the first one never."""
MATRIX = ("motion", "row", "column")
AXES = {
    "mass": MATRIX,
    "damping": MATRIX,
    "stiffness": MATRIX,
    "rows": ("motion", "output", "state"),
    "start": ("motion", "state"),
    "pattern": ("motion", "row"),
}
"""Axes of each array of a `LinearMotion`; the record is that of all."""


def variables(points: Array, motions: Sequence[LinearMotion]) -> Variables:
    """Arrays of the structures at points (S, n), ready for a dataset."""
    count = max(1, min(len(motions), MOST // (3 * motions[0].mass.size)))
    some = motions[:count]
    arrays = {name: np.stack([getattr(x, name) for x in some]) for name in AXES}
    return {
        "motion_inputs": (("motion", "parameter"), points[:count]),
        **{f"motion_{name}": (AXES[name], array) for name, array in arrays.items()},
        "record": (("sample",), some[0].record),
        "record_step": ((), np.array(some[0].record_step)),
    }


def stored_motions(data: xarray.Dataset) -> tuple[Array, list[LinearMotion]]:
    """Inputs (S, n) and structures that a dataset holds."""
    points = data["motion_inputs"].values
    record, step = data["record"].values, float(data["record_step"])
    arrays = [{name: data[f"motion_{name}"].values[s] for name in AXES} for s in range(len(points))]
    return points, [LinearMotion(**each, record=record, record_step=step) for each in arrays]
