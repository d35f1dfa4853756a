"""The key results of a run, and those of two side by side, as tables of texts and sentences."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from textwrap import fill
from typing import Literal, NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.number_text import (
    MINUS,
    ShownUnit,
    Table,
    engineering,
    number_text,
    percent_text,
    range_text,
    text_table,
)
from alphacut.frame import (
    Decision,
    FloorSpectrum,
    Peak,
    SpectrumChecks,
    SpectrumResponse,
    SuitePeaks,
    Tolerances,
)
from alphacut.frame.analyses.answer import Record, enclosing_box_words
from alphacut.frame.structures.quantities import output_of
from alphacut.fuzzy.result import Ends, Nature, rounded
from alphacut.rve.image.bounds import is_positive_definite
from alphacut.rve.result.engineering_constants import PLANE_STRAIN
from alphacut.stages.cell import BOTH_BOUNDS, UPPER_BOUND, constant_label, isotropic_label
from alphacut.stages.envelope import EnvelopeResult
from alphacut.stages.image import ImageResult
from alphacut.stages.modulus import ModulusResult, infinite_if_unknown
from alphacut.stages.summary import FrameResult, Parts

Row = tuple[str, ...]
FLOOR_ROWS = 12
"""Most rows of floor spectra that the terminal shows; of more it has the largest ones."""
MEANING = "Least … largest value if each input stays in its range; α = 1: most plausible"
"""First line of all results, for readers who do not know α-cuts; "nominal" is α = 1."""


class MaterialRow(NamedTuple):
    """Texts of a constant in the table of the material.

    Args:
        label: Name and unit of the constant.
        highest: Its value or range on the highest α-level.
        lowest: Its range on the lowest level.
        nature: Guarantee of the ranges.
        error: Error that the ranges leave out, "none" or empty if there is none.
    """

    label: str
    highest: str
    lowest: str
    nature: str
    error: str


class ComparedEntry(NamedTuple):
    """What is compared of a run: its name, and a number in SI with the unit to show, or a text."""

    what: str
    unit: ShownUnit
    value: float | str


def run_text(parts: Parts, *, every_constant: bool = False) -> str:
    """Return the results of a run for the console.

    Args:
        parts: Numbers of the results; stages that the run lacks are left out.
        every_constant: Whether all constants of a cell or an image are shown.

    Returns:
        Lines that end with a newline: what α-cuts mean; the tables of the material, of the peaks
        and of identified inputs; and sentences on guarantees, smaller time steps, the answers to
        questions, and the inputs that matter most, wrapped at 80 letters.
    """
    of_material = material(parts, every_constant=every_constant)
    shown = [table for table in (of_material, peak_table(parts)) if table.rows]
    sentences = list(material_sentences(parts))
    sentences.extend(chain(natures(parts), wide_bounds(parts), smaller_steps(parts)))
    if parts.update is not None and parts.update.is_refuted:
        sentences.append(parts.update.refuted)
    elif parts.update is not None:
        shown.append(parts.update.table())
    for what, answer, guarantee in answers(parts):
        sentences.append(f"{what}: {answer} ({guarantee})")
    for found in parts.answers:
        if isinstance(found, SpectrumResponse):
            sentences.extend(found.cautions)
        if isinstance(found, SpectrumChecks):
            sentences.extend(note.removesuffix(".") for note in found.notes)
    sentences.extend(drivers(parts))

    # Readers who do not know α-cuts are told once, before the first number.
    text = f"{MEANING}\n" if shown else ""
    for table in shown:
        text += text_table(table.head, table.rows)
    for sentence in sentences:
        text += fill(sentence, 80, subsequent_indent="  ") + "\n"
    return text


def key_tables(parts: Parts) -> list[Table]:
    """Return the tables that the page begins with: material, peaks and answers."""
    return [
        material(parts),
        peak_table(parts),
        Table(("question", "answer", "nature"), answers(parts)),
    ]


def key_sentences(parts: Parts) -> list[str]:
    """Return the sentences below the tables: on guarantees, smaller steps and main inputs."""
    return list(chain(natures(parts), wide_bounds(parts), smaller_steps(parts), drivers(parts)))


def cut_text(cuts: Ends, level: int, nature: Nature, error: float = 0.0) -> str:
    """Return one α-cut as text with five digits, rounded in the direction of its guarantee.

    Args:
        cuts: Lower and upper ends on all levels, NaN where there is no bound, which is shown as
            infinite.
        level: Index of the level; -1 is the highest.
        nature: Guarantee of the ends. Guaranteed ends are moved outwards by `error`.
        error: Absolute error in the unit of the ends. It does not move a positive lower end below
            zero, since a modulus is not negative.
    """
    low, high = (float(end[level]) for end in infinite_if_unknown(cuts))
    if nature is Nature.GUARANTEED:
        # Without the declared error the number shown would be no bound. `min` keeps a lower end
        # that is negative, and lets a positive one fall to 0 at most.
        low = max(low - error, min(low, 0.0))
        high += error
    return range_text(low, high, nature, 5)


def error_text(error: float, nature: Nature) -> str:
    """Return the error that a range leaves out; a guaranteed one leaves out none."""
    if nature is Nature.GUARANTEED:
        return "none"
    return f"{error:.2g}".replace("-", MINUS)


def material(parts: Parts, *, every_constant: bool = False) -> Table:
    """Return a table of the elastic constants, loss factors and damping ratios.

    Args:
        parts: Numbers of the results.
        every_constant: Whether all constants of a cell or an image are shown, instead of E, ν, E_T
            and the loss factor of E alone.

    Returns:
        Row of each constant with its value on the highest level, its range on the lowest one, the
        guarantee and the error. Empty columns are left out. The table is empty if there is neither
        a cell nor an image nor damping by the material.
    """
    rows: list[MaterialRow] = []
    lowest_level = 0.0
    highest_level = 1.0
    found = [part for part in (parts.modulus, parts.image) if part is not None]
    for part in found:
        rows.extend(_constants(part, every_constant=every_constant))
    if found:
        lowest_level, highest_level = found[0].alpha[[0, -1]]
    # Damping ratios follow from loss factors, which come from samples and are of first order: they
    # are called attained, and not guaranteed.
    for name, (low, nominal, high) in parts.damping.items():
        value = range_text(nominal, nominal, Nature.ATTAINED)
        ends = range_text(low, high, Nature.ATTAINED)
        rows.append(MaterialRow(f"damping ratio {name}", value, ends, Nature.ATTAINED, ""))
    # On a single level value and range are the same: one column has both.
    if lowest_level == highest_level == 1:
        rows = [row._replace(lowest="") for row in rows]
    elif lowest_level == highest_level:
        rows = [row._replace(highest="") for row in rows]
    title = f"α = {highest_level:g}"
    if highest_level == 1:
        title = "most plausible"
    head = ("material", title, f"range at α = {lowest_level:g}", "nature", "± error")
    return without_empty_columns(head, rows)


def _constants(part: ModulusResult | ImageResult, *, every_constant: bool) -> Iterator[MaterialRow]:
    """Yield the row of E of a cell or an image, then those of other constants and loss factors.

    Args:
        part: α-cuts of the constants, moduli in GPa.
        every_constant: Whether all constants are shown, instead of E, ν, E_T and the loss factor of
            E alone.
    """
    young = part.E_GPa
    error = 0.0
    error_words = error_text(0.0, part.nature)
    constants: dict[str, Ends] = {}
    # Of a cell at most E is guaranteed, by signs of its derivatives that mechanics proves; of an
    # image bounds by minimum energies hold for every constant.
    nature_of_constants = part.nature
    if isinstance(part, ModulusResult):
        nature_of_constants = Nature.ATTAINED
        error = sum(part.error.values()) * float(young.upper.max())
        error_words = error_text(error, part.nature)
        if part.particles == "mesh":
            nature_of_constants = part.nature  # guaranteed with `mesh.bounds`, by energies as well
            # A mesh from a file is solved once; the error would need a finer mesh.
            if part.nature is not Nature.GUARANTEED:
                error_words = "not declared"
        constants["ν"] = part.nu_cuts
        # E belongs to an isotropic solid with the moduli of the plane. E_T is the modulus across
        # fibres whose ends are free, which a designer needs beside it.
        for name, cuts in part.fibres.items():
            if every_constant or name == "E_T_GPa":
                constants[constant_label(name)] = cuts
    if every_constant:
        for definition, by_name in part.plane.items():
            for name, cuts in by_name.items():
                constants[f"{constant_label(name)} ({definition})"] = cuts
    yield _constant_row(f"E, GPa ({part.average})", young, part.nature, error_words, error)
    for label, cuts in constants.items():
        yield _constant_row(label, cuts, nature_of_constants)
    yield from _loss_rows(part, every_constant=every_constant)


def _loss_rows(part: ModulusResult | ImageResult, *, every_constant: bool) -> Iterator[MaterialRow]:
    """Yield the rows of the loss factors of a cell or an image; none without losses of phases.

    Args:
        part: α-cuts of the loss factors by "E", "G" and "K"; of an image there may be other
            constants. Those of an image are guaranteed to first order, at nominal moduli.
        every_constant: Whether all are shown, instead of the loss factor of E alone.
    """
    if isinstance(part, ImageResult):
        for name, cuts in part.proved_losses.items():
            if every_constant or name == "E":
                label = f"loss factor of {name}, to first order"
                yield _constant_row(label, cuts, part.nature, error_text(0.0, part.nature))
    elif part.loss is not None:
        for name in ("E", "G", "K"):
            if every_constant or name == "E":
                error_words = ""
                if part.loss.error:
                    error_words = error_text(part.loss.error[name], part.loss.nature)
                cuts = getattr(part.loss, name)
                yield _constant_row(f"loss factor of {name}", cuts, part.loss.nature, error_words)


def _constant_row(
    label: str, cuts: Ends, nature: Nature, error_words: str = "", error: float = 0.0
) -> MaterialRow:
    """Return the row of a constant from its α-cuts, and from its error, if one is declared."""
    # The declared error is the largest of all samples, so it widens the range on the lowest level;
    # the value on the highest one is shown as it was computed.
    highest = cut_text(cuts, -1, nature)
    return MaterialRow(label, highest, cut_text(cuts, 0, nature, error), nature, error_words)


def without_empty_columns(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table without the columns whose cells are all empty or "none".

    Args:
        head: Title of each column.
        rows: Text of each column, for each row. Without rows the table has no columns either.
    """
    # "none" says that a guaranteed range leaves out no error: a column of it says nothing more.
    columns = [k for k in range(len(head)) if any(row[k] not in ("", "none") for row in rows)]
    filled_rows = [tuple(row[k] for k in columns) for row in rows]
    return Table(tuple(head[k] for k in columns), filled_rows)


def material_sentences(parts: Parts) -> Iterator[str]:
    """Yield sentences, without full stops, on how the material was computed, and what it is of."""
    if (image := parts.image) is not None:
        yield from image_sentences(image)
    if (cell := parts.modulus) is not None:
        # Constants without stress along the fibres need the stiffness along them, which follows
        # from that of the plane for isotropic phases alone.
        if list(cell.plane) == [PLANE_STRAIN]:
            yield "Plane strain alone: the other definition is for one particle of isotropic phases"
        cost = f"{cell.samples} samples, {cell.solves} linear systems, {cell.seconds:.1f} s"
        yield f"Cells: {cost}, {cell.method}"
        if cell.solver:
            yield f"Cells: {cell.solver}"
    for part in (cell, image):
        if part is not None and (bounds := part.references.get("hashin_shtrikman_E_GPa")):
            yield f"{isotropic_label(part.average)}: {bounds[0]:.4f} … {bounds[1]:.4f} GPa"


def image_sentences(image: ImageResult) -> Iterator[str]:
    """Yield sentences, without full stops, on what bounds of an image hold for, and its phases."""
    # Segmentation is not part of the claim: a wrong threshold gives right bounds of a wrong image.
    # The stiffness matrix is 3×3 of an image, and 6×6 of a volume.
    kind = "volume"
    what = "volume, repeated periodically"
    if len(image.lower_GPa) == 3:
        kind = "area"
        what = "image as segmented, repeated periodically, in plane strain"
    yield f"The bounds are guaranteed of the {what}"
    fractions = ", ".join(f"{name} {fraction:.1%}" for name, fraction in image.fractions.items())
    yield f"Of the {kind}: {fractions}"
    yield width_text(image)


def width_text(image: ImageResult) -> str:
    """Return a sentence, without its full stop, on the width of E or on its missing bounds.

    Args:
        image: Bounds of the stiffness matrix on the highest level, and the width of E on the lowest
            level by its cause, in GPa. Without a lower bound the lower matrix is singular;
            without an upper bound an entry of the upper one is infinite.
    """
    has_lower = is_positive_definite(image.lower_GPa)
    has_upper = np.isfinite(image.upper_GPa).all()
    missing = []
    if not has_lower:
        why = "no solid that carries is found in some direction, or to some shear"
        missing.append(f"lower bound of E but 0: {why}")
    if not has_upper:
        # In the plane E = G (3 − G/K). It falls where G, which has no bound, exceeds 3/2 K.
        which = "upper"
        if has_lower and infinite_if_unknown(image.E_GPa).lower[0] <= 0:
            which = "lower or upper"
        missing.append(f"{which} bound of E: a phase may be rigid")
    if missing:
        return f"This program gives no {', and no '.join(missing)}"
    widths = (f"{cause} {width:.3g} GPa" for cause, width in image.widths_GPa.items())
    return f"Width of E from {', '.join(widths)}"


def peak_table(parts: Parts) -> Table:
    """Return a table of the peak of each output over time.

    Args:
        parts: Numbers of the results.

    Returns:
        Each peak has a row for each unit in which it is shown, with its first limit, and below it a
        row for each further limit. Columns are the cuts on the highest and the lowest level, and on
        a middle one if no peak is guaranteed; the error; of guaranteed peaks the attained value and
        the gap; the record under which a structure moves farthest, with the angle if all angles are
        meant; the limit; and whether it is exceeded. Empty columns are left out. Peaks over a suite
        come last. Without peaks the table is empty.
    """
    studies = parts.studies
    if not studies:
        return Table((), [])
    # All studies of a case have the same levels.
    alpha = next(iter(studies.values())).alpha
    levels = _shown_levels(studies.values(), alpha)

    limits = limits_by_peak(parts)
    rows: list[list[str]] = []
    for name, study in studies.items():
        suffix = ""
        if len(studies) > 1:
            suffix = f" ({name})"
        farthest: dict[str, str] = {}
        if isinstance(study, SuitePeaks):
            farthest = {peak_name: study.where(peak_name) for peak_name in study.peak}
        for peak_name, peak in shown_peaks(study).items():
            unit = parts.shown_units[output_of(peak_name)]
            is_force = study.units[output_of(peak_name)] == "N"
            # A limit of NaN stands for none, so that a peak without limits has a row as well.
            verdicts = limits.get(peak_name, [(math.nan, "")])
            record = farthest.get(peak_name, "")
            for label, factor in display_units(peak_name, unit, parts.structure, is_force=is_force):
                cells = [*peak_cells(peak, factor, levels), record]
                for limit, verdict in verdicts:
                    limit_text = ""
                    if not math.isnan(limit):
                        limit_text = engineering(limit * factor, "")
                    rows.append([label + suffix, *cells, limit_text, verdict])
                    # Further limits and units of the same peak do not repeat what is said of it.
                    cells = [""] * len(cells)
                    record = ""
    titles = [f"α = {alpha[level]:g}" for level in levels]
    # At α = 1 triangular numbers have one value, the nominal one, and so has each peak.
    if alpha[-1] == 1 and not any("…" in row[1] for row in rows):
        titles[0] = "nominal"
    head = ["peak of", *titles, "± error", "reached", "gap", "record", "limit", "exceeded"]
    return without_empty_columns(head, rows)


def _shown_levels(studies: Iterable[EnvelopeResult | SuitePeaks], alpha: Array) -> list[int]:
    """Return the indices of the α-levels whose cuts a table of peaks shows, the highest first.

    Args:
        studies: Peaks of the studies and of the suite.
        alpha: Their rising levels, shape (levels,).

    Returns:
        The highest and the lowest level; between them, if no peak is guaranteed and the table has
        no gaps, the level nearest to 1/2. Each index stands once, so that a single level gives one.
    """
    levels = [len(alpha) - 1, 0]
    peaks = [peak for study in studies for peak in study.peak.values()]
    if not any(peak.nature is Nature.GUARANTEED for peak in peaks):
        levels.insert(1, int(np.argmin(np.abs(alpha - 0.5))))
    return list(dict.fromkeys(levels))


def shown_peaks(study: EnvelopeResult | SuitePeaks) -> dict[str, Peak]:
    """Return the peaks of a study, or those of the outputs alone that the case names for it."""
    named = getattr(study, "drawn", ()) or study.peak
    return {name: peak for name, peak in study.peak.items() if name in named}


def peak_cells(peak: Peak, factor: float, levels: Sequence[int]) -> list[str]:
    """Return the texts of a peak: its cut on each level, error, attained value and gap.

    Args:
        peak: Bounds of a peak in SI units.
        factor: Number by which they are multiplied to be shown.
        levels: Indices of the levels whose cuts are shown. The cuts on the lowest and the highest
            level have four digits, all others three.

    Returns:
        A text for each level; the error; the farthest attained peak on the lowest level; and the
        gap. The gap is the distance from this peak to the farthest bound, as a fraction of the
        bound. Attained peak and gap are empty for peaks that are not guaranteed. They are also
        empty if the box of the inputs encloses a set learned from a measurement, since no response
        of the box is known to belong to the set.
    """
    lower = factor * peak.lower
    upper = factor * peak.upper
    cells = []
    for level in levels:
        digits = 4
        if 0 < level < len(lower) - 1:
            digits = 3
        cells.append(range_text(float(lower[level]), float(upper[level]), peak.nature, digits))
    cells.append(error_text(factor * float(peak.error.max()), peak.nature))
    reached_text = ""
    gap_text = ""
    if peak.nature is Nature.GUARANTEED and not peak.encloses:
        # Attained values are rounded inwards, so that the rounded one is attained as well.
        side: Literal["lower", "upper"] = "upper"
        if peak.is_least:
            side = "lower"
        reached = rounded(factor * float(peak.reached[0]), side, Nature.ATTAINED)
        reached_text = number_text(reached)
        gap_text = f"{peak.gaps[0]:.1%}"
    return [*cells, reached_text, gap_text]


def limits_by_peak(parts: Parts) -> dict[str, list[tuple[float, str]]]:
    """Return the limits of [decision] by the name of their peak, each with its verdict.

    Args:
        parts: Numbers of the results.

    Returns:
        Limit in the SI unit of the peak, and "yes", "no", "can be" or "undecided" on whether it is
        exceeded, in the order of the case. Empty without this question.
    """
    limits: dict[str, list[tuple[float, str]]] = {}
    decided = parts.answered.get(Decision.key)
    if not isinstance(decided, Decision):
        return limits
    short = {"exceeded": "yes", "not exceeded": "no", "can be exceeded": "can be"}
    for decision in decided.limits.values():
        verdict = short.get(decision.verdict, decision.verdict)
        limits.setdefault(decision.peak_name, []).append((decision.limit, verdict))
    return limits


def display_units(
    name: str, unit: ShownUnit, frame: FrameResult | None, *, is_force: bool
) -> Iterator[ShownUnit]:
    """Yield each unit in which a peak is shown, labelled as its row of a table.

    The first is `unit`. In a frame a drift is also shown in per cent of the height of its storey,
    and a force in per cent of the weight of all floors.

    Args:
        name: Name of the peak, such as "drift1" or "max q3".
        unit: Unit of the output; its label is empty for a pure number.
        frame: Weight in N and heights in m by output; None for other structures.
        is_force: Whether the output is a force.
    """
    label = name
    if unit.label:
        label = f"{name}, {unit.label}"
    yield ShownUnit(label, unit.factor)
    if frame is None:
        return
    height = frame.heights_m.get(output_of(name))
    # Codes limit drifts by the height of a storey, and state base shears over the weight.
    if height is not None:
        yield ShownUnit("  % of storey", 100 / height)
    if is_force:
        yield ShownUnit("  % of weight", 100 / frame.weight_N)


def natures(parts: Parts) -> Iterator[str]:
    """Yield sentences, without full stops, on what is guaranteed and how it was tested.

    They say which peaks are guaranteed, estimated or attained, and how many exact responses agree
    with guaranteed bounds. Others explain the stiffness on an own mesh, inputs that were learned
    from a measurement, and means over records. Sentences that do not apply are left out.

    Args:
        parts: Numbers of the results.
    """
    suite = parts.records
    if parts.modulus is not None and parts.modulus.particles == "mesh":
        yield BOTH_BOUNDS if parts.modulus.nature is Nature.GUARANTEED else UPPER_BOUND
    over = "over time"
    if not all(study.is_over_time for study in parts.envelopes.values()):
        over = "over as many periods of the force as its nominal frequency has in the duration"
    if suite is not None:
        over = "over time and records"
        if suite.has_angles:
            over = "over time, records and all angles of incidence"
    outputs: dict[Nature, dict[str, None]] = {}  # an ordered set of names for each guarantee
    for study in parts.studies.values():
        for output, peak in study.peak.items():
            outputs.setdefault(peak.nature, {})[output] = None
    # With a single guarantee the names of the outputs are left out.
    groups = [f"{nature} ({', '.join(names)})" for nature, names in outputs.items()]
    if len(groups) == 1:
        groups = [f"all {nature}" for nature in outputs]
    if groups:
        yield f"Peaks are largest magnitudes {over}, {', '.join(groups)}"
    if parts.encloses:
        yield box_words(parts)
    learned = parts.update
    if learned is not None and learned.narrowed and min(learned.narrowed.values()) > 0.99:
        yield "The measured modes teach nothing: no input has a narrower range than before"
    if suite is not None:
        yield "A mean is that of one structure's peaks; its bounds are means of the records' bounds"
    # Envelopes whose own bounds are not guaranteed were compared with wider ones that are.
    for is_guaranteed in (True, False):
        envelopes = parts.envelopes.values()
        tested = [x for x in envelopes if (x.nature is Nature.GUARANTEED) == is_guaranteed]
        if count := sum(study.motions_tested for study in tested):
            yield f"{count} exact motions by another algorithm {agreement(is_guaranteed)}"


def box_words(parts: Parts) -> str:
    """Return sentences on bounds of a box around a set, with its studies unless it has all."""
    words = enclosing_box_words(parts.encloses)
    boxed = [x for x, y in parts.envelopes.items() if any(z.encloses for z in y.peak.values())]
    if len(boxed) in (0, len(parts.envelopes)):
        return words
    return f"{', '.join(boxed)}: {words[0].lower()}{words[1:]}"


def agreement(is_guaranteed: bool) -> str:
    """Return where tested motions lie: an envelope that is not guaranteed has wider bounds."""
    if is_guaranteed:
        return "agree with what is guaranteed"
    return "lie in the wider bounds that are proved"


def wide_bounds(parts: Parts) -> Iterator[str]:
    """Yield a sentence for each peak whose bound is wide or not guaranteed, with what would help.

    Args:
        parts: Numbers of the results.
    """
    for study in parts.studies.values():
        for name, peak in study.peak.items():
            if peak.warning:
                yield f"Warning: {name}: {peak.warning}"


def smaller_steps(parts: Parts) -> Iterator[str]:
    """Yield a sentence for each peak whose bound the time step widens noticeably.

    Bounds hold at all times, so they contain what responses may add between the time nodes. Widened
    noticeably are bounds of which this is over 1 %, and over half of their uncertainty.

    Args:
        parts: Numbers of the results.
    """
    for study in parts.envelopes.values():
        for name, peak in study.peak.items():
            if not peak.is_widened_by_step or peak.warning:
                continue
            what = "its error"
            whole = float(peak.error[0])
            if peak.nature is Nature.GUARANTEED:
                what = "its bound"
                whole = abs(float(peak.far_end[0]))
            fraction = percent_text(peak.between_nodes / whole)
            between = f"what may come between time nodes {study.step:g} s apart"
            yield f"{name}: {fraction} of {what} is {between}; a smaller step narrows it"


def answers(parts: Parts) -> list[Row]:
    """Return the answers to all questions of a case as rows of texts.

    Args:
        parts: Numbers of the results.

    Returns:
        Rows of what is answered, the answer, and its guarantee, in the order of the report. The
        admissible ranges of the inputs, of which a case may have many, share one row. Of floor
        spectra with many periods there is the largest value of each curve.
    """
    rows: list[Row] = []
    for answer in parts.answers:
        answer_rows = answer.table().rows
        if isinstance(answer, Tolerances):
            # The console has no room for a row of each input; page and CSV file have all.
            scale = answer_rows[0]
            count = len(answer_rows) - 1  # one row for each input
            place = "table on the page and, by report --csv, in tolerances.csv"
            inputs = "input" if count == 1 else "inputs"
            answer_rows = [(scale[0], f"{scale[1]}; {scale[3]}", scale[2])]
            answer_rows.append(("ranges", f"of {count} {inputs}", place))
        if isinstance(answer, FloorSpectrum) and len(answer_rows) > FLOOR_ROWS:
            answer_rows = [answer_rows[k] for k in answer.largest_rows]
        for row in answer_rows:
            rows.append((f"{answer.key}: {row[0]}", row[1], row[2]))
    return rows


def drivers(parts: Parts) -> Iterator[str]:
    """Yield a sentence on the inputs that widen E most, and one on the last output's peak.

    Each names up to three inputs of E and two of a peak, with the fraction by which the width of
    the result on the lowest level falls if the input is fixed at its nominal value.

    Args:
        parts: Numbers of the results, with these fractions by result and input in `shares`. The
            results are "E", "ν" and, for each output, "the peak of NAME". Without them nothing is
            yielded.
    """
    # The last output of a case in general belongs to the top floor, which moves most.
    peaks = [name for name in parts.shares if name not in ("E", "ν")]
    if "E" in parts.shares:
        yield _driver_sentence("E", parts.shares["E"], count=3)
    for name in peaks[-1:]:
        what = name.replace("the peak", "the reached peak")
        # The search was in a box around a set learned from a measurement. Its points need not
        # belong to the set, so that no peak is known to be reached.
        if parts.encloses:
            what = f"{name}, as tried in the box around {parts.encloses},"
        yield _driver_sentence(what, parts.shares[name], count=2)


def _driver_sentence(what: str, fractions: Mapping[str, float], *, count: int) -> str:
    """Return a sentence, without its full stop, on the inputs that widen a result most.

    Args:
        what: The result, in words.
        fractions: Fraction by which its width falls if an input is fixed, by input; not empty.
        count: Number of inputs that are named at most, the largest fraction first.
    """
    ranked = sorted(fractions.items(), key=lambda entry: -entry[1])[:count]
    largest, fraction = ranked[0]
    sentence = f"Fixing {largest} narrows {what} by {percent_text(fraction, 0)}"
    for name, further_fraction in ranked[1:]:
        sentence += f", {name} by {percent_text(further_fraction, 0)}"
    return sentence


def compared(runs: Sequence[Parts]) -> list[Record]:
    """Return a row for each quantity that all runs have in common, in the order of the first run.

    Returns:
        Its name, the unit of the first run, the number in this unit or text of each run, and the
        ratios of all runs but the first over the first, None of texts and over 0; by the titles of
        the columns.
    """
    # Runs are compared by the names of quantities, whatever their cases have besides.
    entries = [{x.what: x for x in _compared_entries(run)} for run in runs]
    names = ["first", "second", "third", *(f"{k}th" for k in range(4, len(runs) + 1))][: len(runs)]
    rows: list[Record] = []
    for what, first in entries[0].items():
        values = [of_run[what].value for of_run in entries if what in of_run]
        if len(values) < len(runs):
            continue
        row: Record = {"at the lowest α": what, "unit": first.unit.label}
        for name, value in zip(names, values, strict=True):
            row[name] = value if isinstance(value, str) else value * first.unit.factor
        for name, value in zip(names[1:], values[1:], strict=True):
            row[f"{name} over first"] = None
            if isinstance(value, float) and isinstance(first.value, float) and first.value:
                row[f"{name} over first"] = value / first.value
        rows.append(row)
    return rows


def comparison(rows: Sequence[Record]) -> Table:
    """Return rows of `compared` as a table of texts, of numbers with their units."""
    titles = [title for title in rows[0] if title != "unit"]

    def text(title: str, row: Record) -> str:
        """Return the text of a column of a row."""
        value = row[title]
        if isinstance(value, float):
            unit = ShownUnit(str(row["unit"]), 1.0)
            return f"{value:.3f}" if " over " in title else unit.text(value)
        return str(value or "")

    return Table(tuple(titles), [tuple(text(title, row) for title in titles) for row in rows])


def _compared_entries(parts: Parts) -> Iterator[ComparedEntry]:
    """Yield the quantities of a run on its lowest level that are compared with another run's.

    They are the largest E and its width, unless infinite; the farthest bound and the width of each
    peak; statistics over the records of a suite; the verdict on each limit; and the admissible
    scale of the tolerances.

    Args:
        parts: Numbers of the results.
    """
    shown_units = parts.shown_units
    no_unit = ShownUnit("", 1.0)
    gigapascal = ShownUnit("GPa", 1e-9)
    for result in (parts.modulus, parts.image):
        if result is None:
            continue
        # In SI units, as all entries; without a bound an end is infinite and not compared.
        low, high = (1e9 * float(end[0]) for end in infinite_if_unknown(result.E_GPa))
        if math.isfinite(high):
            yield ComparedEntry("greatest E", gigapascal, high)
        if math.isfinite(high - low):
            yield ComparedEntry("width of E", gigapascal, high - low)
    for study_name, study in parts.envelopes.items():
        for output, peak in study.peak.items():
            name = output
            if study_name != "all":  # the name of the study that [envelope] alone makes
                name = f"{output} ({study_name})"
            unit = shown_units[output_of(output)]
            width = float(peak.upper[0] - peak.lower[0])
            yield ComparedEntry(f"greatest peak of {name}", unit, float(peak.far_end[0]))
            yield ComparedEntry(f"width of the peak of {name}", unit, width)
    if parts.records is not None:
        for output, statistics in parts.records.statistics.items():
            unit = shown_units[output_of(output)]
            # Each statistic, such as the mean over the records, has a value for each level.
            for name, ends in statistics.items():
                what = f"{name} of the records' peaks of {output}"
                yield ComparedEntry(what, unit, float(ends[0]))  # on the lowest level
    for answer in parts.answers:
        for what, value in answer.compared().items():
            yield ComparedEntry(what, no_unit, value)
