"""Envelopes of a case: structure, fuzzy inputs, document and dataset."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut import frame
from alphacut.case.case import Case
from alphacut.case.limits import asked_gap, asked_tolerance
from alphacut.frame import Envelope
from alphacut.frame.exceedance import peaks
from alphacut.frame.methods.named import options_of
from alphacut.io.files import Document, say
from alphacut.io.kept_arrays import KeptArrays
from alphacut.io.netcdf import write_dataset
from alphacut.io.problem import BadInput
from alphacut.io.progress import Tick
from alphacut.io.provenance import attributes, versions
from alphacut.stages.tolerance import require_within
from alphacut.stages.vibration.envelope_task import EnvelopeTask
from alphacut.stages.vibration.structure import Structure
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray


def compute(
    wanted: Structure,
    task: EnvelopeTask,
    *,
    workers: int = 1,
    progress: Tick | None = None,
    kept: KeptArrays | None = None,
) -> Envelope:
    """The envelope of all outputs on all levels.

    Args:
        wanted: The structure.
        task: What is wanted.
        workers: Processes that share the proof, where a certificate is wanted.
        progress: Told the share done.
        kept: Keeps what is found so far, until the envelope is whole; None for nothing.
    """
    given = arguments(wanted, task)
    if task.certify is not None:
        given["workers"] = workers
    with in_words():
        return frame.envelope(wanted.model, progress=progress or False, **given)


def arguments(wanted: Structure, task: EnvelopeTask) -> Document:
    """What `frame.envelope` and `frame.plan` are called with."""
    return {
        "inputs": wanted.inputs(task.fuzzy),
        "alpha": task.alpha,
        "duration": task.duration,
        "step": task.step,
        "method": named(task),
        "integrator": task.integrator,
        "relative": task.relative and task.certify is None,
        **method_options(task),
    }


def named(task: EnvelopeTask) -> str:
    """The method's name in the library."""
    if task.method != "modal":
        return task.method
    return "proof" if task.certify is not None else "search"


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
    taken = options_of(named(task))
    offered = {"order": task.order, "tolerance": task.resolution, "exclude": task.exclude}
    if task.certify is not None:
        return {"gap": task.certify}
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


def keep_tolerance(case: Case, dataset: xarray.Dataset) -> None:
    """Require the declared error of an envelope within the case's tolerance, where it names one.

    Args:
        case: The case.
        dataset: The envelope, of which `with_peaks` keeps what was reached.

    Raises:
        FailedError: The error is larger.
    """
    method, tolerance = dataset.attrs["method"], asked_tolerance(case)
    if tolerance is not None and "reached" in dataset.attrs:
        require_within(
            float(dataset.attrs["reached"]),
            tolerance.value,
            of=f"the envelope by method {method}, in {tolerance.unit},",
            cure='envelope.method = "auto" or a smaller envelope.step reaches it',
        )
    gap = asked_gap(case)
    if gap is not None and "gap" in dataset.attrs:
        require_within(
            float(dataset.attrs["gap"]),
            gap,
            of="the gap of the bounds, in m,",
            cure="narrower supports or fewer inputs reach it",
        )


def write(dataset: xarray.Dataset, path: Path | str, *, case_text: str, key: str) -> None:
    """Write an envelope as NetCDF, whole or not at all."""
    write_dataset(dataset, path, attributes(case_text, key))
