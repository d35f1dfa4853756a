"""Chain of a case: fuzzy modulus, then envelopes, each kept while up to date."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.case.case import Case
from alphacut.fuzzy import FuzzyNumber
from alphacut.io.files import Document, say
from alphacut.io.kept_arrays import KeptArrays
from alphacut.io.netcdf import fingerprint_of, read_dataset, write_dataset
from alphacut.io.progress import Tick, progress
from alphacut.io.provenance import attributes, fingerprint
from alphacut.stages.image import bounds, document
from alphacut.stages.image.reading import study_of
from alphacut.stages.material import microstructure, modulus, response
from alphacut.stages.material.campaign import campaign
from alphacut.stages.material.microstructure import write as write_microstructure
from alphacut.stages.tolerance import require_modulus
from alphacut.stages.vibration import decision, envelope, update
from alphacut.stages.vibration import exceedance as outcomes
from alphacut.stages.vibration.envelope_task import task_of
from alphacut.stages.vibration.structure import Structure, structure
from alphacut.stages.vibration.studies import Study, envelope_of, side_by_side, studies

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Chain:
    """Settings of a run.

    Args:
        case: The case.
        folder: Where results go.
        workers: Processes that share the samples.
        fresh: Compute everything anew.
        quiet: No progress.
        petsc: PETSc options that override the solver's.
        built: The structure, if it is built; its modulus may be another.
        executor: Processes that compute envelopes side by side.
        meanwhile: Told the findings before the envelopes, while those are under way there.
    """

    case: Case
    folder: Path
    workers: int = 1
    fresh: bool = False
    quiet: bool = False
    petsc: Mapping[str, str] = field(default_factory=dict)
    built: Structure | None = None
    executor: Executor | None = None
    meanwhile: Callable[[Results], None] | None = None

    def file(self, name: str) -> Path:
        """A file among the results."""
        return self.folder / name

    def run(self) -> Results:
        """Compute every stage of the case, or take it from its file."""
        self.folder.mkdir(parents=True, exist_ok=True)
        if "microstructure" in self.case.stages:
            return replace(self, case=self.with_particles()).after_particles()
        return self.after_particles()

    def after_particles(self) -> Results:
        """The stages from the radius map on."""
        handed = modulus.stand_in(self.case)
        cell = self.modulus() if "modulus" in self.case.stages and handed is None else None
        picture = self.image() if "image" in self.case.stages else None
        if "envelope" in self.case.stages and (cell is not None or picture is not None):
            name, key = ("modulus.nc", "modulus.alpha") if picture is None else ("image.nc", "cell")
            handed = modulus.read_number(self.file(name), key)
        found = Results(self.case, self.folder, cell, {}, handed, image=picture)
        if cell is not None and self.case.sections.response:
            found = replace(found, response=self.response(cell))
        return self.after_modulus(found) if "envelope" in self.case.stages else found

    def after_modulus(self, found: Results) -> Results:
        """The structure, its envelopes, and what the case asks of its motion."""
        case, asked, handed = self.case, self.case.sections, found.handed
        wanted = (self.built or structure(case, handed)).with_modulus(handed)
        if asked.update is not None:
            learned = update.learned(case, wanted)
            before, wanted = wanted, learned.structure
            bands = self.asked("update", found, lambda t: update.dataset(case, before, learned, t))
            found = replace(found, learned=learned, update=bands)
        found = replace(found, structure=wanted)
        found = replace(found, envelopes=self.envelopes(found, wanted))
        if asked.exceedance:
            told = self.asked("exceedance", found, lambda t: outcomes.exceedance(case, wanted, t))
            found = replace(found, exceedance=told)
        if asked.decision:
            same = (x.name for x in studies(case) if x.task == task_of(case))
            peaks = found.envelopes.get(next(same, ""))
            make = partial(decision.decision, case, wanted, peaks, workers=self.workers)
            told = self.asked("decision", found, lambda t: make(progress=t))
            found = replace(found, decision=told)
        return found

    def with_particles(self) -> Case:
        """Case with the radius map of its particles; the stage's files are stored."""
        particles = self.case.microstructure
        inputs = {"case": particles, "files": self.case.digests(particles)}
        key = fingerprint(inputs, ("stochastic",))

        def compute(path: Path) -> None:
            with progress("Microstructure", quiet=self.quiet) as tick:
                found = microstructure.compute(self.case, workers=self.workers, progress=tick)
            for old in microstructure.pictures(self.folder):
                old.unlink()
            write_microstructure(found, path.parent, attributes(self.case.text_of_file, key))

        self.stored("microstructure.nc", key, compute)
        radius = self.file("radius.toml").read_text(encoding="utf-8")
        return microstructure.with_radius(self.case, radius)

    def modulus(self) -> xarray.Dataset:
        """The fuzzy modulus, in modulus.nc."""
        case = self.case
        sections = [case.radius, case.cell, case.mesh, case.modulus]
        inputs = {"case": sections, "petsc": dict(self.petsc)}
        key = fingerprint(inputs, ("stochastic", "rve", "fuzzy"))

        def compute(path: Path) -> None:
            store = self.file("samples.db")
            if self.fresh:
                for old in self.folder.glob("samples.db*"):
                    old.unlink()
            with progress("Fuzzy modulus", quiet=self.quiet) as tick:
                wanted = campaign(self.case, petsc=self.petsc, store=store)
                found = modulus.compute(wanted, workers=self.workers, progress=tick)
            modulus.write(found, path, case_text=case.text_of_file, key=key)

        found = self.stored("modulus.nc", key, compute)
        error = modulus.listed(found, "error")
        require_modulus(self.case, sum(error.values()))
        return found

    def image(self) -> xarray.Dataset:
        """The proved bounds of the image's modulus, in image.nc."""
        picture = self.case.picture
        wanted = self.case.modulus
        inputs = {"case": picture, "alpha": wanted.alpha, "average": wanted.average}
        files = self.case.digests(picture)
        key = fingerprint({**inputs, "files": files}, ("stochastic", "rve", "fuzzy"))

        def compute(path: Path) -> None:
            with progress("Image", quiet=self.quiet) as tick:
                study = study_of(self.case)
                found = bounds.compute(study, progress=tick)
            document.write(found, path, attributes(self.case.text_of_file, key))

        return self.stored("image.nc", key, compute)

    def response(self, cell: xarray.Dataset) -> xarray.Dataset:
        """The random and fuzzy stress of the cell, in response.nc."""
        inputs = {"modulus": cell.attrs["fingerprint"], "wanted": self.case.response}
        key = fingerprint(inputs, ("stochastic", "fuzzy", "alphacut"))

        def compute(path: Path) -> None:
            facts = attributes(self.case.text_of_file, key)
            write_dataset(response.dataset(self.case, cell), path, facts)

        return self.stored("response.nc", key, compute)

    def envelopes(self, found: Results, wanted: Structure) -> dict[str, xarray.Dataset]:
        """Every study's envelope, in envelope_NAME.nc; several are computed side by side."""
        keys = {study: self.key_of(study, found.handed) for study in studies(self.case)}
        stale = [s for s, key in keys.items() if not self.current(s.file, key)]
        if self.executor is not None and len(stale) > 1:
            begun = {study: self.begun(study, keys[study]) for study in stale}
            under_way = side_by_side(wanted, begun, self.executor)
            if self.meanwhile is not None:
                self.meanwhile(found)
            with progress("Envelopes", quiet=self.quiet) as tick:
                for done, future in enumerate(as_completed(under_way), start=1):
                    study = under_way[future]
                    self.write_envelope(study, keys[study], future.result())
                    if tick:
                        tick(done / len(stale))
            stale = []
        return {
            study.name: self.envelope(study, key, wanted, stale=study in stale)
            for study, key in keys.items()
        }

    def key_of(self, study: Study, handed: FuzzyNumber | None) -> str:
        """Fingerprint of one study's envelope."""
        holds = ("bounds", "peaks", "tried at nodes")
        return self.vibration({"task": study.task, "holds": holds}, handed)

    def begun(self, study: Study, key: str) -> KeptArrays:
        """What an interrupted run has left of a study's envelope."""
        return KeptArrays(self.file(study.file).with_suffix(".partial.npz"), key, self.fresh)

    def envelope(self, study: Study, key: str, wanted: Structure, *, stale: bool) -> xarray.Dataset:
        """One study's envelope from its file, computed first where that is stale."""
        if stale:
            with progress(f"Envelope {study.name}", quiet=self.quiet) as tick:
                make = partial(envelope_of, wanted, study.task, self.begun(study, key))
                made = make(workers=self.workers, progress=tick)
            self.write_envelope(study, key, made)
        found = read_dataset(self.file(study.file))
        envelope.keep_tolerance(self.case, found)
        return found

    def write_envelope(self, study: Study, key: str, made: xarray.Dataset) -> None:
        """Put a study's envelope into its file, in place of what was kept on the way."""
        envelope.write(made, self.file(study.file), case_text=self.case.text_of_file, key=key)
        self.begun(study, key).done()

    def asked(
        self, name: str, found: Results, make: Callable[[Tick | None], xarray.Dataset]
    ) -> xarray.Dataset:
        """What the section `name` asks of the motion of [envelope], in NAME.nc."""
        motion = replace(self.case.envelope, shares=True)  # which changes nothing here
        key = self.vibration({"wanted": [getattr(self.case, name), motion]}, found.handed)

        def compute(path: Path) -> None:
            with progress(name.capitalize(), quiet=self.quiet) as tick:
                made = make(tick)
            envelope.write(made, path, case_text=self.case.text_of_file, key=key)

        return self.stored(f"{name}.nc", key, compute)

    def vibration(self, wanted: Document, handed: FuzzyNumber | None) -> str:
        """Fingerprint of a result for the structure, its record and the modulus."""
        given = self.case.sections
        inputs = [given.frame, given.pendulum, given.update]
        record = self.case.digests(*inputs)
        return fingerprint(
            {"case": inputs, "record": record, "modulus": handed, **wanted}, ("fuzzy", "frame")
        )

    def stored(self, name: str, key: str, compute: Callable[[Path], None]) -> xarray.Dataset:
        """The dataset in a file: as it is if it has the fingerprint `key`, else computed first."""
        if not self.current(name, key):
            compute(self.file(name))
        return read_dataset(self.file(name))

    def current(self, name: str, key: str) -> bool:
        """Whether a file has the fingerprint `key` and may be taken, which is then said."""
        path = self.file(name)
        if self.fresh or not path.is_file() or fingerprint_of(path) != key:
            return False
        if not self.quiet:
            say(f"{path} is up to date")
        return True


@dataclass(frozen=True)
class Results:
    """Findings of a run.

    Args:
        case: The case.
        folder: Where the files are.
        modulus: Dataset of modulus.nc; None where the case computes none.
        envelopes: Datasets of the studies by name.
        handed: The modulus handed on to the structure, in Pa; None where the structure took its
            own.
        response: Dataset of response.nc; None where the case does not ask for it.
        exceedance: Dataset of exceedance.nc; None where the case names no limit.
        structure: The structure with that modulus; None where none vibrates.
        image: Dataset of image.nc; None where the case shows none.
        learned: What measured modes leave of the inputs; None where the case has none.
        update: Dataset of update.nc, likewise.
        decision: Dataset of decision.nc; None where the case has no such section.
    """

    case: Case
    folder: Path
    modulus: xarray.Dataset | None
    envelopes: Mapping[str, xarray.Dataset]
    handed: FuzzyNumber | None
    response: xarray.Dataset | None = None
    exceedance: xarray.Dataset | None = None
    structure: Structure | None = None
    image: xarray.Dataset | None = None
    learned: update.Learned | None = None
    update: xarray.Dataset | None = None
    decision: xarray.Dataset | None = None

    @property
    def datasets(self) -> list[xarray.Dataset]:
        """Every dataset among them."""
        one = (self.modulus, self.image, self.response, self.exceedance)
        more = (self.update, self.decision, *self.envelopes.values())
        return [data for data in (*one, *more) if data is not None]

    @property
    def studies(self) -> tuple[Study, ...]:
        """The studies, in the case's order."""
        return studies(self.case) if self.envelopes else ()
