"""A whole case: its sections, built once, what they need of each other."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cached_property, partial
from pathlib import Path

from alphacut.base.errors import RefusedError, by_keys, require, require_choice
from alphacut.case.analyses import ANALYSES
from alphacut.case.cell import CellContent
from alphacut.case.generated import AnalysisSection, QuestionSection
from alphacut.case.loads import ForceSection, RecordsSection, with_forces
from alphacut.case.microstructure import MicrostructureSection
from alphacut.case.motion import EnvelopeSection, Identify, Study
from alphacut.case.parse import ParsedCase, parse
from alphacut.case.structure import MaterialDamping, Structure, StructureSection
from alphacut.case.structures import STRUCTURES, with_structures
from alphacut.case.types import AtFirstUse, require_alone
from alphacut.frame import METHODS, Limit
from alphacut.frame.structures.storey import yields
from alphacut.fuzzy import FuzzyNumber


class Content(CellContent):
    """A case, with the sections of its structure and of the analyses that it asks for.

    These stand in `alphacut.case.structures.STRUCTURES` and `alphacut.case.analyses.ANALYSES`.
    """

    microstructure: AtFirstUse[MicrostructureSection] | None = None
    records: AtFirstUse[RecordsSection] | None = None
    force: tuple[AtFirstUse[ForceSection], ...] = ()
    study: tuple[AtFirstUse[Study], ...] = ()
    envelope: AtFirstUse[EnvelopeSection] | None = None
    identify: AtFirstUse[Identify] | None = None

    def asked(self, stage: str = "envelope") -> dict[str, AnalysisSection]:
        """Return the sections of the analyses of a stage, by key in the order of the page.

        If the case has a structure, a limit of "drift", which means every storey, is replaced by
        one limit of each storey: drift1, drift2 …
        """
        # The fields of analyses are those of the class that `with_structures` derives from this.
        found: dict[str, AnalysisSection] = {}
        for key, analysis in ANALYSES.items():
            section = getattr(self, key, None)
            if section is not None and analysis.stage == stage:
                found[key] = section
                if self.structure is not None:
                    found[key] = section.with_storeys(self.structure)
        return found

    @property
    def asked_alone(self) -> list[AnalysisSection]:
        """The sections of analyses that are stages of their own, in the order of `stages`."""
        stages = [stage for stage in self.stages if stage != "envelope"]
        return [section for stage in stages for section in self.asked(stage).values()]

    @property
    def questions(self) -> dict[str, QuestionSection]:
        """Return those of the sections about the response that state limits of it, by key."""
        asked = self.asked().items()
        return {key: section for key, section in asked if isinstance(section, QuestionSection)}

    @property
    def incremental_question(self) -> QuestionSection | None:
        """The question of fragility, with one limit of each storey, if columns yield; else None."""
        is_of_yielding = self.structure is not None and yields(self.structure.model)
        return self.questions.get("fragility") if is_of_yielding else None

    @property
    def limited_outputs(self) -> tuple[str, ...]:
        """Return the names of the peaks over time whose bounds the questions need, each once.

        Questions are the sections with limits of the response, such as [decision]. Questions that
        compute responses themselves, instead of reading peaks of the envelope, are left out. A peak
        is named "q3" if it is the largest magnitude of the output q3, "max q3" or "min q3" if it is
        its largest or smallest value.
        """
        peaks: dict[str, None] = {}
        for section in self.questions.values():
            if not section.made_from.reads_peaks:
                continue
            for limit in section.limits:
                name = limit.peak
                # The mean over records follows from the peaks of the magnitude under each record.
                if limit.side == "mean":
                    name = limit.output
                peaks[name] = None
        return tuple(peaks)

    def limits_where_yielding(self, structure: Structure) -> tuple[Limit, ...]:
        """Return the limits, in SI units, to which the questions need the peaks of a structure.

        Peaks of linear structures are bounded closely in any case: they have none.
        """
        if not yields(structure.model):
            return ()
        asked = [x for x in self.questions.values() if x.made_from.reads_peaks]
        return tuple(side for x in asked for y in x.limits_of(structure) for side in y.one_sided)

    @property
    def component_count(self) -> int:
        """Number of components of each record; 0 without records."""
        return 0 if self.records is None else self.records.component_count

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
        # The fields of structures are those of the class that `with_structures` derives from this.
        sections = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: x for name, x in sections.items() if isinstance(x, StructureSection)}

    @property
    def structure_section(self) -> StructureSection | None:
        """The section of the structure, if the case has one."""
        return next(iter(self.structure_sections.values()), None)

    @cached_property
    def structure(self) -> Structure | None:
        """The structure, with stand-ins for what is yet to be computed; built once."""
        # Checks of a case ask for it many times, and to build it may read matrices from files.
        section = self.structure_section
        if section is None:
            return None
        return with_forces(section.nominal, self.force, section.places)

    def structure_of(
        self, modulus: FuzzyNumber | None = None, loss: FuzzyNumber | None = None
    ) -> Structure:
        """Return the structure of the case with the forces of [[force]].

        Args:
            modulus: Young's modulus in Pa, as stage modulus computes it; None for the modulus that
                the case states, or for 20 GPa if it states none.
            loss: Loss factor of the material, from which the damping ratios follow if the case asks
                for damping by the material; None for a stand-in of 2 %. It is ignored otherwise.

        Raises:
            RefusedError: The case has no structure, its values make none, or the structure cannot
                take one of the forces.
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
        """Refuse sections that do not fit each other. Pydantic calls it once all keys have values.

        Raises:
            RefusedError: Damping by the material has no loss factors; nothing moves the structure;
                a question does not fit the excitation; or stage envelope has not exactly one
                structure that can answer the studies and the questions.
        """
        super().require_consistent()
        # The damping of a structure by its material follows from the loss factor of the cell, which
        # is a result of stage modulus: a stand-in for it would look like a result.
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
        moves = not {"envelope", "response_spectrum"}.isdisjoint(self.stages)
        if moves and "matrices" in self.structure_sections:
            allowed = "pairs [factor, file]; stage static alone needs none"
            mass = getattr(self.structure_sections["matrices"], "mass", ())
            require(len(mass) > 0, "matrices.mass", None, allowed)
        if "envelope" in self.stages and self.envelope is not None:
            self._require_response(self.envelope, self._one_structure())
        for section in self.asked_alone:
            structure = self._one_structure()
            is_possible = self.identify is None or section.made_from.of_learned_set
            allowed = "without [identify], whose set is no box"
            require(is_possible, section.key, "beside [identify]", allowed)
            self._require_inputs(section.key, getattr(section, "fuzzy", ()), structure)
            self._require_modulus()
            section.require_answerable(structure, self.component_count)

    def _require_excitation(self) -> None:
        """Refuse a structure that starts at rest and has no loads.

        Loads are an accelerogram of the structure, a suite [records], or [[force]]. A case without
        a structure has nothing to refuse.

        Raises:
            RefusedError: Nothing moves the structure. Its key names the initial displacements.
        """
        section = self.structure_section
        if "envelope" not in self.stages and any(stage in ANALYSES for stage in self.stages):
            return  # the analysis has loads of its own
        # Without loads a structure at rest stays at rest, and bounds of that look like results.
        if section is None or section.moves_by_itself:
            return
        has_ground = section.nominal.model.ground is not None
        is_loaded = self.records is not None or has_ground or bool(self.force)
        allowed = "a start, an accelerogram, a section [records] or [[force]]"
        require(is_loaded, "frame.displacements", None, allowed, cure="nothing moves the frame")

    def _require_no_questions_to_records(self) -> None:
        """Refuse what only a suite of records answers."""
        for key, section in self.asked().items():
            is_answered = section.made_from.records != "needed"
            require(is_answered, key, "without records", "beside [records]")
        for key, question in self.questions.items():
            means = ", ".join(limit.text for limit in question.limits if limit.side == "mean")
            require(not means, f"{key}.limits", means, "a mean over records beside [records]")

    def _require_records_alone(self, records: RecordsSection) -> None:
        """Refuse what cannot stand beside a suite of ground motion records, [records].

        Refused are an accelerogram of the structure, a structure that no ground motion moves,
        components that are not those of the structure, and the sections [probability],
        [tolerances], [identify] and [[study]], which ask about one response, while a suite has one
        for each record; and floor spectra over all angles of incidence.

        Args:
            records: The section; the case has it.

        Raises:
            RefusedError: With the key that does not fit.
        """
        section = self.structure_section
        if section is not None:
            require_alone("records", section.nominal.model.ground is not None, "an accelerogram")
            section.require_pattern()
            self._require_directions(records, section)
        # For these sections it is not defined how results under several records make one result.
        refused = [key for key, x in self.asked().items() if x.made_from.records == "refused"]
        for key in (*refused, "identify", "study"):
            allowed = "[decision] and [fragility], of one motion for each record"
            require(not getattr(self, key), key, "beside [records]", allowed)

    def _require_directions(self, records: RecordsSection, section: StructureSection) -> None:
        """Refuse records whose components are not those of the structure.

        Args:
            records: The section.
            section: The structure.

        Raises:
            RefusedError: The ground moves in another number of directions; one side of an output is
                limited over all angles of incidence, where only magnitudes are bounded.
        """
        count = records.component_count
        expected = section.direction_count
        allowed = f"{expected} a record, one for each direction of the ground"
        cure = 'name the directions in [matrices], as directions = ["x", "y"]'
        require(count == expected, "records.files", f"{count} files a record", allowed, cure)
        for question in self.asked().values() if records.has_all_angles else ():
            question.require_all_angles()

    def _one_structure(self) -> Structure:
        """Return the structure of the case, without what later stages compute.

        Raises:
            RefusedError: The case has no section of a structure, such as [frame], or several.
        """
        structure = self.structure
        n_sections = len(self.structure_sections)
        if structure is None or n_sections > 1:
            value = None
            if n_sections:
                value = f"beside {n_sections - 1} more"
            names = [f"[{name}]" for name in sorted(STRUCTURES)]
            raise RefusedError("frame", value, f"one of {', '.join(names[:-1])} and {names[-1]}")
        return structure

    def _require_response(self, envelope: EnvelopeSection, structure: Structure) -> None:
        """Refuse studies and questions that the structure cannot answer.

        A [[study]] is an envelope with inputs, outputs and a duration of its own; questions are the
        sections with limits of the response, such as [decision].

        Args:
            envelope: What holds for all studies: method, integrator, α-levels, time step.
            structure: The structure, with a stand-in for what stage modulus computes.

        Raises:
            RefusedError: The method or the integrator does not suit columns that yield; an input,
                output or duration does not fit; two studies have the same name; no modulus is known
                or computed; a limit does not fit; or [identify] has no frame.
        """
        with by_keys("envelope.{}".format):
            from alphacut.frame.propagation import require_kinks  # takes time to import

            require_kinks(structure.model, METHODS[envelope.method])
            if envelope.integrator is not None:
                from alphacut.frame.dynamics.nonlinear import make_flow  # takes time to import

                make_flow(structure.model, (), envelope.step, envelope.step, envelope.integrator)
        # [envelope] is checked even where studies take its place, since questions are about its
        # response. It has no name, which validation of a study would ask for.
        main_study = Study.model_construct(fuzzy=envelope.fuzzy, duration=envelope.duration)
        self._require_study("envelope", main_study, envelope, structure)
        names: list[str] = []
        for number, study in enumerate(self.study, start=1):
            self._require_study(f"study[{number}]", study, envelope, structure)
            is_first = study.name not in names
            require(is_first, f"study[{number}].name", study.name, "a name of its own")
            names.append(study.name)
        self._require_modulus()
        for section in self.asked().values():
            section.require_answerable(structure, self.component_count)
        if self.identify is not None:
            require(structure.model.floors > 0, "identify", "without a frame", "beside [frame]")
            structure.inputs(self.identify.learn, "identify.learn")

    def _require_study(
        self, key: str, study: Study, envelope: EnvelopeSection, structure: Structure
    ) -> None:
        """Refuse inputs, outputs and a duration that do not fit the structure and its forces.

        Args:
            key: Section of the study, "envelope" or "study[2]", for messages.
            study: Names of its fuzzy inputs, of the outputs in its figures, and its duration in s.
            envelope: What holds for all studies; its time step must divide the duration.
            structure: The structure. Inputs that a stage will make fuzzy may still be crisp in it.

        Raises:
            RefusedError: An input is unknown or crisp, an output is unknown, the duration is no
                multiple of the time step, or a force begins only after the duration.
        """
        self._require_inputs(key, study.fuzzy, structure)
        for output in study.figures:
            require_choice(f"{key}.figures", output, structure.outputs)
        envelope.require_steps(f"{key}.duration", study.duration)
        # A force that begins after the end would act on nothing: a unit of time may be wrong.
        for number, force in enumerate(self.force, start=1):
            history = force.history.history
            if history is None:  # an impulse, at the start
                continue
            acts = history.start < study.duration
            value = f"from {history.start:g} s"
            require(acts, f"force[{number}].history", value, f"a start below {key}.duration")

    def _require_inputs(self, key: str, names: Sequence[str], structure: Structure) -> None:
        """Refuse inputs of a section that are unknown or crisp.

        Args:
            key: The section, for messages.
            names: Names of its fuzzy inputs.
            structure: The structure. Inputs that a stage will make fuzzy may still be crisp in it.
        """
        # Stage modulus computes Young's modulus E and, from the loss factor of the material, the
        # damping ratios: zeta of all modes, or zeta1, zeta2 … of each. They may be crisp in the
        # stand-in and fuzzy in the run, so that their width is not judged here.
        computed = "(?!)"  # which matches no name
        if self.has_material_damping:
            computed = r"E|zeta\d*"
        elif "modulus" in self.stages:
            computed = "E"
        stated = [name for name in names if not re.fullmatch(computed, name)]
        structure.inputs(stated, f"{key}.fuzzy")

    def _require_modulus(self) -> None:
        """Refuse columns whose modulus no stage computes."""
        has_modulus = self.has_stated_modulus or "modulus" in self.stages
        require(has_modulus, "frame.modulus", None, "a modulus, or stage modulus")


Case = ParsedCase[Content]


def load(path: Path | str, changes: Sequence[str] = ()) -> Case:
    """Read a case from a TOML file.

    Args:
        path: The file. Files that the case names are looked for in its folder.
        changes: Texts "KEY=VALUE", such as ``cell.matrix_modulus=20 GPa``, that replace keys of the
            file.

    Raises:
        BadInput: With every problem of the case at once, as one line each.
        RefusedError: The file cannot be read; or a change is no "KEY=VALUE", or its key is unknown
            or given twice.
    """
    return parse(partial(with_structures, Content, built=True), path, changes)
