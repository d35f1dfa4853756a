"""The case and results of a command; the stages of a case, one after the other, and their needs."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, cast

from alphacut.base.errors import RefusedError, require
from alphacut.base.kept_files import locked
from alphacut.base.progress_bar import progress_reporter
from alphacut.case.content import Case, Content
from alphacut.case.generated import AnalysisSection
from alphacut.case.loads import RecordsSection
from alphacut.case.material import RadiusMapSection
from alphacut.case.motion import EnvelopeSection
from alphacut.case.structure import Structure
from alphacut.commands.options import read_case
from alphacut.frame.analyses.doubts import load_doubts
from alphacut.frame.analyses.fragility import FragilityQuestion
from alphacut.frame.analyses.peaks import Peak, Peaks
from alphacut.frame.analyses.question import Asked
from alphacut.frame.analyses.suites import summarised
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document, rank, require_writable, say
from alphacut.io.results import MANIFEST, ResultsFolder
from alphacut.rve.image.fields.grid import device_array
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
from alphacut.stages.answers import asked_of
from alphacut.stages.cell import CellProblem
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.modulus import fuzzy_loss, fuzzy_modulus
from alphacut.stages.store import (
    RunProgress,
    Stage,
    StageResult,
    StageStore,
    no_progress,
)
from alphacut.stages.summary import Results


@contextmanager
def open_results(
    options: argparse.Namespace, folder: str = ""
) -> Iterator[tuple[Case, StageStore]]:
    """Yield the case and the store of its results, whose folder is locked during the block.

    Under MPI the first rank alone locks the folder, and empties it for ``--fresh``. A damaged list
    of its files is a warning: the store then takes no earlier result from it.

    Args:
        options: Options of a command that keeps results; some of them have no ``--fresh`` or
            ``--device``.
        folder: Folder of the results where ``--out`` is left out; empty to write nothing.

    Raises:
        RefusedError: An option does not fit the case, or the folder holds other files.
    """
    require(options.workers >= 1, "--workers", options.workers, "a whole number 1 or more")
    case = read_case(options)
    path = options.out or folder
    device = getattr(options, "device", "cpu")
    if device != "cpu":
        has_image = case.content.image_cell is not None
        require(has_image, "--device", device, "cpu for a case without an image")
        device_array(device)  # refuses one that is not there before a folder is made
    if path:
        require_writable("--out", path, folder=True)
    # Under MPI the first rank alone shows progress and writes; the others compute with it.
    is_first = rank() == 0
    lock: AbstractContextManager[object] = nullcontext()
    if path and is_first:
        lock = locked("--out", Path(path))
    with progress_reporter(not options.quiet and is_first) as tick, lock:
        # The manifest is read under the lock, since another run may be writing it.
        results = None
        is_fresh = getattr(options, "fresh", False)
        if path:
            results = ResultsFolder.read(Path(path))
            results.require_own_files("--out")
            if results.is_damaged:
                say(f"warning: {results.path / MANIFEST} is damaged; everything is computed anew")
            if is_fresh and is_first:
                results.clear()
        progress = RunProgress(tick or no_progress)
        yield case, StageStore(results, case.text, is_fresh, options.workers, progress)


@dataclass
class Pipeline:
    """A run of the stages of a case, one after the other.

    Args:
        results: The case, and what is found, which is added here.
        store: Where results are taken from, or computed and kept.
        petsc: PETSc options without their prefix.
        figures: Whether stages draw figures beside their results.
        executor: Computes envelopes, and records of a suite, side by side; None in this process.
        device: Where an image is solved, "cpu" or "cuda".
    """

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
        """Compute every stage of the case that `stages` names, and what follows from them.

        The order is microstructure, modulus, envelope with the answers to questions, response
        spectrum, and the shares of inputs. Results are kept in the store and added to `results`,
        which is returned.

        Raises:
            RefusedError: A stage lacks what it needs.
            FailedError: A computation failed, or an error exceeds a tolerance.
            CampaignError: Samples of a cell failed.
        """
        results = self.results
        stages = self.content.stages
        self.store.progress.foresee(self._kinds_of_stages())
        if (section := self.content.structure_section) is not None:
            for warning in section.file_warnings():
                say(f"warning: {warning}")
        if "microstructure" in stages:
            results.microstructure = self.compute_microstructure()
            numbers = results.microstructure.numbers["radius"]
            radius = RadiusMapSection.model_validate(numbers)
            # Later stages read the computed map as if the case had stated it.
            results.content = self.content.model_copy(update={"radius": radius})
        if "modulus" in stages:
            self.compute_modulus()
        if "envelope" in stages:
            self._compute_motion()
        for analysis in self.content.asked_alone:
            self._compute_alone(analysis)
        if self.content.shares:
            self._compute_shares()
        return results

    def _kinds_of_stages(self) -> list[str]:
        """Return the kind of each stage of the run: the first word of its name, for the progress.

        A kind with several stages stands as many times in the list: "envelope" for each study;
        "record" for each record, with "incremental" if columns yield and fragility is asked for.
        """
        content = self.content
        kinds: list[str] = [stage for stage in content.stages if stage != "envelope"]
        if "envelope" in content.stages and content.records is not None:
            of_record = ["record"]
            if content.incremental_question is not None:
                of_record.append("incremental")
            kinds += of_record * len(content.records.suite)
        elif "envelope" in content.stages:
            kinds += ["envelope"] * max(1, len(content.study))
        kinds += content.asked()
        if content.shares:
            kinds.append("shares")
        if self.figures:
            kinds.append("figures")
        return kinds

    def compute_microstructure(self) -> StageResult[Document]:
        """Return the result of stage microstructure, the radius map, and keep it in the store.

        Raises:
            RefusedError: The case has no section [microstructure], or a file is not read.
            FailedError: Particles still overlap after all steps of the packing, or no map fits.
        """
        section = self.content.microstructure
        if section is None:
            raise RefusedError("microstructure", None, "a section [microstructure]")
        draw: microstructure.Draw | None = None
        if self.figures:
            from alphacut.figures import microstructure as figures  # takes time to import

            draw = figures.draw
        stage = microstructure.stage(section, spheres=self.content.has_spheres, draw=draw)
        return self.store.take(stage)

    def compute_modulus(self) -> None:
        """Compute stage modulus, of an image or of samples of a cell, and check its errors.

        The result is kept in the store and put into `results.image` or `results.modulus`.

        Raises:
            RefusedError: The cell or its mesh does not fit, or E of spheres is outside its bounds.
            FailedError: A linear system was not solved, or the error exceeds the tolerance of the
                case.
            CampaignError: Samples failed.
        """
        results = self.results
        section = self.content.modulus
        if self.content.image_cell is not None:
            image_cell = self.content.image_cell
            stage = image.stage(image_cell, section.alpha, section.average, self.device)
            results.image = self.store.take(stage)
            return
        # The mesh file is checked here once, with a message for a user, and not by each sample.
        self.campaign.require_mesh()
        results.modulus = self.store.take(modulus.stage(self.campaign))
        numbers = results.modulus.numbers
        if numbers.nature is not Nature.GUARANTEED:  # which leaves no error out
            cell.require_tolerance(numbers.error, section.tolerance)
        # The classical bounds belong to the nominal inputs, and so does E on the highest level.
        highest = (float(numbers.E_GPa.lower[-1]), float(numbers.E_GPa.upper[-1]))
        cell.require_bounds(highest, numbers.references, numbers.particles)

    def _compute_motion(self) -> None:
        """Compute what stage envelope asks for, and put it into `results`.

        These are the inputs that measured modes identify, then the peaks under each record of a
        suite or the envelopes of all studies, and at last the answers to the questions of the case.
        The structure takes its material from `results.modulus` or `results.image`, if there is one.

        Raises:
            RefusedError: An input, record or limit does not fit the structure.
            FailedError: A response could not be computed, or an error exceeds the tolerance of the
                case.
        """
        results = self.results
        content = self.content
        section = self.content.envelope
        assert section is not None  # of stage envelope
        structure = self._structure()
        if content.identify is not None:
            results.learned, structure = identify.identify_inputs(
                content.identify, structure, section.alpha
            )
            if results.learned.is_refuted:
                say(f"warning: {results.learned.refuted}; what follows has the inputs of the case")
        results.structure = structure
        (task,) = envelope.tasks(section, ())  # of [envelope] itself
        if content.records is not None:
            asked = self._asked_of_suite(content.records, structure, task)
        else:
            self._compute_envelopes(structure, section)
            limits = content.limits_where_yielding(structure)
            task = replace(task, limited=content.limited_outputs, limits=limits)
            peaks = self._limited_peaks(task, structure)
            response: dict[str, Any] = {"peaks": peaks, **task.times}
            asked = replace(asked_of(structure, task.fuzzy, section.alpha), **response)
        for question in content.asked().values():
            self._answer(question, structure, asked)

    def _structure(self) -> Structure:
        """Return the structure with the material that stage modulus found, if there is one."""
        # α-cuts of the material become fuzzy numbers of the structure. Without a stage the case has
        # stated them.
        material = self.results.modulus or self.results.image
        structure = self.content.structure
        if material is not None:
            young = fuzzy_modulus(material.arrays)
            loss = fuzzy_loss(material.arrays)
            structure = self.content.structure_of(young, loss)
        assert structure is not None
        return structure

    def _compute_alone(self, section: AnalysisSection) -> None:
        """Compute the answers to an analysis of the structure without a response.

        Raises:
            RefusedError: An input, output or limit does not fit the structure.
            FailedError: The analysis fails.
        """
        content = self.content
        self.results.structure = structure = self._structure()
        motions: dict[str, Any] = {}
        is_moved = section.made_from.records != "refused"
        if is_moved and content.records is not None and content.envelope is not None:
            # Spectra are those of whole records, so that the motions last as long.
            whole = content.envelope.model_copy(update={"duration": inf})
            motions["records"] = suite.suite_records(content.records, whole, structure)
            motions["step"] = content.envelope.step
        fuzzy, alpha = (getattr(section, name) for name in ("fuzzy", "alpha"))
        self._answer(section, structure, replace(asked_of(structure, fuzzy, alpha), **motions))

    def _answer(self, section: AnalysisSection, structure: Structure, asked: Asked) -> None:
        """Compute the answer to the question of a section, and what else follows from it."""
        kept = self.results.answers
        question = section.question(structure)
        stage = answers.stage(section.key, [section, asked], partial(question.answer, asked))
        kept[section.key] = found = self.store.take(stage).numbers
        for name, further in question.further(asked, found).items():
            kept[name] = self.store.take(answers.stage(name, [section, asked], further)).numbers

    def _compute_envelopes(self, structure: Structure, section: EnvelopeSection) -> None:
        """Compute the envelopes of all studies into `results`, and check their errors.

        A warning is printed of each load that does not end as the responses do.

        Args:
            structure: The structure with its fuzzy parameters.
            section: Section [envelope], which holds for all studies.

        Raises:
            RefusedError: An input or an output does not fit the structure.
            FailedError: A response could not be computed, or an error exceeds the tolerance of the
                case.
        """
        results = self.results
        content = self.content
        results.tasks = envelope.tasks(
            section,
            content.study,
            content.limited_outputs,
            content.limits_where_yielding(structure),
        )
        if structure.linear is not None:
            longest = max(task.duration for task in results.tasks)
            for doubt in load_doubts(structure.linear, longest):
                say(f"warning: {doubt}")
        # The longest tasks begin, so that none of them is left to the end alone. Their time grows
        # about as inputs times duration.
        longest_first = sorted(results.tasks, key=lambda task: -len(task.fuzzy) * task.duration)
        stages = [envelope.stage(structure, task) for task in longest_first]
        outcomes = self.store.take_all(stages, self.executor)
        for task in results.tasks:
            result = outcomes[f"envelope_{task.name}"]
            envelope.require_tolerance(result, task, structure)
            results.envelopes[task.name] = result

    def _asked_of_suite(
        self, section: RecordsSection, structure: Structure, task: EnvelopeTask
    ) -> Asked:
        """Compute peaks under each record of a suite, and return what questions are asked about.

        Args:
            section: The records of the case.
            structure: The structure that they move.
            task: The response of [envelope]: names of the fuzzy inputs, time step and α-levels.

        Returns:
            The peaks over the suite, which are put into `results.suite`, too. If columns yield and
            fragility is asked for, also the peaks at rising intensity of each record.

        Raises:
            RefusedError: A record or a limit does not fit the structure.
            FailedError: A response could not be computed.
        """
        records = suite.suite_records(section, task.section, structure)
        for record in records:
            for warning in record.warnings:
                say(f"warning: {warning}")
        # Peaks are computed of all outputs, and of those that questions limit besides.
        limited = tuple(dict.fromkeys(structure.outputs + self.content.limited_outputs))
        limits = self.content.limits_where_yielding(structure)
        task = replace(task, limited=limited, limits=limits)
        longest_first = sorted(records, key=lambda record: -record.duration)
        stages = suite.stages(structure, task, longest_first)
        outcomes = self.store.take_all(stages, self.executor)
        by_record = {record.name: outcomes[f"record_{record.name}"].numbers for record in records}
        found = summarised(
            suite.linear_model(structure),
            structure.inputs(task.fuzzy),
            records,
            by_record,
            step=task.section.step,
            alpha=task.section.alpha,
        )
        self.results.suite = found
        response: dict[str, Any] = {"peaks": found.peak, "suite": found, **task.times}
        asked = asked_of(structure, task.fuzzy, task.section.alpha)
        asked = replace(asked, records=records, **response)
        if (fragility := self.content.incremental_question) is None:
            return asked
        question = cast("FragilityQuestion", fragility.question(structure))
        analyses = question.analyses(replace(asked, records=tuple(longest_first)))
        named = question.named_limits
        further = [suite.incremental_stage(named, *analysis) for analysis in analyses.items()]
        scaled = self.store.take_all(further, self.executor)
        increments = {x.name: scaled[f"incremental_{x.name}"].numbers for x in records}
        return replace(asked, increments=increments)

    def _limited_peaks(self, task: EnvelopeTask, structure: Structure) -> Peaks | None:
        """Return the peaks that questions are asked about, by name.

        Args:
            task: The response of [envelope], with the names of the limited peaks.
            structure: The structure.

        Returns:
            The peaks of the study that has just this response, if there is one; else those that a
            stage of their own computes, or None if no question reads peaks.

        Raises:
            RefusedError: An input or an output does not fit the structure.
            FailedError: A response could not be computed.
        """
        # A study with the inputs and the duration of [envelope] has been computed with these peaks.
        for study in self.results.tasks:
            if study.has_response_of(task.section):
                return self.results.envelopes[study.name].numbers.peak
        if not task.limited:
            return None
        inputs = [structure.model, structure.numbers, task]
        stage = Stage(
            "peaks",
            inputs,
            ("fuzzy", "frame"),
            dict[str, Peak],
            lambda context: StageResult(task.close_peaks(structure, context.tick)),
        )
        return self.store.take(stage).numbers

    def _compute_shares(self) -> None:
        """Compute by how much each input widens E, ν and the peaks, into `results.shares`.

        The peaks are taken from the study with the most fuzzy inputs; of several such studies from
        the longest one.

        Raises:
            CampaignError: Samples of the cell failed.
            FailedError: A response could not be computed.
        """
        results = self.results
        cells = None
        if results.modulus is not None:
            cells = self.campaign
        task = None
        peaks = dict[str, Peak]()
        # One study is enough: with more inputs it tells more, and each input takes searches.
        if results.tasks:
            task = max(results.tasks, key=lambda task: (len(task.fuzzy), task.duration))
            peaks = results.envelopes[task.name].numbers.peak
        results.shares = self.store.take(shares.stage(cells, results.structure, task, peaks))
