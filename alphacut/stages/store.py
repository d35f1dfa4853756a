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
from alphacut.fuzzy.arrays import on_one_blas_thread
from alphacut.fuzzy.progress_bar import Progress, progress_reporter
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
class StageContext:
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
    compute: Callable[[StageContext], StageResult]
    has_samples: bool = False

    @property
    def key(self) -> str:
        """Fingerprint of inputs, source and libraries."""
        return fingerprint(self.inputs, self.packages)

    @on_one_blas_thread
    def run(self, context: StageContext) -> StageResult:
        """The result, computed."""
        return self.compute(context)


@dataclass(frozen=True)
class StageStore:
    """The results of a run, in a folder or in memory alone.

    Args:
        folder: The folder; None to write nothing.
        case_text: The case, which every result states.
        fresh: Whether everything is computed anew.
        quiet: Whether nothing is shown.
        workers: Processes of a stage.
        up_to_date: Names of the stages whose files were up to date.
    """

    folder: ResultsFolder | None
    case_text: str
    fresh: bool = False
    quiet: bool = False
    workers: int = 1
    up_to_date: list[str] = field(default_factory=list)

    @property
    def shows_progress(self) -> bool:
        """True where progress is shown, by the first rank alone."""
        return not self.quiet and rank() == 0

    def take(self, stage: Stage) -> StageResult:
        """The result of a stage: from its files where these are up to date, else computed."""
        return self._read_if_current(stage) or self._compute(stage)

    def take_all(
        self, stages: Sequence[Stage], executor: Executor | None
    ) -> dict[str, StageResult]:
        """The results of stages by name: from files that are up to date, else computed in parallel.

        Args:
            stages: The stages, those that take longest first; they write no further files.
            executor: Processes; None: this process computes all.
        """
        stored = {stage.name: self._read_if_current(stage) for stage in stages}
        results = {name: result for name, result in stored.items() if result is not None}
        stale = [stage for stage in stages if stage.name not in results]
        if executor is None or self.folder is None or len(stale) == 1:
            return results | {stage.name: self._compute(stage) for stage in stale}
        stage_of_future = {executor.submit(stage.run, StageContext()): stage for stage in stale}
        with progress_reporter(self.shows_progress) as tick:
            for count, future in enumerate(as_completed(stage_of_future), start=1):
                stage = stage_of_future[future]
                with self._report_failures(stage):
                    result = future.result()
                with TemporaryDirectory() as scratch:
                    results[stage.name] = self._write(stage, result, Path(scratch))
                if tick:
                    tick(count / len(stage_of_future))
        return results

    def _read_if_current(self, stage: Stage) -> StageResult | None:
        """The result in the files of a stage; None where these are missing, changed or outdated."""
        if self.folder is None or self.fresh or stage.name not in self.folder.stage_files:
            return None
        part = self.folder.stage_files[stage.name]
        if part.fingerprint != stage.key:
            return None
        if problem := self.folder.problem(stage.name):
            say(f"warning: {problem}; {stage.name} is computed anew")
            return None
        self.up_to_date.append(stage.name)
        LOG.info("stage %s is taken from its files", stage.name)
        return self._read(stage.name)

    def _read(self, name: str) -> StageResult:
        """The result in the files of a stage, NAME.json and perhaps NAME.nc."""
        assert self.folder is not None
        part = self.folder.stage_files[name]
        document = json.loads(self.folder.content(f"{name}.json"))["result"]
        has_data = f"{name}.nc" in part.files
        data = dataset_of(self.folder.content(f"{name}.nc")) if has_data else None
        return StageResult(document, data, tuple(part.files), part.fingerprint)

    def _compute(self, stage: Stage) -> StageResult:
        """Computes the result of a stage, and writes it into its files if there is a folder."""
        LOG.info("stage %s is computed", stage.name)
        if self.folder is None:
            with progress_reporter(self.shows_progress) as tick:
                result = stage.run(StageContext(workers=self.workers, tick=tick))
            return replace(result, document=json.loads(as_json(result.document)))
        self.folder.require_free(f"{stage.name}.json")
        self.folder.require_free(f"{stage.name}.nc")
        samples = self._sample_store(self.folder) if stage.has_samples else None
        with TemporaryDirectory() as scratch, self._proof_folder(self.folder, stage) as parts:
            with progress_reporter(self.shows_progress) as tick, self._report_failures(stage):
                result = stage.run(StageContext(Path(scratch), samples, self.workers, tick, parts))
            return self._write(stage, result, Path(scratch))

    @contextmanager
    def _proof_folder(self, folder: ResultsFolder, stage: Stage) -> Iterator[Path | None]:
        """Yields the folder of the parts of a stage's proof, which is removed if the stage ends.

        It is named by the stage's fingerprint, so that no other code or case takes what is in it.
        None where somebody has put a link in its place.
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

    def _sample_store(self, folder: ResultsFolder) -> Path:
        """Path of the store of samples.

        If there is none yet, the manifest lists it now, so that an interrupted run owns its file.

        Raises:
            RefusedError: The run is fresh, and there is a store that no manifest lists.
        """
        path, is_listed = folder.path / SAMPLES, SAMPLES in folder.stage_files
        exists = os.path.lexists(path)
        is_allowed = is_listed or not exists or not self.fresh
        cure = "move it away, or leave out --fresh"
        require(is_allowed, str(path), value="listed in no manifest", allowed="none", cure=cure)
        if rank() == 0 and not is_listed and not exists:
            # without checksums, since the store changes
            folder.list_files(SAMPLES, "", {SAMPLES: "", f"{SAMPLES}-journal": ""})
        return path

    def _write(self, stage: Stage, result: StageResult, scratch: Path) -> StageResult:
        """Writes a result and the files in `scratch` into the folder; returns it as read again."""
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
    def _report_failures(self, stage: Stage) -> Iterator[None]:
        """Adds the stage to errors in the block, and writes a motion that contradicts a proof.

        Raises:
            FailedError: A worker process died.
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
