"""What a method of computing envelopes says of itself, and the register of all methods.

A new method is a class in a file of its own, and one entry in `MethodClasses.PLACES`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from alphacut.base.progress_bar import Progress
    from alphacut.frame.boxes import Boxes, UnitFlow
    from alphacut.frame.dynamics.flow import Flow
    from alphacut.frame.result import Envelope


@dataclass(frozen=True)
class Method:
    """How an envelope is computed; a frozen dataclass with the options as its fields."""

    name: ClassVar[str]
    """Word for the method in cases."""
    takes_kinks: ClassVar[bool] = False
    """Whether columns may yield: the response then has kinks as a function of the inputs."""
    is_exact: ClassVar[bool] = False
    """Whether its bounds are those of the exact response, which is the default integrator then."""
    tolerance_is_gain: ClassVar[bool] = False
    """Whether `tolerance` is the smallest gain that is worth a trajectory, and no largest error."""

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the envelope of all outputs on all levels.

        Args:
            flow: The response over the boxes of the inputs.
            progress: Called with the completed fraction.
        """
        raise NotImplementedError  # each method has its own

    def require_possible(self, flow: Flow, boxes: Boxes) -> None:
        """Refuse what cannot be computed, as far as this is known without computing it.

        Args:
            flow: The response.
            boxes: Boxes of its inputs; the widest one counts.

        Raises:
            UnprovedError: The method is a proof, and there is none for such a structure.
        """


class MethodClasses(Mapping[str, "type[Method]"]):
    """Classes of methods by name, each imported when it is looked up: the proofs take .05 s."""

    PLACES: ClassVar = {
        "auto": "auto:Auto",
        "proof": "proof:Proof",
        "dual": "dual:DualProof",
        "graph-follower": "graph_follower:GraphFollower",
        "improved-graph-follower": "improved_follower:ImprovedFollower",
        "quasi-monte-carlo": "sampled:Sampled",
    }
    """Module in `alphacut.frame.methods` and class of each method."""

    def __getitem__(self, name: str) -> type[Method]:
        """Return the class of a method."""
        found: type[Method] = resolve_name(f"alphacut.frame.methods.{self.PLACES[name]}")
        return found

    def __iter__(self) -> Iterator[str]:
        """Return an iterator over the names."""
        return iter(self.PLACES)

    def __len__(self) -> int:
        """Return the number of methods."""
        return len(self.PLACES)


METHODS = MethodClasses()
"""The methods by the words that a case file has for them."""
