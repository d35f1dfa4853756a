"""How long a run of a case will take: small parts of the work are timed.

No speed of a machine is assumed. A motion is computed for parts of its duration, an image on parts
of its pixels, particles are packed into some of their windows, and one record of a suite stands for
all. Work that reports its progress evenly is begun and interrupted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from time import perf_counter
from typing import Any, TypeVar

import numpy as np

from alphacut.base.arrays import Ints
from alphacut.case.content import Content
from alphacut.case.floors import FloorSpectrumSection
from alphacut.case.material import ImageCell, RadiusMapSection
from alphacut.case.microstructure import MicrostructureSection
from alphacut.case.motion import EnvelopeSection
from alphacut.case.structure import Structure
from alphacut.commands.pieces import Foreseen, pieces_of, sample_count
from alphacut.frame import Probability, floor_spectrum
from alphacut.frame import envelope as frame_envelope
from alphacut.frame.analyses.peaks import PEAK_ERROR
from alphacut.frame.analyses.tolerances import scale_supports
from alphacut.frame.methods.auto import Auto
from alphacut.fuzzy import Triangular
from alphacut.rve.image.study import (
    AlphaLevel,
    FuzzyImageStiffness,
    GreyImage,
    ImageStudy,
    Phases,
    solve_study,
)
from alphacut.stages import answers, envelope, identify, microstructure, modulus, spectrum, suite
from alphacut.stages.answers import Response
from alphacut.stages.cell import CellProblem
from alphacut.stages.envelope import FOLLOWERS, EnvelopeTask
from alphacut.stages.foreseen import MOST_TIMED_STEPS, Material, possible_materials
from alphacut.stages.image import study_of
from alphacut.stages.store import Stage, StageContext, no_progress

T = TypeVar("T")
LONG_ENOUGH = 2.0
"""Seconds of parts, or of work that was begun, after which no more is timed: more of it would tell
more, but let the user of `check` wait."""


def foresee(content: Content, petsc: Mapping[str, str]) -> Iterator[Foreseen]:
    """Yield what each stage of a run of a case will take, but the shares of inputs and the figures.

    The stages are begun or computed in part, one after the other as the entries are taken.

    Args:
        content: The case.
        petsc: PETSc's options without their prefix.

    Raises:
        FailedError: A part of the work fails, as the whole may.
        RefusedError: A part of the work is refused, as the whole may be.
    """
    # What one stage finds is the input of the next: a radius map from few packings, and the modulus
    # of a part of an image, stand for those of the run.
    material = None
    pieces = {entry.stage: entry for entry in pieces_of(content, petsc)}
    if "microstructure" in content.stages and content.microstructure is not None:
        seconds, radius = _particles(content.microstructure, spheres=content.has_spheres)
        content = content.model_copy(update={"radius": radius})
        yield pieces["microstructure"]._replace(seconds=seconds)
    if "modulus" in content.stages:
        if content.image_cell is not None:
            seconds, material = _image(content.image_cell, content)
            yield pieces["image"]._replace(seconds=seconds)
        else:
            problem = CellProblem.of(content, petsc)
            seconds = begun_seconds(modulus.stage(problem), has_setup=True)
            number = sample_count(problem)
            yield pieces["modulus"]._replace(number=number, seconds=seconds)
    if "envelope" in content.stages and content.envelope is not None:
        yield from _motion(content, content.envelope, material, pieces)
    section = content.response_spectrum
    if "response_spectrum" in content.stages and section is not None:
        start = perf_counter()
        lowest = section.model_copy(update={"alpha": section.alpha[:1]})  # takes longest
        spectrum.stage(lowest, _structure(content, material)).compute(StageContext())
        seconds = (perf_counter() - start) * len(section.alpha)
        yield pieces["response_spectrum"]._replace(seconds=seconds)


def whole_seconds(run: Callable[[float], float], *, fewest: int = 1) -> float:
    """Return about how many seconds a work takes, from the times of small parts of it.

    The parts are 1/64, 1/64, 1/32 and 1/16 of the work, until they have taken two seconds together.
    The time of a part x is taken as a + b x, where a is what every part takes once; a and b are
    fitted by least squares of the relative errors. The whole work, x = 1, then takes a + b. The
    first part also compiles kernels: what it takes longer than its repetition is added once.

    Args:
        run: Function that does about a given fraction of the work, and returns the fraction done.
        fewest: Number of parts that are timed at least, however long they take.

    Returns:
        Seconds, with the time of compiling: a + b, or the time of the longest part if this is more.
        If all of three or more parts did the same fraction: the time of the last part divided by
        its fraction. If only one or two parts were timed: the time of the last one.
    """
    parts = list[float]()
    seconds = list[float]()
    # After two seconds no more is timed, so that the user of `check` need not wait.
    for fraction in (1 / 64, 1 / 64, 1 / 32, 1 / 16):
        start = perf_counter()
        parts.append(run(fraction))
        seconds.append(perf_counter() - start)
        is_long = sum(seconds[1:]) > LONG_ENOUGH or seconds[0] > 2 * LONG_ENOUGH
        if is_long and len(parts) >= fewest:
            break
    # The second part is the same as the first: it shows what compiling took. The slice ends with
    # the time of the second part, or of the first if there is no second: the difference is then 0.
    compiling = max(0.0, seconds[0] - seconds[:2][-1])
    # A work that has no smaller parts is timed by equal ones.
    if len(parts) > 2 and len(set(parts)) == 1:
        return compiling + seconds[-1] / parts[-1]
    if len(parts) < 3:  # parts so long consist of what every part takes once
        return compiling + seconds[-1]
    # With the weights 1/t relative errors are squared. Otherwise short parts would hardly count,
    # from which the constant a is found.
    timed = np.array(seconds[1:])
    slope, constant = np.polyfit(parts[1:], timed, 1, w=1 / timed)
    return compiling + float(max(slope + constant, timed.max()))


class InterruptedWorkError(Exception):
    """Work that was only begun; its argument is the time that all of it would take, in s."""


def begun_seconds(stage: Stage[T], *, has_setup: bool = False, power: float = 1.0) -> float:
    """Return about how many seconds a stage takes: it is begun, and interrupted by its progress.

    The stage reports the completed fraction p of its work. Once it has worked for t = 2 s or a
    little more, its whole time is taken as t / p^power, and it is interrupted. A stage that ends
    before is timed as it is.

    Args:
        stage: A stage that reports its progress evenly. Its result is not kept.
        has_setup: Whether the first piece builds what all others share. Its time then counts once,
            and only the time and progress after its end are extrapolated.
        power: Power of the progress to which the time grows.

    Raises:
        FailedError: The stage fails. Whatever else it raises leaves this function as well.
    """
    start = perf_counter()
    setup_end = list[tuple[float, float]]()

    def tick(done: float) -> None:
        """Raise InterruptedWorkError with the time of the whole stage, as soon as it is known.

        Of the outer function it uses `start`, the time when the stage began; `power`; and, if
        `has_setup`, the list `setup_end`, to which the first call with progress adds its seconds
        since the start and its progress.

        Args:
            done: Completed fraction of the stage, rising from 0 to 1.

        Raises:
            InterruptedWorkError: The stage has worked for two seconds since its start or the end of
                its setup. The argument is the time that all of it would take, in s.
        """
        seconds = perf_counter() - start
        if not done:
            return
        if has_setup and not setup_end:
            setup_end.append((seconds, done))
        first_seconds = 0.0
        first_done = 0.0
        if has_setup:
            first_seconds, first_done = setup_end[0]
        if seconds - first_seconds > LONG_ENOUGH and done > first_done:
            fraction = ((done - first_done) / (1 - first_done)) ** power
            raise InterruptedWorkError(first_seconds + (seconds - first_seconds) / fraction)

    # An exception is the only way out of a computation of somebody else's code. The stage has no
    # folder, so that nothing half done is left.
    try:
        stage.compute(StageContext(tick=tick))
    except InterruptedWorkError as interrupted:
        return float(interrupted.args[0])
    return perf_counter() - start


def _particles(section: MicrostructureSection, *, spheres: bool) -> tuple[float, RadiusMapSection]:
    """Return what the radius map of particles will take, and such a map from few packings.

    The fewest packings that a case may have are made, with the particles of the case; the time is
    taken as proportional to their number. Measured circles are computed as they are.

    Args:
        section: The particles.
        spheres: Whether they are spheres.

    Returns:
        Seconds of stage microstructure, and the section [radius] of the fitted map.

    Raises:
        RefusedError: The particles are too dense, or a file is not read.
        FailedError: Particles still overlap after all steps of the packing, or no map fits.
    """
    part = section
    number = 1
    fewest = 1
    if (packing := section.packing) is not None:
        number = packing.packings
        # Five packings are the fewest that a case may have: they tell how far statistics vary,
        # without which no map is fitted.
        fewest = min(packing.packings, 5)
        fewer = packing.model_copy(update={"packings": fewest})
        part = section.model_copy(update={"packing": fewer})
    # The time of the fit, which all packings share, is counted with each: too much by little.
    start = perf_counter()
    numbers = microstructure.stage(part, spheres=spheres).compute(StageContext()).numbers
    seconds = (perf_counter() - start) * number / fewest
    radius = RadiusMapSection.model_validate(numbers["radius"])
    return seconds, radius


def _image(cell: ImageCell, content: Content) -> tuple[float, Material]:
    """Return what the bounds of an image or a volume will take, and the material of a part of it.

    Args:
        cell: The image and its phases.
        content: The case, for the α-levels and for what the structure takes from the image.

    Returns:
        Seconds of the stage; and Young's modulus and the loss factor, as fuzzy numbers, of the
        largest part that was solved. Both are None if the structure takes nothing from the image.

    Raises:
        RefusedError: The image is not read, or the phases do not fit it.
        FailedError: A linear system was not solved.
    """
    study = study_of(cell)
    section = content.modulus
    solved = list[FuzzyImageStiffness]()
    alpha = section.alpha
    average = section.average

    def run(fraction: float) -> float:
        """Solve about a fraction of the image, keep the result in `solved`; return the fraction."""
        part = cropped(study, fraction)
        found = solve_study(part, alpha=alpha, average=average, device="cpu", tick=no_progress)
        solved.append(found)
        return float(part.image.values.size / study.image.values.size)

    # From fewer than three parts nothing is extrapolated, and the time of an image is about
    # proportional to its pixels: three are timed however long they take.
    seconds = whole_seconds(run, fewest=3)
    if content.has_stated_modulus and not content.has_material_damping:
        return seconds, Material()
    largest = solved[-1]
    return seconds, Material(largest.modulus, largest.loss_factor)


def cropped(study: ImageStudy[Phases], fraction: float) -> ImageStudy[Phases]:
    """Return the study of about a fraction of an image, around its middle.

    Args:
        study: The image, its phases and their ranges on each level.
        fraction: Fraction of the pixels or voxels, in (0, 1].

    Returns:
        Study whose sides are scaled alike and have four pixels at least, if the image has as many.
    """
    values = study.image.values
    window = []
    for length in values.shape:
        # In d dimensions a part x of the pixels has sides of x^(1/d).
        size = max(min(length, 4), round(length * fraction ** (1 / values.ndim)))
        first = (length - size) // 2
        window.append(slice(first, first + size))
    place = tuple(window)

    def phase_ranges(level: AlphaLevel) -> tuple[Ints, Ints]:
        """Return the lowest and the highest phase of each pixel of the window at a level."""
        # A threshold that is fitted to the image is fitted to all of it, as in the run.
        lowest, highest = study.phase_ranges(level)
        return lowest[place], highest[place]

    image = GreyImage(values[place], study.image.lengths)
    return replace(study, image=image, phase_ranges=phase_ranges)


def _motion(
    content: Content,
    section: EnvelopeSection,
    material: Material | None,
    pieces: Mapping[str, Foreseen],
) -> Iterator[Foreseen]:
    """Yield what the responses of the structure will take.

    These are the identification of inputs, then either the records of a suite or the envelopes of
    all studies and the questions.

    Args:
        content: The case.
        section: Its section [envelope].
        material: Material of the cell as far as it was computed for this; None if it was not.
        pieces: Pieces of each stage by its name.

    Raises:
        RefusedError: A part of the work is refused.
        FailedError: A part of the work fails.
    """
    structure = _structure(content, material)
    if content.identify is not None:
        start = perf_counter()
        _, structure = identify.identify_inputs(content.identify, structure, section.alpha)
        yield pieces["identify"]._replace(seconds=perf_counter() - start)
    # Questions and suites are about the response of [envelope] itself, whatever the studies are.
    (own_task,) = envelope.tasks(section, ())
    if content.records is not None:
        yield from _records(content, structure, own_task, pieces)
        return
    tasks = envelope.tasks(section, content.study, content.limited_outputs)
    seconds = sum(_envelope_seconds(structure, task) for task in tasks)
    yield pieces["envelopes"]._replace(seconds=seconds)
    yield from _answers(content, structure, own_task, pieces)


def _structure(content: Content, material: Material | None) -> Structure:
    """Return the structure with a fuzzy modulus where stage modulus will give one.

    Args:
        content: The case.
        material: Young's modulus in Pa and loss factor from a part of the stage; None if unknown.

    Returns:
        The structure. If the stage has other levels than α = 1 alone, Young's modulus E and the
        damping ratios that it computes are fuzzy: crisp ones become triangular numbers, a tenth to
        either side.

    Raises:
        RefusedError: There is no such structure.
    """
    known = material or possible_materials(content)[0]
    structure = content.structure_of(known.modulus, known.loss)
    # Envelopes of crisp structures take much less time, so that a stand-in must be fuzzy. How wide
    # it is matters less: a tenth is as much as cases usually have.
    if "modulus" not in content.stages or content.modulus.alpha == (1.0,):
        return structure
    numbers = dict(structure.numbers)
    for name, number in numbers.items():
        is_computed = name == "E" or (content.has_material_damping and name.startswith("zeta"))
        if is_computed and number.support.width == 0:
            middle = number.nominal
            numbers[name] = Triangular(0.9 * middle, middle, 1.1 * middle)
    return replace(structure, numbers=numbers)


def shortened(task: EnvelopeTask, fraction: float) -> tuple[EnvelopeTask, float]:
    """Return a task of about a fraction of the duration of a response, and the fraction it is.

    Args:
        task: The response, with its duration and time step.
        fraction: Fraction of the duration, in (0, 1].

    Returns:
        The task with its shorter duration, and this duration as a fraction of the whole. It has
        eight steps at least, if the response has as many. If the response has more than 16,000
        steps, the fraction is taken of 16,000, since parts of all steps would take long as well.
    """
    # In fewer than eight steps nothing moves, and the cost of starting hides the cost of steps.
    steps = round(task.duration / task.section.step)
    count = min(steps, max(8, round(fraction * min(steps, MOST_TIMED_STEPS))))
    return replace(task, duration=count * task.section.step), count / steps


def _envelope_seconds(structure: Structure, task: EnvelopeTask) -> float:
    """Return about how many seconds the envelope of a study takes.

    A Graph Follower is begun and interrupted; other methods are timed on short durations.

    Args:
        structure: The structure with its fuzzy parameters.
        task: The study: method, names of the fuzzy inputs, duration, time step and levels.

    Raises:
        RefusedError: An input or an output does not fit the structure.
        FailedError: A response could not be computed.
    """
    if task.section.method in FOLLOWERS:
        # Its time grows as a power of the time nodes done. Measured were 1.2 where few trajectories
        # are computed, and 2 where their number grows with the nodes; 1.7 lies between.
        return begun_seconds(envelope.stage(structure, task), power=1.7)

    def run(fraction: float) -> float:
        """Compute the envelope over about a fraction of the duration; return the fraction."""
        part, done = shortened(task, fraction)
        envelope.stage(structure, part).compute(StageContext())
        return done

    return whole_seconds(run)


def _records(
    content: Content, structure: Structure, task: EnvelopeTask, pieces: Mapping[str, Foreseen]
) -> Iterator[Foreseen]:
    """Yield what peaks under the records of a suite, fragility and floor spectra will take.

    The peaks under the record of median duration are computed; the time is taken as proportional to
    the durations. Of a frame that yields, some responses at two intensities are timed.

    Args:
        content: The case, which has a suite.
        structure: The structure.
        task: The response of [envelope].
        pieces: Pieces of each stage by its name.

    Raises:
        RefusedError: The records or the limits do not fit the structure.
        FailedError: A response could not be computed.
    """
    assert content.records is not None
    records = suite.suite_records(content.records, task.section, structure)
    # As in the run: peaks are computed of all outputs, and of those that questions limit besides.
    limited = tuple(dict.fromkeys(structure.outputs + content.limited_outputs))
    task = replace(task, limited=limited)
    # Structures that yield take longer the stronger the record is; the median record by duration is
    # a compromise that costs one computation.
    durations = [record.duration for record in records]
    typical = records[int(np.argsort(durations)[len(records) // 2])]
    start = perf_counter()
    suite.stage(structure, task, typical).compute(StageContext())
    seconds = (perf_counter() - start) * sum(durations) / typical.duration
    yield pieces["records"]._replace(seconds=seconds)
    question = content.incremental_question
    if question is not None:
        analyses = suite.analyses_of(question, structure, task, records)
        # the number of responses and their seconds, for each record
        foreseen = [analysis.foresee() for analysis in analyses.values()]
        motions = round(sum(count for count, _ in foreseen))
        yield Foreseen("fragility", motions, "motions", sum(time for _, time in foreseen))
    if content.floor_spectrum is not None:
        moved = suite.moved_by(structure, typical)
        longest = replace(task, duration=max(durations))
        seconds = _floor_spectrum_seconds(content.floor_spectrum, moved, longest)
        yield pieces["floor_spectrum"]._replace(seconds=len(records) * seconds)


def _floor_spectrum_seconds(
    section: FloorSpectrumSection, structure: Structure, task: EnvelopeTask
) -> float:
    """Return about how many seconds floor spectra take, from one period over short durations.

    Args:
        section: Accelerations, periods and damping ratio.
        structure: The structure.
        task: The response of [envelope].

    Raises:
        RefusedError: The structure has no such spectra.
        FailedError: A response could not be computed.
    """
    periods = section.periods_of(structure)
    inputs = structure.inputs(task.fuzzy)
    # The time of a period grows with the time nodes in it, and so with 1/T: the harmonic mean of
    # the periods takes the mean time.
    typical = 0.0
    if periods.any():
        typical = 1 / float(np.mean(1 / periods[periods > 0]))

    def run(fraction: float) -> float:
        """Bound one spectrum over about a fraction of the duration; return the fraction."""
        part, done = shortened(task, fraction)
        floor_spectrum(
            structure.model,
            inputs,
            section.outputs,
            [typical],
            section.damping,
            duration=part.duration,
            step=part.section.step,
            alpha=part.section.alpha,
            progress=False,
        )
        return done

    return len(periods) * whole_seconds(run)


def _answers(
    content: Content, structure: Structure, task: EnvelopeTask, pieces: Mapping[str, Foreseen]
) -> Iterator[Foreseen]:
    """Yield what [probability], [floor_spectrum] and [tolerances] will take.

    They compute responses of their own; all others follow from known peaks.

    Args:
        content: The case.
        structure: The structure.
        task: The response of [envelope].
        pieces: Pieces of each stage by its name.

    Raises:
        RefusedError: Limits or random inputs do not fit the structure.
        FailedError: A response could not be computed.
    """
    if (section := content.questions.get("probability")) is not None:
        stage = answers.stage(Probability, section, Response(structure, task))
        yield pieces["probability"]._replace(seconds=begun_seconds(stage))
    if content.floor_spectrum is not None:
        of_floors = _floor_spectrum_seconds(content.floor_spectrum, structure, task)
        yield pieces["floor_spectrum"]._replace(seconds=of_floors)
    if (section := content.questions.get("tolerances")) is not None:
        assert content.tolerances is not None
        # The largest scale is the widest box, whose envelope takes longest.
        inputs = scale_supports(structure.inputs(task.fuzzy), content.tolerances.most)
        names = [limit.output for limit in section.limits_of(structure)]
        model = structure.model.with_outputs(names)
        method = Auto(PEAK_ERROR, peaks=True)

        def run(fraction: float) -> float:
            """Compute the envelope over about a fraction of the duration; return the fraction."""
            part, done = shortened(task, fraction)
            times: dict[str, Any] = {"duration": part.duration, "step": part.section.step}
            frame_envelope(model, inputs, method, **times, alpha=[0.0], progress=False)
            return done

        found = pieces["tolerances"]
        yield found._replace(seconds=(found.number or 0) * whole_seconds(run))
