"""Contributions to the width: the share lost when an input is fixed (Figs. 34, 35)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import chosen
from alphacut.fuzzy.result import Bounds
from alphacut.fuzzy.sets.boxes import fuzzy_inputs
from alphacut.fuzzy.sets.numbers import Crisp, FuzzyNumber


@dataclass(frozen=True, eq=False)
class Shares:
    """Effect of each input, or group of inputs, on the width of a fuzzy result.

    Args:
        names: Inputs or groups.
        width: Width with all inputs fuzzy, shape (…, outputs).
        lost: Width lost when one is fixed, shape (names, …, outputs). What is lost to all need not
            add up to the width: effects overlap.
    """

    names: tuple[str, ...]
    width: Array
    lost: Array

    @property
    def share(self) -> Array:
        """Width lost over width, shape (names, …, outputs); 0 where there is no width.

        A negative share says that the bounds are wrong by that much at least: a narrower input
        cannot widen the true answer.
        """
        share: Array = np.zeros_like(self.lost)
        return np.divide(self.lost, self.width, out=share, where=self.width > 0)


def width_shares(
    propagation: Callable[[Mapping[str, FuzzyNumber]], Bounds | tuple[Array, Array]],
    inputs: Mapping[str, FuzzyNumber | float],
    *,
    groups: Mapping[str, Sequence[str]] | None = None,
) -> Shares:
    """Run a propagation with all inputs fuzzy and again with each fixed.

    Args:
        propagation: From fuzzy inputs to bounds, as `lambda inputs: propagate(function, inputs)`,
            or to lower and upper ends, two arrays of one shape (…, outputs).
        inputs: The fuzzy inputs.
        groups: Names of inputs that are fixed together, by the name of their group; each input by
            itself if not given.

    Raises:
        RefusedError: A group names no input.
    """
    numbers = fuzzy_inputs(inputs)
    members = groups or {name: (name,) for name in numbers}
    for name in (name for group in members.values() for name in group):
        chosen("input of a group", name, numbers)
    fixed = [{x: Crisp(numbers[x].modal) for x in group} for group in members.values()]
    runs = [propagation({**numbers, **crisp}) for crisp in ({}, *fixed)]
    ends = [(one.lower, one.upper) if isinstance(one, Bounds) else one for one in runs]
    whole, *narrower = (np.asarray(upper) - lower for lower, upper in ends)
    return Shares(tuple(members), whole, np.array([whole - width for width in narrower]))
