"""One mechanism for all stages: a dataset in a file, taken up again while its fingerprint holds."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.io.netcdf import fingerprint_of, read_dataset, write_dataset
from alphacut.io.progress import Tick, progress
from alphacut.io.provenance import attributes, fingerprint

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Work:
    """Surroundings of one computation.

    Args:
        folder: Folder for what is kept on the way; None to keep nothing.
        key: Fingerprint of the stage.
        fresh: Whether what an earlier run kept is passed over.
        workers: Processes.
        tick: Takes the share done; None to show nothing.
    """

    folder: Path | None = None
    key: str = ""
    fresh: bool = False
    workers: int = 1
    tick: Tick | None = None


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
        return fingerprint({"inputs": self.inputs}, self.packages)

    def once(
        self, *, workers: int = 1, quiet: bool = False, kept: Path | None = None
    ) -> xarray.Dataset:
        """The dataset, computed without a store; what is unfinished stays in the folder `kept`."""
        with progress(self.name, quiet=quiet) as tick:
            return self.compute(Work(kept, self.key, workers=workers, tick=tick))


@dataclass(frozen=True)
class Store:
    """Folder of the results of a run.

    Args:
        folder: The folder.
        case_text: The case, which every file carries.
        fresh: Whether everything is computed anew.
        quiet: Whether nothing is shown.
        workers: Processes of a stage.
        taken: Names of the stages whose files were up to date.
    """

    folder: Path
    case_text: str
    fresh: bool = False
    quiet: bool = False
    workers: int = 1
    taken: list[str] = field(default_factory=list)

    def file(self, name: str) -> Path:
        """A file among the results."""
        return self.folder / name

    def take(self, stage: Stage) -> xarray.Dataset:
        """The dataset of a stage: from its file where that is up to date, else computed."""
        if not self.current(stage):
            with progress(stage.name, quiet=self.quiet) as tick:
                self.put(stage, stage.compute(self.work(stage, tick)))
        return read_dataset(self.file(f"{stage.name}.nc"))

    def work(self, stage: Stage, tick: Tick | None = None) -> Work:
        """Surroundings of the stage's computation."""
        return Work(self.folder, stage.key, self.fresh, self.workers, tick)

    def put(self, stage: Stage, dataset: xarray.Dataset) -> None:
        """Writes a stage's dataset, whole or not at all."""
        facts = attributes(self.case_text, stage.key)
        write_dataset(dataset, self.file(f"{stage.name}.nc"), facts)

    def current(self, stage: Stage) -> bool:
        """True if the file of a stage may be taken, which is then noted."""
        path = self.file(f"{stage.name}.nc")
        if self.fresh or not path.is_file() or fingerprint_of(path) != stage.key:
            return False
        self.taken.append(stage.name)
        return True

    def stale(self, stages: Iterable[Stage]) -> list[Stage]:
        """Stages whose files may not be taken."""
        return [stage for stage in stages if not self.current(stage)]
