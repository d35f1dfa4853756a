"""Fuzzy field: many parameters that are alike but not equal, correlated by their distance.

Values at places z are centre + half width · Σ_k √λ_k φ_k(z) ξ_k with the largest eigenvalues λ_k of
the correlation exp(−|z − z'| / length), as in a Karhunen–Loève expansion; the directions ξ lie in a
ball. All directions together leave each place its own interval; few of them leave out a part that
is told. For methods that know boxes alone the directions may vary freely, `free_shapes`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alphacut.fuzzy.sets.interaction import Ellipsoidal
from alphacut.fuzzy.sets.numbers import Array, FuzzyNumber, Triangular


@dataclass(frozen=True)
class FuzzyField:
    """Values of one kind at several places.

    Args:
        name: The kind: its directions are called NAME_1, NAME_2, …
        places: Where the values stand, such as heights of storeys in m.
        centre: Value of membership 1.
        half_width: Half width of each value's support.
        length: Distance over which values are alike: their correlation falls to 1/e.
        share: Part of the field's variance that the directions must hold, in (0, 1].

    Raises:
        ValueError: A number is out of range.
    """

    name: str
    places: Sequence[float]
    centre: float
    half_width: float
    length: float
    share: float = 0.95

    def __post_init__(self) -> None:
        numbers = [*self.places, self.centre, self.half_width, self.length, self.share]
        if not len(self.places) or not np.isfinite(numbers).all():
            raise ValueError(
                f"field {self.name}: its places and numbers must be finite, one place at least"
            )
        if not (self.half_width >= 0 and self.length > 0 and 0 < self.share <= 1):
            raise ValueError(
                f"field {self.name}: half width {self.half_width:g}, length {self.length:g}, share"
                f" {self.share:g}; they must be 0 or greater, positive, and in (0, 1]"
            )

    @cached_property
    def shapes(self) -> Array:
        """Part of each direction in each place, shape (places, directions)."""
        z = np.asarray(self.places, float)
        correlation = np.exp(-np.abs(z[:, None] - z) / self.length)
        values, vectors = np.linalg.eigh(correlation)
        values, vectors = np.maximum(values[::-1], 0.0), vectors[:, ::-1]
        held = np.cumsum(values) / values.sum()
        count = int(np.searchsorted(held, self.share * (1 - 1e-12))) + 1
        return np.asarray(vectors[:, :count] * np.sqrt(values[:count]))

    @property
    def left_out(self) -> float:
        """Largest share of a place's half width that the directions do not reach."""
        return float(1 - np.minimum(np.linalg.norm(self.shapes, axis=1), 1.0).min())

    @property
    def free_shapes(self) -> Array:
        """Parts of directions that vary freely within [-1, 1], shape (places, directions).

        Each place's parts are scaled to a sum of 1: it reaches its own interval and no more.
        """
        return np.asarray(self.shapes / np.abs(self.shapes).sum(1, keepdims=True))

    @property
    def apart(self) -> float:
        """Largest difference of two neighbouring places whose directions vary freely."""
        steps = np.abs(np.diff(self.free_shapes, axis=0)).sum(1)
        return self.half_width * float(steps.max(initial=0.0))

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """The directions as fuzzy numbers."""
        return {name: Triangular(-1.0, 0.0, 1.0) for name in self.names}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the directions."""
        return tuple(f"{self.name}_{k + 1}" for k in range(self.shapes.shape[1]))

    @property
    def interaction(self) -> Ellipsoidal:
        """The ball in which the directions lie on each level, for `propagate`."""
        return Ellipsoidal(among=self.names)

    def values(self, **directions: float | Array) -> list[float | Array]:
        """Values at the places from the directions, each a number or an array (n,)."""
        along = [directions[name] for name in self.names]
        return [
            self.centre
            + self.half_width * sum(float(p) * x for p, x in zip(row, along, strict=True))
            for row in self.shapes
        ]
