"""Fragility: the share of a suite's records under which limits are exceeded, over their measure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from alphacut.case.structure import Structure
from alphacut.figures import style
from alphacut.figures.style import BLUE, INK, alpha_legend, colours
from alphacut.frame.questions.fragility import CriticalMeasures, any_limit
from alphacut.frame.questions.peaks import ANY
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.io.quantity import between, engineering
from alphacut.questions.question import Motion, Question, Row, limit_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 60
"""Measures at which bands are drawn and tabulated."""
UNITS = {"Sa(T1)": "m/s^2", "PGA": "m/s^2", "scale": ""}


class Fragility(Question):
    """Share of the suite's records under which limits are exceeded, over a measure of records."""

    key = "fragility"
    title = "Under how many records are limits exceeded?"
    caption = "Band of the share of records under which the limit is exceeded, over their measure"
    reads_peaks = True
    head = ("limit", "median at the lowest α", "nature", "dispersion", "median at the highest α")

    measure: Literal["Sa(T1)", "PGA", "scale"] = Field(
        default="Sa(T1)", description="measure of a record; T1 and ζ are the nominal structure's"
    )
    independent: bool = Field(
        default=False, description="whether records count as independent draws: 95 % limits"
    )

    def check(self, structure: Structure) -> None:
        """Refuses structures that do not scale with their record.

        Raises:
            RefusedError: The structure is not linear, or moves without its record.
        """
        super().check(structure)
        moves = structure.linear is None or any(
            np.any(x)
            for x in (getattr(structure.linear, "q0", 0), getattr(structure.linear, "v0", 0))
        )
        allowed = "linear structures that start at rest, which scale with their record"
        require(not moves, "fragility", "of another motion", allowed)

    def answer(self, motion: Motion) -> Document:
        """Critical measures, bands, medians and dispersions of each limit, and of any of them."""
        require(motion.suite is not None, "fragility", "without records", "a section [records]")
        assert motion.suite is not None
        limits = self.in_si(motion.structure)
        peaks = list(motion.suite.peaks.values())
        measures = [sizes[self.measure] for sizes in motion.suite.measures.values()]
        critical = {
            name: CriticalMeasures.of(peaks, measures, name, limit)
            for name, limit in limits.items()
        }
        natures = {name: Nature.weakest(one.nature([name]) for one in peaks) for name in limits}
        if len(limits) > 1:
            critical[ANY] = any_limit(list(critical.values()))
            natures[ANY] = Nature.weakest(natures.values())
        return {
            "alpha": motion.alpha,
            "measure": self.measure,
            "unit": UNITS[self.measure],
            "period_s": motion.suite.period,
            "damping_ratio": motion.suite.ratio,
            "records": list(motion.suite.peaks),
            "limits": {
                name: self._document(one)
                | {"limit": limits.get(name, 1.0), "nature": str(natures[name])}
                | {"output_unit": "" if name == ANY else Output(name).unit}
                for name, one in critical.items()
            },
        }

    def _document(self, critical: CriticalMeasures) -> Document:
        """Numbers of one limit; of α-levels first, then of records or measures."""
        grid = measure_grid(critical)
        bands = {"band": critical.band(grid)}
        if self.independent:
            bands["confidence"] = critical.confidence_band(grid)
        spread = {} if len(critical.low) < 2 else {"dispersion": critical.dispersion._asdict()}
        ends = ("low", "low_reached", "high_reached", "high")
        return {
            "critical": {end: getattr(critical, end).T for end in ends},
            "measure": grid,
            **{name: band._asdict() for name, band in bands.items()},
            "median": critical.median._asdict(),
            **spread,
        }

    @staticmethod
    def rows(document: Document) -> list[Row]:
        """A row for each limit."""
        return [
            (
                limit_words(name, one["limit"], one["output_unit"]),
                _range(one["median"], 0, document["unit"]),
                one["nature"],
                _range(one.get("dispersion"), 0, ""),
                _range(one["median"], -1, document["unit"]),
            )
            for name, one in document["limits"].items()
        ]

    @staticmethod
    def words(document: Document) -> str:
        """How to read the bands."""
        text = (
            f"Measure: {document['measure']}"
            f" (T1 = {document['period_s']:.4g} s, ζ = {document['damping_ratio']:.3g}, at the most"
            " plausible inputs). No structure within the α-cut exceeds the limit for a share of"
            " this suite's records outside the band. α is a level of possibility, no probability."
            " This is damage limitation of a linear structure, not collapse."
        )
        if any("confidence" in one for one in document["limits"].values()):
            text += " Dashed: pointwise 95 % limits if the records were independent draws."
        return text

    @staticmethod
    def figure(document: Document) -> Figure:
        """Band of the share of records over the measure, for the last limit, by level."""
        name, one = list(document["limits"].items())[-1]
        alpha = np.asarray(document["alpha"], float)
        measure = np.asarray(one["measure"], float)
        lower, upper = (np.asarray(one["band"][end], float) for end in ("lower", "upper"))
        drawn, axes = style.figure(7.2, 3.8)
        for low, high, shade in zip(lower, upper, colours(alpha), strict=True):
            axes.fill_between(measure, low, high, color=shade, lw=0, step="post")
        for end in (lower[-1], upper[-1]):
            axes.step(measure, end, color=INK, lw=1, where="post")
        for end in one.get("confidence", {}).values():
            axes.plot(measure, np.asarray(end, float)[0], color=BLUE, lw=0.9, ls="--")
        words = limit_words(name, one["limit"], one["output_unit"])
        axes.set_title(words, loc="left", fontsize=10)
        style.prefix_axis(axes, document["measure"], document["unit"], across=True)
        axes.set_ylabel("share of records that exceed it")
        axes.set_ylim(0, 1.02)
        alpha_legend(axes, alpha)
        return drawn


def measure_grid(critical: CriticalMeasures) -> Array:
    """Measures from below the least critical one to above the greatest that is finite."""
    finite = critical.high[np.isfinite(critical.high)]
    greatest = float(finite.max()) if finite.size else float(critical.low_reached.max())
    return np.asarray(np.linspace(0.8 * float(critical.low.min()), 1.1 * greatest, POINTS), float)


def _range(ends: Document | None, level: int, unit: str) -> str:
    """Both ends on a level; the upper one is "no end" where it is infinite."""
    if ends is None:
        return "–"
    low, high = ends["lower"][level], ends["upper"][level]
    if high is None or not np.isfinite(high):
        return f"{engineering(low, unit)} … no end"
    return f"{between(low, high, Nature.GUARANTEED, 3)} {unit}".strip()
