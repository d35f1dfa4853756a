"""A whole case: its sections, built once, what they need of each other."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

from alphacut.base.errors import RefusedError, require, require_choice
from alphacut.case.cell import CellContent
from alphacut.case.limits import (
    DecisionSection,
    FragilitySection,
    ProbabilitySection,
    QuestionSection,
    TolerancesSection,
)
from alphacut.case.loads import ForceSection, RecordsSection, with_forces
from alphacut.case.microstructure import MicrostructureSection
from alphacut.case.motion import EnvelopeSection, Identify, Study
from alphacut.case.parse import ParsedCase, parse
from alphacut.case.structure import MaterialDamping, Structure, StructureSection
from alphacut.case.structures import STRUCTURES, with_structures
from alphacut.case.types import require_alone
from alphacut.frame.structures.storey import yields
from alphacut.fuzzy import FuzzyNumber


class Content(CellContent):
    """A case, with one section of `alphacut.case.structures.STRUCTURES` for its structure."""

    microstructure: MicrostructureSection | None = None
    records: RecordsSection | None = None
    force: tuple[ForceSection, ...] = ()
    study: tuple[Study, ...] = ()
    envelope: EnvelopeSection | None = None
    identify: Identify | None = None
    probability: ProbabilitySection | None = None
    decision: DecisionSection | None = None
    tolerances: TolerancesSection | None = None
    fragility: FragilitySection | None = None

    @property
    def questions(self) -> dict[str, QuestionSection]:
        """Sections of questions about the response by key, with one limit of each storey."""
        questions: dict[str, QuestionSection] = {}
        for section in (self.probability, self.decision, self.tolerances, self.fragility):
            if section is not None:
                questions[section.key] = section
                if self.structure is not None:
                    questions[section.key] = section.with_storeys(self.structure)
        return questions

    @property
    def incremental_question(self) -> FragilitySection | None:
        """The question of fragility, with one limit of each storey, if columns yield; else None."""
        question, structure = self.fragility, self.structure
        if question is None or structure is None or not yields(structure.model):
            return None
        return question.with_storeys(structure)

    @property
    def limited_outputs(self) -> tuple[str, ...]:
        """Peaks that questions compare with limits, each once, such as q3 and max q3."""
        peaks: dict[str, None] = {}
        for section in self.questions.values():
            if not section.reads_peaks:
                continue
            for limit in section.limits:
                is_mean = limit.side == "mean"  # over records; it follows from the peaks under each
                peaks[limit.output if is_mean else limit.peak] = None
        return tuple(peaks)

    @property
    def stated_fraction(self) -> float | None:
        """Fraction of the cell that the particles take as the case says, at its nominal value."""
        if self.microstructure is not None and self.microstructure.packing is not None:
            return self.microstructure.packing.fraction
        return super().stated_fraction

    @property
    def has_stated_modulus(self) -> bool:
        """Whether the structure needs no modulus of a stage."""
        section = self.structure_section
        return section is None or not section.needs_modulus

    @property
    def structure_sections(self) -> dict[str, StructureSection]:
        """The sections of structures in the case, of which there may be one, by their names."""
        sections = {name: getattr(self, name, None) for name in STRUCTURES}
        return {name: section for name, section in sections.items() if section is not None}

    @property
    def structure_section(self) -> StructureSection | None:
        """The section of the structure, if the case has one."""
        return next(iter(self.structure_sections.values()), None)

    @cached_property
    def structure(self) -> Structure | None:
        """The structure, with stand-ins for what is yet to be computed; built once."""
        section = self.structure_section
        if section is None:
            return None
        return with_forces(section.nominal, self.force, section.places)

    def structure_of(
        self, modulus: FuzzyNumber | None = None, loss: FuzzyNumber | None = None
    ) -> Structure:
        """Return the structure with its forces.

        Args:
            modulus: Young's modulus in Pa; the structure's own if not given.
            loss: Loss factor of its material, where the case takes damping from there.

        Raises:
            RefusedError: The case has no structure, or it takes no such force.
        """
        section = self.structure_section
        if section is None:
            raise RefusedError("envelope", None, "a structure and a section [envelope]")
        return with_forces(section.structure(modulus, loss), self.force, section.places)

    @property
    def has_material_damping(self) -> bool:
        """Whether the structure takes damping from the loss factors of its material."""
        ratios = getattr(self.structure_section, "damping_ratio", None)
        return isinstance(ratios, MaterialDamping)

    def require_consistent(self) -> None:
        """Refuse sections that do not fit each other."""
        super().require_consistent()
        # the loss factor of the material is that which stage modulus computes
        if self.has_material_damping:
            has_losses = "modulus" in self.stages and bool(self.cell and self.cell.losses)
            key = f"{next(iter(self.structure_sections))}.damping_ratio"
            allowed = "stage modulus and loss factors in [cell], or a number"
            require(has_losses, key, "material", allowed)
        self._require_excitation()
        if self.records is None:
            self._require_no_questions_to_records()
        else:
            self._require_records_alone(self.records)
        if "envelope" in self.stages and self.envelope is not None:
            self._require_response(self.envelope, self._one_structure())

    def _require_excitation(self) -> None:
        """Refuse a structure at rest without loads."""
        section = self.structure_section
        # Without loads a structure at rest stays at rest, and bounds of that look like results.
        if section is None or section.moves_by_itself:
            return
        has_ground = section.nominal.model.ground is not None
        is_loaded = self.records is not None or has_ground or bool(self.force)
        allowed = "a start, an accelerogram, a section [records] or [[force]]"
        require(is_loaded, "frame.displacements", None, allowed, cure="nothing moves the frame")

    def _require_no_questions_to_records(self) -> None:
        """Refuse what only a suite of records answers."""
        require(self.fragility is None, "fragility", "without records", "beside [records]")
        for key, question in self.questions.items():
            means = ", ".join(limit.text for limit in question.limits if limit.side == "mean")
            require(not means, f"{key}.limits", means, "a mean over records beside [records]")

    def _require_records_alone(self, records: RecordsSection) -> None:
        """Refuse another excitation of the ground, and what a suite of records cannot answer."""
        section = self.structure_section
        if section is not None:
            has_ground = section.nominal.model.ground is not None
            require_alone("records", has_ground, "an accelerogram")
            section.require_pattern()
        # these ask for one response, and a suite has one for each record
        for key in ("probability", "tolerances", "identify", "study"):
            allowed = "[decision] and [fragility], of one motion for each record"
            require(not getattr(self, key), key, "beside [records]", allowed)

    def _one_structure(self) -> Structure:
        """Return the structure; refuse a case with none or several."""
        structure = self.structure
        n_sections = len(self.structure_sections)
        if structure is None or n_sections > 1:
            value = None
            if n_sections:
                value = f"beside {n_sections - 1} more"
            *names, last = (f"[{name}]" for name in sorted(STRUCTURES))
            raise RefusedError("frame", value, f"one of {', '.join(names)} and {last}")
        return structure

    def _require_response(self, envelope: EnvelopeSection, structure: Structure) -> None:
        """Refuse studies and questions that the structure cannot answer."""
        # the response of columns that yield has kinks where they do, and proofs and followers need
        # derivatives by the inputs
        if yields(structure.model):
            allowed = "auto or quasi-monte-carlo where columns yield"
            is_possible = envelope.method in ("auto", "quasi-monte-carlo")
            require(is_possible, "envelope.method", envelope.method, allowed)
            is_exact = envelope.integrator != "midpoint"
            allowed = "exact where columns yield"
            require(is_exact, "envelope.integrator", envelope.integrator, allowed)
        main_study = Study.model_construct(fuzzy=envelope.fuzzy, duration=envelope.duration)
        self._require_study("envelope", main_study, envelope, structure)
        names: list[str] = []
        for number, study in enumerate(self.study, start=1):
            self._require_study(f"study[{number}]", study, envelope, structure)
            is_first = study.name not in names
            require(is_first, f"study[{number}].name", study.name, "a name of its own")
            names.append(study.name)
        has_modulus = self.has_stated_modulus or "modulus" in self.stages
        require(has_modulus, "frame.modulus", None, "a modulus, or stage modulus")
        for section in self.questions.values():
            section.require_answerable(structure)
        if self.identify is not None:
            is_framed = structure.model.floors > 0
            require(is_framed, "identify", "without a frame", "beside [frame]")
            structure.inputs(self.identify.learn, "identify.learn")

    def _require_study(
        self, key: str, study: Study, envelope: EnvelopeSection, structure: Structure
    ) -> None:
        """Refuse inputs, outputs and a duration that do not fit the structure and its forces.

        Args:
            key: Name of the study's section, for messages.
            study: The study.
            envelope: What holds for all studies.
            structure: The structure. What a stage will make fuzzy may be crisp in it.
        """
        computed = "(?!)"  # which matches no name
        if self.has_material_damping:
            computed = r"E|zeta\d*"
        elif "modulus" in self.stages:
            computed = "E"
        # what a stage computes may be crisp in the stand-in and fuzzy in the run
        stated = [name for name in study.fuzzy if not re.fullmatch(computed, name)]
        structure.inputs(stated, f"{key}.fuzzy")
        for output in study.figures:
            require_choice(f"{key}.figures", output, structure.outputs)
        envelope.require_steps(f"{key}.duration", study.duration)
        for number, force in enumerate(self.force, start=1):
            history = force.history.history
            if history is None:
                continue
            acts = history.start < study.duration
            value, allowed = f"from {history.start:g} s", f"a start below {key}.duration"
            require(acts, f"force[{number}].history", value, allowed)


Case = ParsedCase[Content]


def load(path: Path | str, changes: Sequence[str] = ()) -> Case:
    """Read a TOML case file, with changes ``KEY=VALUE`` such as ``cell.matrix_modulus=20 GPa``.

    Raises:
        BadInput: With every problem of the case.
    """
    return parse(with_structures(Content, built=True), path, changes)
