"""Calls of a user's function in the workers, and their named outputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, RefusedError, require, require_choice

Function = Callable[..., object]
Layout = tuple[tuple[str, tuple[int, ...]], ...]
"""Name and shape of each output, in column order; a number has the shape ()."""


@dataclass(frozen=True, eq=False)
class Values:
    """Outputs at many points.

    Args:
        layout: Name and shape of each output, in column order.
        array: One row a point, one column an entry of every output, shape (n, columns).
    """

    layout: Layout
    array: Array

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Name of each column: `E`, or `s11[0]`, `s11[1]`, … of an output that is an array."""
        names = []
        for name, shape in self.layout:
            for index in np.ndindex(shape):
                suffix = "".join(f"[{i}]" for i in index)
                names.append(name + suffix)
        return tuple(names)

    def output(self, name: str) -> Array:
        """Return the values of an output at all points, shape (n, *shape of the output)."""
        require_choice("output", name, dict(self.layout))
        first = 0
        for found, shape in self.layout:
            if found == name:
                break
            first += prod(shape)
        return self.array[:, first : first + prod(shape)].reshape(-1, *shape)

    def column(self, name: str) -> int:
        """Return the index of a column."""
        require_choice("output", name, self.columns)
        return self.columns.index(name)


@dataclass(frozen=True, eq=False)
class Samples:
    """Points (n, inputs) at which a model was evaluated, and its outputs there."""

    points: Array
    values: Values


class SpentError(FailedError):
    """The next evaluations would pass the budget; none of them is run."""


class CampaignError(FailedError):
    """Some samples of a campaign failed.

    Args:
        failures: Inputs of each failed sample by name, and the text of its error.
        total: Number of samples of the campaign.
        cure: What the user can do.
    """

    max_quoted = 3  # failed samples in the message
    max_letters = 300  # letters of each of their errors

    def __init__(self, failures: list[tuple[dict[str, float], str]], total: int, cure: str) -> None:
        self.failures = failures
        self.total = total
        quoted = []
        for point, error in failures[: self.max_quoted]:
            first_line = error.strip().partition("\n")[0]
            if len(first_line) > self.max_letters:
                first_line = f"{first_line[: self.max_letters]} …"
            values = ", ".join(f"{name} = {value:.6g}" for name, value in point.items())
            quoted.append(f"at {values}: {first_line}")
        if len(failures) > self.max_quoted:
            quoted.append(f"and {len(failures) - self.max_quoted} more")
        successes = "the others are done: " if len(failures) < total else ""
        what = f"{len(failures)} of {total} samples failed, {successes}"
        super().__init__(what + "; ".join(quoted), cure)


class Sample(NamedTuple):
    """Outputs at one point."""

    layout: Layout
    row: Array


class Failure(NamedTuple):
    """Error message of a point without outputs."""

    error: str


Outcome = Sample | Failure


@dataclass(frozen=True)
class Call:
    """A function of named inputs, called point by point, in groups, or with arrays.

    Args:
        function: See `shared` and `vectorised`; without either it gets the inputs of one point by
            name.
        names: Names of the inputs, in column order.
        shared: Inputs whose equality lets points share work: the function gets a list of points
            (mappings of names to numbers) that agree in them, and returns a list of outputs.
        vectorised: The function gets arrays by name, shape (n,), and returns arrays whose first
            axis is n.

    Raises:
        RefusedError: It cannot be called, it is both shared and vectorised, or a shared name is no
            input.
    """

    function: Function
    names: tuple[str, ...]
    shared: tuple[str, ...] = ()
    vectorised: bool = False

    def __post_init__(self) -> None:
        is_callable = callable(self.function)
        require(is_callable, "function", value=repr(self.function), allowed="what can be called")
        is_allowed = not (self.shared and self.vectorised)
        allowed = "none where the function is vectorised"
        require(is_allowed, "shared", value=self.shared, allowed=allowed)
        for name in self.shared:
            require_choice("shared input", name, self.names)

    def tasks(self, points: Array) -> Iterator[list[int]]:
        """Yield the rows of the points (n, inputs) that are evaluated by one call of the function.

        Points are grouped by equal shared inputs, or in batches for a vectorised function; else
        each point is a call.
        """
        if self.shared:
            columns = [self.names.index(name) for name in self.shared]
            groups: dict[bytes, list[int]] = {}
            # Equal inputs have equal bits, so the bytes serve as the key.
            for row in range(len(points)):
                groups.setdefault(points[row, columns].tobytes(), []).append(row)
            yield from groups.values()
            return
        # With 1,024 points the call itself costs little, and arrays still fit into the cache.
        size = 1024 if self.vectorised else 1
        for start in range(0, len(points), size):
            yield list(range(start, min(start + size, len(points))))

    def __call__(self, points: Array) -> list[Outcome]:
        """Return the sample or the failure at each of the points (n, inputs) of one call.

        If the call fails, each point is evaluated by a call of its own.
        """
        try:
            outputs = self._outputs(points)
            expected = len(points)
            is_complete = len(outputs) == expected
            require(is_complete, "outputs", value=len(outputs), allowed=f"{expected}")
        except (Exception, SystemExit) as error:  # a model that ends its program ends its sample
            if len(points) > 1:
                # One bad point must not take the others of its batch with it.
                return [self(point[None])[0] for point in points]
            return [Failure(f"{type(error).__name__}: {error}")]
        return [_outcome(output) for output in outputs]

    def _outputs(self, points: Array) -> Sequence[Any]:
        """Call the function, and return its unchecked outputs at each of the points (n, inputs)."""
        if self.vectorised:
            outputs = _named(self.function(**dict(zip(self.names, points.T, strict=True))))
            arrays = {x: np.atleast_1d(np.asarray(value, float)) for x, value in outputs.items()}
            rows = zip(*arrays.values(), strict=True)
            return [dict(zip(arrays, row, strict=True)) for row in rows]
        points_by_name = [named_point(self.names, point) for point in points]
        if self.shared:
            return cast(Sequence[Any], self.function(points_by_name))
        return [self.function(**point) for point in points_by_name]


def named_point(names: Sequence[str], point: Array) -> dict[str, float]:
    """Return the inputs of one point, shape (inputs,), by name, as Python numbers."""
    return {name: float(value) for name, value in zip(names, point, strict=True)}


def _named(outputs: Any) -> Mapping[Any, Any]:
    """Return outputs by name; a number or an array has the name "y"."""
    return outputs if isinstance(outputs, Mapping) else {"y": outputs}


def _outcome(output: Any) -> Outcome:
    """Return the sample of an output of the function, or a failure if it is not allowed.

    Args:
        output: A number (`y`), an array (`y[0]`, …), a mapping of names to numbers and arrays, or
            the exception that ended the call.
    """
    try:
        if isinstance(output, Exception):
            raise output
        named = _named(output).items()
        arrays = {str(name): _finite_array(str(name), value) for name, value in named}
        layout = tuple((name, array.shape) for name, array in arrays.items())
        # An array "a" and a number "a[0]" would have one name.
        columns = Values(layout, np.zeros((0, 0))).columns
        are_distinct = bool(columns) and len(set(columns)) == len(columns)
        allowed = "one number or more, all of different names"
        require(are_distinct, "outputs", value=columns, allowed=allowed)
    except Exception as error:
        return Failure(f"{type(error).__name__}: {error}")
    return Sample(layout, np.concatenate([array.ravel() for array in arrays.values()]))


def _finite_array(name: str, value: ArrayLike | None) -> Array:
    """Return an output as an array; refuse what is no plain array of finite real numbers."""
    # A masked entry has no value, and an array with a unit loses it on conversion: both would pass
    # as plain numbers.
    array = np.ma.asanyarray(value)  # type: ignore[no-untyped-call]
    is_plain = array.dtype.kind in "biuf" and not np.ma.is_masked(array)  # type: ignore[no-untyped-call]
    is_allowed = is_plain and not hasattr(value, "units") and np.isfinite(array).all()
    if not is_allowed:  # not by `require`: the text of an array takes longer than all else here
        shown = " ".join(repr(value).split())[:80]
        allowed = "finite real numbers; of one with a unit its magnitude in the unit you want"
        raise RefusedError(f"output {name}", shown, allowed)
    return np.asarray(array, float)
