"""Results of a run as tables of text, for the console and for the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.io.text_table import text_table
from alphacut.io.units import STANDARD_GRAVITY, axis_prefix, engineering, largest_by_unit
from alphacut.questions.table import QUESTIONS

Row = tuple[str, ...]
Table = tuple[Row, list[Row]]
"""Titles of the columns, and the rows."""
AVERAGES = {
    "cylinders": "eq. 16",
    "axes": "eq. 16",
    "isotropic": "isotropic",
    "spheres": "spheres",
}
"""Averages of the stiffness that E and ν are of."""
NATURES = {
    Nature.GUARANTEED: "No value in the α-cut lies outside these bounds; this is proved.",
    Nature.ESTIMATED: "The true bounds lie within the error, as an independent pass tells.",
    Nature.ATTAINED: "The bounds are reached; the true range may be wider.",
}
"""Meaning of each nature, for the page."""
MATERIAL = ("material", "most plausible", "range at α = 0", "nature", "± error")
ISOTROPIC = "Hashin–Shtrikman bounds of an isotropic E"
"""Label of the bounds that hold for isotropic composites, at the modal values."""
ANSWERS = ("question", "answer", "nature")
GRAVITY = float(STANDARD_GRAVITY)


def run_text(summary: Document) -> str:
    """Every table of a run, and what drives the peak."""
    tables = [one for one in (material(summary), motion(summary)) if one[1]]
    lines = [*natures(summary), *identified(summary.get("update"))]
    lines += [f"{row[0]}: {row[1]} ({row[2]})" for row in answers(summary)]
    lines += drivers(summary)
    return "".join(text_table(*one) for one in tables) + "".join(f"{line}\n" for line in lines)


def nature_of(text: object) -> Nature:
    """The nature that a summary states; the weakest where its word is not known."""
    first = str(text).replace(",", " ").split()[:1]
    return next((nature for nature in Nature if [str(nature)] == first), Nature.ATTAINED)


def outward(value: float, *, up: bool, digits: int = 4) -> float:
    """A bound at so many digits that is not narrower, but for rounding in the tenth."""
    if value == 0 or not math.isfinite(value):
        return value
    scale = 10.0 ** (digits - 1 - math.floor(math.log10(abs(value))))
    slack = 1e-10 * abs(value) * scale
    whole = math.ceil(value * scale - slack) if up else math.floor(value * scale + slack)
    return whole / scale


def between(low: float, high: float, digits: int = 4) -> str:
    """An interval rounded outwards; one number where both ends are the same."""
    if high - low <= 1e-9 * abs(high):
        return f"{low:.{digits}g}"
    low, high = outward(low, up=False, digits=digits), outward(high, up=True, digits=digits)
    return " … ".join(dict.fromkeys(f"{end:.{digits}g}" for end in (low, high)))


def cut(ends: Document, level: int, digits: int = 5, factor: float = 1.0) -> str:
    """One cut of a quantity."""
    return between(factor * ends["lower"][level], factor * ends["upper"][level], digits)


def material(summary: Document) -> Table:
    """Young's modulus and Poisson's ratio of the cell or of the image."""
    rows: list[Row] = []
    for part in (summary.get("modulus"), summary.get("image")):
        if part is None:
            continue
        young = part["cuts"]["E_GPa"] if "cuts" in part else part["E_GPa"]
        kind, mean = str(nature_of(part["nature"])), AVERAGES.get(str(part.get("average")), "")
        name = f"E, GPa ({mean})" if mean else "E, GPa"
        error = sum(part.get("error", {}).values()) * max(young["upper"])
        rows.append((name, cut(young, -1), cut(young, 0), kind, f"{error:.1g}" if error else ""))
        if "nu_cuts" in part:
            rows.append(("ν", cut(part["nu_cuts"], -1), cut(part["nu_cuts"], 0), kind, ""))
        if across := part.get("fibres", {}).get("E_T_GPa"):
            rows.append((fibre_label("E_T_GPa"), cut(across, -1), cut(across, 0), kind, ""))
    return MATERIAL, rows


def fibre_label(key: str) -> str:
    """Label of a constant of fibres: nu_LT as ν_LT, E_T_GPa as E_T, GPa."""
    return key.replace("nu", "ν").replace("_GPa", ", GPa")


def width_text(image: Document) -> str:
    """Width of E at the lowest level by what it comes from; empty without one."""
    parts = (f"{source} {width:.3g} GPa" for source, width in image["widths_GPa"].items())
    return "Width of E from " + ", ".join(parts)


def motion(summary: Document) -> Table:
    """Peaks of the magnitude of each output: nominal, on two levels, error, limit and verdict."""
    studies = summary.get("envelopes", {})
    if not studies:
        return ("peak of",), []
    alpha = [float(x) for x in next(iter(studies.values()))["alpha"]]
    levels = list(dict.fromkeys((len(alpha) - 1, middle(alpha), 0)))
    titles = ["nominal" if alpha[k] == 1 else f"α = {alpha[k]:g}" for k in levels]
    limits = limits_of(summary)
    rows: list[Row] = []
    for name, study in studies.items():
        where = f" ({name})" if len(studies) > 1 else ""
        for output, peak in study["peak"].items():
            each = scales(output, peak, summary.get("structure", {}))
            for label, factor in each if study.get("drawn") in (None, "", output) else ():
                error = f"{factor * max(peak.get('error', [0.0])):.2g}"
                cuts = [nominal(peak, factor)] if alpha[-1] == 1 else []
                cuts += [cut(peak, k, 4 - (k > 0), factor) for k in levels[len(cuts) :]]
                limit = [limit_text(limits.get(output), factor)] * bool(limits)
                rows.append((label + where, *cuts, error, *limit))
    return ("peak of", *titles, "± error", *["limit"] * bool(limits)), rows


def nominal(peak: Document, factor: float) -> str:
    """A peak on the highest level: one number, or an interval wider than a hundredth of it."""
    low, high = (factor * float(peak[end][-1]) for end in ("lower", "upper"))
    return f"{(low + high) / 2:.4g}" if high - low <= 0.01 * abs(high) else between(low, high)


def middle(alpha: Sequence[float]) -> int:
    """Place of the level next to 0.5."""
    return min(range(len(alpha)), key=lambda k: abs(alpha[k] - 0.5))


def scales(output: str, peak: Document, structure: Document) -> Iterator[tuple[str, float]]:
    """Label and factor from SI of each unit in which an output is shown."""
    unit = Output(output).unit
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
    """Limit in SI of each output that a question names, and the verdict on it, or no text."""
    limits: dict[str, tuple[float, str]] = {}
    for key, inner in (("tolerances", "limits"), ("probability", "events"), ("decision", "limits")):
        for output, one in summary.get(key, {}).get(inner, {}).items():
            of = one if isinstance(one, Mapping) else {"limit": one}
            limits[output] = of["limit"], of.get("verdict", "").partition(" ")[0]
    return limits


def limit_text(limit: tuple[float, str] | None, factor: float) -> str:
    """A limit times a factor, with the verdict on it."""
    return ", ".join(filter(None, (f"{limit[0] * factor:.4g}", limit[1]))) if limit else ""


def natures(summary: Document) -> Iterator[str]:
    """A line on the nature of the peaks."""
    each = {name: nature_of(one["nature"]) for name, one in summary.get("envelopes", {}).items()}
    if len(set(each.values())) == 1:
        yield f"All peaks are {next(iter(each.values()))}"
    elif each:
        yield "Peaks are " + ", ".join(f"{nature} ({name})" for name, nature in each.items())


def answers(summary: Document) -> list[Row]:
    """A row for each answer to a question: what, answer, nature."""
    return [
        (f"{question.key}: {row[0]}", *row[1:3])
        for question in QUESTIONS
        if question.key in summary
        for row in question.rows(summary[question.key])
    ]


def drivers(summary: Document) -> Iterator[str]:
    """Lines on what drives the modulus, and the peak of the last output."""
    of = {name: one for name, one in summary.get("shares", {}).items() if name == "E"}
    of |= {f"the peak of {x}": one for x, one in [*summary.get("peak_shares", {}).items()][-1:]}
    yield from (f"Fixing one narrows {name} by: {_ranked(one)}" for name, one in of.items())


def _ranked(shares: Document) -> str:
    """The three largest shares, the largest first."""
    first = sorted(shares.items(), key=lambda pair: -pair[1])[:3]
    return ", ".join(f"{name} {share:.0%}" for name, share in first)


def identified(document: Document | None) -> Iterator[str]:
    """A line for each input and each mode that was predicted, from `Learned.document`."""
    if document is None or "refuted" in document:
        yield from [str(document["refuted"])] if document else []
        return
    for name, ends in document["inputs"].items():
        both_ends, unit = (ends["lower"][0], ends["upper"][0]), document["units"][name]
        words = " … ".join(engineering(end, unit) for end in both_ends)
        yield f"{name}: {words}, {document['narrowed'][name]:.0%} of its width before"
    for mode in document["held_out"]:
        low, high = mode["predicted"]
        where = f"{mode['measured']:.4g}, {'inside' if mode['inside'] else 'outside'}"
        yield f"mode {mode['mode']}: {low:.4g} … {high:.4g} Hz predicted, measured {where}"


def extremes(study: Document) -> list[Row]:
    """Least and greatest value of each output at the lowest level, with the error beside them."""
    units = {name: Output(name).unit for name in study["min"]}
    values = ((study[side][x], units[x]) for side in ("min", "max") for x in units)
    largest, errors = largest_by_unit(values), study.get("error", {})
    return [
        (
            name,
            *(
                engineering(outward(study[x][name], up=x == "max"), unit, beside=largest[unit])
                for x in ("min", "max")
            ),
            engineering(errors[name], unit, digits=2) if name in errors else "not estimated",
            str(nature_of(study["nature"])),
        )
        for name, unit in units.items()
    ]
