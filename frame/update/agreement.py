"""Possibility of parameters by how well their modes agree with the measured ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import least_squares, linprog

from alphacut.frame.calculus.jet import Array
from alphacut.frame.update.chain import Chain
from alphacut.frame.update.measured import Measurement
from alphacut.fuzzy import FuzzyNumber
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
        measured: The measured modes.
    """

    chain: Chain
    prior: Mapping[str, FuzzyNumber]
    measured: Measurement

    @cached_property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """Parameters first, then what was measured."""
        return {**self.prior, **self.measured.quantities}

    @cached_property
    def joint(self) -> Joint | None:
        """Rule by which the claims hold together; None where there is none."""
        names = tuple(name for name, x in self.numbers.items() if isinstance(x, Claimed))
        means = "parameter of the measured frame"
        return Joint(names, self.measured.independent, means, named=True) if names else None

    def own_level(self, alpha: float) -> float:
        """Level of each claim at which all hold together at `alpha`."""
        if self.joint is None:
            return alpha
        m = len(self.joint.names)
        if not self.joint.independent or alpha == 1:
            return alpha / (1 if self.joint.independent else m)
        return -float(np.expm1(np.log1p(-alpha) / m))

    def values(self, points: Array) -> Array:
        """Parameters and measured quantities of points (S, d), shape (S, q)."""
        eigenvalues, vectors = self.chain.modes(points)
        columns = [*points.T]
        for mode in self.measured.modes:
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

    def slopes(self, logs: Array) -> Array:
        """Derivatives of the scaled quantities by the log parameters, shape (q, d)."""
        step = 1e-6 * np.eye(len(logs))
        ends = self.values(self.chain.nominal * np.exp(np.vstack([logs + step, logs - step])))
        difference = (ends[: len(logs)] - ends[len(logs) :]) / 2e-6
        return difference.T / self.scales[1][:, None]

    def distance(self, logs: Array) -> Array:
        """Scaled distance of each quantity from the middle of its cut, shape (q,)."""
        middle, half = self.scales
        return np.asarray((self.values(self.chain.nominal * np.exp(logs)[None])[0] - middle) / half)

    def best(self, lower: Array, upper: Array) -> Array:
        """Log parameters in a box of them, (d,), whose least agreement is about the largest."""
        d = len(lower)
        inside = np.where(upper > lower, (lower + upper) / 2, lower)
        slack = 1e-9 * np.ones(d)
        found = least_squares(
            lambda x: self.distance(x)[d:],
            inside,
            jac=lambda x: self.slopes(x)[d:],
            bounds=(lower - slack, upper + slack),
            max_nfev=30,
        ).x
        best: Array = np.clip(found, lower, upper)
        for _ in range(6):
            step = self._minimax_step(best, lower, upper)
            if step is None:
                break
            tried = np.stack([best + part * step for part in (1.0, 0.5, 0.25, 0.0)])
            worst = [np.abs(self.distance(row)[d:]).max() for row in tried]
            best = tried[int(np.argmin(worst))]
            if np.argmin(worst) == 3:
                break
        return best

    def _minimax_step(self, at: Array, lower: Array, upper: Array) -> Array | None:
        d = len(at)
        away, slopes = self.distance(at)[d:], self.slopes(at)[d:]
        ones = np.ones((len(away), 1))
        rows = np.block([[slopes, -ones], [-slopes, -ones]])
        ends = [*zip(lower - at, upper - at, strict=True), (0, None)]
        cost = np.append(np.zeros(d), 1.0)
        found: Any = linprog(cost, A_ub=rows, b_ub=np.append(-away, away), bounds=ends)
        return found.x[:d] if found.status == 0 else None


def widest(number: FuzzyNumber) -> Cut:
    """The widest cut that a number decides."""
    return number.cut(number.decided) if isinstance(number, Claimed) else number.support
