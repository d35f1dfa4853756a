"""Results of a run, for what is drawn and told of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from alphacut.case.content import Content
from alphacut.case.structure import Structure
from alphacut.frame import StoreyFrame
from alphacut.frame.structures.linear import frequencies
from alphacut.io.files import Document
from alphacut.io.quantity import STANDARD_GRAVITY
from alphacut.stages.envelope import EnvelopeResult, EnvelopeTask
from alphacut.stages.identify import LearnedResult
from alphacut.stages.image import ImageResult
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.shares import ShareTable
from alphacut.stages.store import Numbers, StageResult, Values
from alphacut.stages.suite import SuiteResult

AnyResult = StageResult[Any]
"""Result of one of several stages; its reader knows the type of its numbers."""


class FrameResult(Numbers):
    """A frame at its nominal inputs, with the height of the storey of each drift."""

    omega_rad_per_s: Values
    period_s: float
    weight_N: float
    heights_m: dict[str, float]


@dataclass
class Results:
    """Results of a run; None or empty where the case has no such stage.

    The structure has its modulus and what was learned; `tasks` are the studies, `envelopes` their
    results by name; answers stand by the keys of their questions.
    """

    content: Content
    microstructure: StageResult[Document] | None = None
    modulus: StageResult[ModulusResult] | None = None
    image: StageResult[ImageResult] | None = None
    structure: Structure | None = None
    tasks: tuple[EnvelopeTask, ...] = ()
    envelopes: dict[str, StageResult[EnvelopeResult]] = field(default_factory=dict)
    learned: LearnedResult | None = None
    suite: SuiteResult | None = None
    answers: dict[str, Numbers] = field(default_factory=dict)
    shares: StageResult[ShareTable] | None = None

    @property
    def is_paper(self) -> bool:
        """True if figures bear the paper's numbers."""
        return any(task.figures for task in self.tasks)

    @property
    def single(self) -> dict[str, AnyResult]:
        """Results of the stages that have one, by name."""
        results = {
            "microstructure": self.microstructure,
            "modulus": self.modulus,
            "image": self.image,
            "shares": self.shares,
        }
        return {name: result for name, result in results.items() if result is not None}

    @property
    def fingerprints(self) -> dict[str, str]:
        """Digest of what each result was made from, by the name of its stage."""
        studies = {f"envelope_{name}": result for name, result in self.envelopes.items()}
        return {name: x.fingerprint for name, x in {**self.single, **studies}.items()}

    @property
    def frame_result(self) -> FrameResult | None:
        """Numbers on the frame; None of another structure."""
        if self.structure is None or self.structure.frame is None:
            return None
        return frame_result(self.structure, self.structure.frame)

    @property
    def damping(self) -> dict[str, tuple[float, float, float]]:
        """Least, nominal and greatest damping ratios that the material gives, by name."""
        if self.structure is None or not self.content.has_material_damping:
            return {}
        return {
            name: (number.support.lower, number.modal, number.support.upper)
            for name, number in self.structure.numbers.items()
            if name.startswith("zeta")
        }


def frame_result(structure: Structure, frame: StoreyFrame) -> FrameResult:
    """Natural frequencies, first period and weight of a frame, and the heights of its storeys."""
    omega, drifts = frequencies(frame), set(structure.outputs)
    heights = {x: height.modal for x, height in structure.heights.items() if x in drifts}
    return FrameResult(
        omega_rad_per_s=omega,
        period_s=float(2 * np.pi / omega[0]),
        weight_N=sum(frame.masses) * float(STANDARD_GRAVITY),
        heights_m=heights,
    )
