"""Possibility that a storey frame exceeds a limit at some time, with its fuzzy safety margin.

The cuts of the inputs are a family of boxes that grow as α falls. The largest one proved safe and
the least one with a motion beyond a limit bound the possibility from both sides. Necessity is 0
where some motion of the highest cut keeps all limits, and is not told otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.decisions.safe_scale import Progress, SafeScale, safe_scale
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arguments import fuzzy_inputs
from alphacut.fuzzy.knowledge.joint import JointClaim, joined_once


@dataclass(frozen=True, eq=False)
class Exceeding:
    """How possible it is that any limit is exceeded at any node.

    Args:
        possibility: Lower and upper bound.
        necessity: Lower and upper bound.
        scale: What was proved of boxes of size 1 − α, and the witness.
        claim: What the cuts of the inputs claim.
    """

    possibility: tuple[float, float]
    necessity: tuple[float, float]
    scale: SafeScale
    claim: str

    @property
    def verdict(self) -> str:
        """Safe where exceeding is proved impossible at the lowest cut, unsafe where it is sure."""
        if self.possibility[1] == 0:
            return "safe"
        return "unsafe" if self.necessity[0] == 1 else "undecided"

    def __str__(self) -> str:
        """The decision with what it rests on."""
        (a, b), (c, d) = self.possibility, self.necessity
        degrees = f"possibility of exceeding {a:.4g} … {b:.4g}, necessity {c:.4g} … {d:.4g}"
        lines = [f"{self.verdict}: {degrees} ({self.scale.nature})"]
        return "\n".join([*lines, *([self.claim] if self.claim else [])])


def exceeding(
    frame: StoreyFrame,
    inputs: Mapping[str, FuzzyNumber | float],
    limits: Mapping[str, float],
    *,
    duration: float,
    step: float,
    lowest: float = 0.0,
    workers: int = 1,
    progress: Progress | None = None,
) -> Exceeding:
    """Bounds of the possibility that some |output| exceeds its limit at some node.

    Args:
        frame: The structure with its ground motion and initial state.
        inputs: Fuzzy numbers of the uncertain parameters, in SI units; claims are joined as
            `propagate` does.
        limits: Largest magnitude allowed by output: drifts, accelerations, shears, one or several.
        duration: Length of the motion, in s.
        step: Distance of nodes, in s.
        lowest: Lowest level that the inputs decide.
        workers: Processes of the proof.
        progress: Called with the fraction done.

    Raises:
        ValueError: A limit is not positive, or an input is no parameter.
    """
    numbers = joined_once(fuzzy_inputs(inputs))

    def reach(size: float) -> tuple[Array, Array]:
        cuts = np.array([x.cut(max(1 - size, lowest)) for x in numbers.values()])
        return cuts[:, 0], cuts[:, 1]

    found = safe_scale(
        frame,
        {name: number.modal for name, number in numbers.items()},
        reach,
        limits,
        duration=duration,
        step=step,
        most=1.0 - lowest,
        workers=workers,
        progress=progress,
    )
    safe = 0.0 if found.safe is None else found.safe
    upper = 0.0 if found.safe is not None and safe >= 1 - lowest and lowest == 0 else 1 - safe
    lower = 1 - found.unsafe if np.isfinite(found.unsafe) else 0.0
    necessity = (0.0, 1.0 if found.safe is None else 0.0)
    claim = str(JointClaim.of(numbers).resting_on(found.nature))
    return Exceeding((max(lower, 0.0), upper), necessity, found, claim)
