"""Calls of a user's function, in the workers: points, points that share a set-up, arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from alphacut.fuzzy.samples.model import Layout, flatten
from alphacut.fuzzy.sets.numbers import Array

Function = Callable[..., Any]
BATCH = 1024  # points per call of a vectorised function


class Sample(NamedTuple):
    """Outputs at one point, and the wall time that it took."""

    layout: Layout
    row: Array
    seconds: float = 0.0


class Failure(NamedTuple):
    """Why a point has no outputs, and the wall time that it took to find out."""

    error: str
    seconds: float = 0.0


Outcome = Sample | Failure


class LengthError(ValueError):
    """A vectorised function did not return one output for each point."""


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
        ValueError: Both ways are asked for, or a shared name is no input.
    """

    function: Function
    names: tuple[str, ...]
    shared: tuple[str, ...] = ()
    vectorised: bool = False

    def __post_init__(self) -> None:
        if self.shared and self.vectorised:
            raise ValueError(
                "shared and vectorised are both given; a function is called in one way: give one"
            )
        unknown = [name for name in self.shared if name not in self.names]
        if unknown:
            raise ValueError(
                f"the shared inputs name {', '.join(unknown)}; there are {', '.join(self.names)}"
            )

    def tasks(self, points: Array) -> Iterator[list[int]]:
        """Rows of the points that go into one call each; the same whatever the workers."""
        if self.shared:
            columns = [self.names.index(name) for name in self.shared]
            groups: dict[bytes, list[int]] = {}
            for row in range(len(points)):
                groups.setdefault(points[row, columns].tobytes(), []).append(row)
            yield from groups.values()
            return
        size = BATCH if self.vectorised else 1
        for start in range(0, len(points), size):
            yield list(range(start, min(start + size, len(points))))

    def __call__(self, points: Array) -> list[Outcome]:
        """Outputs of one task; if it fails as a whole, each point is tried alone."""
        start = perf_counter()
        try:
            outcomes = self._outcomes(points)
        except LengthError as error:
            outcomes = [Failure(f"ValueError: {error}")] * len(points)
        except (
            Exception,
            SystemExit,
        ) as error:  # a model that ends its program ends its sample only
            if len(points) > 1:
                return [self(point[None])[0] for point in points]
            outcomes = [Failure(f"{type(error).__name__}: {error}")]
        seconds = (perf_counter() - start) / len(points)
        return [outcome._replace(seconds=seconds) for outcome in outcomes]

    def _outcomes(self, points: Array) -> list[Outcome]:
        outputs = self._outputs(points)
        if len(outputs) != len(points):
            raise ValueError(
                f"the function returned {len(outputs)} outputs for {len(points)} points; it must"
                " return one for each"
            )
        return [_outcome(output) for output in outputs]

    def _outputs(self, points: Array) -> Sequence[Any]:
        if self.vectorised:
            return self._split(self._arrays(points), points)
        named = [named_point(self.names, point) for point in points]
        return self.function(named) if self.shared else [self.function(**point) for point in named]

    def _arrays(self, points: Array) -> dict[str, Array]:
        """Outputs of a vectorised function, by name."""
        outputs = self.function(**dict(zip(self.names, points.T, strict=True)))
        named = outputs if isinstance(outputs, Mapping) else {"": outputs}
        return {str(name): np.asarray(value, float) for name, value in named.items()}

    def _split(self, arrays: dict[str, Array], points: Array) -> Sequence[Any]:
        """Outputs of a vectorised function, point by point; lone numbers are constants."""
        n = len(points)
        if any(array.ndim == 0 for array in arrays.values()) and n > 1:
            single = [self._arrays(points[[row]]) for row in (0, -1)]
            for name, array in arrays.items():
                if array.ndim == 0 and all((one[name] == array).all() for one in single):
                    arrays[name] = np.broadcast_to(array, (n,))
        rows = {name: np.atleast_1d(array) for name, array in arrays.items()}
        for name, array in rows.items():
            if len(array) != n:
                what = (
                    f"output {name!r} of the vectorised function"
                    if name
                    else "what the vectorised function returned"
                )
                raise LengthError(
                    f"{what} has the length {len(array)} for {n} points; its first axis must be the"
                    " points"
                )
        return (
            list(rows[""])
            if list(rows) == [""]
            else [{name: array[row] for name, array in rows.items()} for row in range(n)]
        )


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
