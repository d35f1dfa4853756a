"""Envelopes of a case: structure, fuzzy inputs, document and dataset."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from alphacut.case.case import Case
from alphacut.case.checks import displacements
from alphacut.fuzzy import FuzzyNumber
from alphacut.io.files import say, whole_file
from alphacut.io.problem import BadInput, Problem
from alphacut.io.progress import Tick
from alphacut.io.provenance import attributes, versions
from alphacut.stages.contract import keep
from alphacut.stages.resolution_checks import guard_against
from alphacut.stages.structure import Structure, structure
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray

    from alphacut.frame import Envelope

TOLERANCES = ("envelope.relative_tolerance", "envelope.tolerance", "pendulum.tolerance")
SHARE = 1e-3  # the tolerance where no output is a displacement: of their peaks


@dataclass(frozen=True)
class EnvelopeTask:
    """One envelope to be computed.

    Args:
        fuzzy: Fuzzy inputs as the user names them: E, m, m1 …
        duration: Length of the simulation, in s.
        step: Time step, in s.
        alpha: Levels, rising.
        method: How the envelope is found.
        integrator: Time stepping; None leaves it to the method.
        order: Order κ of the Taylor models.
        tolerance: Gain that is worth a new trajectory, or the error wanted of auto, in the unit of
            the outputs.
        exclude: Methods that auto must not take.
        certify: Gap between attained and proved bounds that is wanted, in the unit of the outputs;
            None for no certificate.
        relative: Whether the tolerance is a share of each output's peak.
    """

    fuzzy: tuple[str, ...]
    duration: float
    step: float
    alpha: tuple[float, ...]
    method: str
    integrator: str | None
    order: int
    tolerance: float
    exclude: tuple[str, ...] = ()
    certify: float | None = None
    relative: bool = False

    @property
    def scheme(self) -> str:
        """Time stepping of a linear structure: integrator, or the method's own."""
        return self.integrator or ("exact" if self.method in ("auto", "modal") else "midpoint")


def task_of(
    case: Case, *, fuzzy: Sequence[str] | None = None, duration: float | None = None
) -> EnvelopeTask:
    """Envelope that [envelope] asks for, with other inputs or duration if given."""
    tolerance = "pendulum.tolerance" if case.has("pendulum.mass") else "envelope.tolerance"
    relative, method = case.has("envelope.relative_tolerance"), case.text("envelope.method")
    forces = (
        case.has("frame.masses") and bool(case.names("frame.outputs")) and not displacements(case)
    )
    certify = case.number("envelope.certify") if case.has("envelope.certify") else None
    return EnvelopeTask(
        tuple(fuzzy) if fuzzy else case.names("envelope.fuzzy"),
        duration or case.number("envelope.duration"),
        case.number("envelope.step"),
        case.numbers("envelope.alpha"),
        "modal" if certify is not None and method == "auto" else method,
        case.text("envelope.integrator") if case.has("envelope.integrator") else None,
        case.integer("envelope.order"),
        (
            case.number("envelope.relative_tolerance")
            if relative
            else SHARE
            if forces
            else case.number(tolerance)
        ),
        certify=certify,
        relative=relative or forces,
    )


def compute(
    case: Case,
    task: EnvelopeTask,
    *,
    modulus: FuzzyNumber | None = None,
    strict: bool = False,
    workers: int = 1,
    progress: Tick | None = None,
) -> Envelope:
    """The envelope of all outputs on all levels.

    Args:
        case: With the sections envelope and frame or pendulum.
        task: What is wanted.
        modulus: Handed on from the stage before, in Pa.
        strict: Refuse a step or tolerance that is coarse beside the motion instead of warning.
        workers: Processes that share the proof, where a certificate is wanted.
        progress: Told the share done.
    """
    from alphacut import frame

    wanted = structure(case, modulus)
    inputs = wanted.inputs(task.fuzzy)
    guard_against(wanted, task, strict=strict)
    try:
        with told_once():
            return frame.envelope(
                wanted.model,
                inputs,
                alpha=task.alpha,
                duration=task.duration,
                step=task.step,
                method=task.method,
                integrator=task.integrator,
                relative=task.relative and task.certify is None,
                progress=progress,
                **method_options(task),
                **({"workers": workers} if task.certify is not None else {}),
            )
    except ValueError as error:
        raise BadInput(Problem("envelope", str(error))) from None


@contextmanager
def told_once() -> Iterator[None]:
    """Warnings of the library in the words of this program, each once."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for text in dict.fromkeys(
        str(warning.message) for warning in caught if issubclass(warning.category, UserWarning)
    ):
        say(f"warning: {text}")


def method_options(task: EnvelopeTask) -> dict[str, Any]:
    """Those of the task's options that its method has."""
    import inspect

    from alphacut.frame import METHODS, GraphFollower
    from alphacut.frame.methods.modal import Modal

    taken = set(inspect.signature(METHODS[task.method]).parameters)
    if task.method.endswith("graph-follower"):
        taken |= {field.name for field in fields(GraphFollower)}
    if task.method == "modal":
        taken |= {field.name for field in fields(Modal)}
    offered = {"order": task.order, "tolerance": task.tolerance, "exclude": task.exclude}
    if task.certify is not None:
        return {"tolerance": task.tolerance, "certify": task.certify}
    return {name: value for name, value in offered.items() if name in taken}


def document(found: Envelope, tried: Array) -> dict[str, Any]:
    """Result for ``--json``: extremes over time, (α, output), in SI.

    Args:
        found: The envelope.
        tried: Least peak among trajectories tried, shape (A, m).
    """
    from alphacut.frame.exceedance import peaks

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


def reached(found: Envelope, wanted: Structure, task: EnvelopeTask) -> float | None:
    """Largest declared error in the tolerance's measure; None where no error is declared."""
    from alphacut.frame.boxes import UnitFlow, boxes

    if found.error is None:
        return None
    cuts = boxes(wanted.inputs(task.fuzzy), task.alpha)
    scheme = task.scheme if wanted.linear is not None else task.integrator
    flow = wanted.flow(cuts.names, task.duration, task.step, scheme)
    scale = UnitFlow(flow, cuts, task.relative and task.certify is None).scale
    return float((found.error.max((0, 1)) / scale).max())


def keep_tolerance(case: Case, dataset: xarray.Dataset, *, best_effort: bool) -> None:
    """Require the declared error of an envelope within the case's tolerance, where it names one.

    Args:
        case: The case.
        dataset: The envelope, of which `with_peaks` keeps what was reached.
        best_effort: Only warn.

    Raises:
        ToleranceMissedError: The error is larger.
    """
    asked = [key for key in TOLERANCES if case.asked(key)]
    if not asked or "reached" not in dataset.attrs:
        return
    unit = {"envelope.tolerance": " m", "pendulum.tolerance": " N"}.get(asked[0], " of a peak")
    keep(
        float(dataset.attrs["reached"]),
        case.number(asked[0]),
        of=f"the error of the envelope by method {dataset.attrs['method']}, in{unit},",
        cure="--method auto reaches it",
        best_effort=best_effort,
    )


def write(dataset: xarray.Dataset, path: Path | str, *, case_text: str, key: str) -> None:
    """Write an envelope as NetCDF, whole or not at all."""
    with whole_file(path) as partial:
        dataset.assign_attrs(attributes(case_text, key)).to_netcdf(partial)
