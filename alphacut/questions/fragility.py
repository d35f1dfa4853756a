"""Fragility: the share of a suite's records under which limits are exceeded, over their measure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np

from alphacut.case.limits import FragilitySection
from alphacut.frame.questions.fragility import CriticalMeasures, of_any_limit
from alphacut.frame.questions.peaks import ANY
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Nature
from alphacut.io.quantity import STANDARD_GRAVITY, engineering, range_text
from alphacut.questions.question import FuzzyResponse, LimitAnswer, LimitsAnswer, Record, Texts
from alphacut.stages.envelope import peaks_of
from alphacut.stages.store import CutsResult, Values

POINTS = 60
"""Measures at which bands are drawn and tabulated."""
UNITS = {"Sa(T1)": "m/s^2", "PGA": "m/s^2", "scale": ""}


class LimitFragility(LimitAnswer):
    """Critical measures of the records for a limit, and bounds of the share of records by measure.

    `critical` has the arrays of `CriticalMeasures` by name, (levels, records). Dispersion is that
    of the measures' logarithms, of two records or more; `confidence` has 95 % limits of the share
    if records are independent draws.
    """

    nature: Nature
    critical: dict[str, Values]
    measure: Values
    band: CutsResult
    median: CutsResult
    dispersion: CutsResult | None
    confidence: CutsResult | None


class FragilityAnswer(LimitsAnswer[LimitFragility]):
    """Share of the suite's records under which limits are exceeded, over a measure of records."""

    key = "fragility"
    title = "Under how many records are limits exceeded?"
    caption = "Band of the share of records under which the limit is exceeded, over their measure"
    measure: str
    unit: str
    period_s: float
    damping_ratio: float

    def texts_of(self, limit: LimitFragility) -> Texts:
        """Median and dispersion of the critical measures."""
        spread = "–" if limit.dispersion is None else _range_text(limit.dispersion[0], "")
        return {
            "limit": limit.words,
            "median at the lowest α": self._median_text(limit.median[0]),
            "nature": limit.nature,
            "dispersion": spread,
            "median at the highest α": self._median_text(limit.median[-1]),
        }

    def _median_text(self, ends: tuple[float, float]) -> str:
        """Range of a median with its measure; of accelerations in g, too."""
        text = f"median {self.measure} {_range_text(ends, self.unit)}"
        if self.unit != "m/s^2":
            return text
        low, high = (end / float(STANDARD_GRAVITY) for end in ends)
        return f"{text} ({_range_text((low, high), 'g')})"

    def numbers_of(self, limit: LimitFragility) -> Iterator[Record]:
        """Yields a record for each level."""
        measure = f"{self.measure} [{self.unit}]" if self.unit else "scale"
        for k, alpha in enumerate(self.alpha):
            spread = (None, None) if limit.dispersion is None else limit.dispersion[k]
            yield {
                "α": float(alpha),
                f"least median {measure}": limit.median[k][0],
                f"greatest median {measure}": limit.median[k][1],
                "least dispersion": spread[0],
                "greatest dispersion": spread[1],
                "nature": limit.nature,
            }

    def words(self) -> str:
        """Sentences on the measure, and on how to read the bands."""
        text = (
            f"Measure: {self.measure}"
            f" (T1 = {self.period_s:.4g} s, ζ = {self.damping_ratio:.3g}, at the most"
            " plausible inputs). No structure within the α-cut exceeds the limit for a share of"
            " this suite's records outside the band. α is a level of possibility, no probability."
            " This is damage limitation of a linear structure, not collapse."
        )
        if any(limit.confidence for limit in self.limits.values()):
            text += " Dashed: pointwise 95 % limits if the records were independent draws."
        return text


def _range_text(ends: tuple[float, float], unit: str) -> str:
    """Text of a range; its upper end may be infinite ("no end")."""
    if not np.isfinite(ends[1]):
        return f"{engineering(ends[0], unit)} … no end"
    return f"{range_text(*ends, Nature.GUARANTEED, 3)} {unit}".strip()


def fragility(section: FragilitySection, response: FuzzyResponse) -> FragilityAnswer:
    """Critical measures, bands, medians and dispersions of each limit, and of any of them."""
    suite, limits = response.suite, section.limits_in_si(response.structure)
    if suite is None:
        raise RefusedError("fragility", "without records", "a section [records]")
    records, critical, natures = suite.records.values(), {}, {}
    measures = [record.measures[section.measure] for record in records]
    peaks_of_records = [peaks_of(record.peak, response.alpha) for record in records]
    for name, limit in section.limits_by_name.items():
        peaks = [peaks[limit.peak] for peaks in peaks_of_records]
        critical[name] = CriticalMeasures.from_peaks(peaks, measures, limits[name])
        natures[name] = Nature.weakest(peak.nature for peak in peaks)
    if len(limits) > 1:
        critical[ANY] = of_any_limit(list(critical.values()))
        natures[ANY] = Nature.weakest(natures.values())

    answers = {}
    for name, ends in critical.items():
        finite = ends.high[np.isfinite(ends.high)]
        largest = float(finite.max()) if finite.size else float(ends.low_reached.max())
        # from below the least critical measure to above the greatest that is finite
        grid: Array = np.linspace(0.8 * float(ends.low.min()), 1.1 * largest, POINTS, dtype=float)
        has_spread = len(ends.low) > 1  # one record has no dispersion
        answers[name] = LimitFragility.of(
            section,
            name,
            response.structure,
            nature=natures[name],
            critical={x.name: getattr(ends, x.name).T for x in fields(ends)},
            measure=grid,
            band=ends.band(grid)._asdict(),
            median=ends.median._asdict(),
            dispersion=ends.dispersion._asdict() if has_spread else None,
            confidence=ends.confidence_band(grid)._asdict() if section.independent else None,
        )
    return FragilityAnswer(
        alpha=np.array(response.alpha),
        measure=section.measure,
        unit=UNITS[section.measure],
        period_s=suite.period_s,
        damping_ratio=suite.damping_ratio,
        limits=answers,
    )
