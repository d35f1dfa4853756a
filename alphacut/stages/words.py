"""Tables for people of a run's summary: the modulus, the peaks of the motion, the questions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from alphacut.frame.structures.quantities import Output
from alphacut.io.files import Document
from alphacut.io.text_table import text_table
from alphacut.io.units import axis_prefix, engineering, fixed
from alphacut.questions.table import QUESTIONS

SHORT = {"guaranteed": "guaranteed", "estimated": "estimated", "inner": "attained"}
"""First words of natures, for a column."""


def run_tables(summary: Document) -> str:
    """Every table of a run."""
    text = text_table(MODULUS, rows) if (rows := [*modulus_rows(summary)]) else ""
    studies = summary.get("envelopes", {})
    if studies:
        text += peaks_table(studies)
    return text + "".join(f"{line}\n" for line in answers(summary))


MODULUS = ("material", "most plausible", "range at α = 0", "nature", "± error")


def modulus_rows(summary: Document) -> Iterator[Sequence[str]]:
    """E and ν: computed, of an image, or given."""
    if cell := summary.get("modulus"):
        error = sum(cell["error"].values()) * float(cell["upper_GPa"])
        yield ("E, GPa", *both(cell["E_GPa"]), nature(cell["nature"]), f"{error:.1e}")
        yield ("ν", *both(cell["nu_cuts"]), nature(cell["nature"]), "")
        low, high = cell["references"]["hashin_shtrikman_E_GPa"]
        yield ("Hashin–Shtrikman, GPa", between(low, high), "", "", "")
    if image := summary.get("image"):
        cuts = image["cuts"]
        yield ("E, GPa", *both(cuts["E_GPa"]), nature(cuts["nature"][0]), "")


def both(cuts: Document) -> tuple[str, str]:
    """Cuts on the highest level and on the lowest."""
    lower, upper = cuts["lower"], cuts["upper"]
    return between(lower[-1], upper[-1]), between(lower[0], upper[0])


def between(low: float, high: float) -> str:
    """An interval, or one number."""
    return " … ".join(dict.fromkeys((fixed(float(low), 4), fixed(float(high), 4))))


def nature(text: str) -> str:
    """The nature of bounds in one word."""
    return SHORT.get(text.partition(",")[0].partition(":")[0].split()[0], text.split(",")[0])


def peaks_table(studies: Document) -> str:
    """Peaks of the magnitude of every output of every study.

    Columns are the peak on the highest level, on the one next to 0.5, and on the lowest.
    """
    first = next(iter(studies.values()))
    alpha = [float(x) for x in first["alpha"]]
    levels = list(dict.fromkeys((len(alpha) - 1, middle(alpha), 0)))
    head = ["peak of", *(f"α = {alpha[k]:g}" for k in levels), "nature", "± error"]
    rows = []
    for name, study in studies.items():
        for output, peak in study["peak"].items():
            of = f" ({name})" if len(studies) > 1 else ""
            rows.append([*peak_row(output, of, peak, levels), error_of(study, output, peak)])
            rows[-1].insert(-1, nature(study["nature"]))
    return text_table(head, rows)


def middle(alpha: Sequence[float]) -> int:
    """Place of the level next to 0.5."""
    return min(range(len(alpha)), key=lambda k: abs(alpha[k] - 0.5))


def peak_row(output: str, of: str, peak: Document, levels: Sequence[int]) -> list[str]:
    """An output with its unit, and its peaks on some levels."""
    factor, unit = axis_prefix(float(peak["upper"][0]), Output(output).unit)
    ends = [[factor * float(peak[end][k]) for end in ("lower", "upper")] for k in levels]
    words = [" … ".join(dict.fromkeys(f"{x:.4g}" for x in pair)) for pair in ends]
    return [f"{output}, {unit}{of}", *words]


def error_of(study: Document, output: str, peak: Document) -> str:
    """Declared error of an output in the unit of its row; empty where there is none."""
    if "error" not in study:
        return ""
    factor, _ = axis_prefix(float(peak["upper"][0]), Output(output).unit)
    return f"{factor * float(study['error'][output]):.2g}"


def answers(summary: Document) -> Iterator[str]:
    """A line for each question, what drives the width, and what measured modes leave."""
    if "update" in summary:
        yield from learned(summary["update"])
    for question in QUESTIONS:
        for row in question.rows(summary[question.key]) if question.key in summary else ():
            yield f"{row[0]}: {row[1]} ({row[2]})"
    shares = summary.get("shares", {})
    outputs = [name for name in shares if name not in ("E", "ν")]
    names = [*(name for name in shares if name == "E"), *outputs[-1:]]
    if names:
        yield "width comes from " + "; ".join(f"{name}: {_ranked(shares[name])}" for name in names)


def _ranked(shares: Document) -> str:
    """The three largest shares, the largest first."""
    first = sorted(shares.items(), key=lambda pair: -pair[1])[:3]
    return ", ".join(f"{name} {share:.0%}" for name, share in first)


def learned(document: Document) -> Iterator[str]:
    """A line for each input and each mode that was predicted, from `Learned.document`."""
    if "refuted" in document:
        yield str(document["refuted"])
        return
    for name, ends in document["inputs"].items():
        both_ends, unit = (ends["lower"][0], ends["upper"][0]), document["units"][name]
        words = " … ".join(engineering(end, unit) for end in both_ends)
        yield f"{name}: {words}, {document['narrowed'][name]:.0%} of its width before"
    for mode in document["held_out"]:
        low, high = mode["predicted"]
        where = f"{mode['measured']:.4g}, {'inside' if mode['inside'] else 'outside'}"
        yield f"mode {mode['mode']}: {low:.4g} … {high:.4g} Hz predicted, measured {where}"
