"""Two runs side by side: peaks, widths and limits of what both have."""

from __future__ import annotations

from collections.abc import Iterator

from alphacut.frame.questions.peaks import verdict_words
from alphacut.io.files import Document
from alphacut.io.quantity import engineering
from alphacut.questions.question import Row, limit_words
from alphacut.report.results import Table, unit_of

HEAD = ("at the lowest α", "first", "second", "second over first")


def comparison(first: Document, second: Document) -> Table:
    """Rows of what both summaries have: greatest peak, width of the peak, limits and verdicts."""
    rows = [*_material(first, second), *_peaks(first, second), *_limits(first, second)]
    return HEAD, rows


def _material(first: Document, second: Document) -> Iterator[Row]:
    for key in ("modulus", "image"):
        if key in first and key in second:
            parts = (first[key].get("cuts", first[key]), second[key].get("cuts", second[key]))
            ends = [(part["E_GPa"]["lower"][0], part["E_GPa"]["upper"][0]) for part in parts]
            yield _row("greatest E", "Pa", *(1e9 * high for _, high in ends))
            yield _row("width of E", "Pa", *(1e9 * (high - low) for low, high in ends))


def _peaks(first: Document, second: Document) -> Iterator[Row]:
    """Greatest peak and width of the peak of each output that both runs have."""
    for study, output, pair in _pairs(first.get("envelopes", {}), second.get("envelopes", {})):
        where = "" if study == "all" else f" ({study})"
        unit = unit_of(first["envelopes"][study], output)
        upper = [peak["upper"][0] for peak in pair]
        widths = [peak["upper"][0] - peak["lower"][0] for peak in pair]
        yield _row(f"greatest peak of {output}{where}", unit, *upper)
        yield _row(f"width of the peak of {output}{where}", unit, *widths)
    statistics = [run.get("records", {}).get("statistics", {}) for run in (first, second)]
    for output in statistics[0].keys() & statistics[1].keys():
        for word in statistics[0][output]["proved"]:
            peaks = [values[output]["proved"][word][0] for values in statistics]
            unit = unit_of(first["records"], output)
            yield _row(f"{word} of the records' peaks of {output}", unit, *peaks)


def _pairs(
    first: Document, second: Document
) -> Iterator[tuple[str, str, tuple[Document, Document]]]:
    """Study, output and peaks of what both have."""
    for study in first:
        if study in second:
            peaks = first[study]["peak"], second[study]["peak"]
            for output in peaks[0]:
                if output in peaks[1]:
                    yield study, output, (peaks[0][output], peaks[1][output])


def _limits(first: Document, second: Document) -> Iterator[Row]:
    """Verdicts on the limits that both runs have, and the scale of tolerances that both keep."""
    limits = [run.get("decision", {}).get("limits", {}) for run in (first, second)]
    for name in limits[0]:
        if name in limits[1]:
            pair = limits[0][name], limits[1][name]
            words = (verdict_words(x["verdict"], x["from_level"]) for x in pair)
            yield (_limit_words(pair[0]), *words, "")
            if pair[0]["limit"] != pair[1]["limit"]:
                yield (_limit_words(pair[1]), "another limit", "this limit", "")
    scales = [run.get("tolerances", {}).get("kept") for run in (first, second)]
    if None not in scales:
        yield _row("scale of tolerances", "", *scales)


def _limit_words(limit: Document) -> str:
    return limit_words(limit.get("output", ""), limit["limit"], limit["unit"]) or "any of them"


def _row(what: str, unit: str, first: float, second: float) -> Row:
    ratio = f"{second / first:.3f}" if first else ""
    shown = (engineering(x, unit) if unit else f"{x:.4g}" for x in (first, second))
    return (what, *shown, ratio)
