"""Interaction between fuzzy inputs: constraints on the box of their cuts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import checked_number, require
from alphacut.fuzzy.sets.numbers import FuzzyNumber


class Interaction(Protocol):
    """A constraint between the inputs that it names: fulfilled where `slack` is not negative."""

    @property
    def names(self) -> Sequence[str]:
        """The inputs that it touches."""

    def slack(self, points: Array, inputs: Mapping[str, FuzzyNumber], alpha: float) -> Array:
        """Distance to the constraint at points (n, inputs), shape (n,); it does not rise with α."""


@dataclass(frozen=True)
class Linear:
    """Σ weights · inputs ≤ bound, on every level.

    Args:
        weights: Weight of each input by name; inputs not named do not matter.
        bound: The bound.

    Raises:
        RefusedError: A weight or the bound is not finite.

    Example:
        >>> from alphacut.fuzzy import Interval, Optimisation, propagate
        >>> inputs, half = {"x": Interval(0, 1), "y": Interval(0, 1)}, [Linear({"x": 1, "y": 1}, 1)]
        >>> options = {"alpha": [0], "interactions": half}
        >>> area = propagate(lambda x, y: x * y, inputs, Optimisation(), **options)
        >>> area.upper.round(6).item()
        0.25
    """

    weights: Mapping[str, float]
    bound: float

    def __post_init__(self) -> None:
        for name, weight in self.weights.items():
            checked_number(f"weight of {name}", weight)
        checked_number("bound of the weighted sum", self.bound)

    @property
    def names(self) -> tuple[str, ...]:
        """The inputs that have a weight."""
        return tuple(self.weights)

    def slack(self, points: Array, inputs: Mapping[str, FuzzyNumber], alpha: float) -> Array:
        """Bound − Σ weights · inputs, shape (n,), as a share of its largest possible sum."""
        weights = np.array([self.weights.get(name, 0.0) for name in inputs])
        largest = np.array([np.abs(number.support).max() for number in inputs.values()])
        size = abs(self.bound) + float(np.abs(weights) @ largest)
        return np.asarray((self.bound - points @ weights) / max(size, np.finfo(float).tiny))


@dataclass(frozen=True)
class Ellipsoidal:
    """Ellipsoid in each cut: tᵀ R⁻¹ t ≤ (1 − α)², with signed distances t_i = ±(1 − μ_i).

    With R = 1 the grades of membership add up like lengths instead of each counting alone; off its
    diagonal R says which inputs tend to be high or low together. The ellipsoid touches the faces of
    the box, so the range of each input alone stays what it was; inputs that it does not name keep
    their whole cuts.

    Args:
        correlation: Entry of R for pairs of inputs, inside (−1, 1); 0 for other pairs of them.

    Raises:
        RefusedError: No two inputs are named, a correlation is out of range, or correlations
            contradict each other.

    Example:
        >>> from alphacut.fuzzy import Optimisation, Triangular, propagate
        >>> inputs = {name: Triangular(-1, 0, 1) for name in ("x", "y")}
        >>> options = {"alpha": [0], "interactions": [Ellipsoidal({("x", "y"): 0.5})]}
        >>> sum_ = propagate(lambda x, y: x + y, inputs, Optimisation(), **options)
        >>> sum_.upper.round(4).item()
        1.7321
    """

    correlation: Mapping[tuple[str, str], float]

    def __post_init__(self) -> None:
        for pair, value in self.correlation.items():
            checked_number(f"correlation of {' and '.join(pair)}", value, least=-1, most=1)
        definite = len(self.names) > 1 and np.linalg.eigvalsh(self._matrix).min() > 0
        allowed = "pairs of inputs with values that agree: their matrix is positive definite"
        require(definite, "correlation", value=dict(self.correlation), allowed=allowed)

    @property
    def names(self) -> tuple[str, ...]:
        """The inputs that interact, each once."""
        return tuple(dict.fromkeys(name for pair in self.correlation for name in pair))

    def slack(self, points: Array, inputs: Mapping[str, FuzzyNumber], alpha: float) -> Array:
        """(1 − α)² − tᵀ R⁻¹ t, shape (n,)."""
        columns = {name: points[:, list(inputs).index(name)] for name in self.names}
        t = np.stack([_signed_distance(inputs[name], x) for name, x in columns.items()], axis=1)
        size: Array = np.einsum("ni,ij,nj->n", t, np.linalg.inv(self._matrix), t)
        return (1 - alpha) ** 2 - size

    @property
    def _matrix(self) -> Array:
        """R, in the order of `names`."""
        matrix = np.eye(len(self.names))
        for (first, second), value in self.correlation.items():
            i, j = self.names.index(first), self.names.index(second)
            matrix[i, j] = matrix[j, i] = value
        return matrix


def _signed_distance(number: FuzzyNumber, x: Array) -> Array:
    """Return ±(1 − μ) at x: negative below the modal value, beyond ±1 outside the support."""
    lower, upper = number.support
    outside = np.maximum(np.maximum(lower - x, x - upper), 0)
    outside = outside / max(upper - lower, np.finfo(float).tiny)
    distance: Array = np.where(x < number.modal, -1.0, 1.0) * (1 - number.membership(x) + outside)
    return distance


def first_allowed_point(point: Array, anchor: Array, slack: Callable[[Array], Array]) -> Array:
    """First allowed point (inputs,) on the straight line from `point` to `anchor`.

    401 points of the line are tried, in steps that grow from 1e-15 of its length.

    Args:
        point: Start of the line, shape (inputs,).
        anchor: An allowed point, shape (inputs,), which is the last one tried.
        slack: Slack of the interactions at points (n, inputs), shape (n,); ≥ 0 where allowed.
    """
    fractions = np.concatenate([[0.0], np.geomspace(1e-15, 1, 400)])[:, None]
    line: Array = point + fractions * (anchor - point)
    line[-1] = anchor
    return np.asarray(line[np.argmax(slack(line) >= 0)])
