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
from alphacut.questions.question import (
    PEAK_ERROR,
    FuzzyResponse,
    NumberRow,
    Question,
    Row,
    peak_document,
)


def _row(name: str, support: Document, document: Document) -> Row:
    """Row of an input: its largest support with no limit exceeded, nature, and in % of modal."""
    if document["kept"] is None:
        return f"tolerance of {name}", "–", document["nature"], ""
    ends, modal = support["kept"], support["modal"]
    relative = f"about {modal:g}"
    if modal:
        relative = ", ".join(f"{end / modal - 1:+.2%}".replace("-", "−") for end in ends)
    sides = zip(ends, ("lower", "upper"), strict=True)
    inside = (rounded(end, side, Nature.ATTAINED) for end, side in sides)  # rounded inwards
    text = " … ".join(engineering(end, of_storey_frame(name).unit) for end in inside)
    return f"tolerance of {name}", text, document["nature"], relative


@dataclass(frozen=True)
class TolerancesQuestion(Question):
    """Largest scale of the supports of the fuzzy inputs at which no limit is exceeded."""

    section: TolerancesSection
    key = "tolerances"
    title = "How far may tolerances go?"
    caption = "Supports of the inputs in the case, and at the scale that exceeds no limit"
    head = ("quantity", "no limit exceeded", "nature", "limit exceeded, or relative")

    def require_answerable(self, response: FuzzyResponse) -> None:
        """Refuses limits that do not fit, and a largest scale at which an input is inadmissible."""
        super().require_answerable(response)
        largest = self.section.most
        try:
            widest = boxes(scaled(response.inputs, largest), [0.0])
            require_admissible(response.structure.model, widest)
        except RefusedError as error:
            value = f"{largest:g} times the supports: {error.key} is {error.value}"
            key, cure = "tolerances.most", "a smaller scale"
            raise RefusedError(key, value, error.allowed, cure) from None

    def answer(self, response: FuzzyResponse) -> Document:
        """Largest scale of all supports with no limit exceeded, and the supports there ("kept").

        "passed" is the least scale known to exceed a limit; "own" is a support in the case.
        """
        assert response.peaks is not None
        limits = self.section.in_si(response.structure)
        scale = tolerances(
            response.structure.model_with_outputs("tolerances.limits", tuple(limits)),
            response.inputs,
            limits,
            duration=response.duration,
            step=response.step,
            most=self.section.most,
            error=PEAK_ERROR,
            at_one=response.peaks if response.alpha[0] == 0 else None,
            progress=response.progress,
        )
        modal = {name: number.modal for name, number in response.inputs.items()}
        supports = {
            name: {"modal": modal[name], "own": response.inputs[name].support, "kept": ends}
            for name, ends in scale.supports.items()
        }
        return {
            "limits": limits,
            "peaks": {name: peak_document(response.peaks, name) for name in limits},
            "kept": scale.admissible,
            "clear": scale.clear,
            "passed": scale.passed if math.isfinite(scale.passed) else None,
            "most": self.section.most,
            "nature": str(scale.nature),
            "envelopes": scale.envelopes,
            "step": response.step,
            "supports": supports,
        }

    @staticmethod
    def rows(document: Document) -> list[Row]:
        """Table of the report: the scale of all supports, then the tolerance of each input."""
        largest, passed = document["kept"], document["passed"]  # without and with an exceedance
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
        """Titles of the columns; rows of the scale, then of the range of each input."""
        head: Row = ("quantity", "unit", "from", "to", "from in the case", "to in the case")
        head += ("most plausible", "nature")
        scale = (None, document["kept"], None, 1.0, None, document["nature"])
        rows: list[NumberRow] = [("scale of all ranges", "", *scale)]
        for name, support in document["supports"].items():
            unit, ends_in_case = of_storey_frame(name).unit, support["own"]
            ends = (None, None) if document["kept"] is None else support["kept"]
            rows.append((name, unit, *ends, *ends_in_case, support["modal"], document["nature"]))
        return head, rows

    @staticmethod
    def words(document: Document) -> str:
        """How to read the scale."""
        return (
            "All supports are scaled together about their modal values; 1 is the case as it stands."
            f" Scales up to {document['most']:g} were tried, each with an envelope of its own."
        )
