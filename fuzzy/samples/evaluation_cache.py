"""A model that remembers: plans that look before they leap never run a point twice."""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.samples.model import Layout, Model, Values
from alphacut.fuzzy.sets.numbers import Array


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
