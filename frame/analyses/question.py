"""A question: an analysis with its options, of which a case has a section."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Literal

if TYPE_CHECKING:  # a case reads the options, and computes nothing yet
    from alphacut.base.progress_bar import Progress
    from alphacut.frame.analyses.answer import Answer
    from alphacut.frame.analyses.incremental import Increments
    from alphacut.frame.analyses.peaks import Peaks
    from alphacut.frame.analyses.suites import ScaledRecord, SuitePeaks
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
        numbers: All parameters by name, crisp or fuzzy, in SI units.
        input_units: SI units of the inputs by name.
        records: The records of a suite that moves the structure.
        suite: Peaks under each of them.
        increments: Peaks over the scales of each by its name, of a frame that yields, where the
            question is that of fragility.
    """

    model: StructureModel
    inputs: Mapping[str, FuzzyNumber]
    alpha: tuple[float, ...]
    duration: float = 0.0
    step: float = 0.0
    peaks: Peaks | None = None
    numbers: Mapping[str, FuzzyNumber] = field(default_factory=dict)
    input_units: Mapping[str, str] = field(default_factory=dict)
    records: tuple[ScaledRecord, ...] = ()
    suite: SuitePeaks | None = None
    increments: Mapping[str, Increments] = field(default_factory=dict)


class Question(ABC):
    """An analysis with its options, which are the fields of a frozen dataclass derived from this.

    A section of a case is made from them: each field has a description below "Args:", quantities
    are ``Annotated[float, Quantity(…)]``, and fields with a `Limit` in their type are read as
    limits in [decision]. `limits` are those of the question, and `states` has those of events by
    their names. `random` has names of inputs. An analysis without a response has the fields
    `fuzzy`, the names of its fuzzy inputs, and `alpha`, the levels. An entry of
    `alphacut.case.analyses` makes it known. What fields forbid each other is refused by
    `__post_init__`.

    `reads_peaks`: the answer follows from the peaks of the outputs in `limits`.
    `needs_magnitudes`: each output has one limit, of its magnitude. `records`: whether a suite of
    records is refused beside it, allowed or needed; `all_angles`: whether their components may
    come from all angles. `of_learned_set`: whether inputs may be learned from a measurement.
    `replaced`: fields that one field replaces, by its name. `of_yielding`:
    fields that count where columns yield alone.
    """

    reads_peaks: ClassVar[bool] = False
    of_learned_set: ClassVar[bool] = True
    needs_magnitudes: ClassVar[bool] = False
    records: ClassVar[Literal["refused", "allowed", "needed"]] = "refused"
    all_angles: ClassVar[bool] = True
    replaced: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    of_yielding: ClassVar[tuple[str, ...]] = ()

    def require(self, model: StructureModel, components: int) -> None:  # noqa: B027
        """Refuse what the structure cannot answer, by the names of the fields.

        Args:
            model: The structure at its nominal values.
            components: Number of components of the records that will move it; 0 without records.
        """

    def require_computable(self, asked: Asked) -> None:  # noqa: B027 - most refuse nothing
        """Refuse what cannot be computed, by the names of the fields; peaks are not known yet."""

    @abstractmethod
    def answer(self, asked: Asked, progress: Progress) -> Answer:
        """Return the answer, calling `progress` with the completed fraction of the work."""

    def further(self, asked: Asked, found: Answer) -> dict[str, Callable[[Progress], Answer]]:
        """Return functions that compute what else follows from the answer, by its key."""
        return {}
