"""The envelopes of a case: the structure, its fuzzy inputs, and the result as a document and a dataset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

from alphacut.accelerogram import accelerogram
from alphacut.case import Case
from alphacut.consistency import beside
from alphacut.output import say, whole_file
from alphacut.problem import BadInput, Problem
from alphacut.progress import Tick
from alphacut.provenance import attributes, versions
from fuzzy import FuzzyNumber

if TYPE_CHECKING:
    import xarray

    from frame import Envelope, StoreyFrame

LISTS = {"m": "masses", "l": "lengths", "d": "dampers"}
RAYLEIGH = ("rayleigh_mass", "rayleigh_stiffness")
STARTS = {"q": "displacements", "v": "velocities"}


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
        tolerance: Gain that is worth a new trajectory, in m.
    """

    fuzzy: tuple[str, ...]
    duration: float
    step: float
    alpha: tuple[float, ...]
    method: str
    integrator: str | None
    order: int
    tolerance: float


def task_of(case: Case, *, fuzzy: Sequence[str] | None = None, duration: float | None = None) -> EnvelopeTask:
    """The envelope that [envelope] asks for, with other fuzzy inputs or another duration if given."""
    return EnvelopeTask(
        tuple(fuzzy) if fuzzy else case.names("envelope.fuzzy"),
        duration or case.number("envelope.duration"),
        case.number("envelope.step"),
        case.numbers("envelope.alpha"),
        case.text("envelope.method"),
        case.text("envelope.integrator") if case.has("envelope.integrator") else None,
        case.integer("envelope.order"),
        case.number("envelope.tolerance"),
    )


def per_floor(case: Case, key: str) -> tuple[FuzzyNumber, ...]:
    """One value for each floor; a single one holds for all of them."""
    values, floors = case.fuzzies(key), len(case.fuzzies("frame.masses"))
    return values * floors if len(values) == 1 else values


def numbers(case: Case, modulus: FuzzyNumber) -> dict[str, FuzzyNumber]:
    """Every parameter of the frame by the name that `frame` gives it, in SI."""
    found = {"E": modulus, "I": case.fuzzy("frame.second_moment")}
    found |= {name: case.fuzzy(f"frame.{name}") for name in RAYLEIGH}
    for letter, key in LISTS.items():
        found |= {f"{letter}{floor}": value for floor, value in enumerate(per_floor(case, f"frame.{key}"), start=1)}
    for letter, key in STARTS.items():
        found |= {f"{letter}{floor}_0": value for floor, value in enumerate(per_floor(case, f"frame.{key}"), start=1)}
    return found


def structure(case: Case, modulus: FuzzyNumber) -> StoreyFrame:
    """The frame at the modal values of its parameters."""
    from frame import StoreyFrame

    modal = {name: tuple(x.modal for x in per_floor(case, f"frame.{name}")) for name in (*LISTS.values(), *STARTS.values())}
    return StoreyFrame(
        modal["masses"],
        modal["lengths"],
        modulus.modal,
        case.fuzzy("frame.second_moment").modal,
        dampers=modal["dampers"],
        damper_placement=cast(Literal["ground", "storey"], case.text("frame.damper_placement")),
        q0=modal["displacements"],
        v0=modal["velocities"],
        outputs=case.names("frame.outputs"),
        rayleigh=(case.fuzzy("frame.rayleigh_mass").modal, case.fuzzy("frame.rayleigh_stiffness").modal),
        ground=accelerogram(beside(case, case.text("frame.accelerogram"))) if case.has("frame.accelerogram") else None,
    )


def modulus_of(case: Case, given: FuzzyNumber | None) -> FuzzyNumber:
    """The modulus handed on, else the frame's own.

    Raises:
        BadInput: There is none.
    """
    if given is not None:
        return given
    if not case.has("frame.modulus"):
        raise BadInput(Problem("frame.modulus", "missing: give it in the case or by --modulus", file=str(case.path)))
    return case.fuzzy("frame.modulus")


def fuzzy_inputs(model: StoreyFrame, names: Sequence[str], values: Mapping[str, FuzzyNumber]) -> dict[str, FuzzyNumber]:
    """The fuzzy inputs that the names stand for; those of a group that are crisp are left out.

    Raises:
        BadInput: A name stands for nothing, or for nothing fuzzy.
    """
    found: dict[str, FuzzyNumber] = {}
    for name in names:
        try:
            members = {member: values[member] for member in model.group(name) if values[member].support.width > 0}
        except (ValueError, KeyError) as error:
            raise BadInput(Problem("envelope.fuzzy", " ".join(str(error.args[0]).split()), name)) from None
        if not members:
            raise BadInput(Problem("envelope.fuzzy", "this input is crisp in the case", name, "an input with a triangle or an interval"))
        found |= members
    return found


def guard_step(model: StoreyFrame, task: EnvelopeTask, *, strict: bool) -> None:
    """Warn where the step cannot resolve the fastest mode, with the phase error that means.

    Raises:
        BadInput: `strict`, and the step cannot.
    """
    from frame import guard

    if task.integrator == "exact" or (task.integrator is None and task.method == "modal"):
        return
    found = guard(model, task.step, task.duration)
    if not found.ok and strict:
        raise BadInput(Problem("envelope.step", found.message.removeprefix("step: ")))
    if not found.ok:
        say(f"warning: envelope.{found.message}")


def compute(
    case: Case, task: EnvelopeTask, *, modulus: FuzzyNumber | None = None, strict: bool = False, progress: Tick | None = None
) -> Envelope:
    """The envelope of all outputs on all levels.

    Args:
        case: With the sections frame and envelope.
        task: What is wanted.
        modulus: Handed on from the stage before, in Pa.
        strict: Refuse a step that cannot resolve the fastest mode instead of warning.
        progress: Told the share done.
    """
    import frame

    young = modulus_of(case, modulus)
    try:
        model = structure(case, young)
    except ValueError as error:
        raise BadInput(Problem("frame", str(error), file=str(case.path))) from None
    guard_step(model, task, strict=strict)
    inputs = fuzzy_inputs(model, task.fuzzy, numbers(case, young))
    return frame.envelope(
        model,
        inputs,
        alpha=task.alpha,
        duration=task.duration,
        step=task.step,
        method=task.method,
        integrator=task.integrator,
        progress=progress,
        **method_options(task),
    )


def method_options(task: EnvelopeTask) -> dict[str, float]:
    """Those of the task's options that its method has."""
    import inspect

    from frame import METHODS, GraphFollower

    taken = set(inspect.signature(METHODS[task.method]).parameters)
    if task.method == "graph-follower":
        taken |= {field.name for field in fields(GraphFollower)}
    return {name: value for name, value in (("order", task.order), ("tolerance", task.tolerance)) if name in taken}


def document(found: Envelope) -> dict[str, Any]:
    """The result as it is printed with ``--json``: extremes over time, one row for each α, one column for each output, in SI."""
    return {
        "alpha": found.alpha,
        "outputs": list(found.outputs),
        "parameters": list(found.parameters),
        "min": found.minimum,
        "max": found.maximum,
        "trajectories": found.trajectories,
        "seconds": found.seconds,
        "method": found.method,
        "nature": found.nature,
        "facts": dict(found.facts),
        "versions": versions(),
    }


def write(dataset: xarray.Dataset, path: Path | str, *, case_text: str, key: str) -> None:
    """Write an envelope as NetCDF, whole or not at all."""
    with whole_file(path) as partial:
        dataset.assign_attrs(attributes(case_text, key)).to_netcdf(partial)


def with_fuzzy(task: EnvelopeTask, names: str) -> EnvelopeTask:
    """The task with the fuzzy inputs of ``--fuzzy E,m``."""
    return replace(task, fuzzy=tuple(name.strip() for name in names.split(",") if name.strip()))
