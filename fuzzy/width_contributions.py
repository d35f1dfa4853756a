"""Contributions to the width: the share lost when an input is fixed (Figs. 34, 35)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.sets.numbers import Array, Crisp, FuzzyNumber

Bounds = Callable[[Mapping[str, FuzzyNumber]], tuple[Array, Array]]


@dataclass(frozen=True)
class Shares:
    """Effect of each input, or group of inputs, on the width of a fuzzy result.

    Args:
        names: Inputs or groups.
        width: Width with all inputs fuzzy, shape (…).
        lost: Width lost when one is fixed, shape (names, …). What is lost to all need not add up to
            the width: effects overlap.
    """

    names: tuple[str, ...]
    width: Array
    lost: Array

    @property
    def share(self) -> Array:
        """Width lost over width, shape (names, …); 0 where there is no width."""
        share: Array = np.divide(
            self.lost, self.width, out=np.zeros_like(self.lost), where=self.width > 0
        )
        return share


def width_shares(
    bounds: Bounds,
    inputs: Mapping[str, FuzzyNumber],
    *,
    groups: Mapping[str, Sequence[str]] | None = None,
) -> Shares:
    """Run a propagation with all inputs fuzzy and again with each fixed.

    Args:
        bounds: The propagation: from fuzzy inputs to lower and upper ends, two arrays of any one
            shape (levels, times, outputs).
        inputs: The fuzzy inputs.
        groups: Names of inputs that are fixed together, by the name of their group; each input by
            itself if not given.

    Raises:
        ValueError: A group names no input.
    """
    chosen = (
        {name: tuple(members) for name, members in groups.items()}
        if groups
        else {name: (name,) for name in inputs}
    )
    unknown = sorted({member for members in chosen.values() for member in members} - set(inputs))
    if unknown:
        raise ValueError(
            f"the groups name {', '.join(unknown)}; the fuzzy inputs are {', '.join(inputs)}"
        )

    def width(fuzzy: Mapping[str, FuzzyNumber]) -> Array:
        lower, upper = bounds(fuzzy)
        difference: Array = np.asarray(upper, float) - np.asarray(lower, float)
        return difference

    whole = width(inputs)
    fixed = [
        {**inputs, **{member: Crisp(inputs[member].modal) for member in members}}
        for members in chosen.values()
    ]
    return Shares(tuple(chosen), whole, np.array([whole - width(kept) for kept in fixed]))
