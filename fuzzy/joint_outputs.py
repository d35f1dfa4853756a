"""Hull of two outputs together: what pairs of values are possible, not only what ranges.

The range of y1 cos φ + y2 sin φ over the inputs, in several directions φ, cuts half planes off:
what all of them leave encloses every pair, as surely as the ranges are bounded. The pairs at which
the ranges are reached span an inner polygon.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.propagation import on_interrupt, propagate
from alphacut.fuzzy.samples.result import FuzzyResult, Plan
from alphacut.fuzzy.sets.numbers import Array, FuzzyNumber

Pair = Callable[..., tuple[object, object]]


@dataclass(frozen=True, eq=False)
class JointOutputs:
    """Hulls of two outputs by level.

    Args:
        alpha: Levels.
        outer: Corners of the polygon that encloses the pairs, one array (corners, 2) for each
            level, counter-clockwise.
        inner: Corners of the hull of pairs that were reached, (corners, 2).
        nature: What the half planes are worth.
        claim: What the cuts of the inputs claim together.
        result: The ranges in all directions.
        margin: What the ranges may be wrong by in each direction, shape (levels, directions).
    """

    alpha: tuple[float, ...]
    outer: tuple[Array, ...]
    inner: tuple[Array, ...]
    nature: str
    claim: str
    result: FuzzyResult
    margin: Array

    def holds(self, pairs: Array, level: int = 0, slack: float = 0.0) -> Array:
        """Whether pairs (n, 2) lie in the enclosing polygon of a level."""
        slack = slack + self.margin[level]
        lower, upper = self.result.lower[level], self.result.upper[level]
        along = pairs @ _directions(len(lower)).T
        return np.asarray(((along >= lower - slack) & (along <= upper + slack)).all(1))

    def area(self, level: int = 0) -> tuple[float, float]:
        """Areas of the inner and the outer polygon of a level."""
        return area(self.inner[level]), area(self.outer[level])


def joint_outputs(
    function: Pair,
    inputs: Mapping[str, FuzzyNumber | float],
    plan: Plan | None = None,
    *,
    directions: int = 16,
    alpha: Sequence[float] | None = None,
    known: Known | None = None,
    vectorised: bool = False,
    progress: Progress | bool | None = None,
    error: tuple[float, float] = (0.0, 0.0),
) -> JointOutputs:
    """Hulls of a function's two outputs.

    Args:
        function: Gets the inputs by name and returns two numbers, or two arrays if `vectorised`:
            two outputs of a structure at a node, or one at two nodes.
        inputs: Fuzzy inputs, as for `propagate`.
        plan: As for `propagate`; with `BranchAndBound` the outer polygon is proved.
        directions: Number of directions, in each of which two half planes are cut off.
        alpha: Levels, as for `propagate`.
        known: Facts about the function's combinations, as for `propagate`.
        vectorised: Whether the function takes arrays.
        progress: As for `propagate`.
        error: What the two outputs may be wrong by at any point: the enclosing polygon grows by it,
            and by the plan's own estimated error, and the inner one shrinks by it.

    Raises:
        ValueError: There are fewer than two directions.
    """
    if directions < 2:
        raise ValueError(f"there is {directions} direction; a hull needs two or more")
    turned = Turned(function, directions)
    with on_interrupt(lambda: "`joint_outputs` keeps nothing: fewer levels end it sooner"):
        how = {"alpha": alpha, "known": known, "vectorised": vectorised, "progress": progress}
        found = propagate(turned, inputs, plan, **how)  # type: ignore[arg-type]
    unit = _directions(directions)
    margin = np.nan_to_num(found.error) + np.abs(unit) @ error
    outer, inner = [], []
    exact = np.flatnonzero(found.domain.exact)
    for level in range(len(found.domain.alpha)):
        above = exact[exact >= level]  # what is reached in wider cuts tells nothing
        ends = [at[k] for k in above[:1] for at in (found.lower_at, found.upper_at)]
        reached = np.vstack(ends or [found.domain.modal])
        pairs = [turned.pair(dict(zip(found.domain.names, row, strict=True))) for row in reached]
        inner.append(_shrunk(_hull(np.array(pairs)), np.array(error)))
        own = margin[level]
        cut = _polygon(unit, found.lower[level] - own, found.upper[level] + own)
        outer.append(cut if len(cut) else inner[-1])  # of one pair alone rounding leaves nothing
    levels, nature = tuple(found.domain.alpha), str(found.nature)
    claim = str(found.claim)
    return JointOutputs(levels, tuple(outer), tuple(inner), nature, claim, found, margin)


@dataclass(frozen=True)
class Turned:
    """Two outputs, seen along several directions.

    Args:
        function: Gives the two outputs.
        directions: Number of directions over half a turn.
    """

    function: Pair
    directions: int

    def __call__(self, **inputs: object) -> dict[str, object]:
        """Combination for each direction."""
        one, other = self.function(**inputs)
        cosine, sine = _directions(self.directions).T
        return {
            f"along {k}": float(a) * one + float(b) * other  # type: ignore[operator]
            for k, (a, b) in enumerate(zip(cosine, sine, strict=True))
        }

    def pair(self, inputs: Mapping[str, float]) -> tuple[float, float]:
        """The outputs at one point."""
        given = {name: np.array([float(x)]) for name, x in inputs.items()}
        one, other = self.function(**given)
        return float(np.asarray(one).ravel()[0]), float(np.asarray(other).ravel()[0])


def _directions(count: int) -> Array:
    angle = np.pi * np.arange(count) / count
    unit = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.where(np.abs(unit) < 1e-15, 0.0, unit)


def _polygon(unit: Array, lower: Array, upper: Array) -> Array:
    """Corners of {x: lower <= unit x <= upper}: a great square, cut by each half plane in turn."""
    reach = 4 * float(np.abs([lower, upper]).max()) + 1e-300
    corners: Array = reach * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for k in range(len(unit)):
        corners = _cut(corners, unit[k], float(upper[k]))
        corners = _cut(corners, -unit[k], -float(lower[k]))
    return corners


def _shrunk(corners: Array, error: Array) -> Array:
    """What a convex polygon keeps however its corners move by `error`; its middle if nothing."""
    if len(corners) < 3 or not error.any():
        return corners
    sides, kept = np.roll(corners, -1, axis=0) - corners, corners
    normals = sides[:, ::-1] * [1.0, -1.0]
    limits = (corners * normals).sum(1) - np.abs(normals) @ error
    for k in range(len(corners)):
        kept = _cut(kept, normals[k], float(limits[k]))
    return kept if len(kept) else corners.mean(0, keepdims=True)


def _cut(corners: Array, normal: Array, limit: float) -> Array:
    """The part of a convex polygon with normal · x <= limit."""
    height = corners @ normal - limit
    kept: list[Array] = []
    for k in range(len(corners)):
        a, b = height[k - 1], height[k]
        if (a > 0) != (b > 0):
            kept.append(corners[k - 1] + a / (a - b) * (corners[k] - corners[k - 1]))
        if b <= 0:
            kept.append(corners[k])
    return np.array(kept).reshape(-1, 2)


def _hull(points: Array) -> Array:
    """Corners of the convex hull, counter-clockwise (Andrew's chain)."""
    rows = np.unique(points, axis=0)
    if len(rows) < 3:
        return rows
    halves = []
    for ordered in (rows, rows[::-1]):
        half: list[Array] = []
        for row in ordered:
            while len(half) > 1 and _turn(half[-2], half[-1], row) <= 0:
                half.pop()
            half.append(row)
        halves += half[:-1]
    return np.array(halves)


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def area(corners: Array) -> float:
    """Area of a polygon (corners, 2)."""
    if len(corners) < 3:
        return 0.0
    x, y = corners.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
