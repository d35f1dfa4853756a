"""What measured modes teach about the parameters of a frame: the answer, as data and as a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.fuzzy.result import Ends, Nature, rounded


@dataclass(frozen=True)
class Prediction:
    """Measured frequency of a held-out mode, and its proved range at the lowest α, in Hz."""

    mode: int
    measured: float
    predicted: tuple[float, float]
    inside: bool

    @property
    def verdict(self) -> str:
        """Whether the measured frequency lies inside, in a word."""
        return "inside" if self.inside else "outside"


@dataclass(frozen=True, eq=False)
class Predictions:
    """Proved bounds of all n natural frequencies of a frame, beside those that were measured.

    Args:
        alpha: Levels, shape (A,), rising.
        lower: Lower bounds, in Hz, shape (A, n).
        upper: Upper bounds.
        measured: Mean measured frequency by the number of its mode, from 1, in Hz.
        learned_from: Numbers of the modes from which the frame was learned.
    """

    alpha: Array
    lower: Array
    upper: Array
    measured: Mapping[int, float]
    learned_from: tuple[int, ...]

    @property
    def held_out(self) -> tuple[Prediction, ...]:
        """The measured modes that were not learned from, at the lowest level."""
        predictions = []
        for mode in sorted(self.measured.keys() - set(self.learned_from)):
            if mode > self.lower.shape[1]:
                continue  # a frame of n floors has n modes
            low, high = float(self.lower[0, mode - 1]), float(self.upper[0, mode - 1])
            measured = self.measured[mode]
            predictions.append(Prediction(mode, measured, (low, high), low <= measured <= high))
        return tuple(predictions)

    def __str__(self) -> str:
        """Return a line for each mode at the lowest level."""
        if not np.isfinite(self.lower).all():
            return "no frequency is predicted: the frame is refuted"
        verdicts = {mode.mode: f", {mode.verdict}: held out" for mode in self.held_out}
        lines = [f"guaranteed frequencies at α = {self.alpha[0]:g}"]
        for mode, ends in enumerate(zip(self.lower[0], self.upper[0], strict=True), start=1):
            line = f"mode {mode}: {range_text(ends, 'Hz')}"
            if mode in self.measured:
                line += f", measured {self.measured[mode]:.4g} Hz{verdicts.get(mode, '')}"
            lines.append(line)
        return "\n".join(lines)

    __repr__ = __str__


class LearnedRow(NamedTuple):
    """A parameter before and after, or a held-out mode measured and predicted, with its unit."""

    name: str
    unit: str
    before: tuple[float, float]
    after: tuple[float, float]
    remark: str


@dataclass(frozen=True, eq=False)
class LearnedInputs:
    """Parameters of a frame that agree with its measured modes; or that none do.

    Args:
        alpha: Levels, shape (A,), rising.
        inputs: Ends of each parameter's box, in SI, shape (A,) each; none of a refuted frame.
        narrowed: Width of each parameter's box over that of its prior, at the lowest α.
        units: SI unit of each parameter.
        claim: What the boxes contain how often, and under which conditions.
        held_out: Modes that were not learned from, measured and predicted.
        prior: Widest decided cut of each parameter before, in SI.
        refuted: Why no such frame has the measured modes; empty if some have.
    """

    alpha: Array
    inputs: Mapping[str, Ends]
    narrowed: Mapping[str, float]
    units: Mapping[str, str]
    claim: str
    held_out: tuple[Prediction, ...]
    prior: Mapping[str, tuple[float, float]]
    refuted: str = ""

    def rows(self) -> Iterator[LearnedRow]:
        """Yield each parameter at the lowest α, then each held-out mode."""
        for name, ends in self.inputs.items():
            after = float(ends.lower[0]), float(ends.upper[0])
            remark = f"{self.narrowed[name]:.0%} of the width"
            yield LearnedRow(name, self.units[name], self.prior[name], after, remark)
        for mode in self.held_out:
            measured = mode.measured, mode.measured
            yield LearnedRow(f"mode {mode.mode}", "Hz", measured, mode.predicted, mode.verdict)

    def __str__(self) -> str:
        """Return a line for each parameter and each held-out mode, or why the frame is refuted."""
        if self.refuted:
            return self.refuted
        lines = [f"guaranteed boxes at α = {self.alpha[0]:g}"]
        for row in self.rows():
            before = range_text(row.before, row.unit)
            lines.append(f"{row.name}: {before} → {range_text(row.after, row.unit)}, {row.remark}")
        return "\n".join([*lines, self.claim])

    __repr__ = __str__


def range_text(ends: tuple[float, float], unit: str) -> str:
    """Return a range with its unit, rounded outwards; one number where its ends agree."""
    low, high = ends
    if low == high:
        return f"{low:.4g} {unit}".strip()
    texts = [
        f"{rounded(low, 'lower', Nature.GUARANTEED):.4g}",
        f"{rounded(high, 'upper', Nature.GUARANTEED):.4g}",
    ]
    return f"{' … '.join(dict.fromkeys(texts))} {unit}".strip()
