"""Studies of a case, each an envelope, and their computation side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import TYPE_CHECKING

from alphacut.case.case import Case
from alphacut.io.kept_arrays import KeptArrays
from alphacut.io.progress import Tick
from alphacut.stages.vibration import envelope
from alphacut.stages.vibration import exceedance as outcomes
from alphacut.stages.vibration.accelerogram import cut_short
from alphacut.stages.vibration.envelope_task import EnvelopeTask, task_of
from alphacut.stages.vibration.structure import Structure

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Study:
    """One envelope of a run.

    Args:
        name: Its file is envelope_NAME.nc.
        task: What is computed.
        figures: Figure of the paper for each output drawn; empty for none.
        output: The one output drawn; empty for all.
    """

    name: str
    task: EnvelopeTask
    figures: tuple[str, ...] = ()
    output: str = ""

    @property
    def file(self) -> str:
        """Name of its file."""
        return f"envelope_{self.name}.nc"


def studies(case: Case) -> tuple[Study, ...]:
    """The studies of a case: its [[study]] tables, or one made of [envelope]."""
    given = case.sections.study
    return tuple(
        Study(
            study.name,
            task_of(case, fuzzy=study.fuzzy, duration=study.duration),
            study.figures,
            study.output,
        )
        for study in given
    ) or (Study("all", task_of(case)),)


def left_out(wanted: Structure, tasks: Iterable[EnvelopeTask]) -> list[str]:
    """Fuzzy inputs that none of the tasks names: their values do not vary."""
    named = {name for task in tasks for name in wanted.inputs(task.fuzzy)}
    spread = (name for name, number in wanted.numbers.items() if number.support.width > 0)
    return [name for name in spread if name not in named]


def fixed_line(names: Iterable[str]) -> list[str]:
    """A line on inputs that are left out; none where every fuzzy input varies."""
    told = ", ".join(names)
    what = "fixed at the middle of the top cut, since no study names them"
    return [f"{what}: {told}"] if told else []


def cut_line(wanted: Structure, tasks: Iterable[EnvelopeTask]) -> list[str]:
    """A line where none of the tasks simulates the whole record."""
    ground = None if wanted.linear is None else wanted.linear.ground
    longest = max((task.duration for task in tasks), default=0.0)
    if ground is None or not cut_short(ground, longest):
        return []
    return [f"all results are of the first {longest:g} s of the record: its rest is left out"]


def envelope_of(
    wanted: Structure,
    task: EnvelopeTask,
    kept: KeptArrays,
    *,
    workers: int = 1,
    progress: Tick | None = None,
) -> xarray.Dataset:
    """The envelope of a task with its peaks; goes on from what is kept."""
    found = envelope.compute(wanted, task, workers=workers, progress=progress, kept=kept)
    return outcomes.with_peaks(found, wanted, task)


def side_by_side(
    wanted: Structure, begun: Mapping[Study, KeptArrays], executor: Executor
) -> dict[Future[xarray.Dataset], Study]:
    """Envelopes of studies under way, each in one of the executor's processes; longest first."""
    first = sorted(begun, key=lambda study: -len(study.task.fuzzy) * study.task.duration)
    return {
        executor.submit(envelope_of, wanted, study.task, begun[study]): study for study in first
    }
