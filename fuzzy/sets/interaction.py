"""Interaction between fuzzy inputs: constraints on their box."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from alphacut.fuzzy.sets.given import is_real
from alphacut.fuzzy.sets.numbers import Array, FuzzyNumber

_HALVINGS = 50


class Interaction(Protocol):
    """A constraint between inputs: fulfilled where `slack` is not negative."""

    def check(self, inputs: Sequence[str]) -> None:
        """Refuse names that are no input."""

    def slack(self, points: Array, inputs: Mapping[str, FuzzyNumber], alpha: float) -> Array:
        """Room at points (n, inputs) on a level, shape (n,); never falls with α."""


@dataclass(frozen=True)
class Linear:
    """Σ weights · inputs ≤ bound, on every level.

    Args:
        weights: Weight of each input by name; inputs not named do not matter.
        bound: The bound.

    Raises:
        ValueError: A weight or the bound is not finite.
    """

    weights: Mapping[str, float]
    bound: float

    def __post_init__(self) -> None:
        _require_weights(self.weights, self.bound)
        if not np.isfinite([*self.weights.values(), self.bound]).all():
            raise ValueError(
                f"the linear interaction has weights {dict(self.weights)} and bound {self.bound};"
                " all must be finite"
            )

    def check(self, inputs: Sequence[str]) -> None:
        """Refuse names that are no input.

        Raises:
            ValueError: As said.
        """
        _require_inputs("linear", self.weights, inputs)

    def slack(self, points: Array, inputs: Mapping[str, FuzzyNumber], alpha: float) -> Array:
        """Bound − Σ weights · inputs, shape (n,), as a share of its largest possible sum."""
        weights = np.array([self.weights.get(name, 0.0) for name in inputs])
        largest = np.array([np.abs(number.support).max() for number in inputs.values()])
        slack: Array = (self.bound - points @ weights) / max(
            abs(self.bound) + float(np.abs(weights) @ largest), np.finfo(float).tiny
        )
        return slack


@dataclass(frozen=True)
class Ellipsoidal:
    """Ellipsoid in each cut: tᵀ R⁻¹ t ≤ (1 − α)², with signed distances t_i = ±(1 − μ_i).

    With R = 1 the grades of membership add up like lengths instead of each counting alone; off its
    diagonal R says which inputs tend to be high or low together. The ellipsoid touches the faces of
    the box, so the range of each input alone stays what it was.

    Args:
        correlation: Entry of R for pairs of inputs, inside (−1, 1); 0 for pairs not named.
        among: Inputs that interact; all if none is named.

    Raises:
        ValueError: A correlation is out of range or belongs to an input that is not among those
            that interact.
    """

    correlation: Mapping[tuple[str, str], float] = field(default_factory=dict)
    among: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for pair, value in self.correlation.items():
            if not is_real(value) or not -1 < value < 1:
                shown = f"{value:g}" if is_real(value) else repr(value)
                raise ValueError(
                    f"the correlation of {' and '.join(pair)} is {shown}; it must lie inside"
                    " (-1, 1)"
                )
            if self.among and not set(pair) <= set(self.among):
                raise ValueError(
                    f"the correlation of {' and '.join(pair)} names an input that is not among"
                    f" {', '.join(self.among)}"
                )

    def check(self, inputs: Sequence[str]) -> None:
        """Refuse names that are no input, and correlations that contradict each other.

        Raises:
            ValueError: As said.
        """
        _require_inputs(
            "ellipsoidal",
            [*self.among, *(name for pair in self.correlation for name in pair)],
            inputs,
        )
        if np.linalg.eigvalsh(self._matrix(self.among or tuple(inputs))).min() <= 0:
            raise ValueError(
                "the correlations of the ellipsoid contradict each other: their matrix must be"
                " positive definite"
            )

    def slack(self, points: Array, inputs: Mapping[str, FuzzyNumber], alpha: float) -> Array:
        """(1 − α)² − tᵀ R⁻¹ t, shape (n,)."""
        names = self.among or tuple(inputs)
        t = np.stack(
            [_signed_distance(inputs[name], points[:, list(inputs).index(name)]) for name in names],
            axis=1,
        )
        size: Array = np.einsum("ni,ij,nj->n", t, np.linalg.inv(self._matrix(names)), t)
        return (1 - alpha) ** 2 - size

    def _matrix(self, names: Sequence[str]) -> Array:
        matrix = np.eye(len(names))
        for (one, other), value in self.correlation.items():
            i, j = names.index(one), names.index(other)
            matrix[i, j] = matrix[j, i] = value
        return matrix


def pulled(point: Array, anchor: Array, slack: Callable[[Array], Array]) -> Array:
    """The point, moved towards an allowed anchor until it is allowed.

    Args:
        point: Shape (inputs,).
        anchor: An allowed point, shape (inputs,).
        slack: Room at points (n, inputs), shape (n,).
    """
    outside, inside = 0.0, 1.0
    if slack(point[None])[0] >= 0:
        return point
    for _ in range(_HALVINGS):
        middle = (outside + inside) / 2
        if slack((point + middle * (anchor - point))[None])[0] >= 0:
            inside = middle
        else:
            outside = middle
    return point + inside * (anchor - point)


def _signed_distance(number: FuzzyNumber, x: Array) -> Array:
    """1 − μ with the side of the modal value as sign; grows beyond 1 outside the support."""
    lower, upper = number.support
    outside = np.maximum(np.maximum(lower - x, x - upper), 0) / max(
        upper - lower, np.finfo(float).tiny
    )
    distance: Array = np.where(x < number.modal, -1.0, 1.0) * (1 - number.membership(x) + outside)
    return distance


def _require_weights(weights: object, bound: object) -> None:
    numbers = isinstance(weights, Mapping) and all(
        is_real(value) for value in (*weights.values(), bound)
    )
    if not numbers:
        raise ValueError(
            f"the linear interaction has weights {weights!r} and bound {bound!r}; it needs numbers"
            " by name, and a number"
        )


def _require_inputs(
    kind: str, names: Mapping[str, float] | Sequence[str], inputs: Sequence[str]
) -> None:
    unknown = sorted(set(names) - set(inputs))
    if unknown:
        raise ValueError(
            f"the {kind} interaction names {', '.join(unknown)}; the fuzzy inputs are"
            f" {', '.join(inputs)}"
        )
