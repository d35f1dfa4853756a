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
    """Table of what both runs have: E, greatest peaks and their widths, verdicts on limits."""
    rows = [*_modulus_rows(first, second), *_peak_rows(first, second), *_limit_rows(first, second)]
    return HEAD, rows


def _modulus_rows(first: Document, second: Document) -> Iterator[Row]:
    """Rows on the greatest E and the width of E, of a round cell and of an image."""
    for key in ("modulus", "image"):
        if key in first and key in second:
            parts = (first[key].get("cuts", first[key]), second[key].get("cuts", second[key]))
            ends = [(part["E_GPa"]["lower"][0], part["E_GPa"]["upper"][0]) for part in parts]
            yield _row("greatest E", "Pa", *(1e9 * high for _, high in ends))
            yield _row("width of E", "Pa", *(1e9 * (high - low) for low, high in ends))


def _peak_rows(first: Document, second: Document) -> Iterator[Row]:
    """Rows on the greatest peak and its width of each output, then on statistics of records."""
    studies = first.get("envelopes", {})
    for study, output, pair in _common_peaks(studies, second.get("envelopes", {})):
        name = output if study == "all" else f"{output} ({study})"
        unit = unit_of(studies[study], output)
        upper = [peak["upper"][0] for peak in pair]
        widths = [peak["upper"][0] - peak["lower"][0] for peak in pair]
        yield _row(f"greatest peak of {name}", unit, *upper)
        yield _row(f"width of the peak of {name}", unit, *widths)
    statistics = [run.get("records", {}).get("statistics", {}) for run in (first, second)]
    for output in statistics[0].keys() & statistics[1].keys():
        for statistic in statistics[0][output]["proved"]:  # mean, median …
            peaks = [values[output]["proved"][statistic][0] for values in statistics]
            unit = unit_of(first["records"], output)
            yield _row(f"{statistic} of the records' peaks of {output}", unit, *peaks)


def _common_peaks(
    first: Document, second: Document
) -> Iterator[tuple[str, str, tuple[Document, Document]]]:
    """Yields the name of each study and output that both runs have, and its peaks in both."""
    for study in first:
        if study in second:
            peaks = first[study]["peak"], second[study]["peak"]
            for output in peaks[0]:
                if output in peaks[1]:
                    yield study, output, (peaks[0][output], peaks[1][output])


def _limit_rows(first: Document, second: Document) -> Iterator[Row]:
    """Rows on the verdicts on limits that both runs have, and on their scales of tolerances."""
    limits = [run.get("decision", {}).get("limits", {}) for run in (first, second)]
    for name in limits[0]:
        if name in limits[1]:
            pair = limits[0][name], limits[1][name]
            verdicts = (verdict_words(x["verdict"], x["from_level"]) for x in pair)
            yield (_limit_words(pair[0]), *verdicts, "")
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
