"""Size of a tolerance beside the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.numbers import below
from alphacut.frame.structures.quantities import Output

LIMIT = 0.01
"""Largest share of an output's peak that passes without a warning."""


@dataclass(frozen=True)
class ToleranceGuard:
    """A tolerance beside the peak of the output that it is coarsest for.

    Args:
        tolerance: In the unit of the output, whose share of a common tolerance it is.
        output: Name of the output.
        peak: Its largest magnitude over time at the modal parameters.
    """

    tolerance: float
    output: str
    peak: float

    @property
    def share(self) -> float:
        """The tolerance over the peak; 0 for an output at rest."""
        return self.tolerance / self.peak if self.peak > 0 else 0.0

    @property
    def cure(self) -> float:
        """The largest tolerance that passes."""
        return LIMIT * self.peak

    @property
    def ok(self) -> bool:
        """True if the tolerance resolves the motion."""
        return self.share <= LIMIT * (1 + 1e-9)

    @property
    def message(self) -> str:
        """One sentence for a warning or an error."""
        unit = Output(self.output).unit
        return (
            f"tolerance: {self.tolerance:.3g} {unit} is {100 * self.share:.3g} % of the peak of"
            f" {self.output}, {self.peak:.3g} {unit}; above {100 * LIMIT:g} % an envelope is rough;"
            f" take at most {below(self.cure)} {unit}, or a relative tolerance such as 0.001"
        )


def tolerance_guard(flow: UnitFlow, tolerance: float) -> ToleranceGuard:
    """Guard of the output of which the tolerance is the largest share of the peak."""
    peak = np.abs(flow.flow.values(flow.boxes.modal[None])[0]).max(0)
    wanted = tolerance * flow.scale
    worst = int(np.argmax(np.divide(wanted, peak, out=np.zeros_like(peak), where=peak > 0)))
    return ToleranceGuard(float(wanted[worst]), flow.outputs[worst], float(peak[worst]))
