"""Checks of a case as a whole, beyond single values."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from functools import partial

from alphacut.case import limits as questions
from alphacut.case.case import Case, files_of
from alphacut.case.checks_image import image
from alphacut.case.checks_material import particles, radius, sphere_model
from alphacut.case.checks_structure import incomplete
from alphacut.case.names import floors, others, structures
from alphacut.case.schema import NEEDED, STAGES
from alphacut.case.sections.vibration import ENVELOPE_METHODS, INTEGRATORS, NONLINEAR
from alphacut.io.output_paths import hint
from alphacut.io.problem import Problem

Check = Callable[[Case], Iterator[Problem]]

MOST_STEPS = 1_000_000  # more would not fit into memory, and no figure could show them


def checks(*, modal: bool = False) -> Iterator[Check]:
    """Every check of a case whose single values are all right; each finds problems of its own."""
    yield order_of_stages
    yield names_of_studies
    yield missing_sections
    yield files
    yield incomplete
    yield where("microstructure", particles)
    yield where("radius", partial(radius, alpha=1.0 if modal else 0.0))
    yield where("cell", sphere_model)
    yield where("response", stress_curves)
    yield one_modulus
    yield image
    yield where("modulus", lambda case: levels("modulus.alpha", case.modulus.alpha))
    yield where("envelope", lambda case: levels("envelope.alpha", case.envelope.alpha))
    yield where("frame", floors)
    yield others
    yield one_structure
    yield where("envelope", times)
    yield where("envelope", tolerances)
    yield where("envelope", methods)
    yield where("envelope", certificate)
    yield where("envelope", integrators)
    yield where("exceedance", questions.exceedance)
    yield where("update", lambda case: levels("update.alpha", case.update.alpha))
    yield where("update", questions.update)
    yield where("decision", questions.decision)


def where(section: str, check: Check) -> Check:
    """The check, of cases that have the section."""
    return lambda case: check(case) if getattr(case.sections, section) else iter(())


def one_modulus(case: Case) -> Iterator[Problem]:
    """At most one thing stands in for the computed modulus, and an image is one."""
    if "image" in case.stages and ("modulus" in case.stages or case.stand_ins):
        yield Problem(
            "stages",
            "stage image gives the modulus, and so does another",
            ", ".join(["image", *case.stand_ins]),
            "one of stage image, stage modulus, modulus.value, modulus.file, modulus.measured",
        )
    if len(case.stand_ins) > 1:
        yield Problem(
            list(case.stand_ins)[1],
            f"more than one modulus is given: {', '.join(case.stand_ins)}",
            allowed="one of them",
        )


def one_structure(case: Case) -> Iterator[Problem]:
    """Exactly one structure vibrates."""
    found = structures(case)
    if "envelope" in case.stages and len(found) != 1:
        yield Problem(
            "frame",
            f"stage envelope needs one structure, got {len(found)}",
            ", ".join(found),
            "[frame] or [pendulum]",
        )


def tolerances(case: Case) -> Iterator[Problem]:
    """One tolerance, in the unit of the output."""
    if case.envelope.relative_tolerance is not None and any(
        case.asked(f"{name}.tolerance") for name in ("envelope", "pendulum")
    ):
        yield Problem(
            "envelope.relative_tolerance",
            "there is a tolerance besides",
            allowed="one of tolerance and relative_tolerance",
        )
    if forces_only(case):
        for key in ("envelope.tolerance", "envelope.certify"):
            if case.asked(key):
                yield case.problem(
                    key,
                    "this is a length, and no output is a displacement",
                    "envelope.relative_tolerance, or an output such as q1 or drift1 besides",
                )
    if case.sections.pendulum and case.asked("envelope.tolerance"):
        yield Problem(
            "envelope.tolerance",
            "a pendulum's output is a force",
            allowed="pendulum.tolerance, or envelope.relative_tolerance",
        )


def forces_only(case: Case) -> bool:
    """Whether a frame is observed, and no output of it is a displacement."""
    outputs = case.sections.frame.outputs if case.sections.frame else ()
    return bool(outputs) and not any(name.startswith(("q", "drift")) for name in outputs)


def order_of_stages(case: Case) -> Iterator[Problem]:
    """Stages stand in the order in which each hands on to the next."""
    if list(case.stages) != sorted(case.stages, key=STAGES.index):
        yield Problem(
            "stages", "the stages are not in their order", str(list(case.stages)), ", ".join(STAGES)
        )


def names_of_studies(case: Case) -> Iterator[Problem]:
    """Every study has its own name, which a file can bear."""
    names = [study.name for study in case.sections.study]
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
    if case.stand_ins:
        yield Problem(
            "response",
            "its stresses come from the samples of stage modulus",
            allowed="this section where the modulus is computed",
        )
    probabilities = case.response.quantiles
    if list(probabilities) != sorted(set(probabilities)):
        yield Problem(
            "response.quantiles",
            "the probabilities are not in rising order",
            str(list(probabilities)),
            "for example [0.05, 0.95]",
        )


def missing_sections(case: Case) -> Iterator[Problem]:
    """Sections that the wanted stages need."""
    for stage in case.stages:
        for section in NEEDED.get(stage, ()):
            if section == "radius" and "microstructure" in case.stages:
                continue
            absent = getattr(case.sections, section) is None
            if section == "cell":
                absent = absent and case.sections.picture is None
            if absent and not (stage == "modulus" and case.stand_ins):
                made = section == "radius" and case.sections.microstructure
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
            "stage microstructure makes this section from the particles, --radius without them",
            allowed="one of stage and section; for --radius a case without the stage and its input",
        )


def files(case: Case) -> Iterator[Problem]:
    """Files that the case names must be there."""
    for section in ("microstructure", "picture", "modulus", "frame", "update"):
        found = getattr(case.sections, section)
        section = "cell" if section == "picture" else section
        for key, name in files_of(found) if found else ():
            if not (path := case.beside(name)).is_file():
                what = "this is a folder" if path.is_dir() else "there is no such file"
                cure = hint(path) or f"a path from the case's folder, {case.path.absolute().parent}"
                yield Problem(f"{section}.{key}", what, name, cure)


def levels(key: str, alpha: tuple[float, ...]) -> Iterator[Problem]:
    """α-levels must rise."""
    if any(low >= high for low, high in itertools.pairwise(alpha)):
        yield Problem(
            key,
            "the α-levels are not in rising order",
            str(list(alpha)),
            "for example [0, 0.25, 0.5, 0.75, 1]",
        )


def methods(case: Case) -> Iterator[Problem]:
    """A method that the structure's kind has."""
    if case.sections.pendulum and case.envelope.method == "modal":
        yield Problem(
            "envelope.method",
            "a pendulum has no modes",
            "modal",
            ", ".join(x for x in ENVELOPE_METHODS if x != "modal"),
        )


def certificate(case: Case) -> Iterator[Problem]:
    """A certificate needs a linear structure, a method that proves, and the exact motion."""
    wanted, pendulum = case.envelope, case.sections.pendulum
    if wanted.certify is None:
        return
    if pendulum or wanted.method not in ("auto", "modal"):
        found = (
            "a pendulum cannot be certified"
            if pendulum
            else f"method {wanted.method} cannot certify"
        )
        yield Problem(
            "envelope.certify", found, allowed="a linear structure with method modal or auto"
        )
    if wanted.integrator not in (None, "exact"):
        yield Problem(
            "envelope.integrator",
            "a certificate is of the exact motion",
            str(wanted.integrator),
            "exact, or no integrator, beside certify",
        )


def integrators(case: Case) -> Iterator[Problem]:
    """A time stepping that the structure's kind has."""
    scheme, pendulum = case.envelope.integrator, case.sections.pendulum
    linear = tuple(x for x in INTEGRATORS if x != "composition4")
    known = NONLINEAR if pendulum else linear
    if scheme is not None and scheme not in known:
        what = f"this is for {'linear structures' if pendulum else 'a pendulum'}"
        yield Problem("envelope.integrator", what, scheme, ", ".join(known))


def times(case: Case) -> Iterator[Problem]:
    """Every duration is a whole number of steps."""
    yield from whole_steps(case, "envelope.duration", case.envelope.duration)
    for index, study in enumerate(case.sections.study):
        yield from whole_steps(case, f"study[{index}].duration", study.duration)


def whole_steps(case: Case, key: str, duration: float) -> Iterator[Problem]:
    """A duration is a whole number of steps, and of not too many."""
    step, written = case.envelope.step, str(case.written.get(key, ""))
    if duration / step > MOST_STEPS:
        what = f"{duration:g} s are {duration / step:.3g} steps of {step:g} s"
        yield Problem(key, what, written, f"at most {MOST_STEPS:,} steps; lengthen envelope.step")
    elif (
        round(duration / step) < 1
        or abs(round(duration / step) * step - duration) > 1e-9 * duration
    ):
        what = f"{duration:g} s is not a whole number of steps of {step:g} s"
        yield Problem(key, what, written, "a multiple of envelope.step")
