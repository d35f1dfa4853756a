"""Results of stages in files, taken from there while their fingerprint and digests hold."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from alphacut.frame.verification.self_test import ContradictionError
from alphacut.fuzzy.blas import on_one_blas_thread
from alphacut.fuzzy.progress_bar import Progress, showing
from alphacut.fuzzy.refused import FailedError, require
from alphacut.io.columns import columns_text
from alphacut.io.files import Document, as_json, rank, say, write_text
from alphacut.io.manifest import ResultsFolder
from alphacut.io.netcdf import dataset_of
from alphacut.io.provenance import fingerprint, origin

LOG = logging.getLogger(__name__)

if TYPE_CHECKING:
    import xarray

SAMPLES = "samples.db"
"""Store of the samples of a campaign, beside the results."""
PARTS = "parts"
"""Folder of the bounds of parts of boxes while a proof runs, beside the results."""


@dataclass(frozen=True)
class Work:
    """Surroundings of a computation.

    Args:
        folder: Empty folder for further files of the stage; None to write none.
        samples: Store of samples; None for none.
        workers: Processes.
        tick: Takes the share done; None to show nothing.
        parts: Folder from which a proof that was killed goes on; None for none.
    """

    folder: Path | None = None
    samples: Path | None = None
    workers: int = 1
    tick: Progress | None = None
    parts: Path | None = None


@dataclass(frozen=True)
class StageResult:
    """Result of a stage.

    Args:
        document: Numbers and texts, as JSON holds them.
        data: Arrays with their axes; None for none.
        files: Names of all its files in the folder of results.
        fingerprint: Digest of everything that it depends on.
    """

    document: Document
    data: xarray.Dataset | None = None
    files: tuple[str, ...] = ()
    fingerprint: str = ""

    @property
    def arrays(self) -> xarray.Dataset:
        """The arrays of a stage that has some."""
        assert self.data is not None
        return self.data

    @property
    def figures(self) -> list[str]:
        """Names of the figures among its files."""
        return [name for name in self.files if name.startswith("figures/")]


@dataclass(frozen=True)
class Stage:
    """A function from objects to a result.

    Args:
        name: Its files are NAME.json and NAME.nc.
        inputs: Everything that the result depends on.
        packages: Packages of this project whose source it depends on.
        compute: The function.
        has_samples: Whether it stores samples on the way.
    """

    name: str
    inputs: object
    packages: tuple[str, ...]
    compute: Callable[[Work], StageResult]
    has_samples: bool = False

    @property
    def key(self) -> str:
        """Fingerprint of inputs, source and libraries."""
        return fingerprint(self.inputs, self.packages)

    @on_one_blas_thread
    def run(self, work: Work) -> StageResult:
        """The result, computed."""
        return self.compute(work)


@dataclass(frozen=True)
class StageStore:
    """The results of a run, in a folder or in memory alone.

    Args:
        folder: The folder; None to write nothing.
        case_text: The case, which every result states.
        fresh: Whether everything is computed anew.
        quiet: Whether nothing is shown.
        workers: Processes of a stage.
        taken: Names of the stages whose files were up to date.
    """

    folder: ResultsFolder | None
    case_text: str
    fresh: bool = False
    quiet: bool = False
    workers: int = 1
    taken: list[str] = field(default_factory=list)

    @property
    def shown(self) -> bool:
        """True where progress is shown, by the first rank alone."""
        return not self.quiet and rank() == 0

    def take(self, stage: Stage) -> StageResult:
        """The result of a stage: from its files where these are up to date, else computed."""
        return self._stored(stage) or self._computed(stage)

    def take_all(
        self, stages: Sequence[Stage], executor: Executor | None
    ) -> dict[str, StageResult]:
        """The results of several stages by their names, computed side by side by an executor.

        Args:
            stages: Those that take longest first; they write no further files.
            executor: Processes; None where this one does everything.
        """
        stored = {stage.name: self._stored(stage) for stage in stages}
        results = {name: result for name, result in stored.items() if result is not None}
        stale = [stage for stage in stages if stage.name not in results]
        if executor is None or self.folder is None or len(stale) == 1:
            return results | {stage.name: self._computed(stage) for stage in stale}
        under_way = {executor.submit(stage.run, Work()): stage for stage in stale}
        with showing(self.shown) as tick:
            for done, future in enumerate(as_completed(under_way), start=1):
                stage = under_way[future]
                with self._reported(stage):
                    result = future.result()
                with TemporaryDirectory() as scratch:
                    results[stage.name] = self._put(stage, result, Path(scratch))
                if tick:
                    tick(done / len(under_way))
        return results

    def _stored(self, stage: Stage) -> StageResult | None:
        """The result from the files of a stage; None where they are not up to date."""
        if self.folder is None or self.fresh or stage.name not in self.folder.parts:
            return None
        part = self.folder.parts[stage.name]
        if part.fingerprint != stage.key:
            return None
        if problem := self.folder.problem(stage.name):
            say(f"warning: {problem}; {stage.name} is computed anew")
            return None
        self.taken.append(stage.name)
        LOG.info("stage %s is taken from its files", stage.name)
        return self._read(stage.name)

    def _read(self, name: str) -> StageResult:
        """The result in the files of a stage."""
        assert self.folder is not None
        part = self.folder.parts[name]
        document = json.loads(self.folder.content(f"{name}.json"))["result"]
        has_data = f"{name}.nc" in part.files
        data = dataset_of(self.folder.content(f"{name}.nc")) if has_data else None
        return StageResult(document, data, tuple(part.files), part.fingerprint)

    def _computed(self, stage: Stage) -> StageResult:
        """The result as it is computed now, and put into its files."""
        LOG.info("stage %s is computed", stage.name)
        if self.folder is None:
            with showing(self.shown) as tick:
                result = stage.run(Work(workers=self.workers, tick=tick))
            return replace(result, document=json.loads(as_json(result.document)))
        self.folder.require_free(f"{stage.name}.json")
        self.folder.require_free(f"{stage.name}.nc")
        samples = self._samples(self.folder) if stage.has_samples else None
        with TemporaryDirectory() as scratch, self._parts(self.folder, stage) as parts:
            with showing(self.shown) as tick, self._reported(stage):
                result = stage.run(Work(Path(scratch), samples, self.workers, tick, parts))
            return self._put(stage, result, Path(scratch))

    @contextmanager
    def _parts(self, folder: ResultsFolder, stage: Stage) -> Iterator[Path | None]:
        """Folder of the parts of a proof, which stays where the stage does not end.

        It is named by the stage's key, so that no other code or case takes what is in it, and not
        used where somebody has put a link in its place.
        """
        path = folder.path / PARTS / stage.key[:32]
        if path.is_symlink() or path.parent.is_symlink():
            yield None
            return
        if self.fresh:
            rmtree(path, ignore_errors=True)
        try:
            yield path
            if rank() == 0:
                rmtree(path, ignore_errors=True)
        finally:
            for folder_of_parts in (path, path.parent):
                with suppress(OSError):  # it holds parts
                    folder_of_parts.rmdir()

    def _samples(self, folder: ResultsFolder) -> Path:
        """The store of samples, which the manifest lists before it is made.

        Raises:
            RefusedError: A store that is not listed would be used by a run that is fresh.
        """
        path, listed = folder.path / SAMPLES, SAMPLES in folder.parts
        there = os.path.lexists(path)
        cure = "move it away, or leave out --fresh"
        require(
            listed or not (there and self.fresh),
            str(path),
            value="listed in no manifest",
            allowed="none",
            cure=cure,
        )
        if rank() == 0 and not listed and not there:
            folder.list_files(SAMPLES, "", {SAMPLES: "", f"{SAMPLES}-journal": ""})
        return path

    def _put(self, stage: Stage, result: StageResult, scratch: Path) -> StageResult:
        """Writes a result into the files of its stage; returns it as it is read from there."""
        assert self.folder is not None
        document = {**origin(self.case_text, stage.key), "result": result.document}
        if rank() != 0:
            return replace(result, document=json.loads(as_json(document))["result"])
        write_text(scratch / f"{stage.name}.json", as_json(document, indent=1))
        if result.data is not None:
            result.data.to_netcdf(scratch / f"{stage.name}.nc")
        self.folder.put(stage.name, stage.key, scratch)
        return self._read(stage.name)

    @contextmanager
    def _reported(self, stage: Stage) -> Iterator[None]:
        """Names the stage where a process dies, and writes the motion that contradicts a proof.

        Raises:
            FailedError: A process died.
            ContradictionError: A motion contradicts a proof.
        """
        try:
            yield
        except BrokenExecutor as error:
            cure = "out of memory, or a crash in compiled code; the stages that are done stay"
            raise FailedError(f"a worker process died in stage {stage.name}", cure) from error
        except ContradictionError as error:
            self.put_text("contradiction.csv", columns_text(error.table))
            raise

    def put_text(self, name: str, text: str) -> None:
        """Writes a text file of the run itself, such as summary.json."""
        if self.folder is not None and rank() == 0:
            put_text(self.folder, name, text)


def put_text(folder: ResultsFolder, name: str, text: str) -> None:
    """Writes a text file into a folder of results, and lists it."""
    with TemporaryDirectory() as scratch:
        write_text(Path(scratch) / name, text)
        folder.put(name, "", Path(scratch))
