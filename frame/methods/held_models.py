"""Taylor models of the trajectories that attain bounds, at their nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet

Models = tuple[Array, Array, Array]
"""Values (K,), first derivatives (K, d) and second derivatives (K, d, d)."""


@dataclass(frozen=True, eq=False)
class HeldModels:
    """Model of the trajectory that holds the bound of each place (node, output, side).

    Args:
        parts: Values (T, m, 2), and derivatives by d parameters behind.
    """

    parts: Models

    @classmethod
    def empty(cls, shape: tuple[int, ...], d: int) -> HeldModels:
        """Room for models at places (T, m, 2) with derivatives by d parameters."""
        value, first, second = map(np.zeros, (shape, (*shape, d), (*shape, d, d)))
        return cls((value, first, second))

    def keep(self, jet: Jet, holder: Array) -> None:
        """Take in the models of trajectories that have become the holders of places.

        Args:
            jet: Trajectories, V = (S, T, m).
            holder: Which of them holds a place now, shape (T, m, 2); −1 for none.
        """
        places = np.nonzero(holder >= 0)
        models = models_at(jet, (holder[places], *places[:2]))
        for part, model in zip(self.parts, models, strict=True):
            part[places] = model

    def models(self, places: tuple[Array, ...]) -> Models:
        """Models of the holders of places (node, output, side)."""
        value, first, second = self.parts
        return value[places], first[places], second[places]


def models_at(jet: Jet, where: tuple[Array, ...]) -> Models:
    """Models of trajectories at (trajectory, node, output), K of each."""
    first, second = np.moveaxis(jet.first, 0, -1), np.moveaxis(jet.second, (0, 1), (-2, -1))
    return jet.value[where], first[where], second[where]
