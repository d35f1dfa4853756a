"""The fuzzy inputs cut at every level: the nested boxes over which a model is searched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fuzzy.numbers import Array, FuzzyNumber


def levels(steps: int) -> tuple[float, ...]:
    """The α-levels 0, 1/steps, …, 1: `steps` = 4 gives the paper's five.

    Raises:
        ValueError: `steps` is below 1.
    """
    if steps < 1:
        raise ValueError(f"the number of steps between α-levels is {steps}; it must be 1 or more")
    return tuple(step / steps for step in range(steps + 1))


@dataclass(frozen=True)
class Domain:
    """Nested boxes of the inputs, one per α-level.

    Args:
        inputs: Name of each input and its fuzzy number, in the order of the columns of every array of points.
        alpha: Levels, rising within [0, 1].

    Raises:
        ValueError: There is no input, or the levels are none, do not rise, or leave [0, 1].
    """

    inputs: Mapping[str, FuzzyNumber]
    alpha: Sequence[float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "inputs", dict(self.inputs))
        object.__setattr__(self, "alpha", tuple(float(level) for level in self.alpha))
        if not self.inputs:
            raise ValueError("there is no fuzzy input; name one at least")
        rising = all(np.diff(self.alpha) > 0) and len(self.alpha) > 0
        if not (rising and self.alpha[0] >= 0 and self.alpha[-1] <= 1):
            raise ValueError(f"the α-levels are {list(self.alpha)}; they must rise within [0, 1]")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the inputs in column order."""
        return tuple(self.inputs)

    @property
    def boxes(self) -> tuple[Array, Array]:
        """Lower and upper corners of the boxes, two arrays of shape (levels, inputs)."""
        cuts = np.array([[number.cut(level) for number in self.inputs.values()] for level in self.alpha])
        return cuts[..., 0], cuts[..., 1]
