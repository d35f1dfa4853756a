"""Structures whose exact motions a result was tested with, as arrays beside the result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.frame.verification.exact_motion import Course, LinearMotion
from alphacut.fuzzy.arrays import Array

if TYPE_CHECKING:
    import xarray

Variables = Mapping[str, tuple[tuple[str, ...], Array]]
"""Arrays with the names of their axes."""
MAX_NUMBERS = 1_000_000
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
FORCES = {"forces": ("motion", "row", "load"), "feeds": ("motion", "output", "load")}
"""Axes of what is there where forces act, whose courses are those of all."""


def variables(points: Array, motions: Sequence[LinearMotion]) -> Variables:
    """Return dataset variables with inputs (S, n) and matrices of the first of S structures.

    As many are stored as keep three matrices each within `MAX_NUMBERS`.
    """
    count = max(1, min(len(motions), MAX_NUMBERS // (3 * motions[0].mass.size)))
    stored = motions[:count]
    axes = AXES | (FORCES if stored[0].courses else {})
    arrays = {name: np.stack([getattr(x, name) for x in stored]) for name in axes}
    return {
        "motion_inputs": (("motion", "parameter"), points[:count]),
        **{f"motion_{name}": (axes[name], array) for name, array in arrays.items()},
        "record": (("sample",), stored[0].record),
        "record_step": ((), np.array(stored[0].record_step)),
        **_stored_courses(stored[0].courses),
    }


def stored_motions(data: xarray.Dataset) -> tuple[Array, list[LinearMotion]]:
    """Return inputs (S, n) and structures of the tested motions that a dataset holds."""
    points = data["motion_inputs"].values
    record, step = data["record"].values, float(data["record_step"])
    courses = _courses(data)
    m, n = data["motion_rows"].shape[1], data["motion_mass"].shape[1]
    no_forces = {"forces": np.zeros((n, 0)), "feeds": np.zeros((m, 0))}
    axes = AXES | (FORCES if courses else {})
    arrays = [
        no_forces | {name: data[f"motion_{name}"].values[s] for name in axes}
        for s in range(len(points))
    ]
    fixed: dict[str, Any] = {"record": record, "record_step": step, "courses": courses}
    return points, [LinearMotion(**arrays_of_motion, **fixed) for arrays_of_motion in arrays]


def _stored_courses(courses: Sequence[Course]) -> dict[str, tuple[tuple[str, ...], Array]]:
    """Return variables with the samples of all courses, one after the other, and their numbers.

    The numbers of a course are its sample count and its fields after the samples.
    """
    if not courses:
        return {}
    numbers = [[len(x.samples), *x[1:]] for x in courses]
    samples = np.concatenate([x.samples for x in courses])
    return {
        "course_samples": (("course_sample",), samples),
        "course_numbers": (("load", "number"), np.array(numbers, float)),
    }


def _courses(data: xarray.Dataset) -> tuple[Course, ...]:
    """Return the courses of forces that `_stored_courses` wrote to a dataset; none without any."""
    if "course_numbers" not in data:
        return ()
    numbers = data["course_numbers"].values
    ends = np.cumsum(numbers[:, 0]).astype(int)[:-1]
    samples = np.split(data["course_samples"].values, ends)
    return tuple(
        Course(x, step, start, bool(is_held), frequency, phase)
        for x, (_, step, start, is_held, frequency, phase) in zip(samples, numbers, strict=True)
    )
