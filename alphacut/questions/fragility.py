"""Fragility: the share of a suite's records under which limits are exceeded, over their measure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.case.limits import FragilitySection
from alphacut.case.structure import Structure
from alphacut.frame.questions.fragility import CriticalMeasures, of_any_limit
from alphacut.frame.questions.peaks import ANY
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.io.quantity import engineering, range_text
from alphacut.questions.question import FuzzyResponse, NumberRow, Question, Row, limit_words

POINTS = 60
"""Measures at which bands are drawn and tabulated."""
UNITS = {"Sa(T1)": "m/s^2", "PGA": "m/s^2", "scale": ""}


@dataclass(frozen=True)
class FragilityQuestion(Question):
    """Share of the suite's records under which limits are exceeded, over a measure of records."""

    section: FragilitySection
    key = "fragility"
    title = "Under how many records are limits exceeded?"
    caption = "Band of the share of records under which the limit is exceeded, over their measure"
    head = ("limit", "median at the lowest α", "nature", "dispersion", "median at the highest α")

    def answer(self, response: FuzzyResponse) -> Document:
        """Critical measures, bands, medians and dispersions of each limit, and of any of them."""
        if response.suite is None:
            raise RefusedError("fragility", "without records", "a section [records]")
        limits = self.section.in_si(response.structure)
        names = {name: limit.peak for name, limit in self.section.limits_by_name.items()}
        peaks = [x.named(names) for x in response.suite.peaks.values()]
        measures = [sizes[self.section.measure] for sizes in response.suite.measures.values()]
        critical = {
            name: CriticalMeasures.from_peaks(peaks, measures, name, limit)
            for name, limit in limits.items()
        }
        natures = {name: Nature.weakest(x.nature([name]) for x in peaks) for name in limits}
        if len(limits) > 1:
            critical[ANY] = of_any_limit(list(critical.values()))
            natures[ANY] = Nature.weakest(natures.values())
        return {
            "alpha": response.alpha,
            "measure": self.section.measure,
            "unit": UNITS[self.section.measure],
            "period_s": response.suite.period,
            "damping_ratio": response.suite.ratio,
            "records": list(response.suite.peaks),
            "limits": {
                name: self._document(measures_of_limit)
                | {"limit": limits.get(name, 1.0), "nature": str(natures[name])}
                | self._output_and_unit(name, response.structure)
                for name, measures_of_limit in critical.items()
            },
        }

    def _output_and_unit(self, name: str, structure: Structure) -> Document:
        shown = self.section.peak_and_unit(name, structure)
        return {"output": shown["output"], "output_unit": shown["unit"]}

    def _document(self, critical: CriticalMeasures) -> Document:
        """Numbers on one limit; arrays have shape (levels, records) or (levels, measures)."""
        grid = measure_grid(critical)
        bounds = {"band": critical.band(grid), "median": critical.median}
        if self.section.independent:
            bounds["confidence"] = critical.confidence_band(grid)
        if len(critical.low) > 1:  # one record has no dispersion
            bounds["dispersion"] = critical.dispersion
        ends = ("low", "low_reached", "high_reached", "high")
        return {
            "critical": {end: getattr(critical, end).T for end in ends},
            "measure": grid,
            **{name: pair._asdict() for name, pair in bounds.items()},
        }

    @staticmethod
    def rows(document: Document) -> list[Row]:
        """A row for each limit: median and dispersion of the critical measures."""
        return [
            (
                limit_words(limit["output"], limit["limit"], limit["output_unit"]),
                _ends_text(limit["median"], 0, document["unit"]),
                limit["nature"],
                _ends_text(limit.get("dispersion"), 0, ""),
                _ends_text(limit["median"], -1, document["unit"]),
            )
            for limit in document["limits"].values()
        ]

    @staticmethod
    def number_rows(document: Document) -> tuple[Row, list[NumberRow]]:
        """Titles of the columns, and a row for each limit and level."""
        measure = f"{document['measure']} [{document['unit']}]" if document["unit"] else "scale"
        head: Row = ("limited output", "unit", "limit", "α", f"least median {measure}")
        head += (f"greatest median {measure}", "least dispersion", "greatest dispersion", "nature")
        rows: list[NumberRow] = []
        for name, limit in document["limits"].items():
            spread = limit.get("dispersion")
            for k, alpha in enumerate(document["alpha"]):
                ends = [limit["median"][side][k] for side in ("lower", "upper")]
                ends += [spread[side][k] if spread else None for side in ("lower", "upper")]
                first = (name, limit["output_unit"], limit["limit"], alpha)
                rows.append((*first, *ends, limit["nature"]))
        return head, rows

    @staticmethod
    def words(document: Document) -> str:
        """Sentences on the measure, and on how to read the bands."""
        text = (
            f"Measure: {document['measure']}"
            f" (T1 = {document['period_s']:.4g} s, ζ = {document['damping_ratio']:.3g}, at the most"
            " plausible inputs). No structure within the α-cut exceeds the limit for a share of"
            " this suite's records outside the band. α is a level of possibility, no probability."
            " This is damage limitation of a linear structure, not collapse."
        )
        if any("confidence" in limit for limit in document["limits"].values()):
            text += " Dashed: pointwise 95 % limits if the records were independent draws."
        return text


def measure_grid(critical: CriticalMeasures) -> Array:
    """Measures from below the least critical one to above the greatest that is finite."""
    finite = critical.high[np.isfinite(critical.high)]
    greatest = float(finite.max()) if finite.size else float(critical.low_reached.max())
    return np.asarray(np.linspace(0.8 * float(critical.low.min()), 1.1 * greatest, POINTS), float)


def _ends_text(ends: Document | None, level: int, unit: str) -> str:
    """Text of the range between both ends on a level; the upper one may be infinite ("no end")."""
    if ends is None:
        return "–"
    low, high = ends["lower"][level], ends["upper"][level]
    if high is None or not np.isfinite(high):
        return f"{engineering(low, unit)} … no end"
    return f"{range_text(low, high, Nature.GUARANTEED, 3)} {unit}".strip()
