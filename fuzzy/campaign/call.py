"""Calls of a user's function in the workers, and their named outputs."""

from __future__ import annotations

import sys
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
        """Name of each column of `array`, which has one column for each entry of each output.

        `layout` has the pairs (name, shape) of the outputs in column order. An output E of shape ()
        is the column "E"; an output s of shape (2, 2) is the columns "s[0][0]", "s[0][1]",
        "s[1][0]" and "s[1][1]", the last index running first.
        """
        names = []
        for name, shape in self.layout:
            for index in np.ndindex(shape):
                suffix = "".join(f"[{i}]" for i in index)
                names.append(name + suffix)
        return tuple(names)

    def output(self, name: str) -> Array:
        """Return the values of an output at all n points, shape (n, *shape of the output).

        It is a view of `array`, which has a row for each point; the columns of the output lie side
        by side there, in the order of the pairs (name, shape) of `layout`.

        Args:
            name: Name of the whole output, such as "s11", not of one of its entries.

        Raises:
            RefusedError: No output has this name.
        """
        require_choice("output", name, dict(self.layout))
        first = 0
        for found, shape in self.layout:
            if found == name:
                break
            first += prod(shape)
        return self.array[:, first : first + prod(shape)].reshape(-1, *shape)

    def column(self, name: str) -> int:
        """Return the index of a column, by a name of `columns`; RefusedError for another name."""
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
    """Outputs at one point: name and shape of each, and all their entries, shape (columns,)."""

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
        """Check the fields.

        Raises:
            RefusedError: `function` cannot be called, `shared` names inputs although the function
                is `vectorised`, or `shared` has a name that is not among the inputs `names`.
        """
        is_callable = callable(self.function)
        require(is_callable, "function", value=repr(self.function), allowed="what can be called")
        is_allowed = not (self.shared and self.vectorised)
        allowed = "none where the function is vectorised"
        require(is_allowed, "shared", value=self.shared, allowed=allowed)
        for name in self.shared:
            require_choice("shared input", name, self.names)

    def tasks(self, points: Array) -> Iterator[list[int]]:
        """Yield, for each call of the function, the rows of the points that it evaluates.

        Each row occurs once. With `shared` inputs a call gets all points that agree in these;
        groups come in the order of their first rows, and rows rise within a group. A `vectorised`
        function gets 1,024 neighbouring rows at a time, any other function one row.

        Args:
            points: One column for each of the inputs `names`, shape (n, inputs). Without a point
                there is no call.
        """
        if self.shared:
            columns = [self.names.index(name) for name in self.shared]
            groups: dict[bytes, list[int]] = {}
            # The bytes of the shared inputs are the key. Campaigns pass no -0.0, which has other
            # bytes than 0.0. Inputs that differ by rounding cost a further call, but no accuracy.
            for row in range(len(points)):
                groups.setdefault(points[row, columns].tobytes(), []).append(row)
            yield from groups.values()
            return
        # With 1,024 points the call itself costs little, and arrays still fit into the cache.
        size = 1024 if self.vectorised else 1
        for start in range(0, len(points), size):
            yield list(range(start, min(start + size, len(points))))

    def __call__(self, points: Array) -> list[Outcome]:
        """Evaluate some points by one call of the function.

        If a call for several points raises an exception, or returns another number of outputs, each
        point is evaluated again by a call of its own, so that one bad point fails alone.

        Args:
            points: One or more points that belong into one call by `tasks`, one column for each of
                the inputs `names`, shape (n, inputs).

        Returns:
            For each point, in order, a `Sample` (names, shapes and values of the outputs), or a
            `Failure` with the text of the error. Exceptions and SystemExit of the function become
            failures; KeyboardInterrupt is raised.
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
        """Call the function, and return its unchecked outputs, one item for each point.

        - A `vectorised` function is called once, with an array of shape (n,) for each input. Item k
          has entry k of each output, by the name of the output.
        - A function with `shared` inputs is called once, with a list of n mappings of input names
          to numbers. Its return value is returned.
        - Any other function is called n times, with a number for each input. An item is the return
          value of one call: a number, an array, or a mapping of names to these.

        Whether there are n items is not checked.

        Args:
            points: One column for each of the inputs `names`, shape (n, inputs).

        Raises:
            ValueError: Arrays of a vectorised function have different lengths, or hold no numbers.
            Exception: Whatever the function raises.
        """
        if self.vectorised:
            # Several outputs are split by points here, since a sample holds the outputs of one.
            outputs = _by_output_name(self.function(**dict(zip(self.names, points.T, strict=True))))
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


def _by_output_name(outputs: object) -> Mapping[Any, Any]:
    """Return outputs by name; a number or an array has the name "y"."""
    return outputs if isinstance(outputs, Mapping) else {"y": outputs}


def _outcome(output: object) -> Outcome:
    """Return what a function returned for one point as a sample, or as a failure if unusable.

    Args:
        output: A number or an array, which gets the name "y"; a mapping of names to numbers and
            arrays; or an exception, which a function of several points may return in place of the
            outputs of a point.

    Returns:
        `Sample` with the pairs (name, shape) of the outputs in their order, and all entries of all
        outputs in one array, shape (columns,). `Failure` with the type and the text of the error
        if `output` is an exception, a value is not a finite real number, an output has no entry or
        there is no output, or two columns have one name. Nothing is raised.
    """
    try:
        if isinstance(output, Exception):
            raise output
        # Outputs by name; a number or an array alone has the name "y".
        named = _by_output_name(output).items()
        arrays = {str(name): _finite_array(str(name), value) for name, value in named}
        layout = tuple((name, array.shape) for name, array in arrays.items())
        # Names of all entries: an array "a" and a number "a[0]" would have one name.
        columns = Values(layout, np.zeros((0, 0))).columns
        are_distinct = bool(columns) and len(set(columns)) == len(columns)
        allowed = "one number or more, all of different names"
        require(are_distinct, "outputs", value=columns, allowed=allowed)
    except Exception as error:
        return Failure(f"{type(error).__name__}: {error}")
    return Sample(layout, np.concatenate([array.ravel() for array in arrays.values()]))


def _finite_array(name: str, value: ArrayLike | None) -> Array:
    """Return an output as an array of floats, of shape () for a number.

    Truth values become 0 and 1.

    Raises:
        RefusedError: A value is complex, no number (a text, None, another object), not finite or
            masked; `value` is an empty list or array; or it has a unit (an attribute `units`).
        ValueError: Nested lists have different lengths.
    """
    # A masked entry has no value, and an array with a unit loses it on conversion: both would pass
    # as plain numbers.
    array = np.asanyarray(value)
    is_masked = False
    if "numpy.ma" in sys.modules:  # which takes time to import, and without which nothing is masked
        array = np.ma.asanyarray(value)  # type: ignore[no-untyped-call]
        is_masked = np.ma.is_masked(array)  # type: ignore[no-untyped-call]
    # `all` of a masked array without entries is masked, which counts as False below.
    is_plain = array.dtype.kind in "biuf" and not is_masked
    is_allowed = is_plain and not hasattr(value, "units") and np.isfinite(array).all()
    if not is_allowed:  # not by `require`: the text of an array takes longer than all else here
        shown = " ".join(repr(value).split())[:80]
        allowed = "finite real numbers; of one with a unit its magnitude in the unit you want"
        raise RefusedError(f"output {name}", shown, allowed)
    return np.asarray(array, float)
