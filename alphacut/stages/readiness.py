"""Readiness of a run: files that a case names, and its structure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from alphacut.case.case import WHOLE, Case
from alphacut.case.names import named_inputs
from alphacut.frame import Accelerogram
from alphacut.frame.structures.linear import frequencies
from alphacut.fuzzy import FuzzyNumber, Interval, Triangular
from alphacut.fuzzy.sets.stepwise import Stepwise
from alphacut.io.problem import BadInput, Problem, refuse
from alphacut.io.units import STANDARD_GRAVITY, engineering
from alphacut.stages import plausible
from alphacut.stages.image.phases import contradicted
from alphacut.stages.image.reading import expected_modulus, study_of
from alphacut.stages.material import modulus, spheres
from alphacut.stages.material.cell import cell_phases, modal_parts, phases_of
from alphacut.stages.material.microstructure import dense_remark, require_readable
from alphacut.stages.material.references import bounds_of, mean_share
from alphacut.stages.vibration import envelope, exceedance, update
from alphacut.stages.vibration.accelerogram import cut_short
from alphacut.stages.vibration.envelope_task import task_of
from alphacut.stages.vibration.resolution_checks import (
    estimated_reason,
    rough,
    too_many,
    unproved_reason,
    wanted_errors,
)
from alphacut.stages.vibration.structure import Structure, structure
from alphacut.stages.vibration.studies import fixed_line, left_out, studies

FINE = 0.005  # rad of the fastest mode in a step, below which a step is needlessly short
MANY_STEPS = 50_000  # fewer cost little


@dataclass(frozen=True)
class Readiness:
    """Remarks on a case that can be run.

    What is `rough` beside the motion is refused where it is meant strictly. The first natural
    period (s) and the structure are those at the modal values, None where none vibrates.
    """

    warnings: tuple[str, ...] = ()
    rough: tuple[Problem, ...] = ()
    period: float | None = None
    structure: Structure | None = None


def ready(case: Case) -> Readiness:
    """Remarks about a case that can be run.

    Raises:
        BadInput: It cannot: a stage lacks what it needs, a file is broken, an input named as fuzzy
            is crisp.
    """
    dense: tuple[str, ...] = ()
    if "microstructure" in case.stages:
        require_readable(case)
        dense = tuple(dense_remark(case))
    if "image" in case.stages:
        dense += tuple(contradicted(case, study_of(case)))
    stand_in = modulus.stand_in(case) if "modulus" in case.stages or case.stand_ins else None
    if "envelope" not in case.stages:
        if "modulus" in case.stages and (given := ", ".join(case.stand_ins)):
            what = f"there is nothing to compute: {given} stands in for stage modulus"
            cure = 'stages = ["modulus", "envelope"], with a structure'
            raise BadInput.of("stages", what, str(list(case.stages)), cure)
        return Readiness((*shape(case), *dense, *plausible.unlikely_material(case)))
    refuse([*lacking(case), *(parted_modulus(case) if case.computes_modulus else ())])
    wanted = structure(case, stand_in or expected(case))
    refuse([*crisp_names(case, wanted)] or [*unlearned(case, wanted)])
    refuse([*unprovable(case, wanted)])
    update.require_readable(case, wanted.frame)
    model = wanted.linear
    period = None if model is None else 2 * math.pi / float(frequencies(model)[0])
    ground = None if model is None else model.ground
    slips = (
        *plausible.unlikely(case, ground, period),
        *plausible.odd(case),
        *plausible.strangers(case),
    )
    found = coarse(case, wanted, slips)
    remarks = (
        *shape(case),
        *dense,
        *plausible.unlikely_material(case),
        *plausible.between_levels(case, known_levels(case, stand_in)),
        *outlasted(case, ground),
        *envelope.wide_gap(case),
        *slips,
        *plausible.overdamped(case, wanted),
        *fine_steps(case, wanted),
        *unproved(case, wanted),
        *exceedance.assumed(case, wanted),
    )
    return Readiness(remarks, found, period, wanted)


def coarse(case: Case, wanted: Structure, slips: Iterable[str]) -> tuple[Problem, ...]:
    """What is coarse about the envelopes of a case.

    Raises:
        BadInput: A step is too coarse for any motion; told after the `slips` that may cause it.
    """
    try:
        found = [problem for study in studies(case) for problem in rough(wanted, study.task)]
    except ValueError as error:
        told = [slip.partition(": ") for slip in slips]
        step = Problem("envelope.step", str(error).removeprefix("step: "))
        first = [Problem(key, what) for key, _, what in told]
        raise BadInput([case.located(problem) for problem in (*first, step)]) from None
    return tuple(dict.fromkeys(found))


def fine_steps(case: Case, wanted: Structure) -> Iterator[str]:
    """A remark on a step that is far shorter than the fastest mode needs."""
    if wanted.linear is None:
        return
    step, fastest = case.envelope.step, float(frequencies(wanted.linear)[-1])
    count = max(study.task.duration for study in studies(case)) / step
    if count > MANY_STEPS and fastest * step < FINE:
        yield (
            f"envelope.step: {engineering(step, 's', digits=3)} makes {count:,.0f} steps,"
            f" {2 * math.pi / fastest / step:,.0f} of them in the shortest natural period;"
            f" {engineering(20 * FINE / fastest, 's', digits=1)} is fine enough"
        )


def shape(case: Case) -> Iterator[str]:
    """A remark where cylinders are computed and the case speaks of spheres."""
    if "modulus" not in case.stages or not case.sections.cell or case.stand_ins:
        return
    given = case.sections.microstructure
    if "microstructure" in case.stages:
        if not (given and given.packing):
            yield from spheres.unmeasured(case)  # the fraction is known when the section is read
            return
        share = given.packing.area_fraction
        values = {name: number.modal for name, number in cell_phases(case).items()}
        phases = phases_of(values)
    else:
        radius, *both = modal_parts(case)
        share, phases = mean_share(radius, "cylinders"), (both[0], both[1])
    if told := spheres.remark(case, share, *phases):
        yield told


def unprovable(case: Case, wanted: Structure) -> Iterator[Problem]:
    """Proofs that are asked for with more inputs than they are affordable for."""
    asked = [("envelope.certify", study.task) for study in studies(case) if study.task.certify]
    if case.sections.decision and not case.sections.update:  # those learned may settle it
        asked.append(("decision", task_of(case)))
    for key, task in asked:
        for problem in too_many(key, wanted, task):
            yield case.located(problem)


def unproved(case: Case, wanted: Structure) -> Iterator[str]:
    """Remarks where a proof is wanted that cannot become a guarantee."""
    asked = "decision" if case.sections.decision else "envelope.certify"
    if wanted.frame is not None and (case.sections.decision or case.envelope.certify is not None):
        reason = unproved_reason(wanted, task_of(case))
        if reason:
            yield f"{asked}: verified by sampling, not proved: {reason}"
    if case.envelope.certify is not None and case.sections.tower:
        yield (
            "envelope.certify: the error of the modal model of a tower, whose shapes are reduced,"
            " is sampled, not proved; a frame allows a guarantee"
        )


def takes_fuzzy_modulus(case: Case) -> bool:
    """Whether some study of a frame takes E as fuzzy."""
    named = any("E" in study.task.fuzzy for study in studies(case))
    return named and case.sections.frame is not None


def known_levels(case: Case, stand_in: FuzzyNumber | None) -> Sequence[float]:
    """Levels at which cuts of E are known, where a study takes a computed one; else none."""
    if not takes_fuzzy_modulus(case):
        return ()
    computed = case.modulus.alpha if case.computes_modulus else ()
    return stand_in.alpha if isinstance(stand_in, Stepwise) else computed


def parted_modulus(case: Case) -> Iterator[Problem]:
    """Levels that do not hold all cuts of E, which a frame takes over, or one number."""
    alpha, fuzzy = case.modulus.alpha, takes_fuzzy_modulus(case)
    if case.sections.frame is None:
        return
    if (alpha != (1.0,) or fuzzy) and (alpha[0], alpha[-1]) != (0.0, 1.0):
        what = "these levels leave cuts of E out that the structure needs"
        yield case.problem("modulus.alpha", what, WHOLE)


def lacking(case: Case) -> Iterator[Problem]:
    """A frame needs a modulus from somewhere."""
    given = case.sections.frame
    if given is None or given.stiffness is not None:
        return
    if given.modulus is None and not ({"modulus", "image"} & set(case.stages) or case.stand_ins):
        what = (
            "missing; stage envelope needs a modulus: give frame.modulus, modulus.value or"
            ' modulus.measured, or compute one with stages = ["modulus", "envelope"]'
        )
        yield case.located(Problem("frame.modulus", what))


def expected(case: Case) -> FuzzyNumber | None:
    """Modulus in place of one yet to be computed, between both phases; or None."""
    computed, given = {"modulus", "image"} & set(case.stages), case.sections.frame
    if not computed or given is None or given.modulus is not None:
        return None
    if "image" in computed:
        low, middle, high = expected_modulus(case)
        return Triangular(low, middle, max(high, low * (1 + 1e-9)))
    matrix, inclusion = case.cell.matrix_modulus, case.cell.inclusion_modulus
    ends, modal = sorted([*matrix.support, *inclusion.support]), matrix.modal
    if case.sections.radius:
        radius, *phases = modal_parts(case)
        share, kind = mean_share(radius, case.cell.particles), case.cell.particles == "spheres"
        softer = inclusion.modal < matrix.modal  # the bound that the matrix makes is the nearer
        modal = bounds_of(share, (phases[0], phases[1]))[kind][softer]
    return Triangular(ends[0], modal, max(ends[-1], ends[0] * (1 + 1e-9)))


def crisp_names(case: Case, wanted: Structure) -> Iterator[Problem]:
    """Names of fuzzy inputs that are crisp in the case, by the key that names them."""
    for key, names in named_inputs(case):
        for name in names:
            try:
                wanted.members(name)
            except BadInput as error:
                (problem,) = error.problems
                yield case.located(Problem(key, problem.what, name, problem.allowed))


def unlearned(case: Case, wanted: Structure) -> Iterator[Problem]:
    """Envelopes whose inputs leave out one that is learned: it would not be fuzzy there."""
    if case.sections.update is None:
        return
    learned = set(wanted.inputs(case.update.learn))
    for key, names in named_inputs(case):
        missing = sorted(learned - set(wanted.inputs(names)))
        if key.endswith(".fuzzy") and missing:
            what = f"{', '.join(missing)} of [update] learn are missing"
            cure = "all inputs that are learned, among others"
            yield case.located(Problem(key, what, ", ".join(names), cure))


def outlasted(case: Case, record: Accelerogram | None) -> Iterator[str]:
    """A remark on durations that are longer than the record, or leave out a part of it."""
    if record is None:
        return
    end = (len(record.acceleration) - 1) * record.step
    longest = max(study.task.duration for study in studies(case))
    if longest > end + 0.5 * record.step:
        yield (
            f"{plausible.record_key(case)}: the record ends at {end:g} s and the simulation at"
            f" {longest:g} s; afterwards the ground is at rest"
        )
    elif cut_short(record, longest):
        yield (
            f"{plausible.record_key(case)}: the simulation ends at {longest:g} s, the record at"
            f" {end:g} s: the rest of the record is left out"
        )


def motion(case: Case, wanted: Structure) -> Iterator[str]:
    """Lines on the inputs that the motion takes, on its levels, and on its record."""
    tasks = [study.task for study in studies(case)]
    named = {name: number for task in tasks for name, number in wanted.inputs(task.fuzzy).items()}
    yield from fixed_line(left_out(wanted, tasks))
    yield from dict.fromkeys(line for task in tasks for line in wanted_errors(wanted, task))
    for reason in dict.fromkeys(estimated_reason(wanted, task) for task in tasks):
        if reason:
            yield f"envelope: bounds will be estimated, with their error: {reason}"
    levels = max(len(task.alpha) for task in tasks)
    alike = named and all(isinstance(one, Interval) for one in named.values())
    if levels > 1 and alike and case.sections.update is None:  # what is learned has levels
        yield (
            f"all inputs are intervals, so all {levels} levels are alike: envelope.alpha = [0] is"
            " enough, and faster"
        )
    if (ground := None if wanted.linear is None else wanted.linear.ground) is not None:
        key, values = plausible.record_key(case), ground.acceleration
        peak = float(abs(values).max())
        end = "" if values[-1] == 0 else f"; ends on {values[-1]:.3g} m/s², then the ground rests"
        if not plausible.DESIGNED[0] <= peak <= plausible.DESIGNED[1]:
            end += f"; {'weak' if peak < 1 else 'strong'}: is the unit in its header right?"
        yield (
            f"{key}: {len(values)} values every {ground.step:g} s, to"
            f" {(len(values) - 1) * ground.step:g} s, peak {peak:.3g} m/s²"
            f" ({peak / float(STANDARD_GRAVITY):.3g} g){end}"
        )
