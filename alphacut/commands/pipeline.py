"""The case and results of a command; the stages of a case, one after the other, and their needs."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from alphacut import frame
from alphacut.base.errors import FailedError, RefusedError, require
from alphacut.base.kept_files import locked
from alphacut.base.progress_bar import progress_reporter
from alphacut.case.content import Case, Content, load
from alphacut.case.loads import RecordsSection
from alphacut.case.material import RadiusMapSection, ThetaSection
from alphacut.case.microstructure import MicrostructureSection
from alphacut.case.motion import EnvelopeSection
from alphacut.case.structure import Structure
from alphacut.commands.options import require_petsc
from alphacut.frame.analyses.incremental import Increments
from alphacut.frame.analyses.peaks import Peak, Peaks
from alphacut.io.files import Document, rank, require_writable, say
from alphacut.io.results import MANIFEST, ResultsFolder
from alphacut.rve.image.fields.grid import device_array
from alphacut.rve.image.study import ImageStudy
from alphacut.stages import (
    answers,
    cell,
    envelope,
    identify,
    image,
    microstructure,
    modulus,
    shares,
    suite,
)
from alphacut.stages.answers import ANSWERS, Response
from alphacut.stages.cell import CellProblem
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.foreseen import possible_materials, structure_as_computed
from alphacut.stages.modulus import fuzzy_loss, fuzzy_modulus, require_levels
from alphacut.stages.store import (
    RunProgress,
    Stage,
    StageResult,
    StageStore,
    no_progress,
)
from alphacut.stages.summary import Results
from alphacut.stochastic import FittedRadiusMap


def read_case(options: argparse.Namespace) -> Case:
    """The case file that the options name, with the changes of ``--set``."""
    case = load(options.case, options.set)
    require_petsc(options.petsc, case.content)
    return case


@contextmanager
def open_results(
    options: argparse.Namespace, folder: str = ""
) -> Iterator[tuple[Case, StageStore]]:
    """Yields the case and the store of its results, whose folder is locked during the block.

    `folder` is that of the results where ``--out`` is left out; empty to write nothing.
    """
    require(options.workers >= 1, "--workers", options.workers, "a whole number 1 or more")
    case, path, fresh = read_case(options), options.out or folder, getattr(options, "fresh", False)
    if (device := getattr(options, "device", "cpu")) != "cpu":
        has_image, allowed = case.content.image_cell is not None, "cpu for a case without an image"
        require(has_image, "--device", device, allowed)
        device_array(device)  # refuses one that is not there before a folder is made
    if path:
        require_writable("--out", path, folder=True)
    lock = locked("--out", Path(path)) if path and rank() == 0 else nullcontext()
    with progress_reporter(not options.quiet and rank() == 0) as tick, lock:
        results = ResultsFolder.read(Path(path)) if path else None
        if results is not None:
            results.require_own_files("--out")
        if results is not None and results.is_damaged:
            say(f"warning: {results.path / MANIFEST} is damaged; everything is computed anew")
        if results is not None and fresh and rank() == 0:
            results.clear()
        progress = RunProgress(tick or no_progress)
        yield case, StageStore(results, case.text, fresh, options.workers, progress)


@dataclass
class Pipeline:
    """A run of the stages of a case; envelopes are computed side by side by `executor`."""

    results: Results
    store: StageStore
    petsc: Mapping[str, str] = field(default_factory=dict)
    figures: bool = True
    executor: Executor | None = None
    device: str = "cpu"

    @property
    def content(self) -> Content:
        """The sections of the case."""
        return self.results.content

    @property
    def campaign(self) -> CellProblem:
        """Samples of a cell that is no image."""
        return CellProblem.of(self.content, self.petsc)

    def run(self) -> Results:
        """Computes every stage of the case; returns their results."""
        results, stages, content = self.results, self.content.stages, self.content
        kinds: list[str] = [stage for stage in stages if stage != "envelope"]
        if "envelope" in stages and content.records is not None:
            n_records, is_scaled = len(content.records.recordings), content.incremental_question
            kinds += ["record"] * n_records + ["incremental"] * bool(is_scaled) * n_records
        elif "envelope" in stages:
            kinds += ["envelope"] * max(1, len(content.study))
        kinds += [*content.questions, *["shares"] * content.shares, *["figures"] * self.figures]
        self.store.progress.foresee(kinds)
        if "microstructure" in stages:
            results.microstructure = self.compute_microstructure()
            numbers = results.microstructure.numbers["radius"]
            radius = RadiusMapSection.model_validate(numbers)
            results.content = self.content.model_copy(update={"radius": radius})
        if "modulus" in stages:
            self.compute_modulus()
        if "envelope" in stages:
            self._compute_motion()
        cells = self.campaign if results.modulus is not None else None
        richest_task = max(results.tasks, key=lambda x: (len(x.fuzzy), x.duration), default=None)
        if content.shares:
            peaks = results.envelopes[richest_task.name].numbers.peak if richest_task else {}
            stage = shares.stage(cells, results.structure, richest_task, peaks)
            results.shares = self.store.take(stage)
        return results

    def compute_microstructure(self) -> StageResult[Document]:
        """Result of stage microstructure: the radius map of the particles."""
        section = self.content.microstructure
        if section is None:
            raise RefusedError("microstructure", None, "a section [microstructure]")
        draw = _draw_microstructure if self.figures else None
        stage = microstructure.stage(section, spheres=self.content.has_spheres, draw=draw)
        return self.store.take(stage)

    def compute_modulus(self) -> None:
        """Computes stage modulus, of an image or of samples of a cell, and checks its errors."""
        results, section = self.results, self.content.modulus
        if self.content.image_cell is not None:
            image_cell = self.content.image_cell
            stage = image.stage(image_cell, section.alpha, section.average, self.device)
            results.image = self.store.take(stage)
            return
        self.campaign.require_mesh()  # once, not by each sample
        results.modulus = self.store.take(modulus.stage(self.campaign))
        numbers = results.modulus.numbers
        cell.require_tolerance(numbers.error, section.tolerance)
        top = float(numbers.E_GPa.lower[-1]), float(numbers.E_GPa.upper[-1])
        cell.require_bounds(top, numbers.references, numbers.particles)

    def _compute_motion(self) -> None:
        """Computes the identified inputs, then the suite of records or envelopes, and answers."""
        results, content, section = self.results, self.content, self.content.envelope
        assert section is not None
        data, structure = results.modulus or results.image, content.structure
        if data is not None:
            structure = content.structure_of(fuzzy_modulus(data.arrays), fuzzy_loss(data.arrays))
        assert structure is not None
        if content.identify is not None:
            learned = identify.identify_inputs(content.identify, structure, section.alpha)
            results.learned, structure = learned
        results.structure = structure
        (task,) = envelope.tasks(section, ())  # of [envelope] itself
        if content.records is not None:
            response = self._suite_response(content.records, structure, task)
        else:
            self._compute_envelopes(structure, section)
            peaks = self._limited_peaks(replace(task, limited=content.limited_outputs), structure)
            response = Response(structure, task, peaks)
        for kind in ANSWERS:
            if (question := content.questions.get(kind.key)) is not None:
                stage = answers.stage(kind, question, response)
                results.answers[kind.key] = self.store.take(stage).numbers

    def _compute_envelopes(self, structure: Structure, section: EnvelopeSection) -> None:
        results, content = self.results, self.content
        for warning in cut_record_warnings(content, structure):
            say(f"warning: {warning}")
        results.tasks = envelope.tasks(section, content.study, content.limited_outputs)
        longest_first = sorted(results.tasks, key=lambda task: -len(task.fuzzy) * task.duration)
        stages = [envelope.stage(structure, task) for task in longest_first]
        outcomes = self.store.take_all(stages, self.executor)
        for task in results.tasks:
            result = outcomes[f"envelope_{task.name}"]
            envelope.require_tolerance(result, task, structure)
            results.envelopes[task.name] = result

    def _suite_response(
        self, section: RecordsSection, structure: Structure, task: EnvelopeTask
    ) -> Response:
        """Computes peaks under each record of a suite into the results; returns the response."""
        records = suite.suite_records(section, task.section, structure)
        for warning in (warning for record in records for warning in record.warnings):
            say(f"warning: {warning}")
        limited = tuple(dict.fromkeys((*structure.outputs, *self.content.limited_outputs)))
        task = replace(task, limited=limited)
        longest_first = sorted(records, key=lambda record: -record.duration)
        stages = [suite.stage(structure, task, record) for record in longest_first]
        outcomes = self.store.take_all(stages, self.executor)
        by_record = {record.name: outcomes[f"record_{record.name}"].numbers for record in records}
        found = suite.suite_peaks(structure, task, records, by_record)
        self.results.suite, increments = found, dict[str, Increments]()
        if (question := self.content.incremental_question) is not None:
            analyses = suite.analyses_of(question, structure, task, longest_first)
            further = [
                suite.incremental_stage(question, structure, *item) for item in analyses.items()
            ]
            scaled = self.store.take_all(further, self.executor)
            increments = {x.name: scaled[f"incremental_{x.name}"].numbers for x in records}
        return Response(structure, task, found.peak, found, increments)

    def _limited_peaks(self, task: EnvelopeTask, structure: Structure) -> Peaks | None:
        """Peaks for questions: of the study with [envelope]'s motion, else computed alone."""
        for study in self.results.tasks:
            if study.has_motion_of(task.section):
                return self.results.envelopes[study.name].numbers.peak
        if not task.limited:
            return None
        inputs = [structure.model, structure.numbers, task]
        compute = partial(task.compute_peaks, structure)
        stage = Stage("peaks", inputs, ("fuzzy", "frame"), dict[str, Peak], compute)
        return self.store.take(stage).numbers


def _draw_microstructure(
    fitted: FittedRadiusMap, folder: Path, section: MicrostructureSection
) -> None:
    from alphacut.figures.microstructure import draw  # whose libraries take time to import

    draw(fitted, folder, section)


def require_runnable(content: Content) -> ImageStudy | None:
    """Reads and builds all that the stages of a case need, so that `check` refuses it too.

    Returns the study of the image that stage modulus takes, if it takes one.
    """
    stages, study_of_image = content.stages, None
    if "microstructure" in stages and content.microstructure is not None:
        content.microstructure.require_readable(spheres=content.has_spheres)
    if "modulus" in stages:
        study_of_image = _require_material(content)
    if "envelope" in stages:
        _require_motion(content)
    return study_of_image


def _require_material(content: Content) -> ImageStudy | None:
    if "envelope" in content.stages and not content.has_stated_modulus:
        require_levels(content.modulus.alpha, "modulus.alpha")
    if content.image_cell is not None:
        fits = all(content.image_cell.is_solid) or "envelope" not in content.stages
        cure = "give a pore a small modulus, a rigid phase a large one, or take stage modulus alone"
        require(fits, "cell.modulus", "0 or rigid", "both bounds of E, for a frame", cure)
        return image.study_of(content.image_cell)
    if "microstructure" not in content.stages:
        problem = CellProblem.of(content)
        problem.require_mesh()
        problem.model()
    elif (particle := content.particle_cell) is not None:  # whose radius is not known yet
        CellProblem(ThetaSection(), particle, content.mesh, content.modulus).model()
    return None


def _require_motion(content: Content) -> None:
    """Require that identification, each study's envelope and each question can be computed.

    Where the modulus is not known before a stage has run, that must be so for a possible one.
    """
    if content.structure is None or content.envelope is None:
        return
    errors: list[RefusedError | FailedError] = []
    for material in possible_materials(content):
        try:
            structure = structure_as_computed(content, material)
            _require_motion_of(content, content.envelope, structure)
            return
        except (RefusedError, FailedError) as error:
            errors.append(error)
    raise errors[0]


def _require_motion_of(content: Content, section: EnvelopeSection, structure: Structure) -> None:
    if content.identify is not None:
        identify.require_learnable(content.identify, structure, section.alpha)
    if content.records is not None:
        records = suite.suite_records(content.records, section, structure)
        structure = suite.moved_by(structure, records[0])  # which stands for all
    for task in envelope.tasks(section, content.study):
        frame.require_envelope(**task.arguments(structure))
    if content.tolerances is not None:
        (own_task,) = envelope.tasks(section, ())  # of [envelope], as questions are
        answers.require_tolerances(content.tolerances, Response(structure, own_task))


def cut_record_warnings(content: Content, structure: Structure) -> Iterator[str]:
    """Yields a warning if the structure's record goes on after the end of all motions."""
    linear = structure.linear
    if linear is None or linear.ground is None or content.envelope is None:
        return
    length = linear.ground.step * (len(linear.ground.samples) - 1)
    longest = max(task.duration for task in envelope.tasks(content.envelope, content.study))
    if length > longest * (1 + 1e-9):
        yield f"the record lasts {length:g} s, and the motion is computed for {longest:g} s"
