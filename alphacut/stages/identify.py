"""Inputs of a frame after its natural modes were measured."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from alphacut.base.errors import RefusedError, require
from alphacut.case.motion import Identify
from alphacut.case.structure import Structure
from alphacut.frame import identify, read_modes
from alphacut.frame.identify.identify import Evidence, Identified
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
    learned = identify(**_arguments(section, structure, alpha))
    if learned.is_refuted:
        return RefutedResult(refuted=learned.refutation), structure
    numbers = {**structure.numbers, **learned.inputs}
    return _stored(learned), replace(structure, numbers=numbers)


def require_learnable(section: Identify, structure: Structure, alpha: tuple[float, ...]) -> None:
    """Refuses what `identify_inputs` refuses."""
    Evidence.of(**_arguments(section, structure, alpha))


def _arguments(section: Identify, structure: Structure, alpha: tuple[float, ...]) -> dict[str, Any]:
    """Arguments of `identify` for a section; RefusedError where it makes none."""
    require(alpha[0] > 0, "envelope.alpha", value=list(alpha), allowed="levels above 0")
    assert structure.frame is not None
    try:
        modes = read_modes(
            section.measured,
            frequency_deviation=section.frequency_deviation,
            shape_deviation=section.shape_deviation,
            floors=section.floors,
        )
    except RefusedError as error:
        is_own = error.key in type(section).model_fields
        key = f"identify.{error.key}" if is_own else error.key
        raise RefusedError(key, error.value, error.allowed, error.cure) from None
    inputs = structure.inputs(section.learn, "identify.learn")
    options = {"held_out": section.held_out, "alpha": alpha}
    return {"frame": structure.frame, "inputs": inputs, "modes": modes, **options}


def _stored(learned: Identified) -> IdentifiedResult:
    answer = learned.answer
    inputs = {name: CutsResult(**ends._asdict()) for name, ends in answer.inputs.items()}
    return IdentifiedResult(
        alpha=answer.alpha,
        inputs=inputs,
        narrowed=dict(answer.narrowed),
        units=dict(answer.units),
        claim=answer.claim,
        held_out=tuple(Prediction(**vars(mode)) for mode in answer.held_out),
        prior=dict(answer.prior),
    )
