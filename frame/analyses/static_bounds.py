"""Bounds of displacements, drifts and forces of structures at rest, with fuzzy parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, checked_number, require, require_choice
from alphacut.base.nature import Nature
from alphacut.base.number_text import engineering, percent_text
from alphacut.base.progress_bar import Progress
from alphacut.base.quantity import Quantity
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.frame.analyses.limits import Limit, about_limit, limits_by_name
from alphacut.frame.analyses.question import Asked, Question
from alphacut.frame.boxes import ALPHA, Boxes, boxes
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.model import Dynamics, StructureModel

if TYPE_CHECKING:
    from alphacut.fuzzy import FuzzyNumber

MAX_BOXES = 400
"""Sub-boxes of one end of an output, after which its gap is stated as it is (tuned: some seconds of
80 unknowns)."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class StaticBounds(Answer):
    """Bounds of the outputs of a structure at rest on each level.

    Args:
        outputs: Names of the outputs.
        units: Their SI units.
        alpha: Levels α, rising, shape (levels,).
        bounds: Guaranteed lower and upper bounds, shape (levels, outputs, 2).
        attained: Smallest and largest values found, the same shape.
        inputs: Names of the inputs.
        attained_at: Inputs in SI units at which the values of the lowest level are attained, shape
            (outputs, 2, inputs).
        nominal: Outputs at the most plausible inputs, shape (outputs,).
        limits: Limits of outputs by name.
    """

    key = "static"
    title = "How far does it move at rest?"
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    alpha: Array
    bounds: Array
    attained: Array
    inputs: tuple[str, ...]
    attained_at: Array
    nominal: Array
    limits: Mapping[str, Limit]

    @property
    def gaps(self) -> Array:
        """Distance from attained values to bounds over the larger end, shape (levels, outputs)."""
        distance = np.abs(self.bounds - self.attained).max(axis=-1)
        largest = np.abs(self.attained).max(axis=-1)
        return np.asarray(distance / np.where(largest > 0, largest, 1.0))

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each output on the lowest level, then one for each limit."""
        for j, (name, unit) in enumerate(zip(self.outputs, self.units, strict=True)):
            ends = [engineering(x, unit) for x in self.bounds[0, j]]
            found = [engineering(x, unit) for x in self.attained[0, j]]
            yield {
                "output": name,
                "at rest": f"{ends[0]} … {ends[1]}",
                "nature": str(Nature.GUARANTEED),
                "attained": f"{found[0]} … {found[1]}",
                "gap": percent_text(float(self.gaps[0, j])),
            }
        for name, limit in self.limits.items():
            j = self.outputs.index(limit.output)
            yield {
                "output": about_limit(limit, self.units[j]).words,
                "at rest": self.verdicts[name],
                "nature": str(Nature.GUARANTEED),
                "attained": "",
                "gap": "",
            }

    @property
    def verdicts(self) -> dict[str, str]:
        """Whether each limit is exceeded over the lowest level, by the name of the limit.

        It is "not exceeded", "exceeded" throughout, "can be exceeded", or "undecided".
        """
        found = {}
        for name, limit in self.limits.items():
            j = self.outputs.index(limit.output)
            bounds = _outward(self.bounds[0, j], limit)
            attained = _outward(self.attained[0, j], limit)
            verdict = "undecided"
            if bounds[1] <= limit.outwards:
                verdict = "not exceeded"
            elif bounds[0] > limit.outwards:
                verdict = "exceeded"
            elif attained[1] > limit.outwards:
                verdict = "can be exceeded"
            found[name] = verdict
        return found

    def number_rows(self) -> Iterator[Row]:
        """Yield a row for each output and level."""
        for level, alpha in enumerate(self.alpha):
            for j, name in enumerate(self.outputs):
                yield {
                    "output": name,
                    "unit": self.units[j],
                    "alpha": alpha,
                    "lower bound": self.bounds[level, j, 0],
                    "smallest attained": self.attained[level, j, 0],
                    "nominal": self.nominal[j],
                    "largest attained": self.attained[level, j, 1],
                    "upper bound": self.bounds[level, j, 1],
                }

    def compared(self) -> dict[str, float | str]:
        """Return the verdicts."""
        return dict(self.verdicts)

    def words(self) -> str:
        """Return what the bounds hold for, and how close they are."""
        largest = percent_text(float(self.gaps.max(initial=0)))
        return (
            f"Bounds over the inputs {', '.join(self.inputs)} at α = {self.alpha[0]:g}, of the"
            f" forces that act for ever. They differ from attained values by at most {largest} of"
            " the larger end."
        )


def _outward(ends: Array, limit: Limit) -> tuple[float, float]:
    """Return the range of what a limit bounds from above, from the range of the output."""
    lower, upper = float(ends[0]), float(ends[1])
    if limit.side == "max":
        return lower, upper
    if limit.side == "min":
        return -upper, -lower
    smallest = 0.0 if lower <= 0 <= upper else min(abs(lower), abs(upper))
    return smallest, max(abs(lower), abs(upper))


@dataclass(frozen=True)
class Static(Question):
    """Bounds of displacements and forces at rest, under the forces that are static.

    Args:
        fuzzy: Inputs that are fuzzy.
        alpha: α-levels.
        outputs: Outputs that are bounded; all of the structure if left out.
        limits: Limits, 'u2 <= 20 mm', 'base_shear <= 900 kN'.
        gap: Wanted distance from attained values to bounds, over the larger end of an output.
    """

    fuzzy: tuple[str, ...]
    alpha: tuple[float, ...] = ALPHA
    outputs: tuple[str, ...] = ()
    limits: tuple[Limit, ...] = ()
    gap: Annotated[float, Quantity(above=0, maximum=1)] = 0.01

    def require(self, model: StructureModel, components: int) -> None:
        """Refuse a structure that is not linear, and one without static forces."""
        _linear(model, self.outputs)

    def answer(self, asked: Asked, progress: Progress) -> StaticBounds:
        """Return the bounds."""
        return static_bounds(
            asked.model,
            asked.inputs,
            outputs=self.outputs,
            alpha=asked.alpha,
            gap=self.gap,
            limits=self.limits,
            progress=progress,
        )


def static_bounds(
    structure: StructureModel,
    inputs: Mapping[str, FuzzyNumber | float],
    *,
    outputs: Sequence[str] = (),
    alpha: Sequence[float] = ALPHA,
    gap: float = 0.01,
    limits: Sequence[Limit] = (),
    progress: Progress = lambda done: None,
) -> StaticBounds:
    """Return guaranteed bounds of the outputs of a structure at rest, K(p) u = f(p).

    An input that multiplies a matrix of rank one, as the stiffness of a bar, a spring or a storey,
    and one that multiplies loads, has the extremes at its ends. Boxes of other inputs are divided
    until the gap is as wanted, or the number of sub-boxes is 400.

    Args:
        structure: A linear structure with forces whose histories are static. That of a
            `MatrixStructure` without mass may act on any unknown.
        inputs: Fuzzy parameters by name, in SI units; a number is a crisp one.
        outputs: Names of the outputs, of displacements or forces; all of the structure if empty.
        alpha: Levels, rising within [0, 1].
        gap: Wanted distance from attained values to bounds, over the larger end of an output.
        limits: Limits of outputs, which get verdicts.
        progress: Function that takes the completed fraction.

    Returns:
        StaticBounds: `bounds` and `attained`, shape (levels, outputs, 2), and `attained_at`.

    Raises:
        RefusedError: An argument is not as said, no force is static, one is not, or all are zero;
            or the stiffness is singular at the nominal inputs or at an end of them.
        UnprovedError: The stiffness is not known to be positive definite over the inputs.

    Example:
        >>> from alphacut.frame import Force, History, StoreyFrame, static_bounds
        >>> from alphacut.fuzzy import Interval
        >>> push = Force(1, 1e4, History.constant(0, is_static=True))
        >>> frame = StoreyFrame(masses=[2e4], stiffness=[5e6], loads=[push], outputs=("q1",))
        >>> found = static_bounds(frame, {"k1": Interval(4e6, 5e6)}, alpha=[0])
        >>> found.bounds[0, 0].round(6).tolist()
        [0.002, 0.0025]
    """
    from alphacut.frame.bounds.static_response import StaticSearch

    system = _linear(structure, outputs)
    named = limits_by_name(limits, tuple(map(str, system.outputs))) if limits else {}
    checked_number("gap", gap, positive=True)
    cuts = boxes(inputs, alpha)
    for name, low, high in zip(cuts.names, cuts.lower[0], cuts.upper[0], strict=True):
        require_choice("inputs", name, system.parameters)
        parameter = system.parameter(name)
        ends = f"[{low:g}, {high:g}]"
        require(parameter.admits(low, high), f"inputs: {name}", ends, parameter.range)
    _require_definite(system, cuts)

    search = StaticSearch(system, cuts.names, cuts.lower[0], cuts.upper[0])
    require(bool(search.model.loads.any()), "loads", "zero", "a static force that is not zero")
    levels, count = len(cuts.alpha), len(system.outputs)
    bounds = np.empty((levels, count, 2))
    attained = np.empty((levels, count, 2))
    at = np.empty((count, 2, len(cuts.names)))
    for j in range(count):
        # rounding moves an output of zero by far less than 1e-9 of its magnitude without signs
        floor = 1e-9 * search.size(j, cuts.nominal)
        for level in reversed(range(levels)):
            box = (cuts.lower[level], cuts.upper[level])
            corners = [abs(search.value(j, end)) for end in (*box, cuts.nominal)]
            allowed = max(floor, gap * max(corners))
            for k, side in enumerate((-1.0, 1.0)):
                found = search.extreme(j, side, *box, gap=allowed, max_boxes=MAX_BOXES)
                bounds[level, j, k] = side * found.bound
                attained[level, j, k] = side * found.attained
                if level == 0:
                    at[j, k] = found.at
            progress((j + 1 - level / levels) / count)
    return StaticBounds(
        outputs=tuple(map(str, system.outputs)),
        units=tuple(system.unit_of(name).removeprefix("SI") for name in system.outputs),
        alpha=cuts.alpha,
        bounds=bounds,
        attained=attained,
        inputs=cuts.names,
        attained_at=at,
        nominal=np.array([search.value(j, cuts.nominal) for j in range(count)]),
        limits=named,
    )


def _linear(structure: StructureModel, outputs: Sequence[str]) -> LinearSystem:
    """Return a linear structure with some of its outputs.

    Raises:
        RefusedError: It is not linear, has a force that is not static, or an output is of
            velocities or accelerations.
    """
    if not isinstance(structure, LinearSystem) or structure.dynamics is not Dynamics.LINEAR:
        cure = "take elastic() of a frame whose columns yield"
        raise RefusedError("structure", "one that is not linear", "a linear structure", cure)
    system = structure.with_outputs(outputs) if outputs else structure
    static = [x.history is not None and x.history.is_static for x in system.loads]
    allowed = 'static forces alone, History.constant(0, is_static=True), "step, static" in a case'
    require(
        all(static) and len(static) > 0, "loads", f"{sum(static)} of {len(static)} static", allowed
    )
    moving = [name for name in system.outputs if system.unit_of(name) in ("m/s", "m/s^2")]
    require(
        not moving, "outputs", ", ".join(moving), "displacements and forces of a structure at rest"
    )
    return system


def _require_definite(system: LinearSystem, cuts: Boxes) -> None:
    """Raise RefusedError if the stiffness is singular at nominal inputs or with all at one end."""
    from alphacut.frame.bounds.static_response import affine_model

    places = (
        ("nominal inputs", cuts.nominal),
        ("lower ends", cuts.lower[0]),
        ("upper ends", cuts.upper[0]),
    )
    for words, point in places:
        stiffness = affine_model(system, cuts.names, point, point).stiffness[0]
        values, vectors = np.linalg.eigh(stiffness)
        is_definite = values[0] > 1e-13 * np.abs(values).max()
        moving = np.flatnonzero(np.abs(vectors[:, 0]) > 0.1 * np.abs(vectors[:, 0]).max())
        what = f"singular or indefinite at the {words}: unknowns {moving[:6].tolist()} move"
        require(bool(is_definite), "stiffness", what, "a stiffness that holds all unknowns")
