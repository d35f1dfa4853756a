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
    Response,
    RoundCell,
)
from alphacut.case.motion import Envelope, Identify, Study
from alphacut.case.particles import Microstructure
from alphacut.case.structure import Structure
from alphacut.case.structures import Frame, Pendulum
from alphacut.case.types import Section, Some, after, unlike
from alphacut.fuzzy.refused import RefusedError
from alphacut.questions.question import Limited
from alphacut.questions.table import QUESTIONS

Stage = Literal["microstructure", "modulus", "envelope"]


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
    response: Response | None = None
    frame: Frame | None = None
    pendulum: Pendulum | None = None
    study: tuple[Study, ...] = ()
    envelope: Envelope | None = None
    identify: Identify | None = None

    @property
    def questions(self) -> dict[str, Limited]:
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
    def structure(self) -> Structure | None:
        """The structure, with a stand-in for a modulus that is yet to be computed."""
        section = self.frame or self.pendulum
        return None if section is None else section.structure()

    @model_validator(mode="after")
    def _stages(self) -> Self:
        """Refuses stages without their sections.

        Raises:
            RefusedError: One lacks a section, or sections do not go together.
        """
        needs = {
            "microstructure": ("microstructure",),
            "modulus": ("cell",)
            if self.picture or "microstructure" in self.stages
            else ("radius", "cell"),
            "envelope": ("envelope",),
        }
        for stage in self.stages:
            for section in needs[stage]:
                if getattr(self, section) is None:
                    raise RefusedError(section, None, f"[{section}], which stage {stage} needs")
        if "microstructure" in self.stages and self.radius is not None:
            raise RefusedError("radius", "beside stage microstructure", "one of them")
        spheres = self.round is not None and self.round.particles == "spheres"
        method, any_cell = self.modulus.method, self.round is not None and not self.round.square
        if (spheres and method in ("prism", "slices")) or (any_cell and method == "series"):
            other = "auto, slices or prism for ellipses or any stiffness"
            allowed = "series or auto for spheres" if spheres else other
            raise RefusedError("modulus.method", method, allowed)
        return self

    @model_validator(mode="after")
    def _motion(self) -> Self:
        """Refuses inputs and outputs that the structure does not have.

        Raises:
            RefusedError: There are some, or no structure.
        """
        envelope, structure = self.envelope, self.structure
        if envelope is None or "envelope" not in self.stages:
            return self
        if (self.frame is None) == (self.pendulum is None) or structure is None:
            value = None if self.frame is None else "beside [pendulum]"
            raise RefusedError("frame", value, "one of [frame] and [pendulum]")
        if self.frame and not self.frame.is_whole and "modulus" not in self.stages:
            raise RefusedError("frame.modulus", None, "a modulus, or stage modulus")
        fuzzy = [x for x in envelope.fuzzy if x != "E" or "modulus" not in self.stages]
        structure.inputs(fuzzy)
        envelope.require_steps("envelope.duration", envelope.duration)
        for place, study in enumerate(self.study):
            key = f"study[{place}]"
            own = [x for x in study.fuzzy if x != "E" or "modulus" not in self.stages]
            structure.inputs(own, f"{key}.fuzzy")
            structure.require_outputs(f"{key}.figures", study.figures)
            envelope.require_steps(f"{key}.duration", study.duration)
            if study.name in (other.name for other in self.study[:place]):
                raise RefusedError(f"{key}.name", study.name, "a name of its own")
        self._questions(structure)
        return self

    def _questions(self, structure: Structure) -> None:
        for key, section in self.questions.items():
            section.require(structure, key)
        if self.identify is not None:
            if self.frame is None:
                raise RefusedError("identify", "without a frame", "beside [frame]")
            structure.inputs(self.identify.learn, "identify.learn")


_FIELDS: dict[str, Any] = {one.key: (one.section | None, None) for one in QUESTIONS}
CONTENT: type[Content] = create_model("CaseFile", __base__=Content, **_FIELDS)
"""The content of a case with a section for each question."""
