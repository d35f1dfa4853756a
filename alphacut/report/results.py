"""Results of a run as tables of text, for the console and for the page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from alphacut.frame.questions.peaks import output_of
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Nature, rounded
from alphacut.io.files import Document
from alphacut.io.quantity import STANDARD_GRAVITY, axis_prefix, range_text
from alphacut.questions.all import QUESTIONS
from alphacut.questions.question import Row

Table = tuple[Row, list[Row]]
"""Titles of the columns, and the rows."""
MATERIAL = ("material", "most plausible", "range at α = 0", "nature", "± error")
MEANING = "Least … largest value if every input stays in its range; α = 1: most plausible"
"""First line of all results, for readers who do not know α-cuts; "nominal" is α = 1."""
TOLERANCE_TABLE = "table on the page and in tolerances.csv"
ANSWERS = ("question", "answer", "nature")
EXCEEDED = {
    "exceeded": "yes",
    "not exceeded": "no",
    "can be exceeded": "can be",
    "undecided": "unknown",
}
"""Verdicts on a limit as they stand in a column."""
GRAVITY = float(STANDARD_GRAVITY)


def cut_text(ends: Document, level: int, nature: Nature, error: float = 0.0) -> str:
    """Text of one cut of a quantity with five digits; guaranteed ends contain the error."""
    low, high = float(ends["lower"][level]), float(ends["upper"][level])
    if nature is Nature.GUARANTEED:
        low, high = max(low - error, min(low, 0.0)), high + error  # the error makes no sign
    return range_text(low, high, nature, 5)


def error_text(error: float, nature: Nature) -> str:
    """Error that a range leaves out; a guaranteed one leaves out none."""
    return "none" if nature is Nature.GUARANTEED else f"{error:.2g}"


def material(summary: Document) -> Table:
    """Table of the elastic constants and loss factors of cell and image, and of damping ratios.

    Each has its value at α = 1, the last level, its range at α = 0, the first, nature and error.
    """
    rows: list[Row] = []
    for part in (summary.get("modulus"), summary.get("image")):
        if part is None:
            continue
        young = part["cuts"]["E_GPa"] if "cuts" in part else part["E_GPa"]
        nature, name = Nature(part["nature"]), f"E, GPa ({part['average']})"
        young_error = sum(part.get("error", {}).values()) * max(young["upper"])
        cuts = cut_text(young, -1, nature), cut_text(young, 0, nature, young_error)
        declares_error = part.get("particles") != "mesh"  # a mesh of one's own is not refined
        error_cell = error_text(young_error, nature) if declares_error else "not declared"
        rows.append((name, *cuts, str(nature), error_cell))
        further = {"ν": part.get("nu_cuts"), "E_T, GPa": part.get("fibres", {}).get("E_T_GPa")}
        for label, values in further.items():
            if values:
                cuts = cut_text(values, -1, nature), cut_text(values, 0, nature)
                rows.append((label, *cuts, str(nature), ""))
        if loss := part.get("loss"):
            nature, loss_error = Nature(loss["nature"]), loss["error"].get("E")
            cuts = cut_text(loss["E"], -1, nature), cut_text(loss["E"], 0, nature)
            error_cell = "" if loss_error is None else error_text(loss_error, nature)
            rows.append(("loss factor of E", *cuts, str(nature), error_cell))
    for name, (low, modal, high) in summary.get("damping", {}).items():
        cuts = range_text(modal, modal, Nature.ATTAINED), range_text(low, high, Nature.ATTAINED)
        rows.append((f"damping ratio {name}", *cuts, str(Nature.ATTAINED), ""))
    return without_empty_columns(MATERIAL, rows)


def without_empty_columns(head: Row, rows: list[Row]) -> Table:
    """The table without columns whose cells are all empty or "none"."""
    columns = [k for k in range(len(head)) if any(row[k] not in ("", "none") for row in rows)]
    return tuple(head[k] for k in columns), [tuple(row[k] for k in columns) for row in rows]


def width_text(image: Document) -> str:
    """Width of E at the lowest level by what it comes from; empty without one."""
    parts = (f"{source} {width:.3g} GPa" for source, width in image["widths_GPa"].items())
    return f"Width of E from {', '.join(parts)}"


def peak_table(summary: Document) -> Table:
    """Table of the peak of each output: its cuts, error or gap, limit and verdict.

    Proved peaks have a gap; the others have the cut of a middle level as well.
    """
    studies = summary.get("envelopes", {})
    if not studies:
        return (), []
    alpha = [float(x) for x in next(iter(studies.values()))["alpha"]]
    peaks = [peak for study in studies.values() for peak in study["peak"].values()]
    levels = [len(alpha) - 1, 0]
    if not any(peak["nature"] == Nature.GUARANTEED for peak in peaks):
        levels.insert(1, min(range(len(alpha)), key=lambda k: abs(alpha[k] - 0.5)))
    levels = list(dict.fromkeys(levels))
    limits, structure = least_limits(summary), summary.get("structure", {})
    rows: list[Row] = []
    for name, study in studies.items():
        suffix = f" ({name})" if len(studies) > 1 else ""
        drawn = study.get("drawn") or study["peak"]
        for output, peak in study["peak"].items():
            units = display_units(output, unit_of(study, output), peak, structure)
            for label, factor in units if output in drawn else ():
                cells = peak_cells(peak, factor, levels, has_core=alpha[-1] == 1)
                limit = limit_cells(limits.get(output), factor)
                rows.append((label + suffix, *cells, *limit))
    titles = [f"α = {alpha[k]:g}" for k in levels]
    if alpha[-1] == 1 and not any("…" in row[1] for row in rows):
        titles[0] = "nominal"
    head = ("peak of", *titles, "± error", "reached", "gap", "limit", "exceeded")
    return without_empty_columns(head, rows)


def peak_cells(peak: Document, factor: float, levels: Sequence[int], *, has_core: bool) -> Row:
    """Texts of a peak times a factor: its cut on each level, its error, what is reached, the gap.

    Args:
        peak: Bounds of the peak on all levels, in SI.
        factor: From SI to the unit shown.
        levels: Indices of the levels, the highest first.
        has_core: Whether the highest level is 1, whose cut is shown by `nominal`.
    """
    nature, cuts = Nature(peak["nature"]), list[str]()
    for k in levels:
        low, high = factor * float(peak["lower"][k]), factor * float(peak["upper"][k])
        cuts.append(range_text(low, high, nature, 3 if k > 0 else 4))
    if has_core:
        cuts[0] = nominal(peak, factor, nature)
    error = error_text(factor * max(peak["error"]), nature)
    return (*cuts, error, *reached_and_gap(peak, factor))


def limit_cells(limit: tuple[float, str] | None, factor: float) -> tuple[str, str]:
    """Texts of a limit, in SI, times a factor, and of the verdict on it; empty without a limit."""
    if limit is None:
        return "", ""
    return f"{limit[0] * factor:.4g}", EXCEEDED.get(limit[1], "")


def unit_of(part: Document, output: str) -> str:
    """SI unit of an output, or of its peak of one side, in a study or under a suite."""
    return part.get("units", {}).get(output_of(output)) or Output(output).unit


def reached_and_gap(peak: Document, factor: float) -> tuple[str, str]:
    """Texts of the peak that a motion reaches, and of its gap to a proved bound; else empty."""
    if Nature(peak["nature"]) is not Nature.GUARANTEED:
        return "", ""
    value = rounded(factor * float(peak["reached"][0]), "upper", Nature.ATTAINED)
    return f"{value:.4g}", f"{peak_gap(peak, 0):.1%}"


def peak_gap(peak: Document, level: int) -> float:
    """Relative gap between the bound of a peak and what a motion reaches, on a level."""
    upper = float(peak["upper"][level])
    return 1 - float(peak["reached"][level]) / upper if upper > 0 else 0.0


def nominal(peak: Document, factor: float, nature: Nature) -> str:
    """Text of a peak at α = 1: a number, or a range if that is wider than a hundredth of it."""
    low, high = (factor * float(peak[end][-1]) for end in ("lower", "upper"))
    middle, is_narrow = (low + high) / 2, high - low <= 0.01 * abs(high)
    return range_text(middle, middle, nature) if is_narrow else range_text(low, high, nature, 3)


def display_units(
    output: str, unit: str, peak: Document, structure: Document
) -> Iterator[tuple[str, float]]:
    """Yields the label and the factor from SI of each unit in which an output's peak is shown."""
    if unit == "m/s^2":
        yield f"{output}, g", 1 / GRAVITY
        return
    factor, prefixed = axis_prefix(float(peak["upper"][0]), unit)
    yield f"{output}, {prefixed}", factor
    if height := structure.get("heights_m", {}).get(output):
        yield "  % of storey", 100 / height
    if unit == "N" and (weight := structure.get("weight_N")):
        yield "  % of weight", 100 / weight


def least_limits(summary: Document) -> dict[str, tuple[float, str]]:
    """Limit in SI of each peak, and the verdict on it; the least of several, of [decision] first.

    Limits of other questions have no verdict.
    """
    limits: dict[str, tuple[float, str]] = {}
    for name, limit in summary.get("tolerances", {}).get("limits", {}).items():
        limits[name] = limit, ""
    for name, event in summary.get("probability", {}).get("events", {}).items():
        limits[name] = event["limit"], ""
    decisions = summary.get("decision", {}).get("limits", {})
    least_first = sorted(decisions.items(), key=lambda pair: pair[1]["limit"])
    for name, answer in reversed(least_first):  # the least overwrites others of its peak
        limits[answer.get("output", name)] = answer["limit"], answer.get("verdict", "")
    return limits


def natures(summary: Document) -> Iterator[str]:
    """Yields sentences on the nature of the peaks, and on the exact motions that tested them."""
    studies = summary.get("envelopes", {}).values()
    outputs_by_nature: dict[str, dict[str, None]] = {}
    for study in studies:
        for output, peak in study["peak"].items():
            outputs_by_nature.setdefault(peak["nature"], {})[output] = None
    groups = [f"{nature} ({', '.join(outputs)})" for nature, outputs in outputs_by_nature.items()]
    if len(groups) == 1:
        groups = [f"all {nature}" for nature in outputs_by_nature]
    if groups:
        yield "Peaks are largest magnitudes over time, " + ", ".join(groups)
    if tested := sum(study.get("motions_tested", 0) for study in studies):
        yield f"{tested} exact motions by another algorithm agree with what is guaranteed."


def answers(summary: Document) -> list[Row]:
    """Rows (what, answer, nature) of all answers to questions; inputs of tolerances share a row."""
    rows: list[Row] = []
    for question in QUESTIONS:
        if question.key in summary:
            answer_rows = question.rows(summary[question.key])
            if question.key == "tolerances":
                scale, *inputs = answer_rows
                answer_rows = [scale, ("ranges", f"of {len(inputs)} inputs", TOLERANCE_TABLE)]
            rows += [(f"{question.key}: {row[0]}", *row[1:3]) for row in answer_rows]
    return rows


def drivers(summary: Document) -> Iterator[str]:
    """Yields sentences on the three inputs that widen E most, and the last output's peak most."""
    shares = dict(summary.get("shares", {}))
    peak_names = [name for name in shares if "peak" in name]
    results = [name for name in shares if name == "E"] + peak_names[-1:]
    for name in results:
        largest, *next_two = sorted(shares[name].items(), key=lambda pair: -pair[1])[:3]
        more = "".join(f", {x} by {share:.0%}" for x, share in next_two)
        yield f"Fixing {largest[0]} narrows {name} by {largest[1]:.0%}{more}"
