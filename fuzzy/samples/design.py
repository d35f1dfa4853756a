"""A design: the samples of every α-level, and the retransformation of their values into α-cuts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.samples.model import Values
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.numbers import Array, Mask, Rows


@dataclass(frozen=True)
class Design:
    """Distinct samples, and which of them each level uses.

    Args:
        domain: Inputs and levels.
        points: Distinct samples, shape (n, inputs).
        levels: For each level, the rows of its samples.
    """

    domain: Domain
    points: Array
    levels: tuple[Rows, ...]

    @classmethod
    def from_levels(cls, domain: Domain, points: Sequence[Array]) -> Design:
        """Gather the points of each level, shape (n_level, inputs), listed once."""
        distinct, inverse = np.unique(np.concatenate(points), axis=0, return_inverse=True)
        ends = np.cumsum([len(rows) for rows in points])[:-1]
        return cls(domain, distinct, tuple(np.split(inverse.ravel(), ends)))

    @classmethod
    def from_samples(cls, domain: Domain, points: Array) -> Design:
        """Let every level use all points, shape (n, inputs), that lie in its cut."""
        rows = tuple(np.flatnonzero(inside) for inside in domain.inside(points))
        empty = [alpha for alpha, own in zip(domain.alpha, rows, strict=True) if not len(own)]
        if empty:
            raise ValueError(
                f"no sample lies in the cut at α = {empty[0]:g}: its interactions leave too little"
                " room, or none"
            )
        return cls(domain, points, rows)

    def bounds(self, values: Values, *, plan: str) -> FuzzyResult:
        """Retransformation: extremes of each level's samples and of every level above.

        Args:
            values: Outputs at `points`.
            plan: Name of the plan that made this design.
        """
        lowest, low_enforced = self._extremes(values.array)
        highest, high_enforced = self._extremes(-values.array)
        return FuzzyResult.attained(
            self.domain,
            self.points,
            values,
            lowest=lowest,
            highest=highest,
            enforced=low_enforced | high_enforced,
            plan=plan,
        )

    def _extremes(self, values: Array) -> tuple[Rows, Mask]:
        """Rows of the least values (levels, outputs), and places that own samples miss."""
        columns = np.arange(values.shape[1])
        best: list[Rows] = []
        enforced: list[Mask] = []
        for rows in reversed(self.levels):
            own = rows[values[rows].argmin(axis=0)]
            missed = (
                values[best[-1], columns] < values[own, columns]
                if best
                else np.zeros(len(columns), bool)
            )
            best.append(np.where(missed, best[-1], own) if best else own)
            enforced.append(missed)
        return np.array(best[::-1]), np.array(enforced[::-1])
