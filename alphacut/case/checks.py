"""Checks of a case as a whole, beyond single values."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from alphacut.case.case import Case
from alphacut.case.checks_image import image
from alphacut.case.checks_material import particles, radius
from alphacut.case.checks_structure import incomplete
from alphacut.case.idle import idle_envelope
from alphacut.case.limits import limit_of, storey_height
from alphacut.case.names import OTHERS, OUTPUTS, floors, named_inputs, study_count
from alphacut.case.schema import ENVELOPE_METHODS, INTEGRATORS, NEEDED, NONLINEAR, STAGES
from alphacut.case.values import nearest
from alphacut.io.output_paths import hint
from alphacut.io.problem import BadInput, Problem

Check = Callable[[Case], Iterator[Problem]]

MOST_STEPS = 1_000_000  # more would not fit into memory, and no figure could show them
FILES = (
    "microstructure.packing.file",
    "microstructure.circles.file",
    "microstructure.image.file",
    "cell.image",
    "cell.polygons",
    "modulus.file",
    "modulus.measured",
    "frame.accelerogram",
    "tower.accelerogram",
)


def checks(*, modal: bool = False) -> Iterator[Check]:
    """Every check of a case whose single values are all right; each finds problems of its own."""
    yield order_of_stages
    yield missing_sections
    yield files
    yield incomplete
    yield where("microstructure.seed", particles)
    yield where("radius.a1", partial(radius, alpha=1.0 if modal else 0.0))
    yield where("response.quantity", stress_curves)
    yield one_modulus
    yield where("cell.boundary", image)
    for section in ("modulus", "envelope"):
        yield where(f"{section}.alpha", partial(levels, key=f"{section}.alpha"))
    yield where("frame.masses", floors)
    yield other_structures
    yield one_structure
    yield where("envelope.step", times)
    yield tolerances
    yield where("envelope.method", methods)
    yield idle_envelope
    yield where("exceedance.output", exceedance)


def where(key: str, check: Check) -> Check:
    """The check, of cases that hold the key."""
    return lambda case: check(case) if case.has(key) else iter(())


def one_modulus(case: Case) -> Iterator[Problem]:
    """At most one thing stands in for the computed modulus, and an image is one."""
    if "image" in case.stages and ("modulus" in case.stages or replaced(case)):
        yield Problem(
            "stages",
            "stage image gives the modulus, and so does another",
            ", ".join(["image", *stand_ins(case)]),
            "one of stage image, stage modulus, modulus.value, modulus.file, modulus.measured",
        )
    if len(stand_ins(case)) > 1:
        yield Problem(
            stand_ins(case)[1],
            f"more than one modulus is given: {', '.join(stand_ins(case))}",
            allowed="one of them",
        )


def other_structures(case: Case) -> Iterator[Problem]:
    """The inputs of structures beside the storey frame."""
    for section, names in OTHERS.items():
        if any(key.startswith(f"{section}.") for key in case.values):
            yield from named_inputs(case, section, names)


def one_structure(case: Case) -> Iterator[Problem]:
    """Exactly one structure vibrates."""
    found = [
        name
        for name in ("frame", *OTHERS)
        if any(key.startswith(f"{name}.") for key in case.values)
    ]
    if "envelope" in case.stages and len(found) != 1:
        yield Problem(
            "frame",
            f"stage envelope needs one structure, got {len(found)}",
            ", ".join(found),
            "[frame], [pendulum] or [tower]",
        )


def tolerances(case: Case) -> Iterator[Problem]:
    """One tolerance, in the unit of the output."""
    if case.has("envelope.relative_tolerance") and any(
        f"{name}.tolerance" in case.written for name in ("envelope", "pendulum")
    ):
        yield Problem(
            "envelope.relative_tolerance",
            "there is a tolerance besides",
            allowed="one of tolerance and relative_tolerance",
        )
    if case.has("frame.masses") and case.names("frame.outputs") and not displacements(case):
        for name in ("tolerance", "certify"):
            if f"envelope.{name}" in case.written:
                allowed = "envelope.relative_tolerance, or an output such as q1 or drift1 besides"
                yield Problem(
                    f"envelope.{name}",
                    "this is a length, and no output is a displacement",
                    as_text(case, name),
                    allowed,
                )
    if case.has("pendulum.mass") and "envelope.tolerance" in case.written:
        yield Problem(
            "envelope.tolerance",
            "a pendulum's output is a force",
            allowed="pendulum.tolerance, or envelope.relative_tolerance",
        )


def displacements(case: Case) -> list[str]:
    """The outputs of a frame that are displacements."""
    return [name for name in case.names("frame.outputs") if name.startswith(("q", "drift"))]


def as_text(case: Case, name: str) -> str:
    """A key of [envelope] as it is written."""
    return str(case.written[f"envelope.{name}"])


def order_of_stages(case: Case) -> Iterator[Problem]:
    """Stages stand in the order in which each hands on to the next."""
    if list(case.stages) != sorted(case.stages, key=STAGES.index):
        yield Problem(
            "stages", "the stages are not in their order", str(list(case.stages)), ", ".join(STAGES)
        )
    names = [case.text(f"study[{i}].name") for i in range(study_count(case))]
    for index, name in enumerate(names):
        if not re.fullmatch(r"[\w.+-]+", name):
            yield Problem(
                f"study[{index}].name",
                "a file will be called so",
                name,
                "letters, digits and . _ + -",
            )
        if name in names[:index]:
            yield Problem(f"study[{index}].name", "another study has this name", name)


def stress_curves(case: Case) -> Iterator[Problem]:
    """The response needs the stress curves of a computed modulus, and each probability once."""
    if replaced(case):
        yield Problem(
            "response",
            "its stresses come from the samples of stage modulus",
            allowed="this section where the modulus is computed",
        )
    probabilities = case.numbers("response.quantiles")
    if list(probabilities) != sorted(set(probabilities)):
        yield Problem(
            "response.quantiles",
            "the probabilities are not in rising order",
            str(list(probabilities)),
            "for example [0.05, 0.95]",
        )


def replaced(case: Case) -> bool:
    """True if something stands in for the computed modulus."""
    return bool(stand_ins(case))


def stand_ins(case: Case) -> list[str]:
    """Keys of what stands in for the computed modulus."""
    return [key for name in ("value", "file", "measured") if case.has(key := f"modulus.{name}")]


def missing_sections(case: Case) -> Iterator[Problem]:
    """Sections that the wanted stages need."""
    for stage in case.stages:
        for section in NEEDED.get(stage, ()):
            if section == "radius" and "microstructure" in case.stages:
                continue
            if not any(key.startswith(f"{section}.") for key in case.values) and not (
                stage == "modulus" and replaced(case)
            ):
                made = section == "radius" and any(
                    key.startswith("microstructure.") for key in case.values
                )
                cure = (
                    'or "microstructure" among the stages, which makes it from the particles'
                    if made
                    else ""
                )
                yield Problem(
                    section, f"section [{section}] is missing; stage {stage} needs it", allowed=cure
                )
    if "microstructure" in case.stages and any(
        key.startswith("radius.") and key != "radius.theta" for key in case.written
    ):
        yield Problem(
            "radius",
            "stage microstructure makes this section from the particles",
            allowed="one of section and stage",
        )


def files(case: Case) -> Iterator[Problem]:
    """Files that the case names must be there."""
    for key in FILES:
        if case.has(key) and not (path := beside(case, case.text(key))).is_file():
            what = "this is a folder" if path.is_dir() else "there is no such file"
            yield Problem(
                key,
                what,
                case.text(key),
                hint(path) or f"a path from the case's folder, {case.path.parent}",
            )


def beside(case: Case, name: str) -> Path:
    """A file that the case names, looked for from the case's folder."""
    return case.path.parent / name


def levels(case: Case, key: str) -> Iterator[Problem]:
    """α-levels must rise."""
    alpha = case.numbers(key)
    if any(low >= high for low, high in itertools.pairwise(alpha)):
        yield Problem(
            key,
            "the α-levels are not in rising order",
            str(list(alpha)),
            "for example [0, 0.25, 0.5, 0.75, 1]",
        )


def methods(case: Case) -> Iterator[Problem]:
    """A method and a time stepping that the structure's kind has."""
    if case.has("pendulum.mass") and case.text("envelope.method") == "modal":
        yield Problem(
            "envelope.method",
            "a pendulum has no modes",
            "modal",
            ", ".join(x for x in ENVELOPE_METHODS if x != "modal"),
        )
    if case.has("envelope.certify") and (
        case.has("pendulum.mass") or case.text("envelope.method") not in ("auto", "modal")
    ):
        found = (
            "a pendulum cannot be certified"
            if case.has("pendulum.mass")
            else f"method {case.text('envelope.method')} cannot certify"
        )
        yield Problem(
            "envelope.certify", found, allowed="a linear structure with method modal or auto"
        )
    if (
        case.has("envelope.certify")
        and case.has("envelope.integrator")
        and case.text("envelope.integrator") != "exact"
    ):
        scheme = case.text("envelope.integrator")
        yield Problem(
            "envelope.integrator",
            "a certificate is of the exact motion",
            scheme,
            "exact, or no integrator, beside certify",
        )
    if case.has("envelope.integrator"):
        known = (
            NONLINEAR
            if case.has("pendulum.mass")
            else tuple(x for x in INTEGRATORS if x != "composition4")
        )
        if (scheme := case.text("envelope.integrator")) not in known:
            what = (
                "this is for linear structures"
                if case.has("pendulum.mass")
                else "this is for a pendulum"
            )
            yield Problem("envelope.integrator", what, scheme, ", ".join(known))


def exceedance(case: Case) -> Iterator[Problem]:
    """A limit is for an output of the structure in vibration, and in its unit."""
    if not case.has("envelope.step"):
        yield Problem("exceedance", "a probability needs the section [envelope]")
    for section, outputs in OUTPUTS.items():
        name = case.text("exceedance.output")
        if any(key.startswith(f"{section}.") for key in case.values) and name not in outputs:
            yield Problem(
                "exceedance.output",
                f"there is no output {name}",
                name,
                ", ".join(outputs),
                nearest(name, outputs),
            )
    try:
        if not (
            case.text("exceedance.output").startswith("drift")
            and storey_height(case, case.text("exceedance.output")) is None
        ):
            limit_of(case)  # of a storey that is not there nothing can be said
    except BadInput as error:
        yield from error.problems


def times(case: Case) -> Iterator[Problem]:
    """Every duration is a whole number of steps."""
    step = case.number("envelope.step")
    for key in ("envelope.duration", *(f"study[{i}].duration" for i in range(study_count(case)))):
        if not case.has(key):
            continue
        duration = case.number(key)
        if duration / step > MOST_STEPS:
            what = f"{duration:g} s are {duration / step:.3g} steps of {step:g} s"
            yield Problem(
                key,
                what,
                str(case.written.get(key, "")),
                f"at most {MOST_STEPS:,} steps; lengthen envelope.step",
            )
            continue
        if (
            round(duration / step) < 1
            or abs(round(duration / step) * step - duration) > 1e-9 * duration
        ):
            what = f"{duration:g} s is not a whole number of steps of {step:g} s"
            yield Problem(key, what, str(case.written.get(key, "")), "a multiple of envelope.step")
