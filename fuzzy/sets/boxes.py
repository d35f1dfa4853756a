"""The fuzzy inputs cut at every level: the nested boxes over which a model is searched."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.sets.claimed import from_level
from alphacut.fuzzy.sets.given import is_real
from alphacut.fuzzy.sets.interaction import Interaction
from alphacut.fuzzy.sets.numbers import Array, FuzzyNumber, Mask

_ROUND_OFF = 1e-12  # of the support: points this close to a cut lie in it

_STRAIGHT = 1e-9  # of the lowest cut: corners this close to a line lie on it

MOST_LEVELS = 10_000


def levels(steps: int) -> tuple[float, ...]:
    """The α-levels 0, 1/steps, …, 1: `steps` = 4 gives the paper's five.

    Raises:
        ValueError: `steps` is no whole number from 1 to 10,000.
    """
    if not (isinstance(steps, int) and is_real(steps) and 1 <= steps <= MOST_LEVELS):
        raise ValueError(
            f"the number of steps between α-levels is {steps}; it must be a whole number from 1 to"
            f" {MOST_LEVELS:,}"
        )
    return tuple(step / steps for step in range(steps + 1))


def _levels(alpha: Sequence[float]) -> tuple[float, ...]:
    given = [] if isinstance(alpha, str) or not isinstance(alpha, Iterable) else list(alpha)
    if not given or not all(map(is_real, given)):
        raise ValueError(
            f"the α-levels are {alpha!r}; they must be a sequence of numbers that rise within"
            " [0, 1]"
        )
    return tuple(map(float, given))


def _straight(number: FuzzyNumber, alpha: Sequence[float]) -> bool:
    """Whether a number's corners between the first and the last level lie on straight lines."""
    between = [level for level in number.cuts.alpha if alpha[0] < level < alpha[-1]]
    ends = np.array([number.cut(level) for level in alpha])
    lines = np.array([np.interp(between, alpha, ends[:, side]) for side in (0, 1)]).T
    corners = np.array([number.cut(level) for level in between]).reshape(-1, 2)
    return bool((np.abs(corners - lines) <= _STRAIGHT * np.ptp(ends[0])).all())


@dataclass(frozen=True)
class Domain:
    """Nested boxes of the inputs, one per α-level.

    Args:
        inputs: Name of each input and its fuzzy number, in the order of the columns of every array
            of points.
        alpha: Levels, rising within [0, 1].
        interactions: Constraints between the inputs.

    Raises:
        ValueError: There is no input, the levels are none, do not rise, or leave [0, 1], or an
            interaction names no input.
    """

    inputs: Mapping[str, FuzzyNumber]
    alpha: Sequence[float]
    interactions: Sequence[Interaction] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "inputs", dict(self.inputs))
        object.__setattr__(self, "alpha", _levels(self.alpha))
        if not self.inputs:
            raise ValueError("there is no fuzzy input; name one at least")
        rising = all(np.diff(self.alpha) > 0) and len(self.alpha) > 0
        if not (rising and self.alpha[0] >= 0 and self.alpha[-1] <= 1):
            raise ValueError(f"the α-levels are {list(self.alpha)}; they must rise within [0, 1]")
        decided = {name: from_level(number, self.alpha[0]) for name, number in self.inputs.items()}
        object.__setattr__(self, "inputs", decided)
        object.__setattr__(self, "interactions", tuple(self.interactions))
        for interaction in self.interactions:
            interaction.check(self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the inputs in column order."""
        return tuple(self.inputs)

    @property
    def boxes(self) -> tuple[Array, Array]:
        """Lower and upper corners of the boxes, two arrays of shape (levels, inputs)."""
        cuts = np.array(
            [[number.cut(level) for number in self.inputs.values()] for level in self.alpha]
        )
        return cuts[..., 0], cuts[..., 1]

    @property
    def exact(self) -> list[bool]:
        """Whether at each level no input's cut is wider than it is told."""
        numbers = self.inputs.values()
        return [all(one.known(level) == level for one in numbers) for level in self.alpha]

    @property
    def linear(self) -> bool:
        """Whether the ends of every input's cut go straight from each level to the next."""
        return all(_straight(number, self.alpha) for number in self.inputs.values())

    @property
    def modal(self) -> Array:
        """Modal point of the inputs, shape (inputs,)."""
        return np.array([number.modal for number in self.inputs.values()], float)

    def inside(self, points: Array) -> Mask:
        """Mask of points, shape (n, inputs), in the cut of each level, shape (levels, n)."""
        lower, upper = self.boxes
        slack = _ROUND_OFF * (upper[0] - lower[0])
        boxes = ((points >= (lower - slack)[:, None]) & (points <= (upper + slack)[:, None])).all(
            axis=2
        )
        allowed: Mask = boxes & np.array(
            [self.slack(points, level) >= -_ROUND_OFF for level in self.alpha]
        )
        return allowed

    def slack(self, points: Array, alpha: float) -> Array:
        """Least room that the interactions leave at points (n, inputs), shape (n,)."""
        rooms = [interaction.slack(points, self.inputs, alpha) for interaction in self.interactions]
        return np.asarray(np.min([np.full(len(points), np.inf), *rooms], axis=0))

    def require_free(self, plan: str) -> None:
        """Refuse interactions, which the named plan cannot respect.

        Raises:
            ValueError: There are interactions.
        """
        if self.interactions:
            kinds = ", ".join(type(interaction).__name__ for interaction in self.interactions)
            cure = "take MonteCarlo, QuasiMonteCarlo, Optimisation or Chebyshev"
            raise ValueError(
                f"the {plan} plan cannot respect interactions between inputs (here: {kinds});"
                f" {cure}"
            )
