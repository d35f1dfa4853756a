"""Inputs of a frame after its natural modes were measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alphacut.base.errors import require
from alphacut.case.motion import Identify
from alphacut.case.structure import Structure
from alphacut.frame.identify import MeasuredMode, RefutedError, identify, measured_mode
from alphacut.frame.identify.identify import widest_cut
from alphacut.frame.identify.mode_rows import ModeRows, mode_rows
from alphacut.frame.identify.uff_modes import ENDINGS, uff_mode_rows
from alphacut.frame.structures.quantities import of_storey_frame
from alphacut.fuzzy import FuzzyNumber
from alphacut.stages.store import CutsResult, Numbers, Values


class Prediction(Numbers):
    """Measured frequency of a mode, and its predicted bounds on the lowest level, in Hz."""

    mode: int
    measured: float
    predicted: tuple[float, float]
    inside: bool

    @property
    def verdict(self) -> str:
        """Whether the measured frequency lies inside, in a word."""
        return "inside" if self.inside else "outside"


class IdentifiedResult(Numbers):
    """Identified inputs: α-cuts in SI, and the share of its width by which each is narrowed."""

    alpha: Values
    inputs: dict[str, CutsResult]
    narrowed: dict[str, float]
    units: dict[str, str]
    claim: str
    held_out: tuple[Prediction, ...]
    prior: dict[str, tuple[float, float]]


class RefutedResult(Numbers):
    """How measurements refute the frame."""

    refuted: str


LearnedResult = IdentifiedResult | RefutedResult


def identify_inputs(
    section: Identify, structure: Structure, alpha: tuple[float, ...]
) -> tuple[LearnedResult, Structure]:
    """Numbers of the inputs identified from measured modes, in SI, and the updated structure.

    Where the measurement refutes the frame, the result says so and the structure is as before.
    """
    rows, learned_modes, prior = require_learnable(section, structure, alpha)
    assert structure.frame is not None
    try:
        posterior = identify(structure.frame, prior, learned_modes, alpha=alpha)
    except RefutedError as error:
        return RefutedResult(refuted=str(error)), structure
    predictions, held_out = posterior.predictions(), list[Prediction]()
    for mode in sorted(mode for mode in section.held_out if mode <= structure.frame.floors):
        low, high = (float(bounds[0, mode - 1]) for bounds in predictions)  # (levels, modes)
        measured = float(rows[mode].frequencies.mean())
        ends, inside = (low, high), low <= measured <= high
        held_out.append(Prediction(mode=mode, measured=measured, predicted=ends, inside=inside))
    cuts = np.stack([posterior.lower, posterior.upper], axis=-1)  # (levels, inputs, 2)
    result = IdentifiedResult(
        alpha=posterior.alpha,
        inputs={name: CutsResult.of(cuts[:, k]) for k, name in enumerate(posterior.names)},
        narrowed=dict(posterior.narrowed),
        units={name: of_storey_frame(name).unit for name in posterior.names},
        claim=str(posterior.claim),
        held_out=tuple(held_out),
        prior={name: widest_cut(number) for name, number in prior.items()},
    )
    return result, replace(structure, numbers={**structure.numbers, **posterior.numbers})


def require_learnable(
    section: Identify, structure: Structure, alpha: tuple[float, ...]
) -> tuple[dict[int, ModeRows], list[MeasuredMode], dict[str, FuzzyNumber]]:
    """Measurements by mode; the modes to learn from, without held-out ones; the prior inputs."""
    require(alpha[0] > 0, "envelope.alpha", value=list(alpha), allowed="levels above 0")
    rows = {row.mode: row for row in _measured_rows(section)}
    allowed, held_out = f"some of modes {[*rows]}, not all", section.held_out
    fits, value = set(held_out) < set(rows), ", ".join(map(str, held_out))
    require(fits, "identify.held_out", value=value, allowed=allowed)
    learned = [
        measured_mode(
            mode,
            row.frequencies,
            {floor: [*map(float, values)] for floor, values in row.amplitudes.items()},
            # the section's standard deviations stand in where the file has none
            frequency_deviation=row.frequency_deviation or section.frequency_deviation,
            shape_deviation=row.shape_deviation or section.shape_deviation,
        )
        for mode, row in rows.items()
        if mode not in held_out
    ]
    return rows, learned, structure.inputs(section.learn, "identify.learn")


def _measured_rows(section: Identify) -> tuple[ModeRows, ...]:
    is_universal = section.measured.suffix.lower() in ENDINGS
    allowed = "the floors of its unknowns" if is_universal else "left out beside a CSV file"
    fits = bool(section.floors) == is_universal
    require(fits, "identify.floors", value=section.floors or None, allowed=allowed)
    if is_universal:
        return uff_mode_rows(section.measured, section.floors)
    return mode_rows(section.measured)
