"""The boxes P_α of the uncertain parameters, and trajectories over the unit box."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.calculus.numbers import require_numbers
from alphacut.frame.dynamics.flow import Flow
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arguments import fuzzy_inputs

ALPHA = (0.0, 0.25, 0.5, 0.75, 1.0)


class Kept(Protocol):
    """Keeps arrays by name, for one search and no other."""

    def load(self, name: str) -> Mapping[str, Array] | None:
        """What was saved under a name; None if nothing was."""

    def save(self, name: str, found: Mapping[str, Array]) -> None:
        """Keep arrays under a name, in place of what it had."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """Nested boxes, one per level, in physical and in unit coordinates.

    The unit coordinate of a parameter runs over [−1, 1] on its widest cut: p = centre + radius u.

    Args:
        names: Parameters, d of them.
        alpha: Levels, rising, shape (A,).
        lower: Lower ends, shape (A, d), in SI units.
        upper: Upper ends, shape (A, d).
        modal: Values of membership 1, shape (d,).

    Raises:
        ValueError: No parameter, or a level outside [0, 1], or levels not rising.
    """

    names: tuple[str, ...]
    alpha: Array
    lower: Array
    upper: Array
    modal: Array

    def __post_init__(self) -> None:
        if not self.names:
            raise ValueError("no uncertain parameter: name at least one")
        if (
            not len(self.alpha)
            or self.alpha.min() < 0
            or self.alpha.max() > 1
            or (np.diff(self.alpha) <= 0).any()
        ):
            raise ValueError(f"alpha: {[float(a) for a in self.alpha]} must rise within [0, 1]")

    def distinct(self) -> tuple[Boxes, Array]:
        """The boxes without those that repeat the one below, and which of them each level has.

        Intervals have the same cut at every level, which need be searched once.
        """
        both = np.concatenate([self.lower, self.upper], 1)
        new = np.append(True, (np.diff(both, axis=0) != 0).any(1))
        kept = replace(self, alpha=self.alpha[new], lower=self.lower[new], upper=self.upper[new])
        return kept, np.cumsum(new) - 1

    @property
    def centre(self) -> Array:
        """Middle of the widest box, shape (d,)."""
        return np.asarray((self.lower[0] + self.upper[0]) / 2)

    @property
    def radius(self) -> Array:
        """Half widths of the widest box, shape (d,)."""
        return np.asarray((self.upper[0] - self.lower[0]) / 2)

    def to_unit(self, points: Array) -> Array:
        """Unit coordinates of physical points (…, d); a parameter without width is at 0."""
        return np.asarray((points - self.centre) / np.where(self.radius > 0, self.radius, 1.0))

    def to_physical(self, unit: Array) -> Array:
        """Physical points of unit coordinates (…, d), never outside the widest box."""
        return np.asarray(np.clip(self.centre + self.radius * unit, self.lower[0], self.upper[0]))

    def in_unit(self, jet: Jet, *, anew: bool = True) -> Jet:
        """Derivatives by the unit coordinates from those by the physical parameters.

        Args:
            jet: The latter.
            anew: Whether its arrays stay as they are.
        """
        shape, r = (1,) * jet.value.ndim, self.radius
        return Jet(
            jet.value,
            np.multiply(jet.first, r.reshape(-1, *shape), out=None if anew else jet.first),
            np.multiply(
                jet.second,
                (r[:, None] * r).reshape(len(r), len(r), *shape),
                out=None if anew else jet.second,
            ),
        )

    def unit(self, level: int) -> tuple[Array, Array]:
        """Lower and upper ends of a level in unit coordinates."""
        return self.to_unit(self.lower[level]), self.to_unit(self.upper[level])


def boxes(inputs: Mapping[str, FuzzyNumber | float], alpha: Sequence[float] = ALPHA) -> Boxes:
    """The α-cuts of `inputs` as boxes.

    Args:
        inputs: Fuzzy numbers by name, in SI units; a plain number is a crisp one.
        alpha: Levels, rising within [0, 1].

    Raises:
        ValueError: An input is no number, or as `Boxes`.
    """
    levels = _levels(alpha)
    numbers = fuzzy_inputs(inputs)
    cuts = np.array(
        [[number.cut(a) for number in numbers.values()] for a in levels], float
    ).reshape(len(levels), len(numbers), 2)
    modal = np.array([number.modal for number in numbers.values()])
    return Boxes(tuple(numbers), levels, cuts[..., 0], cuts[..., 1], modal)


def _levels(alpha: Sequence[float]) -> Array:
    require_numbers("alpha", alpha, "[0, 1]")
    levels = np.asarray(alpha, float)
    if not len(levels) or levels.min() < 0 or levels.max() > 1 or (np.diff(levels) <= 0).any():
        raise ValueError(f"alpha: {levels.tolist()} must rise within [0, 1]")
    return levels


@dataclass(frozen=True, eq=False)
class UnitFlow:
    """A flow in unit coordinates.

    Args:
        flow: The flow in physical parameters.
        boxes: The boxes; its names must be those of `flow`.
        relative: Whether tolerances are shares of each output's modal peak instead of lengths.
        kept: Keeps parts of a search of modal intervening variables; None for nothing.
        called: Names of the outputs where they stand in for others; the flow's own if none.
    """

    flow: Flow
    boxes: Boxes
    relative: bool = False
    kept: Kept | None = None
    called: tuple[str, ...] = ()

    @property
    def time(self) -> Array:
        """Nodes, shape (T,), in s."""
        return self.flow.time

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.called or self.flow.outputs

    @property
    def reference(self) -> int:
        """Index of the output that a tolerance is meant for: the first displacement, else 0."""
        return next(
            (index for index, name in enumerate(self.outputs) if Output(name).unit == "m"), 0
        )

    def told(self, value: float) -> str:
        """An error or gap in words, with the unit of a tolerance."""
        unit = "of each peak" if self.relative else Output(self.outputs[self.reference]).unit
        return f"{value:.3g} {unit}"

    @cached_property
    def scale(self) -> Array:
        """Factor on a tolerance for each output, shape (m,).

        Relative: the modal peaks. Else 1 when all outputs share a unit, or their modal peaks by
            that of `reference`.
        """
        if not self.relative and len({Output(name).unit for name in self.outputs}) == 1:
            return np.ones(len(self.outputs))
        peak = np.abs(self.flow.values(self.boxes.modal[None])[0]).max(0)
        shares: Array = np.where(peak > 0, peak, peak.max() or 1.0) / (
            1.0 if self.relative else peak[self.reference] or 1.0
        )
        return shares

    def values(self, unit: Array) -> Array:
        """Trajectories at unit coordinates (S, d), shape (S, T, outputs)."""
        return self.flow.values(self.boxes.to_physical(unit))

    def taylor(self, unit: Array) -> Jet:
        """Trajectories with derivatives by the unit coordinates, V = (S, T, outputs)."""
        return self.boxes.in_unit(self.flow.taylor(self.boxes.to_physical(unit)), anew=False)
