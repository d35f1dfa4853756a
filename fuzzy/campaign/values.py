"""Named outputs of a model at many points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError, chosen, require

Output = float | Sequence[float] | Mapping[str, ArrayLike] | ArrayLike
Layout = tuple[tuple[str, tuple[int, ...]], ...]


@dataclass(frozen=True, eq=False)
class Values:
    """Outputs at many points.

    Args:
        layout: Name and shape of each output, in column order; a number has the shape ().
        array: One row a point, one column an entry of every output, shape (n, columns).
    """

    layout: Layout
    array: Array

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Name of each column: `E`, or `s11[0]`, `s11[1]`, … of an output that is an array."""
        return tuple(
            name + "".join(f"[{i}]" for i in index)
            for name, shape in self.layout
            for index in np.ndindex(shape)
        )

    def output(self, name: str) -> Array:
        """One output at all points, shape (n, …)."""
        names, shapes = zip(*self.layout, strict=True)
        chosen("output", name, names)
        ends = np.cumsum([prod(shape) for shape in shapes])[:-1]
        place = names.index(name)
        return np.split(self.array, ends, axis=1)[place].reshape(-1, *shapes[place])

    def column(self, name: str) -> int:
        """Index of a column."""
        chosen("output", name, self._places)
        return self._places[name]

    @cached_property
    def _places(self) -> dict[str, int]:
        return {name: column for column, name in enumerate(self.columns)}


@dataclass(frozen=True, eq=False)
class Samples:
    """Points at which a model was evaluated, and its outputs there.

    Args:
        points: Shape (n, inputs).
        values: Outputs at the points.
    """

    points: Array
    values: Values


class SpentError(FailedError):
    """The next evaluations would pass the budget; none of them is run."""


def flatten(output: Output) -> tuple[Layout, Array]:
    """One sample's outputs as a layout and a row of numbers.

    Args:
        output: A number (named `y`), an array (`y[0]`, …) or a mapping of names to either.

    Raises:
        RefusedError: There is no number, one that is not finite, or two of the same name.
    """
    named = output if isinstance(output, Mapping) else {"y": output}
    arrays = {str(name): _numbers(str(name), value) for name, value in named.items()}
    layout = tuple((name, array.shape) for name, array in arrays.items())
    columns = Values(layout, np.zeros((0, 0))).columns
    apart = bool(columns) and len(set(columns)) == len(columns)
    require(apart, "outputs", columns, "one number or more, each with a name of its own")
    return layout, np.concatenate([array.ravel() for array in arrays.values()])


def _numbers(name: str, value: ArrayLike | None) -> Array:
    """Finite real numbers of an output, which may have no unit and no mask."""
    array = np.ma.asanyarray(value)  # type: ignore[no-untyped-call]
    plain = array.dtype.kind in "biuf" and not np.ma.is_masked(array)  # type: ignore[no-untyped-call]
    real_numbers = plain and not hasattr(value, "units") and np.isfinite(array).all()
    shown = " ".join(repr(value).split())[:80]
    allowed = "finite real numbers; of one with a unit its magnitude in the unit you want"
    require(real_numbers, f"output {name}", shown, allowed)
    return np.asarray(array, float)
