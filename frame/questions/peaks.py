"""Fuzzy peaks: the largest magnitude of each output over the motion, as intervals by level.

At the nodes no motion peaks higher than its envelope, and each has at least the magnitude that its
band is away from zero. Both are read off bounds that exclude values and bounds that are attained,
so that a peak is as sure as its envelope; what the steps between nodes may add counts as error.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.frame.envelope import Envelope
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require
from alphacut.fuzzy.result import Ends, Nature


@dataclass(frozen=True, eq=False)
class Peaks:
    """Largest magnitude of each output over time.

    Args:
        alpha: Levels, rising, shape (A,).
        outputs: Names, m of them.
        lower: Magnitude at the nodes that each motion reaches, as the bounds have it, (A, m).
        upper: Magnitude at the nodes that none passes, as the bounds have it, shape (A, m).
        error: Distance by which peaks may lie outside `lower` and `upper`: that of the envelope
            and of the steps between nodes, shape (A, m).
        reached: Magnitude that a motion in the cut is known to reach, shape (A, m).
        natures: Nature of each output's bounds, m of them.
    """

    alpha: Array
    outputs: tuple[str, ...]
    lower: Array
    upper: Array
    error: Array
    reached: Array
    natures: tuple[Nature, ...]

    def most(self, output: str) -> Ends:
        """Ends between which the greatest peak in each cut lies; infinite where nothing excludes.

        Attained bounds exclude nothing: a motion that was not looked at may peak higher.
        """
        k = self.outputs.index(output)
        attained = self.natures[k] is Nature.ATTAINED
        above = self.upper[:, k] + (np.inf if attained else self.error[:, k])
        return Ends(self.reached[:, k], above)

    def least(self, output: str) -> Ends:
        """Ends between which the least peak in each cut lies.

        Each cut holds the highest one, none of whose motions peaks above its greatest.
        """
        k = self.outputs.index(output)
        known = self.natures[k] is not Nature.ATTAINED
        below = known * np.maximum(self.lower[:, k] - self.error[:, k], 0.0)
        return Ends(below, self.most(output).upper[-1:])

    def nature(self, outputs: Iterable[str]) -> Nature:
        """Weakest nature of some outputs' bounds."""
        return Nature.weakest(self.natures[self.outputs.index(name)] for name in outputs)


def peaks(envelope: Envelope) -> Peaks:
    """Fuzzy peaks of the magnitude of every output."""
    natures = envelope.natures or (envelope.nature,) * len(envelope.outputs)
    proved = np.array([nature is Nature.GUARANTEED for nature in natures])
    error = np.where(proved, 0.0, envelope.error)  # of proved bounds it lies inside them
    inner = envelope.attained
    size = np.maximum(envelope.upper, -envelope.lower)
    away = np.maximum(np.maximum(envelope.lower, -envelope.upper), 0.0)
    upper, lower = size.max(1), away.max(1)
    above = within_steps(size + error, envelope.between).max(1) - upper
    below = lower - np.maximum(away - error, 0.0).max(1)
    reached = np.nan_to_num(np.maximum(inner.upper, -inner.lower).max(1), nan=0.0)
    return Peaks(
        np.asarray(envelope.alpha),
        tuple(map(str, envelope.outputs)),
        lower,
        upper,
        np.maximum(above, below),
        np.maximum(reached, 0.0),
        natures,
    )


def within_steps(size: Array, between: Array | None) -> Array:
    """Bound of a magnitude in the step to each node, shape (…, T, m).

    Args:
        size: The magnitude at the nodes, shape (…, T, m).
        between: What it may exceed both ends of each step by, shape (T, m); None for nothing.
    """
    if between is None:
        return size
    out = size.copy()
    out[..., 1:, :] = np.maximum(size[..., 1:, :], size[..., :-1, :]) + between[1:]
    return out


def require_limits(limits: Mapping[str, float], outputs: Sequence[str]) -> None:
    """Refuse limits that are none, or not of these outputs.

    Raises:
        RefusedError: There is no limit, one is not positive, or it names no output.
    """
    require(bool(limits), "limits", None, "one limit or more, as {'q3': 0.1}")
    for name, limit in limits.items():
        require(name in outputs, "limits", name, ", ".join(outputs))
        require(limit > 0, f"limit of {name}", limit, "a positive number")
