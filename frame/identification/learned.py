"""What measured modes teach about the parameters of a frame: the result as data and as a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.nature import Nature
from alphacut.base.number_text import engineering, rounded_ends
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.fuzzy.result import Ends


@dataclass(frozen=True)
class Prediction:
    """Prediction of a mode that was not learned from.

    Args:
        mode: Number of the mode, from 1.
        measured: Mean measured frequency, in Hz.
        predicted: Proved range of the frequency on the lowest level, in Hz.
        inside: Whether the measured frequency lies in the range.
    """

    mode: int
    measured: float
    predicted: tuple[float, float]
    inside: bool

    @property
    def verdict(self) -> str:
        """The word "inside" or "outside"."""
        return "inside" if self.inside else "outside"


@dataclass(frozen=True, eq=False)
class Predictions:
    """Proved bounds of all natural frequencies of a frame, beside the measured ones.

    Args:
        alpha: Levels, rising, shape (levels,).
        lower: Lower bounds of the frequencies, in Hz, shape (levels, modes).
        upper: Upper bounds, same shape.
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
        """Predictions of the measured modes that were not learned from, by rising number.

        Each has the measured frequency, the range that is predicted on the lowest level, and
        whether the former lies in the latter, ends included. Modes beyond the number of floors are
        left out. For a refuted frame no range contains the measured frequency.
        """
        predictions = []
        for mode in sorted(self.measured.keys() - set(self.learned_from)):
            # A frame with n floors has n modes; a higher measured mode is no mode of this model.
            if mode <= self.lower.shape[1]:
                low = float(self.lower[0, mode - 1])
                high = float(self.upper[0, mode - 1])
                measured = self.measured[mode]
                is_inside = low <= measured <= high
                predictions.append(Prediction(mode, measured, (low, high), is_inside))
        return tuple(predictions)

    def __str__(self) -> str:
        """Return a head, and a line with the predicted range of each mode on the lowest level.

        The mean measured frequency stands beside it as far as there is one, and whether it lies
        inside for a mode that was held out. A refuted frame has one line that says so.
        """
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


@dataclass(frozen=True, eq=False, repr=False)
class LearnedInputs(Answer):
    """Parameters of a frame that agree with its measured modes, or that none do.

    Args:
        alpha: Levels, rising, shape (levels,).
        inputs: Ends of the box of each parameter, in SI units, shape (levels,) each; empty for a
            refuted frame.
        narrowed: Width of the box of each parameter over the width of its prior, on the lowest
            level.
        units: SI unit of each parameter.
        claim: What the boxes contain with which probability, and under which conditions.
        held_out: Modes that were not learned from, measured and predicted.
        prior: Widest cut of each parameter before the measurement, in SI units.
        refuted: Why no such frame has the measured modes; empty if some frames have.
    """

    key = "update"
    title = "What do measured modes teach?"
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

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each parameter and for each mode held out.

        The columns are the name; the prior, or the measured frequency; the range that was learned
        on the lowest level, or the predicted range of the frequency; and the width of the learned
        range in per cent of the prior's, or whether the measured frequency lies inside.
        """
        for name in self.inputs:
            yield {
                "input or mode": name,
                "before, measured": outer_text(self.prior[name], self.units[name]),
                "learned, predicted": outer_text(self._learned(name), self.units[name]),
                "": f"{self.narrowed[name]:.0%} of the width",
            }
        for mode in self.held_out:
            yield {
                "input or mode": f"mode {mode.mode}",
                "before, measured": f"{mode.measured:.4g} Hz",
                "learned, predicted": outer_text(mode.predicted, "Hz"),
                "": mode.verdict,
            }

    def _learned(self, name: str) -> tuple[float, float]:
        """Return the ends of the box of a parameter on the lowest level."""
        ends = self.inputs[name]
        return float(ends.lower[0]), float(ends.upper[0])

    def number_rows(self) -> Iterator[Row]:
        """Yield a row of numbers for each parameter and for each mode held out, in SI units.

        The columns are name, unit, both ends of the prior (or twice the measured frequency), both
        ends of the range that was learned or predicted on the lowest level, the width of the
        learned range over that of the prior (None for a mode), and "inside" or "outside" for a
        mode (empty for a parameter).
        """
        for name in self.inputs:
            before, after = self.prior[name], self._learned(name)
            yield {
                "input or mode": name,
                "unit": self.units[name],
                "before or measured, from": before[0],
                "before or measured, to": before[1],
                "from": after[0],
                "to": after[1],
                "fraction of the width": self.narrowed[name],
                "inside": "",
            }
        for mode in self.held_out:
            yield {
                "input or mode": f"mode {mode.mode}",
                "unit": "Hz",
                "before or measured, from": mode.measured,
                "before or measured, to": mode.measured,
                "from": mode.predicted[0],
                "to": mode.predicted[1],
                "fraction of the width": None,
                "inside": mode.verdict,
            }

    def words(self) -> str:
        """Return what the boxes claim, or why the frame is refuted."""
        return self.refuted or f"Guaranteed boxes at α = {self.alpha[0]:g}: {self.claim}"

    def __str__(self) -> str:
        """Return the table and the sentences; for a refuted frame the reason alone."""
        return self.refuted or super().__str__()

    __repr__ = __str__


def outer_text(ends: tuple[float, float], unit: str) -> str:
    """Return a range with its unit, rounded outwards, or one number if its ends agree."""
    low, high = ends
    texts = [engineering(end, unit) for end in rounded_ends(low, high, Nature.GUARANTEED)]
    return " … ".join(dict.fromkeys(texts))
