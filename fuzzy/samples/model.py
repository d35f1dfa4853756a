"""Model as a plan sees it: an evaluation of many points with named outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.sets.numbers import Array

Output = float | Sequence[float] | Mapping[str, ArrayLike] | ArrayLike
Layout = tuple[tuple[str, tuple[int, ...]], ...]


@dataclass(frozen=True, eq=False)
class Values:
    """Outputs at many points.

    Args:
        layout: Name and shape of each output, in column order; a number has the shape ().
        array: One row per point, one column per entry of every output, shape (n, columns).
    """

    layout: Layout
    array: Array

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Name of each column: `E`, or `s11[0]`, `s11[1]`, … for an output that is an array."""
        names: list[str] = []
        for name, shape in self.layout:
            names += [name + "".join(f"[{i}]" for i in index) for index in np.ndindex(shape)]
        return tuple(names)

    def output(self, name: str) -> Array:
        """One output at all points, shape (n, …).

        Raises:
            ValueError: There is no such output.
        """
        start = 0
        for other, shape in self.layout:
            size = prod(shape)
            if other == name:
                return self.array[:, start : start + size].reshape(-1, *shape)
            start += size
        raise ValueError(
            f"there is no output {name!r}; there are {', '.join(other for other, _ in self.layout)}"
        )

    def select(self, columns: Sequence[str]) -> Array:
        """The named columns, shape (n, len(columns)).

        Raises:
            ValueError: There is no such column.
        """
        return self.array[:, [self.column(name) for name in columns]]

    def column(self, name: str) -> int:
        """Index of a column.

        Raises:
            ValueError: There is no such column.
        """
        if name not in self._places:
            raise ValueError(f"there is no output {name}; there are {', '.join(self.columns)}")
        return self._places[name]

    @cached_property
    def _places(self) -> dict[str, int]:
        return {name: column for column, name in enumerate(self.columns)}


class Model(Protocol):
    """A model as plans call it."""

    @property
    def known(self) -> Known:
        """Facts that the caller knows about the model."""

    def __call__(self, points: Array) -> Values:
        """Outputs at the points, shape (n, inputs)."""

    def report(self, share: float, *, last: bool = False) -> None:
        """Report the completed fraction, 0 … 1; `last` fills the rest."""


def flatten(output: Output) -> tuple[Layout, Array]:
    """One sample's outputs as a layout and a row of numbers.

    Args:
        output: A number (named `y`), an array (`y[0]`, …) or a mapping of names to numbers or
            arrays.

    Raises:
        ValueError: There is no number, one that is not finite, or two of the same name.
    """
    if output is None:
        raise ValueError("the function returned None, no real number: is its return missing?")
    named = output if isinstance(output, Mapping) else _labelled(output)
    arrays = {str(name): _numbers(str(name), value) for name, value in named.items()}
    if not sum(array.size for array in arrays.values()):
        raise ValueError("the function returned no number; it must return one at least")
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise ValueError(
                f"output {name!r} is {array.ravel()[~np.isfinite(array.ravel())][0]}; every output"
                " must be a finite number"
            )
    layout = tuple((name, array.shape) for name, array in arrays.items())
    if any("[" in name for name in arrays) or len(arrays) < len(named):
        _require_distinct(layout, named)
    return layout, np.concatenate([array.ravel() for array in arrays.values()])


def _labelled(output: object) -> Mapping[str, ArrayLike]:
    """Outputs by the labels of a pandas object; by the name y where there are none."""
    labels = getattr(output, "columns" if hasattr(output, "columns") else "index", None)
    if not type(output).__module__.startswith("pandas") or labels is None:
        return {"y": output}  # type: ignore[dict-item]
    named = all(isinstance(label, str) for label in labels)
    return {label: output[label] for label in labels} if named else {"y": output}  # type: ignore


def _numbers(name: str, value: ArrayLike) -> Array:
    """Real numbers of an output.

    Raises:
        ValueError: Text, dates, complex numbers, numbers with a unit, or values that are masked.
    """
    if isinstance(value, Mapping):
        raise ValueError(f"output {name!r} is a mapping; outputs have one level of names")
    if hasattr(value, "magnitude") and hasattr(value, "units"):
        raise ValueError(
            f"output {name!r} has the unit {value.units}; return a real number, as"
            " output.to(unit).magnitude"
        )
    array = np.asanyarray(value)
    masked = isinstance(array, np.ma.MaskedArray) and bool(np.any(array.mask))
    if masked or array.dtype.kind not in "biufO":
        kind = "masked" if masked else f"of the type {array.dtype}"
        raise ValueError(f"output {name!r} is {kind}; every output must be a real number")
    return np.asarray(array, float)


def _require_distinct(layout: Layout, given: Mapping[str, ArrayLike]) -> None:
    """Refuse two names of a mapping that mean one output, such as `a[0]`."""
    columns = Values(layout, np.zeros((0, 0))).columns
    spelt = [str(name) for name in given]
    twice = [
        name for name in (*columns, *spelt) if columns.count(name) > 1 or spelt.count(name) > 1
    ]
    if twice:
        raise ValueError(f"two outputs are named {twice[0]!r}; each needs a name of its own")


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

    @property
    def known(self) -> Known:
        """Facts that the caller knows about the model."""
        return self._model.known

    def report(self, share: float, *, last: bool = False) -> None:
        """Tell the share done, 0 … 1."""
        self._model.report(share, last=last)

    @property
    def points(self) -> Array:
        """All samples so far in the order of their first use, shape (n, inputs)."""
        return np.array(self._points)

    @property
    def values(self) -> Values:
        """Outputs at `points`."""
        return Values(self._layout, np.array(self._rows))

    def __len__(self) -> int:
        return len(self._rows)

    def __call__(self, points: Array) -> Values:
        """Outputs at the points, shape (n, inputs)."""
        keys = [point.tobytes() for point in points]
        fresh = {key: row for row, key in enumerate(keys) if key not in self._index}
        if fresh:
            new = points[list(fresh.values())]
            values = self._model(new)
            self._layout = values.layout
            self._index.update({key: len(self._rows) + row for row, key in enumerate(fresh)})
            self._points += [new[row] for row in range(len(new))]
            self._rows += [values.array[row] for row in range(len(new))]
        return Values(self._layout, np.array([self._rows[self._index[key]] for key in keys]))
