"""Results of a run as objects, and their summary in numbers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from alphacut.case.content import Content
from alphacut.case.structure import Structure
from alphacut.frame import StoreyFrame
from alphacut.frame.structures.linear import frequencies
from alphacut.io.files import Document
from alphacut.io.quantity import STANDARD_GRAVITY
from alphacut.stages import envelope
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import StageResult

NAMES = ("microstructure", "modulus", "image", "shares")
"""Stages with one result."""


@dataclass
class Results:
    """Results of a run; None or empty where the case has no such stage.

    Args:
        content: Sections of the case.
        microstructure: Particles and their map.
        modulus: Fuzzy modulus of a round cell.
        image: Proved modulus of an image.
        structure: The structure with its modulus, and with what was learned.
        tasks: The studies.
        envelopes: Their envelopes by name.
        learned: Inputs after measured modes.
        answers: Answers to the questions of the case, by their keys.
        shares: Shares of the inputs in the widths.
        suite: Peaks under each record of a suite.
    """

    content: Content
    microstructure: StageResult | None = None
    modulus: StageResult | None = None
    image: StageResult | None = None
    structure: Structure | None = None
    tasks: tuple[EnvelopeTask, ...] = ()
    envelopes: dict[str, StageResult] = field(default_factory=dict)
    learned: Document | None = None
    answers: dict[str, Document] = field(default_factory=dict)
    shares: StageResult | None = None
    suite: Document | None = None

    @property
    def is_paper(self) -> bool:
        """True if figures bear the paper's numbers."""
        return any(task.figures for task in self.tasks)

    @property
    def stages(self) -> dict[str, StageResult]:
        """Every result by the name of its stage."""
        results = {name: getattr(self, name) for name in NAMES}
        results |= {f"envelope_{name}": data for name, data in self.envelopes.items()}
        return {name: data for name, data in results.items() if data is not None}

    @property
    def _units(self) -> dict[str, str]:
        """SI unit of each output of the structure."""
        assert self.structure is not None
        return {str(name): self.structure.unit(name) for name in self.structure.outputs}

    def document(self) -> Document:
        """Numbers of all results, in the parts of summary.json."""
        results = {name: getattr(self, name) for name in NAMES}
        numbers = {name: result.document for name, result in results.items() if result is not None}
        if self.structure is not None and self.structure.frame is not None:
            numbers["structure"] = frame_properties(self.structure, self.structure.frame)
        tasks = {task.name: task for task in self.tasks}
        if self.structure is not None and self.content.has_material_damping:
            numbers["damping"] = {
                name: (number.support.lower, number.modal, number.support.upper)
                for name, number in self.structure.numbers.items()
                if name.startswith("zeta")
            }
        if self.envelopes:
            numbers["envelopes"] = {
                name: envelope.document(data, tasks[name].fuzzy)
                | {"drawn": list(tasks[name].figures), "units": self._units}
                for name, data in self.envelopes.items()
            }
        if self.suite is not None:
            numbers["records"] = self.suite | {"units": self._units}
        if self.learned is not None:
            numbers["update"] = self.learned
        return {**numbers, **self.answers}


def frame_properties(structure: Structure, frame: StoreyFrame) -> Document:
    """Natural frequencies, first period, weight, and the height of the storey of each drift."""
    omega, drifts = frequencies(frame), set(structure.outputs)
    return {
        "omega_rad_per_s": omega,
        "period_s": 2 * np.pi / omega[0],
        "weight_N": sum(frame.masses) * float(STANDARD_GRAVITY),
        "heights_m": {x: height.modal for x, height in structure.heights.items() if x in drifts},
    }
