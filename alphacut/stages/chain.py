"""The stages of a case, one after the other, each taken from its file while that is up to date."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from alphacut.case.content import Content
from alphacut.case.structure import Structure
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.refused import RefusedError
from alphacut.io.progress import progress
from alphacut.stages import (
    cell,
    envelope,
    identify,
    image,
    microstructure,
    modulus,
    question,
    response,
    shares,
)
from alphacut.stages.modulus import Campaign, campaign
from alphacut.stages.results import Results
from alphacut.stages.store import Store

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Chain:
    """A run of the stages of a case.

    Args:
        content: The sections of the case.
        store: Folder of the results.
        petsc: PETSc options that override the solver's.
        figures: Whether the particles are drawn.
        executor: Processes that compute envelopes side by side.
    """

    content: Content
    store: Store
    petsc: Mapping[str, str] = field(default_factory=dict)
    figures: bool = True
    executor: Executor | None = None

    def run(self) -> Results:
        """The results of every stage."""
        self.store.folder.mkdir(parents=True, exist_ok=True)
        content, results = self.content, Results(self.store.folder, self.content)
        if "microstructure" in content.stages and content.microstructure:
            results = replace(results, microstructure=self._particles())
            radius = microstructure.radius_of(results.microstructure)
            content = content.model_copy(update={"radius": radius})
            self, results = replace(self, content=content), replace(results, content=content)
        if "modulus" in content.stages:
            results = self._image(results) if content.picture else self._modulus(results)
        return self._motion(results) if "envelope" in content.stages else self._shares(results)

    def _particles(self) -> xarray.Dataset:
        content = self.content
        assert content.microstructure is not None
        spheres = content.round is not None and content.round.particles == "spheres"
        stage = microstructure.stage(content.microstructure, spheres=spheres, figures=self.figures)
        return self.store.take(stage)

    @property
    def campaign(self) -> Campaign | None:
        """Samples of a round cell, where the modulus is computed by them."""
        content = self.content
        if "modulus" not in content.stages or content.round is None or content.radius is None:
            return None
        return campaign(
            content.radius,
            content.round,
            content.mesh,
            content.modulus,
            petsc=self.petsc,
            curves=content.response is not None,
        )

    def _modulus(self, results: Results) -> Results:
        content, samples = self.content, self.campaign
        assert samples is not None
        assert content.radius is not None
        assert content.round is not None
        data = self.store.take(modulus.stage(samples))
        cell.require_tolerance(modulus.listed(data, "error"), content.modulus.tolerance)
        beside = cell.references(content.radius, content.round)
        results = replace(results, modulus=data, references=beside)
        if content.response is None:
            return results
        stage = response.stage(content.response, samples, data)
        return replace(results, response=self.store.take(stage))

    def _image(self, results: Results) -> Results:
        assert self.content.picture is not None
        section = self.content.modulus
        stage = image.stage(self.content.picture, section.alpha, section.average)
        return replace(results, image=self.store.take(stage))

    def _number(self, results: Results) -> FuzzyNumber | None:
        """The modulus for the structure, in Pa; None for its own."""
        data = results.modulus if results.image is None else results.image
        return None if data is None else modulus.number_of(data)

    def _motion(self, results: Results) -> Results:
        content, section = self.content, self.content.frame or self.content.pendulum
        assert section is not None
        assert content.envelope is not None
        structure = section.structure(self._number(results))
        tasks = envelope.tasks(content.envelope, content.study)
        results = replace(results, structure=structure, tasks=tasks)
        if content.identify is not None:
            results = self._identified(results, structure)
        results = self._envelopes(results)
        return self._shares(self._questions(results))

    def _identified(self, results: Results, structure: Structure) -> Results:
        section, motion = self.content.identify, self.content.envelope
        assert section is not None
        assert motion is not None
        learned = identify.learned(section, structure, motion.alpha)
        (task,) = envelope.tasks(motion, ())
        if not set(learned.prior) <= set(structure.inputs(task.fuzzy)):
            allowed = "all inputs that are learned, among others"
            raise RefusedError("envelope.fuzzy", ", ".join(task.fuzzy), allowed)
        bands = self.store.take(identify.stage(section, structure, learned, task))
        return replace(results, structure=learned.structure, learned=learned, update=bands)

    def _envelopes(self, results: Results) -> Results:
        """Every study's envelope; several are computed side by side."""
        structure, store = results.structure, self.store
        assert structure is not None
        if self.executor is not None and len(results.tasks) > 1:
            self._side_by_side(results, structure, self.executor)
            store = replace(store, fresh=False)
        every = {}
        for task in results.tasks:
            data = store.take(envelope.stage(structure, task))
            envelope.require_tolerance(data, task, structure)
            every[task.name] = data
        return replace(results, envelopes=every)

    def _side_by_side(self, results: Results, structure: Structure, executor: Executor) -> None:
        quiet = replace(self.store, quiet=True)
        under_way = envelope.side_by_side(quiet, structure, results.tasks, executor)
        with progress("envelopes", quiet=self.store.quiet) as tick:
            for done, future in enumerate(as_completed(under_way), start=1):
                self.store.put(under_way[future], future.result())
                if tick:
                    tick(done / len(under_way))

    def _questions(self, results: Results) -> Results:
        """The answers to what the case asks of the motion of [envelope]."""
        content, structure = self.content, results.structure
        assert structure is not None
        assert content.envelope is not None
        (task,) = envelope.tasks(content.envelope, ())
        answers = {
            key: question.document(self.store.take(question.stage(key, section, structure, task)))
            for key, section in content.questions.items()
        }
        return replace(results, answers=answers)

    def _shares(self, results: Results) -> Results:
        richest = max(results.tasks, key=lambda x: (len(x.fuzzy), x.duration), default=None)
        stage = shares.stage(self.campaign, results.structure, richest)
        return replace(results, shares=self.store.take(stage))
