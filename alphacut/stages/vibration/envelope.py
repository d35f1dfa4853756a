"""Envelopes of a case: structure, fuzzy inputs, document and dataset."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut import frame
from alphacut.case.case import Case
from alphacut.case.limits import asked_gap, asked_tolerance, by_auto, names_rough_integrator
from alphacut.frame import Envelope
from alphacut.frame.exceedance import peaks
from alphacut.frame.methods.named import options_of
from alphacut.io.files import Document, say
from alphacut.io.kept_arrays import KeptArrays
from alphacut.io.netcdf import write_dataset
from alphacut.io.problem import BadInput, refuse
from alphacut.io.progress import Tick
from alphacut.io.provenance import attributes, versions
from alphacut.stages.contract import keep
from alphacut.stages.vibration.envelope_task import EnvelopeTask, task_of
from alphacut.stages.vibration.resolution_checks import (
    WITH_TOLERANCE,
    estimated_reason,
    guard_against,
    too_many,
    unproved_reason,
)
from alphacut.stages.vibration.structure import Structure
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray


def compute(
    wanted: Structure,
    task: EnvelopeTask,
    *,
    strict: bool = False,
    workers: int = 1,
    progress: Tick | None = None,
    kept: KeptArrays | None = None,
) -> Envelope:
    """The envelope of all outputs on all levels.

    Args:
        wanted: The structure.
        task: What is wanted.
        strict: Refuse a step or tolerance that is coarse beside the motion instead of warning.
        workers: Processes that share the proof, where a certificate is wanted.
        progress: Told the share done.
        kept: Keeps what is found so far, until the envelope is whole; None for nothing.
    """
    require_affordable(wanted, task)
    guard_against(wanted, task, strict=strict)
    given = arguments(wanted, task)
    if task.certify is not None:
        given["workers"] = workers
    with in_words():
        return frame.envelope(wanted.model, progress=progress or False, kept=kept, **given)


def require_affordable(wanted: Structure, task: EnvelopeTask) -> None:
    """Refuse a certificate with more inputs than a proof is affordable for.

    Raises:
        BadInput: It is asked for.
    """
    if task.certify is not None:
        refuse(too_many("envelope.certify", wanted, task))


def explain(wanted: Structure, task: EnvelopeTask) -> list[str]:
    """A line for each method that would be tried: what it does, and the seconds expected.

    Before them the reason why a certificate that is asked for will not be proved.
    """
    require_affordable(wanted, task)
    reason = unproved_reason(wanted, task) if task.certify is not None else ""
    told = [f"certify: verified by sampling, not proved: {reason}"] if reason else []
    if estimated := estimated_reason(wanted, task):
        told = [f"bounds: estimated, with their error, not proved: {estimated}"]
    with in_words():
        return [*told, *map(str, frame.plan(wanted.model, **arguments(wanted, task)))]


def arguments(wanted: Structure, task: EnvelopeTask) -> Document:
    """What `frame.envelope` and `frame.plan` are called with."""
    return {
        "inputs": wanted.inputs(task.fuzzy),
        "alpha": task.alpha,
        "duration": task.duration,
        "step": task.step,
        "method": task.method,
        "integrator": task.integrator,
        "relative": task.relative and task.certify is None,
        **method_options(task),
    }


@contextmanager
def in_words() -> Iterator[None]:
    """Warnings, each once, and refusals of the library by this program's keys."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yield
        except ValueError as error:
            key, _, what = str(error).partition(": ")
            if key in ("certify", "step"):
                raise BadInput.of(f"envelope.{key}", what) from None
            raise BadInput.of("envelope", str(error)) from None
    for text in dict.fromkeys(
        str(warning.message) for warning in caught if issubclass(warning.category, UserWarning)
    ):
        say(f"warning: {text}")


def method_options(task: EnvelopeTask) -> Document:
    """Those of the task's options that its method has."""
    taken = options_of(task.method)
    offered = {"order": task.order, "tolerance": task.resolution, "exclude": task.exclude}
    if task.certify is not None:
        return {"tolerance": task.tolerance, "certify": task.certify}
    return {name: value for name, value in offered.items() if name in taken}


def document(found: Envelope, tried: Array) -> Document:
    """Result for ``--json``: extremes over time, (α, output), in SI.

    Args:
        found: The envelope.
        tried: Least peak among trajectories tried, shape (A, m).
    """
    of = peaks(found)
    return {
        "alpha": found.alpha,
        "outputs": list(found.outputs),
        "parameters": list(found.parameters),
        "min": found.minimum,
        "max": found.maximum,
        "peak": {"lower": of.lower, "tried": tried, "upper": of.upper, "error": of.error},
        "error": None if found.error is None else found.error.max(1),
        "trajectories": found.trajectories,
        "seconds": found.seconds,
        "method": found.method,
        "nature": found.nature,
        "facts": dict(found.facts),
        "versions": versions(),
    }


def keep_tolerance(case: Case, dataset: xarray.Dataset, *, best_effort: bool) -> None:
    """Require the declared error of an envelope within the case's tolerance, where it names one.

    Args:
        case: The case.
        dataset: The envelope, of which `with_peaks` keeps what was reached.
        best_effort: Only warn.

    Raises:
        ToleranceMissedError: The error is larger.
    """
    asked = asked_tolerance(case)
    if asked is not None and "reached" in dataset.attrs:
        keep(
            float(dataset.attrs["reached"]),
            asked.value,
            of=f"the error of the envelope by method {dataset.attrs['method']}, in {asked.unit},",
            cure=cure(case, dataset),
            best_effort=best_effort,
        )
    elif asked is None:
        tell_rough(task_of(case), dataset)
    gap = asked_gap(case)
    if gap is not None and "gap" in dataset.attrs:
        keep(
            float(dataset.attrs["gap"]),
            gap,
            of="the gap of the {nature} bounds of {gap_output}, in m,".format(**dataset.attrs),
            cure="narrower supports or fewer inputs reach it",
            best_effort=best_effort,
        )


def tell_rough(task: EnvelopeTask, dataset: xarray.Dataset) -> None:
    """A warning where a declared error passes the tolerance that stands in for one asked for."""
    times = float(dataset.attrs.get("reached", 0.0)) / task.tolerance
    if task.certify is None and task.method in WITH_TOLERANCE and times > 1 + 1e-9:
        what = f"a declared error is {times:.2g} times the one wanted, which check prints for each"
        say(f"warning: envelope.tolerance: {what} output; to name a tolerance makes it a failure")


def wide_gap(case: Case) -> Iterator[str]:
    """A remark on a wanted gap that is wider than the tolerance that the case names."""
    gap, asked = asked_gap(case), asked_tolerance(case)
    if gap is not None and asked is not None and asked.unit == "m" and gap > asked.value:
        yield (
            f"envelope.certify: a gap of {gap:g} m may leave errors above envelope.tolerance,"
            f" {asked.value:g} m, which fails after the proof; leave that tolerance out"
        )


def cure(case: Case, dataset: xarray.Dataset) -> str:
    """What would bring the declared error of an envelope below the tolerance."""
    auto = by_auto(case, "envelope.method")
    if case.envelope.certify is not None:
        return "a narrower gap than envelope.certify, or a larger envelope.tolerance, allows it"
    if case.sections.pendulum is None:
        rough = names_rough_integrator(case)
        return f"{auto}{' --set envelope.integrator=exact' if rough else ''} reaches it"
    if "dominant_error" in dataset.attrs:
        return "a smaller envelope.step, or envelope.integrator=composition4, reaches it"
    if dataset.attrs["method"] == "graph-follower":
        return f"a smaller envelope.gain, or {auto}, reaches it"
    return f"{auto} reaches it"


def write(dataset: xarray.Dataset, path: Path | str, *, case_text: str, key: str) -> None:
    """Write an envelope as NetCDF, whole or not at all."""
    write_dataset(dataset, path, attributes(case_text, key))
