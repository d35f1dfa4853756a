"""Hull of two outputs of a case's structure at a time, or of one output at two times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.checks.step_error import step_error
from alphacut.frame.dynamics.flow import Flow
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.joint_outputs import area, joint_outputs
from alphacut.io.files import Document
from alphacut.io.problem import BadInput
from alphacut.stages.vibration.envelope_task import task_of
from alphacut.stages.vibration.structure import Structure
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False)
class Pair:
    """Two values of a motion as a function of the inputs, for `joint_outputs`.

    Args:
        flow: The motion.
        places: Node and output of both values.
        unit: What both are divided by, so that directions between them mean something.
    """

    flow: Flow
    places: tuple[tuple[int, int], tuple[int, int]]
    unit: tuple[float, float] = (1.0, 1.0)

    def __call__(self, **inputs: Array) -> tuple[Array, Array]:
        """Both values, each (S,), for inputs of shape (S,)."""
        points = np.column_stack(np.broadcast_arrays(*inputs.values()))
        values = self.flow.values(points)
        (node, output), (other_node, other_output) = self.places
        one, two = self.unit
        return values[:, node, output] / one, values[:, other_node, other_output] / two

    def scaled(self, lower: Array, upper: Array) -> Pair:
        """The same in units of about the ranges of both over a box (d,)."""
        middle = (lower + upper) / 2
        ends = [middle + np.diag(sign * (upper - lower) / 2) for sign in (-1.0, 1.0)]
        points = np.vstack([middle[None], *ends])
        one, two = (float(np.ptp(value)) or 1.0 for value in self(**dict(enumerated(points))))
        return replace(self, unit=(one, two))


def enumerated(points: Array) -> Iterator[tuple[str, Array]]:
    """Columns of points (S, d), each by a name."""
    return ((f"x{k}", column) for k, column in enumerate(points.T))


def joint(case: Case, wanted: Structure) -> xarray.Dataset:
    """Enclosing and reached polygons of both values by level.

    Corners beyond a polygon's own repeat its last one.

    Args:
        case: With the sections joint and envelope.
        wanted: The structure.

    Raises:
        BadInput: The inputs cannot be followed together.
    """
    import xarray

    task, given = task_of(case), case.joint
    inputs = wanted.inputs(task.fuzzy)
    scheme = task.scheme if wanted.linear is not None else task.integrator
    flow = wanted.flow(tuple(inputs), max(*given.times, task.step), task.step, scheme)
    columns = [wanted.outputs.index(name) for name in given.outputs]
    nodes = [round(time / task.step) for time in given.times]
    one, other = [(nodes[k % len(nodes)], columns[k % len(columns)]) for k in range(2)]
    supports = np.array([number.cut(task.alpha[0]) for number in inputs.values()])
    pair = Pair(flow, (one, other)).scaled(*supports.T)
    try:
        steps = step_error(UnitFlow(flow, boxes(inputs, task.alpha)))
        wrong = [steps[place] / size for place, size in zip(pair.places, pair.unit, strict=True)]
        found = joint_outputs(
            pair,
            inputs,
            alpha=task.alpha,
            vectorised=True,
            progress=False,
            error=(float(wrong[0]), float(wrong[1])),
        )
    except ValueError as error:
        raise BadInput.of("joint", str(error), file=str(case.path)) from None
    words = [
        f"{given.outputs[k % len(columns)]} at {given.times[k % len(nodes)]:g} s" for k in (0, 1)
    ]
    units = [Output(given.outputs[k % len(columns)]).unit for k in (0, 1)]
    polygons = (("alpha", "corner", "value"), _padded([*found.outer, *found.inner]))
    outer, inner = np.split(polygons[1] * np.array(pair.unit), 2)
    return xarray.Dataset(
        {"outer": (polygons[0], outer), "inner": (polygons[0], inner)},
        {"alpha": np.array(found.alpha), "value": words, "unit": ("value", units)},
        {"nature": found.nature, "claim": found.claim, "runs": found.result.runs},
    )


def _padded(polygons: list[Array]) -> Array:
    """Polygons of one shape (N, corners, 2), their last corners repeated."""
    most = max(len(corners) for corners in polygons)
    rows = [np.vstack([x, np.repeat(x[-1:], most - len(x), axis=0)]) for x in polygons]
    return np.array(rows)


def joint_document(found: xarray.Dataset) -> Document:
    """Areas by level over those of the rectangle of both ranges, and what they are worth."""
    outer, inner = (found[kind].values for kind in ("outer", "inner"))
    boxes = np.ptp(outer, axis=1).prod(1)
    shares = {
        kind: [area(x) / box if box > 0 else 1.0 for x, box in zip(polygons, boxes, strict=True)]
        for kind, polygons in (("outer", outer), ("inner", inner))
    }
    return {
        "values": [str(x) for x in found["value"].values],
        "units": [str(x) for x in found["unit"].values],
        "alpha": found["alpha"].values,
        "lower": outer.min(1),
        "upper": outer.max(1),
        "share_of_rectangle": shares,
        **{key: found.attrs[key] for key in ("nature", "claim", "runs")},
    }


def sentence(found: Document) -> str:
    """What the hull leaves of the rectangle of both ranges, on the lowest level."""
    one, other = found["values"]
    outer, inner = (found["share_of_rectangle"][kind][0] for kind in ("outer", "inner"))
    return (
        f"{one} and {other} together fill {inner:.1%} to {outer:.1%} of the rectangle of their"
        f" ranges at α = {found['alpha'][0]:g} ({found['nature']})"
    )
