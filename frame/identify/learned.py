"""What measured modes teach about the parameters of a frame: the answer, as data and as a table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from textwrap import fill

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.nature import Nature
from alphacut.base.number_text import Table, engineering, rounded_ends, text_table
from alphacut.fuzzy.result import Ends

Record = dict[str, str | float | None]
"""Numbers and texts of a row, in SI, by the titles of their columns."""


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
            line = f"mode {mode}: {outer_text(ends, 'Hz')}"
            if mode in self.measured:
                line += f", measured {self.measured[mode]:.4g} Hz{verdicts.get(mode, '')}"
            lines.append(line)
        return "\n".join(lines)

    __repr__ = __str__


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

    @property
    def is_refuted(self) -> bool:
        """Whether no parameters in their priors agree with the measured modes."""
        return bool(self.refuted)

    def table(self) -> Table:
        """Return texts of each parameter before and after, then of each mode that was held out."""
        rows: list[tuple[str, ...]] = []
        for name, ends in self.inputs.items():
            unit, after = self.units[name], (float(ends.lower[0]), float(ends.upper[0]))
            texts = outer_text(self.prior[name], unit), outer_text(after, unit)
            rows.append((name, *texts, f"{self.narrowed[name]:.0%} of the width"))
        for mode in self.held_out:
            predicted = outer_text(mode.predicted, "Hz")
            rows.append((f"mode {mode.mode}", f"{mode.measured:.4g} Hz", predicted, mode.verdict))
        return Table(("input or mode", "before, measured", "learned, predicted", ""), rows)

    def records(self) -> list[Record]:
        """Return the numbers of the table, in SI: parameters at the lowest α, then modes."""
        rows: list[Record] = []
        for name, ends in self.inputs.items():
            before, after = self.prior[name], (float(ends.lower[0]), float(ends.upper[0]))
            rows.append(_record(name, self.units[name], before=before, after=after))
            rows[-1]["narrowed by"] = self.narrowed[name]
        for mode in self.held_out:
            measured = mode.measured, mode.measured
            rows.append(_record(f"mode {mode.mode}", "Hz", before=measured, after=mode.predicted))
            rows[-1]["inside"] = mode.verdict
        return rows

    def words(self) -> str:
        """Return what the boxes claim, or why the frame is refuted."""
        return self.refuted or f"Guaranteed boxes at α = {self.alpha[0]:g}: {self.claim}"

    def __str__(self) -> str:
        """Return the table, then the sentences; of a refuted frame these alone."""
        return self.refuted or f"{text_table(*self.table())}{fill(self.words(), 100)}"

    __repr__ = __str__


def _record(
    name: str, unit: str, *, before: tuple[float, float], after: tuple[float, float]
) -> Record:
    """Row of numbers of a parameter or a mode, without how far it is narrowed or inside."""
    return {
        "input or mode": name,
        "unit": unit,
        "before or measured, from": before[0],
        "before or measured, to": before[1],
        "from": after[0],
        "to": after[1],
        "narrowed by": None,
        "inside": "",
    }


def outer_text(ends: tuple[float, float], unit: str) -> str:
    """Return a range with its unit, rounded outwards; one number where its ends agree."""
    texts = (engineering(end, unit) for end in rounded_ends(*ends, Nature.GUARANTEED))
    return " … ".join(dict.fromkeys(texts))
