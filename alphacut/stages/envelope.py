"""Stage envelope: fuzzy vibration of a structure, one dataset for each study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from alphacut import frame
from alphacut.case.motion import Envelope, Study, Tolerance
from alphacut.case.structure import Structure
from alphacut.frame.methods.named import options_of
from alphacut.frame.questions.peaks import peaks
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError, RefusedError
from alphacut.io.files import Document, say
from alphacut.stages.store import Stage, Store, Work

if TYPE_CHECKING:
    import xarray

FORCES = Tolerance(1e-3, "")
"""Tolerance where none is named and no output is a displacement: a share of each peak."""
FOLLOWERS = ("graph-follower", "improved-graph-follower")


@dataclass(frozen=True)
class EnvelopeTask:
    """One envelope to be computed.

    Args:
        name: Name of the study.
        fuzzy: Fuzzy inputs as the user names them: E, m, m1 …
        duration: Length of the simulation, in s.
        section: Levels, method, step.
        figures: Figure of the paper for each output drawn; empty for none.
        output: The one output drawn; empty for all.
    """

    name: str
    fuzzy: tuple[str, ...]
    duration: float
    section: Envelope
    figures: tuple[str, ...] = ()
    output: str = ""

    def tolerance(self, structure: Structure) -> Tolerance:
        """Error that is allowed, in the unit of some output or as a share.

        Raises:
            RefusedError: No output has that unit.
        """
        units = {Output(name).unit for name in structure.outputs}
        own = self.section.tolerance
        if own.unit in units or not own.unit:
            return own
        if not self.section.names("tolerance"):
            return FORCES
        value = f"{own.value:g} {own.unit}"
        raise RefusedError("envelope.tolerance", value, f"a share, or {', '.join(sorted(units))}")

    def options(self, structure: Structure) -> dict[str, object]:
        """Options of the method. Auto takes any gap that is proved where no tolerance is named."""
        method, own = self.section.method, self.tolerance(structure).value
        if method == "auto" and not self.section.names("tolerance"):
            return {}
        share = self.section.gain if method in FOLLOWERS else 1.0
        every: dict[str, object] = {"tolerance": own * share}
        return {name: every[name] for name in every if name in options_of(method)}

    def compute(self, structure: Structure, work: Work) -> xarray.Dataset:
        """The envelope with the fuzzy peak of each output's magnitude.

        Variables besides those of the envelope: ``peak`` (alpha, bound, output), bounds of it at
        the nodes, and ``peak_error`` (alpha, output), what it may lie outside them by.

        Raises:
            RefusedError: The structure or the method does not take these values.
        """
        try:
            result = frame.envelope(
                structure.model,
                structure.inputs(self.fuzzy),
                duration=self.duration,
                step=self.section.step,
                alpha=self.section.alpha,
                method=self.section.method,
                integrator=self.section.integrator,
                relative=not self.tolerance(structure).unit,
                progress=work.tick or False,
                **self.options(structure),
            )
        except RefusedError:
            raise
        except ValueError as error:
            value, allowed = self.section.method, "a method that takes this structure"
            raise RefusedError("envelope", value, allowed, str(error)) from None
        return with_peaks(result)


def with_peaks(result: frame.Envelope) -> xarray.Dataset:
    """The dataset of an envelope with its peaks."""
    of = peaks(result)
    words = {"units": "SI, by output", "long_name": "largest magnitude at the nodes"}
    ends = np.stack([of.lower, of.upper], axis=1)
    data = result.to_dataset().assign(peak=(("alpha", "bound", "output"), ends, words))
    beyond = {"units": "SI, by output", "long_name": "distance by which peaks may lie outside"}
    data = data.assign(peak_error=(("alpha", "output"), of.error, beyond))
    return data.assign_coords(bound=["lower", "upper"])


def tasks(section: Envelope, studies: Sequence[Study]) -> tuple[EnvelopeTask, ...]:
    """The envelopes of a case: its studies, or the one of [envelope]."""
    several = tuple(
        EnvelopeTask(s.name, s.fuzzy, s.duration, section, tuple(s.figures.values()), _only(s))
        for s in studies
    )
    return several or (EnvelopeTask("all", section.fuzzy, section.duration, section),)


def _only(study: Study) -> str:
    """The output that a study draws alone; empty where it draws several."""
    return next(iter(study.figures)) if len(study.figures) == 1 else ""


def stage(structure: Structure, task: EnvelopeTask) -> Stage:
    """The stage of one study."""
    inputs = [structure.model, structure.numbers, task.fuzzy, task.duration, task.section]

    def compute(work: Work) -> xarray.Dataset:
        return task.compute(structure, work)

    return Stage(f"envelope_{task.name}", inputs, ("fuzzy", "frame"), compute)


def side_by_side(
    store: Store, structure: Structure, every: Sequence[EnvelopeTask], executor: Executor
) -> dict[Future[xarray.Dataset], Stage]:
    """Stale envelopes under way in the executor's processes, the longest first."""
    stages = {task: stage(structure, task) for task in every}
    stale = store.stale(stages.values())
    longest = sorted(every, key=lambda task: -len(task.fuzzy) * task.duration)
    return {
        executor.submit(task.compute, structure, store.work(stages[task])): stages[task]
        for task in longest
        if stages[task] in stale
    }


def document(data: xarray.Dataset, fuzzy: Sequence[str]) -> Document:
    """Extremes over time at the lowest level, peaks, errors, cost, in SI."""
    lowest = data.isel(alpha=0)
    columns = {
        "min": lowest["lower"].min("time").values,
        "max": lowest["upper"].max("time").values,
        "mean_width": (lowest["upper"] - lowest["lower"]).mean("time").values,
    }
    if "error" in data:
        columns["error"] = lowest["error"].max("time").values
    facts = ("trajectories", "seconds", "method", "nature", "claim", "unproved")
    return {
        "fuzzy": list(fuzzy),
        **{key: by_output(data, column) for key, column in columns.items()},
        "alpha": data["alpha"].values,
        "peak": _peak_document(data),
        **{name: data.attrs[name] for name in facts if name in data.attrs},
        "step": float(data["time"].values[1]),
    }


def by_output(data: xarray.Dataset, column: Array) -> dict[str, float]:
    """A number for each output, by its name."""
    return dict(zip(map(str, data["output"].values), map(float, column), strict=True))


def _peak_document(data: xarray.Dataset) -> Mapping[str, dict[str, Array]]:
    """Fuzzy peak of each output by level: ends, and error where there is one."""
    peaks_of = {}
    for name in map(str, data["output"].values):
        ends = {x: data["peak"].sel(bound=x, output=name).values for x in ("lower", "upper")}
        if "peak_error" in data:
            ends["error"] = data["peak_error"].sel(output=name).values
        peaks_of[name] = ends
    return peaks_of


def require_tolerance(data: xarray.Dataset, task: EnvelopeTask, structure: Structure) -> None:
    """Requires declared errors within the tolerance, where the case names one.

    A Graph Follower takes the tolerance as the gain that it goes on for, and cannot promise it: its
    error is declared, and a line says where it is above.

    Raises:
        FailedError: One is larger.
    """
    if "error" not in data or not task.section.names("tolerance"):
        return
    allowed = task.tolerance(structure)
    errors = data["error"].max(("alpha", "time")).values
    peak = data["peak"].sel(bound="upper").max("alpha").values
    for name, error, size in zip(map(str, data["output"].values), errors, peak, strict=True):
        reached = error / size if not allowed.unit and size else error
        if (not allowed.unit or Output(name).unit == allowed.unit) and reached > allowed.value * (
            1 + 1e-9
        ):
            what = f"the error of {name} is {reached:.2g}; the case allows {allowed.value:.2g}"
            cure = "method auto, or a smaller envelope.step, reaches it"
            if data.attrs.get("method") not in FOLLOWERS:
                raise FailedError(what, cure)
            say(f"warning: {what}; {cure}")
