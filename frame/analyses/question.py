"""A question: an analysis with its options, of which a case has a section."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

if TYPE_CHECKING:  # a case reads the options, and computes nothing yet
    from alphacut.base.progress_bar import Progress
    from alphacut.frame.analyses.answer import Answer
    from alphacut.frame.analyses.peaks import Peaks
    from alphacut.frame.structures.model import StructureModel
    from alphacut.fuzzy import FuzzyNumber


@dataclass(frozen=True)
class Asked:
    """What a question is asked about.

    Args:
        model: The structure at its nominal values.
        inputs: Fuzzy parameters by name, in SI units.
        alpha: α-levels, rising.
        duration: Length of the response in s; 0 for a structure at rest.
        step: Distance of its time nodes in s; 0 for a structure at rest.
        peaks: Peaks of the response over time by name, where they are known.
    """

    model: StructureModel
    inputs: Mapping[str, FuzzyNumber]
    alpha: tuple[float, ...]
    duration: float = 0.0
    step: float = 0.0
    peaks: Peaks | None = None


class Question(ABC):
    """An analysis with its options, which are the fields of a frozen dataclass derived from this.

    A section of a case is made from them: each field has a description below "Args:", quantities
    are ``Annotated[float, Quantity(…)]``, and a field `limits` of type ``tuple[Limit, ...]`` is
    read as in [decision]. An analysis without a response has the fields `fuzzy`, the names of its
    fuzzy inputs, and `alpha`, the levels. An entry of `alphacut.case.analyses` makes it known.

    `reads_peaks`: the answer follows from the peaks of the outputs in `limits`.
    `needs_magnitudes`: each output has one limit, of its magnitude. `records`: whether a suite of
    records is refused beside it, or allowed.
    """

    reads_peaks: ClassVar[bool] = False
    needs_magnitudes: ClassVar[bool] = False
    records: ClassVar[Literal["refused", "allowed", "needed"]] = "refused"

    def require(self, model: StructureModel) -> None:  # noqa: B027 - most refuse nothing
        """Refuse what the structure cannot answer, by the names of the fields."""

    def require_computable(self, asked: Asked) -> None:  # noqa: B027 - most refuse nothing
        """Refuse what cannot be computed, by the names of the fields; peaks are not known yet."""

    @abstractmethod
    def answer(self, asked: Asked, progress: Progress) -> Answer:
        """Return the answer, calling `progress` with the completed fraction of the work."""
