"""Proved bounds of linear programs whose variables all lie between finite ends.

Any multipliers y give a lower bound of the least cᵀx over A x <= b, l <= x <= u: that of yᵀb +
(c − Aᵀy)ᵀx over the box alone. The solver's own multipliers make it sharp, and its tolerances do
not matter (Neumaier and Shcherbina, Mathematical Programming 99, 2004).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array, hstack

from alphacut.fuzzy.arrays import Array

ROUND_OFF = 1e-13
"""Share of the sums' sizes by which bounds are widened for rounding."""


@dataclass(frozen=True, eq=False)
class LinearProgram:
    """A x <= b with l <= x <= u.

    Args:
        rows: A, shape (r, v), sparse.
        right: b, shape (r,).
        lower: l, shape (v,), finite.
        upper: u, shape (v,), finite.
    """

    rows: csr_array
    right: Array
    lower: Array
    upper: Array

    def least(self, objective: Array) -> float:
        """Proved lower bound of cᵀx over the set; infinite where the set is proved empty."""
        ends = np.column_stack([self.lower, self.upper])
        result = linprog(objective, A_ub=self.rows, b_ub=self.right, bounds=ends, method="highs")
        if result.status == 2 and self.empty():
            return np.inf
        multipliers = np.zeros(len(self.right))  # which leave the bound over the box
        if result.status == 0:
            multipliers = np.minimum(result.ineqlin.marginals, 0.0)
        return self._proved(objective, multipliers)

    def empty(self) -> bool:
        """True if it is proved that no point fulfils all rows."""
        size = self.rows.shape[0]
        relaxed = LinearProgram(
            csr_array(hstack([self.rows, csr_array(-np.ones((size, 1)))])),
            self.right,
            np.append(self.lower, 0.0),
            np.append(self.upper, 1e3),
        )
        cost = np.append(np.zeros(len(self.lower)), 1.0)
        return relaxed.least(cost) > 0

    def _proved(self, objective: Array, multipliers: Array) -> float:
        rest = objective - self.rows.T @ multipliers
        ends = np.where(rest > 0, rest * self.lower, rest * self.upper)
        reach = np.maximum(np.abs(self.lower), np.abs(self.upper))
        size = np.abs(multipliers) @ np.abs(self.right) + np.abs(objective) @ reach
        size += (abs(self.rows).T @ np.abs(multipliers)) @ reach
        return float(multipliers @ self.right + ends.sum() - ROUND_OFF * size)
