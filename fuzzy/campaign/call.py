"""Calls of a user's function, in the workers: points, points that share a set-up, arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.campaign.values import Layout, flatten
from alphacut.fuzzy.refused import chosen, require

Function = Callable[..., object]
_BATCH = 1024  # points per call of a vectorised function


class Sample(NamedTuple):
    """Outputs at one point."""

    layout: Layout
    row: Array


class Failure(NamedTuple):
    """Why a point has no outputs."""

    error: str


Outcome = Sample | Failure


@dataclass(frozen=True)
class Call:
    """A function of named inputs with the way it is called.

    Args:
        function: See `shared` and `vectorised`; without either it gets the inputs of one point by
            name.
        names: Names of the inputs, in column order.
        shared: Inputs whose equality lets points share work: the function gets a list of points
            (mappings of names to numbers) that agree in them, and returns a list of outputs.
        vectorised: The function gets arrays by name, shape (n,), and returns arrays whose first
            axis is n.

    Raises:
        RefusedError: It cannot be called, both ways are asked for, or a shared name is no input.
    """

    function: Function
    names: tuple[str, ...]
    shared: tuple[str, ...] = ()
    vectorised: bool = False

    def __post_init__(self) -> None:
        shown = repr(self.function)
        require(callable(self.function), "function", shown, "what can be called")
        one = not (self.shared and self.vectorised)
        require(one, "shared", self.shared, "none where the function is vectorised")
        for name in self.shared:
            chosen("shared input", name, self.names)

    def tasks(self, points: Array) -> Iterator[list[int]]:
        """Rows of the points that go into one call each; the same whatever the workers."""
        if self.shared:
            columns = [self.names.index(name) for name in self.shared]
            groups: dict[bytes, list[int]] = {}
            for row in range(len(points)):
                groups.setdefault(points[row, columns].tobytes(), []).append(row)
            yield from groups.values()
            return
        size = _BATCH if self.vectorised else 1
        for start in range(0, len(points), size):
            yield list(range(start, min(start + size, len(points))))

    def __call__(self, points: Array) -> list[Outcome]:
        """Outputs of one task; if it fails as a whole, each point is tried alone."""
        try:
            outputs = self._outputs(points)
            require(len(outputs) == len(points), "outputs", len(outputs), f"{len(points)}")
        except (Exception, SystemExit) as error:  # a model that ends its program ends its sample
            if len(points) > 1:
                return [self(point[None])[0] for point in points]
            return [Failure(f"{type(error).__name__}: {error}")]
        return [_outcome(output) for output in outputs]

    def _outputs(self, points: Array) -> Sequence[Any]:
        if self.vectorised:
            return self._split(points)
        named = [named_point(self.names, point) for point in points]
        if self.shared:
            return cast(Sequence[Any], self.function(named))
        return [self.function(**point) for point in named]

    def _split(self, points: Array) -> Sequence[Any]:
        """Outputs of a vectorised function, point by point."""
        outputs = self.function(**dict(zip(self.names, points.T, strict=True)))
        named = outputs if isinstance(outputs, Mapping) else {"y": outputs}
        arrays = {name: np.atleast_1d(np.asarray(value, float)) for name, value in named.items()}
        for name, array in arrays.items():
            allowed = f"arrays of the length {len(points)}, that of the points"
            require(len(array) == len(points), f"output {name}", len(array), allowed)
        return [{name: array[row] for name, array in arrays.items()} for row in range(len(points))]


def named_point(names: Sequence[str], point: Array) -> dict[str, float]:
    """The inputs of one point by name, as Python numbers."""
    return {name: float(value) for name, value in zip(names, point, strict=True)}


def _outcome(output: Any) -> Outcome:
    if isinstance(output, Exception):
        return Failure(f"{type(output).__name__}: {output}")
    try:
        return Sample(*flatten(output))
    except (TypeError, ValueError) as error:
        return Failure(f"{type(error).__name__}: {error}")
