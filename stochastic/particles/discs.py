"""Discs in a rectangle, periodic or seen through an open window."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True, eq=False)
class Discs:
    """Discs in the rectangle [0, width] × [0, height].

    Args:
        centres: shape (n, 2), in m, inside the rectangle.
        radii: shape (n,), in m, not negative.
        size: Width and height of the rectangle, shape (2,), in m.
        periodic: Whether the rectangle repeats itself in both directions; otherwise it is a window
            on a larger section.

    Raises:
        ValueError: A shape is wrong, a number is not finite, or a disc has a negative radius or
            lies outside the rectangle.
    """

    centres: Array
    radii: Array
    size: Array
    periodic: bool = True

    def __post_init__(self) -> None:
        for name, shape in (("centres", (-1, 2)), ("radii", (-1,)), ("size", (2,))):
            object.__setattr__(self, name, np.array(getattr(self, name), float).reshape(shape))
        if len(self.centres) != len(self.radii) or not len(self.radii):
            raise ValueError(
                f"got {len(self.centres)} centres and {len(self.radii)} radii; one radius for each"
                " of at least one centre"
            )
        if not (np.isfinite(self.size).all() and (self.size > 0).all()):
            raise ValueError(
                f"the rectangle is {self.size[0]:g} × {self.size[1]:g} m; both sides must be"
                " positive and finite"
            )
        finite = np.isfinite(self.centres).all(axis=1) & np.isfinite(self.radii)
        _refuse(~finite, "is not a finite number: x, y and r must all be given")
        _refuse(~(self.radii >= 0), "has a negative radius: radii must be positive")
        if self.periodic:
            wrapped = np.mod(self.centres, self.size)
            object.__setattr__(self, "centres", np.where(wrapped < self.size, wrapped, 0.0))
        else:
            outside = ((self.centres < 0) | (self.centres > self.size)).any(axis=1)
            _refuse(
                outside,
                f"has its centre outside the window of {self.size[0]:g} × {self.size[1]:g} m: move"
                " the window or drop the disc",
            )

    def __len__(self) -> int:
        return len(self.radii)

    @property
    def area(self) -> float:
        """Area of the rectangle, in m²."""
        return float(self.size.prod())

    @property
    def area_fraction(self) -> float:
        """Σ π r² over the area of the rectangle."""
        return float(np.pi * (self.radii**2).sum() / self.area)

    def separation(self, first: Array, second: Array) -> Array:
        """Vectors from centres `first` to the nearest images of `second`, shape (…, 2), in m."""
        apart = self.centres[second] - self.centres[first]
        return apart - self.size * np.round(apart / self.size) if self.periodic else apart


def _refuse(bad: Any, reason: str) -> None:
    if bad.any():
        raise ValueError(
            f"disc {int(np.argmax(bad))} (counted from 0; {int(bad.sum())} of its kind) {reason}"
        )
