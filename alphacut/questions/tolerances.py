"""Tolerances: the largest scale of all supports at which no limit is exceeded."""

from __future__ import annotations

import math
from dataclasses import dataclass

from alphacut.case.limits import TolerancesSection
from alphacut.frame.boxes import boxes
from alphacut.frame.propagation import require_admissible
from alphacut.frame.questions.tolerances import scaled, tolerances
from alphacut.frame.structures.quantities import of_storey_frame
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Nature, rounded
from alphacut.io.files import Document
from alphacut.io.quantity import engineering
from alphacut.questions.question import PEAK_ERROR, Motion, NumberRow, Question, Row, peak_document


def _row(name: str, support: Document, document: Document) -> Row:
    """An input's support at the scale that exceeds no limit, and relative to its modal value."""
    modal = support["modal"]
    share = [end / modal - 1 for end in support["kept"] if modal]
    ends = ", ".join(f"{end:+.2%}".replace("-", "−") for end in share) or f"about {modal:g}"
    ends_and_sides = zip(support["kept"], ("lower", "upper"), strict=True)
    inside = (rounded(end, side, Nature.ATTAINED) for end, side in ends_and_sides)
    text = " … ".join(engineering(end, of_storey_frame(name).unit) for end in inside)
    tolerance = "–" if document["kept"] is None else text
    return f"tolerance of {name}", tolerance, document["nature"], ends if tolerance != "–" else ""


@dataclass(frozen=True)
class TolerancesQuestion(Question):
    """Largest scale of the supports of the fuzzy inputs at which no limit is exceeded."""

    section: TolerancesSection
    key = "tolerances"
    title = "How far may tolerances go?"
    caption = "Supports of the inputs in the case, and at the scale that exceeds no limit"
    head = ("quantity", "no limit exceeded", "nature", "limit exceeded, or relative")

    def require_answerable(self, motion: Motion) -> None:
        """Refuses scales at which inputs reach values that have no meaning.

        Raises:
            RefusedError: They do at the largest scale.
        """
        super().require_answerable(motion)
        try:
            widest = boxes(scaled(motion.inputs, self.section.most), [0.0])
            require_admissible(motion.structure.model, widest)
        except RefusedError as error:
            what, cure = f"{self.section.most:g} times the supports: {error.key}", "a smaller scale"
            value = f"{what} is {error.value}"
            raise RefusedError("tolerances.most", value, error.allowed, cure) from None

    def answer(self, motion: Motion) -> Document:
        """Scales at which no limit and one is exceeded, and the supports at the first."""
        assert motion.peaks is not None
        limits = self.section.in_si(motion.structure)
        scale = tolerances(
            motion.structure.model_with_outputs("tolerances.limits", tuple(limits)),
            motion.inputs,
            limits,
            duration=motion.duration,
            step=motion.step,
            most=self.section.most,
            error=PEAK_ERROR,
            at_one=motion.peaks if motion.alpha[0] == 0 else None,
            progress=motion.progress,
        )
        modal = {name: number.modal for name, number in motion.inputs.items()}
        supports = {
            name: {"modal": modal[name], "own": motion.inputs[name].support, "kept": ends}
            for name, ends in scale.supports.items()
        }
        return {
            "limits": limits,
            "peaks": {name: peak_document(motion.peaks, name) for name in limits},
            "kept": scale.admissible,
            "clear": scale.clear,
            "passed": scale.passed if math.isfinite(scale.passed) else None,
            "most": self.section.most,
            "nature": str(scale.nature),
            "envelopes": scale.envelopes,
            "step": motion.step,
            "supports": supports,
        }

    @staticmethod
    def rows(document: Document) -> list[Row]:
        """The scale, then each input's tolerance."""
        largest, passed = document["kept"], document["passed"]
        scale = "none"
        if largest is not None:
            scale = f"up to {rounded(largest, 'upper', Nature.ATTAINED):.4g}"
        exceeded = f"exceeded at {passed:.4g}" if passed is not None else "none is exceeded"
        if passed is not None and document["clear"] is not None:
            exceeded = f"no exceedance found up to {document['clear']:.4g}, {exceeded}"
        head = ("scale of all ranges", scale, document["nature"], exceeded)
        supports = document["supports"].items()
        return [head, *(_row(name, support, document) for name, support in supports)]

    @staticmethod
    def number_rows(document: Document) -> tuple[Row, list[NumberRow]]:
        """The scale, then the range of each input."""
        head: Row = ("quantity", "unit", "from", "to", "from in the case", "to in the case")
        head += ("most plausible", "nature")
        scale = (None, document["kept"], None, 1.0, None, document["nature"])
        rows: list[NumberRow] = [("scale of all ranges", "", *scale)]
        for name, support in document["supports"].items():
            ends = (None, None) if document["kept"] is None else support["kept"]
            unit, last = of_storey_frame(name).unit, (support["modal"], document["nature"])
            rows.append((name, unit, *ends, *support["own"], *last))
        return head, rows

    @staticmethod
    def words(document: Document) -> str:
        """How to read the scale."""
        return (
            "All supports are scaled together about their modal values; 1 is the case as it stands."
            f" Scales up to {document['most']:g} were tried, each with an envelope of its own."
        )
