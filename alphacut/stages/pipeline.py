"""The stages of a case, one after the other, each taken from its file while that is up to date."""

from __future__ import annotations

import json
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from alphacut.case.content import Content
from alphacut.case.records import RecordsSection
from alphacut.case.structure import MaterialDamping, Structure
from alphacut.frame.questions.peaks import Peaks
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io.files import as_json, say
from alphacut.questions.all import questions_of
from alphacut.questions.question import Motion, Question
from alphacut.stages import (
    cell,
    envelope,
    identify,
    image,
    microstructure,
    modulus,
    shares,
    suite,
)
from alphacut.stages.envelope import EnvelopeTask, peaks_of
from alphacut.stages.modulus import CellCampaign
from alphacut.stages.readiness import campaign_of, cut_record_warnings
from alphacut.stages.results import Results
from alphacut.stages.store import Stage, StageResult, StageStore, Work

if TYPE_CHECKING:
    import xarray


@dataclass
class Pipeline:
    """A run of the stages of a case.

    Args:
        results: Where the results go; of the stages before, what is there.
        store: Store of the results.
        petsc: PETSc options that override the solver's.
        figures: Whether the particles are drawn.
        executor: Processes that compute envelopes side by side.
    """

    results: Results
    store: StageStore
    petsc: Mapping[str, str] = field(default_factory=dict)
    figures: bool = True
    executor: Executor | None = None

    @property
    def content(self) -> Content:
        """The sections of the case."""
        return self.results.content

    def run(self) -> Results:
        """The results of every stage."""
        results, stages = self.results, self.content.stages
        if "microstructure" in stages:
            results.microstructure = self.particles()
            radius = microstructure.radius_of(results.microstructure)
            results.content = self.content.model_copy(update={"radius": radius})
        if "modulus" in stages:
            self.material()
        if "envelope" in stages:
            data = results.modulus if results.image is None else results.image
            self._motion(self.structure(None if data is None else data.arrays))
        samples = self.campaign if results.modulus is not None else None
        task = max(results.tasks, key=lambda x: (len(x.fuzzy), x.duration), default=None)
        results.shares = self.store.take(shares.stage(samples, results.structure, task))
        return results

    def particles(self) -> StageResult:
        """The particles and their radius map."""
        section = self.content.microstructure
        if section is None:
            raise RefusedError("microstructure", None, "a section [microstructure]")
        stage = microstructure.stage(section, self.content.has_spheres, self.figures)
        return self.store.take(stage)

    @property
    def campaign(self) -> CellCampaign:
        """Samples of a round cell."""
        return campaign_of(self.content, self.petsc)

    def material(self) -> None:
        """The modulus of the cell, round or an image."""
        results, section = self.results, self.content.modulus
        if self.content.picture is not None:
            stage = image.stage(self.content.picture, section.alpha, section.average)
            results.image = self.store.take(stage)
            return
        results.modulus = data = self.store.take(modulus.stage(self.campaign))
        cell.require_tolerance(data.document["error"], section.tolerance)
        young = data.arrays["E"].transpose("alpha", "bound").values[-1]
        particles = self.campaign.cell.particles
        cell.require_bounds((young[0], young[1]), data.document["references"], particles)

    def structure(self, data: xarray.Dataset | None, key: str = "modulus") -> Structure:
        """The structure with the modulus and the loss factor of a stage, None for its own.

        Args:
            data: Result of stage modulus.
            key: Where it comes from.
        """
        content, number = self.content, None if data is None else modulus.number_of(data, key)
        loss = None if data is None else modulus.loss_of(data)
        section = content.structure_section
        if section is None or content.envelope is None:
            raise RefusedError("envelope", None, "a structure and a section [envelope]")
        require(
            number is not None or content.has_own_modulus,
            "frame.modulus",
            value=None,
            allowed="a modulus, or --modulus FILE.nc",
        )
        by_material = isinstance(getattr(section, "damping_ratio", None), MaterialDamping)
        allowed = "loss factors of the cell, or a number"
        is_stated = loss is not None or not by_material
        require(is_stated, "frame.damping_ratio", value="material", allowed=allowed)
        return content.structure_of(number, loss)

    def motion(self, structure: Structure, studies: bool = True) -> None:
        """Envelopes of the structure, of every study or of [envelope] alone."""
        assert self.content.envelope is not None
        results = self.results
        results.structure = structure
        for words in cut_record_warnings(self.content, structure):
            say(f"warning: {words}")
        section, content = self.content.envelope, self.content
        limited = content.limited_outputs
        results.tasks = envelope.tasks(section, content.study if studies else (), limited)
        longest = sorted(results.tasks, key=lambda task: -len(task.fuzzy) * task.duration)
        stages = [envelope.stage(structure, task) for task in longest]
        outcomes = self.store.take_all(stages, self.executor)
        for task in results.tasks:
            data = outcomes[f"envelope_{task.name}"]
            envelope.require_tolerance(data, task, structure)
            results.envelopes[task.name] = data

    def _motion(self, structure: Structure) -> None:
        """Envelopes after what was identified, and the answers to what the case asks of them."""
        results, content = self.results, self.content
        assert content.envelope is not None
        (task,) = envelope.tasks(content.envelope, ())
        if content.identify is not None:
            measured, alpha = content.identify, task.section.alpha
            results.learned, structure = identify.identify_inputs(measured, structure, alpha)
        if content.records is not None:
            self._suite(content.records, structure, task)
            return
        self.motion(structure)
        peaks = self._peaks(replace(task, limited=content.limited_outputs), structure)
        times = (task.section.alpha, task.duration, task.section.step)
        self._answer(Motion(structure, task.fuzzy, *times, peaks))

    def _answer(self, motion: Motion) -> None:
        """Answers to what the case asks of a motion."""
        for question in questions_of(self.content.questions):
            compute, inputs = partial(answer_of, question, motion), [question.section, motion]
            stage = Stage(question.key, inputs, ("fuzzy", "frame", "alphacut"), compute)
            self.results.answers[question.key] = self.store.take(stage).document

    def _suite(self, section: RecordsSection, structure: Structure, task: EnvelopeTask) -> None:
        """Peaks under each record of a suite, and the answers to what the case asks of them."""
        results = self.results
        results.structure = structure
        mode = suite.nominal_mode(structure)
        records = suite.suite(section, task.section, structure)
        for words in suite.suite_warnings(records):
            say(f"warning: {words}")
        limited = self.content.limited_outputs or structure.outputs
        stages = suite.stages(structure, replace(task, limited=limited), records)
        outcomes = self.store.take_all(stages, self.executor)
        peaks = suite.peaks_by_record(outcomes, records, task.section.alpha)
        results.suite = json.loads(as_json(suite.document(peaks, records, mode)))
        times = (task.section.alpha, task.duration, task.section.step)
        moved = suite.motion(peaks, records, mode)
        worst = suite.with_means(suite.worst_peaks(peaks), peaks)
        self._answer(Motion(structure, task.fuzzy, *times, worst, moved))

    def _peaks(self, task: EnvelopeTask, structure: Structure) -> Peaks | None:
        """Peaks of the motion of [envelope]: of the study that has it, else of limited outputs."""
        alpha = task.section.alpha
        for study in self.results.tasks:
            if study.is_motion_of(task.section):
                return peaks_of(self.results.envelopes[study.name].document["peak"], alpha)
        if not task.limited:
            return None
        inputs = [structure.model, structure.numbers, task]
        compute = partial(task.compute_peaks, structure)
        result = self.store.take(Stage("peaks", inputs, ("fuzzy", "frame"), compute))
        return peaks_of(result.document["peak"], alpha)


def answer_of(question: Question, motion: Motion, work: Work) -> StageResult:
    """The answer to a question about a motion."""
    return StageResult(question.answer(replace(motion, progress=work.tick)))
