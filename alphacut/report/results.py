"""Results of a run as tables of text, for the console and for the page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from alphacut.frame.questions.peaks import output_of
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Nature, rounded
from alphacut.io.files import Document
from alphacut.io.quantity import STANDARD_GRAVITY, axis_prefix, between
from alphacut.questions.all import QUESTIONS
from alphacut.questions.question import Row

Table = tuple[Row, list[Row]]
"""Titles of the columns, and the rows."""
MATERIAL = ("material", "most plausible", "range at α = 0", "nature", "± error")
ISOTROPIC = "Hashin–Shtrikman bounds of an isotropic E"
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


def cut(ends: Document, level: int, nature: Nature, error: float = 0.0) -> str:
    """One cut of a quantity with five digits; guaranteed ends contain the error."""
    low, high = float(ends["lower"][level]), float(ends["upper"][level])
    added_error = error if nature is Nature.GUARANTEED else 0.0
    return between(max(low - added_error, min(low, 0.0)), high + added_error, nature, 5)


def error_text(error: float, nature: Nature) -> str:
    """Error that a range leaves out; a guaranteed one leaves out none."""
    return "none" if nature is Nature.GUARANTEED else f"{error:.2g}"


def material(summary: Document) -> Table:
    """Young's modulus and Poisson's ratio of the cell or of the image."""
    rows: list[Row] = []
    for part in (summary.get("modulus"), summary.get("image")):
        if part is None:
            continue
        young = part["cuts"]["E_GPa"] if "cuts" in part else part["E_GPa"]
        nature, name = Nature(part["nature"]), f"E, GPa ({part['average']})"
        error = sum(part.get("error", {}).values()) * max(young["upper"])
        ends = cut(young, -1, nature), cut(young, 0, nature, error)
        off = error_text(error, nature) if part.get("particles") != "mesh" else "not declared"
        rows.append((name, *ends, str(nature), off))
        further_rows = {"ν": part.get("nu_cuts"), "E_T, GPa": part.get("fibres", {}).get("E_T_GPa")}
        for label, values in further_rows.items():
            if values:
                rows.append(
                    (label, cut(values, -1, nature), cut(values, 0, nature), str(nature), "")
                )
        if loss := part.get("loss"):
            nature, error = Nature(loss["nature"]), loss["error"].get("E")
            ends = cut(loss["E"], -1, nature), cut(loss["E"], 0, nature)
            off = "" if error is None else error_text(error, nature)
            rows.append(("loss factor of E", *ends, str(nature), off))
    for name, (low, modal, high) in summary.get("damping", {}).items():
        shown = [between(*pair, Nature.ATTAINED, 4) for pair in ((modal, modal), (low, high))]
        rows.append((f"damping ratio {name}", *shown, str(Nature.ATTAINED), ""))
    return filled(MATERIAL, rows)


def filled(head: Row, rows: list[Row]) -> Table:
    """The columns that hold something, an error that ranges leave out for example."""
    columns = [k for k in range(len(head)) if any(row[k] not in ("", "none") for row in rows)]
    return tuple(head[k] for k in columns), [tuple(row[k] for k in columns) for row in rows]


def fibre_label(key: str) -> str:
    """Label of a constant of fibres: nu_LT as ν_LT, E_T_GPa as E_T, GPa."""
    return key.replace("nu", "ν").replace("_GPa", ", GPa")


def width_text(image: Document) -> str:
    """Width of E at the lowest level by what it comes from; empty without one."""
    parts = (f"{source} {width:.3g} GPa" for source, width in image["widths_GPa"].items())
    return f"Width of E from {', '.join(parts)}"


def motion(summary: Document) -> Table:
    """Peaks of all outputs: nominal, on one or two levels, error or gap, limit and verdict."""
    studies = summary.get("envelopes", {})
    if not studies:
        return (), []
    alpha = [float(x) for x in next(iter(studies.values()))["alpha"]]
    middle = min(range(len(alpha)), key=lambda k: abs(alpha[k] - 0.5))
    has_gaps = any(
        peak["nature"] == Nature.GUARANTEED
        for study in studies.values()
        for peak in study["peak"].values()
    )
    levels = list(dict.fromkeys((len(alpha) - 1, *([] if has_gaps else [middle]), 0)))
    titles = [f"α = {alpha[k]:g}" for k in levels]
    limits = limits_of(summary)
    rows: list[Row] = []
    for name, study in studies.items():
        where = f" ({name})" if len(studies) > 1 else ""
        for output, peak in study["peak"].items():
            scaled = scales(output, unit_of(study, output), peak, summary.get("structure", {}))
            for label, factor in scaled if output in (study.get("drawn") or [output]) else ():
                nature, error = Nature(peak["nature"]), max(peak["error"])
                cuts = [nominal(peak, factor, nature)] if alpha[-1] == 1 else []
                for k in levels[len(cuts) :]:
                    low, high = float(peak["lower"][k]), float(peak["upper"][k])
                    cuts.append(between(factor * low, factor * high, nature, 4 - (k > 0)))
                limit, verdict = limits.get(output, (None, ""))
                words = "" if limit is None else f"{limit * factor:.4g}", EXCEEDED.get(verdict, "")
                cuts += [error_text(factor * error, nature), *reached(peak, factor)]
                rows.append((label + where, *cuts, *words))
    if alpha[-1] == 1 and not any("…" in row[1] for row in rows):
        titles[0] = "nominal"
    head = ("peak of", *titles, "± error", "reached", "gap", "limit", "exceeded")
    return filled(head, rows)


def unit_of(part: Document, output: str) -> str:
    """SI unit of an output, or of its peak of one side, in a study or under a suite."""
    return part.get("units", {}).get(output_of(output)) or Output(output).unit


def reached(peak: Document, factor: float) -> tuple[str, str]:
    """What a motion reaches of a proved peak on the lowest level, and the gap, a share of it."""
    if Nature(peak["nature"]) is not Nature.GUARANTEED:
        return "", ""
    value = rounded(factor * float(peak["reached"][0]), "upper", Nature.ATTAINED)
    return f"{value:.4g}", f"{peak_gap(peak, 0):.1%}"


def peak_gap(peak: Document, level: int) -> float:
    """Distance of a peak that is not exceeded from one that is reached, as a share of it."""
    above = float(peak["upper"][level])
    return 1 - float(peak["reached"][level]) / above if above > 0 else 0.0


def nominal(peak: Document, factor: float, nature: Nature) -> str:
    """A peak on the highest level: one number, or an interval wider than a hundredth of it."""
    low, high = (factor * float(peak[end][-1]) for end in ("lower", "upper"))
    middle, near = (low + high) / 2, high - low <= 0.01 * abs(high)
    return between(middle, middle, nature) if near else between(low, high, nature, 3)


def scales(
    output: str, unit: str, peak: Document, structure: Document
) -> Iterator[tuple[str, float]]:
    """Label and factor from SI of each unit in which an output is shown."""
    if unit == "m/s^2":
        yield f"{output}, g", 1 / GRAVITY
        return
    factor, prefixed = axis_prefix(float(peak["upper"][0]), unit)
    yield f"{output}, {prefixed}", factor
    if height := structure.get("heights_m", {}).get(output):
        yield "  % of storey", 100 / height
    if unit == "N" and (weight := structure.get("weight_N")):
        yield "  % of weight", 100 / weight


def limits_of(summary: Document) -> dict[str, tuple[float, str]]:
    """Least limit in SI of each peak that a question names, and the verdict on it, or no text."""
    limits: dict[str, tuple[float, str]] = {}
    strict: dict[str, float] = {}
    for key, inner in (("tolerances", "limits"), ("probability", "events"), ("decision", "limits")):
        for name, entry in summary.get(key, {}).get(inner, {}).items():
            answer = entry if isinstance(entry, Mapping) else {"limit": entry}
            output, value = answer.get("output", name), answer["limit"]
            if key != "decision" or output not in strict or value < strict[output]:
                limits[output] = value, answer.get("verdict", "")
                strict |= {output: value} if key == "decision" else {}
    return limits


def natures(summary: Document) -> Iterator[str]:
    """Lines on the nature of the peaks, and on the exact motions that tested them."""
    groups: dict[str, dict[str, None]] = {}
    for study in summary.get("envelopes", {}).values():
        for output, peak in study["peak"].items():
            groups.setdefault(peak["nature"], {})[output] = None
    words = [f"{nature} ({', '.join(outputs)})" for nature, outputs in groups.items()]
    if len(words) == 1:
        words = [f"all {nature}" for nature in groups]
    if words:
        yield "Peaks are largest magnitudes over time, " + ", ".join(words)
    if tested := sum(x.get("motions_tested", 0) for x in summary.get("envelopes", {}).values()):
        yield f"{tested} exact motions by another algorithm agree with what is guaranteed."


def answers(summary: Document) -> list[Row]:
    """A row for each answer to a question: what, answer, nature; of tolerances the first two."""
    rows: list[Row] = []
    for question in QUESTIONS:
        if question.key in summary:
            found = question.rows(summary[question.key])
            if question.key == "tolerances":
                found = [found[0], ("ranges", f"of {len(found) - 1} inputs", TOLERANCE_TABLE)]
            rows += [(f"{question.key}: {row[0]}", *row[1:3]) for row in found]
    return rows


def drivers(summary: Document) -> Iterator[str]:
    """Lines on what drives the modulus, and the peak of the last output: the largest shares."""
    shares = dict(summary.get("shares", {}))
    peak_names = [name for name in shares if "peak" in name]
    shown = [name for name in shares if name == "E"] + peak_names[-1:]
    for name in shown:
        first, *more_inputs = sorted(shares[name].items(), key=lambda pair: -pair[1])[:3]
        more = "".join(f", {x} by {share:.0%}" for x, share in more_inputs)
        yield f"Fixing {first[0]} narrows {name} by {first[1]:.0%}{more}"
