"""Tolerances: the largest scale of all supports at which no limit is exceeded."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from alphacut.case.types import Quantity
from alphacut.figures import style
from alphacut.figures.style import BLUE, GREY, INK
from alphacut.frame.boxes import boxes
from alphacut.frame.propagation import require_admissible
from alphacut.frame.questions.tolerances import scaled, tolerances
from alphacut.frame.structures.quantities import of_storey_frame
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Nature, rounded
from alphacut.io.files import Document
from alphacut.io.quantity import engineering
from alphacut.questions.question import Motion, Question, Row, peak_document
from alphacut.stages.envelope import PEAK_ERROR

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _row(name: str, one: Document, document: Document) -> Row:
    modal, share = one["modal"], [end / one["modal"] - 1 for end in one["kept"] if one["modal"]]
    ends = ", ".join(f"{end:+.2%}".replace("-", "−") for end in share) or f"about {modal:g}"
    both = zip(one["kept"], ("lower", "upper"), strict=True)
    inside = (rounded(end, side, Nature.ATTAINED) for end, side in both)
    own = " … ".join(engineering(end, of_storey_frame(name).unit) for end in inside)
    kept = "–" if document["kept"] is None else own
    return f"tolerance of {name}", kept, document["nature"], ends if kept != "–" else ""


class TolerancesSection(Question):
    """Largest scale of the supports of the fuzzy inputs at which no limit is exceeded."""

    key = "tolerances"
    title = "How far may tolerances go?"
    caption = "Supports of the inputs in the case, and at the scale that exceeds no limit"
    reads_peaks = True
    head = ("quantity", "no limit exceeded", "nature", "limit exceeded, or relative")

    most: Annotated[float, Quantity(above=0, most=100)] = Field(
        default=2.0, description="largest scale that is tried; 1 is that of the case"
    )

    def require_answerable(self, motion: Motion) -> None:
        """Refuses scales at which inputs reach values that have no meaning.

        Raises:
            RefusedError: They do at the largest scale.
        """
        super().require_answerable(motion)
        try:
            widest = boxes(scaled(motion.inputs, self.most), [0.0])
            require_admissible(motion.structure.model, widest)
        except RefusedError as error:
            what, cure = f"{self.most:g} times the supports: {error.key}", "a smaller scale"
            value = f"{what} is {error.value}"
            raise RefusedError("tolerances.most", value, error.allowed, cure) from None

    def answer(self, motion: Motion) -> Document:
        """Scales at which no limit and one is exceeded, and the supports at the first."""
        assert motion.peaks is not None
        limits = self.in_si(motion.structure)
        scale = tolerances(
            motion.structure.observing("tolerances.limits", tuple(limits)),
            motion.inputs,
            limits,
            duration=motion.duration,
            step=motion.step,
            most=self.most,
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
            "kept": scale.kept,
            "clear": scale.clear,
            "passed": scale.passed if math.isfinite(scale.passed) else None,
            "most": self.most,
            "nature": str(scale.nature),
            "envelopes": scale.envelopes,
            "step": motion.step,
            "supports": supports,
        }

    @staticmethod
    def rows(document: Document) -> list[Row]:
        """The scale, then each input's tolerance."""
        kept, passed = document["kept"], document["passed"]
        scale = "none" if kept is None else f"up to {rounded(kept, 'upper', Nature.ATTAINED):.4g}"
        beyond = f"exceeded at {passed:.4g}" if passed is not None else "none is exceeded"
        if passed is not None and document["clear"] is not None:
            beyond = f"none seen up to {document['clear']:.4g}, {beyond}"
        head = ("scale of all tolerances", f"{scale}, {beyond}", document["nature"], "")
        return [head, *(_row(name, one, document) for name, one in document["supports"].items())]

    @staticmethod
    def words(document: Document) -> str:
        """How to read the scale."""
        return (
            "All supports are scaled together about their modal values; 1 is the case as it stands."
            f" Scales up to {document['most']:g} were tried, each with an envelope of its own."
        )

    @staticmethod
    def figure(document: Document) -> Figure:
        """Supports of the case and at the scale that exceeds no limit, over their modal values."""
        each = document["supports"]
        drawn, axes = style.figure(7.2, 1.0 + 0.4 * len(each))
        places = np.arange(len(each))[::-1]
        series = (("own", GREY, 0.7, "in the case"), ("kept", BLUE, 0.35, "no limit exceeded"))
        for kind, colour, height, label in series:
            ends = np.array(
                [np.asarray(one[kind]) / (one["modal"] or 1.0) for one in each.values()]
            )
            wide = ends[:, 1] - ends[:, 0]
            axes.barh(places, wide, left=ends[:, 0], height=height, color=colour, lw=0, label=label)
        axes.axvline(1.0, color=INK, lw=0.8)
        axes.set_yticks(places, list(each))
        axes.set_xlabel("value over the modal one")
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return drawn
