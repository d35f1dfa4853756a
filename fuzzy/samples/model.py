"""Model as a plan sees it: an evaluation of many points with named outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.knowledge.known import Known
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
        chosen("output", name, (other for other, _ in self.layout))
        start = 0
        for other, shape in self.layout:
            size = prod(shape)
            if other == name:
                break
            start += size
        return self.array[:, start : start + size].reshape(-1, *shape)

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


class Model(Protocol):
    """A model as plans call it."""

    @property
    def known(self) -> Known:
        """Facts that the caller knows about the model."""

    @property
    def left(self) -> int:
        """Evaluations that the budget still allows."""

    def __call__(self, points: Array) -> Values:
        """Outputs at the points, shape (n, inputs).

        Raises:
            SpentError: They would pass the budget.
        """

    def report(self, share: float) -> None:
        """Report the completed fraction, 0 … 1."""


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


class Memo:
    """Wraps a model and keeps every sample.

    Args:
        model: The model to call at points not seen before.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._index: dict[bytes, int] = {}
        self._points: list[Array] = []
        self._rows: list[Array] = []
        self._layout: Layout = ()
        self._samples: Samples | None = None

    @property
    def known(self) -> Known:
        """Facts that the caller knows about the model."""
        return self._model.known

    @property
    def left(self) -> int:
        """Evaluations that the budget still allows."""
        return self._model.left

    def report(self, share: float) -> None:
        """Tell the share done, 0 … 1."""
        self._model.report(share)

    @property
    def samples(self) -> Samples:
        """All samples so far in the order of their first use."""
        if self._samples is None:
            values = Values(self._layout, np.array(self._rows))
            self._samples = Samples(np.array(self._points), values)
        return self._samples

    def __len__(self) -> int:
        return len(self._rows)

    def __call__(self, points: Array) -> Values:
        """Outputs at the points, shape (n, inputs)."""
        keys = [point.tobytes() for point in points]
        fresh = {key: row for row, key in enumerate(keys) if key not in self._index}
        if fresh:
            new = points[list(fresh.values())]
            values, self._samples = self._model(new), None
            self._layout = values.layout
            self._index |= {key: len(self._rows) + row for row, key in enumerate(fresh)}
            self._points += list(new)
            self._rows += list(values.array)
        return Values(self._layout, np.array([self._rows[self._index[key]] for key in keys]))
