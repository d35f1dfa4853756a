"""One mechanism for all stages: a dataset in a file, taken up again while its fingerprint holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.fuzzy.progress_bar import Progress, showing
from alphacut.io.files import rank, whole_file
from alphacut.io.netcdf import fingerprint_of, read_dataset
from alphacut.io.provenance import attributes, fingerprint

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Work:
    """Surroundings of one computation.

    Args:
        folder: Folder for what is kept on the way; None to keep nothing.
        workers: Processes.
        tick: Takes the share done; None to show nothing.
    """

    folder: Path | None = None
    workers: int = 1
    tick: Progress | None = None


@dataclass(frozen=True)
class Stage:
    """A function from objects to a dataset.

    Args:
        name: Its file is NAME.nc.
        inputs: Everything that the dataset depends on.
        packages: Packages of this project whose source it depends on.
        compute: The function.
    """

    name: str
    inputs: object
    packages: tuple[str, ...]
    compute: Callable[[Work], xarray.Dataset]

    @property
    def key(self) -> str:
        """Fingerprint of inputs, source and libraries."""
        return fingerprint(self.inputs, self.packages)


@dataclass(frozen=True)
class Store:
    """Folder of the results of a run.

    Args:
        folder: The folder; None to keep nothing.
        case_text: The case, which every file carries.
        fresh: Whether everything is computed anew.
        quiet: Whether nothing is shown.
        workers: Processes of a stage.
        taken: Names of the stages whose files were up to date.
    """

    folder: Path | None
    case_text: str
    fresh: bool = False
    quiet: bool = False
    workers: int = 1
    taken: list[str] = field(default_factory=list)

    @property
    def shown(self) -> bool:
        """True where progress is shown, by the first rank alone."""
        return not self.quiet and rank() == 0

    def take(self, stage: Stage) -> xarray.Dataset:
        """The dataset of a stage: from its file where that is up to date, else computed."""
        if not self._current(stage):
            if self.folder is not None:
                self.folder.mkdir(parents=True, exist_ok=True)
            with showing(self.shown) as tick:
                data = stage.compute(Work(self.folder, self.workers, tick))
            if self.folder is None:
                return data
            self._put(stage, data)
        return read_dataset(self._file(stage))

    def take_all(
        self, stages: Sequence[Stage], executor: Executor | None
    ) -> dict[str, xarray.Dataset]:
        """The datasets of several stages by their names, computed side by side by an executor.

        Args:
            stages: Those that take longest first.
            executor: Processes; None where this one does everything.
        """
        if executor is None or self.folder is None or len(stages) == 1:
            return {stage.name: self.take(stage) for stage in stages}
        work = Work(self.folder)
        stale = [stage for stage in stages if not self._current(stage)]
        under_way = {executor.submit(stage.compute, work): stage for stage in stale}
        with showing(self.shown) as tick:
            for done, future in enumerate(as_completed(under_way), start=1):
                self._put(under_way[future], future.result())
                if tick:
                    tick(done / len(under_way))
        return {stage.name: read_dataset(self._file(stage)) for stage in stages}

    def _file(self, stage: Stage) -> Path:
        return (self.folder or Path()) / f"{stage.name}.nc"

    def _put(self, stage: Stage, dataset: xarray.Dataset) -> None:
        """Writes a stage's dataset, whole or not at all."""
        with whole_file(self._file(stage)) as partial:
            dataset.assign_attrs(attributes(self.case_text, stage.key)).to_netcdf(partial)

    def _current(self, stage: Stage) -> bool:
        """True if the file of a stage may be taken."""
        path = self._file(stage)
        if self.folder is None or self.fresh or not path.is_file():
            return False
        current = fingerprint_of(path) == stage.key
        self.taken.extend([stage.name] * current)
        return current
