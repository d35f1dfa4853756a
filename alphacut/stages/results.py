"""Results of a run as objects, and their summary in numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.case.content import Content
from alphacut.case.structure import Structure
from alphacut.frame.structures.linear import frequencies
from alphacut.io.files import Document
from alphacut.io.units import STANDARD_GRAVITY
from alphacut.stages import envelope, microstructure, modulus, response
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.identify import Learned, narrower

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Results:
    """Datasets of a run; None or empty where the case has no such stage.

    Args:
        folder: Where the files are.
        content: Sections of the case.
        microstructure: Particles and their map.
        modulus: Fuzzy modulus of a round cell.
        image: Proved modulus of an image.
        response: Random stress of the cell.
        references: Analytical bounds and estimate of E.
        structure: The structure with its modulus, and with what was learned.
        tasks: The studies.
        envelopes: Their datasets by name.
        learned: Inputs after measured modes.
        update: Inputs and envelope before and after them.
        answers: Answers to the questions of the case, by their keys.
        shares: Shares of the inputs in the widths.
    """

    folder: Path
    content: Content
    microstructure: xarray.Dataset | None = None
    modulus: xarray.Dataset | None = None
    image: xarray.Dataset | None = None
    response: xarray.Dataset | None = None
    references: Document = field(default_factory=dict)
    structure: Structure | None = None
    tasks: tuple[EnvelopeTask, ...] = ()
    envelopes: Mapping[str, xarray.Dataset] = field(default_factory=dict)
    learned: Learned | None = None
    update: xarray.Dataset | None = None
    answers: Mapping[str, Document] = field(default_factory=dict)
    shares: xarray.Dataset | None = None

    @property
    def is_paper(self) -> bool:
        """True if figures bear the paper's numbers."""
        return any(task.figures for task in self.tasks)

    @property
    def datasets(self) -> dict[str, xarray.Dataset]:
        """Every dataset by the name of its file without ending."""
        names = ("microstructure", "modulus", "image", "response", "update", "shares")
        every = {name: getattr(self, name) for name in names}
        every |= {f"envelope_{name}": data for name, data in self.envelopes.items()}
        return {name: data for name, data in every.items() if data is not None}

    def document(self) -> Document:
        """Everything in numbers, for summary.json."""
        return {**self._material(), **self._motion(), **self.answers}

    def _material(self) -> Document:
        numbers: dict[str, Any] = {}
        if self.microstructure is not None:
            numbers["microstructure"] = microstructure.document(self.microstructure)
        if self.modulus is not None:
            numbers["modulus"] = modulus.document(self.modulus) | {"references": self.references}
        if self.image is not None:
            numbers["image"] = json.loads(self.image.attrs["document"])
        if self.response is not None:
            numbers["response"] = response.document(self.response)
        return numbers

    def _motion(self) -> Document:
        numbers: dict[str, Any] = {}
        if self.structure is not None and self.structure.linear is not None:
            omega = frequencies(self.structure.linear)
            numbers["structure"] = {"omega_rad_per_s": omega, "period_s": 2 * np.pi / omega[0]}
            numbers["structure"] |= sizes(self.structure)
        if self.envelopes:
            of = {task.name: task for task in self.tasks}
            numbers["envelopes"] = {
                name: envelope.document(data, of[name].fuzzy) | {"drawn": of[name].output}
                for name, data in self.envelopes.items()
            }
        if self.learned is not None:
            numbers["update"] = self.learned.document()
            if self.update is not None and self.learned.posterior is not None:
                numbers["update"]["envelope_width"] = narrower(self.update)
        return numbers


def sizes(structure: Structure) -> Document:
    """Weight of a storey frame in N, and the height in m of the storey of each drift."""
    if structure.frame is None:
        return {}
    modal = {name: number.modal for name, number in structure.numbers.items()}
    masses = [modal[f"m{floor}"] for floor in range(1, len(structure.frame.masses) + 1)]
    drifts = [name for name in structure.outputs if name.startswith("drift")]
    heights = {name: modal.get(name.replace("drift", "l")) for name in drifts}
    weight = sum(masses) * float(STANDARD_GRAVITY)
    return {"weight_N": weight, "heights_m": {x: height for x, height in heights.items() if height}}
