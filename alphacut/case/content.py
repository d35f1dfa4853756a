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
        """Sections of questions to the motion, by their keys, with one limit of each storey."""
        sections = (self.probability, self.decision, self.tolerances, self.fragility)
        given, structure = [x for x in sections if x is not None], self.structure
        return {x.key: x if structure is None else x.with_storeys(structure) for x in given}

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
        sections = (section for section in self.questions.values() if section.reads_peaks)
        limits = (limit for section in sections for limit in section.limits)
        # the mean over records follows from the peaks under each
        peaks = (limit.output if limit.side == "mean" else limit.peak for limit in limits)
        return tuple(dict.fromkeys(peaks))

    @property
    def stated_fraction(self) -> float | None:
        """Fraction of the cell that the particles take as the case says, at its nominal value."""
        if self.microstructure is not None and self.microstructure.packing is not None:
            return self.microstructure.packing.fraction
        return super().stated_fraction

    @property
    def has_stated_modulus(self) -> bool:
        """True if the structure needs no modulus of a stage."""
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
        return None if section is None else with_forces(section.nominal, self.force, section.places)

    def structure_of(
        self, modulus: FuzzyNumber | None = None, loss: FuzzyNumber | None = None
    ) -> Structure:
        """The structure with its forces; RefusedError where there is none or takes no such force.

        `modulus` is Young's in Pa, the structure's own by default; `loss` the loss factor of its
        material, where the case takes damping from there.
        """
        section = self.structure_section
        if section is None:
            raise RefusedError("envelope", None, "a structure and a section [envelope]")
        return with_forces(section.structure(modulus, loss), self.force, section.places)

    @property
    def has_material_damping(self) -> bool:
        """True if the structure takes damping from the loss factors of its material."""
        ratios = getattr(self.structure_section, "damping_ratio", None)
        return isinstance(ratios, MaterialDamping)

    def require_consistent(self) -> None:
        """Refuses sections that do not fit each other."""
        super().require_consistent()
        if self.has_material_damping:
            has_losses = "modulus" in self.stages and bool(self.cell and self.cell.losses)
            key = f"{next(iter(self.structure_sections))}.damping_ratio"
            allowed = "stage modulus and loss factors in [cell], or a number"
            require(has_losses, key, "material", allowed)
        self._require_excitation()
        self._require_envelope()

    def _require_excitation(self) -> None:
        """Refuses a structure at rest without loads, and what a suite of records cannot answer."""
        section = self.structure_section
        ground = None if section is None else section.nominal.model.ground
        is_loaded = self.records is not None or ground is not None or bool(self.force)
        is_moved = is_loaded or section is None or section.moves_by_itself
        allowed = "a start, an accelerogram, a section [records] or [[force]]"
        cure = "nothing moves the frame"
        require(is_moved, "frame.displacements", None, allowed, cure=cure)
        if self.records is None:
            is_absent, allowed = self.fragility is None, "beside [records]"
            require(is_absent, "fragility", "without records", allowed)
            for key, question in self.questions.items():
                means = ", ".join(limit.text for limit in question.limits if limit.side == "mean")
                require(not means, f"{key}.limits", means, "a mean over records beside [records]")
            return
        require_alone("records", ground is not None, "an accelerogram")
        if section is not None:
            section.require_pattern()
        for key in ("probability", "tolerances", "identify", "study"):
            allowed = "[decision] and [fragility], of one motion for each record"
            require(not getattr(self, key), key, "beside [records]", allowed)

    def _require_envelope(self) -> None:
        envelope, structure = self.envelope, self.structure
        if envelope is None or "envelope" not in self.stages:
            return
        sections = self.structure_sections
        if structure is None or len(sections) > 1:
            value = None if structure is None else f"beside {len(sections) - 1} more"
            *names, last = (f"[{name}]" for name in sorted(STRUCTURES))
            allowed = f"one of {', '.join(names)} and {last}"
            raise RefusedError("frame", value, allowed)
        if yields(structure.model):
            allowed = "auto or quasi-monte-carlo where columns yield"
            is_possible = envelope.method in ("auto", "quasi-monte-carlo")
            require(is_possible, "envelope.method", envelope.method, allowed)
            is_exact, allowed = envelope.integrator != "midpoint", "exact where columns yield"
            require(is_exact, "envelope.integrator", envelope.integrator, allowed)
        main_study = Study.model_construct(fuzzy=envelope.fuzzy, duration=envelope.duration)
        self._require_study("envelope", main_study, envelope, structure)
        for number, study in enumerate(self.study, start=1):
            self._require_study(f"study[{number}]", study, envelope, structure)
        has_modulus = self.has_stated_modulus or "modulus" in self.stages
        require(has_modulus, "frame.modulus", None, "a modulus, or stage modulus")
        is_framed = self.identify is None or structure.model.floors > 0
        require(is_framed, "identify", "without a frame", "beside [frame]")
        names = [study.name for study in self.study]
        for number, name in enumerate(names, start=1):
            is_first = names.index(name) == number - 1
            require(is_first, f"study[{number}].name", name, "a name of its own")
        for section in self.questions.values():
            section.require_answerable(structure)
        if self.identify is not None:
            structure.inputs(self.identify.learn, "identify.learn")

    def _require_study(
        self, key: str, study: Study, envelope: EnvelopeSection, structure: Structure
    ) -> None:
        computed = "E" if "modulus" in self.stages else "(?!)"  # which matches no name
        if self.has_material_damping:
            computed = r"E|zeta\d*"
        stated = [name for name in study.fuzzy if not re.fullmatch(computed, name)]
        structure.inputs(stated, f"{key}.fuzzy")  # refuses unknown and crisp ones
        for output in study.figures:
            require_choice(f"{key}.figures", output, structure.outputs)
        envelope.require_steps(f"{key}.duration", study.duration)
        for number, (history, _) in enumerate((x.history for x in self.force), start=1):
            start, allowed = history.start if history else 0.0, f"a start below {key}.duration"
            require(
                start < study.duration, f"force[{number}].history", f"from {start:g} s", allowed
            )


Case = ParsedCase[Content]


def load(path: Path | str, changes: Sequence[str] = ()) -> Case:
    """Reads a TOML case file, with changes ``KEY=VALUE`` such as ``cell.matrix_modulus=20 GPa``.

    BadInput has every problem of the case.
    """
    return parse(with_structures(Content, built=True), path, changes)
