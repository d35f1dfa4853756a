"""The stages of a case, one after the other, each taken from its file while that is up to date."""

from __future__ import annotations

import json
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from alphacut.case.content import Content
from alphacut.case.loads import RecordsSection
from alphacut.case.structure import Structure
from alphacut.frame.questions.peaks import Peaks
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io.files import as_json, say
from alphacut.questions.all import questions_of
from alphacut.questions.question import FuzzyResponse, Question
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
from alphacut.stages.envelope import EnvelopeTask, peaks_from_document
from alphacut.stages.modulus import CellCampaign
from alphacut.stages.readiness import campaign_of, cut_record_warnings
from alphacut.stages.results import Results
from alphacut.stages.store import Stage, StageContext, StageResult, StageStore

if TYPE_CHECKING:
    import xarray


@dataclass
class Pipeline:
    """A run of the stages of a case; envelopes are computed side by side by `executor`."""

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
        """Computes every stage of the case; returns their results."""
        results, stages = self.results, self.content.stages
        if "microstructure" in stages:
            results.microstructure = self.compute_microstructure()
            radius = microstructure.radius_of(results.microstructure)
            results.content = self.content.model_copy(update={"radius": radius})
        if "modulus" in stages:
            self.compute_modulus()
        if "envelope" in stages:
            data = results.modulus if results.image is None else results.image
            self._compute_motion(self.structure(None if data is None else data.arrays))
        campaign = self.campaign if results.modulus is not None else None
        richest_task = max(results.tasks, key=lambda x: (len(x.fuzzy), x.duration), default=None)
        results.shares = self.store.take(shares.stage(campaign, results.structure, richest_task))
        return results

    def compute_microstructure(self) -> StageResult:
        """Result of stage microstructure: the radius map of the particles."""
        section = self.content.microstructure
        if section is None:
            raise RefusedError("microstructure", None, "a section [microstructure]")
        stage = microstructure.stage(section, self.content.has_spheres, self.figures)
        return self.store.take(stage)

    @property
    def campaign(self) -> CellCampaign:
        """Samples of a round cell."""
        return campaign_of(self.content, self.petsc)

    def compute_modulus(self) -> None:
        """Computes stage modulus, of an image or of samples of a cell, and checks its errors."""
        results, section = self.results, self.content.modulus
        if self.content.image_cell is not None:
            stage = image.stage(self.content.image_cell, section.alpha, section.average)
            results.image = self.store.take(stage)
            return
        results.modulus = data = self.store.take(modulus.stage(self.campaign))
        cell.require_tolerance(data.document["error"], section.tolerance)
        young = data.arrays["E"].transpose("alpha", "bound").values[-1]
        particles = self.campaign.cell.particles
        cell.require_bounds((young[0], young[1]), data.document["references"], particles)

    def structure(self, data: xarray.Dataset | None, key: str = "modulus") -> Structure:
        """The structure of the case with modulus and loss factor of stage modulus, else as stated.

        `key` is the option or key that names the data, for messages.
        """
        content, section = self.content, self.content.structure_section
        young = None if data is None else modulus.fuzzy_modulus(data, key)
        loss = None if data is None else modulus.fuzzy_loss(data)
        if section is None or content.envelope is None:
            raise RefusedError("envelope", None, "a structure and a section [envelope]")
        has_modulus = young is not None or content.has_stated_modulus
        allowed = "a modulus, or --modulus FILE.nc"
        require(has_modulus, "frame.modulus", value=None, allowed=allowed)
        has_damping = loss is not None or not content.has_material_damping
        allowed = "loss factors of the cell, or a number"
        require(has_damping, "frame.damping_ratio", value="material", allowed=allowed)
        return content.structure_of(young, loss)

    def compute_envelopes(self, structure: Structure, studies: bool = True) -> None:
        """Computes the envelopes of all studies, or of [envelope] alone, into the results."""
        assert self.content.envelope is not None
        results = self.results
        results.structure = structure
        for warning in cut_record_warnings(self.content, structure):
            say(f"warning: {warning}")
        section, content = self.content.envelope, self.content
        limited = content.limited_outputs
        results.tasks = envelope.tasks(section, content.study if studies else (), limited)
        longest_first = sorted(results.tasks, key=lambda task: -len(task.fuzzy) * task.duration)
        stages = [envelope.stage(structure, task) for task in longest_first]
        outcomes = self.store.take_all(stages, self.executor)
        for task in results.tasks:
            data = outcomes[f"envelope_{task.name}"]
            envelope.require_tolerance(data, task, structure)
            results.envelopes[task.name] = data

    def _compute_motion(self, structure: Structure) -> None:
        """Computes the identified inputs, then the suite of records or envelopes, and answers."""
        results, content = self.results, self.content
        assert content.envelope is not None
        (task,) = envelope.tasks(content.envelope, ())  # of [envelope] itself
        if content.identify is not None:
            measured, alpha = content.identify, task.section.alpha
            results.learned, structure = identify.identify_inputs(measured, structure, alpha)
        if content.records is not None:
            self._compute_suite(content.records, structure, task)
            return
        self.compute_envelopes(structure)
        peaks = self._limited_peaks(replace(task, limited=content.limited_outputs), structure)
        self._answer(self._response(structure, task, peaks))

    def _answer(self, response: FuzzyResponse) -> None:
        """Answers all questions of the case about a response, into the results."""
        for question in questions_of(self.content.questions):
            compute, inputs = partial(answer_of, question, response), [question.section, response]
            stage = Stage(question.key, inputs, ("fuzzy", "frame", "alphacut"), compute)
            self.results.answers[question.key] = self.store.take(stage).document

    def _compute_suite(
        self, section: RecordsSection, structure: Structure, task: EnvelopeTask
    ) -> None:
        """Computes peaks under each record of a suite, and answers about them, into the results."""
        results = self.results
        results.structure = structure
        mode = suite.nominal_mode(structure)
        records = suite.suite_records(section, task.section, structure)
        for warning in suite.suite_warnings(records):
            say(f"warning: {warning}")
        limited = self.content.limited_outputs or structure.outputs
        stages = suite.stages(structure, replace(task, limited=limited), records)
        outcomes = self.store.take_all(stages, self.executor)
        peaks = suite.peaks_by_record(outcomes, records, task.section.alpha)
        results.suite = json.loads(as_json(suite.document(peaks, records, mode)))
        worst = suite.with_means(suite.worst_peaks(peaks), peaks)
        response = self._response(structure, task, worst)
        self._answer(replace(response, suite=suite.suite_response(peaks, records, mode)))

    def _response(
        self, structure: Structure, task: EnvelopeTask, peaks: Peaks | None
    ) -> FuzzyResponse:
        """The fuzzy response of [envelope], about which questions are asked."""
        alpha, step = task.section.alpha, task.section.step
        return FuzzyResponse(structure, task.fuzzy, alpha, task.duration, step, peaks)

    def _limited_peaks(self, task: EnvelopeTask, structure: Structure) -> Peaks | None:
        """Peaks for questions: of the study with [envelope]'s motion, else computed alone."""
        alpha = task.section.alpha
        for study in self.results.tasks:
            if study.has_motion_of(task.section):
                document = self.results.envelopes[study.name].document
                return peaks_from_document(document["peak"], alpha)
        if not task.limited:
            return None
        inputs = [structure.model, structure.numbers, task]
        compute = partial(task.compute_peaks, structure)
        result = self.store.take(Stage("peaks", inputs, ("fuzzy", "frame"), compute))
        return peaks_from_document(result.document["peak"], alpha)


def answer_of(question: Question, response: FuzzyResponse, context: StageContext) -> StageResult:
    """The answer to a question about a response."""
    return StageResult(question.answer(replace(response, progress=context.tick)))
