"""Results of stages: typed numbers beside arrays, taken from files while they are what was made."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from alphacut.base.arrays import on_one_blas_thread
from alphacut.base.errors import FailedError, RefusedError, require
from alphacut.base.kept_files import whole_file, write_text
from alphacut.base.progress_bar import Progress, foretelling, subprogress
from alphacut.io.files import as_json, rank, say
from alphacut.io.provenance import build_provenance, fingerprint
from alphacut.io.results import Listed, ResultsFolder, write_arrays
from alphacut.io.typed_json import from_document, to_document

if TYPE_CHECKING:
    import xarray

LOG = logging.getLogger(__name__)
SAMPLES = "samples.db"
"""Store of the samples of a campaign, beside the results."""

T = TypeVar("T")


def no_progress(fraction: float) -> None:
    """Show nothing."""


@dataclass(frozen=True)
class StageContext:
    """Surroundings of a computation.

    Args:
        folder: Empty folder for further files; None to write none.
        samples: Store of samples, if the stage has some.
        workers: Number of processes.
        tick: Takes the completed fraction.
    """

    folder: Path | None = None
    samples: Path | None = None
    workers: int = 1
    tick: Progress = no_progress


@dataclass(frozen=True)
class StageResult(Generic[T]):
    """Result of a stage.

    Args:
        numbers: Its numbers.
        data: Arrays with their axes, if it has some.
        files: Names of its files, which the store adds.
        fingerprint: Digest of what it was made from, which the store adds.
    """

    numbers: T
    data: xarray.Dataset | None = None
    files: tuple[str, ...] = ()
    fingerprint: str = ""

    @property
    def arrays(self) -> xarray.Dataset:
        """The arrays of a stage that has some."""
        assert self.data is not None
        return self.data


@dataclass(frozen=True)
class Stage(Generic[T]):
    """A function whose result is kept in the files NAME.json and NAME.nc.

    Args:
        name: NAME.
        inputs: All that the result depends on, besides source and libraries.
        packages: Packages of this project whose source it depends on.
        kind: Type of the numbers.
        compute: Returns the result.
        has_samples: Whether it stores samples on the way.
        work: Work of the stage, compared with that of stages that are computed beside it.
    """

    name: str
    inputs: object
    packages: tuple[str, ...]
    kind: type[T]
    compute: Callable[[StageContext], StageResult[T]]
    has_samples: bool = False
    work: float = 1.0

    @cached_property
    def key(self) -> str:
        """Digest of name, inputs, source and libraries."""
        # The name is part of it: stages of the same inputs have files of their own.
        return fingerprint([self.name, self.inputs], self.packages)

    @on_one_blas_thread
    def run(self, context: StageContext) -> StageResult[T]:
        """Return the result, computed."""
        return self.compute(context)


@dataclass
class RunProgress:
    """Progress of a run in one bar, of which each stage takes a part by its rough seconds.

    Args:
        show: Takes the completed fraction of the run.
        seconds_left: Seconds of all stages to come.
        done: Fraction of the bar that the stages so far have taken.
    """

    show: Progress = no_progress
    seconds_left: float = 1.0
    done: float = 0.0

    def foresee(self, names: Iterable[str]) -> None:
        """Foresee the stages of a run by their names."""
        self.seconds_left = self._seconds_of(names)

    def next_part(self, names: Iterable[str], skipped: Iterable[str] = ()) -> Progress:
        """Return the function that takes the progress of the next stages, and reserve their part.

        The part is a fraction of the rest of the bar: the rough seconds of these stages divided by
        `seconds_left`, the seconds of all stages to come. It is added to `done`, the fraction of
        the bar that is reserved so far, and their seconds are taken from `seconds_left`.

        Args:
            names: Names of the stages that will be computed next.
            skipped: Names of stages that are up to date; they take nothing of the bar.

        Returns:
            Function of the completed fraction, 0 to 1, of these stages together.
        """
        self.seconds_left -= self._seconds_of(skipped)
        seconds = self._seconds_of(names)
        first = self.done
        # Where stages come that nobody foresaw, their seconds may be more than those that are left:
        # the maximum keeps the bar within its end.
        if seconds:
            self.done += (1 - first) * seconds / max(seconds, self.seconds_left)
        self.seconds_left -= seconds
        return foretelling(subprogress(self.show, first, self.done))

    def _seconds_of(self, names: Iterable[str]) -> float:
        """Return the rough seconds of stages by the first words of their names, 1 by default."""
        # They are measured on shipped cases, and only divide the progress bar among the stages.
        measured = {
            "modulus": 10.0,
            "image": 10.0,
            "envelope": 10.0,
            "record": 3.0,
            "incremental": 5.0,
            "probability": 5.0,
            "tolerances": 30.0,
            "figures": 6.0,
        }
        return sum(measured.get(name.partition("_")[0], 1.0) for name in names)


@dataclass(frozen=True)
class StageStore:
    """The results of a run, in a folder or, without one, in memory alone.

    Args:
        folder: The folder.
        case_text: Text of the case, which every result states.
        fresh: Whether all results are computed anew.
        workers: Number of processes of a stage.
        progress: Progress of the run.
        up_to_date: Names of the stages whose files were up to date; they are added here.
    """

    folder: ResultsFolder | None
    case_text: str
    fresh: bool = False
    workers: int = 1
    progress: RunProgress = field(default_factory=RunProgress)
    up_to_date: list[str] = field(default_factory=list)

    def take(self, stage: Stage[T]) -> StageResult[T]:
        """Return the result of a stage: from its files if these are up to date, else computed."""
        # A single stage may use all processes itself, and leaves further files.
        return self.take_all([stage], None)[stage.name]

    def take_all(
        self, stages: Sequence[Stage[T]], executor: Executor | None
    ) -> dict[str, StageResult[T]]:
        """Return the results of stages by their names, from files or computed and then kept.

        A result is taken from the files of its stage if these are unchanged and were made from
        equal inputs by the same source and libraries.

        Args:
            stages: The stages, those that take longest first; their names are distinct.
            executor: Computes them side by side, in other processes, without figures and other
                files; this process computes them if it is None, or if there is one stage or no
                folder.

        Raises:
            FailedError: A worker process died. Whatever else a stage raises leaves this function as
                well; the results before it are kept.
        """
        results: dict[str, StageResult[T]] = {}
        for stage in stages:
            found = self._read(stage)
            if found is not None:
                results[stage.name] = found
        stale = [stage for stage in stages if stage.name not in results]
        tick = self.progress.next_part([stage.name for stage in stale], [*results])
        # The bar moves by the work of stages, which is more even than by their number.
        total = sum(stage.work for stage in stale)
        done = 0.0
        # A stage alone may use all workers itself, and only this process gives it a folder for
        # further files.
        if executor is None or self.folder is None or len(stale) == 1:
            for stage in stale:
                stage_tick = subprogress(tick, done / total, (done + stage.work) / total)
                results[stage.name] = self._compute(stage, stage_tick)
                done += stage.work
            return results
        stage_of_future = {executor.submit(stage.run, StageContext()): stage for stage in stale}
        # Results are written as they come, so that an interrupted run keeps the finished ones.
        from tempfile import TemporaryDirectory  # takes time to import, as below

        for future in as_completed(stage_of_future):
            stage = stage_of_future[future]
            with _naming_dead_workers(stage.name), TemporaryDirectory() as scratch:
                results[stage.name] = self._write(stage, future.result(), Path(scratch))
            done += stage.work
            tick(done / total)
        return results

    def _read(self, stage: Stage[T]) -> StageResult[T] | None:
        """Return the result of a stage from its files, if they are up to date.

        The name of the stage is then added to `up_to_date`. A warning names a damaged file.

        Args:
            stage: The stage, whose key has all that its result depends on.

        Returns:
            None if the run computes everything anew or keeps no files; if the files are missing,
            changed, or made from something else; or if another version of the program has written
            them.
        """
        folder = self.folder
        key = stage.key
        if folder is None or self.fresh:
            return None
        # The key has all that the result depends on: files that were made from it are up to date.
        numbers_file = f"{stage.name}.json"
        arrays_file = f"{stage.name}.nc"
        files = folder.made_from(key)
        if numbers_file not in files:
            return None
        # Every file of the stage is compared with its digest, figures too: a result is whole or
        # computed anew.
        try:
            contents = {file: folder.content(file) for file in files}
            numbers = from_document(stage.kind, json.loads(contents[numbers_file])["result"])
            data = folder.dataset(arrays_file) if arrays_file in files else None
        except RefusedError as error:
            problem = f"{Path(error.key).name} is {error.value or 'missing'}"
            say(f"warning: {problem}; {stage.name} is computed anew")
            return None
        except ValueError:  # of a version that named numbers otherwise
            return None
        self.up_to_date.append(stage.name)
        LOG.info("stage %s is taken from its files", stage.name)
        return StageResult(numbers, data, files, key)

    def _compute(self, stage: Stage[T], tick: Progress) -> StageResult[T]:
        """Compute a stage and, if there is a folder, write its files.

        Args:
            stage: The stage.
            tick: Called with the completed fraction of its work.

        Raises:
            RefusedError: The folder has files under the names of the result that no run has
                written.
            FailedError: A worker process died. Whatever the stage raises leaves this function as
                well.
        """
        from tempfile import TemporaryDirectory

        LOG.info("stage %s is computed", stage.name)
        folder = self.folder
        with _naming_dead_workers(stage.name), TemporaryDirectory() as temporary:
            if folder is None:
                return stage.run(StageContext(workers=self.workers, tick=tick))
            # Files of others under these names are refused before hours of work, not after them.
            for ending in (".json", ".nc"):
                folder.require_free(f"{stage.name}{ending}")
            samples = None
            if stage.has_samples:
                samples = self._sample_store(folder)
            # Other files go to a temporary folder first: a stage that fails leaves no half result.
            context = StageContext(Path(temporary), samples, self.workers, tick)
            return self._write(stage, stage.run(context), Path(temporary))

    def _sample_store(self, folder: ResultsFolder) -> Path:
        """Return the path of the database of samples in the folder; list it if it is new.

        Listed files belong to the runs in this folder, so that a later run may continue or clear
        them.

        Raises:
            RefusedError: The run is to compute everything anew, and the database that is there is
                listed in no manifest, so that it may be somebody else's.
        """
        path = folder.path / SAMPLES
        is_listed = SAMPLES in folder.files
        is_new = not is_listed and not os.path.lexists(path)
        is_allowed = is_listed or is_new or not self.fresh
        cure = "move it away, or leave out --fresh"
        require(is_allowed, str(path), value="listed in no manifest", allowed="none", cure=cure)
        if rank() == 0 and is_new:
            # It is listed now and not at the end, so that an interrupted run owns it; and without
            # a digest, since it changes with each sample. SQLite keeps a journal beside it.
            folder.add_to_list(dict.fromkeys((SAMPLES, f"{SAMPLES}-journal"), Listed("", "")))
        return path

    def _write(self, stage: Stage[T], computed: StageResult[T], files: Path) -> StageResult[T]:
        """Write a result into the folder, beside the other files of its stage.

        Args:
            stage: The stage.
            computed: Its numbers, and a dataset if it has one.
            files: Temporary folder in which the stage has left other files. NAME.json and NAME.nc
                are added to it, and all are copied into the folder of results, which replaces an
                earlier result.

        Returns:
            The result with the names of its files and its digest; under MPI all but the first rank
            write nothing and return it without files.

        Raises:
            RefusedError: Something else is in the place of a file.
        """
        assert self.folder is not None
        # All MPI ranks compute the same result, and the first one writes it.
        name = f"{stage.name}.json"
        key = stage.key
        if rank() != 0:
            return replace(computed, fingerprint=key)
        provenance = build_provenance(self.case_text, key)
        document = {**provenance, "result": to_document(computed.numbers)}
        write_text(files / name, as_json(document, indent=1))
        if computed.data is not None:
            with whole_file(files / f"{stage.name}.nc") as partial:
                write_arrays(computed.data, partial)
        # `before` is the digest of what the earlier result was made from. Files of it that this
        # result does not replace are removed.
        before = ""
        if name in self.folder.files:
            before = self.folder.files[name].source
        self.folder.put_files(key, files, before)
        return replace(computed, files=self.folder.made_from(key), fingerprint=key)

    def put_text(self, name: str, text: str) -> None:
        """Write a text file of the run itself, such as summary.json."""
        # Under MPI several ranks writing one file would damage it.
        if self.folder is not None and rank() == 0:
            self.folder.put_text(name, text)


@contextmanager
def _naming_dead_workers(stage: str) -> Iterator[None]:
    """Turn the death of a worker process within the block into an error that names the stage.

    Args:
        stage: Name of the stage.

    Raises:
        FailedError: A worker died, for want of memory or by a crash in compiled code.
    """
    try:
        yield
    except BrokenExecutor as error:
        cure = "out of memory, or a crash in compiled code; the stages that are done stay"
        raise FailedError(f"a worker process died in stage {stage}", cure) from error
