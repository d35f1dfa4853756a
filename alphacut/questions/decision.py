"""Decision: how possible and how necessary it is that limits are exceeded, and their margins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures import style
from alphacut.figures.style import GREY, INK, ORANGE, Look, colours
from alphacut.frame.questions.peaks import ANY, Passing, Peaks, passing, verdict_words
from alphacut.frame.structures.quantities import Output
from alphacut.io.files import Document
from alphacut.io.quantity import engineering
from alphacut.questions.question import Motion, Question, Row, limit_words, peak_document

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _document(name: str, one: Passing, limits: dict[str, float], peaks: Peaks) -> Document:
    """Degrees and margins of a limit, and on each level the greatest peak, proved and reached."""
    peak = {} if name == ANY else peak_document(peaks, name) | {"proved": peaks.most(name).upper}
    return {
        "peak": peak,
        "limit": limits.get(name, 1.0),
        "unit": "" if name == ANY else Output(name).unit,
        "possibility": one.possibility,
        "necessity": one.necessity,
        "margin": {"lower": one.margin[:, 0], "upper": one.margin[:, 1]},
        "verdict": one.outcome,
        "from_level": one.lowest,
        "nature": str(one.nature),
    }


def degree(ends: Row) -> str:
    """Bounds of a degree, or one number."""
    return " … ".join(dict.fromkeys(f"{float(end):.4g}" for end in ends))


def _left(one: Document) -> str:
    """Least that is left of a limit at the lowest level."""
    left = one["margin"]["lower"][0]
    if left is None or not np.isfinite(left):
        return "not known"
    return engineering(left, one["unit"]) if one["unit"] else f"{left:.1%}"


def _peak(one: Document) -> Row:
    """Greatest peak at the lowest level, proved and reached, and the gap as a share of it."""
    if not one.get("peak"):
        return ("", "", "")
    proved, reached = one["peak"]["proved"][0], one["peak"]["reached"][0]
    if proved is None or not np.isfinite(proved):
        return ("not known", engineering(reached, one["unit"]), "")
    gap = f"{(proved - reached) / proved:.1%}" if proved > 0 else ""
    return (*(engineering(peak, one["unit"]) for peak in (proved, reached)), gap)


class Decision(Question):
    """Possibility and necessity that limits are exceeded."""

    key = "decision"
    title = "Can or must limits be exceeded?"
    caption = "Fuzzy peak of each limited output over its limit"
    reads_peaks = True
    head = (
        *("limit", "verdict", "nature", "possibility", "necessity", "least margin"),
        *("peak at most", "peak reached", "gap"),
    )

    def answer(self, motion: Motion) -> Document:
        """Degrees and margins of every limit, from the peaks of the limited outputs."""
        assert motion.peaks is not None
        limits = self.in_si(motion.structure)
        peaks = motion.peaks
        answers = passing(peaks, limits)
        documents = {name: _document(name, one, limits, peaks) for name, one in answers.items()}
        return {"alpha": motion.alpha, "step": motion.step, "limits": documents}

    @staticmethod
    def rows(document: Document) -> list[Row]:
        """A row for each limit."""
        return [
            (
                limit_words(name, one["limit"], one["unit"]),
                verdict_words(one["verdict"], one["from_level"]),
                one["nature"],
                degree(one["possibility"]),
                degree(one["necessity"]),
                _left(one),
                *_peak(one),
            )
            for name, one in document["limits"].items()
        ]

    @staticmethod
    def words(document: Document) -> str:
        """How to read the degrees."""
        return (
            "A limit is not exceeded where no motion exceeds it, exceeded where every motion does,"
            " and can be exceeded where a motion is known that does."
            " Attained bounds show what is possible and exclude nothing."
        )

    @staticmethod
    def figure(document: Document) -> Figure:
        """Peak of each limited output over its limit, a bar for each level."""
        each = {name: one for name, one in document["limits"].items() if name != ANY}
        drawn, axes = style.figure(7.2, 1.2 + 0.7 * len(each))
        alpha = np.asarray(document["alpha"], float)
        places = np.arange(len(each))[::-1]
        for place, one in zip(places, each.values(), strict=True):
            margins = (np.asarray(one["margin"][side], float) for side in ("upper", "lower"))
            low, high = (1 - margin / one["limit"] for margin in margins)
            for level, left, right, shade in zip(alpha, low, high, colours(alpha), strict=True):
                bar: Look = {"left": left, "height": 0.66 - 0.4 * level, "color": shade, "lw": 0}
                axes.barh(place, right - left, **bar)
            possible, necessary = degree(one["possibility"]), degree(one["necessity"])
            verdict = verdict_words(one["verdict"], one["from_level"])
            text = f"{verdict} ({one['nature']}): possible to {possible}"
            text += f", necessary to {necessary}"
            axes.text(0.01, place + 0.4, text, fontsize=8, transform=axes.get_yaxis_transform())
        axes.axvline(1.0, color=ORANGE, lw=1.4, ls="--")
        axes.axvline(0.0, color=GREY, lw=0.4)
        axes.set_ylim(-0.5, len(each) - 0.2)
        axes.set_yticks(places, list(each), color=INK)
        axes.set_xlabel("peak over its limit (dashed); the darker the higher α")
        return drawn
