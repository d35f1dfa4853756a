"""The key results of a run, and those of two side by side, as tables of texts and sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from textwrap import wrap

import numpy as np

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
from alphacut.frame import Peak, SuitePeaks, Tolerances
from alphacut.frame.analyses.answer import enclosing_box_words
from alphacut.frame.structures.quantities import output_of
from alphacut.fuzzy.result import Ends, Nature, rounded
from alphacut.stages.cell import UPPER_BOUND, constant_label
from alphacut.stages.envelope import EnvelopeResult
from alphacut.stages.image import ImageResult
from alphacut.stages.modulus import ModulusResult, infinite_if_unknown
from alphacut.stages.summary import FrameResult, Parts

Row = tuple[str, ...]
MEANING = "Least … largest value if every input stays in its range; α = 1: most plausible"
"""First line of all results, for readers who do not know α-cuts; "nominal" is α = 1."""


def run_text(parts: Parts) -> str:
    """Return the results of a run for the console: tables, then sentences, answers and drivers."""
    shown = [table for table in (material(parts), peak_table(parts)) if table.rows]
    sentences = [guaranteed_of(parts.image)] if parts.image is not None else []
    sentences += [*natures(parts), *smaller_steps(parts)]
    if parts.modulus is not None and parts.modulus.solver:
        sentences.append(f"Cells: {parts.modulus.solver}")
    if parts.update is not None and parts.update.is_refuted:
        sentences.append(parts.update.refuted)
    elif parts.update is not None:
        shown.append(Table(*parts.update.table()))
    sentences += [f"{what}: {answer} ({guarantee})" for what, answer, guarantee in answers(parts)]
    sentences += drivers(parts)
    heading = f"{MEANING}\n" if shown else ""
    tables = "".join(text_table(*table) for table in shown)
    lines = [line for text in sentences for line in wrap(text, 80, subsequent_indent="  ")]
    return heading + tables + "".join(f"{line}\n" for line in lines)


def key_tables(parts: Parts) -> list[Table]:
    """Return the tables that the page begins with: material, peaks and answers."""
    return [
        material(parts),
        peak_table(parts),
        Table(("question", "answer", "nature"), answers(parts)),
    ]


def key_sentences(parts: Parts) -> list[str]:
    """Return the sentences below them: on guarantees, smaller steps and the main drivers."""
    return [*natures(parts), *smaller_steps(parts), *drivers(parts)]


def cut_text(cuts: Ends, level: int, nature: Nature, error: float = 0.0) -> str:
    """Return one α-cut with five digits; the ends of a guaranteed one contain the error.

    The error does not change the sign of the lower end: a modulus is not negative.
    """
    low, high = (float(end[level]) for end in infinite_if_unknown(cuts))
    if nature is Nature.GUARANTEED:
        low = max(low - error, min(low, 0.0))
        high += error
    return range_text(low, high, nature, 5)


def error_text(error: float, nature: Nature) -> str:
    """Return the error that a range leaves out; a guaranteed one leaves out none."""
    return "none" if nature is Nature.GUARANTEED else f"{error:.2g}".replace("-", MINUS)


def material(parts: Parts, *, every_constant: bool = False) -> Table:
    """Return a table of the elastic constants and loss factors, and of damping ratios.

    Each row has the value on the highest level, the range on the lowest one, guarantee and error.
    Of a cell and an image these are E, ν, E_T and the loss factor of E, or `every_constant`.
    """
    found = [part for part in (parts.modulus, parts.image) if part]
    rows = [row for part in found for row in _constants(part, every_constant=every_constant)]
    first, last = found[0].alpha[[0, -1]] if found else (0.0, 1.0)
    for name, (low, nominal, high) in parts.damping.items():
        value = range_text(nominal, nominal, Nature.ATTAINED)
        ends = range_text(low, high, Nature.ATTAINED)
        rows.append((f"damping ratio {name}", value, ends, Nature.ATTAINED, ""))
    if first == last:  # value and range are the same: one column has both
        same = 2 if last == 1 else 1
        rows = [(*row[:same], "", *row[same + 1 :]) for row in rows]
    title = "most plausible" if last == 1 else f"α = {last:g}"
    head = ("material", title, f"range at α = {first:g}", "nature", "± error")
    return without_empty_columns(head, rows)


def _constants(part: ModulusResult | ImageResult, *, every_constant: bool) -> Iterator[Row]:
    """Yield the row of E of a cell or an image, then those of other constants and loss factors."""
    nature, young = part.nature, part.E_GPa
    error, error_cell = 0.0, error_text(0.0, nature)
    constants = dict[str, Ends]()
    # Of a cell at most E is guaranteed; of an image every constant is.
    nature_of_constants = nature
    if isinstance(part, ModulusResult):
        nature_of_constants = Nature.ATTAINED
        error = sum(part.error.values()) * float(young.upper.max())
        # A mesh from a file is solved once, without a finer one that would tell the error.
        error_cell = "not declared" if part.particles == "mesh" else error_text(error, nature)
        constants["ν"] = part.nu_cuts
        for name, cuts in part.fibres.items():
            if every_constant or name == "E_T_GPa":
                constants[constant_label(name)] = cuts
    if every_constant:
        for definition, by_name in part.plane.items():
            for name, cuts in by_name.items():
                constants[f"{constant_label(name)} ({definition})"] = cuts
    ends = cut_text(young, -1, nature), cut_text(young, 0, nature, error)
    yield (f"E, GPa ({part.average})", *ends, nature, error_cell)
    for label, cuts in constants.items():
        yield _row(label, cuts, nature_of_constants)

    if isinstance(part, ImageResult) and part.proved_losses:
        for name, cuts in part.proved_losses.items():
            if every_constant or name == "E":
                label = f"loss factor of {name}, to first order"
                yield _row(label, cuts, nature, error_text(0.0, nature))
    elif isinstance(part, ModulusResult) and (loss := part.loss) is not None:
        for name in "EGK" if every_constant else "E":
            error_cell = error_text(loss.error[name], loss.nature) if loss.error else ""
            yield _row(f"loss factor of {name}", getattr(loss, name), loss.nature, error_cell)


def _row(label: str, cuts: Ends, nature: Nature, error: str = "") -> Row:
    return label, cut_text(cuts, -1, nature), cut_text(cuts, 0, nature), nature, error


def without_empty_columns(head: Row, rows: list[Row]) -> Table:
    """Return the table without columns whose cells are all empty or "none"."""
    columns = [k for k in range(len(head)) if any(row[k] not in ("", "none") for row in rows)]
    filled_rows = [tuple(row[k] for k in columns) for row in rows]
    return Table(tuple(head[k] for k in columns), filled_rows)


def guaranteed_of(image: ImageResult) -> str:
    """Return a sentence on what the bounds of an image or volume are guaranteed of."""
    if len(image.lower_GPa) == 3:
        what = "image as segmented, repeated periodically, in plane strain"
    else:
        what = "volume, repeated periodically"
    return f"The bounds are guaranteed of the {what}"


def fractions_text(image: ImageResult) -> str:
    """Return a sentence, without its full stop, on the fractions of the phases."""
    measured = "area" if len(image.lower_GPa) == 3 else "volume"
    fractions = ", ".join(f"{name} {fraction:.1%}" for name, fraction in image.fractions.items())
    return f"Of the {measured}: {fractions}"


def width_text(image: ImageResult) -> str:
    """Return the width of E at the lowest level by cause, or which bound is missing and why."""
    has_lower, has_upper = image.lower_GPa.any(), np.isfinite(image.upper_GPa).all()
    missing = []
    if not has_lower:
        why = "stresses are sought that vanish in closed pores, and these meet their own image"
        missing.append(f"lower bound of E: {why}")
    if not has_upper:
        # In the plane E = G (3 − G/K). It falls where G, which has no bound, exceeds 3/2 K.
        may_be_zero = has_lower and infinite_if_unknown(image.E_GPa).lower[0] <= 0
        which = "lower or upper" if may_be_zero else "upper"
        missing.append(f"{which} bound of E: a phase may be rigid")
    if missing:
        return f"This program gives no {', and no '.join(missing)}"
    widths = (f"{cause} {width:.3g} GPa" for cause, width in image.widths_GPa.items())
    return f"Width of E from {', '.join(widths)}"


def peak_table(parts: Parts) -> Table:
    """Return a table of the peak of each output: its cuts, error or gap, limits and verdicts.

    Proved peaks have a gap; the others have the cut of a middle level as well. Each further limit
    of a peak has a row of its own. Of a suite the peaks are the largest over the records, then the
    means.
    """
    studies: dict[str, EnvelopeResult | SuitePeaks] = {**parts.envelopes}
    if parts.records is not None:
        studies["records"] = parts.records
    if not studies:
        return Table((), [])
    alpha = next(iter(studies.values())).alpha
    levels = [len(alpha) - 1, 0]
    peaks = [peak for study in studies.values() for peak in study.peak.values()]
    if not any(peak.nature is Nature.GUARANTEED for peak in peaks):
        levels.insert(1, int(np.argmin(np.abs(alpha - 0.5))))
    levels = list(dict.fromkeys(levels))

    limits = limits_by_peak(parts)
    rows = list[Row]()
    for name, study in studies.items():
        suffix = f" ({name})" if len(studies) > 1 else ""
        farthest = study.farthest_record if isinstance(study, SuitePeaks) else {}
        for peak_name, peak in shown_peaks(study).items():
            output = output_of(peak_name)
            record = farthest.get(peak_name, "")
            verdicts = limits.get(peak_name, [(math.nan, "")])
            is_force = study.units[output] == "N"
            for label, factor in display_units(
                peak_name, parts.shown_units[output], parts.structure, is_force=is_force
            ):
                cells = peak_cells(peak, factor, levels)
                for limit, verdict in verdicts:
                    limit_text = "" if math.isnan(limit) else engineering(limit * factor, "")
                    rows.append((label + suffix, *cells, record, limit_text, verdict))
                    # Further limits of the same peak do not repeat what is said of it.
                    cells, record = ("",) * len(cells), ""
    titles = [f"α = {alpha[level]:g}" for level in levels]
    if alpha[-1] == 1 and not any("…" in row[1] for row in rows):
        titles[0] = "nominal"
    head = ("peak of", *titles, "± error", "reached", "gap", "record", "limit", "exceeded")
    return without_empty_columns(head, rows)


def shown_peaks(study: EnvelopeResult | SuitePeaks) -> dict[str, Peak]:
    """Return the peaks of a study, or those of the outputs alone that the case names for it."""
    drawn = study.drawn if isinstance(study, EnvelopeResult) else ()
    return {name: peak for name, peak in study.peak.items() if not drawn or name in drawn}


def peak_cells(peak: Peak, factor: float, levels: Sequence[int]) -> Row:
    """Return the texts of a peak: its cuts, its error, what is reached, and the gap.

    Args:
        peak: Bounds of a peak in SI units.
        factor: Number by which they are multiplied to be shown.
        levels: Indices of the levels whose cuts are shown. A cut between the highest and the
            lowest level has three digits, these have four.
    """
    nature, lower, upper = peak.nature, factor * peak.lower, factor * peak.upper
    cuts = []
    for level in levels:
        digits = 3 if 0 < level < len(lower) - 1 else 4
        cuts.append(range_text(float(lower[level]), float(upper[level]), nature, digits))
    error = error_text(factor * float(peak.error.max()), nature)
    if nature is not Nature.GUARANTEED or peak.encloses:
        return (*cuts, error, "", "")
    inner = "lower" if peak.is_least else "upper"
    reached = rounded(factor * float(peak.reached[0]), inner, Nature.ATTAINED)
    return (*cuts, error, number_text(reached), f"{peak.gaps[0]:.1%}")


def limits_by_peak(parts: Parts) -> dict[str, list[tuple[float, str]]]:
    """Return limits in SI units, each with its verdict in a word, by the name of their peak."""
    short = {"exceeded": "yes", "not exceeded": "no", "can be exceeded": "can be"}
    limits: dict[str, list[tuple[float, str]]] = {}
    for decision in () if parts.decision is None else parts.decision.limits.values():
        verdict = short.get(decision.verdict, decision.verdict)
        limits.setdefault(decision.peak_name, []).append((decision.limit, verdict))
    return limits


def display_units(
    name: str, unit: ShownUnit, frame: FrameResult | None, *, is_force: bool
) -> Iterator[tuple[str, float]]:
    """Yield the label and the factor from SI of each unit in which a peak is shown.

    Of a frame these are also the height of the storey of a drift, and the weight, for a force.
    """
    yield f"{name}, {unit.label}" if unit.label else name, unit.factor
    if frame is None:
        return
    height = frame.heights_m.get(output_of(name))
    if height is not None:
        yield "  % of storey", 100 / height
    if is_force:
        yield "  % of weight", 100 / frame.weight_N


def natures(parts: Parts) -> Iterator[str]:
    """Yield sentences on the guarantees of C and of peaks, and on the motions that tested them."""
    studies, suite = parts.envelopes.values(), parts.records
    if parts.modulus is not None and parts.modulus.particles == "mesh":
        yield UPPER_BOUND
    outputs: dict[Nature, dict[str, None]] = {}  # an ordered set of names for each guarantee
    for study in (*studies, suite):
        for output, peak in (study.peak if study else {}).items():
            outputs.setdefault(peak.nature, {})[output] = None
    groups = [f"{nature} ({', '.join(names)})" for nature, names in outputs.items()]
    if len(groups) == 1:
        groups = [f"all {nature}" for nature in outputs]
    if groups:
        over = "over time" if suite is None else "over time and records"
        yield f"Peaks are largest magnitudes {over}, {', '.join(groups)}"
    if parts.encloses:
        yield enclosing_box_words(parts.encloses)
    if suite is not None:
        yield "A mean is that of one structure's peaks; its bounds are means of the records' bounds"
    for is_guaranteed in (True, False):
        tested = [x for x in studies if (x.nature is Nature.GUARANTEED) == is_guaranteed]
        if count := sum(study.motions_tested for study in tested):
            yield f"{count} exact motions by another algorithm {agreement(is_guaranteed)}"


def agreement(is_guaranteed: bool) -> str:
    """Return where tested motions lie: an envelope that is not guaranteed has wider bounds."""
    if is_guaranteed:
        return "agree with what is guaranteed"
    return "lie in the wider bounds that are proved"


def smaller_steps(parts: Parts) -> Iterator[str]:
    """Yield a sentence for each peak whose bound is widened most by motions between nodes."""
    for study in parts.envelopes.values():
        for name, peak in study.peak.items():
            if not peak.is_widened_by_step:
                continue
            # What motions add between nodes falls with the square of the step: half a step
            # leaves a quarter of it.
            saved = 0.75 * peak.between_nodes
            if peak.nature is not Nature.GUARANTEED:
                what, value = "an error of", float(peak.error[0]) - saved
            elif peak.is_least:
                what, value = "at least", float(peak.far_end[0]) + saved
            else:
                what, value = "at most", float(peak.far_end[0]) - saved
            text = parts.shown_units[output_of(name)].text(value)
            yield f"{name}: a step of {study.step / 2:g} s would give {what} about {text}"


def answers(parts: Parts) -> list[Row]:
    """Return rows (what, answer, guarantee) of all answers; inputs of tolerances share a row."""
    rows: list[Row] = []
    for answer in parts.answers:
        answer_rows = answer.table().rows
        if isinstance(answer, Tolerances):
            scale, *inputs = answer_rows
            place = "table on the page and in tolerances.csv"
            answer_rows = [scale, ("ranges", f"of {len(inputs)} inputs", place)]
        rows += [(f"{answer.key}: {row[0]}", *row[1:3]) for row in answer_rows]
    return rows


def drivers(parts: Parts) -> Iterator[str]:
    """Yield sentences on the inputs that widen E most, and the last output's peak most."""
    peaks = [name for name in parts.shares if name not in ("E", "ν")]
    for name in [name for name in parts.shares if name == "E"] + peaks[-1:]:
        count = 3 if name == "E" else 2
        ranked = sorted(parts.shares[name].items(), key=lambda x: -x[1])[:count]
        (largest, fraction), *further = ranked
        more = "".join(f", {x} by {percent_text(y, 0)}" for x, y in further)
        what = name.replace("the peak", "the reached peak")
        if name != "E" and parts.encloses:
            what = f"{name}, as tried in the box around {parts.encloses},"
        yield f"Fixing {largest} narrows {what} by {percent_text(fraction, 0)}{more}"


def comparison(first: Parts, second: Parts) -> Table:
    """Return a table of what both runs have: E, peaks and their widths, verdicts on limits."""
    rows: list[Row] = []
    second_entries = {what: entry for what, _, entry in _compared_entries(second)}
    for what, unit, entry in _compared_entries(first):
        if what not in second_entries:
            continue
        second_entry = second_entries[what]
        if isinstance(entry, str) or isinstance(second_entry, str):
            rows.append((what, str(entry), str(second_entry), ""))
        else:
            ratio = f"{second_entry / entry:.3f}" if entry else ""
            rows.append((what, unit.text(entry), unit.text(second_entry), ratio))
    return Table(("at the lowest α", "first", "second", "second over first"), rows)


def _compared_entries(parts: Parts) -> Iterator[tuple[str, ShownUnit, float | str]]:
    """Yield what is compared of a run on the lowest level: its name, its unit, number or text."""
    shown_units, no_unit = parts.shown_units, ShownUnit("", 1.0)
    for result in (parts.modulus, parts.image):
        if result is not None:
            low, high = (1e9 * float(end[0]) for end in infinite_if_unknown(result.E_GPa))
            for what, value in (("greatest E", high), ("width of E", high - low)):
                if math.isfinite(value):
                    yield what, ShownUnit("GPa", 1e-9), value
    for study_name, study in parts.envelopes.items():
        for output, peak in study.peak.items():
            name = output if study_name == "all" else f"{output} ({study_name})"
            unit = shown_units[output_of(output)]
            yield f"greatest peak of {name}", unit, float(peak.far_end[0])
            yield f"width of the peak of {name}", unit, float(peak.upper[0] - peak.lower[0])
    if parts.records is not None:
        for output, statistics in parts.records.statistics.items():
            for name, ends in statistics.items():  # mean, median …
                unit = shown_units[output_of(output)]
                yield f"{name} of the records' peaks of {output}", unit, float(ends[0])
    for limit in () if parts.decision is None else parts.decision.limits.values():
        yield limit.words, no_unit, limit.verdict_words
    if parts.tolerances is not None and parts.tolerances.kept is not None:
        yield "scale of tolerances", no_unit, parts.tolerances.kept
