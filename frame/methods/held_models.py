"""Taylor models of the trajectories that attain bounds, at their nodes and at those beside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet

Models = tuple[Array, Array, Array]
"""Values (K,), first derivatives (K, d) and second derivatives (K, d, d)."""


@dataclass(frozen=True, eq=False)
class HeldModels:
    """Kept parts of jets; of each place (node, output, side) for the one that holds its bound.

    Args:
        kept: By the number of nodes from a place: value (T, m, 2), and derivatives behind.
    """

    kept: dict[int, Models]

    @classmethod
    def empty(cls, shifts: tuple[int, ...], shape: tuple[int, ...], d: int) -> HeldModels:
        """Room for models `shifts` nodes from each place.

        Args:
            shifts: 0 is the place itself, 1 the next node, −1 the one before.
            shape: (T, m, 2).
            d: Number of parameters.
        """
        sizes = (shape, (*shape, d), (*shape, d, d))
        return cls({k: tuple(np.zeros(size) for size in sizes) for k in shifts})  # type: ignore[misc]

    def keep(self, jet: Jet, holder: Array) -> None:
        """Take in the models of trajectories that have become the holders of places.

        Args:
            jet: Trajectories, V = (S, T, m).
            holder: Which of them holds a place now, shape (T, m, 2); −1 for none.
        """
        t, o, side = np.unravel_index(np.flatnonzero(holder >= 0), holder.shape)
        for shift, parts in self.kept.items():
            near = np.clip(t + shift, 0, len(holder) - 1)
            for part, model in zip(
                parts, models_at(jet, (holder[t, o, side], near, o)), strict=True
            ):
                part[t, o, side] = model

    def models(self, shift: int, places: tuple[Array, ...]) -> Models:
        """Models of the holders of places (t, output, side), `shift` nodes from there."""
        value, first, second = (part[places] for part in self.kept[shift])
        return value, first, second


def models_at(jet: Jet, where: tuple[Array, ...]) -> Models:
    """Models of trajectories at (trajectory, node, output), K of each."""
    first, second = np.moveaxis(jet.first, 0, -1), np.moveaxis(jet.second, (0, 1), (-2, -1))
    return jet.value[where], first[where], second[where]
