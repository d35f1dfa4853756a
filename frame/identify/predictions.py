"""Predicted natural frequencies, and how a measurement of one is judged."""

from __future__ import annotations

from dataclasses import dataclass

from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arrays import Array


@dataclass(frozen=True, eq=False)
class Prediction:
    """Natural frequency of one mode over the identified parameters.

    Args:
        mode: Its number by rising frequency, from 1.
        alpha: Levels, shape (A,), rising.
        lower: Least frequency at each level, proved, shape (A,), in Hz.
        upper: Greatest frequency.
        sampled: Frequencies of samples of the lowest level's set, shape (S,), in Hz.
        used: True if the mode was measured and served to identify.
    """

    mode: int
    alpha: Array
    lower: Array
    upper: Array
    sampled: Array
    used: bool

    def inside(self, frequency: float) -> bool:
        """True if a frequency in Hz lies in the proved range at the lowest level."""
        return bool(self.lower[0] <= frequency <= self.upper[0])

    def possibility(self, measured: FuzzyNumber) -> float:
        """Greatest level at which a measured frequency meets the predicted range.

        0 where they do not meet at the lowest level: such a measurement refutes the frame.
        """
        held = 0.0
        for level, low, high in zip(self.alpha, self.lower, self.upper, strict=True):
            cut = measured.cut(float(level))
            if cut.lower <= high and low <= cut.upper:
                held = float(level)
        return held

    @property
    def rule(self) -> str:
        """The judgement of a measurement, in words."""
        low, high = f"{self.lower[0]:.4g}", f"{self.upper[0]:.4g}"
        if self.used:
            return f"mode {self.mode} served to identify: {low} … {high} Hz is no prediction"
        return f"mode {self.mode}: a frequency outside {low} … {high} Hz refutes the frame"
