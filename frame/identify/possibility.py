"""Possibility of parameters by how well their modes agree with the measured ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from alphacut.frame.identify.chain import Chain
from alphacut.frame.identify.measured import MeasuredMode, ModeCut
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.sets.claimed import Claimed, Joint
from alphacut.fuzzy.sets.numbers import Cut

MIDDLE = 0.3
"""Level of each quantity's own cut whose width measures distances in the search for agreement."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """Joint possibility of parameters, from opinions and claims on them and on their modes.

    Args:
        chain: The frame.
        prior: Fuzzy number of each parameter of the chain.
        measured: Measured modes, by rising number.
    """

    chain: Chain
    prior: Mapping[str, FuzzyNumber]
    measured: tuple[MeasuredMode, ...]

    @cached_property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """Parameters first, then the measured quantities."""
        measured = {name: x for mode in self.measured for name, x in mode.quantities.items()}
        return {**self.prior, **measured}

    @cached_property
    def joint(self) -> Joint | None:
        """Rule by which the claims hold together; None where there is none."""
        names = tuple(name for name, x in self.numbers.items() if isinstance(x, Claimed))
        return Joint(names, False, "parameter of the measured frame", named=True) if names else None

    def own_level(self, alpha: float) -> float:
        """Level of each claim at which all hold together at `alpha`."""
        return alpha / len(self.joint.names) if self.joint else alpha

    def cut(self, number: FuzzyNumber, alpha: float) -> Cut:
        """Cut at the joint level α, of a claim at its own one."""
        return number.cut(self.own_level(alpha) if isinstance(number, Claimed) else alpha)

    def modes(self, alpha: float) -> list[ModeCut]:
        """Ranges of the measured modes at the joint level α."""
        return [mode.ranges(lambda x: self.cut(x, alpha)) for mode in self.measured]

    def values(self, points: Array) -> Array:
        """Parameters and measured quantities of points (S, d), shape (S, q)."""
        eigenvalues, vectors = self.chain.modes(points)
        columns = [*points.T]
        for mode in self.measured:
            k = mode.mode - 1
            columns.append(np.sqrt(eigenvalues[:, k]) / (2 * np.pi))
            one = vectors[:, mode.reference - 1, k]
            columns += [vectors[:, floor - 1, k] / one for floor in mode.shape]
        return np.stack(columns, axis=1)

    def possibility(self, points: Array) -> Array:
        """Joint possibility at points (S, d), shape (S,)."""
        least: Array = np.ones(len(points))
        claimed: Array = np.ones(len(points))
        for column, number in zip(self.values(points).T, self.numbers.values(), strict=True):
            if isinstance(number, Claimed):
                claimed = np.minimum(claimed, number.number.membership(column))
            else:
                least = np.minimum(least, number.membership(column))
        return least if self.joint is None else np.minimum(least, self.joint.joined(claimed))

    @cached_property
    def scales(self) -> tuple[Array, Array]:
        """Middle and half width of each number's cut, each (q,); of the claims' at MIDDLE."""
        cuts = [
            number.cut(MIDDLE) if isinstance(number, Claimed) else number.support
            for number in self.numbers.values()
        ]
        lower, upper = np.array(cuts).T
        return (lower + upper) / 2, np.maximum((upper - lower) / 2, 1e-12 * np.abs(upper))

    def distance(self, logs: Array) -> Array:
        """Scaled distance of each quantity from the middle of its cut, shape (q,)."""
        middle, half = self.scales
        return np.asarray((self.values(self.chain.nominal * np.exp(logs)[None])[0] - middle) / half)

    def best(self, lower: Array, upper: Array) -> Array:
        """Log parameters in a box of them, (d,), that agree best by least squares."""
        d, slack = len(lower), 1e-9
        fitted = least_squares(
            lambda x: self.distance(x)[d:],
            np.where(upper > lower, (lower + upper) / 2, lower),
            jac="3-point",
            bounds=(lower - slack, upper + slack),
            max_nfev=30,
        )
        return np.asarray(np.clip(fitted.x, lower, upper))


def widest(number: FuzzyNumber) -> Cut:
    """The widest cut that a number decides."""
    return number.cut(number.decided) if isinstance(number, Claimed) else number.support
