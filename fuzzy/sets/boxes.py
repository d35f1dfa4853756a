"""The fuzzy inputs cut at every level: the nested boxes over which a model is searched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import checked_number, require
from alphacut.fuzzy.sets.claimed import ClaimedNumber
from alphacut.fuzzy.sets.numbers import Crisp, FuzzyNumber, checked_levels


def levels(steps: int) -> tuple[float, ...]:
    """Return the equally spaced α-levels 0, 1/steps, …, 1; `steps` = 4 gives the paper's five.

    Raises:
        RefusedError: `steps` is not a positive whole number.

    Example:
        >>> levels(4)
        (0.0, 0.25, 0.5, 0.75, 1.0)
    """
    checked_number("steps between levels", steps, positive=True, whole=True)
    return tuple(step / steps for step in range(steps + 1))


def quasi_random_points(dimension: int, count: int, *, skip: int = 0) -> Array:
    """Return points of the unit box [0, 1)^d that fill it evenly, shape (count, dimension).

    More points continue the same sequence: x_k = 1/2 + k s mod 1, the additive recurrence of
    Roberts (2018), with s_j = g^(−j) and g the positive root of g^(d + 1) = g + 1.

    Args:
        dimension: d, 1 or more.
        count: Number of points.
        skip: Points of the sequence that are left out at its beginning.
    """
    root = 2.0
    for _ in range(64):  # the fixed-point iteration g = (1 + g)^(1/(d + 1)) converges to g
        root = (1 + root) ** (1 / (dimension + 1))
    step = root ** -np.arange(1.0, dimension + 1)
    # The multiples of irrational steps, taken modulo 1, never repeat, and leave no large gap.
    k = np.arange(skip + 1, skip + count + 1)[:, None]
    return np.asarray((0.5 + k * step) % 1.0)


def chebyshev_points(dimension: int, count: int, *, skip: int = 0) -> Array:
    """Return points of [−1, 1]^d whose density grows towards its faces, shape (count, dimension).

    Each coordinate is −cos(π x) for a coordinate x of `quasi_random_points`, which fill the unit
    box evenly. So it has the Chebyshev density; `skip` points of the sequence are left out.
    """
    return np.asarray(-np.cos(np.pi * quasi_random_points(dimension, count, skip=skip)))


def corners(lower: Array, upper: Array) -> Array:
    """Return all corners of a box in d dimensions, the last coordinate changing fastest.

    Args:
        lower: Lower ends of the box, shape (d,).
        upper: Upper ends, shape (d,); equal to the lower end on an axis without width.

    Returns:
        Corners of shape (2^w, d), where w axes have a width, beginning with `lower`.
    """
    # The keys of a dictionary keep their order, and equal ends become one.
    axes = [dict.fromkeys(pair) for pair in zip(lower, upper, strict=True)]
    return np.array(list(product(*axes)))


def fuzzy_inputs(inputs: Mapping[str, FuzzyNumber | float]) -> dict[str, FuzzyNumber]:
    """Return the inputs as fuzzy numbers by name, in a new mapping of the same order.

    Args:
        inputs: One or more fuzzy numbers by name; a plain number becomes a `Crisp`.

    Raises:
        RefusedError: `inputs` is no mapping with texts as keys, it is empty, or a value is neither
            a fuzzy number nor a finite number.
    """
    is_named = isinstance(inputs, Mapping) and inputs and all(isinstance(x, str) for x in inputs)
    allowed = "a mapping, as {'E': Triangular(24, 25, 26)}"
    require(bool(is_named), "inputs", value=inputs, allowed=allowed)
    numbers: dict[str, FuzzyNumber] = {}
    for name, value in inputs.items():
        if isinstance(value, FuzzyNumber):
            numbers[name] = value
        else:
            numbers[name] = Crisp(checked_number(f"input {name}", value))
    return numbers


@dataclass(frozen=True)
class Domain:
    """Nested boxes of the inputs, one per α-level.

    Args:
        inputs: Name of each input and its fuzzy number, in the order of the columns of every array
            of points.
        alpha: Levels, rising within [0, 1].

    Raises:
        RefusedError: There is no input or level, the levels do not rise within [0, 1], or values do
            not decide the cuts of a number.
    """

    inputs: Mapping[str, FuzzyNumber]
    alpha: Sequence[float]

    def __post_init__(self) -> None:
        """Check the fields, and replace them: levels by a tuple, plain numbers by `Crisp`.

        A claimed number (of measured values) has a level `decided`, below which its values do not
        decide the cut. If no level here lies below it, the number is replaced by a copy whose
        `decided` is 0. Its cuts are the same, and can be asked for at all levels.

        Raises:
            RefusedError: There is no input or level, the levels do not rise within [0, 1], an input
                is neither a fuzzy nor a finite number, or values do not decide the cut of a claimed
                number at the lowest level.
        """
        alpha = checked_levels(self.alpha)
        inputs = fuzzy_inputs(self.inputs)
        for name, number in inputs.items():
            if isinstance(number, ClaimedNumber):
                # The cut of the lowest level is the widest: if the values decide it, they decide
                # all.
                number.cut(alpha[0])  # raises where the values do not decide the cut
                # Methods ask for the support as a length scale, also where no level is 0.
                inputs[name] = replace(number, decided=0.0)
        object.__setattr__(self, "alpha", alpha)
        object.__setattr__(self, "inputs", inputs)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the inputs in column order."""
        return tuple(self.inputs)

    @property
    def boxes(self) -> tuple[Array, Array]:
        """Lower and upper corners of the boxes, two arrays of shape (levels, inputs)."""
        pairs = product(self.alpha, self.inputs.values())
        cuts = np.array([number.cut(alpha) for alpha, number in pairs])
        cuts = cuts.reshape(len(self.alpha), len(self.inputs), 2)
        return cuts[..., 0], cuts[..., 1]

    @property
    def nominal(self) -> Array:
        """Nominal point of the inputs, shape (inputs,)."""
        return np.array([number.nominal for number in self.inputs.values()], float)

    def inside(self, points: Array) -> Mask:
        """Return which points lie in the box of each level, shape (levels, n).

        The box of a level consists of the α-cuts of all inputs, with its faces. A point may lie
        outside by rounding, up to 1e-12 of the width of an input's cut at the lowest level.

        Args:
            points: One column for each input, in the order of the field `inputs`, shape
                (n, inputs).
        """
        lower, upper = self.boxes
        tolerance = 1e-12 * (upper[0] - lower[0])
        # A corner that is computed as lower + 1 · width misses the upper end by rounding.
        # All boxes and points at once: the arrays have the shape (levels, points, inputs).
        above = (points >= (lower - tolerance)[:, None]).all(axis=2)
        below = (points <= (upper + tolerance)[:, None]).all(axis=2)
        return np.asarray(above & below)
