"""A finite-element model steered by a tolerance: refined until its estimated error is within."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from alphacut.rve.auto.model import ChoiceError
from alphacut.rve.cell import Phase
from alphacut.rve.result import Homogenised
from alphacut.rve.settings import require_accuracy
from alphacut.stochastic import RadiusMap

STEERED = ("prism", "slices")


@dataclass(frozen=True)
class RefinedModel:
    """The model `name`, refined until the estimated error of E is below `tolerance`.

    Args:
        name: prism or slices.
        tolerance: Relative error of E allowed, in [1e-10, 0.1].
        stiffness: Whether prisms are to make the whole plane stiffness; slices always do.

    Raises:
        ValueError: A value lies outside its range.
    """

    name: str
    tolerance: float
    stiffness: bool = False

    def __post_init__(self) -> None:
        if self.name not in STEERED:
            raise ValueError(f"model {self.name!r} cannot be refined; allowed: prism, slices")
        require_accuracy(self.tolerance, 1e-10, "tolerance on E")

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order, all within the tolerance.

        Raises:
            ChoiceError: The finest resolution leaves more.
        """
        from alphacut.rve.auto.refinement import refined_prism, refined_slices

        asked = (radius_map, matrix, inclusions)
        results = (
            refined_prism(*asked, tolerance=self.tolerance, stiffness=self.stiffness)
            if self.name == "prism"
            else refined_slices(*asked, tolerance=self.tolerance)
        )
        worst = max(result.estimated_error for result in results)
        if not worst <= self.tolerance:
            raise ChoiceError(
                f"method {self.name} reaches a relative error of {worst:.1e} in E,"
                f" {self.tolerance:.1e} is asked for; allow more, or take method auto"
            )
        return results
