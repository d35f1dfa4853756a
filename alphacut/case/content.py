"""The content of a case file: its sections, built once, and what they need of each other."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, create_model, model_validator

from alphacut.case.material import (
    Cell,
    ImageCell,
    Mesh,
    ModulusSection,
    RadiusMap,
    RoundCell,
)
from alphacut.case.motion import Envelope, Identify, Study
from alphacut.case.particles import Microstructure
from alphacut.case.structure import Frame, Pendulum, Structure
from alphacut.case.types import Section, Some, after, unlike
from alphacut.fuzzy.refused import require
from alphacut.questions.decision import Decision
from alphacut.questions.probability import Probability
from alphacut.questions.question import Question
from alphacut.questions.tolerances import Tolerances

Stage = Literal["microstructure", "modulus", "envelope"]
QUESTIONS: tuple[type[Question], ...] = (Probability, Decision, Tolerances)
"""Questions that a case may put to its motion."""


class Content(Section):
    """A case."""

    title: str = Field(description="one line, for figures and the report")
    about: str = Field(default="", description="a paragraph: what the case shows")
    stages: Annotated[tuple[Stage, ...], Some, after(unlike)] = Field(
        description="stages that `alphacut run` computes"
    )
    microstructure: Microstructure | None = None
    radius: RadiusMap | None = None
    cell: Cell | None = None
    mesh: Mesh = Mesh()
    modulus: ModulusSection = ModulusSection()
    frame: Frame | None = None
    pendulum: Pendulum | None = None
    study: tuple[Study, ...] = ()
    envelope: Envelope | None = None
    identify: Identify | None = None

    @property
    def questions(self) -> dict[str, Question]:
        """Sections of questions to the motion, by their keys."""
        every = {question.key: getattr(self, question.key, None) for question in QUESTIONS}
        return {key: section for key, section in every.items() if section is not None}

    @property
    def picture(self) -> ImageCell | None:
        """The cell if it is an image."""
        return self.cell if isinstance(self.cell, ImageCell) else None

    @property
    def round(self) -> RoundCell | None:
        """The cell if its particle is round."""
        return self.cell if isinstance(self.cell, RoundCell) else None

    @property
    def round_cell(self) -> tuple[RadiusMap, RoundCell]:
        """The radius map and the phases of a round particle.

        Raises:
            RefusedError: There is none.
        """
        there = self.radius is not None and self.round is not None
        require(there, "radius", None, "sections [radius] and [cell]")
        assert self.radius is not None
        assert self.round is not None
        return self.radius, self.round

    @property
    def structure(self) -> Structure | None:
        """The structure, with a stand-in for a modulus that is yet to be computed."""
        section = self.frame or self.pendulum
        return None if section is None else section.structure()

    @model_validator(mode="after")
    def _stages(self) -> Self:
        """Refuses stages without their sections."""
        known = self.picture is not None or "microstructure" in self.stages
        needs = {
            "microstructure": ("microstructure",),
            "modulus": ("cell",) if known else ("radius", "cell"),
            "envelope": ("envelope",),
        }
        for stage, section in ((x, y) for x in self.stages for y in needs[x]):
            there = getattr(self, section) is not None
            require(there, section, None, f"[{section}], which stage {stage} needs")
        one = "microstructure" not in self.stages or self.radius is None
        require(one, "radius", "beside stage microstructure", "one of them")
        if self.round is not None:
            methods = self.round.methods
            allowed, method = ", ".join(methods), self.modulus.method
            require(method in methods, "modulus.method", method, f"{allowed} for this cell")
        return self

    @model_validator(mode="after")
    def _motion(self) -> Self:
        """Refuses inputs and outputs that the structure does not have."""
        envelope, structure = self.envelope, self.structure
        if envelope is None or "envelope" not in self.stages:
            return self
        both = self.frame is not None and self.pendulum is not None
        value, allowed = "beside [pendulum]" if both else None, "one of [frame] and [pendulum]"
        require(structure is not None and not both, "frame", value, allowed)
        assert structure is not None
        whole = self.frame is None or self.frame.is_whole or "modulus" in self.stages
        require(whole, "frame.modulus", None, "a modulus, or stage modulus")
        own = Study.model_construct(fuzzy=envelope.fuzzy, duration=envelope.duration)
        studies = {"envelope": own} | {f"study[{k}]": x for k, x in enumerate(self.study)}
        for key, study in studies.items():
            made = {"E"} if "modulus" in self.stages else set()
            structure.inputs([x for x in study.fuzzy if x not in made], f"{key}.fuzzy")
            structure.require_outputs(f"{key}.figures", study.figures)
            envelope.require_steps(f"{key}.duration", study.duration)
        names = [study.name for study in self.study]
        for place, name in enumerate(names):
            require(name not in names[:place], f"study[{place}].name", name, "a name of its own")
        for section in self.questions.values():
            section.check(structure)
        if self.identify is not None:
            require(self.frame is not None, "identify", "without a frame", "beside [frame]")
            structure.inputs(self.identify.learn, "identify.learn")
        return self


_FIELDS: dict[str, Any] = {one.key: (one | None, None) for one in QUESTIONS}
CONTENT: type[Content] = create_model("CaseFile", __base__=Content, **_FIELDS)
"""The content of a case with a section for each question."""
