"""Outputs at single nodes from eigen-analyses at each point, with exact gradients.

No polynomial stands between the inputs and these values; polynomials only give the curvature.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alphacut.frame.calculus.polynomial import Polynomial, fit
from alphacut.frame.modal.fitting import analyse, fit_points
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.response.load_tables import LoadTables
from alphacut.frame.structures.linear import frequencies
from alphacut.frame.structures.modes import Modes
from alphacut.fuzzy.arrays import Array, Rows

PIECE = 4000
"""Points times inputs treated together; more would leave the cache."""


@dataclass(frozen=True, eq=False)
class ExactResponse:
    """Stands for a modal model, without the error of its polynomials.

    Args:
        model: Polynomials of the same structure, in the units wanted.
        scale: What the outputs are divided by, shape (m,).
        loads: Tables of all modes' answers to the loads, and what these add at once.
        has_hessian: Whether the polynomials are good enough for second derivatives; else these are
            zero, and Newton's method learns them from gradients.
    """

    model: ModalModel
    scale: Array
    loads: tuple[LoadTables, ...]
    has_hessian: bool = True
    secant: ClassVar[bool] = True

    @classmethod
    def from_model(
        cls, model: ModalModel, scale: Array, *, has_hessian: bool = True
    ) -> ExactResponse:
        """Exact response of the structure of `model`, outputs divided by `scale` (m,).

        Loads are tabulated for all modes, those that the model leaves out too.

        Raises:
            ModalError: Under a load, a mode does not oscillate.
        """
        flow, boxes, loads = model.flow, model.boxes, model.loads
        if loads and len(model.chosen) < len(frequencies(flow.system)):
            points = fit_points(len(boxes.names), 2)
            rate = fit(points, analyse(flow, boxes, points).eigenvalue, 2)
            zero = Polynomial(rate.index, np.zeros_like(rate.coefficients))
            loads = tuple(replace(load, rate=rate, share=zero) for load in loads)
        return cls(model.in_units(scale), scale, loads, has_hessian)

    @property
    def time(self) -> Array:
        """Nodes, shape (T,), in s."""
        return self.model.time

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.model.outputs

    def value_at(self, unit: Array, node: Rows, output: Rows) -> Array:
        """Values (N,) of one output at one node for each of N points, unit coordinates (N, d)."""
        return self._values_and_gradients(unit, node, output, 0)[0]

    def at(self, unit: Array, node: Rows, output: Rows) -> tuple[Array, Array, Array]:
        """One output at one node for each of N points, unit coordinates (N, d), with derivatives.

        Returns:
            Exact values (N,) and gradients (N, d); Hessians (N, d, d) of the polynomials, zero
            without `has_hessian`.
        """
        f, g = self._values_and_gradients(unit, node, output, 1)
        if self.has_hessian:
            return f, g, self.model.at(unit, node, output)[2]
        return f, g, np.zeros((*unit.shape, unit.shape[1]))

    def _values_and_gradients(
        self, unit: Array, node: Rows, output: Rows, order: int
    ) -> tuple[Array, Array]:
        """Values (N,) of one output at one node for each of N points, and gradients (N, d).

        Gradients are undefined where `order`, 0 or 1, is 0.
        """
        f, g = np.empty(len(unit)), np.empty(unit.shape)
        for rows, points, indices in point_chunks(unit):
            modes = analyse(self.model.flow, self.model.boxes, points, order=order)
            f[rows], slope = self._at_modes(modes, indices, node[rows], output[rows])
            if order:
                g[rows] = slope
        return f, g

    def _at_modes(
        self, modes: Modes, indices: Rows, node: Rows, output: Rows
    ) -> tuple[Array, Array]:
        """Outputs 2 Re Σ C_k w(t; λ_k), over modes k, free motion and loads, with gradients.

        Args:
            modes: Modes with first derivatives at the distinct points.
            indices: Which of these each of N points is, shape (N,).
            node: Time node of each, shape (N,).
            output: Index of the output of each, shape (N,).

        Returns:
            Values (N,) and gradients (N, d), divided by the outputs' scale.
        """
        rate, slope = modes.eigenvalue.value[indices], modes.eigenvalue.first[:, indices]
        t, scale = self.time[node][:, None], self.scale[output]
        wave = np.exp(rate * t)
        parts = [(modes.coefficient, wave, t * wave)]
        for coefficient, load in zip(modes.loads, self.loads, strict=True):
            parts.append((coefficient, *load.response(rate, node)[:2]))
        f, g = np.zeros(len(indices)), np.zeros((len(slope), len(indices)))
        for C, w, dw in parts:
            value, first = C.value[indices, :, output], C.first[:, indices, :, output]
            f += 2 * (value * w).real.sum(-1)
            g += 2 * (np.moveaxis(first, 1, 0) * w + value * dw * slope).real.sum(-1)
        return f / scale, (g / scale).T


def point_chunks(unit: Array) -> Iterator[tuple[Rows, Array, Rows]]:
    """Chunks of points (N, d), equal ones together, for one eigen-analysis of each distinct point.

    Yields:
        Rows of a chunk in `unit`, (n,), its distinct points, (k, d), and the index of the distinct
        point of each row, (n,).
    """
    order = np.lexsort(unit.T)  # equal points side by side
    size = max(64, PIECE // unit.shape[1])
    for start in range(0, len(unit), size):
        rows = order[start : start + size]
        points = unit[rows]
        is_distinct = np.append(True, (points[1:] != points[:-1]).any(1))
        yield rows, points[is_distinct], np.cumsum(is_distinct) - 1
