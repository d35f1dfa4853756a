"""Inputs of a frame after its natural modes were measured."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from alphacut.base.errors import by_keys, require
from alphacut.case.motion import Identify
from alphacut.case.structure import Structure
from alphacut.frame import LearnedInputs, identify, read_modes
from alphacut.frame.identification.identify import Evidence


def identify_inputs(
    section: Identify, structure: Structure, alpha: tuple[float, ...]
) -> tuple[LearnedInputs, Structure]:
    """Return what measured modes teach about the inputs, and the structure with the learned ones.

    Args:
        section: File of the measured modes, their scatter, and the inputs to be identified.
        structure: The structure, whose fuzzy inputs are what is known before.
        alpha: Rising α-levels above 0 of the learned inputs.

    Returns:
        The answer, and the structure with the learned set, and its fuzzy numbers in place of the
        former ones. If no inputs within the supports agree with the measurement, the answer says
        that the structure is refuted, and the structure is returned as it was.

    Raises:
        RefusedError: α = 0 is among the levels, the file is not read, an input is unknown or crisp,
            or measurement and structure do not fit.
    """
    learned = identify(**_arguments(section, structure, alpha))
    if learned.is_refuted:
        return learned.answer, structure
    numbers = {**structure.numbers, **learned.inputs}
    return learned.answer, replace(structure, numbers=numbers, learned=learned)


def require_learnable(section: Identify, structure: Structure, alpha: tuple[float, ...]) -> None:
    """Refuse what `identify_inputs` refuses."""
    Evidence.of(**_arguments(section, structure, alpha))


def _arguments(section: Identify, structure: Structure, alpha: tuple[float, ...]) -> dict[str, Any]:
    """Return the arguments by name with which `frame.identify` identifies the inputs of a section.

    Args:
        section: File of the measured modes, their scatter, and the inputs to be identified.
        structure: The structure, whose fuzzy inputs are what is known before.
        alpha: Rising α-levels.

    Raises:
        RefusedError: A level is not above 0, the file of the measured modes is not read, or an
            input is unknown or crisp.
    """
    # A level α is the probability that the scatter of a measurement alone takes it as far from the
    # truth. Normal scatter is unbounded, so that a level of 0 would exclude nothing.
    require(alpha[0] > 0, "envelope.alpha", value=list(alpha), allowed="levels above 0")
    options = ("frequency_deviation", "shape_deviation", "floors", "frequency_unit", "override")
    # The reader names arguments, which are keys of the section, or places in the file.
    with by_keys(lambda name: f"identify.{name}" if name in type(section).model_fields else name):
        modes = read_modes(section.measured, **{name: getattr(section, name) for name in options})
    inputs = structure.inputs(section.learn, "identify.learn")
    further = {"held_out": section.held_out, "alpha": alpha}
    return {"frame": structure.model, "inputs": inputs, "modes": modes, **further}
