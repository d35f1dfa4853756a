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
from alphacut.fuzzy.result import Nature, rounded
from alphacut.stages.cell import UPPER_BOUND
from alphacut.stages.envelope import EnvelopeResult
from alphacut.stages.image import ImageResult
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.store import CutsResult
from alphacut.stages.summary import FrameResult, Parts

Row = tuple[str, ...]
MEANING = "Least … largest value if every input stays in its range; α = 1: most plausible"
"""First line of all results, for readers who do not know α-cuts; "nominal" is α = 1."""
TOLERANCE_TABLE = "table on the page and in tolerances.csv"
ANSWER_HEAD = ("question", "answer", "nature")
EXCEEDED = {"exceeded": "yes", "not exceeded": "no", "can be exceeded": "can be"}
"""Verdicts on a limit as they stand in a column, where they are shorter there."""
AROUND = "lie in the wider bounds that are proved"
"""Where tested motions lie beside an envelope that is not guaranteed itself."""
NO_UNIT = ShownUnit("", 1.0)
COMPARED = ("at the lowest α", "first", "second", "second over first")


def run_text(parts: Parts) -> str:
    """The results of a run for the console: tables, then sentences, answers and main drivers."""
    shown = [table for table in (material(parts), peak_table(parts)) if table.rows]
    lines = [guaranteed_of(parts.image)] if parts.image is not None else []
    lines += [*natures(parts), *smaller_steps(parts)]
    if parts.modulus is not None and parts.modulus.solver:
        lines.append(f"Cells: {parts.modulus.solver}")
    lines = [row for line in lines for row in wrap(line, 80, subsequent_indent="  ")]
    if parts.update is not None and parts.update.is_refuted:
        lines.append(parts.update.refuted)
    elif parts.update is not None:
        shown.append(Table(*parts.update.table()))
    for row in answers(parts):
        lines += wrap(f"{row[0]}: {row[1]} ({row[2]})", 80, subsequent_indent="  ")
    lines += drivers(parts)
    heading = f"{MEANING}\n" if shown else ""
    texts = [text_table(*table) for table in shown]
    return heading + "".join(texts) + "".join(f"{line}\n" for line in lines)


def cut_text(cuts: CutsResult, level: int, nature: Nature, error: float = 0.0) -> str:
    """Text of one cut of a quantity with five digits; guaranteed ends contain the error."""
    low, high = (float(end[level]) for end in cuts.ends)
    if nature is Nature.GUARANTEED:
        low, high = max(low - error, min(low, 0.0)), high + error  # the error makes no sign
    return range_text(low, high, nature, 5)


def error_text(error: float, nature: Nature) -> str:
    """Error that a range leaves out; a guaranteed one leaves out none."""
    return "none" if nature is Nature.GUARANTEED else f"{error:.2g}".replace("-", MINUS)


def material(parts: Parts) -> Table:
    """Table of the elastic constants and loss factors of cell and image, and of damping ratios.

    Each has its value on the highest level, its range on the lowest, nature and error.
    """
    found = [part for part in (parts.modulus, parts.image) if part]
    rows = [row for part in found for row in _constants(part)]
    first, last = found[0].alpha[[0, -1]] if found else (0.0, 1.0)
    nominal_title = "most plausible" if last == 1 else f"α = {last:g}"
    for name, (low, nominal, high) in parts.damping.items():
        cuts = range_text(nominal, nominal, Nature.ATTAINED), range_text(low, high, Nature.ATTAINED)
        rows.append((f"damping ratio {name}", *cuts, Nature.ATTAINED, ""))
    if first == last:  # on a single level value and range are one
        same = 2 if last == 1 else 1
        rows = [(*row[:same], "", *row[same + 1 :]) for row in rows]
    head = ("material", nominal_title, f"range at α = {first:g}", "nature", "± error")
    return without_empty_columns(head, rows)


def _constants(part: ModulusResult | ImageResult) -> Iterator[Row]:
    """Yields the row of E of a cell or an image, and those of ν, E_T and the loss factor."""
    nature, further, error = part.nature, dict[str, CutsResult](), 0.0
    young, declares_error = part.E_GPa, True
    if isinstance(part, ModulusResult):
        declares_error = part.particles != "mesh"  # which is not refined
        error = sum(part.error.values()) * float(young.upper.max())
        further = {"ν": part.nu_cuts}
        if "E_T_GPa" in part.fibres:
            further["E_T, GPa"] = part.fibres["E_T_GPa"]
    cuts = cut_text(young, -1, nature), cut_text(young, 0, nature, error)
    error_cell = error_text(error, nature) if declares_error else "not declared"
    yield (f"E, GPa ({part.average})", *cuts, nature, error_cell)
    for label, values in further.items():  # of a cell at most E is proved
        texts = (cut_text(values, level, Nature.ATTAINED) for level in (-1, 0))
        yield (label, *texts, Nature.ATTAINED, "")
    if isinstance(part, ImageResult) and part.proved_losses:
        ends = part.proved_losses["E"]
        cuts = cut_text(ends, -1, nature), cut_text(ends, 0, nature)
        yield ("loss factor of E, to first order", *cuts, nature, error_text(0.0, nature))
    elif (loss := part.loss) is not None:
        cuts = cut_text(loss.E, -1, loss.nature), cut_text(loss.E, 0, loss.nature)
        error_cell = error_text(loss.error["E"], loss.nature) if loss.error else ""
        yield ("loss factor of E", *cuts, loss.nature, error_cell)


def without_empty_columns(head: Row, rows: list[Row]) -> Table:
    """The table without columns whose cells are all empty or "none"."""
    columns = [k for k in range(len(head)) if any(row[k] not in ("", "none") for row in rows)]
    filled_rows = [tuple(row[k] for k in columns) for row in rows]
    return Table(tuple(head[k] for k in columns), filled_rows)


def guaranteed_of(image: ImageResult) -> str:
    """What the bounds of an image or volume are guaranteed of, in a sentence."""
    is_plane = len(image.lower_GPa) == 3
    what = "image as segmented" if is_plane else "volume"
    where = ", in plane strain" if is_plane else ""
    return f"The bounds are guaranteed of the {what}, repeated periodically{where}"


def width_text(image: ImageResult) -> str:
    """Width of E at the lowest level by what it comes from, or which bound is missing, and why."""
    has_lower, has_upper = image.lower_GPa.any(), np.isfinite(image.upper_GPa).all()
    missing = []
    if not has_lower:
        why = "stresses are sought that vanish in closed pores, and these meet their own image"
        missing.append(f"lower bound of E: {why}")
    if not has_upper:
        # the plane's E = G (3 − G/K) falls where G, which has no bound, exceeds 3/2 K
        which = "lower or upper" if has_lower and image.E_GPa.ends[0][0] <= 0 else "upper"
        missing.append(f"{which} bound of E: a phase may be rigid")
    if missing:
        return f"This program gives no {', and no '.join(missing)}"
    parts = (f"{source} {width:.3g} GPa" for source, width in image.widths_GPa.items())
    return f"Width of E from {', '.join(parts)}"


def peak_table(parts: Parts) -> Table:
    """Table of the peak of each output: its cuts, error or gap, limits and verdicts.

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
    peaks = [peak for study in studies.values() for peak in study.peak.values()]
    levels = [len(alpha) - 1, 0]
    if not any(peak.nature is Nature.GUARANTEED for peak in peaks):
        levels.insert(1, int(np.argmin(np.abs(alpha - 0.5))))
    levels = list(dict.fromkeys(levels))
    limits, rows = limits_by_peak(parts), list[Row]()
    shown_units = parts.shown_units
    for name, study in studies.items():
        suffix = f" ({name})" if len(studies) > 1 else ""
        drawn = study.drawn if isinstance(study, EnvelopeResult) else ()
        farthest = study.farthest_record if isinstance(study, SuitePeaks) else {}
        for peak_name in (name for name in study.peak if name in (drawn or study.peak)):
            peak, record = study.peak[peak_name], farthest.get(peak_name, "")
            unit = shown_units[output_of(peak_name)]
            is_force = study.units[output_of(peak_name)] == "N"
            units = display_units(peak_name, unit, parts.structure, is_force=is_force)
            for label, factor in units:
                cells = peak_cells(peak, factor, levels)
                for limit, verdict in limits.get(peak_name, [(math.nan, "")]):
                    limit_text = "" if math.isnan(limit) else engineering(limit * factor, "")
                    exceeded = EXCEEDED.get(verdict, verdict)
                    rows.append((label + suffix, *cells, record, limit_text, exceeded))
                    cells, record = ("",) * len(cells), ""  # of further limits of the same peak
    titles = [f"α = {alpha[k]:g}" for k in levels]
    if alpha[-1] == 1 and not any("…" in row[1] for row in rows):
        titles[0] = "nominal"
    head = ("peak of", *titles, "± error", "reached", "gap", "record", "limit", "exceeded")
    return without_empty_columns(head, rows)


def peak_cells(peak: Peak, factor: float, levels: Sequence[int]) -> Row:
    """Texts of a peak times a factor: its cut on some levels, its error, what is reached, the gap.

    Levels are indices, the highest first; a middle one has three digits.
    """
    nature, lower, upper = peak.nature, factor * peak.lower, factor * peak.upper
    digits = [3 if 0 < k < len(lower) - 1 else 4 for k in levels]
    cuts = [
        range_text(float(lower[k]), float(upper[k]), nature, count)
        for k, count in zip(levels, digits, strict=True)
    ]
    error = error_text(factor * float(peak.error.max()), nature)
    if nature is not Nature.GUARANTEED or peak.encloses:
        return (*cuts, error, "", "")
    inner = "lower" if peak.is_least else "upper"
    reached = rounded(factor * float(peak.reached[0]), inner, Nature.ATTAINED)
    return (*cuts, error, number_text(reached), f"{peak.gaps[0]:.1%}")


def limits_by_peak(parts: Parts) -> dict[str, list[tuple[float, str]]]:
    """Limits of each peak in SI with the verdicts on them, of [decision]."""
    limits: dict[str, list[tuple[float, str]]] = {}
    for decision in () if parts.decision is None else parts.decision.limits.values():
        limits.setdefault(decision.peak_name, []).append((decision.limit, decision.verdict))
    return limits


def display_units(
    name: str, unit: ShownUnit, frame: FrameResult | None, *, is_force: bool
) -> Iterator[tuple[str, float]]:
    """Yields the label and the factor from SI of each unit in which a peak is shown."""
    yield f"{name}, {unit.label}" if unit.label else name, unit.factor
    height = None if frame is None else frame.heights_m.get(output_of(name))
    if height is not None:
        yield "  % of storey", 100 / height
    if frame is not None and is_force:
        yield "  % of weight", 100 / frame.weight_N


def natures(parts: Parts) -> Iterator[str]:
    """Yields sentences on the nature of C and of the peaks, and on motions that tested these."""
    studies, suite = parts.envelopes.values(), parts.records
    if parts.modulus is not None and parts.modulus.particles == "mesh":
        yield UPPER_BOUND
    outputs: dict[Nature, dict[str, None]] = {}
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
            where = "agree with what is guaranteed" if is_guaranteed else AROUND
            yield f"{count} exact motions by another algorithm {where}"


def smaller_steps(parts: Parts) -> Iterator[str]:
    """Yields a sentence for each peak whose bound is widened most by motions between nodes."""
    for study in parts.envelopes.values():
        for name, peak in study.peak.items():
            if peak.is_widened_by_step:
                # what motions add between nodes falls with the square of the step
                saved, what = 0.75 * peak.between_nodes, "an error of"
                value = float(peak.error[0]) - saved
                if peak.nature is Nature.GUARANTEED:
                    what = "at least" if peak.is_least else "at most"
                    value = float(peak.far_end[0]) + (saved if peak.is_least else -saved)
                text = parts.shown_units[output_of(name)].text(value)
                yield f"{name}: a step of {study.step / 2:g} s would give {what} about {text}"


def answers(parts: Parts) -> list[Row]:
    """Rows (what, answer, nature) of all answers to questions; inputs of tolerances share a row."""
    rows: list[Row] = []
    for answer in parts.answers:
        answer_rows = answer.table().rows
        if isinstance(answer, Tolerances):
            scale, *inputs = answer_rows
            answer_rows = [scale, ("ranges", f"of {len(inputs)} inputs", TOLERANCE_TABLE)]
        rows += [(f"{answer.key}: {row[0]}", *row[1:3]) for row in answer_rows]
    return rows


def drivers(parts: Parts) -> Iterator[str]:
    """Yields sentences on the inputs that widen E most, and the last output's peak most."""
    peaks = [name for name in parts.shares if name not in ("E", "ν")]
    for name in [name for name in parts.shares if name == "E"] + peaks[-1:]:
        count = 3 if name == "E" else 2
        (largest, share), *further = sorted(parts.shares[name].items(), key=lambda x: -x[1])[:count]
        more = "".join(f", {x} by {percent_text(y, 0)}" for x, y in further)
        what = name.replace("the peak", "the reached peak")
        if name != "E" and parts.encloses:
            what = f"{name}, as tried in the box around {parts.encloses},"
        yield f"Fixing {largest} narrows {what} by {percent_text(share, 0)}{more}"


def comparison(first: Parts, second: Parts) -> Table:
    """Table of what both runs have: E, greatest peaks and their widths, verdicts on limits."""
    rows: list[Row] = []
    second_entries = {what: entry for what, _, entry in _compared_entries(second)}
    for what, unit, entry in _compared_entries(first):
        second_entry = second_entries.get(what)
        if second_entry is None:
            continue
        if isinstance(entry, str) or isinstance(second_entry, str):
            rows.append((what, str(entry), str(second_entry), ""))
        else:
            ratio = f"{second_entry / entry:.3f}" if entry else ""
            rows.append((what, unit.text(entry), unit.text(second_entry), ratio))
    return Table(COMPARED, rows)


def _compared_entries(parts: Parts) -> Iterator[tuple[str, ShownUnit, float | str]]:
    """Yields what is compared of a run on the lowest level: its name, its unit, number or text."""
    shown_units = parts.shown_units
    for result in (parts.modulus, parts.image):
        if result is not None:
            low, high = (1e9 * float(end[0]) for end in result.E_GPa.ends)
            entries = {"greatest E": high, "width of E": high - low}
            shown = ShownUnit("GPa", 1e-9)
            yield from ((what, shown, x) for what, x in entries.items() if math.isfinite(x))
    for study_name, study in parts.envelopes.items():
        for output, peak in study.peak.items():
            name = output if study_name == "all" else f"{output} ({study_name})"
            unit = shown_units[output_of(output)]
            yield f"greatest peak of {name}", unit, float(peak.far_end[0])
            yield f"width of the peak of {name}", unit, float(peak.upper[0] - peak.lower[0])
    if (suite := parts.records) is not None:
        for output, statistics in suite.statistics.items():
            for name, ends in statistics.items():  # mean, median …
                unit = shown_units[output_of(output)]
                yield f"{name} of the records' peaks of {output}", unit, float(ends[0])
    for limit in () if parts.decision is None else parts.decision.limits.values():
        yield limit.words, NO_UNIT, limit.verdict_words
    if parts.tolerances is not None and parts.tolerances.kept is not None:
        yield "scale of tolerances", NO_UNIT, parts.tolerances.kept
