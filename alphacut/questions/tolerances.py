"""Tolerances: the largest scale of all supports at which no limit is exceeded."""

from __future__ import annotations

import math

from alphacut.base.errors import RefusedError
from alphacut.base.number_text import MINUS, engineering, rounded_ends
from alphacut.case.limits import TolerancesSection
from alphacut.frame.analyses.tolerances import scale_supports, tolerances
from alphacut.frame.boxes import boxes
from alphacut.frame.propagation import require_admissible
from alphacut.fuzzy.result import Nature, rounded
from alphacut.questions.question import Answer, FuzzyResponse, Record, Row, Table
from alphacut.stages.envelope import PEAK_ERROR, PeakResults, peak_results
from alphacut.stages.store import Numbers


class Support(Numbers):
    """Nominal value of an input, its support in the case, and the one with no limit exceeded."""

    nominal: float
    unit: str = ""
    own: tuple[float, float]
    kept: tuple[float, float]


class TolerancesAnswer(Answer):
    """Scales of all supports, and the supports at the largest one with no limit exceeded.

    That scale is `kept`, None if a limit is exceeded at every scale. Up to `clear` no motion is
    known to exceed a limit, `passed` is the least scale known to exceed one and `most` the largest
    tried. Limits are in SI, and `peaks` those at scale 1.
    """

    key = "tolerances"
    title = "How far may tolerances go?"
    caption = "Supports of the inputs in the case, and at the scale that exceeds no limit"
    limits: dict[str, float]
    peaks: PeakResults
    kept: float | None
    clear: float | None
    passed: float | None
    most: float
    nature: Nature
    supports: dict[str, Support]

    def table(self) -> Table:
        """The scale of all supports, then the largest one of each input; rounded inwards."""
        scale, exceeded = "none", "none is exceeded"
        if self.kept is not None:
            scale = f"up to {rounded(self.kept, 'upper', Nature.ATTAINED):.4g}"
        if self.passed is not None:
            clear = "" if self.clear is None else f"no exceedance found up to {self.clear:.4g}, "
            exceeded = f"{clear}exceeded at {self.passed:.4g}"
        nature = self.nature_text(self.nature)
        if self.encloses:
            exceeded = "not known"
        rows: list[Row] = [("scale of all ranges", scale, nature, exceeded)]
        for name, support in self.supports.items():
            text, relative = "–", ""
            if self.kept is not None:
                inside = rounded_ends(*support.kept, Nature.ATTAINED)
                text = " … ".join(dict.fromkeys(engineering(end, support.unit) for end in inside))
                relative = f"about {support.nominal:g}"
                if support.nominal:
                    relative = ", ".join(f"{x / support.nominal - 1:+.2%}" for x in support.kept)
            rows.append((f"tolerance of {name}", text, nature, relative.replace("-", MINUS)))
        head = ("quantity", "no limit exceeded", "nature", "limit exceeded, or relative")
        return Table(head, rows)

    def records(self) -> list[Record]:
        """A row of the scale, then one of the range of each input."""
        rows = [("scale of all ranges", "", None, self.kept, None, 1.0, None)]
        for name, support in self.supports.items():
            ends = (None, None) if self.kept is None else support.kept
            rows.append((name, support.unit, *ends, *support.own, support.nominal))
        titles = ["quantity", "unit", "from", "to", "from in the case", "to in the case"]
        titles += ["most plausible", "nature"]
        nature = self.nature_text(self.nature)
        return [dict(zip(titles, (*row, nature), strict=True)) for row in rows]

    def words(self) -> str:
        """How to read the scale."""
        text = (
            "All supports are scaled together about nominal values; 1 is the case as it stands."
            f" Scales up to {self.most:g} were tried, each with an envelope of its own."
        )
        return f"{text} {self.words_on_box()}".strip()


def require_admissible_scale(section: TolerancesSection, response: FuzzyResponse) -> None:
    """Refuses a largest scale at which an input is inadmissible."""
    try:
        widest = boxes(scale_supports(response.inputs, section.most), [0.0])
        require_admissible(response.structure.model, widest)
    except RefusedError as error:
        value = f"{section.most:g} times the supports: {error.key} is {error.value}"
        key, cure = "tolerances.most", "a smaller scale"
        raise RefusedError(key, value, error.allowed, cure) from None


def admissible_tolerances(section: TolerancesSection, response: FuzzyResponse) -> TolerancesAnswer:
    """Largest scale of all supports with no limit exceeded, and the supports there."""
    assert response.peaks is not None
    limits = section.limits_in_si(response.structure)
    scale = tolerances(
        response.structure.model_with_outputs("tolerances.limits", tuple(limits)),
        response.inputs,
        limits,
        duration=response.duration,
        step=response.step,
        most=section.most,
        error=PEAK_ERROR,
        at_one=response.peaks if response.alpha[0] == 0 else None,
        progress=response.progress,
    )
    inputs, peaks = response.inputs, peak_results(response.peaks)
    return TolerancesAnswer(
        encloses=response.encloses,
        limits=limits,
        peaks={name: peaks[name] for name in limits},
        kept=scale.admissible,
        clear=scale.clear,
        passed=scale.passed if math.isfinite(scale.passed) else None,
        most=section.most,
        nature=scale.nature,
        supports={
            name: Support(
                nominal=inputs[name].nominal,
                unit=response.structure.input_unit(name),
                own=inputs[name].support,
                kept=ends,
            )
            for name, ends in scale.supports.items()
        },
    )
