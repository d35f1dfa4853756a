"""Fragility: the share of a suite's records under which limits are exceeded, over their measure."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydantic import Field

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError
from alphacut.base.number_text import STANDARD_GRAVITY, engineering, range_text
from alphacut.case.limits import FragilitySection
from alphacut.frame.analyses.fragility import CriticalMeasures, of_any_limit
from alphacut.frame.analyses.incremental import GRID_RATIO, RESOLUTION
from alphacut.frame.analyses.peaks import ANY
from alphacut.fuzzy.result import Nature
from alphacut.questions.question import FuzzyResponse, LimitAnswer, LimitsAnswer, Record, Texts
from alphacut.stages.envelope import peaks_of
from alphacut.stages.store import CutsResult, Values
from alphacut.stages.suite import IncrementalResult, SuiteResult

POINTS = 60
"""Measures at which bands are drawn and tabulated."""
UNITS = {"Sa(T1)": "m/s^2", "PGA": "m/s^2", "scale": ""}
ENDS = {"first crossing": "low_reached", "last non-exceedance": "high_reached"}
"""Fields of `CriticalMeasures` of frames that yield by their titles."""


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
    """Share of the suite's records under which limits are exceeded, over a measure of records.

    `increments` are the demands over that measure of each record, of a frame that yields.
    """

    key = "fragility"
    title = "Under how many records are limits exceeded?"
    caption = "Band of the share of records under which the limit is exceeded, over their measure"
    measure: str
    unit: str
    period_s: float
    damping_ratio: float
    increments: dict[str, IncrementalResult] = Field(default={})

    def texts_of(self, limit: LimitFragility) -> Texts:
        """Median and dispersion of the critical measures."""
        spread = "–" if limit.dispersion is None else _range_text(limit.dispersion[0], "")
        return {
            "limit": limit.words,
            "median at the lowest α": self._median_text(limit.median[0]) + self._ends_text(limit),
            "nature": self.nature_text(limit.nature),
            "dispersion": spread,
            "median at the highest α": self._median_text(limit.median[-1]),
        }

    def _median_text(self, ends: tuple[float, float]) -> str:
        """Range of a median with its measure; of accelerations in g, too."""
        text = f"median {self.measure} {_range_text(ends, self.unit)}"
        if self.unit != "m/s^2":
            return text
        low, high = (end / STANDARD_GRAVITY for end in ends)
        return f"{text} ({_range_text((low, high), 'g')})"

    def _ends_text(self, limit: LimitFragility) -> str:
        """Ranges over records of first crossing and last non-exceedance, of a frame that yields."""
        if not self.increments:
            return ""
        ends = {x: np.nan_to_num(limit.critical[end][0], nan=np.inf) for x, end in ENDS.items()}
        texts = (f"{x} {_range_text((y.min(), y.max()), self.unit)}" for x, y in ends.items())
        return f"; over the records {', '.join(texts)}"

    def crossings(self) -> list[Record]:
        """A row for each limit, record and level of a frame that yields: sets of measures."""
        unit, rows = f" [{self.unit}]" if self.unit else "", list[Record]()
        for name, limit in self.limits.items():
            for column, (record, increment) in enumerate(self.increments.items()):
                for level, alpha in enumerate(self.alpha):
                    some, all_found = increment.demands[name][:, level]
                    sets = {"exceeded by some": some, "exceeded by all found": all_found}
                    rows.append({"limit": limit.words, "record": record, "α": float(alpha)})
                    for title, end in ENDS.items():
                        rows[-1][f"{title}{unit}"] = limit.critical[end][level, column]
                    for title, demands in sets.items():
                        rows[-1][f"{title}{unit}"] = _set_text(increment.measure, demands)
        return rows

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
                "nature": self.nature_text(limit.nature),
            }

    def words(self) -> str:
        """Sentences on the measure, and on how to read the bands."""
        text = (
            f"Measure: {self.measure}"
            f" (T1 = {self.period_s:.4g} s, ζ = {self.damping_ratio:.3g}, at the most"
            " plausible inputs). α is a level of possibility, no probability."
        )
        if self.increments:
            text += (
                f" Motions at measures {GRID_RATIO - 1:.0%} apart, and {RESOLUTION:.0%} where the"
                " answer changes: an exceedance between them may be missed. Upper ends of bands"
                " count the records under which a structure is known to exceed the limit, lower"
                " ends those under which all structures found do. Medians reach from those of"
                " first crossings to those of last non-exceedances. Sets end with the largest"
                " measure tried; fragility.most tries more."
            )
            tried = self.increments.items()
            collapses = [x for x, y in tried if np.isnan([*y.demands.values()]).any()]
            if collapses:
                text += f" A collapse exceeds every limit: under {', '.join(collapses)}."
        else:
            text += (
                " No structure within the α-cut exceeds the limit for a share of this suite's"
                " records outside the band."
                " This is damage limitation of a linear structure, not collapse."
            )
        if any(limit.confidence for limit in self.limits.values()):
            text += " Dashed: pointwise 95 % limits if the records were independent draws."
        return f"{text} {self.words_on_box()}".strip()


def _range_text(ends: tuple[float, float], unit: str) -> str:
    """Text of a range; its ends may be infinite."""
    if not np.isfinite(ends[0]):
        return "beyond all measures tried"
    if not np.isfinite(ends[1]):
        return f"{engineering(ends[0], unit)} … no end"
    return f"{range_text(*ends, Nature.GUARANTEED, 3)} {unit}".strip()


def _set_text(measures: Array, demands: Array) -> str:
    """Text of the measures with a demand above 1, as intervals; demands of a collapse are nan."""
    exceeds = np.concatenate([[False], ~(demands <= 1), [False]])
    starts, stops = np.flatnonzero(np.diff(exceeds.astype(int))).reshape(-1, 2).T
    ends = zip(measures[starts], measures[stops - 1], strict=True)
    return ", ".join(f"{low:.4g} … {high:.4g}" for low, high in ends)


def fragility(section: FragilitySection, response: FuzzyResponse) -> FragilityAnswer:
    """Critical measures, bands, medians and dispersions of each limit, and of any of them."""
    suite, increments = response.suite, response.increments
    critical = dict[str, tuple[Nature, CriticalMeasures]]()
    if suite is None:
        raise RefusedError("fragility", "without records", "a section [records]")
    if increments:
        for name in next(iter(increments.values())).demands:
            tried = [(x.measure, x.demands[name]) for x in increments.values()]
            critical[name] = Nature.ESTIMATED, CriticalMeasures.from_demands(tried)
    else:
        critical = _proved_measures(section, response, suite)
    answers = {}
    for name, (nature, ends) in critical.items():
        finite = ends.high[np.isfinite(ends.high)]
        largest = 1.1 * float(finite.max() if finite.size else ends.low_reached.max())
        if increments:
            most = float(next(iter(increments.values())).measure[-1])  # of all records
            largest = min(largest, most) if np.isfinite(ends.high).all() else most
        # from below the least critical measure to above the greatest that is finite
        grid: Array = np.linspace(0.8 * float(ends.low.min()), largest, POINTS, dtype=float)
        answers[name] = LimitFragility.of(
            section,
            name,
            response.structure,
            nature=nature,
            critical={
                x: getattr(ends, x).T for x in ("low", "low_reached", "high_reached", "high")
            },
            measure=grid,
            band=ends.band(grid)._asdict(),
            median=ends.median._asdict(),
            dispersion=ends.dispersion._asdict() if len(suite.records) > 1 else None,
            confidence=ends.confidence_band(grid)._asdict() if section.independent else None,
        )
    return FragilityAnswer(
        encloses=response.encloses,
        alpha=np.array(response.alpha),
        measure=section.measure,
        unit=UNITS[section.measure],
        period_s=suite.period_s,
        damping_ratio=suite.damping_ratio,
        limits=answers,
        increments=dict(increments),
    )


def _proved_measures(
    section: FragilitySection, response: FuzzyResponse, suite: SuiteResult
) -> dict[str, tuple[Nature, CriticalMeasures]]:
    """Nature and critical measures of each limit, and of any of several, of a linear structure."""
    records, limits = suite.records.values(), section.limits_in_si(response.structure)
    measures = [record.measures[section.measure] for record in records]
    peaks_of_records = [peaks_of(record.peak, response.alpha) for record in records]
    found = {}
    for name, limit in section.limits_by_name.items():
        peaks = [peaks[limit.peak] for peaks in peaks_of_records]
        nature = Nature.weakest(peak.nature for peak in peaks)
        found[name] = nature, CriticalMeasures.from_peaks(peaks, measures, limits[name])
    if len(limits) > 1:
        natures, critical = zip(*found.values(), strict=True)
        found[ANY] = Nature.weakest(natures), of_any_limit(critical)
    return found
