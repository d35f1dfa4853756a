"""Model `auto`: the cheapest model that reaches a tolerance, with its error and the reason.

Models are tried from the cheapest on: series, table, slices, prism. One that cannot reach the
tolerance says so itself, and the next is tried; every refusal is told in the result's reason.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from alphacut.rve.cell import Phase
from alphacut.rve.result import Homogenised
from alphacut.rve.settings import require_accuracy, require_parts
from alphacut.rve.spheres.series.model import SphereSeriesModel
from alphacut.rve.spheres.table.model import LEAST_ACCURACY, SphereTableModel
from alphacut.stochastic import RadiusMap

ORDER = ("series", "table", "slices", "prism")  # cheapest first
OF_SPHERES = ("series", "table")
STEERED = ("prism", "slices")  # models that a tolerance refines
TABLED = 0.9
"""Of the tolerance on E, for the moduli that a table of spheres holds; the rest is for θ."""
_MARGIN = 0.4  # of the tolerance, for the series at each θ and again for its rule in θ
_WHY = {
    "series": "exact for circles, a few small systems for each θ",
    "table": "planar cells over r and E_i once, every further map and modulus an evaluation",
    "slices": "planar cells at the nodes in θ",
    "prism": "the product-space problem itself, refined until E settles",
}


class ChoiceError(RuntimeError):
    """No model that is left reaches the tolerance."""


@dataclass(frozen=True)
class AutoModel:
    """The cheapest model that reaches `tolerance`.

    Args:
        tolerance: Error allowed, in [1e-10, 0.1]: relative for E, mean stresses and moduli of the
            plane, absolute for Poisson's ratio. Stress curves declare errors of their own.
        exclude: Names of models not to take, of series, table, slices, prism.
        cache: Folder where tables are kept; None keeps them in the process.
        moduli: Moduli of the particle that a table is to cover, in Pa, where further ones will be
            asked for; None: those of each call.
        progress: Called with the fraction done by models that take long.
        particles: "cylinders", or "spheres": series and table alone.

    Raises:
        ValueError: A value lies outside its range, or nothing is left to choose from.
    """

    tolerance: float = 1e-4
    exclude: tuple[str, ...] = ()
    cache: Path | None = None
    moduli: tuple[float, float] | None = None
    progress: Callable[[float], None] | None = None
    particles: str = "cylinders"
    name = "auto"

    def __post_init__(self) -> None:
        if not 1e-10 <= self.tolerance <= 0.1:
            raise ValueError(f"the tolerance is {self.tolerance:g}; it must lie in [1e-10, 0.1]")
        known = ", ".join(self._order)
        unknown = [name for name in self.exclude if name not in self._order]
        if unknown:
            raise ValueError(f"auto is told to exclude {unknown[0]!r}; known models are {known}")
        if not set(self._order) - set(self.exclude):
            raise ValueError(f"auto is told to exclude every model; leave one of {known}")

    @property
    def _order(self) -> tuple[str, ...]:
        return OF_SPHERES if self.particles == "spheres" else ORDER

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order, within the tolerance.

        Raises:
            ChoiceError: No model left reaches the tolerance.
        """
        require_parts(radius_map, matrix, inclusions)
        if not inclusions:
            return []
        refusals: list[str] = []
        for name in self._order:
            if name in self.exclude:
                refusals.append(f"{name} excluded")
                continue
            try:
                results = self._take(name, radius_map, matrix, inclusions)
            except RuntimeError as refusal:
                refusals.append(f"{name} refused: {refusal}")
                continue
            return [replace(r, reason=self._reason(r, refusals)) for r in results]
        raise ChoiceError(
            f"no model reaches a relative error of {self.tolerance:g}: {'; '.join(refusals)}"
        )

    def _take(
        self, name: str, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """Results of one model at the resolution that the tolerance asks for."""
        results: Sequence[Homogenised]
        if self.particles == "spheres":
            results = self._of_spheres(name).solve(radius_map, matrix, inclusions)
        elif name == "series":
            from alphacut.rve.series.model import SeriesModel

            results = SeriesModel(accuracy=max(_MARGIN * self.tolerance, 1e-12)).solve(
                radius_map, matrix, inclusions
            )
        elif name == "table":
            from alphacut.rve.table.model import TableModel

            model = TableModel(
                self.tolerance, self.cache, moduli=self.moduli, progress=self.progress
            )
            results = model.solve(radius_map, matrix, inclusions)
        elif name == "slices":
            from alphacut.rve.auto.refinement import refined_slices

            results = refined_slices(
                radius_map, matrix, inclusions, tolerance=self.tolerance, progress=self.progress
            )
        else:
            from alphacut.rve.auto.refinement import refined_prism

            results = refined_prism(radius_map, matrix, inclusions, tolerance=self.tolerance)
        worst = max(r.largest_error for r in results)
        if not worst <= self.tolerance:
            raise ChoiceError(f"its declared error is {worst:.1e}")
        return list(results)

    def _of_spheres(self, name: str) -> SphereSeriesModel | SphereTableModel:
        """Model of spheres for the tolerance."""
        if name == "series":
            return SphereSeriesModel(accuracy=max(_MARGIN * self.tolerance, 1e-11))
        if (accuracy := TABLED * self.tolerance) < LEAST_ACCURACY:
            raise ChoiceError(f"tables of spheres end at an accuracy of {LEAST_ACCURACY:g}")
        return SphereTableModel(accuracy, self.cache, self.moduli)

    def _reason(self, result: Homogenised, refusals: list[str]) -> str:
        before = f" ({'; '.join(refusals)})" if refusals else ""
        return (
            f"{result.method} reaches a relative error of {self.tolerance:g} in E, stresses and"
            f" stiffness{before}:"
            f" {_WHY[result.method]}; {result.reason}"
        )


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
